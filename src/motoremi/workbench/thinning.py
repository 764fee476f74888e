"""Thins long curves for plots: no more points than can be seen, with every peak and dip kept."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from motoremi.arrays import FloatArray

# Curves of up to WHOLE points are sent complete; longer ones in CELLS, each with its first point and the extremes of every curve.
WHOLE = 2000
CELLS = 700
# The span that is shown.
Band: TypeAlias = tuple[float, float]


def seen(frequency_hz: FloatArray, *curves: FloatArray, band_hz: Band | None = None) -> NDArray[np.intp]:
    """Indices of the points that a plot over log frequency shows.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
        Increasing.
    curves : ndarray, shape (n,)
        The curves that are drawn; non-finite points are ignored.
    band_hz : tuple of float, optional
        The span that the plot is zoomed to: its points are thinned separately and added to those of the whole span.

    Returns
    -------
    ndarray of int
        Increasing, first and last point included.
    """
    kept = _thinned(frequency_hz, curves)
    if band_hz is None or len(kept) == len(frequency_hz):
        return kept
    # One more point on each side, so that curves reach the edges of the plot.
    first, last = np.searchsorted(frequency_hz, band_hz)
    begin, end = max(int(first) - 1, 0), int(last) + 1
    if begin >= len(frequency_hz) or end - begin < 2:
        return kept
    own = begin + _thinned(frequency_hz[begin:end], [curve[begin:end] for curve in curves])
    return np.union1d(kept, own)


def _thinned(frequency_hz: FloatArray, curves: Sequence[FloatArray]) -> NDArray[np.intp]:
    count = len(frequency_hz)
    if count <= WHOLE:
        return np.arange(count)
    position = np.log(frequency_hz / frequency_hz[0])
    cell = np.minimum((CELLS * position / position[-1]).astype(np.intp), CELLS - 1)
    begins = np.flatnonzero(np.diff(cell, prepend=-1))
    kept = [begins, np.array([count - 1])]
    for curve in curves:
        for sign in (1.0, -1.0):
            values = np.where(np.isfinite(curve), sign * curve, -np.inf)
            # Sorted by cell, then by value: the last point of each cell is its highest.
            order = np.lexsort((values, cell))
            kept.append(order[np.append(begins[1:], count) - 1])
    return np.unique(np.concatenate(kept))
