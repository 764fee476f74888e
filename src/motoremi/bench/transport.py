"""The link to one instrument: text and binary blocks on top of two methods, `send` and `receive`."""

from __future__ import annotations

import abc
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from math import ceil
from typing import Literal

import pyvisa
from pyvisa import constants
from pyvisa.resources import MessageBasedResource

from motoremi.bench.clock import Clock, WallClock
from motoremi.bench.socket_input import discard_until_silent, readable_bytes, socket_of
from motoremi.errors import InstrumentError

TERMINATOR = b"\n"
# Data that the VISA library has read ahead, that the operating system has received, and that it has not sent yet.
_SERIAL_BUFFERS = (
    constants.BufferOperation.discard_read_buffer,
    constants.BufferOperation.discard_receive_buffer,
    constants.BufferOperation.discard_transmit_buffer,
)
# Ctrl-C and the workbench's Stop are blocked during a wait in a VISA library, so it waits in slices of this length.
_LONGEST_WAIT_S = 0.5
# Resolution of VISA's timeouts, which are in whole milliseconds.
_CLOSE_ENOUGH_S = 1e-3
# Status of a read that returned only a part of the message.
_MORE = constants.StatusCode.success_max_count_read
Parity = Literal["none", "even", "odd"]
# Bit 6 of the status byte in a serial poll.
_REQUESTS_SERVICE = 0x40


class Transport(abc.ABC):
    """A link that carries messages.

    A new kind of link defines `send`, `receive`, `receive_bytes`, `clear`, `close` and `timeout_s`; everything else uses these, so that a
    recording or a replay has every byte in one place.

    Parameters
    ----------
    resource_name : str
        VISA name of the instrument, for messages and records.
    clock : Clock
        Clock of everything that waits.
    stream : bool
        True where only a newline marks the end of a message (socket, serial line), which a binary block may contain.

    Attributes
    ----------
    service_requests : bool
        Whether the instrument can be waited for with `await_request`; False unless the link says otherwise.
    while_waiting : callable
        Called repeatedly during that wait; an exception from it ends the wait.
    answered_at : str
        UTC time of the last answer, where the link records it; a replay gives the recorded one.
    """

    def __init__(self, resource_name: str, clock: Clock, stream: bool = False) -> None:
        self.resource_name = resource_name
        self.clock = clock
        self.stream = stream
        self.service_requests = False
        self.while_waiting: Callable[[], None] = lambda: None
        self.terminator = TERMINATOR
        self.answered_at = ""
        self._last_command = ""

    @abc.abstractmethod
    def send(self, data: bytes) -> None:
        """Send one message, terminator included."""

    @abc.abstractmethod
    def receive(self) -> bytes:
        """Receive one message, terminator included; `InstrumentError` if none comes within `timeout_s`."""

    @abc.abstractmethod
    def receive_bytes(self, count: int) -> bytes:
        """Receive that many bytes of an answer without terminator; `InstrumentError` if they do not arrive within `timeout_s`."""

    @abc.abstractmethod
    def clear(self) -> None:
        """Clear the link: the instrument discards unread answers and incomplete commands."""

    @abc.abstractmethod
    def close(self) -> None:
        """Close the link; calling it again has no effect."""

    @property
    @abc.abstractmethod
    def timeout_s(self) -> float:
        """Deadline of one exchange in seconds."""

    @timeout_s.setter
    @abc.abstractmethod
    def timeout_s(self, seconds: float) -> None: ...

    def await_request(self, seconds: float) -> bool:
        """Wait until the instrument requests service; False if it does not within that time."""
        raise InstrumentError(f"{self.resource_name}: this link carries no service requests")

    def end_messages_with(self, sent: bytes, received: str) -> None:
        """Replace the newline at the end of messages: `sent` follows each command, the character `received` ends each answer if there is one."""
        self.terminator = sent

    def talk_at(self, baud: int, data_bits: int = 8, parity: Parity = "none") -> None:  # noqa: B027
        """Set up a serial line; no effect on other links."""

    @contextmanager
    def deadline(self, seconds: float) -> Iterator[None]:
        """Use another deadline, in seconds, within a `with` block."""
        before = self.timeout_s
        self.timeout_s = seconds
        try:
            yield
        finally:
            self.timeout_s = before

    def write(self, command: str) -> None:
        """Send a command."""
        try:
            data = command.encode("ascii")
        except UnicodeEncodeError as error:
            raise InstrumentError(f"{self.resource_name}: {command!r} is not ASCII; no instrument takes it") from error
        self._last_command = command
        self.send(data + self.terminator)

    def write_bytes(self, data: bytes, command: str) -> None:
        """Send binary data; `command` describes it in messages."""
        self._last_command = command
        self.send(data)

    def read(self) -> str:
        """Read a text answer, without its terminator."""
        # Receivers write µ in latin-1; every byte has a meaning there, so nothing can fail to decode.
        return self.receive().decode("latin-1").strip()

    def query(self, command: str) -> str:
        """Send a command and read its text answer."""
        self.write(command)
        return self.read()

    def query_block(self, command: str) -> bytes:
        """Send a command and read its IEEE 488.2 definite-length block, without the header.

        Raises
        ------
        InstrumentError
            If the answer is no block, or shorter or longer than its header says.
        """
        self.write(command)
        message = self.receive()
        start, length = self._block_extent(message)
        while self.stream and len(message) < start + length + len(TERMINATOR):
            message += self.receive()
        payload = message[start:]
        # Some instruments end the message by the END line alone, others by CR LF.
        if payload[length:] in (TERMINATOR, b"\r" + TERMINATOR):
            payload = payload[:length]
        if len(payload) != length:
            raise InstrumentError(
                f"{self.resource_name}: the block in answer to {command!r} announces {length} bytes but has {len(payload)}; "
                "the transfer was cut, repeat it or choose ASCII transfer"
            )
        return payload

    def _block_extent(self, message: bytes) -> tuple[int, int]:
        digits = message[1:2]
        count = message[2 : 2 + int(digits)] if message[:1] == b"#" and digits.isdigit() else b""
        if not count.isdigit() or len(count) != int(digits):
            raise InstrumentError(f"{self.resource_name}: expected a binary block in answer to {self._last_command!r}, got {message[:24]!r}")
        return 2 + len(count), int(count)


