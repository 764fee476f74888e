"""What the simulated receivers share: a scan of what arrives, overload, units and transfer formats."""

from __future__ import annotations

import numpy as np

from motoremi.arrays import FloatArray
from motoremi.bench.clock import Clock
from motoremi.bench.simulated_device import Wiring
from motoremi.bench.simulated_scpi import SimulatedScpi

DETECTORS = {"POS": "peak", "QPE": "quasi-peak", "AVER": "average", "EAV": "average"}
# Level at the mixer, in dBuV, above which it compresses.
MIXER_LIMIT_DBUV = 97.0
PREAMPLIFIER_DB = 20.0
RF_OVERLOAD = 1
DBUV_OF_0_DBM = 106.98970004336019


class SimulatedReceiver(SimulatedScpi):
    """A receiver whose input is connected to a test stand."""

    def __init__(self, profile: str, wiring: Wiring, clock: Clock) -> None:
        self._ends_s = 0.0
        self._frequency_hz: FloatArray = np.zeros(0)
        self._levels_dbuv: FloatArray = np.zeros(0)
        self._overload_event = 0
        super().__init__(profile, wiring, clock)

    def busy_until(self) -> float:
        """When the running scan ends."""
        return self._ends_s

    def measure(self, frequency_hz: FloatArray, detector: str, attenuation_db: float, preamplifier: bool, duration_s: float) -> None:
        """Start a scan; `detector` is the instrument's word."""
        # A sweep that begins at 0 Hz sees its own local oscillator there, not the motor.
        arriving = self.wiring.level_dbuv(np.maximum(frequency_hz, 10.0), DETECTORS[detector])
        limit_dbuv = MIXER_LIMIT_DBUV + attenuation_db - (PREAMPLIFIER_DB if preamplifier else 0.0)
        if np.any(arriving > limit_dbuv):
            self._overload_event |= RF_OVERLOAD
        self._frequency_hz = frequency_hz
        self._levels_dbuv = np.minimum(arriving, limit_dbuv)
        self._ends_s = self.clock.now() + duration_s

    def stop(self) -> None:
        """Stop the running scan."""
        self._ends_s = self.clock.now()

    def levels(self, unit: str) -> FloatArray:
        """Levels of the last scan."""
        return self._levels_dbuv - (DBUV_OF_0_DBM if unit == "DBM" else 0.0)

    def read_overload(self) -> bytes:
        """The overload event register, which reading clears."""
        event, self._overload_event = self._overload_event, 0
        return str(event).encode()

    def _clear_status(self, argument: str) -> None:
        super()._clear_status(argument)
        self._overload_event = 0


def steps(start_hz: float, stop_hz: float, step_hz: float) -> FloatArray:
    """Frequencies of a scan table; the small addition keeps a last step that rounding would lose."""
    axis: FloatArray = start_hz + step_hz * np.arange(int((stop_hz - start_hz) / step_hz + 1e-6) + 1, dtype=np.float64)
    return axis


def ascii_levels(levels: FloatArray) -> bytes:
    """Levels as text."""
    return ",".join(f"{level:.3f}" for level in levels).encode()
