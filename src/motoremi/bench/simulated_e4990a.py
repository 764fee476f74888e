"""The simulated E4990A: triggering, parameters, data formats and fixture compensation on top of its profile."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from motoremi.arrays import FloatArray
from motoremi.bench.clock import Clock
from motoremi.bench.shown_quantities import QUANTITIES
from motoremi.bench.simulated_bridge import SimulatedBridge, pairs
from motoremi.bench.simulated_device import Wiring, definite_block
from motoremi.bench.simulated_scpi import SimulatedScpi

STANDARDS = {"OPEN": "open", "SHOR": "short", "LOAD": "load"}
MEASURING = 16
# Words of PAR:DEF.
PARAMETERS = {
    "Z": "|Z|",
    "TZ": "phase of Z",
    "R": "R",
    "X": "X",
    "Y": "|Y|",
    "TY": "phase of Y",
    "G": "G",
    "B": "B",
    "LS": "Ls",
    "LP": "Lp",
    "CS": "Cs",
    "CP": "Cp",
    "RS": "R",
    "RP": "Rp",
    "Q": "Q",
    "D": "D",
    "IMP": "Z",
    "ADM": "Y",
}


class SimulatedE4990A(SimulatedBridge, SimulatedScpi):
    """An E4990A with a fixture, connected to a test stand."""

    def __init__(self, wiring: Wiring, clock: Clock) -> None:
        self._selected = 1
        super().__init__("keysight_e4990a.yaml", wiring, clock)

    def commands(self) -> dict[str, Callable[[str], bytes | None]]:
        """What the E4990A computes."""
        table: dict[str, Callable[[str], bytes | None]] = {
            "SYST:PRES": self._reset,
            "ABOR": lambda _: self.set_continuous(False),
            "INIT": lambda _: self._trigger("INT"),
            "TRIG": lambda _: self._trigger("BUS"),
            "TRIG:SING": lambda _: self._trigger("BUS"),
            "*TRG": lambda _: self._trigger("BUS"),
            "STAT:OPER:COND?": lambda _: str(MEASURING if self.busy_until() > self.clock.now() else 0).encode(),
            "FREQ:DATA?": lambda _: self._array(self.axis()),
            "CALC:PAR1:SEL": partial(self._select, 1),
            "CALC:PAR2:SEL": partial(self._select, 2),
            "CALC:DATA:FDAT?": lambda _: self._array(self._formatted()),
            "CALC:DATA:RDAT?": lambda _: self._array(pairs(self.impedance_ohm())),
            "DISP:WIND1:TRAC1:Y:AUTO": lambda _: None,
            "DISP:WIND1:TRAC2:Y:AUTO": lambda _: None,
        }
        for word, standard in STANDARDS.items():
            table[f"CORR2:COLL:ACQ:{word}"] = partial(self._acquire, standard)
            table[f"CORR2:{word}"] = partial(self.enable, standard)
            table[f"CORR2:{word}?"] = partial(self._is_enabled, standard)
        return table

    def sweeps_continuously(self) -> bool:
        """With the internal trigger, if initiated again and again."""
        return bool(self.value("continuous") == "ON" and self.value("trigger") == "INT")

    def _trigger(self, source: str) -> None:
        if self.value("trigger") != source:
            self.error_response("trigger_ignored")
            return
        self.sweep()

    def _acquire(self, standard: str, _: str) -> None:
        self.measure_standard(standard)

    def _is_enabled(self, standard: str, _: str) -> bytes:
        return b"1" if self.is_enabled(standard) else b"0"

    def _select(self, parameter: int, _: str) -> None:
        if parameter > int(self.value("parameters")):
            self.error_response("execution_error")
            return
        self._selected = parameter

    def _formatted(self) -> FloatArray:
        """Two values a point of the selected parameter; the second one is 0 unless the parameter is complex."""
        impedance = self.impedance_ohm()
        if not impedance.any():
            return np.zeros(2 * impedance.size)
        name = PARAMETERS[self.value(f"parameter_{self._selected}")]
        return pairs(QUANTITIES[name](impedance, 2 * np.pi * self.axis()))

    def _array(self, values: FloatArray) -> bytes:
        if self.value("format") == "ASC":
            return ",".join(_three_digit_exponent(value) for value in values).encode()
        size = "f4" if self.value("format") == "REAL32" else "f8"
        return definite_block(values, f"{'<' if self.value('byte_order') == 'SWAP' else '>'}{size}")

    def _reset(self, argument: str) -> None:
        super()._reset(argument)
        self._selected = 1


def _three_digit_exponent(value: float) -> str:
    mantissa, _, exponent = f"{value:+.11E}".partition("E")
    return f"{mantissa}E{int(exponent):+04d}"
