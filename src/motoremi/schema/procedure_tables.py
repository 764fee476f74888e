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
    """Driver and resource of the instrument in a role; roles with the same driver and resource are one instrument."""

    driver: Annotated[str, BeforeValidator(_known_driver)] = Field(description="name of the driver; motoremi instruments lists them")
    resource: str = Field(min_length=1, description="VISA resource; a bench file overrides it")
    channel: int | None = Field(default=None, ge=1, le=8, description="supply: number of the output that feeds the motor; 1 if left out")
    probe: Probe | None = Field(default=None, description="multimeter as thermometer: its temperature sensor, FRTD if left out")
    lines: Lines | None = Field(default=None, description="line reader: how its lines are read, see [instruments.ROLE.lines]")

    @property
    def options(self) -> JsonDict:
        """The driver's options besides its resource."""
        return self.model_dump(include={"channel", "probe", "lines"}, exclude_none=True)

    def refuse_in(self, role: Role) -> None:
        """Raise `BadInput` if the driver cannot have a role of the motor's state."""
        driver = driver_class(self.driver)
        if role == "supply" and not issubclass(driver, Supply):
            raise BadInput(f"instruments.supply: the driver {self.driver!r} is no supply")
        quantity = QUANTITY_OF_ROLE.get(role)
        if quantity is None:
            return
        if not issubclass(driver, Meter) or quantity not in driver.quantities:
            raise BadInput(f"instruments.{role}: the driver {self.driver!r} reads no {STATE_QUANTITIES[quantity][0]}")
        # Of the instruments that read the motor's state, only the line reader has no error queue.
        if (self.lines is not None) != (not driver.error_query):
            raise BadInput(f"instruments.{role}: 'lines' belongs to the driver line-reader, and to no other")
        if self.lines is not None and self.lines.quantity != quantity:
            raise BadInput(f"instruments.{role}.lines: the unit {self.lines.unit!r} is none of {STATE_QUANTITIES[quantity][0]}")


class Band(Strict):
    """A span of frequencies; the tables that have one give the limits of its ends."""

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
    """The impedance sweep. The limits of the driver apply too. With segments, start, stop and points follow from the segments."""

    start: Annotated[float, Quantity("Hz", 20, 3e9)] = Field(description="first frequency")
    stop: Annotated[float, Quantity("Hz", 20, 3e9)] = Field(description="last frequency")
    points: int = Field(ge=MINIMUM_POINTS, le=1601, description="number of frequencies")
    spacing: Literal["log", "linear", "list"] = Field(default="log", description="spacing of the frequencies; list: given by segments")
    bandwidth: int = Field(default=3, ge=1, le=5, description="measuring speed: 1 is fastest, 5 most accurate")
    oscillator: Annotated[float, Quantity("V", 0.005, 1.0)] = Field(default=0.5, description="level of the test signal")
    adapter: Literal["none", "1m", "2m", "42942A", "42941A"] = Field(default="none", description="extension cable, terminal adapter or probe")
    fixture: Literal["none", "16047E", "16034G", "16089", "leads"] = Field(default="none", description="test fixture; leads: leads of your own")
    sweep_averages: int = Field(default=1, ge=1, le=999, description="number of sweeps that are averaged")
    point_averages: int = Field(default=1, ge=1, le=999, description="number of readings that are averaged at each point")
    bias: Annotated[float, Quantity("V", -40, 40)] = Field(default=0.0, description="direct voltage across the motor during a sweep")
    bias_limit: Annotated[float, Quantity("A", 1e-3, 0.1)] = Field(default=1e-3, description="largest current of the bias")
    bias_ramp: Annotated[float, Quantity("s", 0, 600)] = Field(default=1.0, description="time in which the bias is raised, and removed")
    segments: tuple[SegmentSpec, ...] = Field(default=(), max_length=100, description="tables with start, stop, points; for spacing list")

    @model_validator(mode="before")
    @classmethod
    def _span_of_segments(cls, data: Any) -> Any:
        """Derive start, stop and points of a list sweep from its segments; errors in a segment are reported for the segment."""
        parts = data.get("segments") if isinstance(data, Mapping) else None
        if not isinstance(parts, list | tuple) or not parts or not all(isinstance(part, Mapping) for part in parts):
            return data
        if {"start", "stop", "points"} & set(data):
            raise BadInput("segments: leave out start, stop and points of the sweep, which follow from the segments")
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
        """The options of the sweep, beyond frequencies, level and speed."""
        return SweepOptions(
            adapter=self.adapter,
            fixture=self.fixture,
            sweep_averages=self.sweep_averages,
            point_averages=self.point_averages,
            bias=Bias(self.bias, self.bias_limit, self.bias_ramp),
            segments=tuple(Segment(one.start, one.stop, one.points) for one in self.segments),
        )


class SpectrumSpec(Band):
    """The receiver's scan. The limits of the driver apply too."""

    start: Annotated[float, Quantity("Hz", 10, 26.5e9)] = Field(description="first frequency")
    stop: Annotated[float, Quantity("Hz", 10, 26.5e9)] = Field(description="last frequency")
    step: Annotated[float, Quantity("Hz", 1, 1e6)] = Field(
        description="frequency step; at most half the bandwidth, or lines between two points are measured too low"
    )
    bandwidth: Annotated[float, Quantity("Hz", 10, 10e6)] = Field(default=9e3, description="6 dB resolution bandwidth")
    dwell: Annotated[float, Quantity("s", 50e-6, 100)] = Field(default=0.05, description="measuring time at each step")
    attenuation: Annotated[float, Quantity("dB", 0, 75)] = Field(default=10.0, description="input attenuation")
    overload: Literal["attenuate", "mark"] = Field(
        default="attenuate", description="attenuate: overloaded points are measured again with more attenuation; mark: they are marked"
    )
    line_switch: Literal["operator", "receiver"] = Field(default="operator", description="who switches the LISN between lines")


# Key of the table -> setting of the driver, whose range is checked before anything is connected.
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
