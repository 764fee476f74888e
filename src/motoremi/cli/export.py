"""`motoremi export`: the model or the data in the formats of other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from motoremi.cli.options import AsJson, SessionPath, command
from motoremi.errors import BadInput


def _file(name: str, text: str) -> Any:
    return typer.Option(name, metavar="FILE", help=text, show_default=False)


def export_(
    path: SessionPath,
    spice: Annotated[Path | None, _file("--spice", "The fitted motor as a subcircuit for ngspice and LTspice.")] = None,
    spice_emission: Annotated[
        Path | None, _file("--spice-emission", "The whole emission test: source, motor, stray capacitance, cable, LISNs.")
    ] = None,
    touchstone: Annotated[Path | None, _file("--touchstone", "One termination: .s1p, or .z1p for impedance normalised to 50 Ohm.")] = None,
    csv: Annotated[Path | None, _file("--csv", "All sweeps in one table, the model beside them.")] = None,
    hdf5: Annotated[Path | None, _file("--hdf5", "Sweeps, spectra, model and analyses (extra hdf5).")] = None,
    parquet: Annotated[Path | None, _file("--parquet", "The table of --csv as Parquet (extra parquet).")] = None,
    termination: Annotated[Literal["short", "open"] | None, typer.Option(help="Which sweep goes to --touchstone; open if there is one.")] = None,
    model: Annotated[bool, typer.Option("--model", help="Write the fitted model to --touchstone instead of the measurement.")] = False,
    as_json: AsJson = False,
) -> None:
    """Take the model or the data elsewhere; several formats at once are fine."""
    from motoremi.cli.output import emit_json, say
    from motoremi.data.session import load
    from motoremi.data.storage import write_whole
    from motoremi.export.emission_deck import emission_deck
    from motoremi.export.hdf5 import hdf5_bytes
    from motoremi.export.spice import SpiceModel, spice_model
    from motoremi.export.tables import csv_bytes, parquet_bytes
    from motoremi.export.touchstone import session_touchstone
    from motoremi.workflow import ladder_of
    from motoremi.workflow_emission import setup_of

    asked = [file for file in (spice, spice_emission, touchstone, csv, hdf5, parquet) if file is not None]
    if not asked:
        raise BadInput("nothing to export: give --spice, --spice-emission, --touchstone, --csv, --hdf5 or --parquet with a FILE")
    session = load(path)
    fit = next(iter(ladder_of(session)[-1:]), None)
    written: list[tuple[Path, str, bytes]] = []
    netlist: SpiceModel | None = None
    if spice is not None or spice_emission is not None:
        if fit is None:
            raise BadInput(f"{path} has no fit yet: motoremi fit {path}")
        netlist = spice_model(fit)
    if spice is not None and netlist is not None:
        told = f"netlist within {netlist.error_db:.2g} dB and {netlist.error_deg:.2g} degree of the model"
        if netlist.left_out:
            told += f"; left out as errors of the meter: {', '.join(netlist.left_out)}"
        written.append((spice, told, netlist.text.encode()))
    if spice_emission is not None and netlist is not None:
        deck = emission_deck(netlist.text, setup_of(session))
        written.append((spice_emission, "emission test, node receiver", deck.encode()))
    if touchstone is not None:
        if model and fit is None:
            raise BadInput(f"{path} has no fit yet: motoremi fit {path}")
        parameter: Literal["S", "Z"] = "Z" if touchstone.suffix.lower() == ".z1p" else "S"
        text, chosen = session_touchstone(session, termination, parameter, fit if model else None)
        written.append((touchstone, f"{chosen}-circuit {'model' if model else 'measurement'}, {parameter} parameters", text.encode()))
    if csv is not None:
        written.append((csv, "sweeps" + (" and model" if fit else ""), csv_bytes(session, fit)))
    if hdf5 is not None:
        written.append((hdf5, "sweeps, spectra, analyses" + (", model" if fit else ""), hdf5_bytes(session, fit)))
    if parquet is not None:
        written.append((parquet, "sweeps" + (" and model" if fit else ""), parquet_bytes(session, fit)))
    # Everything is made before the first file is written.
    for file, _, data in written:
        write_whole(file, data)
    if as_json:
        document: dict[str, Any] = {"schema": "motoremi.files/1", "files": [str(file) for file, _, _ in written]}
        if netlist is not None:
            document["spice"] = {"error_db": netlist.error_db, "error_deg": netlist.error_deg, "left_out": list(netlist.left_out)}
        emit_json(document)
        return
    for file, told, _ in written:
        say(f"{file}: {told}")


def register(app: typer.Typer) -> None:
    """Add this command."""
    command(app, "export", export_, "motoremi export my_motor --spice motor.cir --touchstone motor.s1p")