class VisaTransport(Transport):
    """A real PyVISA resource, with its terminations and deadline set explicitly.

    Parameters
    ----------
    resource : pyvisa.resources.MessageBasedResource
    timeout_s : float
        Deadline of one exchange in seconds.
    clock : Clock, optional
    reopen : callable, optional
        Opens the resource again. `clear` does so after a failed exchange, because the link may be broken.
    """

    def __init__(
        self,
        resource: MessageBasedResource,
        timeout_s: float = 5.0,
        clock: Clock | None = None,
        reopen: Callable[[], MessageBasedResource] | None = None,
    ) -> None:
        stream = resource.interface_type == constants.InterfaceType.asrl or resource.resource_class == "SOCKET"
        super().__init__(str(resource.resource_name), clock or WallClock(), stream)
        self._resource = resource
        self._reopen = reopen
        self._failed = False
        self._timeout_s = timeout_s
        # Deadline of the present exchange on the machine's monotonic clock, which VISA's timeouts follow; set when its answer is first read.
        self._ends_s: float | None = None
        self._serial: tuple[int, int, Parity] | None = None
        # On GPIB, USB and VXI-11 the END line closes a message. A termination character would cut binary blocks there.
        resource.read_termination = TERMINATOR.decode() if stream else None
        self.service_requests = not stream and self._enable_requests()
        self.timeout_s = timeout_s

    @property
    def timeout_s(self) -> float:
        """Deadline of one exchange in seconds."""
        return self._timeout_s

    @timeout_s.setter
    def timeout_s(self, seconds: float) -> None:
        self._timeout_s = seconds
        self._ends_s = None
        self._wait_at_most(seconds)

    def end_messages_with(self, sent: bytes, received: str) -> None:
        """Replace the newline at the end of messages; an empty `received` means that answers have no terminator."""
        super().end_messages_with(sent, received)
        self._resource.read_termination = received or None

    def talk_at(self, baud: int, data_bits: int = 8, parity: Parity = "none") -> None:
        """Set up a serial line."""
        if self._resource.interface_type != constants.InterfaceType.asrl:
            return
        self._serial = (baud, data_bits, parity)
        with self._one_line("cannot be set up as a serial line after", "check baud rate, data bits and parity"):
            self._resource.set_visa_attribute(constants.ResourceAttribute.asrl_baud_rate, baud)
            self._resource.set_visa_attribute(constants.ResourceAttribute.asrl_data_bits, data_bits)
            self._resource.set_visa_attribute(constants.ResourceAttribute.asrl_parity, constants.Parity[parity])

    def send(self, data: bytes) -> None:
        """Send one message."""
        self._ends_s = None
        with self._one_line("did not accept", "check cable, address and power"):
            self._resource.write_raw(data)

    def receive(self) -> bytes:
        """Receive one message; everything that is received after one command shares one deadline, so a slow link cannot extend it."""
        begun = self._ends_s is not None
        if self._ends_s is None:
            self._ends_s = time.monotonic() + self._timeout_s
        message = bytearray()
        status = _MORE
        with self._resource.ignore_warning(_MORE, constants.StatusCode.success_device_not_present):
            while status == _MORE:
                trouble = "did not finish its answer to" if begun or message else "gave no answer to"
                with self._one_line(trouble, "check power, cable and address, and that no other program uses it"):
                    part, status = self._receive_part(self._ends_s)
                message += part
        return bytes(message)

    def receive_bytes(self, count: int) -> bytes:
        """Receive that many bytes, within one deadline."""
        ends_s = time.monotonic() + self._timeout_s
        answer = bytearray()
        with self._resource.ignore_warning(_MORE, constants.StatusCode.success_device_not_present):
            while len(answer) < count:
                with self._one_line("gave no whole answer to", "check power, cable and address, and that no other program uses it"):
                    answer += self._receive_part(ends_s, count - len(answer))[0]
        return bytes(answer)

    def _receive_part(self, ends_s: float, most: int | None = None) -> tuple[bytes, constants.StatusCode]:
        left_s = ends_s - time.monotonic()
        ready = readable_bytes(self._resource, left_s) if left_s > 0 else 0
        if not ready:
            raise pyvisa.VisaIOError(constants.StatusCode.error_timeout)
        is_later = left_s < self._timeout_s - _CLOSE_ENOUGH_S
        if is_later:
            self._wait_at_most(left_s)
        try:
            return self._resource.visalib.read(self._resource.session, ready if most is None else min(ready, most))
        finally:
            if is_later:
                self._wait_at_most(self._timeout_s)

    def _wait_at_most(self, seconds: float) -> None:
        self._resource.timeout = max(1, round(seconds * 1000))

    def await_request(self, seconds: float) -> bool:
        """Wait for a service request, and read the status byte to see whether it came from this instrument."""
        deadline_s = self.clock.now() + seconds
        while (left_s := deadline_s - self.clock.now()) > 0:
            # Rounded up, so that the deadline has really passed when the last slice ends.
            wait_ms = ceil(1000 * min(left_s, _LONGEST_WAIT_S)) + 1
            with self._one_line("failed while it was waited for after", "check cable, address and power"):
                event = self._resource.wait_on_event(constants.EventType.service_request, wait_ms, capture_timeout=True)
                if not event.timed_out and self._resource.read_stb() & _REQUESTS_SERVICE:
                    return True
            self.while_waiting()
        return False

    def clear(self) -> None:
        """Send a device clear, on a new link if the last exchange failed. No command is repeated; that is up to the caller."""
        self._ends_s = None
        with self._one_line("could not be cleared after", "switch it off and on"):
            link = socket_of(self._resource)
            if link is not None and not self._failed:
                # A socket has no device clear, so input is discarded. One that was closed, or sends without end, has to be opened again.
                self._failed = not discard_until_silent(link, self._timeout_s)
            if self._failed and self._reopen is not None:
                self._reconnect(self._reopen)
            if link is not None:
                self._resource.flush(constants.BufferOperation.discard_receive_buffer)
            elif self._resource.interface_type == constants.InterfaceType.asrl:
                # A serial line has no device clear, so all buffers are discarded.
                for buffer in _SERIAL_BUFFERS:
                    self._resource.flush(buffer)
            else:
                self._resource.clear()

    def close(self) -> None:
        """Close the VISA session."""
        self._resource.close()

    def _reconnect(self, reopen: Callable[[], MessageBasedResource]) -> None:
        timeout_s, ending = self.timeout_s, self._resource.read_termination
        # Closing a broken link may fail too.
        with suppress(pyvisa.Error, OSError):
            self._resource.close()
        self._resource = reopen()
        self._resource.read_termination = ending
        if self._serial is not None:
            self.talk_at(*self._serial)
        if self.service_requests:
            self._enable_requests()
        self.timeout_s = timeout_s
        self._failed = False

    def _enable_requests(self) -> bool:
        """Have service requests queued; False if the resource or its library cannot."""
        try:
            self._resource.enable_event(constants.EventType.service_request, constants.EventMechanism.queue)
        except (pyvisa.Error, OSError, NotImplementedError):
            return False
        return True

    @contextmanager
    def _one_line(self, trouble: str, advice: str) -> Iterator[None]:
        # PyVISA-py does not translate errors of the socket, and not every backend has every call.
        try:
            yield
        except (pyvisa.Error, OSError, NotImplementedError) as error:
            self._failed = True
            detail = f"within {self.timeout_s:g} s" if _is_timeout(error) else f"({str(error).splitlines()[0]})"
            command = self._last_command or "the opening of the link"
            raise InstrumentError(f"{self.resource_name}: {trouble} {command!r} {detail}; {advice}") from error


def _is_timeout(error: Exception) -> bool:
    return isinstance(error, pyvisa.VisaIOError) and error.error_code == constants.StatusCode.error_timeout
