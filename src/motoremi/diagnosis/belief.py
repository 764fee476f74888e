"""The decision from the probabilities of the models that were found.

The decision uses one posterior over sets of effects, including the empty set. The most probable set is named if its odds against the empty set
are at least 20 to 1; effects that could replace a named one are its family. A named set is accepted if its remaining error is small enough.
The confidence is the set's probability times `RELIABLE`, since the posterior compares only the models that were found and cannot
contain errors of search, catalogue and declared analyser.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from motoremi.diagnosis.explore import Key, M, in_place_of
from motoremi.diagnosis.thresholds import NEARLY_ALL
from motoremi.fitting.result import Fit
from motoremi.fitting.search import BEYOND_SIGMA

Acceptance: TypeAlias = Literal["explained", "slight", "mostly", "not"]
Verdict: TypeAlias = Literal["adequate", "missing-effect", "family", "instrument", "data", "unexplained"]

# An effect, or a further one, is named only if all smaller sets together have less of the posterior than this (odds of 20 to 1).
LEAST_DOUBT = 0.05
# A family lists its most probable members until they have this share of its posterior (the confidence of such an answer), and only those with at
# least the second share of the best member's.
FAMILY_TOGETHER, FAMILY_SHARE = 0.97, 0.01
# An undescribed part below this share of the floor is `slight`: analyser or motor may have caused it.
SLIGHT_SHARE = 0.25
# A model describes most of the error if its undescribed part is at most this share of the base's.
MOSTLY = 0.25
# With more than this left, in percent, a model describes nothing, however much more the base leaves: with standards instead of the motor connected,
# a leakage of 25 mOhm took the undescribed part from 1600 to 188 %.
MISSES_ALL_PERCENT = 50.0
# Largest analyser error, in percent, with which an error is compared: no working analyser errs by more where it is meant to be used.
MOST_ERRING_PERCENT = 10.0
# In standard deviations, of which three are the specification: no working analyser errs by 100 times that: then the circuit is wrong, unless it
# describes nearly all of what was missing (two cables joined in a box, as one cable: 89 % fell to 2 %, with 323).
NO_ANALYSER_SIGMA = 300.0
# Share of true answers of each kind, for the errors that the posterior does not contain: estimated from the scoreboards of
# docs/explanation/how_often_right.md and earlier_figures.md, to be checked with other seeds. `adequate` was true in 190 of 190 cases, `unexplained`
# in 47 of 50; the other three had a serious finding.
# Answers with two effects were completely right in 10 of 12 cases by the protocol, 11 of 17 outside it (scoreboards of seeds 26112981 to 26113091)
# and 7 of 12 of another generator: two effects often describe a third one as well; of later versions in 5 of 6 outside the protocol (seed 26112902)
# and in 20 of 25 of three other generators, together 53 of 72. If one of them alone left at most 2 % of the undescribed part,
# they were right in 8 of 24 cases of two other generators, whose laws are not quite those of the catalogue; simulated motors follow the
# catalogue's laws more closely, and there is no third kind to decide: 0.5.
# Three names were completely right in 10 of 12 cases (seeds 26113101 and 26113201) and in none of 2 of two other generators, whose laws are not
# exactly the catalogue's: 0.6.
# A single effect with unusual values was wrong in 6 of 6 cases (a tapped winding; investigations of seeds 25112602, 25112603 and 25113021), but
# simulated motors never have such values and the share of real motors that have them is unknown: 0.5.
# In three motors of two other generators an effect with usual values did as well; two of these were true.
# A relaxation alone, across the winding or to the frame, was true in 8 of 17 cases (investigations of seeds 24112603, 24113001 and 24113201, the
# protocol's seed 24113202); a tenth of those motors had an effect outside the catalogue, the share of real motors that have one is unknown.
# If the model needs errors far beyond the specification of an impedance analyser, the named effects were never all of the hidden ones (0 of 6, seed
# 25113003, three hidden effects), but often one or two of them. If the data fit another analyser better, they were right in 4 of 7 cases (there and
# in seed 25113001): an effect outside the catalogue can look like another analyser.
# A circuit whose error lies where the analyser is insensitive (a ferrite core of 5 kohm on a NanoVNA: 87 %) may be right; 0.7 is a guess.
# `adequate` although an effect is more probable (not named, since analyser errors explain it too) was true in 3 of 6 cases (seed 26112531).
# `instrument` although an effect explains the error as well was wrong in 3 of 3 cases.
# Names from the open-circuit sweep alone were right in 5 of 9 cases, stated 0.91 (motors of an independent generator): winding and frame may be
# exchanged.
# A strap of a few centimetres was named in 2 of 4 motors whose leads were longer in one sweep (seed 26112984): they have the same impedance.
# An effect that takes an undescribed part of less than 0.1 % to nothing, by odds above e^60, was true in 10 of 11 cases (four boards and the
# independent generator); 0.75, since real analysers have fine structure of that size. An analyser without a name may have more of it.
# `unexplained` although a set of effects left at most a tenth of the undescribed part was wrong in 8 of 8 cases of another generator, where the
# hidden effects had other values or slightly other laws than the catalogue's: 0.5. Where more was left, it was true in 9 of 9 cases (there, and
# seed 26113603). If the set was two relaxations at one place, it was true of 4 of 4 motors of that seed, whose layers have a distributed
# resistance, and of none of 2 of the other generator, which had two relaxations: 0.7.
# Where a causal model of 25 poles misses by more than 10 % too, a search may not find what is in the catalogue: `unexplained` was wrong in 3 of 3
# cases (windings of 36 to 40 sections, two independent generators): 0.5.
# A capacitor of 10 uF between the ports of a network analyser (a real curve), imported as a winding: a capacitance at the terminals took the error
# from 83 to 75 %, where the analyser may err by 200 %. In five independent generators no motor was like that.
# Of four motors whose sweeps the instrument had smoothed two were named wrongly, with 0.63 and 0.70 (independent generator).
# Motors behind a mains filter or a varistor with its resistor (independent generator) were told as the same sweep twice (two of two), and so were
# all simulated operators' mistakes. How often either occurs is unknown.
RELIABLE: Mapping[str, float] = {
    "adequate": 0.98,
    "adequate, with a serious finding": 0.96,
    "adequate, a weak effect unnamed": 0.6,
    "adequate, hardly seen": 0.7,
    "one name": 0.98,
    "unusual values": 0.5,
    "instead of unusual values": 0.6,
    "imitated": 0.6,
    "named from the open-circuit sweep alone": 0.7,
    "names beyond the specification": 0.5,
    "names with which the circuit errs by much": 0.5,
    "names, not as declared": 0.7,
    "names, neighbouring points correlated": 0.5,
    "a strap as short as leads": 0.7,
    "hardly matters": 0.75,
    "two names": 0.75,
    "two names, one describes nearly all": 0.5,
    "three names": 0.6,
    "family": 0.97,
    "mostly": 0.75,
    "slight": 0.85,
    "weak": 0.7,
    "instrument": 0.95,
    "instrument, an effect unnamed": 0.5,
    "data": 0.6,
    "sweeps that contradict each other": 0.7,
    "a phase that no passive part has": 0.95,
    "exchanged sweeps": 0.95,
    "unexplained": 0.95,
    "unexplained, nearly all described": 0.5,
    "unexplained, two relaxations at one place": 0.7,
    "unexplained, more resonances than a causal model has": 0.5,
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
        For each named effect, the others that describe the data about as well in its place, the most probable first.
    probability : float
        Of the named set and of those with members of the families instead, among all sets that were found.
    posterior : dict
        Of each set that was found.
    """

    named: Key
    families: Mapping[str, Key]
    probability: float
    posterior: Mapping[Key, float]

    @property
    def inclusion(self) -> dict[str, float]:
        """Probability of each effect: each set's is divided equally among its effects, so that with the empty set all add up to one."""
        shared: dict[str, float] = {}
        for key, probability in self.posterior.items():
            for name in key:
                shared[name] = shared.get(name, 0.0) + probability / len(key)
        return shared


