"""Whether a model has been changed since it was compiled."""

import numpy as np
from dm_control import mjcf


def fingerprint(root: mjcf.RootElement) -> int:
    """Returns a number that changes if any attribute of any element of a model does.

    It is good within one process, and takes a twentieth of the time of a compilation.
    """
    found: list = []

    def visit(element: mjcf.Element) -> None:
        for name, value in element.get_attributes().items():
            if isinstance(value, np.ndarray):
                value = value.tobytes()
            elif not isinstance(value, (str, int, float)):
                value = id(value)  # A reference to another element.
            found.append((element.tag, name, value))
        for child in element.all_children():
            visit(child)

    visit(root)
    return hash(tuple(found))
