"""A CISPR 16-1-1 receiver in the time domain, which processes samples block by block and measures all frequencies at once.

A short-time Fourier transform with a Gaussian window, which is the intermediate-frequency filter, gives the envelope at each frequency; the
detectors process the envelopes step by step, as circuits. The memory does not depend on the length of the record.
It has no code in common with the formulas of `motoremi.emission`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft

from motoremi.arrays import FloatArray
from motoremi.errors import BadInput

# (bandwidth, charge, discharge, meter, averaging time of the RMS-average) of bands A and B of CISPR 16-1-1.
BANDS: Final = {"A": (200.0, 45e-3, 500e-3, 160e-3, 100e-3), "B": (9e3, 1e-3, 160e-3, 160e-3, 10e-3)}
# The window is cut off where it has decreased to 2e-4 of its height.
_HALF_WIDTH_SIGMAS = 4.1
# Envelope samples per standard deviation of the envelope of an impulse: the largest sample is at most 0.27 dB too low, 0.1 dB on average.
_PER_SIGMA = 2.0
_BATCH = 32
# Number of steps of the detector for each step of the meter, which is slow.
_METER_EVERY = 8


@dataclass(frozen=True)
class Reading:
    """Levels in dBuV, shape (n,) each, of all detectors over one record."""

    frequency_hz: FloatArray
    peak: FloatArray
    quasi_peak: FloatArray
    average: FloatArray
    rms_average: FloatArray

    def level(self, detector: str) -> FloatArray:
        """Levels of a detector by its name."""
        return getattr(self, detector.replace("-", "_"))


class TimeDomainReceiver:
    """Measures a sampled voltage at equally spaced frequencies.

    Parameters
    ----------
    sample_rate_hz : float
    frequency_hz : array_like, shape (n,)
        Equally spaced, below half the sample rate.
    band : {"A", "B"}
    noise_dbuv : float, optional
        Average reading of the receiver's own noise, added to every frequency.
    quasi_peak : bool
        Whether to run the quasi-peak detector, which takes as long as everything else; without it the peak levels are returned for it.
    seed : int
        Seed of the noise.
    keep : bool
        Keep all envelopes, so that `repeat` can run the quasi-peak detector over them once more.

    Raises
    ------
    BadInput
        For frequencies that are not equally spaced, or not below half the sample rate.
    """

    def __init__(
        self,
        sample_rate_hz: float,
        frequency_hz: ArrayLike,
        band: str = "B",
        noise_dbuv: float | None = None,
        quasi_peak: bool = True,
        seed: int = 0,
        keep: bool = False,
    ) -> None:
        if band not in BANDS:
            raise BadInput(f"unknown band {band!r}: use A or B")
        self.frequency_hz: FloatArray = np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
        self._check(sample_rate_hz)
        bandwidth, charge, discharge, self._meter_s, self._rms_s = BANDS[band]
        sigma_s = math.sqrt(2 * math.log(2)) / (math.pi * bandwidth)
        half = math.ceil(_HALF_WIDTH_SIGMAS * sigma_s * sample_rate_hz)
        time_s = np.arange(-half, half + 1) / sample_rate_hz
        window = np.exp(-0.5 * (time_s / sigma_s) ** 2)
        # A sine is indicated with its rms value: the transform of a sine of amplitude a is a/2 times the sum of the window.
        self._window: NDArray[np.float32] = (window * (math.sqrt(2) / window.sum())).astype(np.float32)
        self._hop = max(1, int(sigma_s * sample_rate_hz / _PER_SIGMA))
        self._step_s = self._hop / sample_rate_hz
        self._points, self._every, shift_hz = self._bins(sample_rate_hz, bandwidth)
        self._folds = -(-self._window.size // self._points)
        shift = np.exp(-2j * np.pi * shift_hz * np.arange(self._folds * self._points) / sample_rate_hz)
        self._turn: NDArray[np.complex64] | None = None if shift_hz == 0 else shift.astype(np.complex64)
        self._rest: NDArray[np.float32] = np.zeros(0, dtype=np.float32)
        self._noise_v = None if noise_dbuv is None else 1e-6 * 10 ** (noise_dbuv / 20) * 2 / math.sqrt(math.pi)
        # Correlation of two noise samples behind the filter, one hop apart.
        self._noise_memory = math.exp(-0.25 * (self._step_s / sigma_s) ** 2)
        self._rng = np.random.default_rng(seed)
        self._noise: NDArray[np.complex64] | None = None
        self._keep = keep
        self._kept: list[NDArray[np.float32]] = []
        self._detectors = _Detectors(self.frequency_hz.size, self._step_s, charge, discharge, self._meter_s, self._rms_s, quasi_peak)

    def _check(self, sample_rate_hz: float) -> None:
        if not (math.isfinite(sample_rate_hz) and sample_rate_hz > 0):
            raise BadInput(f"the sample rate is {sample_rate_hz}; it must be above 0")
        steps = np.diff(self.frequency_hz)
        if steps.size and (steps[0] <= 0 or not np.allclose(steps, steps[0], rtol=1e-6)):
            raise BadInput("the receiver reads equally spaced frequencies; give them in steps")
        if self.frequency_hz[0] <= 0 or self.frequency_hz[-1] >= sample_rate_hz / 2:
            raise BadInput(f"at {sample_rate_hz:g} samples a second only frequencies below {sample_rate_hz / 2:g} Hz can be read")

    def _bins(self, sample_rate_hz: float, bandwidth_hz: float) -> tuple[int, slice | NDArray[np.intp], float]:
        """Length of the transform, indices of the bins that are used, and frequency by which the signal is shifted down first."""
        first, size = float(self.frequency_hz[0]), self.frequency_hz.size
        step = float(self.frequency_hz[1]) - first if size > 1 else bandwidth_hz / 2
        # Bins at the distance of the frequencies, with the signal shifted if necessary; or bins at a fraction of that distance, without shift.
        for parts in (1, 2, 3, 4):
            points = parts * sample_rate_hz / step
            offset = first * parts / step
            whole = abs(points - round(points)) < 1e-6 and self._window.size <= 4 * points
            if whole and (parts == 1 or abs(offset - round(offset)) < 1e-6):
                start = math.floor(offset + 1e-6)
                shift_hz = first - start * step / parts
                return round(points), slice(start, start + parts * (size - 1) + 1, parts), shift_hz if abs(shift_hz) > 1e-6 * step else 0.0
        # Otherwise the nearest bin, at most a sixteenth of the bandwidth away (0.07 dB).
        length = int(fft.next_fast_len(math.ceil(8 * sample_rate_hz / bandwidth_hz), real=True))
        return length, np.rint(self.frequency_hz * length / sample_rate_hz).astype(np.intp), 0.0

    def feed(self, samples: ArrayLike) -> None:
        """Process the next samples, in volt."""
        data = np.concatenate([self._rest, np.asarray(samples, dtype=np.float32)])
        length = self._window.size
        count = max(0, (data.size - length) // self._hop + 1)
        for start in range(0, count, _BATCH):
            number = min(_BATCH, count - start)
            stretches = np.lib.stride_tricks.sliding_window_view(data, length)[start * self._hop :: self._hop][:number]
            envelope = np.abs(self._with_noise(self._filtered(stretches)))
            self._detectors.process(envelope)
            if self._keep:
                self._kept.append(envelope)
        self._rest = data[count * self._hop :].copy()

    def _filtered(self, stretches: NDArray[np.float32]) -> NDArray[np.complex64]:
        if not stretches.any():
            return np.zeros((len(stretches), self.frequency_hz.size), dtype=np.complex64)
        pieces = np.zeros((len(stretches), self._folds * self._points), dtype=np.float32)
        np.multiply(stretches, self._window, out=pieces[:, : self._window.size])
        folds = pieces.reshape(len(pieces), self._folds, self._points)
        if self._turn is None:
            spectrum = fft.rfft(folds.sum(axis=1) if self._folds > 1 else folds[:, 0], axis=1, workers=2)
        else:
            spectrum = fft.fft((folds * self._turn.reshape(self._folds, self._points)).sum(axis=1), axis=1, workers=2)
        return np.ascontiguousarray(spectrum[:, self._every])

    def _with_noise(self, filtered: NDArray[np.complex64]) -> NDArray[np.complex64]:
        if self._noise_v is None:
            return filtered
        fresh = self._rng.standard_normal((*filtered.shape, 2), dtype=np.float32).view(np.complex64)[..., 0] * np.float32(
            self._noise_v / math.sqrt(2)
        )
        now = fresh[0] if self._noise is None else self._noise
        new = math.sqrt(1 - self._noise_memory**2)
        for index in range(len(filtered)):
            now = self._noise_memory * now + new * fresh[index]
            filtered[index] += now
        self._noise = now
        return filtered

    @property
    def window_samples(self) -> int:
        """Length of the filter's window."""
        return int(self._window.size)

    def repeat(self) -> None:
        """Run the quasi-peak detector over the record so far once more; without effect unless envelopes are kept."""
        for envelope in self._kept:
            self._detectors.run_quasi_peak(envelope)

    def read(self) -> Reading:
        """The readings so far.

        Raises
        ------
        BadInput
            If the record is shorter than one window.
        """
        if not self._detectors.steps:
            raise BadInput(f"the record is too short: the filter alone needs {self._window.size} samples")
        peak, quasi, average, rms = (20 * np.log10(np.maximum(volt, 1e-15) / 1e-6) for volt in self._detectors.read())
        return Reading(self.frequency_hz, peak, quasi, average, rms)


