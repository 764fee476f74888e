"""Replay: recorded traffic answers in place of the instruments."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from datetime import datetime
from typing import Any

from motoremi.bench.clock import VirtualClock
from motoremi.bench.connect import Options, attach
from motoremi.bench.driver import Driver
from motoremi.bench.motor_connections import ConnectionName
from motoremi.bench.replay_difference import CONTEXT, RecordedEnd, ReplayDifference, shown
from motoremi.bench.traffic import TrafficSink, decode_bytes, encode_bytes
from motoremi.bench.transport import Transport
from motoremi.errors import BadInput, InstrumentError

# How many records ahead a lenient replay looks for the present command: farther away, it belongs to another measurement.
LOOK_AHEAD = 40
# Records that are not exchanges.
_MARKS = ("open", "close")


class ReplayClock(VirtualClock):
    """Virtual time that follows the recorded time, so that deadlines are met and missed as in the recorded run."""

    def __init__(self) -> None:
        super().__init__()
        self._origin_s: float | None = None

    def follow(self, recorded_s: float) -> None:
        """Advance to a recorded time; never go back."""
        if self._origin_s is None:
            self._origin_s = recorded_s - self.now()
        self.sleep(recorded_s - self._origin_s - self.now())


class ReplayTransport(Transport):
    """Plays back the recorded exchanges of one instrument, in order; a difference is an error that shows both sides.

    Parameters
    ----------
    resource_name : str
    records : iterable of mapping
        As `RecordingTransport` writes them, of one connection to this instrument.
    clock : ReplayClock, optional
    lenient : bool
        Continue after a difference: recorded exchanges that no longer occur are skipped, and new commands are answered from elsewhere in
        the record where possible. The differences are kept in `differences`.
    """

    def __init__(self, resource_name: str, records: Iterable[Mapping[str, Any]], clock: ReplayClock | None = None, lenient: bool = False) -> None:
        everything = list(records)
        opened = next((record for record in everything if record["direction"] == "open"), {})
        self._clock = clock or ReplayClock()
        super().__init__(resource_name, self._clock, bool(opened.get("stream", False)))
        # Sessions recorded by versions without service requests were polled, and are polled again.
        self.service_requests = bool(opened.get("service_requests", False))
        self._records = [record for record in everything if record["direction"] not in _MARKS]
        # The record of a run that was killed ends without a record "close", also where the kill came while the instrument was made safe.
        self._killed = bool(opened) and not any(record["direction"] == "close" for record in everything)
        self._position = 0
        self._lenient = lenient
        # Position of the next answer if the last command was found elsewhere in the record; -1: it was not found; None: it was the next record.
        self._borrowed: int | None = None
        self.differences: list[ReplayDifference] = []
        self._timeout_s = float(opened.get("timeout_s", 5.0))

    @property
    def timeout_s(self) -> float:
        """Deadline in seconds, kept for the records only: a replay does not wait."""
        return self._timeout_s

    @timeout_s.setter
    def timeout_s(self, seconds: float) -> None:
        self._timeout_s = seconds

    def send(self, data: bytes) -> None:
        """Compare with what was sent when the record was made."""
        self._borrowed = None
        wanted = {"direction": "write", **encode_bytes(data)}
        try:
            self._take("write", wanted)
        except ReplayDifference as difference:
            self._resume_at(difference, data)
        self._raise_recorded_error("write")

    def receive(self) -> bytes:
        """The recorded answer, or the recorded error."""
        if self._borrowed is not None:
            return self._borrow()
        self._raise_recorded_error("read")
        record = self._take("read", {"direction": "read", "text": "(an answer)"})
        self.answered_at = str(record.get("time", ""))
        return decode_bytes(record)

    def receive_bytes(self, count: int) -> bytes:
        """The recorded answer, whatever its length; the caller checks it."""
        return self.receive()

    def await_request(self, seconds: float) -> bool:
        """Whether a service request came when the record was made."""
        self._borrowed = None
        self._raise_recorded_error("request")
        try:
            return bool(self._take("request", {"direction": "request"})["came"])
        except ReplayDifference as difference:
            if not self._lenient:
                raise
            self.differences.append(difference)
            self._clock.sleep(seconds)
            return False

    def clear(self) -> None:
        """Compare with the record."""
        self._borrowed = None
        try:
            self._take("clear", {"direction": "clear"})
        except ReplayDifference as difference:
            if not self._lenient:
                raise
            self.differences.append(difference)
        self._raise_recorded_error("clear")

    def close(self) -> None:
        """Nothing to close."""

    def finish(self) -> None:
        """Raise if part of the record was not played."""
        left = [record for record in self._records[self._position :] if record["direction"] != "leave"]
        if left and not self._lenient:
            raise InstrumentError(f"{self.resource_name}: replay ended early: {len(left)} recorded exchanges left, next {shown(left[0])}")

    def _take(self, direction: str, asked: Mapping[str, Any]) -> Mapping[str, Any]:
        """The next record, which must be the same exchange; the content of an answer is not compared."""
        skip = 1 if self._is_leaving(self._position) and self._fits(self._position + 1, asked) else 0
        at = self._position + skip
        if self._is_leaving(at) or (at >= len(self._records) and self._killed):
            raise RecordedEnd(f"{self.resource_name}: the recorded run ended here, after {at} exchanges")
        if not self._fits(at, asked):
            recorded = shown(self._records[at]) if at < len(self._records) else "the end of the record"
            before = [shown(record) for record in self._records[max(0, at - CONTEXT) : at]]
            raise ReplayDifference(self.resource_name, at + 1, recorded, shown(asked), before)
        self._position = at + 1
        record = self._records[at]
        if "clock_s" in record:
            self._clock.follow(float(record["clock_s"]))
        return record

    def _fits(self, at: int, asked: Mapping[str, Any]) -> bool:
        if at >= len(self._records) or self._records[at]["direction"] != asked["direction"]:
            return False
        return asked["direction"] != "write" or decode_bytes(self._records[at]) == decode_bytes(asked)

    def _is_leaving(self, at: int) -> bool:
        return at < len(self._records) and self._records[at]["direction"] == "leave"

    def _resume_at(self, difference: ReplayDifference, data: bytes) -> None:
        """Find the place of a command that is not the next one in the record."""
        if not self._lenient:
            raise difference
        self.differences.append(difference)
        asked = {"direction": "write", **encode_bytes(data)}
        ahead = range(self._position, min(self._position + LOOK_AHEAD, len(self._records)))
        found = next((at for at in ahead if self._fits(at, asked)), None)
        if found is not None:
            self._position = found + 1
            return
        elsewhere = sorted((abs(at - self._position), at) for at in range(len(self._records)) if self._fits(at, asked))
        if not elsewhere and self._is_other_argument(data):
            self._position += 1
            return
        self._borrowed = elsewhere[0][1] + 1 if elsewhere else -1

    def _is_other_argument(self, data: bytes) -> bool:
        """Whether the next record is the same command with another argument."""
        following = self._records[self._position : self._position + 1]
        return bool(following) and following[0]["direction"] == "write" and decode_bytes(following[0]).split()[:1] == data.split()[:1]

    def _borrow(self) -> bytes:
        at = -1 if self._borrowed is None else self._borrowed
        if at < 0 or at >= len(self._records) or self._records[at]["direction"] != "read":
            raise InstrumentError(f"{self.resource_name}: nothing in the record answers {self._last_command!r}")
        self._borrowed = at + 1
        return decode_bytes(self._records[at])

    def _raise_recorded_error(self, during: str) -> None:
        if self._borrowed is not None or self._position >= len(self._records):
            return
        record = self._records[self._position]
        if record["direction"] == "error" and record["during"] == during:
            self._position += 1
            if "clock_s" in record:
                self._clock.follow(float(record["clock_s"]))
            raise InstrumentError(str(record["error"]))


def _check(record: Mapping[str, Any], number: int) -> None:
    """Refuse what `RecordingTransport` cannot have written, because a session may come from an untrusted source."""
    try:
        known = record["direction"] in ("open", "close", "leave", "clear", "read", "write", "request", "error")
        if record["direction"] in ("read", "write"):
            decode_bytes(record)
        elif record["direction"] == "request":
            known = isinstance(record["came"], bool)
        elif record["direction"] == "error":
            known = isinstance(record["error"], str) and isinstance(record["during"], str)
        known = known and isinstance(record["instrument"], str) and math.isfinite(float(record.get("clock_s", 0.0)))
    except (KeyError, TypeError, ValueError):
        known = False
    if not known:
        raise BadInput(f"traffic.jsonl, line {number}: is no record of an exchange")


class ReplayBench:
    """A bench whose instruments are recordings.

    Parameters
    ----------
    traffic : iterable of mapping
        All records of a session, as `Session.traffic()` gives them.
    lenient : bool
        See `ReplayTransport`.
    """

    def __init__(self, traffic: Iterable[Mapping[str, Any]], lenient: bool = False) -> None:
        self.clock = ReplayClock()
        self._lenient = lenient
        self._transports: list[ReplayTransport] = []
        self.begin_run(None)
        # One recording for each time that an instrument was opened, since a resumed run has opened it again.
        self._recordings: dict[str, list[list[Mapping[str, Any]]]] = {}
        for number, record in enumerate(traffic, start=1):
            _check(record, number)
            parts = self._recordings.setdefault(str(record["instrument"]), [])
            if record["direction"] == "open" or not parts:
                parts.append([])
            parts[-1].append(record)

    def open(self, role: str, driver: str, resource: str, sink: TrafficSink, options: Options | None = None) -> Driver:
        """Connect the driver of a role to the traffic recorded for that role."""
        parts = self._recordings.get(role)
        if not parts:
            raise InstrumentError(f"{role}: the session holds no recorded traffic of it")
        if self._until is not None and datetime.fromisoformat(str(parts[0][0].get("time"))) > self._until:
            raise RecordedEnd(f"{role}: the recorded run was stopped before this was opened")
        records = parts.pop(0)
        transport = ReplayTransport(str(records[0].get("resource", role)), records, self.clock, self._lenient)
        self._transports.append(transport)
        return attach(transport, role, driver, sink, options)

    def connect(self, what: ConnectionName) -> int:
        """Count the connections, as the recorded run did."""
        self._connections += 1
        return self._connections

    def at_line(self, line: str) -> None:
        """Nothing to do: the recorded levels are those of the line."""

    def begin_run(self, until: datetime | None) -> None:
        """Count connections from one again, as in every run; `until` is when the next run of the session began, if there was one."""
        self._connections = 0
        self._until = until

    @property
    def differences(self) -> list[ReplayDifference]:
        """The differences that a lenient replay has ignored."""
        return [difference for transport in self._transports for difference in transport.differences]

    def finish(self) -> None:
        """Raise if a recorded exchange was not played."""
        for transport in self._transports:
            transport.finish()

    def close(self) -> None:
        """Nothing to close."""
