"""Uncertainty of the readings of a scan: scatter from point to point, estimated from the scan, and the receiver's ripple along frequency."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import median_filter

from motoremi.arrays import FloatArray

# Number of points of the running median: 0.3 MHz of a usual scan, less than an octave of it, so that the scatter may change along the scan.
_WINDOW = 61
# Range of scatter (estimates): from the resolution of readings to what peaks scatter by; lines of a comb look like a larger scatter.
_LEAST_DB, _MOST_DB = 0.1, 1.2
# Distance of the knots of the ripple in ln f (eleven in a scan of band B); ripple of a receiver within its specification; further ripple of each
# detector's formula. Estimates.
_KNOT_SPACING = 0.55
RIPPLE_DB, OWN_RIPPLE_DB = 0.5, 0.2


def scatter_db(level_dbuv: FloatArray) -> FloatArray:
    """Standard deviation of each reading, from the deviations of nearby readings from the mean of their two neighbours.

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
    # The median of the absolute values of a normal distribution is 0.6745 standard deviations.
    middle = median_filter(np.pad(beside, 1, mode="edge"), size=min(_WINDOW, level_dbuv.size), mode="reflect") / 0.6745
    return np.clip(middle, _LEAST_DB, _MOST_DB)


def even_steps(frequency_hz: FloatArray) -> tuple[FloatArray, float]:
    """Frequencies in equal steps over a scan, and the step, in Hz, to interpolate over points that were left out (overloaded, for example)."""
    step_hz = float(np.median(np.diff(frequency_hz)))
    return np.arange(frequency_hz[0], frequency_hz[-1], step_hz), step_hz


def ripple_columns(frequency_hz: FloatArray, detectors: int) -> FloatArray:
    """Smooth errors of the readings of all detectors: columns for unknowns of standard deviation 1.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
    detectors : int

    Returns
    -------
    ndarray, shape (detectors * n, m)
        In dB: the ripple that all detectors have in common, then that of each detector.
    """
    place = np.log(frequency_hz)
    knots = np.linspace(place[0], place[-1], max(3, round((place[-1] - place[0]) / _KNOT_SPACING) + 1))
    shapes = CubicSpline(knots, np.eye(knots.size))(place)
    return np.hstack([RIPPLE_DB * np.tile(shapes, (detectors, 1)), OWN_RIPPLE_DB * np.kron(np.eye(detectors), shapes)])
