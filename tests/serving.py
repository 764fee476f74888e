"""Simulated instruments behind genuine PyVISA resources: a loopback socket or a pseudo-terminal, opened with PyVISA-py."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from motoremi.bench.clock import FastClock
from motoremi.virtual.serve import Server, SocketServer, TerminalServer
from motoremi.virtual.simulated_bench import SimulatedBench
from motoremi.virtual.virtual_instruments import virtual_instrument

# Far faster than real, and yet slow enough for a client to see an instrument that is busy.
SPEED = 500.0


@contextmanager
def served(name: str, over: str = "tcp", bench: SimulatedBench | None = None) -> Iterator[tuple[Server, SimulatedBench]]:
    """A simulated instrument that other programs can reach, and the bench that it is on: its own at work, or the one that is given."""
    instrument = virtual_instrument(name)
    if bench is None:
        bench = SimulatedBench(7, clock=FastClock(SPEED))
        bench.connect(bench.at_work(instrument.role))
    device = instrument.make(bench, bench.clock)
    server: Server = SocketServer(device) if over == "tcp" else TerminalServer(device)
    with server:
        yield server, bench
    bench.close()


@contextmanager
def started(*arguments: str, in_background: bool = False) -> Iterator[tuple[dict[str, str], subprocess.Popen[str]]]:
    """`motoremi simulate` as users start it, and what it says when it is ready.

    `in_background`: with Ctrl-C ignored from the start, as `nohup`, a script's `&` and many CI runners start programs.
    """

    def ignore() -> None:
        signal.signal(signal.SIGINT, signal.SIG_IGN)

    command = [sys.executable, "-c", "from motoremi.cli import main; main()", "simulate", *arguments]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    process = subprocess.Popen(command, **pipes, text=True, preexec_fn=ignore if in_background else None)  # type: ignore[call-overload]
    try:
        yield json.loads(process.stdout.readline()), process
    finally:
        process.kill()
        process.communicate()
