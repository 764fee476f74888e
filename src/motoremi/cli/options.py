"""Arguments and options that several commands have in common."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypeAlias

import typer

from motoremi.errors import BadInput

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from motoremi.data.corrections import Corrections

SessionPath: TypeAlias = Annotated[Path, typer.Argument(metavar="SESSION", help="A session folder.", show_default=False)]
AsJson: TypeAlias = Annotated[bool, typer.Option("--json", help="One JSON document on standard output, for machines.")]
Without: TypeAlias = Annotated[
    list[str] | None, typer.Option("--without", metavar="ID", help="A measurement that this bench cannot do; may be repeated.")
]
Menu: TypeAlias = Annotated[Path | None, typer.Option("--menu", metavar="FILE", help="Measurements and minutes of your own laboratory (TOML).")]
# Options of both imports.
AnalyserName: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--analyser",
        metavar="NAME",
        help="Analyser of the sweeps: 4294a, e4990a (with adapter and fixture: 4294a+1m+leads), nanovna, none (ideal); with the motor "
        "between two ports, for files that do not say so, nanovna+series-through; "
        "unknown, the default: the size of its errors is estimated.",
    ),
]
Fixture: TypeAlias = Annotated[
    Literal["series-through", "shunt-through", "reflection"] | None,
    typer.Option(
        "--fixture",
        help="For Touchstone of two ports (.s2p): motor in series between the ports, or across the line (S21; the errors assumed of the "
        "analyser are then those of a transmission), or at port 1 alone (S11).",
    ),
]
Compensated: TypeAlias = Annotated[
    bool,
    typer.Option(
        "--compensated",
        help="The analyser was calibrated at the motor's terminals, or its fixture compensated there: without it a network analyser's fixture "
        "of a few centimetres is estimated from the sweeps.",
    ),
]
Band: TypeAlias = Annotated[
    str, typer.Option("--band", metavar="LOW:HIGH", help="Part of the sweeps to use, for example 150kHz:30MHz; the rest is left out.")
]
UnitsGiven: TypeAlias = Annotated[
    list[str] | None,
    typer.Option("--unit", metavar="COLUMN=UNIT", help="Unit of a column whose name has none: FREQ=Hz, Z=Ohm, PHASE=deg; may be repeated."),
]
Accuracy: TypeAlias = Annotated[
    str, typer.Option("--accuracy", metavar="PERCENT", help="Accuracy of the sweeps in percent of |Z|; a model with this error is good enough.")
]
Operator: TypeAlias = Annotated[str, typer.Option("--operator", metavar="TEXT", help="Who measured, for the report.")]
Ambient: TypeAlias = Annotated[str, typer.Option("--ambient", metavar="TEXT", help="Temperature and humidity, for the report.")]
Out: TypeAlias = Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Folder to make.", show_default=False)]


def command(app: typer.Typer, name: str, function: Callable[..., None], example: str) -> None:
    """Add a command whose help ends with an example."""
    app.command(name, epilog=f"Example: {example}")(function)


def refuse_output(path: Path) -> None:
    """Refuse a file to write whose folder does not exist, which is often a mistyped name, or that belongs to the data of a session.

    Raises
    ------
    BadInput
        In these cases.
    """
    from motoremi.data.output_file import check_output

    if not path.parent.is_dir():
        raise BadInput(f"{path}: there is no folder {path.parent}; make it first, or name another")
    check_output(path)


def plot_file(path: Path) -> Path:
    """A file that a plot can be written to.

    Raises
    ------
    BadInput
        For any other ending, a folder that does not exist, or a file of a session's data.
    """
    if path.suffix.lower() not in (".svg", ".png", ".pdf"):
        raise BadInput(f"{path}: plots are written as .svg, .png or .pdf")
    refuse_output(path)
    return path


def save_plot(figure: Figure, file: Path) -> None:
    """Write a figure to such a file, whole or not at all."""
    from motoremi.data.output_file import write_output

    drawn = io.BytesIO()
    figure.savefig(drawn, format=file.suffix.lower()[1:])
    write_output(file, drawn.getvalue())


def corrections_of(path: Path) -> Corrections:
    """The corrections of a file; on a terminal the user is asked about a loss or gain with the wrong sign."""
    from motoremi.data.corrections import read_corrections

    return read_corrections(path, ask_once())


def ask_once() -> Callable[[str], bool] | None:
    """A function that asks a yes-or-no question; None if standard input is not a terminal."""
    return (lambda question: typer.confirm(question, err=True)) if sys.stdin.isatty() else None


def is_typed(context: typer.Context, name: str) -> bool:
    """Whether an option was given with the command, not in a settings file: that is for new sessions and reports of one."""
    source = context.get_parameter_source(name)
    return source is not None and source.name == "COMMANDLINE"
