"""The steps that concern the motor's state: set its supply, and wait until a quantity has settled."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from motoremi.data.state import show_state
from motoremi.errors import BadInput
from motoremi.quantities import parse
from motoremi.schema.quantity_field import Quantity
from motoremi.schema.strict import Strict

# Word in a step -> key of the state, unit of a target, unit of a difference.
WORDS: dict[str, tuple[str, str, str]] = {
    "temperature": ("temperature_degc", "degC", "K"),
    "speed": ("speed_rpm", "rpm", "rpm"),
    "voltage": ("voltage_volt", "V", "V"),
    "current": ("current_ampere", "A", "A"),
}
# Units whose first letter could be taken for an SI prefix.
_WHOLE = ("rpm", "degC", "K")


class SupplyStep(Strict):
    """Set the motor's supply and switch its output; every run switches it off at its end, also after an error."""

    do: Literal["supply"]
    output: Literal["on", "off"] = Field(default="on", description="state of the output after the step")
    voltage: Annotated[float, Quantity("V", 0.0, 1000.0)] | None = Field(default=None, description="voltage; required if the output is on")
    current_limit: Annotated[float, Quantity("A", 1e-3, 1000.0)] | None = Field(
        default=None, description="current limit of the supply; required if the output is on"
    )
    ramp: Annotated[float, Quantity("s", 0.0, 600.0)] = Field(default=0.0, description="time in which the voltage is reached; 0: at once")

    @model_validator(mode="after")
    def _on_with_both(self) -> Self:
        both = self.voltage is not None and self.current_limit is not None
        if (self.output == "on") != both or (self.output == "off" and (self.voltage or self.current_limit)):
            raise BadInput("an output that is on needs voltage and current_limit; one that is off takes neither")
        return self


@dataclass(frozen=True)
class Demand:
    """Limits that a quantity of the state has to stay within while something is measured.

    Parameters
    ----------
    key : str
        Key of the quantity in the state.
    low, high : float
        Both NaN if the wait ended without reaching the state, so that every value is outside.
    text : str
        The limits in words.
    """

    key: str
    low: float
    high: float
    text: str

    def outside(self, value: float) -> bool:
        """Whether a reading is outside."""
        return not self.low <= value <= self.high


class WaitFor(Strict):
    """Wait until a quantity of the motor's state is stable or at its target; what is measured later outside of these limits is marked."""

    do: Literal["wait-for"]
    quantity: Literal["temperature", "speed", "voltage", "current"] = Field(description="quantity that has to settle")
    within: str = Field(max_length=40, description="largest difference between readings, or from the target: 1 K, 30 rpm, 1 %")
    target: str | None = Field(
        default=None, max_length=40, description="value to be reached: 60 degC, 3000 rpm; without it, the quantity has to be stable"
    )
    hold: Annotated[float, Quantity("s", 0.0, 86400.0)] = Field(description="time for which it has to stay within these limits")
    every: Annotated[float, Quantity("s", 0.1, 600.0)] = Field(default=5.0, description="time between two readings")
    longest: Annotated[float, Quantity("s", 1.0, 86400.0)] = Field(default=3600.0, description="longest wait")
    otherwise: Literal["stop", "ask"] = Field(
        default="stop", description="after the longest wait: end the run, or ask the operator whether to go on"
    )

    @model_validator(mode="after")
    def _can_be_judged(self) -> Self:
        if self.tolerance(1.0) <= 0:
            raise BadInput(f"within: {self.within!r} must be above 0")
        if self.quantity == "temperature" and self.within.rstrip().endswith("%"):
            raise BadInput("within: give the tolerance of a temperature in K, not percent")
        if self.target is None and self.hold == 0:
            raise BadInput("hold: must be above 0 without a target, else a single reading would count as stable")
        if self.hold > self.longest:
            raise BadInput("longest: must not be below hold")
        if self.target is not None:
            _number(self.target, WORDS[self.quantity][1])
        return self

    @property
    def key(self) -> str:
        """Key of the state."""
        return WORDS[self.quantity][0]

    @property
    def readings(self) -> int:
        """How many readings in a row have to be within the limits.

        Readings are counted rather than timed, so that a replay takes exactly as many as the recorded run.
        """
        return math.ceil(self.hold / self.every) + 1

    @property
    def most_readings(self) -> int:
        """Largest number of readings."""
        return max(self.readings, math.ceil(self.longest / self.every) + 1)

    @property
    def text(self) -> str:
        """The condition in words."""
        what = f"{self.quantity} {'stable' if self.target is None else f'at {self.target}'} within {self.within}"
        return f"{what} for {self.hold:g} s" if self.hold else what

    def tolerance(self, about: float) -> float:
        """Largest deviation in the quantity's unit; a percentage is of `about`."""
        text = self.within.strip()
        if text.endswith("%"):
            return parse(text[:-1].strip(), "1") / 100 * abs(about)
        return _number(text, WORDS[self.quantity][2])

    def met(self, values: Sequence[float]) -> Demand | None:
        """The limits that hold from now on if the last readings meet the condition; None if they do not."""
        last = np.array(values[-self.readings :])
        if last.size < self.readings:
            return None
        middle = float(np.mean(last)) if self.target is None else _number(self.target, WORDS[self.quantity][1])
        within = self.tolerance(middle)
        apart = float(np.ptp(last)) if self.target is None else float(np.max(np.abs(last - middle)))
        if apart > within:
            return None
        # A stable value may still drift slowly, so the limits are around the last reading, not around the mean of the wait.
        about = float(last[-1]) if self.target is None else middle
        low, high = about - within, about + within
        return Demand(self.key, low, high, f"{show_state(self.key, low)} to {show_state(self.key, high)} was demanded")

    def unmet(self) -> Demand:
        """The limits if the operator goes on without the condition: every value is outside."""
        return Demand(self.key, math.nan, math.nan, f"never was {self.text}")


def _number(text: str, unit: str) -> float:
    """Convert text with a unit to a number."""
    if unit in _WHOLE and not text.strip().endswith(unit):
        raise BadInput(f"{text!r}: write it with its unit, {unit}")
    return parse(text.strip().removesuffix(unit).strip() if unit in _WHOLE else text, unit)
