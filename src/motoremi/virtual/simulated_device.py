"""Base class of all simulated instruments: settings from a profile, IEEE 488.2 status and errors, messages and answers.

A profile is read with PyVISA-sim, whose `Property` also checks the values of settings; its VISA library calls `write` here.
PyVISA-sim's own `Device` is not used: it compares commands byte for byte, and what it answers cannot be computed through its public interface.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Protocol

import numpy as np
from pyvisa import rname
from pyvisa_sim.component import Property

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.bench.clock import Clock
from motoremi.simulate.stand import MotorStand
from motoremi.virtual.profile import read_profile

# Time on the bus for one message. Without it, a client that polls a simulated sweep on a virtual clock would never see it end.
MESSAGE_S = 1e-3
QUEUE_DEPTH = 10
REQUESTS_SERVICE = 64
LONGEST_MESSAGE = 1 << 18
_NUMBER = re.compile(r"([+-]?\d*\.?\d+(?:[eE][+-]?\d+)?)\s*([a-zA-Z]*)")
_SCALE = {
    "HZ": 1.0,
    "KHZ": 1e3,
    "MHZ": 1e6,
    "GHZ": 1e9,
    "V": 1.0,
    "MV": 1e-3,
    "S": 1.0,
    "MS": 1e-3,
    "US": 1e-6,
    "DB": 1.0,
    "": 1.0,
}
# A switch may be written as a word or as a digit, whichever of them the profile has.
_SWITCH = {"ON": ("ON", "1"), "1": ("1", "ON"), "OFF": ("OFF", "0"), "0": ("0", "OFF")}


class Wiring(Protocol):
    """What the simulated instruments are connected to."""

    seed: int
    stand: MotorStand

    def connected_ohm(self, frequency_hz: FloatArray) -> ComplexArray:
        """True impedance of what is connected, in ohm."""
        ...

    def impedance_ohm(self, frequency_hz: FloatArray, bandwidth_factor: int, averages: int = 1) -> ComplexArray:
        """What an analyser without fixture would read now, in ohm; the mean of `averages` readings."""
        ...

    def at_line(self, line: str) -> None:
        """Switch the LISN to another line."""
        ...

    def level_dbuv(self, frequency_hz: FloatArray, detector: str) -> FloatArray:
        """Level at the receiver's input, in dBuV."""
        ...


class ErrorQueue:
    """An instrument's error queue; when it is full, new errors are lost, as in real instruments.

    Parameters
    ----------
    texts : mapping of str to str
        A row of `error_queue` in a profile: the query `q`, the answer of an empty queue `default`, and one text for each kind of error.
    """

    def __init__(self, texts: Mapping[str, str]) -> None:
        self._texts = texts
        self.entries: list[str] = []

    def note(self, error: str) -> None:
        """Append the text of an error, if this instrument has one for it."""
        if error in self._texts and len(self.entries) < QUEUE_DEPTH:
            self.entries.append(self._texts[error])

    def pop(self) -> bytes:
        """Remove the oldest entry and return it."""
        return (self.entries.pop(0) if self.entries else self._texts["default"]).encode()


