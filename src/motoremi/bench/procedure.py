"""The schema of a bench procedure and of a bench file, both TOML."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from importlib import resources
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import BeforeValidator, Field, PrivateAttr, ValidationError, model_validator

from motoremi.arrays import JsonDict
from motoremi.bench.analyser import ImpedanceAnalyser, refuse_without
from motoremi.bench.connect import driver_class, driver_names, refuse_unless_allowed
from motoremi.bench.lines import Lines
from motoremi.bench.meter import QUANTITY_OF_ROLE, Meter
from motoremi.bench.quantity import Quantity
from motoremi.bench.receiver import EmiReceiver
from motoremi.bench.roles import Role
from motoremi.bench.state_steps import SupplyStep, WaitFor
from motoremi.bench.steps import Check, Compensate, Final, Identify, JudgeStep, MeasuringStep, PlainStep, Repeat, Scan, Step, Sweep
from motoremi.bench.strict import Strict
from motoremi.bench.supply import Supply
from motoremi.bench.sweep_options import Bias, Segment, SweepOptions
from motoremi.data.corrections import Correction, Corrections, with_tables
from motoremi.data.corrections import Role as Corrected
from motoremi.data.state import STATE_QUANTITIES
from motoremi.data.sweep import MINIMUM_POINTS
from motoremi.emission.limit import find_limit
from motoremi.errors import BadInput
from motoremi.quantities import show

# More than any bench does in a week; stops a procedure that would only fill memory.
MOST_STEPS = 10_000


# Sensors of a Truevolt multimeter: four- and two-wire resistance thermometers and thermistors; thermocouples on 34465A and 34470A.
Probe = Literal["FRTD", "RTD", "FTH", "THER", "TC,J", "TC,K", "TC,T"]


def _known_driver(name: str) -> str:
    if name not in driver_names():
        raise BadInput(f"unknown instrument driver {name!r}: known are {', '.join(sorted(driver_names()))}")
    return name


# Detectors behind a meter of 160 ms (two equal poles): after a second it shows all but 0.12 dB. CISPR 16-2-1 asks for a second as well
# (unconfirmed: not read in the standard).
METERED, METER_DWELL_S = ("quasi-peak", "cispr-average", "rms-average"), 1.0


class InstrumentSpec(Strict):
    """Which driver plays a role, and where; roles with the same driver and resource are one instrument."""

    driver: Annotated[str, BeforeValidator(_known_driver)] = Field(description="name of the driver; motoremi instruments lists them")
    resource: str = Field(min_length=1, description="VISA resource; a bench file overrides it")
    channel: int | None = Field(default=None, ge=1, le=8, description="supply: the output that the motor hangs on; 1 if left out")
    probe: Probe | None = Field(default=None, description="multimeter as thermometer: its sensor, FRTD if left out")
    lines: Lines | None = Field(default=None, description="line reader: how its lines are read, see [instruments.ROLE.lines]")

    @property
    def options(self) -> JsonDict:
        """What the driver takes beside its resource."""
        return self.model_dump(include={"channel", "probe", "lines"}, exclude_none=True)

    def refuse_in(self, role: Role) -> None:
        """Raise `BadInput` if the driver cannot play a role of the motor's state."""
        driver = driver_class(self.driver)
        if role == "supply" and not issubclass(driver, Supply):
            raise BadInput(f"instruments.supply: the driver {self.driver!r} is no supply")
        quantity = QUANTITY_OF_ROLE.get(role)
        if quantity is None:
            return
        if not issubclass(driver, Meter) or quantity not in driver.quantities:
            raise BadInput(f"instruments.{role}: the driver {self.driver!r} reads no {STATE_QUANTITIES[quantity][0]}")
        # A reader of lines is the only one without an error queue.
        if (self.lines is not None) != (not driver.error_query):
            raise BadInput(f"instruments.{role}: 'lines' belongs to the driver line-reader, and to no other")
        if self.lines is not None and self.lines.quantity != quantity:
            raise BadInput(f"instruments.{role}.lines: the unit {self.lines.unit!r} is none of {STATE_QUANTITIES[quantity][0]}")


class _Band(Strict):
    start: float
    stop: float

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.stop <= self.start:
            raise BadInput("stop must be above start")
        return self


