"""Sweeps of many points, averaged in bins to about 800 points for search and diagnosis.

Bins have equal length along the curve (ln f, ln Z), so that neighbouring points are averaged where the curve hardly changes, and a
resonance keeps its points however narrow it is. Weights are kept: the white noise of the mean of k points is smaller by sqrt(k). The other
parts of the noise (correlated noise, drift) are averaged like the impedance. The mean over a bin differs from the value at its middle by
the curvature; this is corrected with the curvature between the neighbouring bins.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from motoremi.arrays import BoolArray, ComplexArray, FloatArray
from motoremi.data.kernels import logarithm, smoothed
from motoremi.data.noise import Noise
from motoremi.data.sweep import RepeatedSweep

# A sweep of more points than the first number is averaged to about the second, twice the number that the ready procedures measure.
MOST_POINTS, COARSE_POINTS = 1201, 801


def bins_of(sweep: RepeatedSweep, steps_hz: Sequence[float]) -> np.ndarray:
    """Number of the bin that each point of a sweep is in, shape (n,), increasing from 0.

    Parameters
    ----------
    sweep : RepeatedSweep
    steps_hz : sequence of float
        Frequencies at which the analyser may switch ranges: no bin contains points of both sides.
    """
    curve = logarithm(smoothed(sweep.mean_ohm))
    length = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(np.log(sweep.frequency_hz)), 0.5 * np.abs(np.diff(curve))))])
    at = np.minimum((COARSE_POINTS * length / length[-1]).astype(np.intp), COARSE_POINTS - 1)
    ranges = np.searchsorted(np.sort(steps_hz), sweep.frequency_hz)
    # Bins without points are left out.
    return np.unique(at + ranges * COARSE_POINTS, return_inverse=True)[1]


def coarse(sweep: RepeatedSweep, noise: Noise, steps_hz: Sequence[float]) -> tuple[RepeatedSweep, Noise]:
    """The sweep averaged in bins; the sweep itself if it has few points.

    Parameters
    ----------
    sweep : RepeatedSweep
    noise : Noise
        Of its mean.
    steps_hz : sequence of float
        As in `bins_of`.
    """
    if sweep.frequency_hz.size <= MOST_POINTS:
        return sweep, noise
    bins = bins_of(sweep, steps_hz)
    weight = 1 / noise.sigma**2
    total = _sums(bins, weight)

    def mean(values: np.ndarray) -> np.ndarray:
        return _sums(bins, values * weight) / total

    place = np.log(sweep.frequency_hz)
    middle = mean(place)
    spread = mean((place - middle[bins]) ** 2)
    curve = logarithm(sweep.mean_ohm)
    bend = 0.5 * spread * _second_derivative(middle, mean(curve))
    # Each repeat relative to the mean, so that the phases of all repeats are unwrapped alike.
    repeats = np.array([mean(curve + np.log(one / sweep.mean_ohm)) - bend for one in sweep.impedance_ohm])
    outliers = noise.outliers
    return (
        RepeatedSweep(sweep.termination, np.exp(middle), np.exp(repeats), None, np.bincount(bins).astype(np.float64), sweep.moved),
        Noise(
            1 / np.sqrt(total),
            noise.source,
            None if noise.correlated is None else mean(noise.correlated),
            None if noise.drift is None else mean(noise.drift),
            None if outliers is None else _all_of(bins, outliers),
            None if noise.within is None else mean(noise.within),
            None if noise.moved is None else np.column_stack([mean(column) for column in noise.moved.T]),
        ),
    )


def points_in_bins(sweep: RepeatedSweep, steps_hz: Sequence[float], chosen: BoolArray) -> BoolArray:
    """The measured points in the chosen bins, shape (n,)."""
    return chosen if sweep.frequency_hz.size <= MOST_POINTS else chosen[bins_of(sweep, steps_hz)]


def scatter_in_bins(sweep: RepeatedSweep, noise: Noise, steps_hz: Sequence[float], residuals: ComplexArray) -> float:
    """Weighted sum of squares of the residuals of the points, shape (n,), about their mean in each bin; 0 for a sweep that is not averaged."""
    if sweep.frequency_hz.size <= MOST_POINTS:
        return 0.0
    bins, weight = bins_of(sweep, steps_hz), 1 / noise.sigma**2
    mean = _sums(bins, residuals * weight) / _sums(bins, weight)
    return float(np.sum(weight * np.abs(residuals - mean[bins]) ** 2))


def _sums(bins: np.ndarray, values: np.ndarray) -> np.ndarray:
    edges = np.flatnonzero(np.diff(bins, prepend=-1))
    return np.add.reduceat(values, edges)


def _all_of(bins: np.ndarray, chosen: BoolArray) -> BoolArray | None:
    """Bins all of whose points are chosen, None if there is no such bin."""
    whole: BoolArray = np.logical_and.reduceat(chosen, np.flatnonzero(np.diff(bins, prepend=-1)))
    return whole if whole.any() else None


def _second_derivative(x: FloatArray, y: ComplexArray) -> ComplexArray:
    """Second derivative at each place from the places two further on either side, to keep its noise small; at the ends the nearest value."""
    low, here, high = x[:-4], x[2:-2], x[4:]
    below, above = (y[2:-2] - y[:-4]) / (here - low), (y[4:] - y[2:-2]) / (high - here)
    return np.pad(2 * (above - below) / (high - low), 2, mode="edge")
