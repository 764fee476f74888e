"""Sweeps of many thousand points, averaged down to what their curve can show.

Neighbouring points are put together where the curve hardly moves between them: bins are equally long along (ln f, ln Z), so that a
resonance keeps its share however narrow it is. Weights are kept: the white noise of k points together is smaller by sqrt(k). All else of
the noise (what is correlated, what drifts) is that of the points. A mean over a bin differs from the middle of the bin by the curve's
bend, which the neighbouring bins tell.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from motoremi.arrays import BoolArray, ComplexArray, FloatArray
from motoremi.data.kernels import logarithm, smoothed
from motoremi.data.noise import Noise
from motoremi.data.sweep import RepeatedSweep

# A sweep of more points than the first is averaged down to about the second: twice what the bench measures by itself.
MOST_POINTS, COARSE_POINTS = 1201, 801


def bins_of(sweep: RepeatedSweep, steps_hz: Sequence[float]) -> np.ndarray:
    """Which bin each point of a sweep is in, shape (n,), rising from 0.

    Parameters
    ----------
    sweep : RepeatedSweep
    steps_hz : sequence of float
        Where the analyser may switch ranges: no bin lies on both sides.
    """
    curve = logarithm(smoothed(sweep.mean_ohm))
    length = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(np.log(sweep.frequency_hz)), 0.5 * np.abs(np.diff(curve))))])
    at = np.minimum((COARSE_POINTS * length / length[-1]).astype(np.intp), COARSE_POINTS - 1)
    ranges = np.searchsorted(np.sort(steps_hz), sweep.frequency_hz)
    # A bin between two points is none.
    return np.unique(at + ranges * COARSE_POINTS, return_inverse=True)[1]


def coarse(sweep: RepeatedSweep, noise: Noise, steps_hz: Sequence[float]) -> tuple[RepeatedSweep, Noise]:
    """The same sweep on fewer points; itself where it has few.

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
    # Each repeat against the mean, so that all have its phase.
    repeats = np.array([mean(curve + np.log(one / sweep.mean_ohm)) - bend for one in sweep.impedance_ohm])
    outliers = noise.outliers
    return (
        RepeatedSweep(sweep.termination, np.exp(middle), np.exp(repeats), None, np.bincount(bins).astype(np.float64)),
        Noise(
            1 / np.sqrt(total),
            noise.source,
            noise.correlated,
            None if noise.drift is None else mean(noise.drift),
            None if outliers is None else _all_of(bins, outliers),
            None if noise.within is None else mean(noise.within),
        ),
    )


def of_points(sweep: RepeatedSweep, steps_hz: Sequence[float], averages: BoolArray) -> BoolArray:
    """The points of the averages that are chosen, shape (n,)."""
    return averages if sweep.frequency_hz.size <= MOST_POINTS else averages[bins_of(sweep, steps_hz)]


def scattered(sweep: RepeatedSweep, noise: Noise, steps_hz: Sequence[float], left: ComplexArray) -> float:
    """Weighted sum of squares of what is left at the points, shape (n,), round its mean in each bin; 0 where the sweep is not averaged."""
    if sweep.frequency_hz.size <= MOST_POINTS:
        return 0.0
    bins, weight = bins_of(sweep, steps_hz), 1 / noise.sigma**2
    mean = _sums(bins, left * weight) / _sums(bins, weight)
    return float(np.sum(weight * np.abs(left - mean[bins]) ** 2))


def _sums(bins: np.ndarray, values: np.ndarray) -> np.ndarray:
    edges = np.flatnonzero(np.diff(bins, prepend=-1))
    return np.add.reduceat(values, edges)


def _all_of(bins: np.ndarray, chosen: BoolArray) -> BoolArray | None:
    """Bins of which all points are chosen; of others, those that are not say what is there."""
    whole: BoolArray = np.logical_and.reduceat(chosen, np.flatnonzero(np.diff(bins, prepend=-1)))
    return whole if whole.any() else None


def _second_derivative(x: FloatArray, y: ComplexArray) -> ComplexArray:
    """At each place from those two further on either side, so that little of its own noise is in it; at the ends as beside them."""
    low, here, high = x[:-4], x[2:-2], x[4:]
    below, above = (y[2:-2] - y[:-4]) / (here - low), (y[4:] - y[2:-2]) / (high - here)
    return np.pad(2 * (above - below) / (high - low), 2, mode="edge")
