"""Hard blind cases: simulated motors that are measured with one departure from the protocol each, or hide something harder."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TypeAlias

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.blind.cases import BANDWIDTH_FACTOR, COPPER, POINTS, REPEATS, SPAN_HZ, catalogue_kinds, drawn_together
from motoremi.blind.disturbances import (
    DoubledAnalyser,
    ReflectionAnalyser,
    behind_fixture,
    changed,
    flicker_noise,
    point_errors,
    station_points,
    warming,
)
from motoremi.blind.weak import strength_for, weakened
from motoremi.data.sweep import TERMINATIONS, ImpedanceSweep, Termination
from motoremi.errors import BadInput
from motoremi.simulate.analyser_errors import SimulatedAnalyser, noise_sd_ohm
from motoremi.simulate.hidden import ELEMENTS, log_uniform, uniform
from motoremi.simulate.hidden_effects import OUTSIDE_EFFECTS
from motoremi.simulate.simulated_motor import SimulatedMotor
from motoremi.simulate.uncatalogued import UNCATALOGUED_EFFECTS, UncataloguedMotor

Generator: TypeAlias = np.random.Generator
# Termination, number of the repeat, frequencies, impedance so far -> impedance.
Change: TypeAlias = Callable[[Termination, int, FloatArray, ComplexArray], ComplexArray]

# Residuals of a fixture twice as large as specified after compensation: ohm, henry, farad.
_DOUBLED_FIXTURE = (20e-3, 6e-9, 0.2e-12)


def _same(termination: Termination, repeat: int, frequency_hz: FloatArray, impedance: ComplexArray) -> ComplexArray:
    return impedance


@dataclass
class _Bench:
    """The set-up of one case, which a departure changes. Each part has a separate random stream."""

    motor_seed: int
    motor: SimulatedMotor | UncataloguedMotor
    analyser: SimulatedAnalyser
    grids: dict[Termination, FloatArray] = field(default_factory=lambda: {name: np.geomspace(*SPAN_HZ, POINTS) for name in TERMINATIONS})
    repeats: int = REPEATS
    declared: str = "4294a"
    # The motor in each termination, if it changes between the sweeps.
    other: dict[Termination, SimulatedMotor] = field(default_factory=dict)
    # Impedance of a motor that changes from point to point.
    moving: Callable[[Termination, int, FloatArray], ComplexArray] | None = None
    handheld: ReflectionAnalyser | None = None
    # Changes of the impedance between motor and analyser, and of the readings.
    before: Change = _same
    after: Change = _same
    # Lowest and highest factor on the elements during the measurement.
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def plain(self) -> SimulatedMotor:
        return self.motor.motor if isinstance(self.motor, UncataloguedMotor) else self.motor

    def sweeps(self) -> list[ImpedanceSweep]:
        measured = []
        for termination, frequency in self.grids.items():
            still = self.other.get(termination, self.motor).impedance(termination, frequency) if self.moving is None else None
            for repeat in range(self.repeats):
                true = still if self.moving is None else self.moving(termination, repeat, frequency)
                assert true is not None
                read = self._read(termination, frequency, self.before(termination, repeat, frequency, true))
                seen = self.after(termination, repeat, frequency, read)
                measured.append(ImpedanceSweep(termination, frequency, seen, metadata={"analyser": self.declared}))
        return measured

    def _read(self, termination: Termination, frequency: FloatArray, impedance: ComplexArray) -> ComplexArray:
        if self.handheld is not None:
            return self.handheld.measure(frequency, impedance)
        connection = TERMINATIONS.index(termination)
        return self.analyser.measure(termination, frequency, impedance, connection=connection, bandwidth_factor=BANDWIDTH_FACTOR)

    def grid(self, frequency_hz: FloatArray) -> None:
        self.grids = dict.fromkeys(TERMINATIONS, frequency_hz)


def _one_repeat(bench: _Bench, rng: Generator) -> None:
    bench.repeats = 1


def _few_points(bench: _Bench, rng: Generator) -> None:
    bench.grid(np.geomspace(*SPAN_HZ, int(rng.choice([51, 101]))))


def _other_band(bench: _Bench, rng: Generator) -> None:
    spans = ((40e3, 10e6), (500e3, 60e6), (20e3, 20e6), (300e3, 30e6))
    bench.grid(np.geomspace(*spans[int(rng.integers(len(spans)))], POINTS))


def _linear_grid(bench: _Bench, rng: Generator) -> None:
    bench.grid(np.linspace(*SPAN_HZ, POINTS))


def _one_termination(bench: _Bench, rng: Generator) -> None:
    kept = TERMINATIONS[int(rng.integers(2))]
    bench.grids = {kept: bench.grids[kept]}


def _partial_overlap(bench: _Bench, rng: Generator) -> None:
    low, high = log_uniform(rng, 6e5, 2e6), log_uniform(rng, 5e6, 1.2e7)
    lower, upper = np.geomspace(SPAN_HZ[0], high, POINTS), np.geomspace(low, SPAN_HZ[1], POINTS)
    first = int(rng.integers(2))
    bench.grids = {TERMINATIONS[0]: (lower, upper)[first], TERMINATIONS[1]: (upper, lower)[first]}


def _outliers(bench: _Bench, rng: Generator) -> None:
    count = int(rng.integers(2, 6))
    where = [(TERMINATIONS[int(rng.integers(2))], int(rng.integers(bench.repeats)), int(rng.integers(POINTS))) for _ in range(count)]
    errors = [log_uniform(rng, 0.03, 0.5) * np.exp(2j * np.pi * rng.random()) for _ in where]

    def after(termination: Termination, repeat: int, frequency_hz: FloatArray, impedance: ComplexArray) -> ComplexArray:
        disturbed = impedance.copy()
        for (which, number, point), error in zip(where, errors, strict=True):
            if (which, number) == (termination, repeat):
                disturbed[point] *= 1 + error
        return disturbed

    bench.after = after


def _leads_apart(bench: _Bench, rng: Generator) -> None:
    longer, henry = TERMINATIONS[int(rng.integers(2))], uniform(rng, 5e-9, 30e-9)

    def before(termination: Termination, repeat: int, frequency_hz: FloatArray, impedance: ComplexArray) -> ComplexArray:
        return impedance + 2j * np.pi * frequency_hz * henry if termination == longer else impedance

    bench.before = before


def _capacitance_apart(bench: _Bench, rng: Generator) -> None:
    factor = 1 + uniform(rng, 0.01, 0.03) * (1 if rng.random() < 0.5 else -1)
    bench.other["open"] = changed(bench.plain, {"Ca": factor})
    bench.ranges = {"Ca": (min(1.0, factor), max(1.0, factor))}


def _handheld_analyser(rng: Generator) -> ReflectionAnalyser:
    return ReflectionAnalyser(rng, 10 ** (uniform(rng, -60.0, -54.0) / 20))


def _vna_reflection(bench: _Bench, rng: Generator) -> None:
    bench.handheld, bench.declared = _handheld_analyser(rng), "nanovna"


def _vna_not_compensated(bench: _Bench, rng: Generator) -> None:
    ohm, henry, farad = log_uniform(rng, 20e-3, 300e-3), uniform(rng, 5e-9, 40e-9), uniform(rng, 0.5e-12, 5e-12)

    def before(termination: Termination, repeat: int, frequency_hz: FloatArray, impedance: ComplexArray) -> ComplexArray:
        return behind_fixture(impedance, frequency_hz, ohm, henry, farad)

    bench.before, bench.handheld, bench.declared = before, _handheld_analyser(rng), "nanovna"


def _flicker(bench: _Bench, rng: Generator) -> None:
    size = log_uniform(rng, 3.0, 15.0)
    series = {name: (flicker_noise(rng, bench.repeats * POINTS), flicker_noise(rng, bench.repeats * POINTS)) for name in TERMINATIONS}

    def after(termination: Termination, repeat: int, frequency_hz: FloatArray, impedance: ComplexArray) -> ComplexArray:
        here = slice(repeat * POINTS, (repeat + 1) * POINTS)
        real, imaginary = series[termination]
        return impedance + size * noise_sd_ohm(frequency_hz, impedance, BANDWIDTH_FACTOR) * (real[here] + 1j * imaginary[here])

    bench.after = after


def _warming(bench: _Bench, rng: Generator) -> None:
    rises, quickness = {"Ra": uniform(rng, 0.01, 0.03), "Ca": 5e-3}, log_uniform(rng, 0.3, 3.0)
    passes, motor = len(TERMINATIONS) * bench.repeats, bench.plain

    def moving(termination: Termination, repeat: int, frequency_hz: FloatArray) -> ComplexArray:
        number = TERMINATIONS.index(termination) * bench.repeats + repeat
        time = (number + np.linspace(0, 1, frequency_hz.size)) / passes
        return warming(motor, termination, frequency_hz, (1 - np.exp(-quickness * time)) / (1 - np.exp(-quickness)), rises)

    bench.moving = moving
    bench.ranges = {name: (1.0, 1 + rise) for name, rise in rises.items()}


def _stations(bench: _Bench, rng: Generator) -> None:
    steady = bool(rng.random() < 0.5)
    points = station_points(rng, bench.grids["short"])
    errors = {
        (name, repeat): point_errors(rng, points, POINTS, 5.0, 100.0) for name in TERMINATIONS for repeat in range(1 if steady else bench.repeats)
    }

    def after(termination: Termination, repeat: int, frequency_hz: FloatArray, impedance: ComplexArray) -> ComplexArray:
        error = errors[termination, 0 if steady else repeat]
        return impedance + noise_sd_ohm(frequency_hz, impedance, BANDWIDTH_FACTOR) * error

    bench.after = after


def _declared_wrongly(bench: _Bench, rng: Generator) -> None:
    if rng.random() < 0.5:
        bench.handheld, bench.declared = _handheld_analyser(rng), "4294a"
    else:
        bench.declared = "none"


def _doubled_errors(bench: _Bench, rng: Generator) -> None:
    bench.analyser = DoubledAnalyser(bench.analyser.seed)
    left = {name: rng.standard_normal(3) * _DOUBLED_FIXTURE for name in TERMINATIONS}

    def after(termination: Termination, repeat: int, frequency_hz: FloatArray, impedance: ComplexArray) -> ComplexArray:
        return behind_fixture(impedance, frequency_hz, *(float(value) for value in left[termination]))

    bench.after = after


def _weak_effect(bench: _Bench, rng: Generator) -> None:
    floors, names = uniform(rng, 1.0, 3.0), tuple(effect.name for effect in bench.plain.effects)
    if names:
        bench.motor = weakened(bench.plain, _strength(bench.motor_seed, names, floors))


def _nothing(bench: _Bench, rng: Generator) -> None:
    """No departure: the hidden effects make the case hard."""


@lru_cache(maxsize=256)
def _strength(motor_seed: int, hidden: tuple[str, ...], floors: float) -> float:
    return strength_for(SimulatedMotor.random(motor_seed, hidden), floors, np.geomspace(*SPAN_HZ, POINTS), BANDWIDTH_FACTOR, REPEATS)


DEPARTURES: Mapping[str, Callable[[_Bench, Generator], None]] = {
    "one-repeat": _one_repeat,
    "few-points": _few_points,
    "other-band": _other_band,
    "linear-grid": _linear_grid,
    "one-termination": _one_termination,
    "partial-overlap": _partial_overlap,
    "outliers": _outliers,
    "leads-apart": _leads_apart,
    "capacitance-apart": _capacitance_apart,
    "vna-reflection": _vna_reflection,
    "vna-not-compensated": _vna_not_compensated,
    "flicker": _flicker,
    "warming": _warming,
    "stations": _stations,
    "declared-wrongly": _declared_wrongly,
    "doubled-errors": _doubled_errors,
    "weak-effect": _weak_effect,
    "outside": _nothing,
    "three": _nothing,
}
# Findings that name a departure correctly.
FINDINGS: Mapping[str, tuple[str, ...]] = {
    "flicker": ("correlated-noise", "drift"),
    "warming": ("drift", "sweeps-disagree", "correlated-noise"),
    "stations": ("interference",),
    "vna-not-compensated": ("not-compensated",),
    "declared-wrongly": ("not-as-declared", "beyond-specification"),
    "doubled-errors": ("beyond-specification", "not-as-declared"),
    "leads-apart": ("sweeps-disagree",),
    "capacitance-apart": ("sweeps-disagree",),
}


@dataclass(frozen=True)
class HardCase:
    """One motor, measured with one departure from the protocol.

    Parameters
    ----------
    seed, index : int
        They determine the case.
    departure : str
        Key of `DEPARTURES`.
    hidden : tuple of str
        Identifiers as in the catalogue; `outside-...` for effects that are not in it.
    motor_seed : int
    """

    seed: int
    index: int
    departure: str
    hidden: tuple[str, ...]
    motor_seed: int

    @property
    def accepted(self) -> tuple[str, ...]:
        """Ids of the findings that name the departure correctly; none if the data are not disturbed."""
        # With a core that depends on the level the two sweeps contradict each other.
        by_effect = ("sweeps-disagree",) if "outside-level-dependent-core" in self.hidden else ()
        return (*FINDINGS.get(self.departure, ()), *by_effect)

    def sweeps(self, hidden: Sequence[str] | None = None) -> list[ImpedanceSweep]:
        """The measured sweeps; `hidden` replaces the hidden effects, everything else is the same."""
        return self._bench(hidden).sweeps()

    def motor(self, hidden: Sequence[str] | None = None) -> SimulatedMotor | UncataloguedMotor:
        """The motor with its hidden effects at their strength, at the beginning of the measurement."""
        return self._bench(hidden).motor

    def truth(self) -> dict[str, float]:
        """The seven elements of the motor at the beginning of the measurement, SI units."""
        return dict(self.motor().elements)

    def ranges(self) -> dict[str, tuple[float, float]]:
        """Lowest and highest value of each element during the measurement, SI units."""
        bench = self._bench()
        factors = {name: bench.ranges.get(name, (1.0, 1.0)) for name in ELEMENTS}
        return {name: (value * factors[name][0], value * factors[name][1]) for name, value in bench.plain.elements.items()}

    def _bench(self, hidden: Sequence[str] | None = None) -> _Bench:
        names = self.hidden if hidden is None else tuple(hidden)
        uncatalogued = [name for name in names if name in UNCATALOGUED_EFFECTS]
        plain = SimulatedMotor.random(self.motor_seed, [name for name in names if name not in uncatalogued])
        motor = UncataloguedMotor(plain, uncatalogued[0], self.motor_seed) if uncatalogued else plain
        bench = _Bench(self.motor_seed, motor, SimulatedAnalyser(self.motor_seed + 1))
        DEPARTURES[self.departure](bench, np.random.default_rng([self.motor_seed, zlib.crc32(self.departure.encode())]))
        return bench


def draw_hard(seed: int, index: int) -> HardCase:
    """The case with this number; the departures follow each other cyclically, and every other case of each has one hidden effect."""
    if seed < 0 or index < 0:
        raise BadInput(f"seed {seed} and index {index} must be 0 or above")
    rng = np.random.default_rng([seed, index, zlib.crc32(b"hard")])
    names = list(DEPARTURES)
    departure = names[index % len(names)]
    known = catalogue_kinds()["one"]
    hidden: tuple[str, ...] = ()
    if departure == "outside":
        hidden = (str(rng.choice([*OUTSIDE_EFFECTS, *UNCATALOGUED_EFFECTS])),)
    elif departure == "three":
        hidden = drawn_together(rng, known, 3, COPPER)
    elif departure == "weak-effect" or (index // len(names) + index % len(names) + seed) % 2:
        hidden = (str(rng.choice(known)),)
    return HardCase(seed, index, departure, hidden, int(rng.integers(1, 2**31)))


def draw_hard_many(seed: int, count: int, departure: str | None = None) -> list[HardCase]:
    """The first `count` cases of a seed, or the first with one departure."""
    if count < 1:
        raise BadInput(f"{count} cases: ask for at least one")
    names = list(DEPARTURES)
    if departure is None:
        return [draw_hard(seed, index) for index in range(count)]
    if departure not in names:
        raise BadInput(f"there is no departure {departure!r}; known: {', '.join(names)}")
    return [draw_hard(seed, names.index(departure) + len(names) * number) for number in range(count)]
