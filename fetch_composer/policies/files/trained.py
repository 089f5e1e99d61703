"""Where the policies are that come with the package: networks that were trained on its tasks."""

import pathlib

from fetch_composer.policies.protocol import PolicyContext

_FOLDER = pathlib.Path(__file__).parents[1] / 'trained'
_SUFFIX = '.onnx'


def path(context: PolicyContext) -> str:
    """Returns the ONNX file of a trained policy.

    Args:
        context: Its task and convention tell which.

    Raises:
        ValueError: if there is none; the message lists those that there are.
    """
    found = _FOLDER / f'{context.task_name}_{context.convention}{_SUFFIX}'
    if found.is_file():
        return str(found)
    there = ', '.join(sorted(each.stem for each in _FOLDER.glob(f'*{_SUFFIX}')))
    raise ValueError(
        f'There is no trained policy for {found.stem}; there is {there or "none for any task"}.'
    )