class SegmentSpec(_Band):
    """One part of a list sweep, spaced linearly."""

    start: Annotated[float, Quantity("Hz", 20, 3e9)] = Field(description="first frequency")
    stop: Annotated[float, Quantity("Hz", 20, 3e9)] = Field(description="last frequency")
    points: int = Field(ge=2, le=1601, description="number of frequencies")


class SweepSpec(_Band):
    """The impedance sweep. The driver's own limits hold too. With segments, start, stop and points follow from them."""

    start: Annotated[float, Quantity("Hz", 20, 3e9)] = Field(description="first frequency")
    stop: Annotated[float, Quantity("Hz", 20, 3e9)] = Field(description="last frequency")
    points: int = Field(ge=MINIMUM_POINTS, le=1601, description="number of frequencies")
    spacing: Literal["log", "linear", "list"] = Field(default="log", description="how the frequencies are spaced; list: by segments")
    bandwidth: int = Field(default=3, ge=1, le=5, description="1 is fastest, 5 most accurate")
    oscillator: Annotated[float, Quantity("V", 0.005, 1.0)] = Field(default=0.5, description="level of the test signal")
    adapter: Literal["none", "1m", "2m", "42942A", "42941A"] = Field(default="none", description="extension cable, terminal adapter or probe")
    fixture: Literal["none", "16047E", "16034G", "16089", "leads"] = Field(default="none", description="what holds the motor; leads: one's own")
    sweep_averages: int = Field(default=1, ge=1, le=999, description="of how many sweeps a result is the mean")
    point_averages: int = Field(default=1, ge=1, le=999, description="of how many readings at each point a result is the mean")
    bias: Annotated[float, Quantity("V", -40, 40)] = Field(default=0.0, description="direct voltage across the motor during a sweep")
    bias_limit: Annotated[float, Quantity("A", 1e-3, 0.1)] = Field(default=1e-3, description="largest current of the bias")
    bias_ramp: Annotated[float, Quantity("s", 0, 600)] = Field(default=1.0, description="time in which the bias is raised, and taken away")
    segments: tuple[SegmentSpec, ...] = Field(default=(), max_length=100, description="tables with start, stop, points; for spacing list")

    @model_validator(mode="before")
    @classmethod
    def _span_of_segments(cls, data: Any) -> Any:
        """A list sweep is from its first to its last frequency; what is wrong with a segment is said of the segment."""
        parts = data.get("segments") if isinstance(data, Mapping) else None
        if not isinstance(parts, list | tuple) or not parts or not all(isinstance(part, Mapping) for part in parts):
            return data
        if {"start", "stop", "points"} & set(data):
            raise BadInput("segments: start, stop and points of the sweep follow from them; leave those out")
        points = [part.get("points") for part in parts]
        total = sum(points) if all(type(count) is int for count in points) else None
        edges = {"start": parts[0].get("start"), "stop": parts[-1].get("stop"), "points": total}
        return {**data, **{name: value for name, value in edges.items() if value is not None}}

    @model_validator(mode="after")
    def _segments_in_order(self) -> Self:
        if bool(self.segments) != (self.spacing == "list"):
            raise BadInput('segments: belong to spacing = "list", and that needs them')
        if any(second.start <= first.stop for first, second in pairwise(self.segments)):
            raise BadInput("segments: each must start above the stop of the one before")
        return self

    def options(self) -> SweepOptions:
        """What comes on top of frequencies, level and speed."""
        return SweepOptions(
            adapter=self.adapter,
            fixture=self.fixture,
            sweep_averages=self.sweep_averages,
            point_averages=self.point_averages,
            bias=Bias(self.bias, self.bias_limit, self.bias_ramp),
            segments=tuple(Segment(one.start, one.stop, one.points) for one in self.segments),
        )


