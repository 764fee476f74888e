"""A PyVISA-sim device that can compute: what all simulated instruments share.

PyVISA-sim takes identity, settings, ranges and errors from YAML, matches commands byte for byte, and computes nothing. What is
overridden here, `Device._match` and the buffers and tables it works on, is private: hence the pinned version in `pyproject.toml`.
"""

from __future__ import annotations

import copy
import functools
import re
from collections.abc import Callable, Mapping
from importlib import resources
from typing import Any, Protocol

import numpy as np
from pyvisa_sim import parser
from pyvisa_sim.component import NoResponse
from pyvisa_sim.devices import Device

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.bench.clock import Clock
from motoremi.simulate.stand import MotorStand

# Time on the bus for one message: what lets a client without a clock of its own poll a simulated sweep to its end.
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
        """What is connected, as it truly is, in ohm."""
        ...

    def impedance_ohm(self, frequency_hz: FloatArray, bandwidth_factor: int, averages: int = 1) -> ComplexArray:
        """What an analyser without fixture would read now, in ohm; the mean of so many readings."""
        ...

    def at_line(self, line: str) -> None:
        """Switch the LISN to another line."""
        ...

    def level_dbuv(self, frequency_hz: FloatArray, detector: str) -> FloatArray:
        """What reaches the receiver, in dBuV."""
        ...


@functools.cache
def _parsed(profile: str) -> tuple[str, dict[str, Any]]:
    """Name and description of the device in a profile; one that is `like` another says only what differs.

    Kept, because reading YAML takes longer than a simulated sweep.
    """
    with resources.as_file(resources.files("motoremi.sim_profiles") / profile) as path:
        content = parser.parse_file(path)
    ((name, data),) = content["devices"].items()
    return name, _overlaid(_parsed(content["like"])[1], data) if "like" in content else data


def _overlaid(base: dict[str, Any], own: dict[str, Any]) -> dict[str, Any]:
    """Tables are merged row by row; anything else replaces what the base has."""
    merged = {key: _overlaid(base[key], value) if isinstance(value, dict) and key in base else value for key, value in own.items()}
    return {**base, **merged}


