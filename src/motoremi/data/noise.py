"""Random noise of a sweep, estimated from its repeats or, if there are none, from its own scatter.

White noise follows the law of the analyser (`noise_law`), times a slow function of frequency. In addition there are noise that is correlated
along frequency, drift from repeat to repeat, and outliers: single points that differ from their repeats or from their neighbours (a broadcast
station, a bad contact). Outliers are given a low weight instead of being deleted.
"""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from scipy.ndimage import median_filter, uniform_filter1d

from motoremi.arrays import BoolArray, ComplexArray, FloatArray
from motoremi.data.noise_by_scatter import noise_by_scatter
from motoremi.data.noise_law import SMALLEST_SIGMA, Domain, domain_of, fitted_by_law
from motoremi.data.quantity import Quantity
from motoremi.data.repeats import CorrelatedPart, contrasts, correlated_part, drift_of
from motoremi.data.spikes import spikes
from motoremi.data.sweep import RepeatedSweep
from motoremi.interrupts import checkpoint

NoiseSource: TypeAlias = Literal["repeats", "stated", "scatter"]
# Scatter from point to point misses slower variations. In a native 4294A export of an R-L load the residuals of a good fit are 1.5 times
# the scatter, so the correlated part has a variance of 1.5^2 - 1 times that of the white part.
UNSEEN_BY_SCATTER = 1.1
# A point is an outlier if the standard deviation of its repeats is more than this factor above the neighbours' median: in 123 sweeps
# without a disturbance the largest factor was 5.8, in 14 sweeps with broadcast stations all were above 18.
OUTLIER = 9.0
NEIGHBOURS = 15


@dataclass(frozen=True)
class Noise:
    """Random noise of the mean of the repeats, relative to Z.

    Parameters
    ----------
    sigma : ndarray, shape (n,)
        Standard deviation of the white noise of the real and of the imaginary part of ln Z each.
    source : {"repeats", "stated", "scatter"}
        What it was estimated from.
    correlated : ndarray, shape (n,), or None
        Real or complex; one standard deviation, of the real and of the imaginary part each, of the part that is correlated along frequency.
    drift : ndarray, shape (n,), or None
        Complex; one standard deviation of the error of the mean because the motor changed during the repeats.
    within : ndarray, shape (n,), or None
        Complex; one standard deviation, of the real and of the imaginary part each, of the error at each point because the motor changed
        from the first point of a sweep to its last.
    moved : ndarray, shape (n, 4), or None
        Complex; one standard deviation of the error of the mean because of a series R and L and a shunt G and C that changed between repeats.
    outliers : ndarray of bool, shape (n,), or None
        Points that differ from their repeats or from their neighbours; their `sigma` is as large as the deviation.
    """

    sigma: FloatArray
    source: NoiseSource
    correlated: FloatArray | ComplexArray | None = None
    drift: ComplexArray | None = None
    outliers: BoolArray | None = None
    within: ComplexArray | None = None
    moved: ComplexArray | None = None

    @property
    def regular(self) -> BoolArray:
        """Points that are not outliers, shape (n,)."""
        return np.ones(self.sigma.size, dtype=np.bool_) if self.outliers is None else ~self.outliers

    @property
    def variance(self) -> FloatArray:
        """Variance of all parts together, of the real and of the imaginary part each, shape (n,)."""
        drift = 0.0 if self.drift is None else 0.5 * np.abs(self.drift) ** 2
        within = 0.0 if self.within is None else np.abs(self.within) ** 2
        moved = 0.0 if self.moved is None else 0.5 * np.sum(np.abs(self.moved) ** 2, axis=1)
        return self.sigma**2 + self.correlated_sigma**2 + drift + within + moved

    @property
    def correlated_sigma(self) -> FloatArray:
        """Standard deviation of the correlated part at each point, shape (n,)."""
        return np.zeros(self.sigma.size) if self.correlated is None else np.abs(self.correlated)


