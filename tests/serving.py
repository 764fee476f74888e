"""Simulated instruments behind genuine PyVISA resources: a loopback socket or a pseudo-terminal, opened with PyVISA-py."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from motoremi.bench.clock import FastClock
from motoremi.bench.serve import Server, SocketServer, TerminalServer
from motoremi.bench.simulated import SimulatedBench
from motoremi.bench.virtual import virtual_instrument

# Far faster than real, and yet slow enough for a client to see an instrument that is busy.
SPEED = 500.0


@contextmanager
def served(name: str, over: str = "tcp", connected: str | None = None) -> Iterator[tuple[Server, SimulatedBench]]:
    """A simulated instrument that other programs can reach, and the bench that it is on."""
    clock = FastClock(SPEED)
    bench = SimulatedBench(7, clock=clock)
    instrument = virtual_instrument(name)
    bench.connect(connected or bench.at_work(instrument.role))  # type: ignore[arg-type]
    device = instrument.make(bench, clock)
    server: Server = SocketServer(device) if over == "tcp" else TerminalServer(device)
    with server:
        yield server, bench
    bench.close()
