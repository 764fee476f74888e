"""Long curves as a plot needs them: no more points than can be seen, and every peak and dip among them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from motoremi.arrays import FloatArray

# Up to so many points a curve is sent whole; of a longer one this many cells, each with its first point and the extremes of every curve.
WHOLE = 2000
CELLS = 700
# The part of the span that is shown.
Band: TypeAlias = tuple[float, float]


def seen(frequency_hz: FloatArray, *curves: FloatArray, band_hz: Band | None = None) -> NDArray[np.intp]:
    """Indices of the points that a plot over log frequency shows.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
        Increasing.
    curves : ndarray, shape (n,)
        What is drawn; points that are not finite are passed over.
    band_hz : tuple of float, optional
        What the plot is zoomed to: its points are thinned by themselves, beside those of the whole span.

    Returns
    -------
    ndarray of int
        Increasing, first and last point included.
    """
    kept = _thinned(frequency_hz, curves)
    if band_hz is None or len(kept) == len(frequency_hz):
        return kept
    # One more on each side: curves go on to the edge of the plot.
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
            # By cell, then by value: the last of each cell is its highest.
            order = np.lexsort((values, cell))
            kept.append(order[np.append(begins[1:], count) - 1])
    return np.unique(np.concatenate(kept))
