"""What an analyser measures instead of an impedance: the coefficient of waves that a motor reflects, or lets through between two ports.

Each is a fraction of two straight lines in Z, and each is where a network analyser's errors and its noise are simple. With Z0 = 50 ohm:

==================  =====================  ==============================  ====================================
motor               coefficient            error                           relative to Z
==================  =====================  ==============================  ====================================
at one port         G = (Z-Z0)/(Z+Z0)      dG = a + b G + c G^2            2 dG / (1 - G^2)
from port to port   T = 2 Z0/(2 Z0 + Z)    dT = a + b T + c T (1 - T)      -dT / (T (1 - T))
across the line     T = 2 Z/(2 Z + Z0)     dT = a + b T + c T (1 - T)      dT / (T (1 - T))
==================  =====================  ==============================  ====================================

Of a reflection a, b and c are directivity, tracking and match. Of a transmission a is what leaks past the motor, b is transmission tracking,
and c is the sum of what source and load reflect. Derivation: a two-port that reflects R at either side and transmits T, between a source that
reflects g and a load that reflects h, transmits T / ((1 - g R)(1 - h R) - g h T^2); the through connection, with which the analyser is
calibrated, has R = 0 and T = 1. A motor in the line reflects R = 1 - T, and one across it R = T - 1, so that to first order in g and h the
error is T (g + h) R, or c T (1 - T) with c = +-(g + h). Relative to Z this is c alone: the reading is Z times 2 Z0 / (Zs + Zl) in the line, with
the impedances Zs and Zl of source and load, which is exact. The terms are those of the 12-term model (Rytting, "Network analyzer error models and
calibration methods", Hewlett-Packard, 1998), without what is of second order.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from motoremi.arrays import ComplexArray

# Reference impedance of a network analyser, in ohm.
REFERENCE_OHM = 50.0


@dataclass(frozen=True)
class Quantity(ABC):
    """A coefficient c that depends on the impedance by dc/dZ = slope / (Z + pole)^2.

    Attributes
    ----------
    name : str
    standards : str
        What the analyser is calibrated with, for messages.
    pole_ohm, slope_ohm : float
    """

    name: ClassVar[str]
    standards: ClassVar[str]
    pole_ohm: ClassVar[float]
    slope_ohm: ClassVar[float]

    @abstractmethod
    def coefficient_of(self, impedance_ohm: ComplexArray) -> ComplexArray:
        """The coefficient of an impedance."""

    @abstractmethod
    def impedance_of(self, coefficient: ComplexArray) -> ComplexArray:
        """The impedance in ohm that has this coefficient."""

    @abstractmethod
    def relative(self, impedance_ohm: ComplexArray) -> ComplexArray:
        """Relative change of an impedance for one of its coefficient, dlnZ/dc."""

    @abstractmethod
    def error_terms(self, coefficient: ComplexArray) -> tuple[ComplexArray, ...]:
        """What the error terms a, b and c are multiplied by in the error of the coefficient; each of the shape of the coefficient."""


@dataclass(frozen=True)
class Reflection(Quantity):
    """The motor at one port: G = (Z - Z0)/(Z + Z0)."""

    name = "reflection"
    standards = "open, short and load"
    pole_ohm = REFERENCE_OHM
    slope_ohm = 2 * REFERENCE_OHM

    def coefficient_of(self, impedance_ohm: ComplexArray) -> ComplexArray:
        return (impedance_ohm - REFERENCE_OHM) / (impedance_ohm + REFERENCE_OHM)

    def impedance_of(self, coefficient: ComplexArray) -> ComplexArray:
        return REFERENCE_OHM * (1 + coefficient) / (1 - coefficient)

    def relative(self, impedance_ohm: ComplexArray) -> ComplexArray:
        return 2 / (1 - self.coefficient_of(impedance_ohm) ** 2)

    def error_terms(self, coefficient: ComplexArray) -> tuple[ComplexArray, ...]:
        return coefficient**0, coefficient, coefficient**2


@dataclass(frozen=True)
class SeriesThrough(Quantity):
    """The motor in the line, from port to port: T = 2 Z0/(2 Z0 + Z)."""

    name = "series-through"
    standards = "through and isolation"
    pole_ohm = 2 * REFERENCE_OHM
    slope_ohm = -2 * REFERENCE_OHM

    def coefficient_of(self, impedance_ohm: ComplexArray) -> ComplexArray:
        return 2 * REFERENCE_OHM / (2 * REFERENCE_OHM + impedance_ohm)

    def impedance_of(self, coefficient: ComplexArray) -> ComplexArray:
        return 2 * REFERENCE_OHM * (1 - coefficient) / coefficient

    def relative(self, impedance_ohm: ComplexArray) -> ComplexArray:
        coefficient = self.coefficient_of(impedance_ohm)
        return -1 / (coefficient * (1 - coefficient))

    def error_terms(self, coefficient: ComplexArray) -> tuple[ComplexArray, ...]:
        return _of_transmission(coefficient)


@dataclass(frozen=True)
class ShuntThrough(Quantity):
    """The motor across the line, from line to ground: T = 2 Z/(2 Z + Z0)."""

    name = "shunt-through"
    standards = "through and isolation"
    pole_ohm = REFERENCE_OHM / 2
    slope_ohm = REFERENCE_OHM / 2

    def coefficient_of(self, impedance_ohm: ComplexArray) -> ComplexArray:
        return impedance_ohm / (impedance_ohm + REFERENCE_OHM / 2)

    def impedance_of(self, coefficient: ComplexArray) -> ComplexArray:
        return REFERENCE_OHM / 2 * coefficient / (1 - coefficient)

    def relative(self, impedance_ohm: ComplexArray) -> ComplexArray:
        coefficient = self.coefficient_of(impedance_ohm)
        return 1 / (coefficient * (1 - coefficient))

    def error_terms(self, coefficient: ComplexArray) -> tuple[ComplexArray, ...]:
        return _of_transmission(coefficient)


def _of_transmission(coefficient: ComplexArray) -> tuple[ComplexArray, ...]:
    return coefficient**0, coefficient, coefficient * (1 - coefficient)


REFLECTION = Reflection()
SERIES_THROUGH, SHUNT_THROUGH = SeriesThrough(), ShuntThrough()
THROUGH: tuple[Quantity, ...] = (SERIES_THROUGH, SHUNT_THROUGH)


def ports_written(fixture: object) -> str:
    """Connection between two ports as the header of a file writes it, `series-through` or `shunt-through`; empty for anything else."""
    written = str(fixture).strip().lower()
    return written if any(written == quantity.name for quantity in THROUGH) else ""
