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

Repeats = Annotated[int, Field(ge=1, le=100, description="how many, one after the other on the same connection")]


class Identify(Strict):
    """Connect to every instrument, check who answers, reset it and set it up. Must be the first step of a measurement."""

    do: Literal["identify"]


class Compensate(Strict):
    """Measure the fixture with a standard and switch that compensation on; prompts for the standard."""

    do: Literal["compensate"]
    standard: Literal["open", "short", "load"] = Field(description="which standard")
    nominal: Annotated[float, Quantity("Ohm", 1e-3, 1e6)] | None = Field(default=None, description="resistance of the load standard")
    inductance: Annotated[float, Quantity("H", 0, 1e-3)] = Field(default=0.0, description="inductance of the load standard")

    @model_validator(mode="after")
    def _load_has_a_value(self) -> Self:
        if (self.standard == "load") != (self.nominal is not None):
            raise BadInput("nominal: belongs to the load standard, and to no other")
        return self

    def parameters(self) -> JsonDict:
        """What the standard is only where it is told."""
        return self.model_dump(include={"standard", "nominal", "inductance"} if self.standard == "load" else {"standard"})


class Connect(Strict):
    """Prompt the operator, with a drawing. The measuring steps that follow use this connection; without it each makes its own."""

    do: Literal["connect"]
    what: ConnectionName = Field(description="what is connected")
    note: str = Field(default="", max_length=500, description="what else the operator should know")


class Sweep(Strict):
    """Measure the motor's impedance, several times without touching the connection."""

    do: Literal["sweep"]
    termination: Termination = Field(description="short: between the terminals, far one joined to the frame; open: terminal to frame")
    repeat: Repeats = 1
    condition: str | None = Field(default=None, description="what was set up for it: second-temperature=53degC")

    @field_validator("condition")
    @classmethod
    def _condition_is_known(cls, condition: str | None) -> str | None:
        under = None if condition is None else parse_condition(condition)
        return None if under is None else under.text


class Check(Strict):
    """Measure a standard through the compensated fixture and judge what is left of the fixture: pass or fail."""

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
        if (self.standard == "load") != (self.nominal is not None):
            raise BadInput("nominal: belongs to the load standard, and to no other")
        return self

    def parameters(self) -> JsonDict:
        """The limits of this standard only."""
        limits = {"short": {"resistance", "inductance"}, "open": {"conductance", "capacitance"}, "load": {"nominal", "tolerance_percent"}}
        return self.model_dump(include={"standard", *limits[self.standard]})


class Scan(Strict):
    """Measure the conducted emission at the LISN with one detector."""

    do: Literal["spectrum"]
    detector: Detector = Field(description="CISPR detector")
    condition: Condition = Field(default="motor running", description="motor off measures the background; kept with the data")
    line: Line | None = Field(default=None, description="phase of the LISN: switched by the operator, or by command (line_switch)")
    operating: str = Field(default="", max_length=100, description="operating state of the motor, such as full load; prompts when it changes")
    dwell: Annotated[float, Quantity("s", 50e-6, 100)] | None = Field(
        default=None, description="measuring time of this scan; else that of [spectrum]"
    )
    repeat: Repeats = 1

    def parameters(self) -> JsonDict:
        """Keys that say something."""
        return self.model_dump(exclude={"do", *(key for key in ("line", "operating", "dwell") if not getattr(self, key))})


class Final(Strict):
    """Read the highest maxima of the scans before again, each with the detectors of the limit, on every line and in every state of those scans."""

    do: Literal["final"]
    limit: str = Field(default="cispr32-b", max_length=300, description="limit that the maxima are held against; motoremi limits lists them")
    detectors: tuple[Detector, ...] = Field(default=("quasi-peak", "cispr-average"), min_length=1, description="detectors of the final readings")
    dwell: Annotated[float, Quantity("s", 1.0, 100)] = Field(default=1.0, description="measuring time of each reading; longer for slow repetition")
    margin: Annotated[float, Quantity("dB", 0, 200)] = Field(default=10.0, description="only maxima less than this below the limit, or above it")
    maxima: int = Field(default=6, ge=1, le=100, description="at most so many, the nearest to the limit of every subrange first")
    apart: Annotated[float, Quantity("Hz", 0, 30e6)] = Field(default=50e3, description="two maxima are at least so far apart")
    subranges: int = Field(default=10, ge=1, le=100, description="parts of the span, equal on a logarithmic axis, that give maxima in turn")


class Wait(Strict):
    """Let time pass, for example until the motor is warm."""

    do: Literal["wait"]
    time: Annotated[float, Quantity("s", 0.0, 86400.0)] = Field(description="how long")
    reason: str = Field(default="", max_length=200, description="what for; shown while waiting")


class FitStep(Strict):
    """Fit the model."""

    do: Literal["fit"]
    method: Literal["ant-colony", "paper"] = Field(default="ant-colony", description="paper is the algorithm as printed")
    seed: int = Field(default=1, ge=0, description="the search is deterministic for a seed")


class CompareStep(Strict):
    """Judge the model against the measurement; without tolerances, against the measurement's own uncertainty."""

    do: Literal["compare"]
    error_percent: float | None = Field(default=None, gt=0, description="largest |Z_model/Z_measured - 1| at any point, in percent")
    magnitude_db: float | None = Field(default=None, gt=0, description="largest error of the magnitude at any point, in dB")
    phase_deg: float | None = Field(default=None, gt=0, description="largest error of the phase at any point, in degrees")


class DiagnoseStep(Strict):
    """Name the physical effect that is missing in the model."""

    do: Literal["diagnose"]


class NextStep(Strict):
    """Tell which measurement would best separate the candidates that are left; after diagnose."""

    do: Literal["next"]


class JudgeStep(Strict):
    """Hold the corrected levels against a limit: the final values where there are any, else the scans."""

    do: Literal["judge"]
    limit: str = Field(default="cispr32-b", max_length=300, description="its name (motoremi limits), or the path of your own file")
    uncertainty: Annotated[float, Quantity("dB", 0, 40)] = Field(default=3.4, description="expanded uncertainty (k = 2): the guard band")


class ReportStep(Strict):
    """Write the report."""

    do: Literal["report"]


AnalysisStep = FitStep | CompareStep | DiagnoseStep | NextStep | JudgeStep | ReportStep
MeasuringStep = Compensate | Sweep | Check | Scan | Final
PlainStep = Identify | Connect | Wait | SupplyStep | WaitFor | MeasuringStep | AnalysisStep


class Repeat(Strict):
    """Do the steps inside several times; a repeat inside a repeat is not allowed."""

    do: Literal["repeat"]
    times: int = Field(ge=1, le=1000, description="how often")
    steps: tuple[Annotated[PlainStep, Field(discriminator="do")], ...] = Field(min_length=1, description="what is repeated")


Step = Annotated[PlainStep | Repeat, Field(discriminator="do")]
STEPS: tuple[type[Strict], ...] = (
    Identify, Compensate, Connect, Sweep, Check, Scan, Final, Wait, SupplyStep, WaitFor, Repeat, FitStep, CompareStep, DiagnoseStep, NextStep,
    JudgeStep, ReportStep,
)  # fmt: skip