class SpectrumSpec(_Band):
    """The receiver's scan. The driver's own limits hold too."""

    start: Annotated[float, Quantity("Hz", 10, 26.5e9)] = Field(description="first frequency")
    stop: Annotated[float, Quantity("Hz", 10, 26.5e9)] = Field(description="last frequency")
    step: Annotated[float, Quantity("Hz", 1, 1e6)] = Field(description="step; half the bandwidth or less misses nothing")
    bandwidth: Annotated[float, Quantity("Hz", 10, 10e6)] = Field(default=9e3, description="6 dB resolution bandwidth")
    dwell: Annotated[float, Quantity("s", 50e-6, 100)] = Field(default=0.05, description="measuring time at each step")
    attenuation: Annotated[float, Quantity("dB", 0, 75)] = Field(default=10.0, description="input attenuation")
    overload: Literal["attenuate", "mark"] = Field(
        default="attenuate", description="what is overloaded is measured again with more attenuation, or marked"
    )
    line_switch: Literal["operator", "receiver"] = Field(default="operator", description="who switches the LISN from line to line")


# Key of the table -> setting of a driver, whose own range is checked before anything is connected.
DRIVER_SETTINGS: dict[str, dict[str, str]] = {
    "sweep": {
        "start": "start_hz",
        "stop": "stop_hz",
        "points": "points",
        "bandwidth": "bandwidth_factor",
        "oscillator": "oscillator_volt",
        "adapter": "adapter",
        "sweep_averages": "sweep_averages",
        "point_averages": "point_averages",
        "bias": "bias_volt",
    },
    "spectrum": {
        "start": "start_hz",
        "stop": "stop_hz",
        "step": "step_hz",
        "bandwidth": "resolution_bandwidth_hz",
        "dwell": "dwell_s",
        "attenuation": "attenuation_db",
    },
}
_NEEDS: tuple[tuple[Any, Role, str], ...] = ((Compensate | Sweep | Check, "analyser", "sweep"), (Scan | Final, "receiver", "spectrum"))


@dataclass(frozen=True)
class Planned:
    """One step in the order in which all are done, with those of a repeat one by one.

    Parameters
    ----------
    number : int
        From 1.
    step : step model
    round, rounds : int
        Which pass of a repeat; 1 of 1 outside of it.
    """

    number: int
    step: PlainStep
    round: int = 1
    rounds: int = 1

    def __str__(self) -> str:
        passed = f", round {self.round} of {self.rounds}" if self.rounds > 1 else ""
        return f"step {self.number} ({self.step.do}){passed}"


