"""Random noise of a sweep, from its repeats or, for want of any, from its own scatter.

White noise follows the law of a bridge: a relative part, an additive part in impedance (seen at low |Z|) and an additive part in
admittance (seen at high |Z|), times a slow function of frequency. Beside it stand what is correlated along frequency, what drifts from
repeat to repeat, and single points that stand out (a broadcast station, a bad contact), among their repeats or of their neighbours, which
count for little instead of being deleted.
"""

from __future__ import annotations

import dataclasses
import hashlib
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Literal, TypeAlias

import numpy as np
from scipy.ndimage import median_filter, uniform_filter1d
from scipy.optimize import nnls

from motoremi.arrays import BoolArray, ComplexArray, FloatArray
from motoremi.data.repeats import contrasts, correlated_part, drift_of
from motoremi.data.spikes import spikes
from motoremi.data.sweep import RepeatedSweep
from motoremi.interrupts import checkpoint

NoiseSource: TypeAlias = Literal["repeats", "stated", "scatter"]
# The quietest export of a 4294A that we know scatters by 6e-5; files carry 6 or 7 digits. Below this no noise is believed.
SMALLEST_SIGMA = 1e-5
# Scatter from point to point misses what wanders more slowly. In the native 4294A export that we have, an R-L load, the residuals of a
# good fit are 1.5 times the scatter, so the part that wanders has a variance of 1.5^2 - 1 times the white one.
UNSEEN_BY_SCATTER = 1.1
# A point stands out where its repeats differ by so many times their neighbours' median variance: of 123 sweeps without a disturbance none
# reached 5.8 in amplitude, of 14 with stations all were above 18.
STANDS_OUT = 9.0
NEIGHBOURS = 15


@dataclass(frozen=True)
class Noise:
    """Random noise of the mean of the repeats, relative to Z.

    Parameters
    ----------
    sigma : ndarray, shape (n,)
        Standard deviation of the white noise of the real and of the imaginary part of ln Z each.
    source : {"repeats", "stated", "scatter"}
        Where it comes from.
    correlated : float
        Standard deviation of the part that is correlated along frequency.
    drift : ndarray, shape (n,), or None
        Complex; how far the mean may be off because the motor changed during the repeats, one standard deviation.
    within : ndarray, shape (n,), or None
        Complex; how far each point may be off because the motor went on changing from the first point of a sweep to its last, one standard
        deviation of the real and of the imaginary part each.
    outliers : ndarray of bool, shape (n,), or None
        Points that stand out, in their repeats or of their neighbours. Their `sigma` is as large as they are far off.
    """

    sigma: FloatArray
    source: NoiseSource
    correlated: float = 0.0
    drift: ComplexArray | None = None
    outliers: BoolArray | None = None
    within: ComplexArray | None = None

    @property
    def regular(self) -> BoolArray:
        """Points that do not stand out, shape (n,)."""
        return np.ones(self.sigma.size, dtype=np.bool_) if self.outliers is None else ~self.outliers

    @property
    def variance(self) -> FloatArray:
        """Of the real and of the imaginary part each, everything together, shape (n,)."""
        drift = 0.0 if self.drift is None else 0.5 * np.abs(self.drift) ** 2
        within = 0.0 if self.within is None else np.abs(self.within) ** 2
        total: FloatArray = self.sigma**2 + self.correlated**2 + drift + within
        return total


@dataclass(frozen=True)
class _Asked:
    """A sweep, the same as any other with these bytes."""

    digest: bytes
    sweep: RepeatedSweep = field(compare=False)


def estimate_noise(sweep: RepeatedSweep) -> Noise:
    """Noise of the mean of a repeated sweep."""
    checkpoint()
    told = (sweep.frequency_hz, sweep.impedance_ohm, *(() if sweep.sigma_relative is None else (sweep.sigma_relative,)))
    parts = [f"{array.shape}".encode() + np.ascontiguousarray(array).tobytes() for array in told]
    return _noise_of(_Asked(hashlib.sha256(b"".join(parts)).digest(), sweep))


# A page asks of the same sweeps when it fits, shows and diagnoses them: of ten thousand points that takes a second or more each time.
@lru_cache(maxsize=8)
def _noise_of(asked: _Asked) -> Noise:
    sweep = asked.sweep
    noise = estimated(sweep)
    off = spikes(sweep.frequency_hz, sweep.mean_ohm, np.hypot(noise.sigma, noise.correlated))
    if not off.any():
        return noise
    outliers = off > 0 if noise.outliers is None else (off > 0) | noise.outliers
    return dataclasses.replace(noise, sigma=np.maximum(noise.sigma, off), outliers=outliers)


def estimated(sweep: RepeatedSweep) -> Noise:
    """From what there is: repeats, what the user states, or scatter."""
    if sweep.repeats > 1:
        return _from_repeats(sweep)
    if sweep.sigma_relative is not None:
        return Noise(np.maximum(sweep.sigma_relative, SMALLEST_SIGMA), "stated")
    sigma = _from_scatter(sweep.frequency_hz, sweep.impedance_ohm[0])
    return Noise(sigma, "scatter", correlated=UNSEEN_BY_SCATTER * float(np.median(sigma)))