@dataclass(frozen=True)
class ByContent:
    """A sweep and what its analyser measures as a cache key: equal to another with the same bytes, whatever the termination."""

    digest: bytes
    quantity: Quantity | None
    sweep: RepeatedSweep = field(compare=False)

    @classmethod
    def of(cls, sweep: RepeatedSweep, quantity: Quantity | None) -> ByContent:
        """The key of a sweep."""
        arrays = (sweep.frequency_hz, sweep.impedance_ohm, sweep.sigma_relative, sweep.moved, sweep.rounding_relative)
        parts = [b"-" if array is None else f"{array.shape}".encode() + np.ascontiguousarray(array).tobytes() for array in arrays]
        return cls(hashlib.sha256(b"".join(parts)).digest(), quantity, sweep)


def rms_percent(variances: Iterable[FloatArray]) -> float:
    """Rms of relative errors whose real and imaginary parts each have these variances, in percent."""
    return float(100 * np.sqrt(np.mean(2 * np.concatenate(list(variances)))))


def estimate_noise(sweep: RepeatedSweep, quantity: Quantity | None = None) -> Noise:
    """Noise of the mean of a repeated sweep, as a bridge has it or, with a `quantity`, a network analyser that measures this."""
    return noise_of(ByContent.of(sweep, quantity))


# The workbench estimates the noise of the same sweeps to fit, show and diagnose them; with ten thousand points that takes a second or more.
@lru_cache(maxsize=16)
def noise_of(key: ByContent) -> Noise:
    """The same as `estimate_noise`."""
    return noise_anew(key)


def noise_anew(key: ByContent) -> Noise:
    """The same without a cache, for sweeps that are used once."""
    checkpoint()
    sweep, noise = key.sweep, estimated(key)
    if sweep.moved is not None:
        noise = dataclasses.replace(noise, moved=sweep.changes_by_leads * sweep.moved_of_mean)
    off = spikes(sweep.frequency_hz, sweep.mean_ohm, np.hypot(noise.sigma, noise.correlated_sigma))
    if not off.any():
        return noise
    outliers = off > 0 if noise.outliers is None else (off > 0) | noise.outliers
    return dataclasses.replace(noise, sigma=np.maximum(noise.sigma, off), outliers=outliers)


def estimated(key: ByContent) -> Noise:
    """Noise from the repeats, as stated by the user, or from the scatter; never below the rounding of the numbers."""
    sweep, domain = key.sweep, domain_of(key.quantity, key.sweep.mean_ohm)
    noise = _by_source(key, domain)
    # With little noise all repeats are rounded alike, and so is their mean.
    return noise if sweep.rounding_relative is None else dataclasses.replace(noise, sigma=np.maximum(noise.sigma, sweep.rounding_relative))


def _by_source(key: ByContent, domain: Domain) -> Noise:
    sweep = key.sweep
    if sweep.repeats > 1:
        return _from_repeats(key, domain)
    if sweep.sigma_relative is not None:
        return Noise(np.maximum(sweep.sigma_relative, SMALLEST_SIGMA), "stated")
    sigma = noise_by_scatter(sweep.frequency_hz, domain, _rounding(sweep, domain))
    return Noise(sigma * np.abs(domain.to_relative), "scatter", UNSEEN_BY_SCATTER * sigma * domain.to_relative)


def _rounding(sweep: RepeatedSweep, domain: Domain) -> FloatArray | None:
    """The rounding of one repeat in the domain of the analyser's law, if it is known."""
    return None if sweep.rounding_relative is None else sweep.rounding_relative / np.abs(domain.to_relative)


class _Random(NamedTuple):
    """Contrasts of the repeats, and the noise that is estimated from them; all but `correlated` at every point."""

    deviations: ComplexArray
    free: ComplexArray
    variance: FloatArray
    outliers: BoolArray
    white: FloatArray
    correlated: CorrelatedPart


# Whether leads moved between the repeats is judged by the likelihood of sweeps whose noise was just estimated.
@lru_cache(maxsize=4)
def _random(key: ByContent) -> _Random:
    """White noise from sample variances, fitted by the analyser's law times a slow correction; then correlated noise."""
    sweep, domain = key.sweep, domain_of(key.quantity, key.sweep.mean_ohm)
    deviations = (sweep.impedance_ohm / sweep.mean_ohm - 1) / domain.to_relative
    free = contrasts(deviations)
    variance = np.mean(np.abs(free) ** 2, axis=0) / 2
    rounding = _rounding(sweep, domain)
    known = np.zeros(variance.size) if rounding is None else rounding**2
    outliers = _outliers(variance, domain.law, known)
    white = _white(np.where(outliers, _median_of_neighbours(variance), variance), domain.law, known)
    correlated = correlated_part(sweep.frequency_hz[~outliers], white[~outliers], free[:, ~outliers])
    return _Random(deviations, free, variance, outliers, white, correlated)


