"""Blind cases: motors without a hidden effect, with one, two, one outside the catalogue, or with a fault of the analyser."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass
from functools import reduce

import numpy as np

from motoremi.data.sweep import TERMINATIONS, ImpedanceSweep
from motoremi.diagnosis.candidates import ALLOWED_SIGMA
from motoremi.errors import BadInput
from motoremi.fitting.fit import fit
from motoremi.fitting.result import Fit
from motoremi.model.effects import find_effect, identifiers
from motoremi.model.motor import dc_motor
from motoremi.simulate.analyser_errors import SimulatedAnalyser
from motoremi.simulate.hidden_effects import HIDDEN_EFFECTS, OUTSIDE_EFFECTS, excluding, split_effects
from motoremi.simulate.simulated_motor import SimulatedMotor

# Both determine the copper resistance: motors outside the protocol have at most one of them.
COPPER = frozenset({"skin-effect", "proximity-effect"})
POINTS = 401
SPAN_HZ = (150e3, 30e6)
REPEATS = 3
BANDWIDTH_FACTOR = 3
# A hidden effect counts as visible if adding it raises the log evidence by this (odds of 20 to 1).
SHOWING = 3.0
SORTS = {"none": 0.2, "one": 0.45, "two": 0.15, "outside": 0.1, "instrument": 0.1}


@dataclass(frozen=True)
class Case:
    """One motor on one analyser.

    Parameters
    ----------
    seed, index : int
        They determine the case.
    sort : str
        Key of `SORTS`.
    hidden : tuple of str
        Identifiers as in the catalogue; `outside-...` for effects that are not in it.
    motor_seed : int
    """

    seed: int
    index: int
    sort: str
    hidden: tuple[str, ...]
    motor_seed: int

    def sweeps(self, hidden: Sequence[str] | None = None, points: int = POINTS) -> list[ImpedanceSweep]:
        """Three repeats of each termination; `hidden` replaces the hidden effects, everything else is the same."""
        in_motor, in_analyser = split_effects(self.hidden if hidden is None else hidden)
        motor = SimulatedMotor.random(self.motor_seed, in_motor)
        analyser = SimulatedAnalyser(self.motor_seed + 1, faults=in_analyser)
        frequency = np.geomspace(*SPAN_HZ, points)
        measured = []
        for connection, termination in enumerate(TERMINATIONS):
            true = motor.impedance(termination, frequency)
            for _ in range(REPEATS):
                seen = analyser.measure(termination, frequency, true, connection=connection, bandwidth_factor=BANDWIDTH_FACTOR)
                measured.append(ImpedanceSweep(termination, frequency, seen, metadata={"analyser": "4294a"}))
        return measured

    def seen(self) -> tuple[str, ...]:
        """The hidden effects that show: alone beyond the seven elements within noise and specification, and of two each beside the other."""
        alone = tuple(name for name in self.hidden if visible(fit(dc_motor(), self.sweeps((name,)))))
        return shown(fit(dc_motor(), self.sweeps()), alone) if len(self.hidden) > 1 and alone == self.hidden else alone


def visible(base: Fit) -> bool:
    """Whether the data show that the seven elements alone are not enough, above noise and specification."""
    return base.marginal.nothing_left < 0.5 or base.analyser_sigma > ALLOWED_SIGMA


def shown(base: Fit, hidden: tuple[str, ...]) -> tuple[str, ...]:
    """The hidden effects that are visible in data, each compared with a model that has all the others.

    An effect is visible if the model without it leaves more than noise and specification explain, and adding it describes that. Otherwise the
    rest may be fine structure of a handheld analyser's errors, which repeats reveal.

    Parameters
    ----------
    base : Fit
        Of the seven elements alone.
    """
    others = {name: reduce(Fit.add, (other for other in hidden if other != name), base) for name in hidden}
    return tuple(name for name, without in others.items() if visible(without) and (name in OUTSIDE_EFFECTS or _describes(name, without)))


def _describes(name: str, without: Fit) -> bool:
    return without.add(name).log_evidence - without.log_evidence > SHOWING


def catalogue_kinds() -> dict[str, list[str]]:
    """The effects that can be hidden, by sort of case; without those that are visible only below the band, or that a diagnosis never names."""
    # A place that makes a difference only beside another effect would be the usual place under another name.
    effects = {name: find_effect(name).effect for name in HIDDEN_EFFECTS if name in identifiers() and find_effect(name).differs_in(dc_motor())}
    known = [name for name, effect in effects.items() if SPAN_HZ[0] < effect.below_hz and not effect.describes]
    instrument = [name for name in known if effects[name].group == "instrument"]
    return {"one": [name for name in known if name not in instrument], "outside": list(OUTSIDE_EFFECTS), "instrument": instrument}


def drawn_together(rng: np.random.Generator, known: Sequence[str], count: int, apart: Set[str] = frozenset()) -> tuple[str, ...]:
    """Effects drawn at random that one motor can hide together; not all of `apart`, if that is given."""
    while True:
        hidden = tuple(str(name) for name in rng.choice(known, count, replace=False))
        if not excluding(hidden) and not (apart and apart <= set(hidden)):
            return hidden


def draw(seed: int, index: int) -> Case:
    """The case with this number."""
    rng = np.random.default_rng([seed, index])
    kinds = catalogue_kinds()
    sort = str(rng.choice(list(SORTS), p=list(SORTS.values())))
    hidden: tuple[str, ...] = ()
    if sort == "two":
        hidden = drawn_together(rng, kinds["one"], 2)
    elif sort != "none":
        hidden = (str(rng.choice(kinds[sort])),)
    return Case(seed, index, sort, hidden, int(rng.integers(1, 2**31)))


def draw_many(seed: int, count: int) -> list[Case]:
    """The first `count` cases of a seed."""
    if count < 1:
        raise BadInput(f"{count} cases: ask for at least one")
    if seed < 0:
        raise BadInput(f"the seed is {seed}; it must be 0 or above")
    return [draw(seed, index) for index in range(count)]
