"""Serves a simulated instrument to other programs: on a loopback TCP socket or on a pseudo-terminal."""

from __future__ import annotations

import logging
import os
import select
import socket
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from types import TracebackType
from typing import Self

from motoremi.data.text import clean_text
from motoremi.errors import BadInput, InstrumentError
from motoremi.virtual.simulated_device import SimulatedDevice

LOOPBACK = "127.0.0.1"
_CHUNK = 65536
_NEWLINE = b"\n"
_LOG = logging.getLogger(__name__)


class Server(ABC):
    """Serves one instrument at one address, to one client at a time.

    Use it as a context manager, which serves from a thread, or call `serve_forever`.

    Parameters
    ----------
    device : SimulatedDevice
        Its `resource_name` is set to the server's resource.
    resource : str
        VISA name under which clients reach it.
    """

    def __init__(self, device: SimulatedDevice, resource: str) -> None:
        self.resource = resource
        self.device = device
        device.resource_name = resource
        self._stop_read, self._stop_write = socket.socketpair()
        self._thread = threading.Thread(target=self.serve_forever, name=f"serve {resource}", daemon=True)

    @abstractmethod
    def serve_forever(self) -> None:
        """Answer clients until `close`."""

    def close(self) -> None:
        """Stop serving; calling it again has no effect."""
        with suppress(OSError):
            self._stop_write.send(b"x")
        if self._thread.is_alive():
            self._thread.join()
        self._stop_read.close()
        self._stop_write.close()

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    @contextmanager
    def _survived(self) -> Iterator[None]:
        """Log an error of the simulation in one line, and go on serving."""
        try:
            yield
        except ConnectionError:
            raise
        except Exception as error:
            _LOG.error(clean_text(f"motoremi: {self.resource}: a message could not be answered ({type(error).__name__}: {error}); report it"))
            self.device.device_clear()

    def _readable(self, source: int) -> bool:
        """Wait for data; False if the server is to stop."""
        stop = self._stop_read.fileno()
        ready, _, _ = select.select([source, stop], [], [])
        return stop not in ready

    def send(self, target: int, write: Callable[[bytes], int], data: bytes) -> None:
        """Send as fast as the client reads; give up if the server is to stop."""
        stop = self._stop_read.fileno()
        while data:
            ready, writable, _ = select.select([stop], [target], [])
            if stop in ready:
                return
            if writable:
                with suppress(BlockingIOError):
                    data = data[write(data) :]


class SocketServer(Server):
    """On a TCP socket of this machine; no other machine can connect.

    Parameters
    ----------
    device : SimulatedDevice
    port : int
        0 for any free one.

    Raises
    ------
    BadInput
        If the number is not a port.
    InstrumentError
        If the port is in use.
    """

    def __init__(self, device: SimulatedDevice, port: int = 0) -> None:
        if not 0 <= port <= 65535:
            raise BadInput(f"{port} is no TCP port: use 0 (any free one) to 65535")
        try:
            self.listener = socket.create_server((LOOPBACK, port))
        except OSError as error:
            raise InstrumentError(f"TCP port {port} of {LOOPBACK} cannot be served: {error.strerror or error}") from error
        self._client: socket.socket | None = None
        self.port: int = self.listener.getsockname()[1]
        super().__init__(device, f"TCPIP::{LOOPBACK}::{self.port}::SOCKET")

    def serve_forever(self) -> None:
        """Answer one client after the other."""
        while self._readable(self.listener.fileno()):
            client, _ = self.listener.accept()
            # Answers that the last client has not read must not reach the next one.
            self.device.device_clear()
            self._client = client
            with client, suppress(ConnectionError), self._survived():
                client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                client.setblocking(False)
                while self._readable(client.fileno()) and (data := client.recv(_CHUNK)):
                    self.send(client.fileno(), client.send, converse(self.device, data))

    def drop_client(self) -> None:
        """Cut the connection, as a pulled network cable or a restarted switch does."""
        if self._client is not None:
            with suppress(OSError):
                self._client.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Stop serving."""
        super().close()
        self.listener.close()


class TerminalServer(Server):
    """On a pseudo-terminal, which any program can open as a serial port.

    Raises
    ------
    BadInput
        If the operating system has none.
    """

    def __init__(self, device: SimulatedDevice) -> None:
        try:
            import pty
            import tty
        except ImportError as error:
            raise BadInput("this operating system has no pseudo-terminals; use --tcp") from error
        self.master, self._slave = pty.openpty()
        # Raw mode: the terminal neither echoes nor translates line ends.
        tty.setraw(self._slave)
        os.set_blocking(self.master, False)
        self.path = os.ttyname(self._slave)
        super().__init__(device, f"ASRL{self.path}::INSTR")

    def serve_forever(self) -> None:
        """Answer any program that opens the port; the port stays open in between."""
        while self._readable(self.master):
            data = os.read(self.master, _CHUNK)
            with self._survived():
                self.send(self.master, partial(os.write, self.master), converse(self.device, data))

    def close(self) -> None:
        """Stop serving."""
        super().close()
        for descriptor in (self.master, self._slave):
            with suppress(OSError):
                os.close(descriptor)


def converse(device: SimulatedDevice, data: bytes) -> bytes:
    """Pass bytes to an instrument, which may be several messages or a part of one, and return all its answers."""
    answer = bytearray()
    for piece in data.splitlines(keepends=True) if _NEWLINE in data else [data]:
        device.write(piece)
        answer += device.take_answers()
    return bytes(answer)
