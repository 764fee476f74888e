"""Commands on what a session holds: import, withdraw, verify."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from motoremi.cli.options import (
    Accuracy,
    Ambient,
    AnalyserName,
    AsJson,
    Band,
    Compensated,
    Fixture,
    Operator,
    SessionPath,
    UnitsGiven,
    command,
    corrections_of,
    is_typed,
)
from motoremi.errors import BadInput

if TYPE_CHECKING:
    from motoremi.arrays import JsonDict, Progress
    from motoremi.data.corrections import Corrections
    from motoremi.data.spectrum import Spectrum
    from motoremi.data.sweep import ImpedanceSweep
    from motoremi.workflow_import import Addition


def import_(
    context: typer.Context,
    out: Annotated[Path, typer.Argument(metavar="OUT", help="Session folder to make; with --append, the session to add to.", show_default=False)],
    append: Annotated[bool, typer.Option("--append", help="Add to a session: more repeats, sweeps under a condition, spectra, values.")] = False,
    condition: Annotated[
        str | None,
        typer.Option(
            "--condition",
            metavar="ID[=VALUE]",
            help="What was set up for the appended sweeps: second-temperature=53degC, far-end-grounded.",
        ),
    ] = None,
    value: Annotated[
        list[str] | None,
        typer.Option("--value", metavar="NAME=QUANTITY", help="A number from another meter: dc-resistance=21.3mohm+-0.1mohm; may be repeated."),
    ] = None,
    short: Annotated[list[Path] | None, typer.Option("--short", metavar="FILE...", help="Short-circuit sweeps; several are repeats.")] = None,
    open_: Annotated[list[Path] | None, typer.Option("--open", metavar="FILE...", help="Open-circuit sweeps; several are repeats.")] = None,
    spectrum: Annotated[list[Path] | None, typer.Option("--spectrum", metavar="FILE...", help="Emission spectra.")] = None,
    analyser: AnalyserName = None,
    fixture: Fixture = None,
    compensated: Compensated = False,
    band: Band = "",
    unit: UnitsGiven = None,
    accuracy: Accuracy = "",
    corrections: Annotated[
        Path | None,
        typer.Option(
            "--corrections",
            metavar="FILE",
            help="Corrections for the parts between motor and instruments: TOML with correction tables (motoremi procedures --keys).",
        ),
    ] = None,
    limit: Annotated[
        str,
        typer.Option("--limit", metavar="NAME", help="Judge the spectra against it ('motoremi limits', or your own .toml); FAIL is status 1."),
    ] = "",
    motor: Annotated[str, typer.Option("--motor", metavar="TEXT", help="Name of the motor, for the report.")] = "",
    serial: Annotated[str, typer.Option("--serial", metavar="TEXT", help="Its serial number; a fleet report looks for drift with it.")] = "",
    operator: Operator = "",
    ambient: Ambient = "",
    as_json: AsJson = False,
) -> None:
    """Make a session from files, or add files to a session."""
    from motoremi.cli.bars import progress_bars
    from motoremi.cli.output import emit_json, quoted, say
    from motoremi.data.conditions import parse_condition, parse_value, refuse_other_termination
    from motoremi.data.corrections import NO_CORRECTIONS
    from motoremi.quantities import parse_band
    from motoremi.workflow_import import ImportOptions, addition, prepared

    values = [parse_value(text) for text in value or []]
    span, units = parse_band(band) if band else None, units_given(unit or [])
    if append:
        beside = {
            "--corrections": corrections,
            "--limit": limit,
            "--motor": motor,
            "--serial": serial,
            "--operator": operator,
            "--ambient": ambient,
        }
        for name in (name for name, given in beside.items() if given):
            raise BadInput(f"{name} is for a new session: leave it out with --append")
        under = None if condition is None else parse_condition(condition)
        if condition is not None:
            refuse_other_termination(condition, bool(short), bool(open_))
        with progress_bars(as_json) as bars:
            show = bars.bar("reading") or _silent
            further = sweeps_of(short or [], open_ or [], fixture, span, units, show)
            spectra, finals = _emission(spectrum or [], units, show)
        check_units(units, [*further, *spectra])
        stated = ImportOptions(
            analyser if is_typed(context, "analyser") else None,
            band if further or is_typed(context, "band") else "",
            accuracy if is_typed(context, "accuracy") else "",
            compensated=compensated and (bool(further) or is_typed(context, "compensated")),
        )
        added = addition(out, further, values, under, stated, spectra, finals)
        added.store(out)
        _show_addition(out, added, as_json)
        return
    if condition is not None:
        raise BadInput("--condition is for sweeps that are added to a session: import sweeps of the motor as it is first, then use --append")
    files = [*(short or []), *(open_ or []), *(spectrum or [])]
    if not files:
        raise BadInput("nothing to import: give --short FILE..., --open FILE..., or better both; or --spectrum FILE...")
    with progress_bars(as_json) as bars:
        show = bars.bar("reading") or _silent
        read = sweeps_of(short or [], open_ or [], fixture, span, units, show)
        spectra, finals = _emission(spectrum or [], units, show)
    check_units(units, [*read, *spectra])
    chain = NO_CORRECTIONS if corrections is None else corrections_of(corrections)
    stated = ImportOptions(analyser, band, accuracy, chain, limit, motor, serial, operator, ambient, compensated)
    with progress_bars(as_json) as bars:
        stages = bars.bar("importing") or _silent
        stages("checking the data", 0, 2)
        made = prepared(read, spectra, stated, [path.name for path in files], values, finals)
        stages("storing the session", 1, 2)
        verdict = made.store(out)
    sweeps, start = made.sweeps, made.start
    if as_json:
        emit_json(
            {
                "schema": "motoremi.import/1",
                "verdict": verdict and verdict["verdict"],
                "session": str(out),
                "sweeps": [{**sweep.extent(), **_read(sweep.metadata)} for sweep in sweeps],
                **_spectra_in_json(spectra, finals),
                "corrections": start["corrections"],
                "analyser": start["analyser"],
                "analyser_assumed": start["analyser_assumed"],
                "caveats": [*made.caveats, *((*verdict["reasons"], *verdict["remarks"]) if verdict is not None else ())],
                "observations": list(made.observations),
            }
        )
        raise typer.Exit(1 if verdict is not None and verdict["verdict"] == "fail" else 0)
    for sweep in sweeps:
        say(_as_read(sweep))
    for text in _spectra_as_read(chain, spectra, finals):
        say(text)
    for entry in chain.entries:
        say(f"corrected ({entry.role}): {entry.describe()}")
    if start["analyser_assumed"]:
        say(_not_named(sweeps))
    for remark in [*made.caveats, *(one["text"] for one in made.observations), *(verdict["remarks"] if verdict is not None else ())]:
        say(f"note: {remark}")
    if verdict is not None:
        say(f"verdict: {verdict['says']}")
    say(f"session: {out}" + (f"\nnext: motoremi fit {quoted(out)}" if sweeps else ""))
    raise typer.Exit(1 if verdict is not None and verdict["verdict"] == "fail" else 0)


def _not_named(sweeps: Sequence[ImpedanceSweep]) -> str:
    from motoremi.data.declaration import declared_analyser, is_compensated

    text = "analyser not named: the size of its errors is estimated from the data; give --analyser NAME if you know it"
    analyser = declared_analyser(sweeps)[0]
    if not analyser.by_waves:
        return f"{text} (none for ideal data)"
    if analyser.name.endswith("-through"):
        return f"{text}. Transmissions are taken for those of a network analyser"
    if not all(is_compensated(sweep) for sweep in sweeps):
        text += ", and --compensated if it was calibrated at the motor's terminals"
    return f"{text}. Reflections are taken for those of a network analyser"


def _show_addition(session: Path, added: Addition, as_json: bool) -> None:
    from motoremi.cli.output import emit_json, say
    from motoremi.data.session import load

    if as_json:
        emit_json(
            {
                "schema": "motoremi.addition/1",
                "session": str(session),
                "sweeps": [{"condition": None, **sweep.extent(), **_read(sweep.metadata)} for sweep in added.sweeps],
                **_spectra_in_json(added.spectra, added.finals),
                "values": [one.to_dict() for one in added.values],
                "caveats": list(added.caveats),
                "empties_ladder": added.empties_ladder,
                "discards_emission": added.discards,
            }
        )
        return
    for sweep in added.sweeps:
        say(_as_read(sweep))
    for text in _spectra_as_read(load(session).corrections, added.spectra, added.finals):
        say(text)
    for one in added.values:
        say(f"value {one}")
    for remark in added.caveats:
        say(f"note: {remark}")
    fitted = "without these sweeps" if added.empties_ladder else ""
    _say_what_follows(session, fitted, added.discards, of_spectra=not added.sweeps and not added.values)


def _say_what_follows(session: Path, fitted: str, discarded: bool, of_spectra: bool) -> None:
    """The commands after a change of a session's data.

    Parameters
    ----------
    session : Path
    fitted : str
        To which data the removed models were fitted; empty if they are kept.
    discarded : bool
        Whether what was computed of the spectra was removed.
    of_spectra : bool
        Whether only spectra have changed.
    """
    from motoremi.cli.output import quoted, say

    if fitted:
        again = f"motoremi fit {quoted(session)}, then motoremi add {quoted(session)} EFFECT"
        say(f"note: the models of the ladder were fitted {fitted} and are removed; fit them again: {again}")
    if discarded:
        say("note: verdict, models and diagnosis of the spectra were of other spectra and are removed")
    say(f"next: motoremi {'predict' if of_spectra else 'diagnose'} {quoted(session)}")


def withdraw_(
    path: SessionPath,
    names: Annotated[
        list[str],
        typer.Argument(
            metavar="NAME", help="A sweep or spectrum by its file (short-2, peak-1), or a single value (dc-resistance).", show_default=False
        ),
    ],
    why: Annotated[str, typer.Option("--why", metavar="TEXT", help="The reason; the report gives it.", show_default=False)] = "",
    restore: Annotated[bool, typer.Option("--restore", help="Use them again.")] = False,
    as_json: AsJson = False,
) -> None:
    """Withdraw sweeps, spectra or values that were measured wrongly: they stay in the session, and no analysis uses them."""
    from motoremi.cli.output import emit_json, say
    from motoremi.workflow_withdraw import restore_withdrawn, withdraw

    if restore and why:
        raise BadInput("--why is for what is withdrawn: leave it out with --restore")
    done = restore_withdrawn(path, names) if restore else withdraw(path, names, why)
    if as_json:
        emit_json({
            "schema": "motoremi.withdrawn/1",
            "session": str(path),
            "names": list(done.names),
            "restored": done.restored,
            "withdrawn": list(done.session.withdrawn),
            "empties_ladder": done.emptied_ladder,
            "discards_emission": done.discarded,
        })  # fmt: skip
        return
    what = ", ".join(done.names)
    say(f"{what} used again" if restore else f"{what} withdrawn: {done.why}; kept in the session, and no analysis uses it")
    say(f"the session has {done.session.summary()}")
    _say_what_follows(path, "to other data" if done.emptied_ladder else "", done.discarded, done.of_spectra)


def units_given(given: list[str]) -> dict[str, str]:
    """Units of columns by name, from `COLUMN=UNIT`."""
    units = {}
    for text in given:
        name, equals, unit = text.rpartition("=")
        if not (name.strip() and equals and unit.strip()):
            raise BadInput(f"--unit {text!r}: write the column's name, = and its unit, for example --unit FREQ=Hz")
        units[name.strip()] = unit.strip()
    return units


def check_units(units: dict[str, str], read: Sequence[ImpedanceSweep | Spectrum]) -> None:
    """Refuse units that no file needs: the name of a column may be mistyped."""
    from motoremi.data.columns import UNITS_GIVEN

    if units and not any(change.startswith(UNITS_GIVEN) for one in read for change in one.metadata.get("changes", ())):
        raise BadInput(f"--unit is for columns of tables: no file has a column {' or '.join(map(repr, units))}")


def sweeps_of(
    short: list[Path],
    open_: list[Path],
    fixture: str | None,
    band: tuple[float, float] | None,
    units: dict[str, str],
    progress: Progress,
) -> list[ImpedanceSweep]:
    """The sweeps of all files, within a band in hertz if one is named.

    Raises
    ------
    BadInput
        As the readers, and for a fixture that applies to none of the files.
    """
    from motoremi.data.files import read_impedances

    terminations = ["short"] * len(short) + ["open"] * len(open_)
    files = zip(_shown([*short, *open_], progress), terminations, strict=True)
    sweeps = [sweep for path, termination in files for sweep in read_impedances(path, termination, fixture, band, units)]
    if fixture is not None and not any(sweep.metadata["read_as"].startswith(("S21 of", "S11 of")) for sweep in sweeps):
        raise BadInput("--fixture is for Touchstone files of two ports (.s2p), and none of the files is one")
    return sweeps


def _emission(files: list[Path], units: dict[str, str], progress: Progress) -> tuple[list[Spectrum], list[Spectrum]]:
    """The scans and the final values of all files."""
    from motoremi.data.files import read_emission

    read = [read_emission(path, units) for path in _shown(files, progress)]
    return [one for scans, _ in read for one in scans], [one for _, finals in read for one in finals]


def _spectra_in_json(spectra: Sequence[Spectrum], finals: Sequence[Spectrum]) -> JsonDict:
    return {
        "spectra": [{"detector": s.detector, "points": len(s), **_read(s.metadata)} for s in spectra],
        "finals": [{"detector": s.detector, "frequency_hz": float(s.frequency_hz[0]), **_read(s.metadata)} for s in finals],
    }


def _spectra_as_read(corrections: Corrections, spectra: Sequence[Spectrum], finals: Sequence[Spectrum]) -> list[str]:
    """A line for each spectrum with its corrected levels and what was assumed, and one for the final values of each detector in each file."""
    from motoremi.data.import_notes import final_summaries

    lines = []
    for item in map(corrections.corrected_spectrum, spectra):
        assumed = ", ".join(what for what in ("detector", "rbw") if item.metadata.get(f"{what}_assumed"))
        lines.append(f"{item.detector} {_origin(item.metadata)}: {item.summary()}" + (f" (assumed: {assumed})" if assumed else ""))
    return lines + final_summaries([corrections.corrected_spectrum(one) for one in finals])


def _shown(files: Sequence[Path], progress: Progress) -> Iterator[Path]:
    """The files one after the other, each shown as a step of the progress while it is read."""
    for index, path in enumerate(files):
        progress(path.name, index, len(files))
        yield path


def _silent(name: str, done: int, total: int) -> None:
    """No progress is shown."""


def _read(metadata: Mapping[str, Any]) -> JsonDict:
    """File, format and quantities, changes on import, what is doubtful, and what was stated of accuracy and calibration."""
    kept = ("source", "format", "read_as", "changes", "warnings", "accuracy_percent", "compensated")
    return {key: metadata[key] for key in kept if key in metadata}


def _as_read(sweep: ImpedanceSweep) -> str:
    """A line with file and span, changes on import, what is doubtful, and what was stated of accuracy and calibration."""
    from motoremi.data.declaration import is_compensated

    percent = sweep.metadata.get("accuracy_percent")
    parts = [
        sweep.summary(),
        *sweep.metadata.get("changes", []),
        *(f"warning: {one}" for one in sweep.metadata.get("warnings", [])),
        *([] if percent is None else [f"accuracy stated: {percent:g} %"]),
        *(["calibrated at the motor's terminals"] if is_compensated(sweep) else []),
    ]
    return f"{sweep.termination:5s} {_origin(sweep.metadata)}: {'; '.join(parts)}"


def _origin(metadata: Mapping[str, Any]) -> str:
    read = _read(metadata)
    return f"{read.get('source', '')} ({', '.join(str(read[key]) for key in ('format', 'read_as') if key in read)})"


def verify_(path: SessionPath, as_json: AsJson = False) -> None:
    """Check a session's hash chain and manifest: FAIL if anything was changed after it was stored."""
    from motoremi.cli.output import emit_json, say
    from motoremi.data.session import load, verify

    if not path.is_dir():
        raise BadInput(f"{path}: no such session folder")
    problems = verify(path)
    if as_json:
        emit_json({"schema": "motoremi.verification/1", "session": str(path), "verdict": "fail" if problems else "pass", "problems": problems})
    elif problems:
        say(f"FAIL: {path} is not as it was stored")
        for problem in problems:
            say(f"  {problem}")
    else:
        say(f"PASS: {path} is as it was stored ({load(path).summary()})")
    raise typer.Exit(1 if problems else 0)


def register(app: typer.Typer) -> None:
    """Add the commands of this module."""
    command(app, "import", import_, "motoremi import my_motor --short short1.csv short2.csv --open open1.csv open2.csv --analyser 4294a")
    command(app, "withdraw", withdraw_, "motoremi withdraw my_motor short-3 --why 'the clip was loose'")
    command(app, "verify", verify_, "motoremi verify my_motor")
