"""The schema of a bench file: settings of one laboratory, in contrast to those of a procedure."""

from __future__ import annotations

from collections.abc import Callable
from datetime import date
from pathlib import Path
from typing import Annotated

from pydantic import Field

from motoremi.bench.connect import refuse_unless_allowed
from motoremi.data.corrections import Correction, Corrections, with_tables
from motoremi.data.corrections import Role as Corrected
from motoremi.data.toml_file import read_toml
from motoremi.schema.procedure import Procedure
from motoremi.schema.procedure_tables import Band, InstrumentSpec
from motoremi.schema.quantity_field import Quantity
from motoremi.schema.roles import Role
from motoremi.schema.strict import Strict
from motoremi.schema.toml_file import checked


class BenchFile(Strict):
    """Settings of one laboratory: resources, people, calibration dates, limits, corrections."""

    backend: str = Field(
        default="",
        description="PyVISA's name of the VISA library, such as @py; empty: the system's VISA, or PyVISA-py without one; sim: the simulated bench",
    )
    resources: dict[Role, str] = Field(default_factory=dict, description="VISA resource of a role; overrides the procedure")
    allow: frozenset[str] | None = Field(default=None, description="the only resources that may be opened; without it, any")
    operator: str = Field(default="", max_length=200, description="who measures")
    motor: str = Field(default="", max_length=200, description="name of the motor under test, for the report")
    serial: str = Field(default="", max_length=200, description="its serial number")
    ambient: str = Field(default="", max_length=200, description="temperature and humidity as read, such as 23 degC, 45 %")
    instruments: dict[Role, InstrumentSpec] = Field(
        default_factory=dict, description="instruments of this bench, added to those of the procedure; one in the same role replaces it"
    )
    highest_voltage: Annotated[float, Quantity("V", 0.0, 1000.0)] | None = Field(
        default=None, description="largest voltage that a supply step may set on this bench"
    )
    highest_current: Annotated[float, Quantity("A", 0.0, 1000.0)] | None = Field(
        default=None, description="largest current limit that a supply step may set on this bench"
    )
    calibrated: dict[Role, date] = Field(default_factory=dict, description="date of the last calibration")
    correction: tuple[Correction, ...] = Field(default=(), description="attenuators, cables, transducers, fixtures: [[correction]] tables")
    seed: int = Field(default=1, ge=0, description="simulated bench: number from which motor, errors and noise are drawn")
    effects: tuple[str, ...] = Field(default=(), description="simulated bench: effects that its motor and analyser have")

    @property
    def corrections(self) -> Corrections:
        """Corrections for what is between the motor and the instruments."""
        return Corrections(self.correction)

    def refuse_uncovered(self, procedure: Procedure) -> None:
        """Raise `BadInput` if a correction is not known over the span that the procedure measures."""
        spans: dict[Corrected, Band | None] = {"receiver": procedure.spectrum, "analyser": procedure.sweep}
        for role, band in spans.items():
            if band is not None and role in procedure.instruments:
                self.corrections.refuse_outside(role, band.start, band.stop)

    def refuse_unless_allowed(self, procedure: Procedure) -> None:
        """Raise `BadInput` if a resource of the bench file or the procedure is not on the allow-list."""
        for role, spec in procedure.instruments.items():
            refuse_unless_allowed(role, self.resources.get(role, spec.resource), self.allow)


def load_bench_file(path: str | Path, confirm: Callable[[str], bool] | None = None) -> BenchFile:
    """Read a bench file with the tables that its corrections name; `sim` stands for the embedded simulated bench.

    Parameters
    ----------
    path : path-like
    confirm : callable, optional
        Asked whether a correction with a negative value is intended; without it, a negative value is an error.
    """
    if str(path) == "sim":
        return BenchFile(backend="sim")
    bench_file = checked(BenchFile, read_toml(path), str(path))
    return bench_file.model_copy(update={"correction": with_tables(bench_file.corrections, Path(path).parent, confirm).entries})
