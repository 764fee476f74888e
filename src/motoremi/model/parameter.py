"""A parameter of a circuit: name, unit, range and prior."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Parameter:
    """A named quantity with unit and bounds.

    Parameters
    ----------
    name : str
        Unique within a motor: `La`, or `eddy-laminations.share` for a parameter of an effect.
    unit : str
        SI unit, empty for a pure number.
    low, high : float
        Physically possible range for a motor, in `unit`.
    reason : str
        Reason for these bounds.
    scale : {"log", "linear"}
        `log` for quantities that are positive and span decades (they are fitted as logarithms); `linear` for signed ones.
    sigma : float, optional
        Standard deviation of a Gaussian prior about zero (`linear` only).
    vary : bool
        False for a value that is found by a scan and then held.
    special : float, optional
        The value at which the law takes its simplest form; it has half of the prior probability.
    usual : tuple of float, optional
        Range of most motors within the bounds; it has half of the prior probability.
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
