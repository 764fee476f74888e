"""The command-line application; each command is defined in the module of its subject."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from motoremi import __version__
from motoremi.cli import (
    bench,
    blind,
    catalogue,
    demo,
    doctor,
    emission,
    export,
    fleet,
    import_folder,
    investigate,
    paper,
    session_commands,
    session_data,
    simulate,
    workbench,
)

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
    context: typer.Context,
    config: Annotated[
        Path | None,
        typer.Option(
            "--config", metavar="FILE", envvar="MOTOREMI_CONFIG", help="Settings; by default motoremi.toml here or in your own settings folder."
        ),
    ] = None,
    effects_from: Annotated[
        list[Path] | None,
        typer.Option(
            "--effects-from", metavar="FILE.py", envvar="MOTOREMI_EFFECTS_FROM", help="Effects of your own from a Python file. This runs its code."
        ),
    ] = None,
    version: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")] = False,
) -> None:
    from motoremi.cli.settings import defaults, settings_file, tell_own_effects

    command: Any = context.command
    context.default_map = defaults(settings_file(config), command.commands)
    if effects_from:
        from motoremi.model.effects import effects_from as take

        tell_own_effects(effects_from)
        take(*effects_from)


for module in (
    demo,
    bench,
    investigate,
    simulate,
    session_data,
    import_folder,
    session_commands,
    workbench,
    emission,
    export,
    fleet,
    catalogue,
    doctor,
    blind,
    paper,
):
    module.register(app)
