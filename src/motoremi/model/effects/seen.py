"""What a reader of start values sees of the sweeps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.model.rational import Rational, rational_fit


@dataclass(frozen=True, eq=False)
class Seen:
    """The sweeps, mean of their repeats, and what the model at hand makes of them.

    Parameters
    ----------
    frequency_hz, short_ohm : ndarray, shape (n,), optional
        The short-circuit sweep.
    frame_hz, open_ohm, through_ohm : ndarray, shape (m,), optional
        The open-circuit sweep, and the winding's share of it.
    model_ohm : ndarray, shape (n,), optional
        What the model gives in the short-circuit sweep.
    parameters : mapping
        The model's, SI units.
    place : str
        Where the effect that is started attaches.
    """

    frequency_hz: FloatArray | None = None
    short_ohm: ComplexArray | None = None
    frame_hz: FloatArray | None = None
    open_ohm: ComplexArray | None = None
    through_ohm: ComplexArray | None = None
    model_ohm: ComplexArray | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)
    place: str = ""

    @property
    def lowest_inductance_h(self) -> float | None:
        """The inductance that the short-circuit sweep shows at its low end; None where it shows none."""
        if self.frequency_hz is None or self.short_ohm is None:
            return None
        henry = float(self.short_ohm.imag[0] / (2 * np.pi * self.frequency_hz[0]))
        return henry if henry > 0 else None

    @cached_property
    def resonating(self) -> Rational | None:
        """The short-circuit sweep of a winding with two resonances."""
        return self.short_rational((3, 4))

    @cached_property
    def relaxing(self) -> Rational | None:
        """That of a winding with a resonance and a corner."""
        return self.short_rational((2, 3))

    @cached_property
    def choked(self) -> Rational | None:
        """That of a winding with a resonance, and an inductance with a corner in series."""
        return self.short_rational((4, 3))

    @cached_property
    def frame(self) -> Rational | None:
        """s times the difference of the sweeps, for a frame with one more time constant."""
        if self.frame_hz is None or self.open_ohm is None or self.through_ohm is None:
            return None
        omega = 2 * np.pi * self.frame_hz
        weight = 1 / (omega * np.hypot(np.abs(self.open_ohm), np.abs(self.through_ohm)))
        return rational_fit(self.frame_hz, 1j * omega * (self.open_ohm - self.through_ohm), weight, (3, 3))

    def short_rational(self, degrees: tuple[int, int]) -> Rational | None:
        """A rational fit of the short-circuit sweep; None without one."""
        if self.frequency_hz is None or self.short_ohm is None:
            return None
        return rational_fit(self.frequency_hz, self.short_ohm, 1 / np.abs(self.short_ohm), degrees)
