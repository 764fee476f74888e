"""`motoremi export`: the model or the data in the formats of other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from motoremi.cli.options import AsJson, SessionPath, command, refuse_output
from motoremi.errors import BadInput

TOUCHSTONE = (".s1p", ".z1p")


def _file(name: str, text: str) -> Any:
    return typer.Option(name, metavar="FILE", help=text, show_default=False)


def export_(
    path: SessionPath,
    spice: Annotated[Path | None, _file("--spice", "The fitted motor as a subcircuit for ngspice and LTspice.")] = None,
    spice_emission: Annotated[
        Path | None, _file("--spice-emission", "The whole emission test: source, motor, stray capacitance, cable, LISNs.")
    ] = None,
    touchstone: Annotated[Path | None, _file("--touchstone", "One termination: .s1p, or .z1p for impedance normalised to 50 Ohm.")] = None,
    csv: Annotated[Path | None, _file("--csv", "All sweeps in one table, also those under a condition, the model beside them.")] = None,
    spectra: Annotated[Path | None, _file("--spectra", "All spectra in one CSV table: readings, corrected levels, limit and margin.")] = None,
    hdf5: Annotated[Path | None, _file("--hdf5", "All sweeps, single values, spectra, model and analyses (extra hdf5).")] = None,
    parquet: Annotated[Path | None, _file("--parquet", "The table of --csv as Parquet (extra parquet).")] = None,
    termination: Annotated[
        Literal["short", "open"] | None, typer.Option(help="Which sweep goes to --touchstone; by default open if there is one.")
    ] = None,
    model: Annotated[bool, typer.Option("--model", help="Write the fitted model to --touchstone instead of the measurement.")] = False,
    as_json: AsJson = False,
) -> None:
    """Write the model or the data for other programs; several formats may be given at once."""
    from motoremi.cli.output import emit_json, say
    from motoremi.data.output_file import write_output
    from motoremi.data.session import load
    from motoremi.workflow import ladder_of
    from motoremi.workflow_export import Exported, Exporter

    files = [file for file in (spice, spice_emission, touchstone, csv, spectra, hdf5, parquet) if file is not None]
    if not files:
        raise BadInput("nothing to export: give --spice, --spice-emission, --touchstone, --csv, --spectra, --hdf5 or --parquet with a FILE")
    for number, wanted in enumerate(files):
        refuse_output(wanted)
        if wanted.resolve() in [other.resolve() for other in files[:number]]:
            raise BadInput(f"{wanted}: two formats would be written to it, and only the last would remain; give each its own file")
    if touchstone is not None and touchstone.suffix.lower() not in TOUCHSTONE:
        raise BadInput(f"{touchstone}: the data of one port are written as {' or '.join(TOUCHSTONE)}")
    session = load(path)
    exporter = Exporter(session, next(iter(ladder_of(session)[-1:]), None))
    written: list[tuple[Path, Exported]] = []
    if spice is not None:
        written.append((spice, exporter.spice()))
    if spice_emission is not None:
        written.append((spice_emission, exporter.spice_emission()))
    if touchstone is not None:
        written.append((touchstone, exporter.touchstone(termination, "Z" if touchstone.suffix.lower() == ".z1p" else "S", model)))
    for file, make in ((csv, exporter.csv), (spectra, exporter.spectra), (hdf5, exporter.hdf5), (parquet, exporter.parquet)):
        if file is not None:
            written.append((file, make()))
    # All contents are computed before the first file is written.
    for file, made in written:
        write_output(file, made.data)
    if as_json:
        document: dict[str, Any] = {"schema": "motoremi.files/1", "files": [str(file) for file, _ in written]}
        if spice is not None or spice_emission is not None:
            netlist = exporter.netlist
            document["spice"] = {"error_db": netlist.error_db, "error_deg": netlist.error_deg, "left_out": list(netlist.left_out)}
        emit_json(document)
        return
    for file, made in written:
        say(f"{file}: {made.description}")


def register(app: typer.Typer) -> None:
    """Add this command."""
    command(app, "export", export_, "motoremi export my_motor --spice motor.cir --touchstone motor.s1p")