class Procedure(Strict):
    """A bench procedure: instruments by role, what to measure, and the steps in order."""

    title: str = Field(min_length=1, max_length=200, description="what it is, for the report")
    instruments: dict[Role, InstrumentSpec] = Field(description="by role: analyser, receiver, supply, voltmeter, ammeter, tachometer, thermometer")
    calibration_within: Annotated[float, Quantity("d", 1, 3650)] | None = Field(
        default=None, description="no run with an instrument whose calibration is older, lies in the future or is not stated"
    )
    sweep: SweepSpec | None = None
    spectrum: SpectrumSpec | None = None
    steps: tuple[Step, ...] = Field(min_length=1, description="what is done, in order")
    _source: JsonDict = PrivateAttr(default_factory=dict)

    @property
    def source(self) -> JsonDict:
        """The procedure as written, for the record; `parse_procedure` reads it again."""
        return self._source

    @property
    def plan(self) -> tuple[Planned, ...]:
        """Every step in the order in which it is done."""
        return tuple(Planned(number, *entry) for number, entry in enumerate(self._unrolled(), start=1))

    def _unrolled(self) -> Iterator[tuple[PlainStep, int, int]]:
        for step in self.steps:
            if isinstance(step, Repeat):
                yield from ((inner, turn, step.times) for turn in range(1, step.times + 1) for inner in step.steps)
            else:
                yield step, 1, 1

    @model_validator(mode="after")
    def _complete(self) -> Self:
        count = sum(step.times * len(step.steps) if isinstance(step, Repeat) else 1 for step in self.steps)
        if count > MOST_STEPS:
            raise BadInput(f"steps: {count} steps with all repeats; at most {MOST_STEPS}")
        once = [inner for step in self.steps for inner in (step.steps if isinstance(step, Repeat) else (step,))]
        measuring = [step for step in once if isinstance(step, MeasuringStep)]
        if (measuring or any(isinstance(step, SupplyStep | WaitFor) for step in once)) and not isinstance(self.steps[0], Identify):
            raise BadInput("the first step must be 'identify', which connects and sets up the instruments")
        for name, spec in self.instruments.items():
            spec.refuse_in(name)
        for kinds, role, table in _NEEDS:
            if any(isinstance(step, kinds) for step in measuring):
                if role not in self.instruments:
                    raise BadInput(f"the steps need instruments.{role}")
                if getattr(self, table) is None:
                    raise BadInput(f"the steps need the table [{table}]")
                self._refuse_beyond_driver(role, table)
        self._refuse_emission_that_cannot_be(once)
        self._refuse_lacking(measuring)
        return self

    def _refuse_emission_that_cannot_be(self, steps: Sequence[PlainStep]) -> None:
        """Limits are known, the receiver has the detectors, and a final measurement has a scan to start from."""
        scanned = False
        for step in steps:
            if isinstance(step, Final | JudgeStep):
                find_limit(step.limit)
            if isinstance(step, Final) and not scanned:
                raise BadInput("the step 'final' needs a step 'spectrum' of the running motor before it, which finds the maxima")
            scanned = scanned or (isinstance(step, Scan) and step.condition == "motor running")
            wanted = [step.detector] if isinstance(step, Scan) else step.detectors if isinstance(step, Final) else []
            for detector in wanted:
                self._refuse_detector(detector)

    def _refuse_detector(self, detector: str) -> None:
        name = self.instruments["receiver"].driver
        driver = driver_class(name)
        if issubclass(driver, EmiReceiver) and detector not in driver.detectors():
            raise BadInput(f"the {name} has no {detector} detector of CISPR 16-1-1; it has {', '.join(driver.detectors())}")

    def remarks(self) -> tuple[str, ...]:
        """What makes the emission's levels wrong, or may miss some, though the receiver would measure like this."""
        if self.spectrum is None:
            return ()
        found = []
        spec = self.spectrum
        if spec.step > spec.bandwidth / 2 * (1 + 1e-9):
            found.append(
                f"[spectrum]: the step of {show(spec.step, 'Hz')} is coarser than half the bandwidth of {show(spec.bandwidth, 'Hz')}: "
                "a line between two points reads low"
            )
        for planned in self.plan:
            if isinstance(planned.step, Scan) and planned.step.detector in METERED:
                dwell = planned.step.dwell or spec.dwell
                if dwell < METER_DWELL_S:
                    found.append(
                        f"step {planned.number}: {planned.step.detector} with a dwell of {show(dwell, 's')} reads low: "
                        f"its meter needs {METER_DWELL_S:g} s at each point"
                    )
        return tuple(found)

    def _refuse_lacking(self, measuring: Sequence[object]) -> None:
        """Options and standards that the analyser does not have."""
        kind = driver_class(self.instruments["analyser"].driver) if "analyser" in self.instruments else None
        if self.sweep is None or kind is None or not issubclass(kind, ImpedanceAnalyser):
            return
        name = self.instruments["analyser"].driver
        refuse_without(kind, self.sweep.options(), f"sweep: the {name}")
        wanted = {step.standard for step in measuring if isinstance(step, Compensate)}
        if lacking := wanted - kind.COMPENSATES:
            raise BadInput(f"the {name} compensates no {', '.join(sorted(lacking))}; leave that step out")
        if missing := kind.REQUIRED - wanted:
            needed = ", ".join(sorted(kind.REQUIRED))
            raise BadInput(f"the {name} measures only after steps that compensate with {needed}: {', '.join(sorted(missing))} missing")

    def _refuse_beyond_driver(self, role: Role, table: str) -> None:
        driver = self.instruments[role].driver
        settings = driver_class(driver).table()
        for key, name in DRIVER_SETTINGS[table].items():
            setting, value = settings.get(name), getattr(getattr(self, table), key)
            if setting is not None and setting.span is not None and not setting.span[0] <= value <= setting.span[1]:
                low, high = (show(limit, setting.unit) for limit in setting.span)
                raise BadInput(f"{table}.{key}: {show(value, setting.unit)} is outside the range {low} to {high} of the {driver}")


