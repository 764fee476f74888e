"""What the data say of a parameter or of what follows from several: an interval, a value with its standard deviation."""

from __future__ import annotations

import math
from dataclasses import dataclass

from motoremi.quantities import show


@dataclass(frozen=True)
class Interval:
    """What values of a parameter the data allow at 95 %.

    Parameters
    ----------
    name, unit : str
    low, high : float
        SI units.
    open_below, open_above : bool
        True where the interval reaches the parameter's bound: the data set no limit on that side.
    """

    name: str
    unit: str
    low: float
    high: float
    open_below: bool
    open_above: bool

    def __str__(self) -> str:
        if self.open_below and self.open_above:
            return "any value fits"
        # Two digits of the interval's width.
        digits = 1 + max(2, math.ceil(-math.log10((self.high - self.low) / self.high)))
        low, high = show(self.low, self.unit, digits), show(self.high, self.unit, digits)
        if self.open_below:
            return f"anything from 0 to {high} fits {self.name}"
        if self.open_above:
            return f"anything above {low} fits {self.name}"
        return f"anything from {low} to {high} fits {self.name}"


@dataclass(frozen=True)
class Derived:
    """A quantity that follows from the elements, with its standard deviation; SI units."""

    name: str
    value: float
    sigma: float
    unit: str
