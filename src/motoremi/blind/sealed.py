"""Sealed motors for the scoreboard of investigations: hidden effects, first measurements, and the bench that measures on request."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, TypeAlias, get_args

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.blind.cases import BANDWIDTH_FACTOR, COPPER, POINTS, REPEATS, SPAN_HZ, catalogue_kinds, drawn_together, shown
from motoremi.blind.disturbances import ReflectionAnalyser, behind_fixture
from motoremi.data.analyser import find_analyser
from motoremi.data.conditions import VALUES, Condition, SingleValue
from motoremi.data.measurement import Measurement
from motoremi.data.sweep import TERMINATIONS, ImpedanceSweep, Termination
from motoremi.errors import BadInput
from motoremi.fitting.fit import fit
from motoremi.model.motor import dc_motor
from motoremi.simulate.analyser_errors import SimulatedAnalyser
from motoremi.simulate.arrangement import Analyser, Arrangement
from motoremi.simulate.hidden import log_uniform, uniform
from motoremi.simulate.hidden_effects import OUTSIDE_EFFECTS, split_effects
from motoremi.simulate.operator import MISTAKEN, Mistake, Operator
from motoremi.simulate.simulated_motor import SimulatedMotor
from motoremi.simulate.specimen import Specimen

Start: TypeAlias = Literal["one short sweep", "uncompensated NanoVNA", "two effects"]
STARTS: tuple[Start, ...] = get_args(Start)
# Share of the motors with an effect outside the catalogue.
OUTSIDE = 0.1
# Ranges of the fixture of a handheld analyser, and of its three error terms in dB.
_FIXTURE = {"resistance_ohm": (20e-3, 300e-3), "inductance_h": (5e-9, 40e-9), "capacitance_f": (0.5e-12, 5e-12)}
_ERROR_TERMS_DB = (-60.0, -54.0)
# Largest span of a wide sweep.
_WIDE_HZ = (400.0, 60e6)


@dataclass(frozen=True)
class Evidence:
    """All measurements of a motor so far.

    Parameters
    ----------
    sweeps : tuple of ImpedanceSweep
        With those under a condition.
    values : tuple of SingleValue
    """

    sweeps: tuple[ImpedanceSweep, ...]
    values: tuple[SingleValue, ...] = ()

    def plus(self, other: Evidence) -> Evidence:
        """The evidence with more measurements."""
        return Evidence((*self.sweeps, *other.sweeps), (*self.values, *other.values))


@dataclass(frozen=True)
class Asked:
    """A requested measurement.

    Parameters
    ----------
    id : str
        Identifier on the menu.
    condition : Condition, optional
        The requested condition; None for further sweeps of the motor as it is, and for a single value.
    terminations : tuple of str
        The requested sweeps; empty for a single value.
    """

    id: str
    condition: Condition | None = None
    terminations: tuple[Termination, ...] = TERMINATIONS


@dataclass(frozen=True)
class HandheldAnalyser:
    """A handheld network analyser with a fixture that is not compensated at first.

    Parameters
    ----------
    seed : int
    compensated : bool
    purpose : str
        Name of the random stream of the noise.
    """

    seed: int
    compensated: bool = False
    purpose: str = ""

    def measure(
        self,
        termination: Termination,
        frequency_hz: FloatArray,
        true_impedance: ComplexArray,
        connection: int = 0,
        bandwidth_factor: int = 5,
        averages: int = 1,
    ) -> ComplexArray:
        """One sweep, in ohm; the bandwidth cannot be changed."""
        seen = true_impedance
        if not self.compensated:
            rng = self._rng("fixture")
            seen = behind_fixture(
                seen,
                frequency_hz,
                log_uniform(rng, *_FIXTURE["resistance_ohm"]),
                uniform(rng, *_FIXTURE["inductance_h"]),
                uniform(rng, *_FIXTURE["capacitance_f"]),
            )
        rng = self._rng("errors")
        name = f"noise {self.purpose} {termination} {connection}"
        noise = self._noise.setdefault(name, self._rng(name))
        return ReflectionAnalyser(rng, 10 ** (uniform(rng, *_ERROR_TERMS_DB) / 20), noise).measure(frequency_hz, seen)

    @cached_property
    def _noise(self) -> dict[str, np.random.Generator]:
        """The random stream of each connection's noise: a repeat continues it."""
        return {}

    def without(self, faults: Sequence[str], *, compensated: bool = False) -> HandheldAnalyser:
        """The analyser after compensation, if it was done; it has no other faults."""
        return replace(self, compensated=self.compensated or compensated)

    def with_noise(self, purpose: str) -> HandheldAnalyser:
        """The analyser with a separate stream of noise."""
        return replace(self, purpose=purpose)

    def _rng(self, purpose: str) -> np.random.Generator:
        # The word is part of the seed: another one would draw other analysers.
        return np.random.default_rng([self.seed, zlib.crc32(f"pocket {purpose}".encode())])