class BenchFile(Strict):
    """What belongs to one laboratory rather than to the procedure."""

    backend: str = Field(default="", description="what PyVISA takes, such as @py; empty: the system's VISA or PyVISA-py; sim: the simulated bench")
    resources: dict[Role, str] = Field(default_factory=dict, description="VISA resource of a role; overrides the procedure")
    allow: frozenset[str] | None = Field(default=None, description="resources that may be opened at all; without it, every one")
    operator: str = Field(default="", max_length=200, description="who measures")
    motor: str = Field(default="", max_length=200, description="name of the motor under test, for the report")
    serial: str = Field(default="", max_length=200, description="its serial number")
    ambient: str = Field(default="", max_length=200, description="temperature and humidity as read, such as 23 degC, 45 %")
    instruments: dict[Role, InstrumentSpec] = Field(
        default_factory=dict, description="instruments of this bench; they come beside the procedure's and replace those in the same role"
    )
    highest_voltage: Annotated[float, Quantity("V", 0.0, 1000.0)] | None = Field(
        default=None, description="no supply step may set more on this bench"
    )
    highest_current: Annotated[float, Quantity("A", 0.0, 1000.0)] | None = Field(
        default=None, description="no supply step may set a higher limit on this bench"
    )
    calibrated: dict[Role, date] = Field(default_factory=dict, description="date of the last calibration")
    correction: tuple[Correction, ...] = Field(default=(), description="pads, cables, transducers, fixtures: [[correction]] tables")
    seed: int = Field(default=1, ge=0, description="simulated bench: which motor")
    effects: tuple[str, ...] = Field(default=(), description="simulated bench: what it hides")

    @property
    def corrections(self) -> Corrections:
        """What stands between the motor and the instruments."""
        return Corrections(self.correction)

    def refuse_uncovered(self, procedure: Procedure) -> None:
        """Raise `BadInput` if a correction is not known over the span that the procedure measures."""
        spans: dict[Corrected, _Band | None] = {"receiver": procedure.spectrum, "analyser": procedure.sweep}
        for role, band in spans.items():
            if band is not None and role in procedure.instruments:
                self.corrections.refuse_outside(role, band.start, band.stop)

    def refuse_unless_allowed(self, procedure: Procedure) -> None:
        """Raise `BadInput` if a resource, the bench's own or what the procedure names, is not on the allow-list."""
        for role, spec in procedure.instruments.items():
            refuse_unless_allowed(role, self.resources.get(role, spec.resource), self.allow)


Model = TypeVar("Model", Procedure, BenchFile)


def ready_procedures() -> list[str]:
    """Names of the procedures that come along."""
    return sorted(entry.name.removesuffix(".toml") for entry in resources.files("motoremi.procedures").iterdir() if entry.name.endswith(".toml"))


def load_procedure(path: str | Path) -> Procedure:
    """Read a procedure from a file, or one that comes with motoremi by its name, such as `full_motor_test`.

    Raises
    ------
    BadInput
        With file, step and key in one line for everything that is wrong.
    """
    if not Path(path).exists() and str(path) in ready_procedures():
        shipped = resources.files("motoremi.procedures") / f"{path}.toml"
        return parse_procedure(_toml(shipped.read_text(encoding="utf-8"), f"{path}.toml"), f"{path}.toml")
    return parse_procedure(_toml(_read(Path(path)), str(path)), str(path))


def parse_procedure(data: Mapping[str, Any], where: str) -> Procedure:
    """Check a procedure that has been read already; `where` names it in errors."""
    procedure = _checked(Procedure, data, where)
    procedure._source = dict(data)
    return procedure


def load_bench_file(path: str | Path, confirm: Callable[[str], bool] | None = None) -> BenchFile:
    """Read a bench file with the tables that its corrections name; `sim` stands for the embedded simulated bench.

    Parameters
    ----------
    path : path-like
    confirm : callable, optional
        Asked whether a correction with a negative value is meant; without it that is an error.
    """
    if str(path) == "sim":
        return BenchFile(backend="sim")
    bench_file = _checked(BenchFile, _toml(_read(Path(path)), str(path)), str(path))
    return bench_file.model_copy(update={"correction": with_tables(bench_file.corrections, Path(path).parent, confirm).entries})


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
