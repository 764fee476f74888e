"""The EMI receiver by formula: filter, detectors, noise floor, attenuator, preamplifier."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np
from scipy.special import ndtri

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.data.spectrum import Detector
from motoremi.emission.band import BAND_B, Band
from motoremi.emission.reading import Readings, noise_unit, pulses_on_noise, read_comb, read_events, rician_mean, separate
from motoremi.emission.source import Source
from motoremi.errors import BadInput

# Thermal noise at 290 K in 50 Ohm, in dBuV in 1 Hz: -174 dBm + 107 dB.
_THERMAL_DBUV_HZ = -67.0
# Exponent of the mean maximum of two peaks that each scatter by 0.8 dB, like those of noise with a dwell of 50 ms.
_SCATTERING = 10
FIELDS: Mapping[Detector, str] = {
    "peak": "peak",
    "quasi-peak": "quasi_peak",
    "average": "average",
    # Commutation repeats many times within the meter's 160 ms, so that the meter shows the average.
    "cispr-average": "average",
    "rms-average": "rms_average",
}


@dataclass(frozen=True, eq=False)
class Background:
    """What the receiver reads without the commutation.

    Parameters
    ----------
    steady : Readings, optional
        Of lines: a chopper, stations.
    noise : Readings
    ground : Readings
        Lines and noise together.
    """

    steady: Readings | None
    noise: Readings
    ground: Readings

    @classmethod
    def of(cls, steady: Readings | None, noise: Readings) -> Background:
        """Lines in noise."""
        if steady is None:
            return cls(None, noise, noise)
        ground = Readings(
            np.hypot(steady.peak, noise.peak),
            np.hypot(steady.quasi_peak, noise.quasi_peak),
            rician_mean(steady.average, noise.average),
            np.hypot(steady.rms_average, noise.rms_average),
        )
        return cls(steady, noise, ground)


@dataclass(frozen=True)
class Receiver:
    """Settings of the receiver.

    Parameters
    ----------
    band : Band
    noise_figure_db : float
        Without attenuation and preamplifier.
    attenuation_db : float
    preamplifier : bool
        20 dB in front of the mixer; the noise figure is then assumed to be 5 dB lower.
    dwell_s : float
        Time at each frequency; the peak of noise increases with it.
    """

    band: Band = BAND_B
    noise_figure_db: float = 10.0
    attenuation_db: float = 10.0
    preamplifier: bool = False
    dwell_s: float = 0.05

    def __post_init__(self) -> None:
        for name in ("noise_figure_db", "attenuation_db"):
            if not 0 <= getattr(self, name) <= 100:
                raise BadInput(f"the receiver's {name} is {getattr(self, name)}; it must be between 0 and 100")
        if not (math.isfinite(self.dwell_s) and self.dwell_s > 0):
            raise BadInput(f"the receiver's dwell_s is {self.dwell_s}; it must be above 0")

    @property
    def floor_dbuv(self) -> float:
        """Reading of the average detector without a signal."""
        figure = self.noise_figure_db - (5.0 if self.preamplifier else 0.0)
        power = _THERMAL_DBUV_HZ + 10 * math.log10(self.band.noise_bandwidth_hz) + figure + self.attenuation_db
        return power - 20 * math.log10(2 / math.sqrt(math.pi))

    def read(
        self,
        source: Source,
        frequency_hz: FloatArray,
        transfer: ComplexArray,
        noise: Readings | None = None,
        lines: Readings | None = None,
        weigh: bool = True,
    ) -> dict[Detector, FloatArray]:
        """Levels in dBuV of all detectors.

        Parameters
        ----------
        source : Source
        frequency_hz : ndarray, shape (n,)
        transfer : ndarray of complex, shape (n,)
            Receiver voltage per volt of the source.
        noise : Readings, optional
            Readings with the motor off; by default the receiver's own noise.
        lines : Readings, optional
            Stations.
        weigh : bool
            Whether to compute the quasi-peak levels, which take most of the time; without it they are left out.
        """
        if noise is None:
            noise = self.noise(np.full(frequency_hz.shape, self.floor_dbuv))
        background = Background.of(self.steady(source, frequency_hz, transfer, lines, weigh), noise)
        return self.read_over(background, source, frequency_hz, transfer, weigh)

    def read_over(
        self, background: Background, source: Source, frequency_hz: FloatArray, transfer: ComplexArray, weigh: bool = True
    ) -> dict[Detector, FloatArray]:
        """Levels in dBuV of all detectors, as `read` gives them, from what does not depend on the speed of the motor."""
        ground = background.ground
        if source.step_v or source.arc is not None:
            ground = self._with_events(background, source, frequency_hz, np.abs(transfer), weigh)
        wanted = {detector: name for detector, name in FIELDS.items() if weigh or detector != "quasi-peak"}
        return {detector: 20 * np.log10(getattr(ground, name) / 1e-6) for detector, name in wanted.items()}

    def noise(self, average_dbuv: FloatArray) -> Readings:
        """Gaussian noise of a given average reading, shape (n,), on all detectors."""
        return noise_unit(self.band, self.dwell_s).scaled(1e-6 * 10 ** (average_dbuv / 20))

    def steady(
        self, source: Source, frequency_hz: FloatArray, transfer: ComplexArray, lines: Readings | None = None, weigh: bool = True
    ) -> Readings | None:
        """Readings that do not depend on the speed of the motor: the chopper's comb, the paper's source, stations; None without any."""
        parts = [] if lines is None else [lines]
        if source.chopper is not None:
            chopper = source.chopper

            def density(at_hz: FloatArray) -> ComplexArray:
                # The transfer function is nearly constant between the lines within one bandwidth.
                return np.asarray(chopper.density(at_hz) * np.interp(at_hz, frequency_hz, np.abs(transfer)), dtype=np.complex128)

            parts.append(read_comb(frequency_hz, chopper.frequency_hz, density, self.band, weigh))
        if source.high_pass is not None:
            parts.append(Readings.of_lines(source.high_pass.voltage(frequency_hz) * np.abs(transfer)))
        if not parts:
            return None
        both = parts[0]
        for part in parts[1:]:
            both = Readings(*(np.hypot(getattr(both, name), getattr(part, name)) for name in dict.fromkeys(FIELDS.values())))
        return both

    def _with_events(self, background: Background, source: Source, frequency_hz: FloatArray, gain: FloatArray, weigh: bool) -> Readings:
        ground, steady, noise = background.ground, background.steady, background.noise
        coming = source.repetition_hz * (1 - source.missing_share)
        density = np.abs(source.density(frequency_hz)) * gain
        events = read_events(frequency_hz, density, source.repetition_hz, self.band, source.jitter_s, source.missing_share, weigh)
        # Expected maximum of many events, which scatter by themselves and because of the noise in phase with them.
        number = max(2.0, self.dwell_s * coming)
        scatter = np.hypot(source.arc.spread * events.peak if source.arc is not None else 0.0, noise.rms_average / math.sqrt(2))
        highest = events.peak + scatter * float(ndtri((number - 0.375) / (number + 0.25)))
        peak = _higher(highest + (0.0 if steady is None else steady.peak), ground.peak)
        if separate(source.repetition_hz, self.band):
            average = pulses_on_noise(events.peak, ground.average, coming, self.band)
        else:
            average = rician_mean(events.average, ground.average)
        quasi_peak = np.hypot(ground.quasi_peak, events.quasi_peak)
        return Readings(peak, quasi_peak, average, np.hypot(ground.rms_average, events.rms_average))

    def to_dict(self) -> JsonDict:
        """Plain data."""
        return {**asdict(self), "band": self.band.name, "resolution_bandwidth_hz": self.band.bandwidth_hz}


def _higher(one: FloatArray, other: FloatArray) -> FloatArray:
    """Expected maximum of two readings that both scatter: 0.6 dB above them if they are equal."""
    low, high = np.minimum(one, other), np.maximum(one, other)
    return high * (1 + (low / high) ** _SCATTERING) ** (1 / _SCATTERING)