class _Detectors:
    """Peak, quasi-peak, average and RMS-average of envelopes, step by step."""

    def __init__(self, size: int, step_s: float, charge_s: float, discharge_s: float, meter_s: float, rms_s: float, quasi_peak: bool) -> None:
        self.steps, self._weighed = 0, 0
        self._step_s, self._meter_s = step_s, meter_s
        self._fade = math.exp(-step_s / discharge_s)
        constant, self._sine = _sine_response(charge_s, discharge_s)
        self._gain = step_s / constant
        self._highest = np.zeros(size, dtype=np.float32)
        self._sum, self._power, self._rms_sum = (np.zeros(size) for _ in range(3))
        self._rms_steps, self._in_block, self._blocks = max(1, round(rms_s / step_s)), 0, 0
        self._voltage, self._drop, self._flow = (np.zeros(size, dtype=np.float32) for _ in range(3))
        self._needle, self._speed, self._shown = (np.zeros(size) for _ in range(3))
        self._quasi_peak = quasi_peak

    def process(self, envelope: NDArray[np.float32]) -> None:
        """Process envelopes, shape (steps, frequencies)."""
        np.maximum(self._highest, envelope.max(axis=0), out=self._highest)
        self._sum += envelope.sum(axis=0)
        self._blockwise(envelope)
        if self._quasi_peak:
            self.run_quasi_peak(envelope)
        self.steps += len(envelope)

    def run_quasi_peak(self, envelope: NDArray[np.float32]) -> None:
        """Run the quasi-peak detector and its meter."""
        for row in envelope:
            self._charge(row)
            self._weighed += 1
            if self._weighed % _METER_EVERY == 0:
                self._move()

    def _blockwise(self, envelope: NDArray[np.float32]) -> None:
        """Rms values over blocks of one averaging time."""
        start = 0
        while start < len(envelope):
            part = envelope[start : start + self._rms_steps - self._in_block]
            self._power += np.einsum("ij,ij->j", part, part)
            self._in_block += len(part)
            start += len(part)
            if self._in_block == self._rms_steps:
                self._rms_sum += np.sqrt(self._power / self._rms_steps)
                self._power[:] = 0
                self._in_block, self._blocks = 0, self._blocks + 1

    def _charge(self, envelope: NDArray[np.float32]) -> None:
        voltage, drop, flow = self._voltage, self._drop, self._flow
        voltage *= np.float32(self._fade)
        # The mean of the positive part of e cos(x) - v over a cycle is nearly e ((e - v)/e)^1.5 (0.3001 + 0.0182 (e - v)/e).
        np.subtract(envelope, voltage, out=drop)
        np.maximum(drop, np.float32(0), out=drop)
        np.divide(drop, envelope + np.float32(1e-20), out=flow)
        scale = np.float32(0.0182 * self._gain) * flow
        scale += np.float32(0.3001 * self._gain)
        np.sqrt(flow, out=flow)
        flow *= scale
        np.minimum(flow, np.float32(1), out=flow)
        flow *= drop
        voltage += flow

    def _move(self) -> None:
        """One step of the meter, which has two equal poles."""
        step = _METER_EVERY * self._step_s
        self._speed += step * ((self._voltage - self._needle) / self._meter_s - 2 * self._speed) / self._meter_s
        self._needle += step * self._speed
        np.maximum(self._shown, self._needle, out=self._shown)

    def read(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Rms values of the sines that give the same readings."""
        quasi: FloatArray = self._shown / self._sine if self._quasi_peak else self._highest.astype(np.float64)
        rms: FloatArray = self._rms_sum / self._blocks if self._blocks else np.sqrt(self._power / max(1, self._in_block))
        return self._highest.astype(np.float64), quasi, self._sum / self.steps, rms


@lru_cache(maxsize=2)
def _sine_response(charge_s: float, discharge_s: float) -> tuple[float, float]:
    """Charge constant with which the circuit reaches 63 % in `charge_s`, and its final voltage for a sine of amplitude 1, by simulation."""

    def run(constant: float) -> tuple[float, float]:
        step, voltage = charge_s / 200, 0.0
        trace: list[float] = []
        while len(trace) < 40 or trace[-1] - trace[-40] > 1e-7:
            drop = max(0.0, 1 - voltage)
            voltage += step * (drop**1.5 * (0.3001 + 0.0182 * drop) / constant - voltage / discharge_s)
            trace.append(voltage)
        return step * float(np.searchsorted(trace, (1 - math.exp(-1)) * voltage)), voltage

    low, high = 0.02 * charge_s, charge_s
    for _ in range(18):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if run(middle)[0] < charge_s else (low, middle)
    return middle, run(middle)[1]


def read_waveform(
    samples: ArrayLike | Iterator[FloatArray],
    sample_rate_hz: float,
    frequency_hz: ArrayLike,
    band: str = "B",
    quasi_peak: bool = True,
    noise_dbuv: float | None = None,
    repeats: int = 1,
    seed: int = 0,
) -> Reading:
    """Readings of a record, given as a whole or in blocks.

    Parameters
    ----------
    samples : array_like, shape (n,), or iterator of arrays
        Voltage at the receiver's input, in volt.
    sample_rate_hz : float
    frequency_hz : array_like, shape (m,)
        Equally spaced.
    band : {"A", "B"}
    quasi_peak : bool
        Whether to run the quasi-peak detector.
    noise_dbuv : float, optional
        Noise of the receiver with the average detector.
    repeats : int
        Number of times that the quasi-peak detector processes the record, as if it were periodic; the envelopes are kept in memory for that.
    seed : int
    """
    receiver = TimeDomainReceiver(sample_rate_hz, frequency_hz, band, noise_dbuv, quasi_peak, seed, keep=repeats > 1 and quasi_peak)
    block = int(0.02 * sample_rate_hz) + receiver.window_samples
    for part in _blocks(samples, block):
        receiver.feed(part)
    for _ in range(repeats - 1):
        receiver.repeat()
    return receiver.read()


def _blocks(samples: ArrayLike | Iterator[FloatArray], size: int) -> Iterator[FloatArray]:
    if isinstance(samples, Iterator):
        yield from samples
        return
    whole = np.asarray(samples, dtype=np.float64)
    for start in range(0, whole.size, size):
        yield whole[start : start + size]
