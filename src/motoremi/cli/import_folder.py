"""`motoremi import-folder`: a session for each motor from the files of a production line."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motoremi.cli.options import Accuracy, Ambient, AnalyserName, AsJson, Band, Compensated, Fixture, Operator, UnitsGiven, command

if TYPE_CHECKING:
    from motoremi.data.grouping import Files


def import_folder_(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder with the files, at any depth.", show_default=False)],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="Folder for the sessions, one for each motor.", show_default=False)],
    short: Annotated[
        str | None,
        typer.Option("--short", metavar="PATTERN", help="Names of the short-circuit sweeps: '*_short.csv'; the first * is the motor's name."),
    ] = None,
    open_: Annotated[str | None, typer.Option("--open", metavar="PATTERN", help="Names of the open-circuit sweeps: '*_open.csv'.")] = None,
    analyser: AnalyserName = None,
    fixture: Fixture = None,
    compensated: Compensated = False,
    band: Band = "",
    unit: UnitsGiven = None,
    accuracy: Accuracy = "",
    motor: Annotated[str, typer.Option("--motor", metavar="TEXT", help="Name of the type, for the reports.")] = "",
    operator: Operator = "",
    ambient: Ambient = "",
    as_json: AsJson = False,
) -> None:
    """Make a session for each motor from the files of a folder; those that exist stay as they are.

    A motor's name in the files is the name of its session and its serial number. A file that cannot be used does not stop the others: it is
    reported, and the exit status is 1.
    """
    from motoremi.cli.bars import progress_bars
    from motoremi.cli.output import emit_json, quoted, say
    from motoremi.cli.session_data import check_units, sweeps_of, units_given
    from motoremi.data.grouping import files_by_motor, without_one_sweep
    from motoremi.errors import BadInput
    from motoremi.quantities import parse_band
    from motoremi.workflow_import import ImportOptions, prepared

    span, units = parse_band(band) if band else None, units_given(unit or [])
    found, others = files_by_motor(folder, short, open_)

    def imported(name: str, files: Files) -> list[str]:
        """Make the session of a motor; what is to be noticed about its data."""
        read = sweeps_of(files.short, files.open_, fixture, span, units, lambda *_: None)
        check_units(units, read)
        stated = ImportOptions(analyser, band, accuracy, motor=motor, serial=name, operator=operator, ambient=ambient, compensated=compensated)
        made = prepared(read, [], stated, [path.name for path in (*files.short, *files.open_)])
        made.store(out / name)
        return list(made.caveats)

    done: dict[str, list[str]] = {}
    refused: dict[str, str] = {}
    there: list[str] = []
    with progress_bars(as_json) as bars:
        show = bars.bar("importing") or (lambda *_: None)
        for number, (name, files) in enumerate(found.items()):
            show(name, number, len(found))
            if (out / name).exists():
                there.append(name)
                continue
            try:
                done[name] = imported(name, files)
            except BadInput as error:
                refused[name] = str(error)
    alone = without_one_sweep(found)
    if as_json:
        emit_json(
            {
                "schema": "motoremi.import-folder/1",
                "imported": done,
                "refused": refused,
                "existing": there,
                "without": alone,
                "other_files": [path.relative_to(folder).as_posix() for path in others],
            }
        )
    else:
        _say(done, refused, there, alone, others)
        say(f"sessions: {out}\nnext: motoremi fleet {quoted(out)}")
    raise typer.Exit(int(bool(refused)))


def _say(done: dict[str, list[str]], refused: dict[str, str], there: list[str], alone: dict[str, str], others: list[Path]) -> None:
    """What was imported, what was not and why; a note that most motors have is said once."""
    from motoremi.cli.output import say

    more = f", {len(there)} existed and stay as they are" if there else ""
    say(f"{len(done)} motors imported, {len(refused)} refused{more}")
    for name, why in refused.items():
        say(f"  {name}: refused: {why}")
    often = [note for note, count in Counter(note for notes in done.values() for note in notes).items() if 2 * count > len(done) > 1]
    for note in often:
        say(f"  most motors: {note}")
    for name, notes in done.items():
        for note in notes:
            if note not in often:
                say(f"  {name}: {note}")
    for name, kind in alone.items():
        say(f"  {name}: no {kind}-circuit sweep")
    if others:
        say(f"  {len(others)} other files match no pattern, such as {others[0].name}")


def register(app: typer.Typer) -> None:
    """Add this command."""
    command(app, "import-folder", import_folder_, "motoremi import-folder measured line --short '*_short.csv' --open '*_open.csv'")
