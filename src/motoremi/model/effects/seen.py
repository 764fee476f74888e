"""The data from which start values of an effect are computed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.model.rational import Rational, rational_fit

# If a rational function has a negative resistance, this one is used instead.
LEAST_OHM = 1e-3


def winding_of(b0: float, b1: float, a2: float, middle: float) -> dict[str, float]:
    """Ra, La and Ca of the winding with the impedance (b0 + b1 p)/(1 + a1 p + a2 p^2), p being s over `middle`."""
    return {"Ra": max(float(b0), LEAST_OHM), "La": float(b1 / middle), "Ca": float(a2 / b1 / middle)}


class Frame(NamedTuple):
    """The impedance of the path to the frame, and its error up to a common factor: both sweeps have the same relative error."""

    frequency_hz: FloatArray
    impedance_ohm: ComplexArray
    error_ohm: FloatArray

    def at(self, points: NDArray[np.intp] | slice) -> Frame:
        """Some of its points."""
        return Frame(self.frequency_hz[points], self.impedance_ohm[points], self.error_ohm[points])


class Across(NamedTuple):
    """A sweep beside a model's impedance, and the relative decrease of that for each siemens across the winding, in ohm."""

    frequency_hz: FloatArray
    measured_ohm: ComplexArray
    model_ohm: ComplexArray
    decrease_ohm: ComplexArray


@dataclass(frozen=True, eq=False)
class Seen:
    """The mean sweeps, and the model without the effect.

    Parameters
    ----------
    frequency_hz, short_ohm : ndarray, shape (n,), optional
        The short-circuit sweep.
    frame_hz, open_ohm, through_ohm : ndarray, shape (m,), optional
        The open-circuit sweep, and the impedance of the winding in it.
    across : Across, optional
        What an admittance across the winding changes in the model without the effect.
    parameters : mapping
        The model's parameters, SI units.
    place : str
        Place of the effect for which start values are computed.
    """

    frequency_hz: FloatArray | None = None
    short_ohm: ComplexArray | None = None
    frame_hz: FloatArray | None = None
    open_ohm: ComplexArray | None = None
    through_ohm: ComplexArray | None = None
    across: Across | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)
    place: str = ""

    @property
    def frame(self) -> Frame | None:
        """The path to the frame: the difference of the two sweeps; None without one of them."""
        if self.frame_hz is None or self.open_ohm is None or self.through_ohm is None:
            return None
        return Frame(self.frame_hz, self.open_ohm - self.through_ohm, np.hypot(np.abs(self.open_ohm), np.abs(self.through_ohm)))

    @property
    def lowest_inductance_h(self) -> float | None:
        """The inductance at the low end of the short-circuit sweep; None if it is not inductive there."""
        if self.frequency_hz is None or self.short_ohm is None:
            return None
        henry = float(self.short_ohm.imag[0] / (2 * np.pi * self.frequency_hz[0]))
        return henry if henry > 0 else None

    @property
    def first_resonance_hz(self) -> float | None:
        """Where the short-circuit sweep turns from inductive to capacitive for the first time; None if it does not."""
        if self.frequency_hz is None or self.short_ohm is None:
            return None
        falling = np.flatnonzero((self.short_ohm.imag[1:] <= 0) & (self.short_ohm.imag[:-1] > 0))
        return float(self.frequency_hz[falling[0] + 1]) if falling.size else None

    @property
    def frame_capacitance_f(self) -> float | None:
        """The capacitance to the frame at the low end of the open-circuit sweep; None if it is not capacitive there."""
        frame = self.frame
        if frame is None:
            return None
        reactance_ohm = float(frame.impedance_ohm.imag[0])
        return -1 / (2 * np.pi * float(frame.frequency_hz[0]) * reactance_ohm) if reactance_ohm < 0 else None

    @cached_property
    def resonating(self) -> Rational | None:
        """Rational fit of the short-circuit sweep with the degrees of a winding with two resonances."""
        return self.short_rational((3, 4))

    @cached_property
    def relaxing(self) -> Rational | None:
        """The same for a winding with one resonance and one relaxation."""
        return self.short_rational((2, 3))

    @cached_property
    def behind_lead(self) -> Rational | None:
        """The same for a winding with one resonance, in series with an inductance."""
        return self.short_rational((3, 2))

    @cached_property
    def choked(self) -> Rational | None:
        """The same for a winding with one resonance, in series with an inductance with one relaxation."""
        return self.short_rational((4, 3))

    @cached_property
    def film(self) -> Rational | None:
        """Rational fit of s times the difference of the sweeps, with the degrees of a frame with one more time constant."""
        return self._frame_rational((3, 3), 1)

    @cached_property
    def leaking_frame(self) -> Rational | None:
        """Rational fit of the difference of the sweeps, with the degrees of a frame through which direct current flows."""
        return self._frame_rational((2, 3), 0)

    def _frame_rational(self, degrees: tuple[int, int], power: int) -> Rational | None:
        """A rational fit of a power of s times the difference of the sweeps; None without one of them."""
        frame = self.frame
        if frame is None:
            return None
        factor = (2j * np.pi * frame.frequency_hz) ** power
        return rational_fit(frame.frequency_hz, factor * frame.impedance_ohm, 1 / (np.abs(factor) * frame.error_ohm), degrees)

    def short_rational(self, degrees: tuple[int, int]) -> Rational | None:
        """A rational fit of the short-circuit sweep; None without one."""
        if self.frequency_hz is None or self.short_ohm is None:
            return None
        return rational_fit(self.frequency_hz, self.short_ohm, 1 / np.abs(self.short_ohm), degrees)
