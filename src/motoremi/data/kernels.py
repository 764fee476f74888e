"""Random functions that are smooth along frequency, each as a few columns; logarithm, smoothing and slope of a sweep.

The functions are Matern 3/2 processes over log10 of frequency: continuous with kinks, like an error that is interpolated between the points
of a calibration (Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, eq. 4.17).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from scipy.ndimage import uniform_filter1d

from motoremi.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from motoremi.threads import one_blas_thread

# (share of the variance, correlation length in decades) of each process.
Parts = Sequence[tuple[float, float]]
# Knots per length of the shortest part; between them the columns are straight lines (a test compares them with the kernel).
KNOTS_PER_LENGTH = 4
# Modes below this share of the largest variance are rounding errors.
LEAST_VARIANCE = 1e-6
# Number of points over which a sweep is smoothed; it reduces white noise to a quarter.
SMOOTHED_POINTS = 15
# Numbers of points through which a parabola is laid: it leaves a seventh, a quarter or a half of the noise's variance.
PARABOLAS = (15, 9, 5)
# Acceptable error of d ln Z / d ln f. An inductance has a slope of 1, a resonance a slope of about its quality factor.
SLOPE_ERROR = 0.3


def matern(one: FloatArray, other: FloatArray, length: float) -> FloatArray:
    """Correlation between positions, shape (n, m); positions and length in the same unit."""
    distance = np.sqrt(3) * np.abs(one[:, None] - other[None, :]) / length
    return (1 + distance) * np.exp(-distance)


def smooth_basis(frequency_hz: FloatArray, parts: Parts) -> FloatArray:
    """Columns B, shape (n, q), such that B c with independent standard normal c is a draw of a sum of smooth processes.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
        In any order.
    parts : sequence of (share, length)
        Share of the variance and length in decades of each process.
    """
    return _smooth_basis(np.asarray(frequency_hz, dtype=np.float64).tobytes(), tuple(parts))


# The noise of one sweep needs the same few columns some ten times, and the other sweeps of a motor mostly have the same frequencies.
@lru_cache(maxsize=8)
@one_blas_thread
def _smooth_basis(frequencies: bytes, parts: tuple[tuple[float, float], ...]) -> FloatArray:
    place = np.log10(np.frombuffer(frequencies))
    span = float(np.ptp(place))
    shortest = min(length for _, length in parts)
    knots = place.min() + np.linspace(0.0, span, max(4, int(np.ceil(KNOTS_PER_LENGTH * span / shortest)) + 1))
    covariance = sum(share * matern(knots, knots, length) for share, length in parts)
    variances, vectors = np.linalg.eigh(np.asarray(covariance))
    keep = variances > LEAST_VARIANCE * variances[-1]
    modes = vectors[:, keep] * np.sqrt(variances[keep])
    step = span / (knots.size - 1)
    at = np.clip(((place - knots[0]) / step).astype(np.intp), 0, knots.size - 2)
    share = ((place - knots[at]) / step)[:, None]
    columns: FloatArray = (1 - share) * modes[at] + share * modes[at + 1]
    columns.flags.writeable = False
    return columns


def logarithm(impedance_ohm: ComplexArray) -> ComplexArray:
    """ln Z along a sweep, with unwrapped phase."""
    return np.log(np.abs(impedance_ohm)) + 1j * np.unwrap(np.angle(impedance_ohm))


def interpolated(frequency_hz: FloatArray, impedance_ohm: ComplexArray, wanted_hz: FloatArray) -> ComplexArray:
    """A sweep at other frequencies: ln Z is straight over ln f between its points."""
    return np.exp(np.interp(np.log(wanted_hz), np.log(frequency_hz), logarithm(impedance_ohm)))


def steps_beside(frequency_hz: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Distance of each point from the one before and from the one after it; of an end point from its only neighbour, twice."""
    steps = np.diff(frequency_hz)
    return np.concatenate([steps[:1], steps]), np.concatenate([steps, steps[-1:]])


def nearest_points(frequency_hz: FloatArray, wanted_hz: FloatArray) -> IntArray:
    """Index of the nearest of rising frequencies to each wanted one."""
    return np.searchsorted((frequency_hz[1:] + frequency_hz[:-1]) / 2, wanted_hz)


def within_half_a_step(frequency_hz: FloatArray, wanted_hz: FloatArray) -> tuple[IntArray, BoolArray]:
    """Index of the nearest of two or more rising frequencies to each wanted one, and whether it is no more than half of its step away."""
    nearest = nearest_points(frequency_hz, wanted_hz)
    reach = np.maximum(*steps_beside(frequency_hz)) / 2
    return nearest, np.abs(frequency_hz[nearest] - wanted_hz) <= reach[nearest] * (1 + 1e-9)  # beyond rounding


def smoothed(impedance_ohm: ComplexArray) -> ComplexArray:
    """A sweep with most of its white noise removed, and the sharpest of its resonances lowered."""
    if impedance_ohm.size < 2 * SMOOTHED_POINTS:
        return impedance_ohm
    values = logarithm(impedance_ohm)
    return np.exp(_mean(values.real, SMOOTHED_POINTS) + 1j * _mean(values.imag, SMOOTHED_POINTS))


def by_parabolas(values: ComplexArray, sigma: FloatArray) -> ComplexArray:
    """Values along a sweep, each from the parabola through its neighbours (Savitzky and Golay, Analytical Chemistry 36, 1964).

    The widest of `PARABOLAS` is used from which all values differ by no more than their white noise `sigma`, which keeps resonances that are
    sharper than the sweep is dense.
    """
    # Of n complex values with this noise, none exceeds the limit in all but one of e^5 sweeps.
    limit = np.sqrt(2 * (np.log(values.size) + 5)) * sigma
    for width in PARABOLAS:
        if values.size >= 2 * width:
            smooth = _parabolas(values, width)
            if np.all(np.abs(values - smooth) < limit):
                return smooth
    return values


def _parabolas(values: ComplexArray, width: int) -> ComplexArray:
    powers = np.vander(np.linspace(-1, 1, width), 3)
    fitted, half = powers @ np.linalg.pinv(powers), width // 2
    # Those at the ends are on the parabola of the first or of the last points.
    inside = np.convolve(values, fitted[half], "valid")
    return np.concatenate([fitted[:half] @ values[:width], inside, fitted[half + 1 :] @ values[-width:]])


def _mean(values: FloatArray, width: int) -> FloatArray:
    """Running mean of the deviation from the straight line between the ends, so that a slope does not shift the ends."""
    line = np.linspace(values[0], values[-1], values.size)
    return line + uniform_filter1d(values - line, width, mode="nearest")


def slope(frequency_hz: FloatArray, impedance_ohm: ComplexArray, sigma: float) -> ComplexArray:
    """d ln Z / d ln f along a sweep, averaged over no more points than its noise requires, to keep the slopes of sharp resonances.

    Parameters
    ----------
    sigma : float
        White noise of ln Z.
    """
    step = float(np.median(np.diff(np.log(frequency_hz))))
    # The slope over w points has a standard deviation of about sigma / (step w^1.5).
    width = int(np.ceil((sigma / (SLOPE_ERROR * step)) ** (2 / 3)))
    values = logarithm(impedance_ohm)
    if width > 1:
        width = min(width | 1, SMOOTHED_POINTS, impedance_ohm.size // 2)
        values = _mean(values.real, width) + 1j * _mean(values.imag, width)
    return np.gradient(values, np.log(frequency_hz))
