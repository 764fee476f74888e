"""All commands in one list; each lives in the module of its subject."""

from __future__ import annotations

from typing import Annotated

import typer

from motoremi import __version__
from motoremi.cli import bench, blind, catalogue, demo, export, fleet, paper, session

app = typer.Typer(
    help="Measure the common-mode impedance and emission of DC motors, fit the circuit, find the missing effect, report.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Start with: motoremi demo",
)


def _version(asked: bool) -> None:
    if asked:
        typer.echo(f"motoremi {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")] = False,
) -> None:
    pass


for module in (demo, bench, session, export, fleet, catalogue, blind, paper):
    module.register(app)
