"""The simulated ESR: receiver scan, analyser sweep and marker on top of its profile."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from motoremi.virtual.simulated_band import band_commands
from motoremi.virtual.simulated_device import definite_block
from motoremi.virtual.simulated_receiver import SimulatedReceiver, ascii_levels, steps


class SimulatedESR(SimulatedReceiver):
    """An ESR whose input is connected to a test stand."""

    profile = "rohde_schwarz_esr.yaml"

    def power_on(self) -> None:
        """Marker at the first point, LISN at its first line."""
        super().power_on()
        self._marker = 0
        self._line = "L1"

    def commands(self) -> dict[str, Callable[[str], bytes | None]]:
        """What the ESR computes."""
        return {
            **super().commands(),
            "INIT": lambda _: self._sweep_analyser(),
            "INIT:CONM": lambda _: self._sweep_analyser(),
            "INIT2": lambda _: self._scan(),
            "ABOR": lambda _: self.stop(),
            "TRAC?": self._trace,
            "STAT:QUES:POW:COND?": lambda _: b"0",
            "STAT:QUES:POW?": lambda _: self.read_overload(),
            "CALC:MARK": lambda _: None,
            "CALC:MARK:MAX": lambda _: self._to_peak(),
            "CALC:MARK:X?": lambda _: f"{self._frequency_hz[self._marker]:.6f}".encode() if self._frequency_hz.size else b"0",
            "CALC:MARK:Y?": lambda _: f"{self.levels(self.value('unit'))[self._marker]:.3f}".encode() if self._frequency_hz.size else b"0",
            "INP:LISN:PHAS": self._switch_line,
            "INP:LISN:PHAS?": lambda _: self._line.encode(),
            **band_commands(self, "FREQ:CENT", "FREQ:SPAN", "analyser_start", "analyser_stop"),
            # Returns the instrument to local operation, on a socket.
            "&GTL": lambda _: None,
        }

    def _scan(self) -> None:
        """The receiver's scan."""
        frequency_hz = steps(*(float(self.value(name)) for name in ("start", "stop", "step")))
        preamplifier = self.value("preamplifier") == "ON"
        self.measure(
            frequency_hz, self.value("detector"), float(self.value("attenuation")), preamplifier, frequency_hz.size * float(self.value("dwell"))
        )

    def _sweep_analyser(self) -> None:
        """A sweep in analyser mode. In receiver mode, one reading of the bargraph, which is not simulated."""
        if self.value("mode") == "SAN":
            frequency_hz = np.linspace(self.value("analyser_start"), self.value("analyser_stop"), self.value("analyser_points"))
            self.measure(frequency_hz, "POS", float(self.value("analyser_attenuation")), False, float(self.value("analyser_sweep_time")))

    def _switch_line(self, argument: str) -> None:
        if argument.upper() not in ("L1", "L2", "L3", "N"):
            self.note_error("execution_error")
            return
        self._line = argument.upper()
        self.wiring.at_line(self._line)

    def _to_peak(self) -> None:
        self._marker = int(np.argmax(self._levels_dbuv)) if self._levels_dbuv.size else 0

    def _trace(self, argument: str) -> bytes | None:
        if argument.upper() != "TRACE1":
            self.note_error("execution_error")
            return None
        levels = self.levels(self.value("unit"))
        return ascii_levels(levels) if self.value("format") == "ASC" else definite_block(levels, "<f4")


class SimulatedESRP(SimulatedESR):
    """An ESRP."""

    profile = "rohde_schwarz_esrp.yaml"


class SimulatedESW(SimulatedESR):
    """An ESW."""

    profile = "rohde_schwarz_esw.yaml"


class SimulatedESCI(SimulatedESR):
    """An ESCI."""

    profile = "rohde_schwarz_esci.yaml"


class SimulatedESU(SimulatedESR):
    """An ESU."""

    profile = "rohde_schwarz_esu.yaml"
