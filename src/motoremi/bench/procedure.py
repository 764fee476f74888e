"""The schema of a bench procedure and of a bench file, both TOML."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from datetime import date
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PrivateAttr, ValidationError, model_validator

from motoremi.arrays import JsonDict
from motoremi.bench.connect import driver_names
from motoremi.data.spectrum import Detector
from motoremi.data.sweep import MINIMUM_POINTS, Termination
from motoremi.errors import BadInput
from motoremi.quantities import parse, show


def _quantity(unit: str, low: float, high: float) -> BeforeValidator:
    """Text with the unit, such as `"150 kHz"`, to a number in SI units within a range."""

    def read(value: object) -> float:
        if not isinstance(value, str):
            raise BadInput(f"write it as text with its unit, for example {show(low, unit)!r}")
        number = parse(value, unit)
        if not low <= number <= high:
            raise BadInput(f"{value!r} is outside the range {show(low, unit)} to {show(high, unit)}")
        return number

    return BeforeValidator(read)


def _known_driver(name: str) -> str:
    if name not in driver_names():
        raise BadInput(f"unknown instrument driver {name!r}: known are {', '.join(sorted(driver_names()))}")
    return name


Role = Literal["analyser", "receiver"]
AnalyserHertz = Annotated[float, _quantity("Hz", 40, 110e6)]
ReceiverHertz = Annotated[float, _quantity("Hz", 10, 26.5e9)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class InstrumentSpec(_Strict):
    """Which driver plays a role, and where."""

    driver: Annotated[str, BeforeValidator(_known_driver)]
    resource: str = Field(min_length=1)


class _Band(_Strict):
    start: float
    stop: float

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.stop <= self.start:
            raise BadInput("stop must be above start")
        return self


class SweepSpec(_Band):
    """The impedance sweep; frequencies in hertz, oscillator in volt."""

    start: AnalyserHertz
    stop: AnalyserHertz
    points: int = Field(ge=MINIMUM_POINTS, le=801)
    spacing: Literal["log", "linear"] = "log"
    bandwidth: int = Field(default=3, ge=1, le=5)
    oscillator: Annotated[float, _quantity("V", 0.005, 1.0)] = 0.5


class SpectrumSpec(_Band):
    """The receiver's scan; frequencies in hertz, dwell in seconds, attenuation in dB."""

    start: ReceiverHertz
    stop: ReceiverHertz
    step: Annotated[float, _quantity("Hz", 1, 1e6)]
    bandwidth: Annotated[float, _quantity("Hz", 10, 10e6)] = 9e3
    dwell: Annotated[float, _quantity("s", 50e-6, 100)] = 0.05
    attenuation: Annotated[float, _quantity("dB", 0, 75)] = 10.0


class Identify(_Strict):
    """Connect, check who answers, set up."""

    do: Literal["identify"]


class Compensate(_Strict):
    """Measure the fixture with a standard."""

    do: Literal["compensate"]
    standard: Literal["open", "short"]


class Sweep(_Strict):
    """Measure the motor's impedance, several times without touching the connection."""

    do: Literal["sweep"]
    termination: Termination
    repeat: int = Field(default=1, ge=1, le=100)


class Scan(_Strict):
    """Measure the conducted emission."""

    do: Literal["spectrum"]
    detector: Detector
    repeat: int = Field(default=1, ge=1, le=100)


class FitStep(_Strict):
    """Fit the model."""

    do: Literal["fit"]
    method: Literal["ant-colony", "paper"] = "ant-colony"
    seed: int = Field(default=1, ge=0)


class CompareStep(_Strict):
    """Judge the model against the measurement; without tolerances, against the measurement's own uncertainty."""

    do: Literal["compare"]
    error_percent: float | None = Field(default=None, gt=0)
    magnitude_db: float | None = Field(default=None, gt=0)
    phase_deg: float | None = Field(default=None, gt=0)


class DiagnoseStep(_Strict):
    """Name the missing effect."""

    do: Literal["diagnose"]


class ReportStep(_Strict):
    """Write the report."""

    do: Literal["report"]


AnalysisStep = FitStep | CompareStep | DiagnoseStep | ReportStep
Step = Annotated[Identify | Compensate | Sweep | Scan | AnalysisStep, Field(discriminator="do")]


