"""Records every exchange with an instrument: the evidence of a measurement and the source of its replay."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from typing import Any

from motoremi.bench.transport import Parity, Transport
from motoremi.errors import InstrumentError

TrafficSink = Callable[[Mapping[str, Any]], None]


def encode_bytes(data: bytes) -> dict[str, str]:
    """Bytes as readable text where they are printable ASCII, as base64 where they are not."""
    text = data.decode("latin-1")
    if text.isascii() and text.replace("\r", "").replace("\n", "").replace("\t", "").isprintable():
        return {"text": text}
    return {"base64": base64.b64encode(data).decode("ascii")}


def decode_bytes(record: Mapping[str, Any]) -> bytes:
    """The bytes of a record that `encode_bytes` wrote."""
    if "base64" in record:
        return base64.b64decode(record["base64"], validate=True)
    return str(record["text"]).encode("ascii")


class RecordingTransport(Transport):
    """Passes every exchange of another transport to a sink before it goes on.

    A record holds `time` (UTC), `clock_s` (of the bench's clock), `timeout_s` (the deadline in force), `instrument` (its role),
    `resource`, `direction` (`open`, `write`, `read`, `request`, `clear`, `error` or `close`), and `text`, `base64` or, for an error,
    `error` and the call that failed in `during`. `open` says how the link carries messages and whether it carries service requests;
    `request` is the end of a wait for one, and whether it `came`.

    Parameters
    ----------
    inner : Transport
    instrument : str
        The role it plays, for example `analyser`.
    sink : callable
        Takes one record; `SessionWriter.log_traffic` is one.
    """

    def __init__(self, inner: Transport, instrument: str, sink: TrafficSink) -> None:
        super().__init__(inner.resource_name, inner.clock, inner.stream)
        self._inner = inner
        self._instrument = instrument
        self._sink = sink
        # Kept here: asking VISA for each record would take longer than writing the record.
        self._timeout_s = inner.timeout_s
        self.service_requests = inner.service_requests
        self._record("open", stream=inner.stream, service_requests=inner.service_requests)

    @property
    def timeout_s(self) -> float:
        """Deadline of one exchange in seconds."""
        return self._timeout_s

    @timeout_s.setter
    def timeout_s(self, seconds: float) -> None:
        self._inner.timeout_s = seconds
        self._timeout_s = seconds

    def end_messages_with(self, sent: bytes, received: str) -> None:
        """Replace the newline at the end of messages."""
        super().end_messages_with(sent, received)
        self._inner.end_messages_with(sent, received)

    def talk_at(self, baud: int, data_bits: int = 8, parity: Parity = "none") -> None:
        """Set up a serial line."""
        self._inner.talk_at(baud, data_bits, parity)

    def send(self, data: bytes) -> None:
        """Record, then send, so that an attempt that fails is recorded too."""
        # The inner transport names the command when it fails.
        self._inner._last_command = self._last_command
        self._record("write", **encode_bytes(data))
        with self._errors_recorded("write"):
            self._inner.send(data)

    def receive(self) -> bytes:
        """Receive, then record."""
        with self._errors_recorded("read"):
            data = self._inner.receive()
        self.answered_at = self._inner.answered_at or datetime.now(UTC).isoformat()
        self._record("read", **encode_bytes(data))
        return data

    def receive_bytes(self, count: int) -> bytes:
        """Receive, then record."""
        with self._errors_recorded("read"):
            data = self._inner.receive_bytes(count)
        self._record("read", **encode_bytes(data))
        return data

    def await_request(self, seconds: float) -> bool:
        """Wait for a service request, then record whether one came."""
        self._inner.while_waiting = self.while_waiting
        with self._errors_recorded("request"):
            came = self._inner.await_request(seconds)
        self._record("request", came=came)
        return came

    def clear(self) -> None:
        """Record, then clear the link."""
        self._record("clear")
        with self._errors_recorded("clear"):
            self._inner.clear()

    def close(self) -> None:
        """Record, then close the link."""
        self._record("close")
        self._inner.close()

    @contextmanager
    def _errors_recorded(self, during: str) -> Iterator[None]:
        try:
            yield
        except InstrumentError as error:
            self._record("error", during=during, error=str(error))
            raise

    def _record(self, direction: str, **content: str | bool) -> None:
        self._sink(
            {
                "time": self.answered_at if direction == "read" else datetime.now(UTC).isoformat(),
                "clock_s": self.clock.now(),
                "timeout_s": self._timeout_s,
                "instrument": self._instrument,
                "resource": self.resource_name,
                "direction": direction,
                **content,
            }
        )
