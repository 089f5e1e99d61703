"""A run's state in one file, which is written whole or not at all."""

import json
import pathlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from fetch_composer.explorer import files

FILE_NAME = 'checkpoint.npz'
_RUN = 'run'
_WHAT_TO_DO = 'remove it to begin again, or give another --output_dir.'


def save(folder: pathlib.Path, run: Mapping[str, Any], state: Mapping[str, np.ndarray]) -> None:
    """Writes a checkpoint.

    Args:
        folder: Where to.
        run: What the run was asked to do, fit for JSON.
        state: Arrays that decide on what follows.
    """
    files.save_arrays(folder / FILE_NAME, {**state, _RUN: np.array(json.dumps(run))})


def load(folder: pathlib.Path, run: Mapping[str, Any]) -> dict[str, np.ndarray] | None:
    """Returns the state of the checkpoint in a folder; None if there is no checkpoint.

    Raises:
        ValueError: if it is of a run that was asked to do something else, or cannot be read; the
            message says what differs.
    """
    path = folder / FILE_NAME
    if not path.exists():
        return None
    try:
        state = files.load_arrays(path)
        found = json.loads(str(state.pop(_RUN)))
    except files.UnreadableError as error:
        raise ValueError(f'{error}; {_WHAT_TO_DO}') from None
    except (ValueError, KeyError):
        raise ValueError(f'{path} is no checkpoint; {_WHAT_TO_DO}') from None
    differences = _differences(found, run)
    if differences:
        raise ValueError(
            f'{folder} holds another run ({"; ".join(differences)}); give another --output_dir.'
        )
    return state


def _differences(found: Mapping[str, Any], asked: Mapping[str, Any], name: str = '') -> list[str]:
    """Returns what differs, each as `name: there this, here that`."""
    differences = []
    for key in [*asked, *(key for key in found if key not in asked)]:
        there, here = found.get(key), asked.get(key)
        if isinstance(there, dict) and isinstance(here, dict):
            differences += _differences(there, here, f'{key} ')
        elif there != here:
            differences.append(f'{name}{key}: there {there}, here {here}')
    return differences
