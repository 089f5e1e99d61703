"""Composer entities from which the Fetch tasks are assembled."""

from fetch_composer.entities.arena import Arena
from fetch_composer.entities.block import Block
from fetch_composer.entities.fetch import ARM_JOINTS, FetchArm, FetchGripper
from fetch_composer.entities.mocap import Mocap
from fetch_composer.entities.obstacle import Obstacle
from fetch_composer.entities.table import Table
from fetch_composer.entities.target import ACHIEVED_RGBA, Target

__all__ = (
    'ACHIEVED_RGBA',
    'ARM_JOINTS',
    'Arena',
    'Block',
    'FetchArm',
    'FetchGripper',
    'Mocap',
    'Obstacle',
    'Table',
    'Target',
)
