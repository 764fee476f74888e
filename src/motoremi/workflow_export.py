"""All exports of a session, for `motoremi export` and the workbench."""

from __future__ import annotations

from functools import cached_property
from typing import Literal, NamedTuple

from motoremi.data.mislabelled import without_mislabelled
from motoremi.data.session import Session
from motoremi.data.sweep import group_repeats
from motoremi.emission.limit import find_limit
from motoremi.errors import BadInput
from motoremi.export.emission_deck import emission_deck
from motoremi.export.hdf5 import hdf5_bytes
from motoremi.export.spectrum_table import spectrum_table
from motoremi.export.spice import SpiceModel, spice_model
from motoremi.export.tables import csv_bytes, parquet_bytes
from motoremi.export.touchstone_file import session_touchstone
from motoremi.fitting.result import Fit
from motoremi.workflow_emission import PREDICTION, limit_of, setup_of


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
        return Exported(text.encode(), f"{chosen}-circuit {'model' if model else 'measurement'}, {parameter} parameters{self._not_used}")

    def csv(self) -> Exported:
        """All sweeps in one table, the model beside them."""
        return Exported(csv_bytes(self._session, self._fit), self._table())

    def spectra(self) -> Exported:
        """All spectra in one table, with limit and margin if the session was judged against a limit."""
        limit = find_limit(limit_of(self._session)) if PREDICTION in self._session.analysis_files else None
        if limit is not None and limit.unit != self._session.corrections.level_unit:
            limit = None
        table = spectrum_table(self._session, limit).to_csv(index=False, lineterminator="\n")
        return Exported(table.encode(), f"spectra, {f'margins to {limit.title}' if limit is not None else 'not compared with a limit'}")

    def parquet(self) -> Exported:
        """The same as Parquet."""
        return Exported(parquet_bytes(self._session, self._fit), self._table())

    def hdf5(self) -> Exported:
        """Sweeps, spectra, model and analyses."""
        finals = ", final scans" if self._session.finals else ""
        values = ", single values" if self._session.values else ""
        what = f"sweeps{self._under_conditions}, spectra{finals}{values}, analyses"
        return Exported(hdf5_bytes(self._session, self._fit), self._with_model(what, ", model") + self._not_used)

    def _table(self) -> str:
        values = "; single values are not in a table of sweeps: --hdf5 FILE" if self._session.values else ""
        return self._with_model(f"sweeps{self._under_conditions}") + values + self._not_used

    @property
    def _under_conditions(self) -> str:
        count = len(self._session.conditioned)
        return f" ({count} of {count + len(self._session.sweeps)} under a condition)" if count else ""

    @cached_property
    def _not_used(self) -> str:
        """The sweeps that a fit leaves out, in words; empty if it uses all."""
        try:
            used, _ = without_mislabelled(group_repeats(self._session.corrected_sweeps))
        except BadInput:
            # Repeats that cannot be averaged, or no sweep of the motor as it is: a table holds them all the same.
            return ""
        names = [f"{sweep.termination} sweep {name}" for sweep in used for name in sweep.left_out]
        return f"; not used by fits, because of the other termination: {', '.join(names)}" if names else ""

    def _with_model(self, what: str, model: str = " and model") -> str:
        return what + (model if self._fit is not None else "")

    def _fitted(self) -> Fit:
        if self._fit is None:
            raise BadInput(f"{self._session.path} has no fit yet: motoremi fit {self._session.path}")
        return self._fit
