"""Single values of one name that contradict each other."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from motoremi.data.conditions import SingleValue
from motoremi.quantities import show

# Two values disagree if they differ by more than this share of the larger one, which no drift of a motor at rest explains (copper changes by 4 %
# for 10 K), and by more than so many standard deviations of their difference.
LEAST_SHARE, LEAST_SIGMA = 0.1, 5.0
REMEDY = "withdraw the wrong one: motoremi withdraw SESSION NAME-2 for the second that was given"


def disagreements(values: Sequence[SingleValue]) -> list[str]:
    """The pairs of values of one name that cannot both be right, each in a sentence."""
    found = []
    for one, other in combinations(values, 2):
        apart = abs(one.value_si - other.value_si)
        sigma = float(np.hypot(one.sigma, other.sigma))
        if one.name == other.name and apart > max(LEAST_SHARE * max(abs(one.value_si), abs(other.value_si)), LEAST_SIGMA * sigma):
            shown = f"{one.name} was measured as {show(one.value_si, one.unit)} and as {show(other.value_si, other.unit)}"
            found.append(f"{shown}, {apart / sigma:.0f} standard deviations apart" if sigma else shown)
    return found