def believe(found: Mapping[Key, M], together: float = FAMILY_TOGETHER) -> Belief:
    """The decision from the models that were found, including the one without added effects.

    Parameters
    ----------
    found : mapping
        Models by what they add.
    together : float
        Share of the family's posterior up to which members are listed; an effect that has it alone has no family.
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
    """The most probable set of the smallest size against which all larger sets have odds below 20 to 1."""
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


def agreeing(posterior: Mapping[Key, float], named: Key, families: Mapping[str, Key]) -> float:
    """Probability of the sets with each named effect, or one of its family; sets with a further effect count too."""
    places = [{effect, *families.get(effect, ())} for effect in named]
    return sum(probability for key, probability in posterior.items() if _agrees(list(key), places))


def _agrees(key: list[str], places: list[set[str]]) -> bool:
    """Whether each place can be assigned a different effect of a set."""
    if not places:
        return True
    return any(name in places[0] and _agrees(key[:at] + key[at + 1 :], places[1:]) for at, name in enumerate(key))


def after_verdict(probability: float, verdict: str, confidence: float) -> float:
    """The probability of something that was found; after the verdict "unexplained", at most the probability that the verdict is wrong."""
    return probability * (1.0 - confidence if verdict == "unexplained" else 1.0)


def acceptance_of(base: Fit, best: Fit) -> Acceptance:
    """Whether the remaining error of a model is small enough to accept the model."""
    left = best.unexplained_percent["value"]
    nearly_all = best is not base and left <= NEARLY_ALL * base.unexplained_percent["value"]
    if best.analyser_sigma > NO_ANALYSER_SIGMA and not nearly_all:
        return "not"
    # If nothing remains but the analyser's error is far beyond its specification, the model is accepted and a finding reports the analyser.
    # An added effect that only reaches a stated accuracy counts as `mostly`, since its law may be wrong; a base that reaches it is `explained`.
    enough = best.explained and (best is base or best.measurement.accuracy_percent is None)
    # It is not known by how much an analyser without a name may err: if it would have to err by much, an effect may be the cause instead.
    unknown = best is not base and not best.measurement.analyser.named and best.analyser_sigma > BEYOND_SIGMA
    if (best.marginal.nothing_left >= 0.5 and not unknown) or enough:
        return "explained"
    if left <= SLIGHT_SHARE * min(best.floor_percent, MOST_ERRING_PERCENT):
        return "slight"
    if best is not base and (left <= min(MOSTLY * base.unexplained_percent["value"], MISSES_ALL_PERCENT) or best.explained):
        return "mostly"
    return "slight" if best.within_specification else "not"
