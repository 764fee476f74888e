"""Readings of the detectors for a train of events, by formula.

Behind a Gaussian filter of impulse bandwidth B an event of density |V| has an envelope with the peak sqrt(2) |V| B (as the rms value of a sine
with the same reading). If the envelope decays before the next event, the events are separate; otherwise they add up, in phase if the tuned
frequency is a multiple of the repetition rate (lines), at random with jitter (noise).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import ive

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.emission.band import Band
from motoremi.emission.weighting import envelope_weight, pulse_weight

# Distance of events, in standard deviations of the envelope, below which neighbours overlap.
TOUCHING = 8.0
# Offsets of the tuned frequency from a line, and standard deviations of the phase in rad, at which a train with jitter is tabulated.
_OFFSETS = np.linspace(0.0, 0.5, 9)
_SCATTERS = np.array([0.0, 0.25, 0.5, 0.75, 1.0, 1.4, 2.0, 3.0])
_FAR_ABOVE = 1e4
_EVENTS = 96
_SAMPLES = 8
# Samples of a period for the quasi-peak circuit; the mean of a smooth periodic function does not need more.
_SHOWN = 16


@dataclass(frozen=True)
class Readings:
    """Levels of all detectors as rms voltages, shape (n,) each."""

    peak: FloatArray
    quasi_peak: FloatArray
    average: FloatArray
    rms_average: FloatArray

    def scaled(self, factor: FloatArray | float) -> Readings:
        """All readings times a factor."""
        return Readings(self.peak * factor, self.quasi_peak * factor, self.average * factor, self.rms_average * factor)

    @classmethod
    def of_lines(cls, volt: FloatArray) -> Readings:
        """Readings of sines, which are the same for every detector."""
        return cls(volt, volt, volt, volt)


def separate(repetition_hz: float, band: Band) -> bool:
    """Whether the envelope of an event has decayed before the next event."""
    return repetition_hz * TOUCHING * band.pulse_sigma_s <= 1


def read_events(
    frequency_hz: FloatArray,
    density_vs: FloatArray,
    repetition_hz: float,
    band: Band,
    jitter_s: float = 0.0,
    missing_share: float = 0.0,
    weigh: bool = True,
) -> Readings:
    """Detector readings of short events whose density is nearly constant within the bandwidth.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
        Tuned frequencies of the receiver.
    density_vs : ndarray, shape (n,)
        |V| at the receiver, V s.
    repetition_hz : float
    band : Band
    jitter_s : float
        Standard deviation of the event times.
    missing_share : float
        Share of events that are missing.
    weigh : bool
        Whether to compute the quasi-peak reading, which costs most; without it, the peak is returned for it.
    """
    height = math.sqrt(2) * density_vs * band.impulse_bandwidth_hz
    coming = repetition_hz * (1 - missing_share)
    if separate(repetition_hz, band):
        return _separate_unit(coming, band, weigh).scaled(height)
    place = np.abs(frequency_hz / repetition_hz - np.round(frequency_hz / repetition_hz))
    scatter = np.minimum(2 * np.pi * frequency_hz * jitter_s, _SCATTERS[-1])
    tables = _touching_units(repetition_hz / band.bandwidth_hz, band, jitter_s > 0, round(missing_share, 3), weigh)
    column = place / (_OFFSETS[1] - _OFFSETS[0])
    row = np.interp(scatter, _SCATTERS, np.arange(_SCATTERS.size)) if jitter_s > 0 else np.zeros_like(column)
    peak, quasi_peak, average, rms = (_between(table, row, column) * height for table in tables)
    return Readings(peak, quasi_peak, average, rms)


def _separate_unit(coming_hz: float, band: Band, weigh: bool) -> Readings:
    average = coming_hz / band.impulse_bandwidth_hz
    pulse_energy_s = math.sqrt(math.pi) * band.pulse_sigma_s
    # Rms over 1/corner, then the mean of these values, most of which are zero if the events come more slowly than the corner frequency.
    within = max(coming_hz, band.rms_corner_hz)
    rms = math.sqrt(pulse_energy_s * within) * min(1.0, coming_hz / band.rms_corner_hz)
    one = np.ones(1)
    weight = pulse_weight(band, coming_hz) if weigh else 1.0
    return Readings(one, weight * one, average * one, rms * one)


def _between(table: FloatArray, row: FloatArray, column: FloatArray) -> FloatArray:
    """Bilinear interpolation at fractional rows and columns."""
    if table.shape[0] == 1:
        return np.interp(column, np.arange(table.shape[1]), table[0])
    i = np.minimum(row.astype(np.intp), table.shape[0] - 2)
    j = np.minimum(column.astype(np.intp), table.shape[1] - 2)
    a, b = row - i, column - j
    return (1 - a) * ((1 - b) * table[i, j] + b * table[i, j + 1]) + a * ((1 - b) * table[i + 1, j] + b * table[i + 1, j + 1])


@lru_cache(maxsize=32)
def _touching_units(
    relative_rate: float, band: Band, jitters: bool, missing_share: float, weigh: bool
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Peak, quasi-peak, average and rms of overlapping unit events: by scatter of the phase (rows) and offset from a line (columns).

    `relative_rate` is the repetition over the bandwidth; without `weigh` the quasi-peak is the peak.
    """
    gap = 1 / (relative_rate * band.bandwidth_hz * band.pulse_sigma_s)
    reach = math.ceil(TOUCHING / 2 / gap) + 1
    scatters = _SCATTERS if jitters else _SCATTERS[:1]
    random = jitters or missing_share > 0
    events = _EVENTS if random else 1
    rng = np.random.default_rng(20250101)
    normal, lost = rng.standard_normal(events), rng.random(events) < missing_share
    number = np.arange(events)
    moments = np.arange(_SAMPLES) / _SAMPLES
    envelope = np.zeros((scatters.size, _OFFSETS.size, events, _SAMPLES), dtype=np.complex128)
    for shift in range(-reach, reach + 1):
        pulse = np.exp(-(((moments - shift) * gap) ** 2) / 2)
        other = (number + shift) % events
        phase = 2 * np.pi * _OFFSETS[None, :, None] * (number + shift) + scatters[:, None, None] * normal[other]
        envelope += (np.exp(1j * phase) * ~lost[other])[..., None] * pulse
    size = np.abs(envelope).reshape(scatters.size, _OFFSETS.size, -1)
    peak = size.max(axis=-1)
    return peak, envelope_weight(band, size) if weigh else peak, size.mean(axis=-1), np.sqrt(np.mean(size**2, axis=-1))


