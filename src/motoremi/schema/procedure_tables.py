"""The tables of a procedure: instruments by role, the impedance sweep, the receiver's scan."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from motoremi.arrays import JsonDict
from motoremi.bench.connect import driver_class, driver_names
from motoremi.bench.meter import QUANTITY_OF_ROLE, Meter
from motoremi.bench.supply import Supply
from motoremi.bench.sweep_options import Bias, Segment, SweepOptions
from motoremi.data.state import STATE_QUANTITIES
from motoremi.data.sweep import MINIMUM_POINTS
from motoremi.errors import BadInput
from motoremi.schema.quantity_field import Quantity
from motoremi.schema.roles import Role
from motoremi.schema.strict import Strict
from motoremi.schema.text_lines import Lines

# Sensors of a Truevolt multimeter: four- and two-wire resistance thermometers and thermistors; thermocouples on 34465A and 34470A.
Probe = Literal["FRTD", "RTD", "FTH", "THER", "TC,J", "TC,K", "TC,T"]


def _known_driver(name: str) -> str:
    if name not in driver_names():
        raise BadInput(f"unknown instrument driver {name!r}: known are {', '.join(sorted(driver_names()))}")
    return name


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


class Band(Strict):
    start: float
    stop: float

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.stop <= self.start:
            raise BadInput("stop must be above start")
        return self


class SegmentSpec(Band):
    """One part of a list sweep, spaced linearly."""

    start: Annotated[float, Quantity("Hz", 20, 3e9)] = Field(description="first frequency")
    stop: Annotated[float, Quantity("Hz", 20, 3e9)] = Field(description="last frequency")
    points: int = Field(ge=2, le=1601, description="number of frequencies")


class SweepSpec(Band):
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


class SpectrumSpec(Band):
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
