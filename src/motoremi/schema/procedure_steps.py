"""The steps of a bench procedure: what each one does, its keys with units, limits and help."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator

from motoremi.arrays import JsonDict
from motoremi.bench.motor_connections import Condition, ConnectionName, Line
from motoremi.data.conditions import parse_condition
from motoremi.data.spectrum import Detector
from motoremi.data.sweep import Termination
from motoremi.errors import BadInput
from motoremi.schema.quantity_field import Quantity
from motoremi.schema.state_steps import SupplyStep, WaitFor
from motoremi.schema.strict import Strict

Repeats = Annotated[int, Field(ge=1, le=100, description="number of measurements on the same connection")]


def _only_a_load_has(standard: str, nominal: float | None) -> None:
    if (standard == "load") != (nominal is not None):
        raise BadInput("nominal: belongs to the load standard, and to no other")


class Identify(Strict):
    """Connect to every instrument, check its identity, reset it and set it up. Must be the first step of a measurement."""

    do: Literal["identify"]


class Compensate(Strict):
    """Measure the fixture with a standard and switch that compensation on; the operator is asked to connect the standard."""

    do: Literal["compensate"]
    standard: Literal["open", "short", "load"] = Field(description="which standard")
    nominal: Annotated[float, Quantity("Ohm", 1e-3, 1e6)] | None = Field(default=None, description="resistance of the load standard")
    inductance: Annotated[float, Quantity("H", 0, 1e-3)] = Field(default=0.0, description="inductance of the load standard")

    @model_validator(mode="after")
    def _load_has_a_value(self) -> Self:
        _only_a_load_has(self.standard, self.nominal)
        return self

    def parameters(self) -> JsonDict:
        """Value and inductance only for a load standard."""
        return self.model_dump(include={"standard", "nominal", "inductance"} if self.standard == "load" else {"standard"})


class Connect(Strict):
    """Ask the operator to make a connection, with a drawing. The measuring steps that follow use it; without it each step makes its own."""

    do: Literal["connect"]
    what: ConnectionName = Field(description="what is connected")
    note: str = Field(default="", max_length=500, description="further text for the operator")


class Sweep(Strict):
    """Measure the motor's impedance, several times without touching the connection."""

    do: Literal["sweep"]
    termination: Termination = Field(
        description="short: between the terminals, the far one connected to the frame; open: from one terminal to the frame"
    )
    repeat: Repeats = 1
    condition: str | None = Field(default=None, description="condition that was set up for the sweep: second-temperature=53degC")

    @field_validator("condition")
    @classmethod
    def _condition_is_known(cls, condition: str | None) -> str | None:
        under = None if condition is None else parse_condition(condition)
        return None if under is None else under.text


class Check(Strict):
    """Measure a standard through the compensated fixture and judge the residual error of the fixture: pass or fail."""

    do: Literal["check"]
    standard: Literal["open", "short", "load"] = Field(description="which standard")
    nominal: Annotated[float, Quantity("Ohm", 1e-3, 1e6)] | None = Field(default=None, description="resistance of the load standard")
    tolerance_percent: float = Field(default=3.0, gt=0, le=100, description="load: largest |Z/nominal - 1|, in percent")
    resistance: Annotated[float, Quantity("Ohm", 1e-4, 10)] = Field(default=0.03, description="short: largest residual resistance")
    inductance: Annotated[float, Quantity("H", 1e-11, 1e-6)] = Field(default=5e-9, description="short: largest residual inductance")
    conductance: Annotated[float, Quantity("S", 1e-10, 1e-2)] = Field(default=1e-6, description="open: largest residual conductance")
    capacitance: Annotated[float, Quantity("F", 1e-15, 1e-10)] = Field(default=2e-13, description="open: largest residual capacitance")

    @model_validator(mode="after")
    def _load_has_a_value(self) -> Self:
        _only_a_load_has(self.standard, self.nominal)
        return self

    def parameters(self) -> JsonDict:
        """The limits of this standard only."""
        limits = {"short": {"resistance", "inductance"}, "open": {"conductance", "capacitance"}, "load": {"nominal", "tolerance_percent"}}
        return self.model_dump(include={"standard", *limits[self.standard]})


class Scan(Strict):
    """Measure the conducted emission at the LISN with one detector."""

    do: Literal["spectrum"]
    detector: Detector = Field(description="CISPR detector")
    condition: Condition = Field(default="motor running", description="motor off measures the background; stored with the data")
    line: Line | None = Field(default=None, description="phase of the LISN: switched by the operator, or by command (line_switch)")
    operating: str = Field(
        default="", max_length=100, description="operating state of the motor, such as full load; the operator is asked when it changes"
    )
    dwell: Annotated[float, Quantity("s", 50e-6, 100)] | None = Field(
        default=None, description="measuring time at each step of this scan; without it, that of [spectrum]"
    )
    repeat: Repeats = 1

    def parameters(self) -> JsonDict:
        """Keys with a value."""
        return self.model_dump(exclude={"do", *(key for key in ("line", "operating", "dwell") if not getattr(self, key))})


