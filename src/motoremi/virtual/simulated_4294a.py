"""The simulated 4294A: triggering, event register, traces and fixture compensation on top of its profile."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from motoremi.arrays import FloatArray
from motoremi.bench.sweep_options import Segment
from motoremi.virtual.shown_quantities import PAIRS, QUANTITIES
from motoremi.virtual.simulated_band import band_commands
from motoremi.virtual.simulated_bridge import SimulatedBridge, pairs
from motoremi.virtual.simulated_device import definite_block, number_text

SWEEP_COMPLETE = 1
COMPENSATION_COMPLETE = 256
# Bias range -> largest current in ampere.
BIAS_RANGES_A = {"M1": 1e-3, "M10": 1e-2, "M100": 0.1}
# Adapter -> what its set-up has to measure (Programming Manual, page 54): phase, open, short, load.
ADAPTERS = {"OFF": "", "M1": "PC", "M2": "PC", "APC7": "PABC", "PROBE": "PABC"}
BINARY_FORMATS = {"FORM2": ">f4", "FORM3": ">f8", "FORM5": "<f4"}
STANDARDS = {"A": "open", "B": "short", "C": "load"}


class Simulated4294A(SimulatedBridge):
    """A 4294A with a fixture, connected to a test stand.

    The words of a list sweep (EDITLIST, CLEL, SADD, SDON, SQUI, EDITDONE) are those that public programs send to the 4395A of the same
    family; on the 4294A they are unconfirmed, and so are the numbers of the errors other than 137.
    """

    profile = "agilent_4294a.yaml"
    LIST = "LIST"

    def power_on(self) -> None:
        """Values as text, no list, no adapter."""
        super().power_on()
        self._format = "FORM4"
        self._events = 0
        self._event_at_end = SWEEP_COMPLETE
        # The list of segments that is being edited, and the segment that is being entered.
        self._edited: list[Segment] = []
        self._segment: dict[str, float] | None = None
        self._adapter_data: set[str] = set()

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
            "AVERREST": lambda _: self.restart_average(),
            "POIN?": lambda _: f"{self.axis().size:+d}".encode(),
            "EDITLIST": lambda _: self._edit(list(self._segments)),
            "CLEL": lambda _: self._edit([]),
            "SADD": lambda _: self._add_segment(),
            "SDON": lambda _: self._end_segment(),
            "SQUI": lambda _: self._leave_segment(),
            "EDITDONE": lambda _: self.take_list(self._edited),
            "ECALDON": lambda _: self._end_adapter(),
            "ECALQUI": lambda _: self._adapter_data.clear(),
            **{f"ECAL{letter}": partial(self._measure_for_adapter, letter) for letter in "PABC"},
            **band_commands(self, "CENT", "SPAN", "start", "stop"),
        }
        for letter, standard in STANDARDS.items():
            table[f"COM{letter}"] = partial(self._compensate, standard)
            table[f"COMST{letter}"] = partial(self.enable, standard)
            table[f"COMST{letter}?"] = partial(self._is_enabled, standard)
            number = "ABC".index(letter) + 1
            table[f"OUTPCOMC{number}?"] = partial(self._print_compensation, standard)
            table[f"INPUCOMC{number}"] = partial(self._read_compensation, standard)
        for name in (*BINARY_FORMATS, "FORM4"):
            table[name] = partial(self._choose, name)
        return table

    def status_byte(self) -> int:
        """Bit 2 summarises the event register, bit 5 the standard register, bit 6 requests service."""
        summary = super().status_byte() | (4 if self._events & int(self.value("event_mask")) else 0)
        return summary | (64 if summary & int(self.value("service_mask")) else 0)

    def ended(self) -> None:
        """Set the event bit of a completed sweep, group of sweeps, or compensation."""
        self._events |= self._event_at_end

    def fold_word(self, word: str) -> str:
        """One spelling for each word; programs send FIXED for FIXE."""
        return {"FIXED": "FIXE"}.get(word.upper(), word.upper())

    def _trigger(self, sweeps: int) -> None:
        self._event_at_end = SWEEP_COMPLETE
        self.sweep(sweeps)

    def _group(self, argument: str) -> None:
        if not argument.isdigit() or not 1 <= int(argument) <= 999:
            self.note_error("execution_error")
            return
        self._trigger(int(argument))

    def _bus_trigger(self) -> None:
        if self.value("trigger") != "BUS":
            self.note_error("trigger_ignored")
            return
        self._trigger(1)

    def _compensate(self, standard: str, _: str) -> None:
        self._event_at_end = COMPENSATION_COMPLETE
        self.measure_standard(standard)

    def _is_enabled(self, standard: str, _: str) -> bytes:
        return b"1" if self.is_enabled(standard) else b"0"

    def assign(self, name: str, argument: str) -> None:
        """Set a setting; while a segment is edited, start, stop and points are the segment's. A bias that exceeds the current range is refused."""
        if self._segment is not None and name in ("start", "stop", "points"):
            text = number_text(argument)
            low, high = self.limits(name)
            if text is None or not low <= float(text) <= high:
                self.note_error("execution_error")
                return
            self._segment[name] = float(text)
            return
        super().assign(name, argument)
        if name.startswith("bias") and abs(self.bias_current_a()) > BIAS_RANGES_A[self.value("bias_range")]:
            self.set_value("bias", "0")
            self.note_error("bias_overload")

    def _edit(self, segments: list[Segment]) -> None:
        self._edited, self._segment = segments, None

    def _add_segment(self) -> None:
        self._segment = {}

    def _end_segment(self) -> None:
        segment, self._segment = self._segment, None
        if segment is None or segment.keys() != {"start", "stop", "points"}:
            self.note_error("execution_error")
            return
        self._edited.append(Segment(segment["start"], segment["stop"], int(segment["points"])))

    def _leave_segment(self) -> None:
        self._segment = None

    def _measure_for_adapter(self, letter: str, _: str) -> None:
        if letter not in ADAPTERS[self.value("adapter")]:
            self.note_error("settings_conflict")
            return
        self._adapter_data.add(letter)
        self._event_at_end = COMPENSATION_COMPLETE
        self.begin()

    def _end_adapter(self) -> None:
        if self._adapter_data != set(ADAPTERS[self.value("adapter")]):
            self.note_error("settings_conflict")
        self._adapter_data.clear()

    def _print_compensation(self, standard: str, _: str) -> bytes | None:
        """The open standard as G and B, the others as R and X."""
        kept = self.kept_standard(standard)
        if kept is None:
            self.note_error("no_compensation")
            return None
        return self._array(pairs(1 / kept[1] if standard == "open" else kept[1]))

    def _read_compensation(self, standard: str, argument: str) -> None:
        try:
            values = np.array([float(text) for text in argument.split(",")])
        except ValueError:
            values = np.zeros(0)
        if values.size != 2 * self.axis().size:
            self.note_error("execution_error")
            return
        complex_ = values[::2] + 1j * values[1::2]
        with np.errstate(divide="ignore", invalid="ignore"):
            self.keep_standard(standard, 1 / complex_ if standard == "open" else complex_)

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
        self._edit([])
        self._adapter_data.clear()

    def _trace(self) -> FloatArray:
        """Two values for each point; the second one is 0 unless the trace is complex."""
        impedance = self.impedance_ohm()
        if not impedance.any():
            return np.zeros(2 * impedance.size)
        name = PAIRS[self.value("measurement")]["AB".index(self.value("trace"))]
        return pairs(QUANTITIES[name](impedance, 2 * np.pi * self.axis()))

    def _array(self, values: FloatArray) -> bytes:
        if self._format == "FORM4":
            return ",".join(f"{value:+.11E}" for value in values).encode()
        return definite_block(values, BINARY_FORMATS[self._format])