def read_comb(
    frequency_hz: FloatArray, repetition_hz: float, density: Callable[[FloatArray], ComplexArray], band: Band, weigh: bool = True
) -> Readings:
    """Detector readings of a strictly periodic source, line by line; its density may change within the bandwidth.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
    repetition_hz : float
        At least a tenth of the bandwidth.
    density : callable
        Complex density of one period at the receiver, V s, at any frequencies.
    band : Band
    weigh : bool
        Whether to compute the quasi-peak reading, which takes most of the time; without it, the peak is returned for it.
    """
    reach = math.ceil(1.7 * band.bandwidth_hz / repetition_hz)
    nearest = np.round(frequency_hz / repetition_hz).astype(np.intp)
    first, last = max(1, int(nearest.min()) - reach), int(nearest.max()) + reach
    steps = np.arange(-reach, reach + 1)
    number = nearest[:, None] + steps
    # Only lines within the bandwidth of a point: a fit uses few points above some MHz.
    seen = np.zeros(last - first + 1, dtype=bool)
    seen[np.maximum(number - first, 0)] = True
    lines = np.zeros(seen.size, dtype=np.complex128)
    lines[seen] = math.sqrt(2) * repetition_hz * density(repetition_hz * np.asarray(first + np.flatnonzero(seen), dtype=np.float64))
    offset: FloatArray = number * repetition_hz - frequency_hz[:, None]
    passed = np.where(number >= first, lines[np.maximum(number - first, 0)], 0) * np.exp(-(offset**2) / (2 * band.sigma_hz**2))
    moments = max(8, 4 * reach)
    envelope: FloatArray = np.abs(passed @ np.exp(2j * np.pi * np.outer(steps, np.arange(moments)) / moments))
    rms = np.sqrt(np.mean(envelope**2, axis=1))
    peak = envelope.max(axis=1)
    weighted = envelope_weight(band, envelope[:, :: max(1, moments // _SHOWN)]) if weigh else peak
    return Readings(peak, weighted, envelope.mean(axis=1), rms)


def noise_unit(band: Band, dwell_s: float) -> Readings:
    """Readings of Gaussian noise with an average of 1; the peak increases with the dwell time."""
    effective = 2 / math.sqrt(math.pi)
    independent = max(2.0, 2 * dwell_s * band.noise_bandwidth_hz)
    one = np.ones(1)
    # Expected maximum of many exponentially distributed powers.
    highest = effective * math.sqrt(math.log(independent) + np.euler_gamma)
    return Readings(highest * one, _noise_weight(band) * one, one, effective * one)


@lru_cache(maxsize=4)
def _noise_weight(band: Band) -> float:
    quantiles = np.sqrt(-np.log1p(-(np.arange(2000) + 0.5) / 2000)) * 2 / math.sqrt(math.pi)
    return float(envelope_weight(band, quantiles[None])[0])


def rician_mean(sine: FloatArray, noise_average: FloatArray) -> FloatArray:
    """Mean envelope of a sine in Gaussian noise whose own mean envelope is `noise_average`; linear units."""
    # Far above the noise the Bessel functions lose their accuracy, and the mean is the sine.
    square = np.pi / 4 * np.minimum(sine / noise_average, _FAR_ABOVE) ** 2
    half = square / 2
    mean: FloatArray = noise_average * ((1 + square) * ive(0, half) + square * ive(1, half))
    return np.maximum(mean, sine)


def pulses_on_noise(height: FloatArray, noise_average: FloatArray, coming_hz: float, band: Band) -> FloatArray:
    """Average of separate Gaussian pulses of peak `height` in noise: the noise plus the area that each pulse adds."""
    ratios, areas = _added_areas()
    ratio = np.clip(height / noise_average, ratios[0], ratios[-1])
    area = np.exp(np.interp(np.log(ratio), np.log(ratios), np.log(areas)))
    return noise_average * (1 + coming_hz * band.pulse_sigma_s * area)


@lru_cache(maxsize=1)
def _added_areas() -> tuple[FloatArray, FloatArray]:
    """Area that a Gaussian pulse of unit standard deviation adds to the mean envelope of noise of mean 1, for a range of heights."""
    ratios = np.geomspace(1e-2, 1e6, 161)
    u = (np.arange(120) + 0.5) * 0.05
    added = rician_mean(ratios[:, None] * np.exp(-(u**2) / 2), np.ones(1)) - 1
    areas: FloatArray = 2 * np.sum(added, axis=1) * 0.05
    return ratios, areas
