"""Base class of the simulated receivers: scans, overload, units and transfer formats."""

from __future__ import annotations

import math

import numpy as np

from motoremi.arrays import FloatArray
from motoremi.virtual.simulated_device import Wiring
from motoremi.virtual.simulated_scpi import SimulatedScpi

DETECTORS = {
    "POS": "peak",
    "QPE": "quasi-peak",
    "AVER": "average",
    "CAV": "cispr-average",
    "EAV": "cispr-average",
    "CRMS": "rms-average",
    "RAV": "rms-average",
}
METER_S = 0.160
# Level at the mixer, in dBuV, above which it compresses.
MIXER_LIMIT_DBUV = 97.0
PREAMPLIFIER_DB = 20.0
RF_OVERLOAD = 1
BAND_B_HZ: FloatArray = 150e3 + 4.5e3 * np.arange(6634, dtype=np.float64)
BAND_B_END_HZ = 30e6
# Scans with at most this many points are interpolated from one scan of the whole band, because simulating five points takes as long as all.
SHORT_SCAN = 8
# Scans with a finer step than this, far finer than the 9 kHz filter, are interpolated too.
FINE_STEP_HZ = 1e3
# Limit that protects this computer's memory; more than any receiver stores for one trace.
MOST_POINTS = 1_000_000
NOTHING_DBUV = -200.0
# Correction that the instrument adds by itself while it is switched on, as for an attenuator at its input.
OWN_CORRECTION_DB = 10.0
DBUV_OF_0_DBM = 106.98970004336019


class SimulatedReceiver(SimulatedScpi):
    """A receiver whose input is connected to a test stand."""

    def power_on(self) -> None:
        """Nothing scanned yet."""
        super().power_on()
        self._ends_s = 0.0
        self._frequency_hz: FloatArray = np.zeros(0)
        self._levels_dbuv: FloatArray = np.zeros(0)
        self._overload_event = 0

    def busy_until(self) -> float:
        """When the running scan ends."""
        return self._ends_s

    def measure(
        self, frequency_hz: FloatArray, detector: str, attenuation_db: float, preamplifier: bool, duration_s: float, dwell_s: float | None = None
    ) -> None:
        """Start a scan; `detector` is the instrument's word, `dwell_s` the time at each frequency (of a sweep: within its filter)."""
        upwards = frequency_hz.size == 1 or (frequency_hz.size > 1 and frequency_hz[-1] > frequency_hz[0])
        if not upwards or frequency_hz.size > MOST_POINTS:
            self.note_error("execution_error")
            return
        arriving = self.arriving(frequency_hz, DETECTORS[detector])
        limit_dbuv = MIXER_LIMIT_DBUV + attenuation_db - (PREAMPLIFIER_DB if preamplifier else 0.0)
        if np.any(arriving > limit_dbuv):
            self._overload_event |= RF_OVERLOAD
        self._frequency_hz = frequency_hz
        self._levels_dbuv = np.minimum(arriving, limit_dbuv) + settling_db(DETECTORS[detector], dwell_s or duration_s / frequency_hz.size)
        self._ends_s = self.clock.now() + duration_s

    def arriving(self, frequency_hz: FloatArray, detector: str) -> FloatArray:
        """Level at the input in dBuV."""
        return arriving_dbuv(self.wiring, frequency_hz, detector)

    def stop(self) -> None:
        """Stop the running scan."""
        self._ends_s = self.clock.now()

    def levels(self, unit: str) -> FloatArray:
        """Levels of the last scan, with the instrument's own correction."""
        return self._levels_dbuv + self.correction_db() - (DBUV_OF_0_DBM if unit == "DBM" else 0.0)

    def correction_db(self) -> float:
        """Correction in dB that the instrument applies by itself."""
        return OWN_CORRECTION_DB if self.value("own_correction") == "ON" else 0.0

    def read_overload(self) -> bytes:
        """The overload event register, which reading clears."""
        event, self._overload_event = self._overload_event, 0
        return str(event).encode()

    def _clear_status(self, argument: str) -> None:
        super()._clear_status(argument)
        self._overload_event = 0

    def _reset(self, argument: str) -> None:
        # A reset keeps corrections and external gain, as on the X-series, and installed options.
        kept = {name: self.value(name) for name in ("own_correction", "external_gain", "emi_option") if self.has(name)}
        super()._reset(argument)
        for name, value in kept.items():
            self.set_value(name, value)


def settling_db(detector: str, dwell_s: float) -> float:
    """Error in dB of a meter that has not settled within the dwell: two equal poles of 160 ms (CISPR 16-1-1, band B), starting from zero.

    Peak and the linear average have no meter time constant.
    """
    if detector in ("peak", "average"):
        return 0.0
    x = dwell_s / METER_S
    return 20 * math.log10(max(1 - (1 + x) * math.exp(-x), 1e-5))


def arriving_dbuv(wiring: Wiring, frequency_hz: FloatArray, detector: str) -> FloatArray:
    """Level at the input in dBuV: simulated at the points of a scan within band B, else interpolated from one scan of that band.

    Outside of the band there is no signal.
    """
    if frequency_hz.size <= SHORT_SCAN or frequency_hz[1] - frequency_hz[0] < FINE_STEP_HZ:
        return read_off_the_band(wiring, frequency_hz, detector)
    inside = BAND_B_HZ[0] <= frequency_hz[0] and frequency_hz[-1] <= BAND_B_END_HZ
    if inside and frequency_hz.size <= 2 * BAND_B_HZ.size:
        return wiring.level_dbuv(frequency_hz, detector)
    return read_off_the_band(wiring, frequency_hz, detector)


def read_off_the_band(wiring: Wiring, frequency_hz: FloatArray, detector: str) -> FloatArray:
    """Level at any frequencies, interpolated from one scan of band B, whose simulation takes seconds and is done once."""
    level = np.interp(frequency_hz, BAND_B_HZ, wiring.level_dbuv(BAND_B_HZ, detector))
    # The last step of the band ends a little before 30 MHz.
    inside = (BAND_B_HZ[0] <= frequency_hz) & (frequency_hz <= BAND_B_END_HZ)
    return np.where(inside, level, NOTHING_DBUV)


def steps(start_hz: float, stop_hz: float, step_hz: float) -> FloatArray:
    """Frequencies of a scan table; none if there are too many. The small addition keeps a last step that rounding would lose."""
    if step_hz * MOST_POINTS < stop_hz - start_hz:
        return np.zeros(0)
    return start_hz + step_hz * np.arange(int((stop_hz - start_hz) / step_hz + 1e-6) + 1, dtype=np.float64)


def ascii_levels(levels: FloatArray) -> bytes:
    """Levels as text."""
    return ",".join(f"{level:.3f}" for level in levels).encode()
