"""Conditions that are set up for a sweep in addition to its termination, and single values from other meters.

A condition is written as `second-temperature=53degC` or `far-end-grounded`, a value as `dc-resistance=21.3mohm+-0.1mohm`: on the command
line, in the header of a file (`# condition: ...`) and in the documents of a session.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from motoremi.arrays import JsonDict
from motoremi.data.text import clean_text
from motoremi.errors import BadInput
from motoremi.quantities import parse, show

ABSOLUTE_ZERO_DEGC = -273.15
# Units that are written without prefixes.
_PLAIN_UNITS = ("degC", "deg", "A", "m")
_LENGTH = re.compile(r"([+-]?[0-9.]+(?:[eE][+-]?[0-9]+)?)\s*(mm|cm|m)")
_METRES = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
_UNCERTAINTY = re.compile(r"\s*(?:\+-|\+/-|±)\s*")


@dataclass(frozen=True)
class Setting:
    """Unit and range of the value of a condition, or of a single value.

    Parameters
    ----------
    unit : str
        As written after a number, SI but for degC and deg; "" for a plain number.
    low, high : float
        A value outside of this range is refused as a typing error.
    example : str
    needed : bool
        Whether the condition must have a value.
    """

    unit: str
    low: float
    high: float
    example: str
    needed: bool = True


# All conditions that the menu of measurements can ask for, with the value that each takes.
CONDITIONS: Mapping[str, Setting | None] = {
    "wide-sweep": None,
    "far-end-grounded": None,
    "repeat-first-sweep": None,
    "sweep-downwards": None,
    "shaft-turned": Setting("deg", -360.0, 360.0, "30deg", needed=False),
    "contacts-cleaned": None,
    "field-winding": None,
    "repeat-compensation": None,
    "longer-lead": Setting("H", 1e-10, 1e-4, "50nH"),
    "longer-strap": Setting("H", 1e-10, 1e-4, "30nH", needed=False),
    "terminal-block": None,
    "end-turn-touched": None,
    "known-capacitor": Setting("F", 1e-14, 1e-3, "100pF"),
    "brushes-lifted": None,
    "rotor-out": None,
    "dc-bias": Setting("A", -1e4, 1e4, "1A"),
    "second-temperature": Setting("degC", ABSOLUTE_ZERO_DEGC, 400.0, "53degC"),
    "dried": None,
    "standards": Setting("Ohm", 1e-3, 1e7, "50ohm"),
    "fixture-open": None,
    "fixture-short": None,
    "fixture-load": Setting("Ohm", 1e-3, 1e7, "50ohm"),
}
# Ids on the menu that ask for sweeps without a condition.
REFERENCE = ("short-sweep", "open-sweep", "repeats")
# Conditions in which a standard is connected instead of the motor.
STANDARDS = ("standards", "fixture-open", "fixture-short", "fixture-load")
# Standards with almost no impedance or almost no admittance.
NEXT_TO_NOTHING = ("fixture-open", "fixture-short")


@dataclass(frozen=True)
class Condition:
    """What was set up for a sweep.

    Parameters
    ----------
    id : str
        Of the measurement on the menu, for example "second-temperature".
    value : float, optional
        For example 53.0 degC; SI but for degC and deg.
    unit : str
        Of the value; empty without one.
    """

    id: str
    value: float | None = None
    unit: str = ""

    @property
    def text(self) -> str:
        """As it is written, for example `longer-lead=50nH`; `parse_condition` reads it back exactly."""
        return self.id if self.value is None else f"{self.id}={_written(self.value, self.unit)}"

    def __str__(self) -> str:
        return self.text

    def to_dict(self) -> JsonDict:
        """Plain data."""
        return {"id": self.id, "value": self.value, "unit": self.unit}

    @classmethod
    def restored(cls, payload: object) -> Condition:
        """From what `to_dict` wrote; also a condition that this installation does not know.

        Raises
        ------
        BadInput
            If it is not such a dictionary.
        """
        try:
            stored = dict(payload)  # type: ignore[call-overload]
            value = stored["value"]
            return cls(str(stored["id"]), None if value is None else float(value), str(stored["unit"]))
        except (KeyError, TypeError, ValueError) as error:
            raise BadInput(f"a stored condition cannot be read: {clean_text(str(error), 80)}") from error


@dataclass(frozen=True)
class SingleValue:
    """A value that was measured with another meter.

    Parameters
    ----------
    name : str
        One of `VALUES`.
    value_si : float
    unit : str
    sigma : float
        Standard deviation, in the same unit.
    """

    name: str
    value_si: float
    unit: str
    sigma: float

    @property
    def text(self) -> str:
        """As it is written, for example `dc-resistance=21.3mOhm+-100uOhm`; `parse_value` reads it back exactly."""
        return f"{self.name}={_written(self.value_si, self.unit)}+-{_written(self.sigma, self.unit)}"

    def __str__(self) -> str:
        return self.text

    def to_dict(self) -> JsonDict:
        """Plain data."""
        return {"name": self.name, "value": self.value_si, "unit": self.unit, "sigma": self.sigma}

    @classmethod
    def restored(cls, payload: Mapping[str, Any]) -> SingleValue:
        """From what `to_dict` wrote.

        Raises
        ------
        BadInput
            If it is not such a dictionary.
        """
        try:
            return checked_value(cls(str(payload["name"]), float(payload["value"]), str(payload["unit"]), float(payload["sigma"])))
        except (KeyError, TypeError, ValueError) as error:
            raise BadInput(f"a stored single value cannot be read: {clean_text(str(error), 80)}") from error


@dataclass(frozen=True)
class Quantity:
    """A kind of single value.

    Parameters
    ----------
    setting : Setting
    meaning : str
    termination : {"short", "open"} or None
        Of the sweep without which no model tells the value; None if any will do.
    relative, absolute : float
        Uncertainty if none is given: `relative` times the value plus `absolute`.
    """

    setting: Setting
    meaning: str
    termination: str | None
    relative: float
    absolute: float = 0.0


VALUES: Mapping[str, Quantity] = {
    "dc-resistance": Quantity(Setting("Ohm", 1e-6, 1e7, "21.3mohm"), "the winding's resistance at DC, with four wires", "short", 0.005),
    "insulation-resistance": Quantity(Setting("Ohm", 1.0, 1e16, "2Gohm"), "winding to frame at DC", "open", 0.1),
    "capacitance-1khz": Quantity(Setting("F", 1e-14, 1e-3, "320pF"), "winding to frame at 1 kHz", "open", 0.01),
    "tan-delta-1khz": Quantity(Setting("", 1e-6, 10.0, "0.012"), "loss factor of winding to frame at 1 kHz", "open", 0.05, 0.001),
    "lead-length": Quantity(Setting("m", 1e-3, 100.0, "0.3m"), "test lead between fixture and terminal, on the way to the motor alone", None, 0.1),
}


def condition(name: str, value: float | None = None) -> Condition:
    """A condition of the menu with its value in the unit that belongs to it.

    Raises
    ------
    BadInput
        For an unknown name, or a value that is missing, out of range or not allowed.
    """
    if name in VALUES:
        raise BadInput(f"{name} is a single value, not a condition of a sweep: write --value {name}={VALUES[name].setting.example}")
    if name not in CONDITIONS:
        raise BadInput(f"unknown condition {clean_text(name, 40)!r}; known are {', '.join(CONDITIONS)}")
    setting = CONDITIONS[name]
    if setting is None:
        if value is not None:
            raise BadInput(f"the condition {name} takes no value: write {name} alone")
        return Condition(name)
    if value is None:
        if setting.needed:
            raise BadInput(f"the condition {name} needs its value: write for example {name}={setting.example}")
        return Condition(name)
    if name == "dc-bias" and value == 0:
        raise BadInput("dc-bias=0A is no bias: append the sweep without --condition")
    return Condition(name, _checked(name, value, setting), setting.unit)


def parse_condition(text: str) -> Condition | None:
    """A condition as a person writes it, `ID` or `ID=VALUE` with a unit; None for an id that asks for sweeps without a condition.

    Raises
    ------
    BadInput
        For an unknown name, a missing value or unit, a wrong unit, or a value out of range.
    """
    name, equals, given = (part.strip() for part in str(text).partition("="))
    if name in REFERENCE and not equals:
        return None
    setting = CONDITIONS.get(name)
    if setting is None or not equals:
        if equals and name in CONDITIONS:
            raise BadInput(f"the condition {name} takes no value: write {name} alone")
        return condition(name)
    return condition(name, _with_unit(name, given, setting))


def refuse_other_termination(text: str, short: bool, open_: bool) -> None:
    """Raise `BadInput` if a condition that asks for the sweep of one termination is given with sweeps of the other."""
    for asked, other in (("short", open_), ("open", short)):
        if text.strip() == f"{asked}-sweep" and other:
            given = "open" if asked == "short" else "short"
            raise BadInput(f"--condition {asked}-sweep asks for the {asked}-circuit sweep, and --{given} files were given: use --{asked} FILE...")


def parse_value(text: str) -> SingleValue:
    """A single value as a person writes it: `dc-resistance=21.3mohm`, with an uncertainty `...+-0.1mohm` or `...+-0.5%`.

    Raises
    ------
    BadInput
        For an unknown name, no number, a missing or wrong unit, or an unusable uncertainty.
    """
    name, equals, given = (part.strip() for part in str(text).partition("="))
    quantity = _quantity(name)
    setting = quantity.setting
    if not (equals and given):
        raise BadInput(f"{name} needs its value: write for example {name}={setting.example}")
    parts = _UNCERTAINTY.split(given)
    if len(parts) > 2:
        raise BadInput(f"cannot read {clean_text(given, 60)!r} as a value with one uncertainty: write for example {name}={setting.example}+-1%")
    value = _with_unit(name, parts[0], setting)
    if len(parts) == 1:
        return checked_value(SingleValue(name, value, setting.unit, _decimal(quantity.relative * abs(value) + quantity.absolute)))
    stated = parts[1]
    sigma = _decimal(parse(stated, "%") / 100 * abs(value)) if stated.endswith("%") else _with_unit(name, stated, setting)
    return checked_value(SingleValue(name, value, setting.unit, sigma))


def checked_value(value: SingleValue) -> SingleValue:
    """The value, after its range and uncertainty are checked.

    Raises
    ------
    BadInput
        For an unknown name, another unit, a value out of range, or an uncertainty that is not above 0 and below the value.
    """
    setting = _quantity(value.name).setting
    if value.unit != setting.unit:
        raise BadInput(f"{value.name} has the unit {clean_text(value.unit, 20)!r}, expected {setting.unit or 'none'}")
    _checked(value.name, value.value_si, setting)
    if not 0 < value.sigma < value.value_si:
        raise BadInput(f"the uncertainty of {value.name} must be above 0 and below the value: write for example {value.name}={setting.example}+-1%")
    return value


def _quantity(name: str) -> Quantity:
    if name not in VALUES:
        raise BadInput(f"unknown value {clean_text(name, 40)!r}; known are {', '.join(VALUES)}")
    return VALUES[name]


def _decimal(value: float) -> float:
    """Without the binary rounding of a product: 5 % of 2.3 is 0.115, not 0.11499999999999999."""
    return float(f"{value:.12g}")


def _with_unit(name: str, text: str, setting: Setting) -> float:
    """A number with its unit, which is required: `longer-lead=50` could be 50 nH as well as 50 mm."""
    written = text.replace("°C", "degC").replace("°", "deg").replace("Ω", "Ohm").replace("ohm", "Ohm")
    example = f"write for example {name}={setting.example}"
    if not text:
        raise BadInput(f"{name} needs its value: {example}")
    if setting.unit == "m":
        # `0.3m` is 0.3 metres here; elsewhere m is the prefix milli.
        length = _LENGTH.fullmatch(written)
        if length is None:
            raise BadInput(f"cannot read {clean_text(text, 40)!r} as a length of {name}: {example}")
        return parse(length[1], "") * _METRES[length[2]]
    if not written.endswith(setting.unit):
        raise BadInput(f"{clean_text(text, 40)!r} is not in {setting.unit}, the unit of {name}: {example}")
    try:
        return parse(written, setting.unit)
    except BadInput as error:
        raise BadInput(f"cannot read {clean_text(text, 40)!r} as the value of {name}: {example}") from error


def _checked(name: str, value: float, setting: Setting) -> float:
    if not math.isfinite(value):
        raise BadInput(f"{name} must be a finite number in {setting.unit or 'no unit'}")
    if setting.unit == "degC" and value <= ABSOLUTE_ZERO_DEGC:
        raise BadInput(f"{name}={value:g}degC is not above absolute zero ({ABSOLUTE_ZERO_DEGC:g} degC): write for example {name}={setting.example}")
    if not setting.low <= value <= setting.high:
        span = f"{_written(setting.low, setting.unit)} to {_written(setting.high, setting.unit)}"
        raise BadInput(f"{name}={_written(value, setting.unit)} is out of range ({span}): write for example {name}={setting.example}")
    return float(value)


def _written(value: float, unit: str) -> str:
    """A number with its unit and no blank; reading it back gives exactly the same number."""
    if unit in _PLAIN_UNITS or not unit:
        return f"{value!r}".removesuffix(".0") + unit
    short = show(value, unit, 12).replace(" ", "")
    return short if parse(short, unit) == value else f"{value!r}{unit}"
