"""The data's side of a problem: the points that are used, their weights, and the directions in which the analyser's gain may err.

Nothing here depends on the model, so all candidates of a diagnosis share it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Literal

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.analyser import gain_basis
from motoremi.data.measurement import Measurement
from motoremi.data.sweep import MINIMUM_POINTS

Weights = Literal["likelihood", "log"]


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
        Noise of its real and of its imaginary part; one where all points count alike.
    expected : float
        What noise and analyser leave of the unweighted sum of squares.
    """

    termination: str
    frequency_hz: FloatArray
    s: ComplexArray
    measured: ComplexArray
    sigma: FloatArray
    expected: float


@dataclass(frozen=True)
class Observed:
    """All points, sweep after sweep.

    Parameters
    ----------
    measurement : Measurement
    sweeps : tuple of ObservedSweep
    ideal : bool
        Whether the analyser counts as ideal.
    """

    measurement: Measurement
    sweeps: tuple[ObservedSweep, ...]
    ideal: bool

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
    def slices(self) -> dict[str, slice]:
        """Where each termination's residuals are."""
        ends = np.cumsum([0, *(sweep.sigma.size for sweep in self.sweeps)])
        return {sweep.termination: slice(int(a), int(b)) for sweep, a, b in zip(self.sweeps, ends[:-1], ends[1:], strict=True)}

    @cached_property
    def directions(self) -> FloatArray:
        """Orthogonal directions, shape (n, q), in which the gain error takes up weighted residuals.

        The squared length of each is the share that it takes up: with the gain error's covariance B B', the inverse of 1 + B B' is
        1 - D D' with these as D.
        """
        everything = np.unique(self.frequency_hz)
        basis = gain_basis(self.measurement.analyser, everything)[np.searchsorted(everything, self.frequency_hz)]
        if self.ideal or basis.shape[1] == 0:
            return np.zeros((self.size, 0))
        vectors, singular, _ = np.linalg.svd(basis * self.weight[:, None], full_matrices=False)
        keep = singular > 1e-3
        return np.asarray(vectors[:, keep] * (singular[keep] / np.sqrt(1 + singular[keep] ** 2)), dtype=np.float64)

    @property
    def expected_objective(self) -> float:
        """What a perfect model would leave of the objective `log`: random noise and the analyser's systematic errors."""
        return sum(sweep.expected for sweep in self.sweeps)


# A diagnosis uses the same handful of grids again and again.
@lru_cache(maxsize=32)
def observed(measurement: Measurement, points: int | None, weights: Weights, highest_hz: float) -> Observed:
    """Points of a measurement.

    Parameters
    ----------
    points : int, optional
        Use about this many a sweep, those that tell most.
    weights : {"likelihood", "log"}
        Over the noise, or every point alike.
    highest_hz : float
        Use points up to here only.
    """
    prepared = []
    for sweep, noise in zip(measurement.sweeps, measurement.noise, strict=True):
        mean = sweep.mean_ohm
        low = max(int(np.searchsorted(sweep.frequency_hz, highest_hz, side="right")), MINIMUM_POINTS)
        chosen = informative_points(sweep.frequency_hz[:low], mean[:low], points or mean.size)
        frequency, impedance, sigma = sweep.frequency_hz[chosen], mean[chosen], noise.sigma[chosen]
        systematic = measurement.analyser.uncertainty(frequency, impedance)
        prepared.append(
            ObservedSweep(
                termination=sweep.termination,
                frequency_hz=frequency,
                s=2j * np.pi * frequency,
                measured=impedance,
                sigma=sigma if weights == "likelihood" else np.ones(chosen.size),
                expected=float(np.sum(2 * sigma**2 + systematic**2)),
            )
        )
    return Observed(measurement, tuple(prepared), ideal=weights == "log")


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
