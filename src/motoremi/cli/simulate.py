"""`motoremi simulate`: serve a virtual instrument to other programs."""

from __future__ import annotations

import sys
import threading
from typing import TYPE_CHECKING, Annotated

import typer

from motoremi.cli.options import command

if TYPE_CHECKING:
    from motoremi.virtual.simulated_bench import SimulatedBench


def simulate_(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A driver: 4294a, esr, ...; motoremi instruments lists them.")],
    tcp: Annotated[int | None, typer.Option(metavar="PORT", help="Serve on this TCP port of 127.0.0.1; 0 for any free one.")] = None,
    pty: Annotated[bool, typer.Option("--pty", help="Serve on a pseudo-terminal, which is a serial port to other programs.")] = False,
    effect: Annotated[list[str] | None, typer.Option(metavar="ID", help="Hidden effect of the motor or the instrument.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Number from which motor, errors and noise are drawn.")] = 1,
    connected: Annotated[str | None, typer.Option(metavar="WHAT", help="What is connected at the beginning.", show_default=False)] = None,
    speed: Annotated[float, typer.Option(min=0.001, help="Speed of the instrument's time: 10 is ten times real time.")] = 1.0,
    as_json: Annotated[bool, typer.Option("--json", help="Allowed as with every command: the line is JSON without it, too.")] = False,
) -> None:
    """Serve a virtual instrument on loopback until Ctrl-C; prints {"resource": ...} when ready.

    Type what to connect (short, open, open-standard, ...) and press Enter to change the connection while it runs.
    """
    import json
    from contextlib import closing, suppress

    from motoremi.bench.clock import FastClock, WallClock
    from motoremi.errors import BadInput
    from motoremi.interrupts import stopped_by_signals
    from motoremi.virtual.serve import Server, SocketServer, TerminalServer
    from motoremi.virtual.simulated_bench import SimulatedBench
    from motoremi.virtual.virtual_instruments import virtual_instrument

    if (tcp is None) != pty:
        raise BadInput("give either --tcp PORT or --pty")
    instrument = virtual_instrument(name)
    clock = WallClock() if speed == 1 else FastClock(speed)
    with stopped_by_signals(), closing(SimulatedBench(seed, tuple(effect or ()), clock)) as bench:
        _connect(bench, connected or bench.at_work(instrument.role))
        device = instrument.make(bench, clock)
        server: Server = TerminalServer(device) if tcp is None else SocketServer(device, tcp)
        with closing(server), suppress(KeyboardInterrupt):
            sys.stdout.write(json.dumps({"resource": server.resource, "instrument": name}) + "\n")
            sys.stdout.flush()
            threading.Thread(target=_read_connections, args=(bench,), daemon=True).start()
            server.serve_forever()


def _read_connections(bench: SimulatedBench) -> None:
    """Change the connection to what is typed, line by line."""
    from motoremi.data.text import clean_text
    from motoremi.errors import BadInput

    for line in sys.stdin:
        try:
            _connect(bench, line.strip())
            sys.stderr.write(f"connected: {line.strip()}\n")
        except BadInput as error:
            sys.stderr.write(f"motoremi: {clean_text(str(error))}\n")


def _connect(bench: SimulatedBench, what: str) -> None:
    """Change the connection."""
    bench.connect(what)  # type: ignore[arg-type]  # the bench checks names from outside


def register(app: typer.Typer) -> None:
    """Add this command."""
    command(app, "simulate", simulate_, "motoremi simulate 4294a --tcp 5025")
