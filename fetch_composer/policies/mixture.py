"""Mixtures: one policy plays an episode, another one the next, by given shares.

The name of a mixture has its policies and their shares: `expert:0.7,random:0.3`.
"""

import itertools
import math
import re
from collections.abc import Mapping

from fetch_composer.policies import streams

_PART = re.compile(r'(?P<policy>.+):(?P<share>[\d.][\d.eE+-]*)')
_TOLERANCE = 1e-9


def shares(name: str) -> dict[str, float]:
    """Returns the share of each policy of a mixture by name; none if it is no name of one.

    Raises:
        ValueError: if shares are not positive or do not add up to 1, or a policy is named twice.
    """
    matches = [_PART.fullmatch(each.strip()) for each in name.split(',')]
    found = [(each['policy'], _number(each['share'])) for each in matches if each is not None]
    if len(found) < len(matches):
        return {}
    if min(share for _, share in found) <= 0 or not math.isclose(
        sum(share for _, share in found), 1, abs_tol=_TOLERANCE
    ):
        raise ValueError(f'The shares of a mixture are positive and add up to 1; got {name!r}.')
    if len(dict(found)) < len(found):
        raise ValueError(f'A mixture names each of its policies once; got {name!r}.')
    return dict(found)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def joined(of_policies: Mapping[str, float]) -> str:
    """Returns the name of a mixture."""
    return ','.join(f'{policy}:{share!r}' for policy, share in of_policies.items())


def drawn(of_policies: Mapping[str, float], seed: int | None) -> str:
    """Returns the policy that plays the episode of a seed."""
    draw = streams.generator(seed, streams.MIXTURE).random()
    ends = itertools.accumulate(of_policies.values())
    names = list(of_policies)
    return next((name for name, end in zip(names, ends, strict=True) if draw < end), names[-1])