@dataclass(frozen=True)
class Given:
    """The result of a request.

    Parameters
    ----------
    evidence : Evidence
    mistake : Mistake, optional
        The operator's mistake, which is known only to the scoring.
    """

    evidence: Evidence
    mistake: Mistake | None = None


@dataclass(frozen=True)
class Sealed:
    """One sealed motor and its first measurements.

    Parameters
    ----------
    seed, index : int
        They determine the case.
    start : str
        One of `STARTS`.
    hidden : tuple of str
        Identifiers as in the catalogue; `outside-...` for effects that are not in it.
    motor_seed : int
    mistaken : float
        Probability of a mistake of the operator.
    """

    seed: int
    index: int
    start: Start
    hidden: tuple[str, ...]
    motor_seed: int
    mistaken: float = MISTAKEN

    @property
    def declared(self) -> str:
        """The analyser, as the sweeps name it."""
        return "nanovna" if self.start == "uncompensated NanoVNA" else "4294a"

    @cached_property
    def specimen(self) -> Specimen:
        """The motor with its responses to conditions."""
        in_motor, _ = split_effects(self.hidden)
        return Specimen(SimulatedMotor.random(self.motor_seed, in_motor), self.motor_seed)

    @cached_property
    def analyser(self) -> SimulatedAnalyser | HandheldAnalyser:
        """The analyser that measures it."""
        _, faults = split_effects(self.hidden)
        return HandheldAnalyser(self.motor_seed + 1) if self.declared == "nanovna" else SimulatedAnalyser(self.motor_seed + 1, faults=faults)

    def begin(self) -> Evidence:
        """The measurements before any request."""
        terminations: tuple[Termination, ...] = ("short",) if self.start == "one short sweep" else TERMINATIONS
        return self._measured(Arrangement(self.specimen, None, terminations), "begin", 0, REPEATS if self.start == "two effects" else 1)

    def give(self, asked: Asked, turn: int = 0) -> Given:
        """The result when this is requested for the `turn`-th time (from 0); it does not depend on other requests."""
        operator = Operator(self.motor_seed + 2, self.mistaken)
        arrangement = Arrangement.made_by(operator, self.specimen, asked.condition, asked.terminations, asked.id, turn)
        if asked.id in VALUES:
            return Given(Evidence((), (arrangement.single_value(asked.id),)), arrangement.mistake)
        return Given(self._measured(arrangement, asked.id, 2 + zlib.crc32(f"{asked.id} {turn}".encode()) % 2**20, 1), arrangement.mistake)

    def detectable(self) -> bool:
        """Whether each hidden effect shows in the sweeps of both terminations, measured three times."""
        both = Measurement.of(self._measured(Arrangement(self.specimen), "begin", 0, REPEATS).sweeps)
        return shown(fit(dc_motor(), both), self.hidden) == self.hidden

    def _measured(self, arrangement: Arrangement, purpose: str, connection: int, repeats: int) -> Evidence:
        span = SPAN_HZ
        if arrangement.condition is not None and arrangement.condition.id == "wide-sweep":
            low, high = find_analyser(self.declared).span_hz
            span = max(low, _WIDE_HZ[0]), min(high, _WIDE_HZ[1])
        analyser: Analyser = self.analyser.with_noise(f"{purpose} {arrangement.turn}")
        sweeps = arrangement.sweeps(analyser, np.geomspace(*span, POINTS), connection, repeats, BANDWIDTH_FACTOR)
        return Evidence(tuple(sweep.with_metadata(analyser=self.declared) for sweep in sweeps))


def draw_sealed(seed: int, index: int) -> Sealed:
    """The motor with this number; the starts follow each other cyclically."""
    if seed < 0 or index < 0:
        raise BadInput(f"seed {seed} and index {index} must be 0 or above")
    rng = np.random.default_rng([seed, index, zlib.crc32(b"investigation")])
    start = STARTS[index % len(STARTS)]
    kinds = catalogue_kinds()
    if rng.random() < OUTSIDE:
        return Sealed(seed, index, start, (str(rng.choice(OUTSIDE_EFFECTS)),), int(rng.integers(1, 2**31 - 3)))
    # Not two faults of the analyser at once, and none together with an uncompensated fixture.
    known = kinds["one"] + (kinds["instrument"] if start == "one short sweep" else [])
    hidden = drawn_together(rng, known, 2 if start == "two effects" else 1, COPPER)
    return Sealed(seed, index, start, hidden, int(rng.integers(1, 2**31 - 3)))


def draw_sealed_many(seed: int, count: int) -> list[Sealed]:
    """The first `count` motors of a seed."""
    if count < 1:
        raise BadInput(f"{count} motors: ask for at least one")
    return [draw_sealed(seed, index) for index in range(count)]
