"""The decision from the probabilities of the models that were found.

Everything rests on one posterior over sets of effects, none among them. A set is named if it is the likeliest, unless the odds against none
are less than 20 to 1; effects that would do as well in the place of a named one are its family. Whether a named set stands depends on what
it leaves. How sure that is altogether, `RELIABLE` estimates: the posterior knows which of the models found is meant, not what
search, catalogue and declaration missed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from motoremi.diagnosis.explore import Key, M
from motoremi.fitting.result import Fit

Standing: TypeAlias = Literal["explained", "slight", "mostly", "not"]

# No effect is named, and no further one, unless the doubt of it is smaller: odds of 20 to 1.
LEAST_DOUBT = 0.05
# The likeliest members of a family together have so much of its posterior (as much as an answer that names a family is sure), and each at least
# this share of the best one's.
FAMILY_TOGETHER, FAMILY_SHARE = 0.97, 0.01
# A set of three describes almost any curve, right or wrong.
MOST_NAMES = 2
# What is left is slight where it is a small part of what noise and specification leave of a perfect model: it could be either.
SLIGHT_SHARE = 0.25
# What is left of what was left before, for a named effect to be most of the truth.
MOSTLY = 0.25
# No analyser that works errs by a hundred times its specification, which is three standard deviations: then the circuit is what is wrong.
NO_ANALYSER_SIGMA = 300.0
# How often each kind of answer is true, beyond what the posterior knows. Estimates from the boards of docs/explanation/how_often_right.md:
# `adequate` was true 190 times of 190, `unexplained` 47 of 50, with a serious finding each time that it was not. Boards of other seeds confirm or
# deny them.
# Two names were the whole truth 61 times of 70, inside the protocol and outside it: two effects easily take up a third.
# A single effect with values that few motors have was wrong six times of six (a tapped winding; investigations of seeds 25112602, 25112603 and
# 25113021): simulated motors never have such values. How many real motors do, nobody knows: even odds.
# A relaxation alone, across the winding or to the frame, was true 8 times of 17 (investigations of seeds 24112603, 24113001 and 24113201, the
# protocol's seed 24113202), where a tenth of the motors hid what the catalogue does not hold: how many real motors do, nobody knows.
# Names beside errors far beyond an impedance analyser's specification were the whole truth 0 times of 6 (seed 25113003, three hidden effects), one
# of two or three more often. Beside data that deny the declared analyser they were right 4 times of 7 (there and in seed 25113001): what the
# catalogue does not hold can look like another analyser.
# A circuit that errs most where its analyser sees next to nothing (a ferrite core of 5 kohm on a NanoVNA: an error of 87 %) may be right: a guess.
# That nothing is missing, where an effect is likelier and is not named since the analyser may do the same, was true 3 times of 6 (seed 26112531).
# That an analyser beyond its specification is to blame, where an effect would do as well and is not named, was wrong three times of three.
RELIABLE: Mapping[str, float] = {
    "adequate": 0.98,
    "adequate, with a serious finding": 0.96,
    "adequate, a weak effect unnamed": 0.6,
    "adequate, hardly seen": 0.7,
    "one name": 0.98,
    "unusual values": 0.5,
    "imitated": 0.6,
    "names beyond the specification": 0.5,
    "names, not as declared": 0.7,
    "two names": 0.87,
    "two names that leave something": 0.7,
    "family": 0.97,
    "mostly": 0.75,
    "slight": 0.85,
    "weak": 0.7,
    "instrument": 0.95,
    "instrument, an effect unnamed": 0.5,
    "data": 0.6,
    "the same sweep twice": 0.98,
    "unexplained": 0.95,
    "with a serious finding": 0.8,
}


@dataclass(frozen=True)
class Belief:
    """The decision: named effects, their families and probabilities.

    Parameters
    ----------
    named : tuple of str
        The effects, in the order in which they were added; empty for none.
    families : dict
        For each named effect, the others that describe the data about as well in its place, the likeliest first.
    probability : float
        Of the named set, families included, among all that were found.
    posterior : dict
        Of each set that was found.
    """

    named: Key
    families: Mapping[str, Key]
    probability: float
    posterior: Mapping[Key, float]

    @property
    def inclusion(self) -> dict[str, float]:
        """Probability of each effect, shared among the effects of a set so that all effects and none add up to one."""
        shared: dict[str, float] = {}
        for key, probability in self.posterior.items():
            for name in key:
                shared[name] = shared.get(name, 0.0) + probability / len(key)
        return shared


def believe(found: Mapping[Key, M], together: float = FAMILY_TOGETHER) -> Belief:
    """The decision from the models that were found, among them the one with nothing added.

    Parameters
    ----------
    found : mapping
        Models by what they add.
    together : float
        What the members of a family have of its posterior: one that has so much alone has no family.
    """
    scores = np.array([model.score for model in found.values()])
    weights = np.exp(scores - scores.max())
    posterior = {key: float(weight) for key, weight in zip(found, weights / weights.sum(), strict=True)}
    best = _smallest_undoubted(found, posterior)
    if not best:
        return Belief((), {}, max(posterior[()], 0.5), posterior)
    families = {effect: _rivals(best, effect, posterior, together) for effect in found[best].added}
    return Belief(found[best].added, families, agreeing(posterior, found[best].added, families), posterior)


def _smallest_undoubted(found: Mapping[Key, M], posterior: Mapping[Key, float]) -> Key:
    """The likeliest set of so many effects as are needed: of the smallest number that no larger one beats by 20 to 1."""
    sets = sorted(found, key=lambda key: (len(key), -found[key].score))
    return next(key for key in sets if sum(share for other, share in posterior.items() if len(other) <= len(key)) >= LEAST_DOUBT)


def _rivals(best: Key, effect: str, posterior: Mapping[Key, float], together: float) -> Key:
    """Effects that describe the data about as well in the place of one effect of a set."""
    others = in_place_of(effect, best, posterior)
    shares = {name: posterior[key] for name, key in others.items() if posterior[key] >= FAMILY_SHARE * posterior[best]}
    ranked = sorted(shares, key=lambda name: -shares[name])
    total = posterior[best] + sum(shares.values())
    before = posterior[best] + np.cumsum([0.0, *(shares[name] for name in ranked)])
    return tuple(name for name, sum_before in zip(ranked, before, strict=False) if sum_before < together * total)


def in_place_of(effect: str, key: Sequence[str], found: Iterable[Key]) -> dict[str, Key]:
    """Other effects, each with the set that was found with it in the place of one effect of a set."""
    rest = list(key)
    rest.remove(effect)
    others: dict[str, Key] = {}
    for other in found:
        left = list(other)
        for name in rest:
            if name in left:
                left.remove(name)
        if len(other) == len(key) and len(left) == 1 and left[0] != effect:
            others[left[0]] = other
    return others


def agreeing(posterior: Mapping[Key, float], named: Key, families: Mapping[str, Key]) -> float:
    """Probability of the sets with each named effect, or one of its family; a further, idle effect does not contradict the answer."""
    places = [{effect, *families.get(effect, ())} for effect in named]
    return sum(probability for key, probability in posterior.items() if _agrees(list(key), places))


def _agrees(key: list[str], places: list[set[str]]) -> bool:
    """Whether each place can be assigned a different effect of a set."""
    if not places:
        return True
    return any(name in places[0] and _agrees(key[:at] + key[at + 1 :], places[1:]) for at, name in enumerate(key))


def stands(base: Fit, best: Fit) -> Standing:
    """Whether the remaining error of a model is small enough to accept the model."""
    if best.analyser_sigma > NO_ANALYSER_SIGMA:
        return "not"
    left = best.unexplained_percent["value"]
    # Where only an analyser far beyond its specification is asked for, that is what is wrong, and the findings say so.
    # An effect that only reaches a stated accuracy may be of another law: it describes most. The base that does needs none.
    enough = best.explained and (best is base or best.measurement.accuracy_percent is None)
    if best.marginal.nothing_left >= 0.5 or enough:
        return "explained"
    if left <= SLIGHT_SHARE * best.floor_percent:
        return "slight"
    if best is not base and (left <= MOSTLY * base.unexplained_percent["value"] or best.explained):
        return "mostly"
    return "slight" if best.within_specification else "not"
