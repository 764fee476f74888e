"""What an answer is worth where the data are outside the protocol: strict, but a true word about the data counts."""

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
# Departures that are the analyser's errors: to blame it is right, and to name one of its errors beside the motor's effect is too.
OF_THE_ANALYSER = ("vna-reflection", "vna-not-compensated", "doubled-errors", "declared-wrongly", "leads-apart")
# Departures that are the motor's own change during the measurement, which the catalogue has a name for.
OF_THE_MOTOR = ("capacitance-apart", "warming")
DRIFT = "temperature-drift"
# Departures that are faults of the data: to be unable to explain them is no false certainty.
OF_THE_DATA = (*OF_THE_ANALYSER, *OF_THE_MOTOR, "flicker", "stations", "outliers")
# Elements whose meaning a hidden effect changes: their fitted values are not comparable.
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
    """A fitted element of a played case, and the values that it had during the measurement, SI units."""

    name: str
    value: float
    sigma: float
    low: float
    high: float

    @property
    def inside(self) -> bool:
        """Whether its 95 % interval holds what it was."""
        return self.value - 1.96 * self.sigma <= self.high and self.value + 1.96 * self.sigma >= self.low


def attached(hidden: Sequence[str]) -> set[str]:
    """Elements that the hidden effects attach to."""
    places: set[str] = set()
    for name in hidden:
        _, _, place = name.partition("@")
        places.update([place] if place in ELEMENTS else ATTACHED.get(name, ()))
    return places


def of_the_motor(case: HardCase, effects: Sequence[str]) -> tuple[str, ...]:
    """Those of the named effects that are not the departure by another name."""
    return tuple(name for name in effects if not _is_departure(case, name))


def strict(case: HardCase, answer: Answer, findings: Sequence[str], seen: Sequence[str]) -> Outcome:
    """What an answer is worth.

    Parameters
    ----------
    case : HardCase
    answer : Answer
    findings : sequence of str
        Ids of the serious findings.
    seen : sequence of str
        Those of the hidden effects that the data show at all.
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
    # Nothing but the departure itself was named: for a motor that shows nothing, that is the whole truth.
    if answer.effects and not about_motor.effects and not seen and case.departure in OF_THE_MOTOR:
        return "right"
    worths = [outcome(hidden, about_motor) for hidden in dict.fromkeys([tuple(case.hidden), tuple(seen)])]
    return next((worth for worth in worths if worth in GOOD), worths[0])


def true_word(case: HardCase, answer: Answer, findings: Sequence[str], seen: Sequence[str]) -> bool:
    """Whether what the answer's confidence speaks of is true: as `strict`, but a family may be of any size."""
    if strict(case, answer, findings, seen) in GOOD:
        return True
    return answer.verdict not in ("data", "instrument") and hit(case.hidden, _about_motor(case, answer), detectable=bool(seen) or not case.hidden)


def sure_and_wrong(case: HardCase, answer: Answer, worth: Outcome) -> bool:
    """Whether somebody who believed the answer would be misled."""
    excused = answer.verdict in ("unexplained", "data") and case.departure in OF_THE_DATA
    return answer.confidence >= SURE and worth not in GOOD and not excused


def _is_departure(case: HardCase, name: str) -> bool:
    if case.departure in OF_THE_MOTOR:
        return name == DRIFT
    return case.departure in OF_THE_ANALYSER and find_effect(name).effect.group == "instrument"


def _about_motor(case: HardCase, answer: Answer) -> Answer:
    """The answer without what is the departure by another name."""
    effects = of_the_motor(case, answer.effects)
    dropped = set(answer.effects) - set(effects)
    families = tuple(family for family in answer.families if not dropped & set(family))
    return dataclasses.replace(answer, effects=effects, families=families) if dropped else answer
