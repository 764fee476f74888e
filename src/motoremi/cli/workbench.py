"""`motoremi workbench`: the local page."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from motoremi.cli.options import AsJson, command
from motoremi.errors import BadInput

NEEDED = ("starlette", "uvicorn")


def workbench_(
    path: Annotated[Path | None, typer.Argument(metavar="SESSION", help="A session folder to open.", show_default=False)] = None,
    folder: Annotated[Path, typer.Option(metavar="DIR", help="Folder for new sessions; its sessions are listed.")] = Path(),
    bench: Annotated[Path | None, typer.Option(metavar="FILE", help="Bench file with real instruments.", show_default=False)] = None,
    profile: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Profile of the laboratory for reports (docs/howto/report.md).", show_default=False)
    ] = None,
    port: Annotated[int, typer.Option(help="TCP port; 0 takes any free one.", min=0, max=65535)] = 0,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page (from a terminal only).")] = True,
    as_json: AsJson = False,
) -> None:
    """Serve the local web page for all of this. Only programs on this machine that know the printed address can use it. Ctrl-C ends it."""
    from importlib.util import find_spec

    if missing := [name for name in NEEDED if find_spec(name) is None]:
        raise BadInput(f"the workbench needs {' and '.join(missing)}: pip install 'motoremi[workbench]'")

    from motoremi.data.laboratory import read_laboratory
    from motoremi.data.paths import SESSION
    from motoremi.schema.bench_file import load_bench_file
    from motoremi.workbench.doorway import Opener
    from motoremi.workbench.server import serve

    if path is not None and not (path / SESSION).is_file():
        raise BadInput(f"{path}: no session here ({SESSION} is missing)")
    if profile is not None:
        read_laboratory(profile)  # errors are reported before the page opens
    bench_file = None if bench is None else load_bench_file(bench)
    opener = Opener()

    def ready(address: str) -> None:
        from motoremi.cli.output import emit_json, say

        if as_json:
            emit_json({"schema": "motoremi.workbench/1", "address": address})
        else:
            say(f"workbench: {address}\nKeep this address to yourself: it is the key. Ctrl-C ends the workbench.")
        sys.stdout.flush()
        if browser and not as_json and sys.stdout.isatty():
            opener.open(address)

    try:
        serve(folder, [] if path is None else [path], bench_file, port, ready, profile)
    finally:
        opener.close()


def register(app: typer.Typer) -> None:
    """Add this command."""
    command(app, "workbench", workbench_, "motoremi workbench my_motor")
