"""The exports of a session in the formats of other programs, as `motoremi export` writes them."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterator
from functools import partial
from typing import Literal, NamedTuple

from motoremi.arrays import JsonDict
from motoremi.errors import BadInput
from motoremi.workbench.desk import Desk
from motoremi.workflow_export import Exported, Exporter

TERMINATIONS = ("open", "short")
PARAMETERS: tuple[tuple[str, Literal["S", "Z"], str], ...] = (("s1p", "S", "S-parameters"), ("z1p", "Z", "impedance over 50 Ω"))


class Offer(NamedTuple):
    """A file that can be made.

    Parameters
    ----------
    name : str
        The file's name.
    title : str
    make : callable
    missing : str
        Why it cannot be made now; empty if it can.
    """

    name: str
    title: str
    make: Callable[[], Exported]
    missing: str = ""


def offers(desk: Desk) -> list[JsonDict]:
    """Names and titles of all files, with the reason for those that cannot be made now."""
    return [{"name": one.name, "title": one.title, "missing": one.missing} for one in _offers(desk)]


def exported(desk: Desk, name: str) -> bytes:
    """The content of one file.

    Raises
    ------
    BadInput
        If there is no file of that name, or it cannot be made.
    """
    for one in _offers(desk):
        if one.name == name:
            if one.missing:
                raise BadInput(f"{name}: {one.missing}")
            return one.make().data
    raise BadInput(f"nothing is exported as {name!r}")


def _offers(desk: Desk) -> Iterator[Offer]:
    session, fit = desk.session, next(iter(desk.steps[-1:]), None)
    exporter = Exporter(session, fit)
    unfitted = "" if fit is not None else "fit this session first"
    no_sweep = "" if session.sweeps else "this session holds no impedance sweep"
    no_spectrum = "" if session.spectra or session.finals else "this session holds no spectrum"
    yield Offer("motor.cir", "the fitted motor as a subcircuit for ngspice and LTspice", exporter.spice, unfitted)
    yield Offer("emission-test.cir", "the whole emission test: source, motor, cable, LISNs", exporter.spice_emission, unfitted)
    held = {sweep.termination for sweep in session.sweeps}
    for termination in (one for one in TERMINATIONS if one in held):
        for suffix, parameter, what in PARAMETERS:
            for stem, model, whose in ((termination, False, "measured"), (f"{termination}-model", True, "of the model")):
                yield Offer(
                    f"{stem}.{suffix}",
                    f"Touchstone: {what} {whose}, {termination} circuit",
                    partial(exporter.touchstone, termination, parameter, model),
                    unfitted if model else "",
                )
    yield Offer("sweeps.csv", "all sweeps in one table, the model beside them", exporter.csv, no_sweep)
    yield Offer("spectra.csv", "all spectra in one table, with limit and margin", exporter.spectra, no_spectrum)
    yield Offer("session.h5", "sweeps, spectra, model and analyses as HDF5", exporter.hdf5, _not_installed("h5py", "hdf5"))
    yield Offer("sweeps.parquet", "the table of sweeps as Parquet", exporter.parquet, no_sweep or _not_installed("pyarrow", "parquet"))


def _not_installed(module: str, extra: str) -> str:
    return "" if importlib.util.find_spec(module) is not None else f"needs pip install 'motoremi[{extra}]'"