class SimulatedDevice(Device):
    """An instrument whose settings come from a profile and whose answers may be computed.

    Subclasses list what they compute in `commands()`: header to a function of the argument text that returns the answer or None.

    Parameters
    ----------
    profile : str
        File in `motoremi.sim_profiles`.
    wiring : Wiring
        What it is connected to.
    clock : Clock
    """

    # When the waiting answer may be read, in seconds of the clock; later than now only by a fault.
    answer_due_s = 0.0
    # What stands before each header of the answer to `*LRN?`.
    LEARN_PREFIX = ""
    # How often it has requested service; a restart does not undo what the bus has heard.
    service_requests = 0
    _summary = 0
    _unpolled = False

    def __init__(self, profile: str, wiring: Wiring, clock: Clock) -> None:
        name, data = copy.deepcopy(_parsed(profile))
        super().__init__(name, b"")
        self.wiring = wiring
        self.clock = clock
        self._data = data
        self.add_error_handler(data["error"])
        for interface, terminators in data["eom"].items():
            self.add_eom(interface, terminators["q"], terminators["r"])
        parser.update_component(name, self, data)
        self._settable = {self.fold(row["setter"]["q"].rpartition(" ")[0]): key for key, row in data["properties"].items() if "setter" in row}
        spelled = [row["q"] for row in (*data["dialogues"], *data["error"]["status_register"], *data["error"]["error_queue"])]
        spelled += [row["getter"]["q"] for row in data["properties"].values() if "getter" in row]
        self._queries = {self.fold(query): query.encode() for query in spelled}
        self._completion_asked = False
        self._commands = {
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

    def use(self, options: Mapping[str, Mapping[str, Any]]) -> None:
        """Take what a procedure says of each role that this instrument plays."""

    def commands(self) -> dict[str, Callable[[str], bytes | None]]:
        """What this instrument computes, by header."""
        raise NotImplementedError

    def busy_until(self) -> float:
        """When the running measurement ends, in seconds of the clock."""
        raise NotImplementedError

    def status_byte(self) -> int:
        """The IEEE 488.2 status byte."""
        self._settle()
        standard = int(self._status_registers[b"*ESR?"].value)
        return 32 if standard & int(self.value("standard_mask")) else 0

    def notice_request(self) -> None:
        """Request service when the summary in bit 6 of the status byte has risen; the request goes with the summary."""
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
        return self._properties[name].get_value()

    def limits(self, name: str) -> tuple[int, int]:
        """Smallest and largest value of a whole-number setting of the profile."""
        specs = self._data["properties"][name]["specs"]
        return int(float(specs["min"])), int(float(specs["max"]))

    def device_clear(self) -> None:
        """Forget half commands and unread answers."""
        self._input_buffer.clear()
        self._output_buffers.clear()

    def write(self, data: bytes) -> None:
        """Take a message or a part of one; what never ends is forgotten, as in an instrument whose buffer is full."""
        if len(self._input_buffer) + len(data) > LONGEST_MESSAGE:
            self._input_buffer.clear()
            self.error_response("command_error")
            return
        super().write(data)

    def take_answers(self) -> bytes:
        """All that waits to be read."""
        answers = b"".join(bytes(buffer) for buffer in self._output_buffers)
        self._output_buffers.clear()
        return answers

    def fold(self, header: str) -> str:
        """One spelling for each header; the base takes any case."""
        return header.upper()

    def fold_word(self, word: str) -> str:
        """One spelling for each word that a setting may have."""
        return word.upper()

    def error_response(self, error_key: str) -> Any:
        """Note an error; like the real queues, a full one keeps its oldest entries."""
        super().error_response(error_key)
        for queue in self._error_queues.values():
            del queue._queue[QUEUE_DEPTH:]
        return NoResponse

    def _match(self, query: bytes) -> Any:
        self.clock.sleep(MESSAGE_S)
        if self._output_buffers:
            # IEEE 488.2: a new message while an answer waits is a query error, and the answer is gone.
            self._output_buffers.clear()
            self.error_response("query_error")
        answers = [a for message in self._messages(query.decode("latin-1")) if (a := self._answer(message)) is not None]
        self.notice_request()
        return b";".join(answers) if answers else NoResponse

    @staticmethod
    def _messages(line: str) -> list[str]:
        return [message.strip() for message in line.split(";") if message.strip()]

    def _answer(self, message: str) -> bytes | None:
        header, _, argument = message.partition(" ")
        header, argument = self.fold(header), argument.strip()
        # Before the command, which may clear what has happened meanwhile.
        self.notice_request()
        if header in self._commands:
            return self._commands[header](argument)
        if header in self._settable and argument:
            self._assign(self._settable[header], argument)
            return None
        answer: Any = super()._match(self._queries[header]) if header in self._queries else None
        if answer is None:
            self.error_response("command_error")
            return None
        return bytes(answer)

    def _assign(self, name: str, argument: str) -> None:
        """Set a property; numbers may carry a unit, words any case."""
        setting = self._properties[name]
        specs: Any = setting.specs
        text = argument
        if specs.type is not str:
            number = number_text(argument)
            if number is None:
                self.error_response("execution_error")
                return
            text = number
        elif specs.valid:
            text = self.fold_word(argument)
            text = next((word for word in _SWITCH.get(text, ()) if word in specs.valid), text)
        try:
            setting.set_value(text)
        except ValueError:
            self.error_response("execution_error")

    def set_value(self, name: str, value: float) -> None:
        """Set a number of the profile, without a look at its unit; the caller keeps it within the limits."""
        self._properties[name].set_value(repr(value))

    def _learn(self) -> bytes:
        """Every setting but the masks as the message that sets it (IEEE 488.2, `*LRN?`); the makers' own form is unconfirmed."""
        units = []
        for name, row in self._data["properties"].items():
            if "setter" not in row or "getter" not in row or name.endswith("_mask"):
                continue
            header = row["setter"]["q"].rpartition(" ")[0]
            answer: Any = super()._match(row["getter"]["q"].encode())
            if answer:
                units.append(f"{self.LEARN_PREFIX}{header} {bytes(answer).decode('latin-1')}")
        return ";".join(units).encode("latin-1")

    def _clear_status(self, _: str) -> None:
        for register in self._status_registers.values():
            register.clear()
        for queue in self._error_queues.values():
            queue.clear()
        self._completion_asked = False

    def _reset(self, _: str) -> None:
        for name, row in self._data["properties"].items():
            if not name.endswith("_mask"):
                self._properties[name].init_value(row["default"])

    def _note_completion(self, _: str) -> None:
        self._completion_asked = True

    def _settle(self) -> None:
        """Let what has ended by now show in the registers."""
        # An idle instrument is busy until now; on a real clock that has passed by the time it is compared.
        busy_until_s = self.busy_until()
        if self._completion_asked and self.clock.now() >= busy_until_s:
            self._status_registers[b"*ESR?"].set("operation_complete")
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
