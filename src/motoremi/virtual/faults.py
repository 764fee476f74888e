"""Faults of instruments and links, for tests: one fault, from one exchange on, in a simulated instrument.

A fault replaces the function that turns a message into an answer, so drivers, transports and recordings are those of a real run.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NoReturn

import numpy as np

from motoremi.errors import BadInput
from motoremi.virtual.simulated_device import SimulatedDevice, definite_block

# A driver that makes this many exchanges is in an endless loop, which on a virtual clock would never end.
MOST_EXCHANGES = 20_000
SHORT_DELAY_S, LONG_DELAY_S = 1.0, 30.0
NOT_A_NUMBER, NOT_MEASURED = float("nan"), 9.9e37
# Arrays of the simulated instruments: 64 bit, as FORM3 of the 4294A and REAL of SCPI analysers send them.
BLOCK_TYPE = ">f8"
DBM_BELOW_DBUV = 106.99


class EndlessExchanges(RuntimeError):
    """The driver does not stop sending messages."""


class FaultLayer:
    """Makes a simulated instrument do one thing wrong.

    Parameters
    ----------
    device : SimulatedDevice
    kind : str
        One of `FAULTS`.
    at : int
        Number of the exchange, from 1, from which the fault may occur; it occurs at the first one that it can change.

    Attributes
    ----------
    occurred : bool
        Whether it has occurred.
    """

    def __init__(self, device: SimulatedDevice, kind: str, at: int) -> None:
        if kind not in FAULTS:
            raise BadInput(f"unknown fault {kind!r}: use one of {', '.join(FAULTS)}")
        self.device = device
        self.kind = kind
        self.at = at
        self.occurred = False
        self.exchanges = 0
        self._healthy = device.respond
        self._act, self._lasting, _ = FAULTS[kind]
        device.respond = self._respond

    def _respond(self, query: bytes) -> bytes | None:
        self.exchanges += 1
        if self.exchanges > MOST_EXCHANGES:
            raise EndlessExchanges(f"{MOST_EXCHANGES} exchanges, the last one {query!r}")
        if self.exchanges < self.at or (self.occurred and not self._lasting):
            return self._healthy(query)
        return self._act(self, query)

    def note(self) -> None:
        """Note that the fault occurs in this exchange."""
        self.occurred = True

    def answer(self, query: bytes) -> bytes | None:
        """The answer without the fault."""
        return self._healthy(query)


Act = Callable[[FaultLayer, bytes], bytes | None]


def _changed(change: Callable[[bytes], bytes | None]) -> Act:
    """A fault that changes an answer; `change` returns None for an answer that it cannot change."""

    def act(layer: FaultLayer, query: bytes) -> bytes | None:
        answer = layer.answer(query)
        if answer is None or (changed := change(answer)) is None or changed == answer:
            return answer
        layer.note()
        return changed

    return act


def _silent(layer: FaultLayer, query: bytes) -> bytes | None:
    if layer.answer(query) is not None:
        layer.note()
    return None


def _dead(layer: FaultLayer, query: bytes) -> bytes | None:
    layer.note()
    return None


def _delayed(seconds: float) -> Act:
    def act(layer: FaultLayer, query: bytes) -> bytes | None:
        answer = layer.answer(query)
        if answer is not None:
            layer.note()
            layer.device.answer_due_s = layer.device.clock.now() + seconds
        return answer

    return act


def _dropped(layer: FaultLayer, query: bytes) -> NoReturn:
    layer.note()
    raise ConnectionResetError("connection reset by peer")


def _error_entry(layer: FaultLayer, query: bytes) -> bytes | None:
    layer.note()
    answer = layer.answer(query)
    layer.device.note_error("execution_error")
    return answer


def _wrong_identity(layer: FaultLayer, query: bytes) -> bytes | None:
    answer = layer.answer(query)
    if query.strip().upper() != b"*IDN?":
        return answer
    layer.note()
    return b"ACME,\x1b[31m9000,0,1.0"


def _overload(layer: FaultLayer, query: bytes) -> bytes | None:
    answer = layer.answer(query)
    if b"QUES:POW" not in query.upper():
        return answer
    layer.note()
    return b"1"


def _restarted(layer: FaultLayer, query: bytes) -> bytes | None:
    layer.note()
    layer.device.power_on()
    return layer.answer(query)


def _dbm(layer: FaultLayer, query: bytes) -> bytes | None:
    """Levels in dBm and frequencies in kHz, as if somebody had changed the units at the instrument."""
    answer = layer.answer(query)
    if b"UNIT" in query.upper() and query.endswith(b"?"):
        return b"DBM"
    if answer is None:
        return answer
    if b"TRAC" in query.upper() and (levels := _numbers(answer)) is not None and levels.size > 1:
        layer.note()
        return ",".join(f"{level - DBM_BELOW_DBUV:.3f}" for level in levels).encode()
    if b"STAR" in query.upper() or b"STOP" in query.upper():
        layer.note()
        return repr(float(answer) / 1e3).encode()
    return answer


def _numbers(answer: bytes) -> np.ndarray[Any, np.dtype[np.float64]] | None:
    """The values of an answer that is a block or a list of numbers."""
    if answer[:1] == b"#" and answer[1:2].isdigit():
        payload = answer[2 + int(answer[1:2]) :]
        return np.frombuffer(payload, BLOCK_TYPE).astype(np.float64) if payload and len(payload) % 8 == 0 else None
    try:
        return np.array([float(field) for field in answer.split(b",")])
    except ValueError:
        return None


def _rewritten(change: Callable[[np.ndarray[Any, np.dtype[np.float64]]], Any], least: int = 1) -> Callable[[bytes], bytes | None]:
    def rewrite(answer: bytes) -> bytes | None:
        values = _numbers(answer)
        if values is None or values.size < least:
            return None
        values = np.asarray(change(values), dtype=np.float64)
        if answer[:1] == b"#":
            return definite_block(values, BLOCK_TYPE)
        return b",".join(f"{value:.6E}".encode() for value in values)

    return rewrite


def _with_one(value: float) -> Callable[[bytes], bytes | None]:
    def change(values: np.ndarray[Any, np.dtype[np.float64]]) -> Any:
        values = values.copy()
        values[values.size // 4 * 2] = value
        return values

    return _rewritten(change)


def _wrong_length(by: int) -> Callable[[bytes], bytes | None]:
    """A block whose header announces another length than it has."""

    def change(answer: bytes) -> bytes | None:
        if answer[:1] != b"#" or not answer[1:2].isdigit():
            return None
        digits = int(answer[1:2])
        count = str(int(answer[2 : 2 + digits]) + by).encode()
        return b"#" + str(len(count)).encode() + count + answer[2 + digits :]

    return change


def _high_bit(answer: bytes) -> bytes:
    return bytes(byte ^ 0x80 for byte in answer)


def _half(answer: bytes) -> bytes:
    return answer[: len(answer) // 2]


def _decimal_comma(answer: bytes) -> bytes | None:
    return answer.replace(b".", b",") if _numbers(answer) is not None and answer[:1] != b"#" else None


def _unit_suffix(answer: bytes) -> bytes | None:
    values = _numbers(answer)
    return answer + b" HZ" if values is not None and values.size == 1 and answer[:1] != b"#" else None


# Kind -> function, whether it persists, and description.
FAULTS: dict[str, tuple[Act, bool, str]] = {
    "silence": (_silent, False, "one answer does not come"),
    "dead": (_dead, True, "no answer any more"),
    "short-delay": (_delayed(SHORT_DELAY_S), False, "an answer comes late, within the deadline"),
    "long-delay": (_delayed(LONG_DELAY_S), False, "an answer comes after the deadline"),
    "link-glitch": (_dropped, False, "the link drops for one exchange"),
    "dropped-link": (_dropped, True, "the link is gone"),
    "garbled": (_changed(_high_bit), False, "an answer with wrong bits in every byte, as with a wrong parity"),
    "truncated": (_changed(_half), False, "half of an answer"),
    "block-too-short": (_changed(_wrong_length(+8)), False, "a block that is shorter than its header says"),
    "block-too-long": (_changed(_wrong_length(-8)), False, "a block that is longer than its header says"),
    "nan": (_changed(_with_one(NOT_A_NUMBER)), False, "one value is NaN"),
    "9.9e37": (_changed(_with_one(NOT_MEASURED)), False, "one value is 9.9E37, which marks a point that was not measured"),
    "overload": (_overload, False, "the receiver's overload bit is set"),
    "error-entry": (_error_entry, False, "an entry in the error queue"),
    "wrong-identity": (_wrong_identity, False, "another instrument answers"),
    "half-sweep": (_changed(_rewritten(lambda values: values[: values.size // 2], least=8)), False, "an array with half of the points"),
    "restart": (_restarted, False, "power off and on: all settings at their defaults"),
    "other-unit": (_dbm, True, "frequencies in kHz, levels in dBm"),
    "unit-suffix": (_changed(_unit_suffix), False, "a number with its unit behind it"),
    "decimal-comma": (_changed(_decimal_comma), False, "numbers with a decimal comma"),
}
