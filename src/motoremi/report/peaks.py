"""Clear maxima of a curve."""

from __future__ import annotations

import numpy as np

from motoremi.arrays import FloatArray


def clear_maxima(level: FloatArray, prominence: float) -> list[tuple[int, float]]:
    """Index and prominence of each maximum with at least the given prominence; the middle one of equal points.

    The same as `scipy.signal.find_peaks`, whose import alone takes a fifth of the time of a report.

    Parameters
    ----------
    level : array, shape (n,)
    prominence : float
        How far the curve falls on both sides before it rises above the maximum or ends; in the unit of `level`.
    """
    edges = np.flatnonzero(np.diff(level)) + 1
    first, last = np.append(0, edges), np.append(edges, level.size) - 1
    run = level[first]
    tops = 1 + np.flatnonzero((run[1:-1] > run[:-2]) & (run[1:-1] > run[2:]))
    found = [(int(at), _stands_out(level, at)) for at in (first[tops] + last[tops]) // 2]
    return [(at, stands_out) for at, stands_out in found if stands_out >= prominence]


def _stands_out(level: FloatArray, at: int) -> float:
    higher = np.flatnonzero(level > level[at])
    after = int(np.searchsorted(higher, at))
    left = higher[after - 1] if after else 0
    right = higher[after] if after < higher.size else level.size
    return float(level[at] - max(level[left : at + 1].min(), level[at:right].min()))