class SimulatedDevice:
    """An instrument whose settings come from a profile and whose answers may be computed.

    Subclasses list what they compute in `commands()`: header to a function of the argument text that returns the answer or None; and set their
    own state in `power_on()`.

    Parameters
    ----------
    wiring : Wiring
        What it is connected to.
    clock : Clock

    Attributes
    ----------
    respond : callable
        Turns one message into its answer, or None; `answer` unless a fault replaces it.
    answers : deque of bytearray
        Answers that wait to be read, terminators included.
    answer_due_s : float
        When the waiting answer may be read, in seconds of the clock; later than now only by a fault.
    service_requests : int
        How many times it has requested service. It is not reset by `power_on`, because clients have counted the earlier requests.
    """

    # File in `motoremi.sim_profiles`.
    profile: ClassVar[str]
    # What stands before each header in the answer to `*LRN?`.
    LEARN_PREFIX = ""

    def __init__(self, wiring: Wiring, clock: Clock) -> None:
        self.wiring = wiring
        self.clock = clock
        self.respond: Callable[[bytes], bytes | None] = self.answer
        self.answers: deque[bytearray] = deque()
        self.answer_due_s = 0.0
        self.service_requests = 0
        self._summary = 0
        self._unpolled = False
        self._resource_name: str | None = None
        self._terminators = b"\n", b"\n"
        self._data = read_profile(self.profile)
        (self._standard_bits,) = self._data["error"]["status_register"] or [{}]
        (error_texts,) = self._data["error"]["error_queue"] or [{}]
        self.texts = {row["q"]: row["r"] for row in self._data["dialogues"]}
        rows: dict[str, Any] = self._data["properties"]
        self.settable = {self.fold(row["setter"]["q"].rpartition(" ")[0]): name for name, row in rows.items() if "setter" in row}
        self.known_queries: dict[str, Callable[[], bytes]] = {
            **{self.fold(query): text.encode for query, text in self.texts.items()},
            **{self.fold(one["q"]): query for one, query in ((self._standard_bits, self._read_standard), (error_texts, self._pop_error)) if one},
            **{self.fold(row["getter"]["q"]): lambda name=name: self._shown(name) for name, row in rows.items() if "getter" in row},  # type: ignore[misc]
        }
        self.errors = ErrorQueue(error_texts)
        self.power_on()
        self.known_commands = {
            "*CLS": self._clear_status,
            "*RST": self._reset,
            "*OPC": self._note_completion,
            "*OPC?": self._wait_and_answer,
            "*WAI": self._wait,
            "*STB?": lambda _: str(self.status_byte()).encode(),
            "*TST?": lambda _: b"0",
            "*LRN?": lambda _: self._learn(),
            **{self.fold(header): command for header, command in self.commands().items()},
        }

    @property
    def resource_name(self) -> str | None:
        """VISA name that it is bound to; the kind of link decides how its messages end."""
        return self._resource_name

    @resource_name.setter
    def resource_name(self, name: str) -> None:
        parsed = rname.parse_resource_name(name)
        self._resource_name = str(parsed)
        row = self._data["eom"].get(f"{parsed.interface_type} {parsed.resource_class}", {"q": "\n", "r": "\n"})
        self._terminators = row["q"].encode(), row["r"].encode()

    def power_on(self) -> None:
        """Bring the instrument into the state that it has after power-on."""
        self._settings = {name: Property[Any](name, row["default"], row["specs"]) for name, row in self._data["properties"].items()}
        self._standard_events = 0
        self._completion_asked = False
        self.errors.entries.clear()
        self.device_clear()

    def use(self, options: Mapping[str, Mapping[str, Any]]) -> None:
        """Take the options that a procedure gives for each role of this instrument."""

    def commands(self) -> dict[str, Callable[[str], bytes | None]]:
        """What this instrument computes, by header."""
        raise NotImplementedError

    def busy_until(self) -> float:
        """When the running measurement ends, in seconds of the clock."""
        raise NotImplementedError

    def status_byte(self) -> int:
        """The IEEE 488.2 status byte."""
        self._settle()
        return 32 if self._standard_events & int(self.value("standard_mask")) else 0

    def notice_request(self) -> None:
        """Request service when the summary in bit 6 of the status byte has risen; the request ends with the summary."""
        before, self._summary = self._summary, self.status_byte() & REQUESTS_SERVICE
        if self._summary and not before:
            self.service_requests += 1
        self._unpolled = bool(self._summary) and (self._unpolled or not before)

    def serial_poll(self) -> int:
        """The status byte with, in bit 6, whether it requests service: polling answers that request (IEEE 488.2)."""
        self.notice_request()
        request, self._unpolled = REQUESTS_SERVICE if self._unpolled else 0, False
        return self.status_byte() & ~REQUESTS_SERVICE | request

    def value(self, name: str) -> Any:
        """Present value of a setting of the profile."""
        return self._settings[name].get_value()

    def set_value(self, name: str, value: float | str) -> None:
        """Set a setting of the profile.

        Raises
        ------
        ValueError
            If the profile does not allow the value.
        """
        self._settings[name].set_value(value if isinstance(value, str) else repr(value))

    def has(self, name: str) -> bool:
        """Whether the profile has a setting of that name."""
        return name in self._settings

    def limits(self, name: str) -> tuple[int, int]:
        """Smallest and largest value of a whole-number setting of the profile."""
        specs = self._data["properties"][name]["specs"]
        return int(float(specs["min"])), int(float(specs["max"]))

    def device_clear(self) -> None:
        """Discard incomplete messages and unread answers."""
        self.incoming = bytearray()
        self.answers.clear()

    def write(self, data: bytes) -> None:
        """Receive a message or a part of one; a message that is too long is discarded, as by an instrument whose buffer is full."""
        if len(self.incoming) + len(data) > LONGEST_MESSAGE:
            self.incoming.clear()
            self.note_error("command_error")
            return
        self.incoming += data
        ending, answer_ending = self._terminators
        if self.incoming.endswith(ending):
            message, self.incoming = bytes(self.incoming[: -len(ending)]), bytearray()
            answer = self.respond(message)
            if answer is not None:
                self.answers.append(bytearray(answer + answer_ending))

    def take_answers(self) -> bytes:
        """All that waits to be read."""
        answers = b"".join(self.answers)
        self.answers.clear()
        return answers

    def fold(self, header: str) -> str:
        """One spelling for each header; here, capitals."""
        return header.upper()

    def fold_word(self, word: str) -> str:
        """One spelling for each word that a setting may have."""
        return word.upper()

    def note_error(self, error: str) -> None:
        """Set the event bit of an error and append it to the error queue.

        Parameters
        ----------
        error : str
            A key in the profile's `status_register` or `error_queue`.
        """
        self._standard_events |= int(self._standard_bits.get(error, 0))
        self.errors.note(error)

    def answer(self, message: bytes) -> bytes | None:
        """Carry out one message, which may hold several commands, and return its answer if it has one."""
        self.clock.sleep(MESSAGE_S)
        if self.answers:
            # IEEE 488.2: a new message before the last answer was read is a query error, and that answer is lost.
            self.answers.clear()
            self.note_error("query_error")
        answers = [a for command in message.decode("latin-1").split(";") if command.strip() and (a := self._answer(command.strip())) is not None]
        self.notice_request()
        return b";".join(answers) if answers else None

    def _answer(self, command: str) -> bytes | None:
        header, _, argument = command.partition(" ")
        header, argument = self.fold(header), argument.strip()
        # Before the command, which may clear the events that have happened meanwhile.
        self.notice_request()
        if header in self.known_commands:
            return self.known_commands[header](argument)
        if header in self.settable and argument:
            self.assign(self.settable[header], argument)
            return None
        if header in self.known_queries:
            return self.known_queries[header]()
        self.note_error("command_error")
        return None

    def assign(self, name: str, argument: str) -> None:
        """Set a setting; numbers may carry a unit, words may be in any case."""
        specs: Any = self._settings[name].specs
        text = argument
        if specs.type is not str:
            number = number_text(argument)
            if number is None:
                self.note_error("execution_error")
                return
            text = number
        elif specs.valid:
            text = self.fold_word(argument)
            text = next((word for word in _SWITCH.get(text, ()) if word in specs.valid), text)
        try:
            self.set_value(name, text)
        except ValueError:
            self.note_error("execution_error")

    def _shown(self, name: str) -> bytes:
        """A setting as the instrument writes it."""
        shown: str = self._data["properties"][name]["getter"]["r"].format(self.value(name))
        return shown.encode()

    def _learn(self) -> bytes:
        """Every setting except the masks, as the message that sets it (IEEE 488.2, `*LRN?`); the makers' own form is unconfirmed."""
        units = []
        for name, row in self._data["properties"].items():
            if "setter" not in row or "getter" not in row or name.endswith("_mask"):
                continue
            header = row["setter"]["q"].rpartition(" ")[0]
            if shown := self._shown(name):
                units.append(f"{self.LEARN_PREFIX}{header} {shown.decode('latin-1')}")
        return ";".join(units).encode("latin-1")

    def _read_standard(self) -> bytes:
        """The standard event register, which reading clears."""
        events, self._standard_events = self._standard_events, 0
        return str(events).encode()

    def _pop_error(self) -> bytes:
        return self.errors.pop()

    def _clear_status(self, _: str) -> None:
        self._standard_events = 0
        self.errors.entries.clear()
        self._completion_asked = False

    def _reset(self, _: str) -> None:
        for name, row in self._data["properties"].items():
            if not name.endswith("_mask"):
                self.set_value(name, row["default"])

    def _note_completion(self, _: str) -> None:
        self._completion_asked = True

    def _settle(self) -> None:
        """Set the event bits of what has ended by now."""
        # `busy_until` of an idle instrument is the present time, so it must be read before the clock is: a real clock runs on.
        busy_until_s = self.busy_until()
        if self._completion_asked and self.clock.now() >= busy_until_s:
            self._standard_events |= int(self._standard_bits["operation_complete"])
            self._completion_asked = False

    def _wait(self, _: str) -> None:
        self.clock.sleep(self.busy_until() - self.clock.now())

    def _wait_and_answer(self, _: str) -> bytes:
        self._wait("")
        return b"1"


def number_text(argument: str) -> str | None:
    """A number with or without unit as text in SI units; None if it is none or the unit is unknown."""
    number = _NUMBER.fullmatch(argument)
    scale = _SCALE.get(number[2].upper()) if number else None
    if number is None or scale is None:
        return None
    return number[1] if scale == 1.0 else repr(float(number[1]) * scale)


def definite_block(values: FloatArray, dtype: str) -> bytes:
    """An IEEE 488.2 definite-length block of numbers."""
    payload = np.asarray(values).astype(dtype).tobytes()
    count = str(len(payload)).encode()
    return b"#" + str(len(count)).encode() + count + payload
