"""The simulated ESR: SCPI spelling, scan, overload and error logic on top of its profile."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from motoremi.arrays import FloatArray
from motoremi.bench.clock import Clock
from motoremi.bench.simulated_device import Wiring, definite_block
from motoremi.bench.simulated_scpi import SimulatedScpi

DETECTORS = {"POS": "peak", "QPE": "quasi-peak", "AVER": "average"}
# Level at the mixer, in dBuV, above which it compresses.
MIXER_LIMIT_DBUV = 97.0
RF_OVERLOAD = 1


class SimulatedESR(SimulatedScpi):
    """An ESR whose input is connected to a test stand."""

    def __init__(self, wiring: Wiring, clock: Clock) -> None:
        self._ends_s = 0.0
        self._levels: FloatArray = np.zeros(0)
        self._overload_event = 0
        super().__init__("rohde_schwarz_esr.yaml", wiring, clock)

    def commands(self) -> dict[str, Callable[[str], bytes | None]]:
        """What the ESR computes."""
        return {
            "INIT2": lambda _: self._scan(),
            "INIT2:IMM": lambda _: self._scan(),
            "ABOR": lambda _: self._stop(),
            "TRAC?": self._trace,
            "TRAC:DATA?": self._trace,
            "TRAC1?": self._trace,
            "STAT:QUES:POW:COND?": lambda _: b"0",
            "STAT:QUES:POW:EVEN?": lambda _: self._read_overload(),
            "STAT:QUES:POW?": lambda _: self._read_overload(),
        }

    def busy_until(self) -> float:
        """When the running scan ends."""
        return self._ends_s

    def _scan(self) -> None:
        start, stop, step = (float(self.value(name)) for name in ("start", "stop", "step"))
        frequency_hz = start + step * np.arange(int((stop - start) / step + 1e-6) + 1, dtype=np.float64)
        arriving = self.wiring.level_dbuv(frequency_hz, DETECTORS[self.value("detector")])
        attenuation = float(self.value("attenuation"))
        if np.any(arriving - attenuation > MIXER_LIMIT_DBUV):
            self._overload_event |= RF_OVERLOAD
        self._levels = np.minimum(arriving, MIXER_LIMIT_DBUV + attenuation)
        self._ends_s = self.clock.now() + frequency_hz.size * float(self.value("dwell"))

    def _stop(self) -> None:
        self._ends_s = self.clock.now()

    def _trace(self, argument: str) -> bytes | None:
        if argument.upper() != "TRACE1":
            self.error_response("execution_error")
            return None
        if self.value("format") == "ASC":
            return ",".join(f"{level:.3f}" for level in self._levels).encode()
        return definite_block(self._levels, "<f4")

    def _read_overload(self) -> bytes:
        event, self._overload_event = self._overload_event, 0
        return str(event).encode()

    def _clear_status(self, argument: str) -> None:
        super()._clear_status(argument)
        self._overload_event = 0
