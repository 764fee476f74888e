"""The data's side of a problem: the points that are used, their weights, and the covariance of what a perfect circuit would leave.

Nothing here depends on the model, so all candidates of a diagnosis share it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Literal

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.covariance import Columns, Part
from motoremi.data.measurement import Measurement
from motoremi.data.sweep import MINIMUM_POINTS

Weights = Literal["likelihood", "log", "relative"]
# Weight of an outlier; all other points have the weight one.
OUT_OF_SIGHT = 1e3
# A point of which the analyser may err by this much, relative to Z, has half the weight of one without error: that is tens of per cent far from
# the reference resistance of a network analyser, and at a suppressor's resonance of a tenth of an ohm.
BLURRED = 0.1


@dataclass(frozen=True)
class ObservedSweep:
    """One termination's points.

    Parameters
    ----------
    termination : str
    frequency_hz : ndarray, shape (n,)
    s : ndarray, shape (n,)
        2 pi j f.
    measured : ndarray, shape (n,)
        Mean impedance in ohm.
    sigma : ndarray, shape (n,)
        White noise of its real and of its imaginary part; one where all points count alike.
    part : Part
        The sweep with its noise, and which of its points these are.
    systematic : ndarray, shape (n,)
        What the analyser may err by, relative to Z: standard deviation.
    variance : ndarray, shape (n,)
        Of the white noise of real and of imaginary part, relative to Z, whatever the weights.
    expected : float
        What noise and analyser leave of the sum of squares where all points count alike.
    """

    termination: str
    frequency_hz: FloatArray
    s: ComplexArray
    measured: ComplexArray
    sigma: FloatArray
    part: Part
    systematic: FloatArray
    variance: FloatArray
    expected: float


@dataclass(frozen=True)
class Observed:
    """All points, sweep after sweep.

    Parameters
    ----------
    measurement : Measurement
    sweeps : tuple of ObservedSweep
    """

    measurement: Measurement
    sweeps: tuple[ObservedSweep, ...]

    @cached_property
    def size(self) -> int:
        """Number of complex points."""
        return sum(sweep.sigma.size for sweep in self.sweeps)

    @cached_property
    def frequency_hz(self) -> FloatArray:
        """Frequencies of all residuals."""
        return np.concatenate([sweep.frequency_hz for sweep in self.sweeps])

    @cached_property
    def s(self) -> ComplexArray:
        """2 pi j f of all residuals."""
        return np.concatenate([sweep.s for sweep in self.sweeps])

    @cached_property
    def measured(self) -> ComplexArray:
        """Mean impedances of all residuals in ohm."""
        return np.concatenate([sweep.measured for sweep in self.sweeps])

    @cached_property
    def weight(self) -> FloatArray:
        """One over the noise."""
        return 1 / np.concatenate([sweep.sigma for sweep in self.sweeps])

    @cached_property
    def systematic(self) -> FloatArray:
        """What the analyser may err by at each point, relative to Z."""
        return np.concatenate([sweep.systematic for sweep in self.sweeps])

    @cached_property
    def variance(self) -> FloatArray:
        """Of the white noise of real and of imaginary part, relative to Z, whatever the weights."""
        return np.concatenate([sweep.variance for sweep in self.sweeps])

    @cached_property
    def slices(self) -> dict[str, slice]:
        """Where each termination's residuals are."""
        ends = np.cumsum([0, *(sweep.sigma.size for sweep in self.sweeps)])
        return {sweep.termination: slice(int(a), int(b)) for sweep, a, b in zip(self.sweeps, ends[:-1], ends[1:], strict=True)}

    def at(self, other: Observed, values: ComplexArray) -> ComplexArray:
        """Values at these points, shape (n,), interpolated to those of another grid."""
        found = []
        for mine, its in zip(self.sweeps, other.sweeps, strict=True):
            found.append(np.interp(np.log(its.frequency_hz), np.log(mine.frequency_hz), values[self.slices[mine.termination]]))
        return np.concatenate(found)

    @cached_property
    def columns(self) -> Columns:
        """The covariance of what a perfect circuit would leave."""
        return Columns.of([sweep.part for sweep in self.sweeps], self.measurement.analyser)

    @property
    def expected_objective(self) -> float:
        """What a perfect model would leave of the objective `log`: random noise and the analyser's systematic errors."""
        return sum(sweep.expected for sweep in self.sweeps)


# Cached: a diagnosis uses the same few grids repeatedly.
@lru_cache(maxsize=32)
def observed(measurement: Measurement, points: int | None, weights: Weights, highest_hz: float, blur: float = 0.0) -> Observed:
    """The points of a measurement that are used, with their weights.

    Parameters
    ----------
    points : int, optional
        Use about this many a sweep, those with the most information.
    weights : {"likelihood", "log"}
        Over the noise, or every point alike.
    highest_hz : float
        Use points up to here only.
    blur : float
        White noise that is added, relative to Z.
    """
    prepared = []
    for sweep, noise in zip(measurement.sweeps, measurement.noise, strict=True):
        mean = sweep.mean_ohm
        low = max(int(np.searchsorted(sweep.frequency_hz, highest_hz, side="right")), MINIMUM_POINTS)
        chosen = informative_points(sweep.frequency_hz[:low], mean[:low], points or mean.size)
        frequency, impedance, sigma = sweep.frequency_hz[chosen], mean[chosen], noise.sigma[chosen]
        systematic = measurement.analyser.uncertainty(frequency, impedance)
        alike = 1 / np.sqrt(sweep.counts[chosen]) if weights == "relative" and sweep.counts is not None else 1.0
        blurred = np.hypot(1.0, systematic / BLURRED) if weights == "log" else 1.0
        outlying = noise.outliers[chosen] if noise.outliers is not None else np.zeros(chosen.size, dtype=np.bool_)
        prepared.append(
            ObservedSweep(
                termination=sweep.termination,
                frequency_hz=frequency,
                s=2j * np.pi * frequency,
                measured=impedance,
                # A search with equal weights leaves out outliers, and points at which the analyser is insensitive.
                sigma=np.hypot(sigma, blur) if weights == "likelihood" else np.where(outlying, OUT_OF_SIGHT, alike * blurred),
                part=Part(sweep.frequency_hz, mean, noise, chosen),
                systematic=systematic,
                variance=noise.variance[chosen],
                expected=float(np.sum(np.where(outlying, 0.0, (2 * noise.variance[chosen] + systematic**2) / blurred**2))),
            )
        )
    return Observed(measurement, tuple(prepared))


def informative_points(frequency_hz: FloatArray, impedance_ohm: ComplexArray, count: int) -> np.ndarray:
    """Indices of about `count` points, dense where the impedance turns.

    They are equally spaced along the curve (ln f, 0.5 ln Z), so a resonance gets its share however narrow it is.
    """
    if count >= frequency_hz.size:
        return np.arange(frequency_hz.size)
    x = np.log(frequency_hz)
    turn = 0.5 * np.hypot(np.diff(np.log(np.abs(impedance_ohm))), np.diff(np.unwrap(np.angle(impedance_ohm))))
    length = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), turn))])
    return np.unique(np.searchsorted(length, np.linspace(0, length[-1] * (1 - 1e-12), count)))
