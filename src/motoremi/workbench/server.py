"""Serve the workbench on the loopback address until it is stopped."""

from __future__ import annotations

import asyncio
import secrets
import socket
from collections.abc import Callable
from pathlib import Path

import uvicorn
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol

from motoremi.errors import BadInput
from motoremi.schema.bench_file import BenchFile
from motoremi.workbench.routes import Workbench, make_app
from motoremi.workbench.shelf import Shelf

LOOPBACK = "127.0.0.1"
# Open event streams are closed this long after the workbench is told to stop.
SHUTDOWN_S = 1
# Connections whose request headers are not complete by then are closed; longer than uvicorn keeps an idle connection (5 s).
HEADER_DEADLINE_S = 8.0


class Deadlined(H11Protocol):
    """A connection with a deadline for request headers: uvicorn alone would wait without limit for a request that never completes."""

    _late: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Start the deadline for the first request."""
        super().connection_made(transport)
        self._await_request()

    def on_response_complete(self) -> None:
        """Restart the deadline for the next request."""
        self._await_request()
        super().on_response_complete()

    def connection_lost(self, exc: Exception | None) -> None:
        """Cancel the deadline."""
        if self._late is not None:
            self._late.cancel()
        super().connection_lost(exc)

    def _await_request(self) -> None:
        if self._late is not None:
            self._late.cancel()
        self._late = self.loop.call_later(HEADER_DEADLINE_S, self._cut_off)

    def _cut_off(self) -> None:
        if self.cycle is None or self.cycle.response_complete:
            self.transport.close()


class Server(uvicorn.Server):
    """Closes event streams first: otherwise shutdown would wait for the connections of open pages."""

    def __init__(self, app: ASGIApp, workbench: Workbench) -> None:
        config = uvicorn.Config(
            app,
            http=Deadlined,
            log_level="critical",
            access_log=False,
            lifespan="off",
            ws="none",
            server_header=False,
            timeout_graceful_shutdown=SHUTDOWN_S,
        )
        super().__init__(config)
        self._workbench = workbench

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Stop serving."""
        self._workbench.events.close()
        await super().shutdown(sockets)


def serve(
    folder: Path, sessions: list[Path], bench_file: BenchFile | None, port: int, ready: Callable[[str], None], profile: Path | None = None
) -> None:
    """Serve until Ctrl-C.

    Parameters
    ----------
    folder : Path
        Where new sessions are made.
    sessions : list of Path
        Sessions to open at once.
    bench_file : BenchFile or None
        The real bench.
    port : int
        0 takes a free one.
    ready : callable
        Called with the address, including the token, as soon as the server accepts connections.
    profile : Path, optional
        The laboratory profile used for reports.

    Raises
    ------
    BadInput
        If the port is taken, or the folder does not exist.
    """
    if not folder.is_dir():
        raise BadInput(f"{folder}: no such folder")
    workbench = Workbench(Shelf(folder, sessions), bench_file, profile)
    token = secrets.token_urlsafe(32)
    with _listening(port) as listener:
        actual = listener.getsockname()[1]
        app = make_app(workbench, token, {f"{LOOPBACK}:{actual}", f"localhost:{actual}"})
        # The socket is listening already, so the address can be used at once.
        ready(f"http://{LOOPBACK}:{actual}/?token={token}")
        try:
            Server(app, workbench).run(sockets=[listener])
        finally:
            workbench.leave()


def _listening(port: int) -> socket.socket:
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((LOOPBACK, port))
        listener.listen(128)
    except OSError as error:
        listener.close()
        raise BadInput(f"port {port}: {error.strerror}; another workbench may be using it (--port 0 takes a free one)") from error
    return listener
