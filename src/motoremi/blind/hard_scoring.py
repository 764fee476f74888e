"""Scoring of answers for data outside the protocol: strict, but a correct finding about the data counts as right."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from motoremi.blind.departures import HardCase
from motoremi.blind.scoring import Answer, Outcome, hit, outcome
from motoremi.model.effects import find_effect
from motoremi.simulate.hidden import ELEMENTS

GOOD = ("right", "family")
SURE = 0.8
# Departures that are errors of the analyser: the verdict `instrument`, or the name of such an error in addition to the motor's effect, is right.
OF_THE_ANALYSER = ("vna-reflection", "vna-not-compensated", "doubled-errors", "declared-wrongly", "leads-apart")
# Departures that are changes of the motor during the measurement, for which the catalogue has an effect.
OF_THE_MOTOR = ("capacitance-apart", "warming")
DRIFT = "temperature-drift"
# Departures that are faults of the data: the verdicts `unexplained` and `data` do not count as sure and wrong there.
OF_THE_DATA = (*OF_THE_ANALYSER, *OF_THE_MOTOR, "flicker", "stations", "outliers")
# Elements whose meaning is changed by a hidden effect: their fitted values cannot be compared with the truth.
ATTACHED: Mapping[str, tuple[str, ...]] = {
    "skin-effect": ("Ra", "La"),
    "proximity-effect": ("Ra", "La"),
    "field-coupling": ("La",),
    "eddy-laminations": ("La",),
    "permeability-relaxation": ("La",),
    "core-loss": ("La",),
    "brush-contact": ("Ra",),
    "distributed-winding": ("Ra", "La", "Ca", "Cf"),
    "second-resonance": ("La",),
    "bearing-film": ("Cr",),
    "rotor-cage": ("La",),
    "shorted-turn": ("La",),
    "machine-winding": ("Ra", "La", "Ca", "Cf"),
    "winding-sections": ("Ra", "La", "Ca", "Cf"),
    "frame-eddy": ("Lr",),
}


@dataclass(frozen=True)
class Element:
    """A fitted element of a case, with its lowest and highest true value during the measurement, SI units."""

    name: str
    value: float
    sigma: float
    low: float
    high: float

    @property
    def inside(self) -> bool:
        """Whether its 95 % interval contains a true value."""
        return self.value - 1.96 * self.sigma <= self.high and self.value + 1.96 * self.sigma >= self.low


def attached(hidden: Sequence[str]) -> set[str]:
    """Elements whose meaning the hidden effects change."""
    places: set[str] = set()
    for name in hidden:
        _, _, place = name.partition("@")
        places.update([place] if place in ELEMENTS else ATTACHED.get(name, ()))
    return places


def of_the_motor(case: HardCase, effects: Sequence[str]) -> tuple[str, ...]:
    """The named effects without those that are a description of the departure itself."""
    return tuple(name for name in effects if not _is_departure(case, name))


def strict(case: HardCase, answer: Answer, findings: Sequence[str], seen: Sequence[str]) -> Outcome:
    """Score of an answer.

    Parameters
    ----------
    case : HardCase
    answer : Answer
    findings : sequence of str
        Ids of the serious findings.
    seen : sequence of str
        The hidden effects that are visible in the data.
    """
    if answer.trouble:
        return "crashed"
    named_truly = bool(set(findings) & set(case.accepted))
    about_motor = _about_motor(case, answer)
    if answer.verdict == "data":
        return "right" if named_truly else "wrong" if seen else "false alarm"
    if answer.verdict == "unexplained" and case.departure == "three":
        return "right"
    if answer.verdict == "adequate" and case.departure == "weak-effect":
        return "right"
    if answer.verdict == "instrument" and not about_motor.effects and not seen and (named_truly or case.departure in OF_THE_ANALYSER):
        return "right"
    # Only the departure itself was named, which is right for a motor without visible effects.
    if answer.effects and not about_motor.effects and not seen and case.departure in OF_THE_MOTOR:
        return "right"
    # An effect that is not visible beside the others may be named but need not be.
    named = {*about_motor.effects, *(name for family in about_motor.families for name in family)}
    expected = tuple(name for name in case.hidden if name in seen or name in named)
    scores = [outcome(hidden, about_motor) for hidden in dict.fromkeys([tuple(case.hidden), expected, tuple(seen)])]
    return next((score for score in scores if score in GOOD), scores[0])


def statement_is_true(case: HardCase, answer: Answer, findings: Sequence[str], seen: Sequence[str]) -> bool:
    """Whether the answer is true in the sense of its stated confidence: as `strict`, but a family may have any size."""
    if strict(case, answer, findings, seen) in GOOD:
        return True
    return answer.verdict not in ("data", "instrument") and hit(case.hidden, _about_motor(case, answer), detectable=bool(seen) or not case.hidden)


def sure_and_wrong(case: HardCase, answer: Answer, score: Outcome) -> bool:
    """Whether the answer is wrong with a confidence of at least `SURE`."""
    excused = answer.verdict in ("unexplained", "data") and case.departure in OF_THE_DATA
    return answer.confidence >= SURE and score not in GOOD and not excused


def _is_departure(case: HardCase, name: str) -> bool:
    if case.departure in OF_THE_MOTOR:
        return name == DRIFT
    return case.departure in OF_THE_ANALYSER and find_effect(name).effect.group == "instrument"


def _about_motor(case: HardCase, answer: Answer) -> Answer:
    """The answer without effects that are a description of the departure itself."""
    effects = of_the_motor(case, answer.effects)
    dropped = set(answer.effects) - set(effects)
    families = tuple(family for family in answer.families if not dropped & set(family))
    return dataclasses.replace(answer, effects=effects, families=families) if dropped else answer
