"""The simulated 4294A: triggering, event register, traces and fixture compensation on top of its profile."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from motoremi.arrays import FloatArray
from motoremi.bench.clock import Clock
from motoremi.bench.shown_quantities import PAIRS, QUANTITIES
from motoremi.bench.simulated_bridge import SimulatedBridge, pairs
from motoremi.bench.simulated_device import Wiring, definite_block

SWEEP_COMPLETE = 1
COMPENSATION_COMPLETE = 256
BINARY_FORMATS = {"FORM2": ">f4", "FORM3": ">f8", "FORM5": "<f4"}
STANDARDS = {"A": "open", "B": "short", "C": "load"}


class Simulated4294A(SimulatedBridge):
    """A 4294A with a fixture, connected to a test stand."""

    def __init__(self, wiring: Wiring, clock: Clock) -> None:
        self._format = "FORM4"
        self._events = 0
        self._event_at_end = SWEEP_COMPLETE
        self._sweeps_left = 0
        super().__init__("agilent_4294a.yaml", wiring, clock)

    def commands(self) -> dict[str, Callable[[str], bytes | None]]:
        """What the 4294A computes."""
        table: dict[str, Callable[[str], bytes | None]] = {
            "PRES": self._reset,
            "SING": lambda _: self._trigger(1),
            "NUMG": self._group,
            "CONT": lambda _: self.set_continuous(True),
            "HOLD": lambda _: self.set_continuous(False),
            "*TRG": lambda _: self._bus_trigger(),
            "ESB?": lambda _: self._read_events(),
            "OUTPSWPRM?": lambda _: self._array(self.axis()),
            "OUTPDTRC?": lambda _: self._array(self._trace()),
            "OUTPDATA?": lambda _: self._array(pairs(self.impedance_ohm())),
            "AUTO": lambda _: None,
            "AVERREST": lambda _: None,
        }
        for letter, standard in STANDARDS.items():
            table[f"COM{letter}"] = partial(self._compensate, standard)
            table[f"COMST{letter}"] = partial(self.enable, standard)
            table[f"COMST{letter}?"] = partial(self._is_enabled, standard)
        for name in (*BINARY_FORMATS, "FORM4"):
            table[name] = partial(self._choose, name)
        return table

    def status_byte(self) -> int:
        """Bit 2 summarises the event register, bit 5 the standard register, bit 6 requests service."""
        summary = super().status_byte() | (4 if self._events & int(self.value("event_mask")) else 0)
        return summary | (64 if summary & int(self.value("service_mask")) else 0)

    def ended(self) -> None:
        """Note the end of a sweep, or of all sweeps of a group, or of a compensation."""
        if self._sweeps_left > 1:
            self._trigger(self._sweeps_left - 1)
            return
        self._sweeps_left = 0
        self._events |= self._event_at_end

    def _trigger(self, sweeps: int) -> None:
        self._sweeps_left = sweeps
        self._event_at_end = SWEEP_COMPLETE
        self.sweep()

    def _group(self, argument: str) -> None:
        if not argument.isdigit() or not 1 <= int(argument) <= 999:
            self.error_response("execution_error")
            return
        self._trigger(int(argument))

    def _bus_trigger(self) -> None:
        if self.value("trigger") != "BUS":
            self.error_response("trigger_ignored")
            return
        self._trigger(1)

    def _compensate(self, standard: str, _: str) -> None:
        self._event_at_end = COMPENSATION_COMPLETE
        self.measure_standard(standard)

    def _is_enabled(self, standard: str, _: str) -> bytes:
        return b"1" if self.is_enabled(standard) else b"0"

    def _choose(self, name: str, _: str) -> None:
        self._format = name

    def _read_events(self) -> bytes:
        events, self._events = self._events, 0
        return str(events).encode()

    def _clear_status(self, argument: str) -> None:
        super()._clear_status(argument)
        self._events = 0

    def _reset(self, argument: str) -> None:
        super()._reset(argument)
        self._format = "FORM4"

    def _trace(self) -> FloatArray:
        """Two values a point; the second one matters for complex traces only."""
        impedance = self.impedance_ohm()
        if not impedance.any():
            return np.zeros(2 * impedance.size)
        name = PAIRS[self.value("measurement")]["AB".index(self.value("trace"))]
        return pairs(QUANTITIES[name](impedance, 2 * np.pi * self.axis()))

    def _array(self, values: FloatArray) -> bytes:
        if self._format == "FORM4":
            return ",".join(f"{value:+.11E}" for value in values).encode()
        return definite_block(values, BINARY_FORMATS[self._format])
