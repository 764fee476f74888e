"""A number that a circuit depends on, and what is known about it beforehand."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Parameter:
    """A named, unit-bearing, bounded quantity.

    Parameters
    ----------
    name : str
        Unique within a motor: `La`, or `eddy-laminations.share` for a parameter of an effect.
    unit : str
        SI unit, empty for a pure number.
    low, high : float
        What is physically possible for a motor, in `unit`.
    reason : str
        Why these bounds.
    scale : {"log", "linear"}
        `log` for quantities that are positive and span decades (they are fitted as logarithms); `linear` for signed ones.
    sigma : float, optional
        Standard deviation of a Gaussian prior round zero (`linear` only): the analyser's specified errors.
    vary : bool
        False for a value that is found by a scan and then held.
    special : float, optional
        The value at which the law takes its simplest form, as likely beforehand as all others together.
    usual : tuple of float, optional
        Where most motors lie within the bounds: as likely beforehand as all the rest together.
    """

    name: str
    unit: str
    low: float
    high: float
    reason: str
    scale: Literal["log", "linear"] = "log"
    sigma: float | None = None
    vary: bool = True
    special: float | None = None
    usual: tuple[float, float] | None = None

    @property
    def short_name(self) -> str:
        """The name within its effect: `share` of `eddy-laminations.share`."""
        return self.name.rpartition(".")[2]

    @property
    def middle(self) -> float:
        """Centre of the range: the geometric mean for `log`."""
        if self.scale == "log":
            return math.sqrt(self.low * self.high)
        return 0.5 * (self.low + self.high)