class Procedure(_Strict):
    """A bench procedure: instruments by role, what to measure, and the steps in order."""

    title: str = Field(min_length=1)
    instruments: dict[Role, InstrumentSpec]
    sweep: SweepSpec | None = None
    spectrum: SpectrumSpec | None = None
    steps: tuple[Step, ...] = Field(min_length=1)
    _source: JsonDict = PrivateAttr(default_factory=dict)

    @property
    def source(self) -> JsonDict:
        """The procedure as written, for the record; `parse_procedure` reads it again."""
        return self._source

    @model_validator(mode="after")
    def _complete(self) -> Self:
        measuring = [step for step in self.steps if isinstance(step, Compensate | Sweep | Scan)]
        if measuring and not isinstance(self.steps[0], Identify):
            raise BadInput("the first step must be 'identify', which connects and sets up the instruments")
        for kinds, role, table in ((Compensate | Sweep, "analyser", "sweep"), (Scan, "receiver", "spectrum")):
            if any(isinstance(step, kinds) for step in measuring):
                if role not in self.instruments:
                    raise BadInput(f"the steps need instruments.{role}")
                if getattr(self, table) is None:
                    raise BadInput(f"the steps need the table [{table}]")
        return self


class BenchFile(_Strict):
    """What belongs to one laboratory rather than to the procedure.

    Parameters
    ----------
    backend : str
        What PyVISA takes, for example `@py`; empty for the system's VISA or PyVISA-py; `sim` for the embedded simulated bench.
    resources : dict
        Role to VISA resource; overrides the procedure.
    allow : frozenset of str, optional
        Resources that may be opened at all.
    operator : str
    calibrated : dict
        Role to the date of the last calibration.
    seed, effects
        Of the simulated bench: what its motor is and what it hides.
    """

    backend: str = ""
    resources: dict[Role, str] = Field(default_factory=dict)
    allow: frozenset[str] | None = None
    operator: str = ""
    calibrated: dict[Role, date] = Field(default_factory=dict)
    seed: int = Field(default=1, ge=0)
    effects: tuple[str, ...] = ()


Model = TypeVar("Model", Procedure, BenchFile)


def load_procedure(path: str | Path) -> Procedure:
    """Read a procedure from a file, or one that comes with motoremi by its name, such as `full_motor_test`.

    Raises
    ------
    BadInput
        With file, step and key in one line for everything that is wrong.
    """
    shipped = resources.files("motoremi.procedures") / f"{path}.toml"
    if not Path(path).exists() and shipped.is_file():
        return parse_procedure(_toml(shipped.read_text(encoding="utf-8"), f"{path}.toml"), f"{path}.toml")
    return parse_procedure(_toml(_read(Path(path)), str(path)), str(path))


def parse_procedure(data: Mapping[str, Any], where: str) -> Procedure:
    """Check a procedure that has been read already; `where` names it in errors."""
    procedure = _checked(Procedure, data, where)
    procedure._source = dict(data)
    return procedure


def load_bench_file(path: str | Path) -> BenchFile:
    """Read a bench file; `sim` stands for the embedded simulated bench."""
    if str(path) == "sim":
        return BenchFile(backend="sim")
    return _checked(BenchFile, _toml(_read(Path(path)), str(path)), str(path))


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(f"cannot read {path}: {getattr(error, 'strerror', None) or 'it is not UTF-8 text'}") from error


def _toml(text: str, where: str) -> JsonDict:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise BadInput(f"{where}: not valid TOML: {error}") from error


def _checked(model: type[Model], data: Mapping[str, Any], where: str) -> Model:
    try:
        return model.model_validate(data)
    except ValidationError as error:
        problems = "; ".join(_one_problem(problem, data) for problem in error.errors())
        raise BadInput(f"{where}: {problems}") from error


def _one_problem(problem: Mapping[str, Any], data: Mapping[str, Any]) -> str:
    place = [str(part) for part in problem["loc"]]
    if place[:1] == ["steps"] and len(place) > 1:
        number = int(place[1])
        kind = data["steps"][number].get("do", "?") if isinstance(data["steps"][number], Mapping) else "?"
        # The union's tag stands between the number and the key.
        key = [part for part in place[2:] if part != kind]
        place = [f"step {number + 1} ({kind})", *key]
    message = str(problem["msg"]).removeprefix("Value error, ")
    if problem["type"] == "extra_forbidden":
        message = "unknown key"
    return ": ".join(part for part in (".".join(place).replace(").", "): "), message) if part)