class Final(Strict):
    """Measure the highest maxima of the earlier scans again with these detectors, on every line and in every operating state of those scans."""

    do: Literal["final"]
    limit: str = Field(default="cispr32-b", max_length=300, description="limit that the maxima are compared with; motoremi limits lists them")
    detectors: tuple[Detector, ...] = Field(default=("quasi-peak", "cispr-average"), min_length=1, description="detectors of the final readings")
    dwell: Annotated[float, Quantity("s", 1.0, 100)] = Field(
        default=1.0, description="measuring time of each reading; longer for slowly repeating disturbances"
    )
    margin: Annotated[float, Quantity("dB", 0, 200)] = Field(default=10.0, description="only maxima above the limit, or less than this below it")
    maxima: int = Field(default=6, ge=1, le=100, description="largest number of maxima; the one nearest to the limit of each subrange first")
    apart: Annotated[float, Quantity("Hz", 0, 30e6)] = Field(default=50e3, description="least distance between two maxima")
    subranges: int = Field(
        default=10, ge=1, le=100, description="number of parts of the span, equally wide on a logarithmic axis, that maxima are taken from in turn"
    )


class Wait(Strict):
    """Wait, for example until the motor is warm."""

    do: Literal["wait"]
    time: Annotated[float, Quantity("s", 0.0, 86400.0)] = Field(description="how long")
    reason: str = Field(default="", max_length=200, description="reason, shown while waiting")


class FitStep(Strict):
    """Fit the model."""

    do: Literal["fit"]
    method: Literal["ant-colony", "paper"] = Field(
        default="ant-colony", description="ant-colony: this project's search; paper: the algorithm as printed in the paper"
    )
    seed: int = Field(default=1, ge=0, description="start of the random numbers; the same seed gives the same result")


class CompareStep(Strict):
    """Judge the model against the measurement: a point fails if its error is beyond a tolerance and beyond the measurement's uncertainty.

    Without tolerances, those of the session's last comparison hold; at first that is an error of 10 %.
    """

    do: Literal["compare"]
    error_percent: float | None = Field(default=None, gt=0, description="largest |Z_model/Z_measured - 1| at any point, in percent")
    magnitude_db: float | None = Field(default=None, gt=0, description="largest error of the magnitude at any point, in dB")
    phase_deg: float | None = Field(default=None, gt=0, description="largest error of the phase at any point, in degrees")


class DiagnoseStep(Strict):
    """Name the physical effect that is missing in the model."""

    do: Literal["diagnose"]


class NextStep(Strict):
    """Name the measurement that would best separate the remaining candidates; after diagnose."""

    do: Literal["next"]


class JudgeStep(Strict):
    """Judge the corrected levels against a limit: the final values if there are any, else the scans."""

    do: Literal["judge"]
    limit: str = Field(default="cispr32-b", max_length=300, description="its name (motoremi limits), or the path of your own file")
    uncertainty: Annotated[float, Quantity("dB", 0, 40)] = Field(default=3.4, description="expanded uncertainty (k = 2)")
    guard_band: Annotated[float, Quantity("dB", 0, 40)] | None = Field(
        default=None, description="guard band of the verdicts instead of the uncertainty with that of the corrections; 0 is simple acceptance"
    )


class ReportStep(Strict):
    """Write the report."""

    do: Literal["report"]


AnalysisStep = FitStep | CompareStep | DiagnoseStep | NextStep | JudgeStep | ReportStep
MeasuringStep = Compensate | Sweep | Check | Scan | Final
PlainStep = Identify | Connect | Wait | SupplyStep | WaitFor | MeasuringStep | AnalysisStep


class Repeat(Strict):
    """Repeat steps; a repeat inside a repeat is not allowed."""

    do: Literal["repeat"]
    times: int = Field(ge=1, le=1000, description="number of passes")
    steps: tuple[Annotated[PlainStep, Field(discriminator="do")], ...] = Field(min_length=1, description="steps of one pass")


Step = Annotated[PlainStep | Repeat, Field(discriminator="do")]
STEPS: tuple[type[Strict], ...] = (
    Identify, Compensate, Connect, Sweep, Check, Scan, Final, Wait, SupplyStep, WaitFor, Repeat, FitStep, CompareStep, DiagnoseStep, NextStep,
    JudgeStep, ReportStep,
)  # fmt: skip
