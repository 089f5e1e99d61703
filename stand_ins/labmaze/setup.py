"""Stands in for labmaze on Python 3.13, for which it has no wheel.

dm_control requires it for its locomotion mazes; nothing in fetch_composer imports it. Install it
beside fetch_composer: `pip install . ./stand_ins/labmaze`.
"""

import setuptools

setuptools.setup(name='labmaze', version='1.0.6', py_modules=[])
