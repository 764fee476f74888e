"""By how much a scan's readings may be off: scatter from point to point, which it shows, and the receiver's ripple, smooth along frequency."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import median_filter

from motoremi.arrays import FloatArray

# Scatter is the middle of so many points. Lines of a comb look like scatter too: no real one is larger than the second figure.
_WINDOW = 61
_LEAST_DB, _MOST_DB = 0.1, 1.2
# Knots of the ripple along ln f. Flatness of a receiver within its specification; what the formula of one detector leaves besides.
_KNOT_SPACING = 0.55
RIPPLE_DB, OWN_RIPPLE_DB = 0.5, 0.2


def scatter_db(level_dbuv: FloatArray) -> FloatArray:
    """Standard deviation of each reading, from how far its neighbours' readings lie beside the straight line through them.

    Parameters
    ----------
    level_dbuv : ndarray, shape (n,)
        One scan.

    Returns
    -------
    ndarray, shape (n,)
    """
    if level_dbuv.size < 5:
        return np.full(level_dbuv.shape, _MOST_DB)
    beside = np.abs(level_dbuv[1:-1] - 0.5 * (level_dbuv[:-2] + level_dbuv[2:])) / np.sqrt(1.5)
    # The middle of a normal distribution's absolute values is at 0.6745 standard deviations.
    middle = median_filter(np.pad(beside, 1, mode="edge"), size=min(_WINDOW, level_dbuv.size), mode="reflect") / 0.6745
    return np.clip(middle, _LEAST_DB, _MOST_DB)


def even_steps(frequency_hz: FloatArray) -> tuple[FloatArray, float]:
    """Frequencies in equal steps over a scan, and the step, in Hz: points that were left out, overloaded ones for example, can be bridged."""
    step_hz = float(np.median(np.diff(frequency_hz)))
    return np.arange(frequency_hz[0], frequency_hz[-1], step_hz), step_hz


def ripple_columns(frequency_hz: FloatArray, detectors: int) -> FloatArray:
    """What the readings of all detectors may be off by, smoothly along frequency, for unknowns of standard deviation 1.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
    detectors : int

    Returns
    -------
    ndarray, shape (detectors * n, m)
        In dB: the ripple that all detectors share, then what each has of its own.
    """
    place = np.log(frequency_hz)
    knots = np.linspace(place[0], place[-1], max(3, round((place[-1] - place[0]) / _KNOT_SPACING) + 1))
    shapes = CubicSpline(knots, np.eye(knots.size))(place)
    return np.hstack([RIPPLE_DB * np.tile(shapes, (detectors, 1)), OWN_RIPPLE_DB * np.kron(np.eye(detectors), shapes)])
