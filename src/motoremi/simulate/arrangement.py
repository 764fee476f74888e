"""The set-up on the simulated bench for a requested measurement: motor, condition, analyser, and the operator's mistakes."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, Self

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.conditions import STANDARDS, VALUES, Condition, SingleValue
from motoremi.data.sweep import TERMINATIONS, ImpedanceSweep, Termination
from motoremi.simulate.operator import Mistake, Operator
from motoremi.simulate.response import SILENT
from motoremi.simulate.specimen import Specimen

# Faults of the analyser that are removed by what the operator does for a measurement.
REMOVED_FAULTS: Mapping[str, tuple[str, ...]] = {
    "repeat-compensation": ("open-residual", "short-residual", "gain-error", "cable-delay"),
    "contacts-cleaned": ("contact-resistance",),
    "sweep-downwards": ("range-step",),
}
# Errors of other meters, relative and absolute, and the highest resistance that an insulation tester shows.
_METERS: Mapping[str, tuple[float, float]] = {
    "dc-resistance": (2e-3, 1e-3),
    "insulation-resistance": (0.05, 0.0),
    "capacitance-1khz": (3e-3, 0.0),
    "tan-delta-1khz": (0.02, 3e-4),
    "lead-length": (0.03, 2e-3),
}
_HIGHEST_INSULATION_OHM = 1e10
_TWO_WIRES_OHM = (0.1, 0.4)
_OTHER_STANDARD = {"fixture-open": "fixture-short", "fixture-short": "fixture-open"}


class Analyser(Protocol):
    """Interface of a simulated analyser, such as `SimulatedAnalyser`."""

    def measure(
        self,
        termination: Termination,
        frequency_hz: FloatArray,
        true_impedance: ComplexArray,
        connection: int = 0,
        bandwidth_factor: int = 5,
        averages: int = 1,
    ) -> ComplexArray:
        """One sweep, in ohm."""
        ...

    def without(self, faults: Sequence[str], *, compensated: bool = False) -> Self:
        """The same analyser without some faults."""
        ...


@dataclass(frozen=True)
class Arrangement:
    """A requested measurement as the operator set it up.

    Parameters
    ----------
    specimen : Specimen
    condition : Condition or None
        The requested condition; None for the motor as it is.
    terminations : tuple of str
        The requested sweeps.
    turn : int
        Number of earlier requests for the same measurement.
    mistake : Mistake, optional
        The operator's deviation from the request.
    """

    specimen: Specimen
    condition: Condition | None = None
    terminations: tuple[Termination, ...] = TERMINATIONS
    turn: int = 0
    mistake: Mistake | None = None

    @classmethod
    def made_by(
        cls, operator: Operator, specimen: Specimen, condition: Condition | None, terminations: tuple[Termination, ...], name: str, turn: int = 0
    ) -> Arrangement:
        """The set-up that an operator makes for a request; `name` is the identifier of the measurement."""
        return cls(specimen, condition, terminations, turn, operator.mistake(name, turn))

    @property
    def name(self) -> str:
        """Identifier of the condition that was actually set up; empty for none."""
        asked = "" if self.condition is None else self.condition.id
        if self.mistake is None:
            return asked
        if self.mistake.kind == "nothing done":
            return ""
        return _OTHER_STANDARD.get(asked, "fixture-open") if self.mistake.kind == "other standard" else asked

    @property
    def on_the_fixture(self) -> bool:
        """Whether a standard is connected instead of the motor."""
        return self.name in STANDARDS

    def impedance(self, termination: Termination, frequency_hz: FloatArray) -> ComplexArray:
        """The true impedance in the sweep of that name, in ohm."""
        value = None if self.condition is None else self.condition.value
        return self.specimen.impedance(self._true_termination(termination), frequency_hz, self.name, value, self.turn)

    def _true_termination(self, termination: Termination) -> Termination:
        if self.mistake is None or self.mistake.kind != "other termination":
            return termination
        meant = self.terminations[self.mistake.of % len(self.terminations)]
        return TERMINATIONS[1 - TERMINATIONS.index(termination)] if termination == meant else termination

    def analyser(self, before: Any) -> Any:
        """The analyser, an `Analyser`, without the faults that this measurement removes."""
        faults = REMOVED_FAULTS.get(self.name, ())
        if faults and self._rng(self.name).random() < SILENT and self.name != "repeat-compensation":
            return before
        return before.without(faults, compensated=self.name == "repeat-compensation") if faults else before

    def sweeps(
        self, analyser: Analyser, frequency_hz: FloatArray, connection: int, repeats: int = 1, bandwidth_factor: int = 3
    ) -> list[ImpedanceSweep]:
        """The requested sweeps; each termination is a separate connection, numbered from `connection`.

        Parameters
        ----------
        analyser : Analyser
            The analyser before the measurement.
        frequency_hz : ndarray, shape (n,)
        connection : int
        repeats : int
        bandwidth_factor : int
            1 (fastest) to 5 (best).
        """
        now: Analyser = self.analyser(analyser)
        measured = []
        for number, termination in enumerate(self.terminations, start=connection):
            true = self.impedance(termination, frequency_hz)
            for _ in range(repeats):
                seen = now.measure(self._true_termination(termination), frequency_hz, true, number, bandwidth_factor)
                measured.append(ImpedanceSweep(termination, frequency_hz, seen, metadata={"connection": number}, condition=self.condition))
        return measured

    def single_value(self, name: str) -> SingleValue:
        """The reading of another meter."""
        quantity, (relative, absolute), rng = VALUES[name], _METERS[name], self._rng(f"{name} {self.turn}")
        kind = None if self.mistake is None else self.mistake.kind
        true = self.specimen.single_value("dc-resistance" if kind == "terminals" else name)
        if kind == "two wires":
            true += float(rng.uniform(*_TWO_WIRES_OHM))
        read = true * (1 + relative * float(rng.standard_normal())) + absolute * float(rng.standard_normal())
        if name == "insulation-resistance":
            read = min(read, _HIGHEST_INSULATION_OHM)
        read = max(read, quantity.setting.low)
        sigma = quantity.relative * read + quantity.absolute
        return SingleValue(name, read, quantity.setting.unit, min(sigma, read / 2))

    def _rng(self, purpose: str) -> np.random.Generator:
        return np.random.default_rng([self.specimen.seed, zlib.crc32(f"arrangement {purpose}".encode())])
