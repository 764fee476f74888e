"""A field of a procedure that is written with its unit, such as `"150 kHz"`, and becomes a number in SI units."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

from motoremi.errors import BadInput
from motoremi.quantities import parse, show


@dataclass(frozen=True)
class Quantity:
    """Unit and limits of a field; use as `Annotated[float, Quantity("Hz", 10, 30e6)]`.

    Parameters
    ----------
    unit : str
        SI unit.
    low, high : float
        Smallest and largest value, in `unit`.
    """

    unit: str
    low: float
    high: float

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self.read, handler(source))

    def read(self, value: object) -> float:
        """Convert text with a unit to a number in SI units.

        Raises
        ------
        BadInput
            If it is not such a text, or outside the limits.
        """
        if not isinstance(value, str):
            raise BadInput(f"write it as text with its unit, for example {show(self.low, self.unit)!r}")
        number = parse(value, self.unit)
        # `parse` takes a number alone as one in SI units: 50 for 50 ms would be 50 s, and 500 for 500 mA would be 500 A.
        if not value.replace("Ω", "Ohm").replace("ohm", "Ohm").strip().endswith(self.unit):
            raise BadInput(f"{value!r} has no unit: write it with its unit, for example {show(self.low, self.unit)!r}")
        if not self.low <= number <= self.high:
            raise BadInput(f"{value!r} is outside the range {self.span()}")
        return number

    def span(self) -> str:
        """The limits as text."""
        return f"{show(self.low, self.unit)} to {show(self.high, self.unit)}"
