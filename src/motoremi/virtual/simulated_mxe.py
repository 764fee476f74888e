"""The simulated MXE: the frequency scan of the EMI receiver mode on top of its profile."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from motoremi.virtual.simulated_band import band_commands
from motoremi.virtual.simulated_device import definite_block
from motoremi.virtual.simulated_receiver import SimulatedReceiver, ascii_levels

INPUT_OVERLOAD = 16


class SimulatedMxe(SimulatedReceiver):
    """An MXE whose input is connected to a test stand."""

    profile = "keysight_mxe.yaml"

    def commands(self) -> dict[str, Callable[[str], bytes | None]]:
        """What the MXE computes."""
        return {
            **super().commands(),
            "CONF:FSC": lambda _: self.stop(),
            "INIT2": lambda _: self._scan(),
            "INIT2:REST": lambda _: self._scan(),
            "ABOR": lambda _: self.stop(),
            "TRAC:FSC?": self._trace,
            "TRAC:DATA?": self._trace,
            "STAT:QUES:INT?": lambda _: self._overload_event_register(),
            "STAT:QUES:INT:COND?": lambda _: b"0",
            "CALC:FSC:SLIS:DEL:ALL": lambda _: None,
            **band_commands(self, "FREQ:CENT", "FREQ:SPAN", "analyser_start", "analyser_stop"),
        }

    def _scan(self) -> None:
        if self.value("mode") != "EMI" or self.value("row_2") != "ON":
            self.note_error("execution_error")
            return
        frequency_hz = np.linspace(self.value("start"), self.value("stop"), self.value("points"))
        preamplifier = self.value("preamplifier") == "ON"
        self.measure(frequency_hz, self.value("detector"), float(self.value("attenuation")), preamplifier, float(self.value("scan_time")))

    def _trace(self, argument: str) -> bytes | None:
        if argument.upper() != "TRACE1":
            self.note_error("execution_error")
            return None
        order = "<" if self.value("byte_order") == "SWAP" else ">"
        match self.value("format"):
            case "INT,32":
                # Thousandths of a dBm, whatever unit is displayed.
                return definite_block(np.round(self.levels("DBM") * 1e3), f"{order}i4")
            case "REAL,32":
                return definite_block(self.levels("DBUV"), f"{order}f4")
            case _:
                return ascii_levels(self.levels("DBUV"))

    def _overload_event_register(self) -> bytes:
        return str(INPUT_OVERLOAD if self.read_overload() != b"0" else 0).encode()


class SimulatedN6141(SimulatedMxe):
    """An MXA with the EMI measurement application."""

    profile = "keysight_n6141.yaml"