def repeats_log_likelihood(key: ByContent) -> float:
    """Log likelihood of the contrasts of the repeats with the white and correlated noise that is estimated from them."""
    return _random(key).correlated.log_likelihood


def _from_repeats(key: ByContent, domain: Domain) -> Noise:
    """White and correlated noise, and a drift."""
    sweep = key.sweep
    deviations, free, variance, outliers, white, (correlated, factor, _) = _random(key)
    rounding = _rounding(sweep, domain)
    if rounding is not None and correlated < np.median(rounding):
        # A last digit that is the same at neighbouring points and another one in the next repeat.
        correlated = 0.0
    inside = ~outliers
    sigma = np.maximum(white * np.sqrt(factor), SMALLEST_SIGMA)
    drift = _drift(sweep, sigma, correlated, free, inside)
    if drift is not None and correlated > 0:
        # Correlated noise was estimated with the drift in it; it is estimated again without.
        order = np.arange(sweep.repeats) - (sweep.repeats - 1) / 2
        steady = contrasts(deviations - order[:, None] * drift)
        correlated, factor, _ = correlated_part(sweep.frequency_hz[inside], sigma[inside], steady[:, inside])
        sigma = np.maximum(sigma * np.sqrt(factor), SMALLEST_SIGMA)
    sigma = np.where(outliers, np.sqrt(np.maximum(variance, sigma**2)) * np.sqrt(OUTLIER), sigma)
    drifting = None if drift is None else drift * domain.to_relative
    return Noise(
        sigma * np.abs(domain.to_relative) / np.sqrt(sweep.repeats),
        "repeats",
        correlated / np.sqrt(sweep.repeats) * domain.to_relative if correlated else None,
        None if drifting is None else drifting * sweep.repeats / 2,
        outliers if outliers.any() else None,
        # Points are measured one after the other: the ends of a sweep are half a repeat before and after its middle.
        None if drifting is None else drifting * np.linspace(-0.5, 0.5, drifting.size),
    )


def _drift(sweep: RepeatedSweep, sigma: FloatArray, correlated: float, free: ComplexArray, inside: BoolArray) -> ComplexArray | None:
    """Drift from repeat to repeat; None with fewer than three repeats, because correlated noise may look like a drift between two."""
    if sweep.repeats < 3:
        return None
    steady = free[1:]
    if correlated > 0:
        # How large the correlated noise is without the trend.
        correlated = correlated_part(sweep.frequency_hz[inside], sigma[inside], steady[:, inside]).size
    found = drift_of(sweep.frequency_hz[inside], sigma[inside], correlated, free[:, inside])
    if found is None:
        return None
    place = np.log(sweep.frequency_hz)
    return np.interp(place, place[inside], found)


def _outliers(variance: FloatArray, law: FloatArray, known: FloatArray) -> BoolArray:
    """Points whose repeats differ far more than those of their neighbours and than the analyser's law and the known part allow."""
    # Of rounded repeats most may agree exactly.
    beside = np.maximum(_median_of_neighbours(variance), known)
    allowed = fitted_by_law(np.minimum(variance, OUTLIER * beside), law, known=known)
    limit = OUTLIER**2
    return (variance > limit * beside) & (variance > limit * allowed)


def _median_of_neighbours(variance: FloatArray) -> FloatArray:
    return np.maximum(median_filter(variance, size=min(NEIGHBOURS, variance.size), mode="nearest"), SMALLEST_SIGMA**2)


def _white(variance: FloatArray, law: FloatArray, known: FloatArray) -> FloatArray:
    """Standard deviation of one repeat from sample variances, a part of which is known."""
    expected = fitted_by_law(variance, law, known=known)
    # The slow correction averages over so many points that its own scatter stays near 10 %.
    width = min(len(variance), max(25, len(variance) // 6))
    correction = uniform_filter1d(variance / expected, width, mode="reflect")
    return np.maximum(np.sqrt(expected * np.clip(correction, 0.25, 4.0)), SMALLEST_SIGMA)
