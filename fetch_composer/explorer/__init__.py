"""Runs policies without a display, and shows what happened: `python -m fetch_composer.explorer`.

`evaluate` says how well a policy does, also while it is trained, and needs no extra. The rest needs
the extra `explore`. Nothing in the package below imports this.
"""

from fetch_composer.explorer.episodes.seeds import STANDARD as STANDARD_SEEDS
from fetch_composer.explorer.results.evaluation import Evaluation, evaluate

__all__ = ('STANDARD_SEEDS', 'Evaluation', 'evaluate')
