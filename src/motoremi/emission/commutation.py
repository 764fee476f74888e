"""Commutation of one coil: eq. (5) - (16) of Liu, Wang and Nan (2011) in closed form.

With tau = t/Tk, i = is/ia and A = Rd Tk/Ls the paper's equation has the solution

    i = 1 - 2 tau + 2 tau (1 - tau)/(A + 1) 2F1(1, 2; A + 2; tau).

For A > 1 the current reverses in time. For A < 1 it does not: the remaining current is interrupted when the segment leaves the brush, and the
voltage at the trailing edge grows until an arc ignites.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq
from scipy.special import hyp2f1

from motoremi.arrays import FloatArray, JsonDict
from motoremi.errors import BadInput

# Smallest 1 - tau that can be computed with; for A < 1 the voltage is computed up to here.
CLOSEST_TO_END = 1e-12


def commutation_time(brush_width_m: float, commutator_diameter_m: float, speed_rpm: float) -> float:
    """Time during which a brush covers one joint between segments: its width divided by the commutator's surface speed.

    Parameters
    ----------
    brush_width_m, commutator_diameter_m : float
        In metres.
    speed_rpm : float
        Turns per minute.

    Returns
    -------
    float
        In seconds. The paper's 100 mm, 360 mm and 1400 rpm give 3.79 ms, not the 38.4 ms printed there.
    """
    _positive(brush_width_m=brush_width_m, commutator_diameter_m=commutator_diameter_m, speed_rpm=speed_rpm)
    return brush_width_m / (math.pi * commutator_diameter_m * speed_rpm / 60)


def _positive(**values: float) -> None:
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0):
            raise BadInput(f"{name} is {value}; it must be above 0")


@dataclass(frozen=True)
class Commutation:
    """One coil under a brush. The defaults are the paper's printed values.

    Parameters
    ----------
    resistance_ohm : float
        Rd, contact resistance of the whole brush.
    inductance_h : float
        Ls, of the coil.
    time_s : float
        Tk.
    current_a : float
        ia, current of one parallel path.
    """

    resistance_ohm: float = 21.3e-3
    inductance_h: float = 121e-6
    time_s: float = 38.4e-3
    current_a: float = 10.0

    def __post_init__(self) -> None:
        _positive(**{name: float(value) for name, value in vars(self).items()})

    @property
    def ratio(self) -> float:
        """A = Rd Tk/Ls: above 1 the current reverses in time."""
        return self.resistance_ohm * self.time_s / self.inductance_h

    @property
    def sparks(self) -> bool:
        """Whether the current is not yet reversed when the segment leaves the brush (A <= 1)."""
        return self.ratio <= 1

    def current(self, tau: ArrayLike) -> FloatArray:
        """Coil current is(t) in ampere at tau = t/Tk in 0 .. 1: from +ia to -ia (Fig. 10)."""
        x = _inside(tau)
        return self.current_a * (1 - 2 * x + x * (1 - x) * self._g(x))

    def trailing_voltage(self, tau: ArrayLike) -> FloatArray:
        """Rx ix at the segment that leaves the brush, in volt: the voltage that ignites an arc."""
        x = _inside(tau)
        return self.resistance_ohm * self.current_a * (2 + x * self._g(x))

    def leading_voltage(self, tau: ArrayLike) -> FloatArray:
        """Ry iy at the segment that comes under the brush, in volt."""
        x = _inside(tau)
        return self.resistance_ohm * self.current_a * (2 - (1 - x) * self._g(x))

    def contact_voltage(self, tau: ArrayLike) -> FloatArray:
        """The paper's uc, eq. (15): the sum of both contact drops in volt (Fig. 11)."""
        return self.trailing_voltage(tau) + self.leading_voltage(tau)

    def coil_voltage(self, tau: ArrayLike) -> FloatArray:
        """-Ls dis/dt in volt: the difference of the two contact drops in the loop of the coil."""
        return self.trailing_voltage(tau) - self.leading_voltage(tau)

    def contact_voltage_rate(self, tau: ArrayLike) -> FloatArray:
        """duc/dt, eq. (16), in V/s.

        From uc = Rd ia (4 - (1 - 2 tau) g) and the differential equation of g.
        """
        x = np.minimum(_inside(tau), 1 - CLOSEST_TO_END)
        g = self._g(x)
        # g (A + 1)/2 = 2F1(1, 2; A + 2; tau) =: F, and F' = 2/(A + 2) 2F1(2, 3; A + 3; tau).
        slope = 4 / ((self.ratio + 1) * (self.ratio + 2)) * hyp2f1(2, 3, self.ratio + 3, x)
        return self.resistance_ohm * self.current_a * (2 * g - (1 - 2 * x) * slope) / self.time_s

    def end_step_v(self) -> float:
        """Contact voltage uc that falls to zero when the segment leaves, in volt; infinite if it sparks."""
        if self.sparks:
            return math.inf
        return 2 * self.resistance_ohm * self.current_a * (1 + self.ratio / (self.ratio - 1))

    def spark(self, arc_voltage_v: float) -> Spark | None:
        """Time of ignition of an arc, and the current that it interrupts.

        Parameters
        ----------
        arc_voltage_v : float
            Least voltage of an arc: 12 to 20 V for carbon on copper (textbook value, not checked against a measurement).

        Returns
        -------
        Spark or None
            None if the trailing edge never reaches that voltage.
        """
        _positive(arc_voltage_v=arc_voltage_v)
        reached = float(self.trailing_voltage(1 - CLOSEST_TO_END))
        if reached < arc_voltage_v:
            return None

        def missing(exponent: float) -> float:
            return float(self.trailing_voltage(1 - 10**exponent)) - arc_voltage_v

        left = 1.0 if missing(0.0) > 0 else 10 ** float(brentq(missing, math.log10(CLOSEST_TO_END), 0.0))
        broken = arc_voltage_v * left / self.resistance_ohm
        return Spark(1 - left, broken, 0.5 * self.inductance_h * broken**2, arc_voltage_v)

    def _g(self, tau: FloatArray) -> FloatArray:
        """g = 2/(A + 1) 2F1(1, 2; A + 2; tau): finite at the end for A > 1, proportional to (1 - tau)^(A - 1) for A < 1."""
        a = self.ratio
        end = 1.0 if a > 1 else 1 - CLOSEST_TO_END
        return 2 / (a + 1) * np.asarray(hyp2f1(1, 2, a + 2, np.minimum(tau, end)), dtype=np.float64)

    def to_dict(self) -> JsonDict:
        """Values with units, SI."""
        return {**vars(self), "ratio": self.ratio, "sparks": self.sparks}


@dataclass(frozen=True)
class Spark:
    """Ignition of an arc.

    Parameters
    ----------
    tau : float
        Time in units of Tk.
    current_a : float
        Current through the trailing edge at that time.
    energy_j : float
        Energy of the coil at that current, 1/2 Ls ix^2.
    voltage_v : float
        Voltage of the arc.
    """

    tau: float
    current_a: float
    energy_j: float
    voltage_v: float


def _inside(tau: ArrayLike) -> FloatArray:
    values: FloatArray = np.asarray(tau, dtype=np.float64)
    if np.any((values < 0) | (values > 1)) or not np.all(np.isfinite(values)):
        raise BadInput("tau = t/Tk must be between 0 and 1")
    return values
