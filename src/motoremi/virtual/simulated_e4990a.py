"""The simulated E4990A: triggering, parameters, data formats and fixture compensation on top of its profile."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.bench.sweep_options import Segment
from motoremi.virtual.shown_quantities import QUANTITIES
from motoremi.virtual.simulated_band import band_commands
from motoremi.virtual.simulated_bridge import SimulatedBridge, pairs
from motoremi.virtual.simulated_device import definite_block
from motoremi.virtual.simulated_scpi import SimulatedScpi

PARAMETER_COUNT = 4
# Head of the table of a segment sweep: version 7, start and stop as edges, and six columns that are absent; the number of segments follows.
SEGMENT_HEAD = (7, 0, 0, 0, 0, 0, 0, 0)
MOST_BIAS_A = 0.1
STANDARDS = {"OPEN": "open", "SHOR": "short", "LOAD": "load"}
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
    """An E4990A with a fixture, connected to a test stand.

    Headers and words are those that public programs send; `:SENS1:SEGM:DATA` is accepted only in the form that they send.
    """

    # `SENS:APER:TIME` is `SENS:APER`, `TRIG:SEQ:AVER` is `TRIG:AVER`.
    IMPLIED_NODES = SimulatedScpi.IMPLIED_NODES | {"TIME", "SEQ"}
    profile = "keysight_e4990a.yaml"
    LIST = "SEGM"

    def power_on(self) -> None:
        """Parameter 1 is selected."""
        super().power_on()
        self._selected = 1

    def commands(self) -> dict[str, Callable[[str], bytes | None]]:
        """What the E4990A computes."""
        table: dict[str, Callable[[str], bytes | None]] = {
            **super().commands(),
            "SYST:PRES": self._reset,
            "ABOR": lambda _: self.set_continuous(False),
            "INIT": lambda _: self._trigger("INT"),
            "TRIG": lambda _: self._trigger("BUS"),
            "TRIG:SING": lambda _: self._trigger("BUS"),
            "*TRG": lambda _: self._trigger("BUS"),
            "FREQ:DATA?": lambda _: self._array(self.axis()),
            "CALC:DATA:FDAT?": lambda _: self._array(self._formatted()),
            "CALC:DATA:RDAT?": lambda _: self._array(pairs(self.impedance_ohm())),
            "CALC:AVER:CLE": lambda _: self.restart_average(),
            "SEGM:DATA": self._read_segments,
            "SEGM:DATA?": lambda _: self._print_segments(),
            "SEGM:SWE:POIN?": lambda _: f"{sum(one.points for one in self._segments):+d}".encode(),
            "DC:MEAS:CLE": lambda _: None,
            "DC:MEAS:DATA:DCI?": lambda _: self._monitored(self.bias_current_a()),
            "DC:MEAS:DATA:DCV?": lambda _: self._monitored(float(self.value("bias_volt")) if self.value("bias") == "1" else 0.0),
            "CALC:MARK:FUNC:EXEC": lambda _: None,
            "DISP:WIND1:TRAC1:Y:AUTO": lambda _: None,
            "DISP:WIND1:TRAC2:Y:AUTO": lambda _: None,
            **{f"CALC:PAR{number}:SEL": partial(self._select, number) for number in range(1, PARAMETER_COUNT + 1)},
            **band_commands(self, "FREQ:CENT", "FREQ:SPAN", "start", "stop"),
        }
        for word, standard in STANDARDS.items():
            table[f"CORR2:COLL:ACQ:{word}"] = partial(self._acquire, standard)
            table[f"CORR2:{word}"] = partial(self.enable, standard)
            table[f"CORR2:{word}?"] = partial(self._is_enabled, standard)
            table[f"CORR2:ZME:{word}:FREQ?"] = partial(self._print_standard, standard, lambda kept: kept[0])
            table[f"CORR2:ZME:{word}:DATA?"] = partial(self._print_standard, standard, lambda kept: pairs(kept[1]))
            table[f"CORR2:ZME:{word}:POIN?"] = partial(self._count_standard, standard)
        return table

    def sweeps_continuously(self) -> bool:
        """With the internal trigger and continuous initiation."""
        return bool(self.value("continuous") == "1" and self.value("trigger") == "INT")

    def _trigger(self, source: str) -> None:
        if self.value("trigger") != source:
            self.note_error("trigger_ignored")
            return
        self.sweep(int(self.value("sweep_averages")) if self.value("sweep_averaging") == self.value("averaging_trigger") == "1" else 1)

    def _read_segments(self, argument: str) -> None:
        try:
            values = [float(text) for text in argument.split(",")]
        except ValueError:
            values = []
        head, rows = values[: len(SEGMENT_HEAD) + 1], values[len(SEGMENT_HEAD) + 1 :]
        if tuple(head[:-1]) != SEGMENT_HEAD or len(rows) != 3 * head[-1]:
            self.note_error("execution_error")
            return
        self.take_list([Segment(rows[i], rows[i + 1], int(rows[i + 2])) for i in range(0, len(rows), 3)])

    def _print_segments(self) -> bytes:
        rows = [f"{one.start_hz:.11E},{one.stop_hz:.11E},{one.points}" for one in self._segments]
        return ",".join([*map(str, SEGMENT_HEAD), str(len(rows)), *rows]).encode()

    def _monitored(self, value: float) -> bytes:
        """A reading of the bias monitor; the source limits the current."""
        seen = min(max(value, -MOST_BIAS_A), MOST_BIAS_A) if abs(value) == np.inf else value
        return _three_digit_exponent(seen if self.value("bias_monitor") == "1" else 0.0).encode()

    def _print_standard(self, standard: str, part: Callable[[tuple[FloatArray, ComplexArray]], FloatArray], _: str) -> bytes:
        """Measurement of a standard; a single zero if there is none, which no program takes for a sweep."""
        kept = self.kept_standard(standard)
        return self._array(np.zeros(1) if kept is None else part(kept))

    def _count_standard(self, standard: str, _: str) -> bytes:
        kept = self.kept_standard(standard)
        return f"{0 if kept is None else kept[0].size:+d}".encode()

    def _acquire(self, standard: str, _: str) -> None:
        self.measure_standard(standard)

    def _is_enabled(self, standard: str, _: str) -> bytes:
        return b"1" if self.is_enabled(standard) else b"0"

    def _select(self, parameter: int, _: str) -> None:
        if parameter > int(self.value("parameters")):
            self.note_error("execution_error")
            return
        self._selected = parameter

    def _formatted(self) -> FloatArray:
        """Two values for each point of the selected parameter; the second one is 0 unless the parameter is complex."""
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