def _from_repeats(sweep: RepeatedSweep) -> Noise:
    """Sample variances, fitted with the bridge's law, times a slow correction; then what is correlated, and what drifts."""
    free = contrasts(sweep.impedance_ohm / sweep.mean_ohm - 1)
    variance = np.mean(np.abs(free) ** 2, axis=0) / 2
    magnitude = np.abs(sweep.mean_ohm)
    outliers = _standing_out(variance, magnitude)
    quiet = np.where(outliers, _median_of_neighbours(variance), variance)
    sigma = _white(quiet, magnitude)
    inside = ~outliers
    correlated, factor = correlated_part(sweep.frequency_hz[inside], sigma[inside], free[:, inside])
    sigma = np.maximum(sigma * np.sqrt(factor), SMALLEST_SIGMA)
    drift = _drift(sweep, sigma, correlated, free, inside)
    if drift is not None and correlated > 0:
        # What drifts passed for correlated noise as long as nothing else could carry it.
        order = np.arange(sweep.repeats) - (sweep.repeats - 1) / 2
        steady = contrasts(sweep.impedance_ohm / sweep.mean_ohm - 1 - order[:, None] * drift)
        correlated, factor = correlated_part(sweep.frequency_hz[inside], sigma[inside], steady[:, inside])
        sigma = np.maximum(sigma * np.sqrt(factor), SMALLEST_SIGMA)
    sigma = np.where(outliers, np.sqrt(np.maximum(variance, sigma**2)) * np.sqrt(STANDS_OUT), sigma)
    return Noise(
        sigma / np.sqrt(sweep.repeats),
        "repeats",
        correlated / float(np.sqrt(sweep.repeats)),
        None if drift is None else drift * sweep.repeats / 2,
        outliers if outliers.any() else None,
        # Points are measured one after the other: against the middle of a sweep its ends are half a repeat off.
        None if drift is None else drift * np.linspace(-0.5, 0.5, drift.size),
    )


def _drift(sweep: RepeatedSweep, sigma: FloatArray, correlated: float, free: ComplexArray, inside: BoolArray) -> ComplexArray | None:
    """A trend from repeat to repeat. Noise that wanders may look like one, so three repeats at least have to show it."""
    if sweep.repeats < 3:
        return None
    steady = free[1:]
    if correlated > 0:
        # How large the correlated noise is without the trend.
        correlated = correlated_part(sweep.frequency_hz[inside], sigma[inside], steady[:, inside])[0]
    found = drift_of(sweep.frequency_hz[inside], sigma[inside], correlated, free[:, inside])
    if found is None:
        return None
    place = np.log(sweep.frequency_hz)
    whole: ComplexArray = np.interp(place, place[inside], found.real) + 1j * np.interp(place, place[inside], found.imag)
    return whole


def _standing_out(variance: FloatArray, magnitude: FloatArray) -> BoolArray:
    """Points whose repeats differ far more than both their neighbours' do and the bridge's law allows at their |Z|."""
    beside = _median_of_neighbours(variance)
    law = _bridge_law(np.minimum(variance, STANDS_OUT * beside), magnitude)
    limit = STANDS_OUT**2
    found: BoolArray = (variance > limit * beside) & (variance > limit * law)
    return found


def _median_of_neighbours(variance: FloatArray) -> FloatArray:
    median: FloatArray = np.maximum(median_filter(variance, size=min(NEIGHBOURS, variance.size), mode="nearest"), SMALLEST_SIGMA**2)
    return median


def _white(variance: FloatArray, magnitude: FloatArray) -> FloatArray:
    """Standard deviation of one repeat from sample variances."""
    law = _bridge_law(variance, magnitude)
    # The slow correction averages over so many points that its own scatter stays near 10 %.
    width = min(len(variance), max(25, len(variance) // 6))
    correction = uniform_filter1d(variance / law, width, mode="reflect")
    sigma: FloatArray = np.maximum(np.sqrt(law * np.clip(correction, 0.25, 4.0)), SMALLEST_SIGMA)
    return sigma


def _bridge_law(variance: FloatArray, magnitude: FloatArray) -> FloatArray:
    """r^2 + (z/|Z|)^2 + (y |Z|)^2 fitted to sample variances, whose own scatter is proportional to themselves."""
    columns = np.column_stack([np.ones_like(magnitude), 1 / magnitude**2, magnitude**2])
    law = np.full_like(variance, max(float(np.mean(variance)), SMALLEST_SIGMA**2))
    for _ in range(8):
        scaled = columns / law[:, None]
        norms = np.linalg.norm(scaled, axis=0)
        coefficients = nnls(scaled / norms, variance / law)[0] / norms
        law = np.maximum(columns @ coefficients, SMALLEST_SIGMA**2)
    return law


def _from_scatter(frequency_hz: FloatArray, impedance_ohm: ComplexArray) -> FloatArray:
    """Scatter round a local parabola through the neighbours; an upper bound where the sweep is coarse.

    Medians keep sharp resonances, where a parabola does not follow, from passing for noise.
    """
    logarithm = np.log(frequency_hz)
    response = np.log(np.abs(impedance_ohm)) + 1j * np.unwrap(np.angle(impedance_ohm))
    half = 3
    start = np.clip(np.arange(response.size) - half, 0, response.size - 2 * half - 1)
    windows = start[:, None] + np.arange(2 * half + 1)
    x = logarithm[windows] - logarithm[:, None]
    x = x / np.max(np.abs(x), axis=1, keepdims=True)
    orthonormal = np.linalg.qr(x[..., None] ** np.arange(4))[0]
    inside = response[windows][..., None]
    residual = inside - orthonormal @ (np.swapaxes(orthonormal, 1, 2) @ inside)
    # 7 points less 4 coefficients leave 3 complex degrees of freedom.
    variance = np.sum(np.abs(residual[..., 0]) ** 2, axis=1) / (2 * 3)
    # Median of chi-squared with 6 degrees of freedom over its mean.
    typical = median_filter(variance, size=min(31, len(variance)), mode="nearest") / 0.8914
    overall = float(np.median(variance)) / 0.8914
    return np.maximum(np.sqrt(np.minimum(typical, 9 * overall)), SMALLEST_SIGMA)
