"""Recorded traffic that answers in place of the instrument."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from motoremi.bench.clock import VirtualClock
from motoremi.bench.connect import Connection, attach
from motoremi.bench.driver import Driver
from motoremi.bench.recording import TrafficSink, decode_bytes
from motoremi.bench.transport import Transport
from motoremi.errors import InstrumentError


class ReplayTransport(Transport):
    """Plays one instrument's recorded exchanges back, in order; a difference is an error that shows both sides.

    Parameters
    ----------
    resource_name : str
    records : iterable of mapping
        As `RecordingTransport` writes them, of this instrument only.
    """

    def __init__(self, resource_name: str, records: Iterable[Mapping[str, Any]]) -> None:
        super().__init__(resource_name, VirtualClock())
        self._records = list(records)
        self._position = 0
        self._timeout_s = 5.0

    @property
    def timeout_s(self) -> float:
        """Deadline in seconds; nothing waits in a replay."""
        return self._timeout_s

    @timeout_s.setter
    def timeout_s(self, seconds: float) -> None:
        self._timeout_s = seconds

    def send(self, data: bytes) -> None:
        """Compare with what was sent when the record was made."""
        record = self._next("write", f"{data!r} to be sent")
        expected = decode_bytes(record)
        if expected != data:
            raise InstrumentError(f"{self.resource_name}: replay differs at exchange {self._position}: expected {expected!r}, got {data!r}")
        self._raise_recorded_error("write")

    def receive(self) -> bytes:
        """The recorded answer, or the recorded error."""
        self._raise_recorded_error("read")
        return decode_bytes(self._next("read", "an answer to be read"))

    def clear(self) -> None:
        """Compare with the record."""
        self._next("clear", "the link to be cleared")
        self._raise_recorded_error("clear")

    def close(self) -> None:
        """Nothing to give back."""

    def finish(self) -> None:
        """Raise if part of the record was not played."""
        left = len(self._records) - self._position
        if left:
            raise InstrumentError(
                f"{self.resource_name}: replay ended early: {left} recorded exchanges left, next {_show(self._records[self._position])}"
            )

    def _next(self, direction: str, asked: str) -> Mapping[str, Any]:
        if self._position >= len(self._records):
            raise InstrumentError(f"{self.resource_name}: replay differs: expected the end of the record, got {asked}")
        record = self._records[self._position]
        self._position += 1
        if record["direction"] != direction:
            raise InstrumentError(f"{self.resource_name}: replay differs at exchange {self._position}: expected {_show(record)}, got {asked}")
        return record

    def _raise_recorded_error(self, during: str) -> None:
        if self._position >= len(self._records):
            return
        record = self._records[self._position]
        if record["direction"] == "error" and record["during"] == during:
            self._position += 1
            raise InstrumentError(str(record["error"]))


class ReplayBench:
    """A bench whose instruments are recordings.

    Parameters
    ----------
    traffic : iterable of mapping
        All records of a session, as `Session.traffic()` gives them.
    """

    def __init__(self, traffic: Iterable[Mapping[str, Any]]) -> None:
        self._traffic = list(traffic)
        self._transports: list[ReplayTransport] = []
        self._connections = 0

    def open(self, role: str, driver: str, resource: str, sink: TrafficSink) -> Driver:
        """Connect the driver of a role to what was recorded of that role."""
        records = [record for record in self._traffic if record["instrument"] == role]
        if not records:
            raise InstrumentError(f"{role}: the session holds no recorded traffic of it")
        transport = ReplayTransport(str(records[0]["resource"]), records)
        self._transports.append(transport)
        return attach(transport, role, driver, sink)

    def connect(self, what: Connection) -> int:
        """Count as the recorded run did."""
        self._connections += 1
        return self._connections

    def finish(self) -> None:
        """Raise if a recorded exchange was not played."""
        for transport in self._transports:
            transport.finish()

    def close(self) -> None:
        """Nothing to give back."""


def _show(record: Mapping[str, Any]) -> str:
    content = record.get("text", record.get("base64", record.get("error", "")))
    return f"{record['direction']} {content!r:.80}"
