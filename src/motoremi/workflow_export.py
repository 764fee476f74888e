"""All exports of a session, for `motoremi export` and the workbench."""

from __future__ import annotations

from functools import cached_property
from typing import Literal, NamedTuple

from motoremi.data.session import Session
from motoremi.errors import BadInput
from motoremi.export.emission_deck import emission_deck
from motoremi.export.hdf5 import hdf5_bytes
from motoremi.export.spice import SpiceModel, spice_model
from motoremi.export.tables import csv_bytes, parquet_bytes
from motoremi.export.touchstone_file import session_touchstone
from motoremi.fitting.result import Fit
from motoremi.workflow_emission import setup_of


class Exported(NamedTuple):
    """The content of a file, and a short description."""

    data: bytes
    description: str


class Exporter:
    """Exports one session and its model; the netlist is computed once.

    Parameters
    ----------
    session : Session
    fit : Fit, optional
        The current model.
    """

    def __init__(self, session: Session, fit: Fit | None) -> None:
        self._session = session
        self._fit = fit

    @cached_property
    def netlist(self) -> SpiceModel:
        """The fitted motor as a subcircuit."""
        return spice_model(self._fitted())

    def spice(self) -> Exported:
        """The subcircuit."""
        description = f"netlist within {self.netlist.error_db:.2g} dB and {self.netlist.error_deg:.2g} degree of the model"
        if self.netlist.left_out:
            description += f"; left out as errors of the meter: {', '.join(self.netlist.left_out)}"
        return Exported(self.netlist.text.encode(), description)

    def spice_emission(self) -> Exported:
        """The whole emission test, with the fitted motor."""
        return Exported(emission_deck(self.netlist.text, setup_of(self._session)).encode(), "emission test, node receiver")

    def touchstone(self, termination: str | None, parameter: Literal["S", "Z"], model: bool) -> Exported:
        """One termination: the measurement, or the model."""
        text, chosen = session_touchstone(self._session, termination, parameter, self._fitted() if model else None)
        return Exported(text.encode(), f"{chosen}-circuit {'model' if model else 'measurement'}, {parameter} parameters")

    def csv(self) -> Exported:
        """All sweeps in one table, the model beside them."""
        return Exported(csv_bytes(self._session, self._fit), self._with_model("sweeps"))

    def parquet(self) -> Exported:
        """The same as Parquet."""
        return Exported(parquet_bytes(self._session, self._fit), self._with_model("sweeps"))

    def hdf5(self) -> Exported:
        """Sweeps, spectra, model and analyses."""
        return Exported(hdf5_bytes(self._session, self._fit), self._with_model("sweeps, spectra, analyses", ", model"))

    def _with_model(self, what: str, model: str = " and model") -> str:
        return what + (model if self._fit is not None else "")

    def _fitted(self) -> Fit:
        if self._fit is None:
            raise BadInput(f"{self._session.path} has no fit yet: motoremi fit {self._session.path}")
        return self._fit
