"""A judgement of the reference sweeps, updated by sweeps under conditions and by single values."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
from scipy.special import logsumexp

from motoremi.data.measurement import Measurement
from motoremi.diagnosis.belief import RELIABLE
from motoremi.diagnosis.decision import decided
from motoremi.diagnosis.explore import Key, key_of
from motoremi.diagnosis.findings import Finding
from motoremi.diagnosis.judgement import Judgement, distributed
from motoremi.fitting.result import Fit
from motoremi.investigation.mistakes import STRANGE_VALUE, Mistake
from motoremi.investigation.question import NONE_DESCRIBES, ODDS
from motoremi.investigation.rivals import BEHIND, Rivals, rivals_of, update

# Probability from which one explanation counts as the only one left (the odds at which an investigation stops).
ONLY_ONE_LEFT = ODDS / (1 + ODDS)
# Identifier of the finding that a sweep or value is not what was requested.
NOT_AS_ASKED = "not-as-asked"
# Prior that the truth is outside the catalogue, by how far the most probable model is accepted; from `belief.RELIABLE` of such answers.
OUTSIDE: Mapping[str, float] = {"explained": 0.03, "slight": 0.15, "mostly": 0.25, "not": NONE_DESCRIBES}
# How often the reference sweeps alone name the wrong one of several sets of two or three effects that all describe them, however clear the odds:
# laws of real materials and those of the catalogue differ, and with two of them at work small differences decide. Of 87 simulated motors with two
# effects 12 were named wrongly in the end (investigations of seed 26112841), 4 of them at the start with odds above 20 to 1.
MISJUDGED = 0.15


def rivals_in(judgement: Judgement, measurement: Measurement | None = None) -> Rivals:
    """The explanations that remain, updated by sweeps under conditions and single values.

    Sets with two relaxations at one place describe almost any curve and count as outside the catalogue, unless the family that is reported has one.
    """
    scores, family = _scores(judgement), judgement.alternatives if judgement.accepted else ()
    credible = {key: (one.fit, scores[key]) for key, one in judgement.found.items() if key in family or not distributed(key)}
    if judgement.aside:
        best = max(score for _, score in credible.values())
        together = float(logsumexp([one.score for one in judgement.aside.values()]))
        credible |= {key: (one.fit, best + one.score - together) for key, one in judgement.aside.items()}
    model = key_of(judgement.model)
    if judgement.accepted and model in credible and judgement.model.fit.marginal.nothing_left < 0.5:
        # Likelihood ratios of laws that are approximate mean little: those of a family are as likely as the model until a measurement decides.
        least = credible[model][1]
        credible |= {key: (credible[key][0], max(credible[key][1], least)) for key in judgement.alternatives if key in credible}
    credible |= _as_good(judgement, credible)
    outside = OUTSIDE[judgement.acceptance]
    if not judgement.accepted and judgement.nearly_described:
        # What describes nearly all may be what is missing: then a measurement can show it.
        outside = RELIABLE["unexplained, nearly all described"]
    if judgement.named and judgement.model.unusual:
        outside = max(outside, 1 - RELIABLE["unusual values"])
    if judgement.of_several is not None:
        outside = max(outside, 1 - RELIABLE[judgement.of_several])
    start = rivals_of(credible, outside, 1 - RELIABLE["imitated"])
    return update(start, measurement or judgement.base.measurement)


def _as_good(judgement: Judgement, credible: Mapping[Key, tuple[Fit, float]]) -> dict[Key, tuple[Fit, float]]:
    """Sets of several effects that describe everything, as the most probable one does, each with its share of `MISJUDGED`."""
    best = max(credible, key=lambda key: credible[key][1])
    found = {key: judgement.found[key] for key in credible if key in judgement.found and len(key) == len(best)}
    good = {key: one for key, one in found.items() if one.leaves_nothing and credible[key][1] > credible[best][1] - BEHIND}
    if len(best) < 2 or best not in good or len(good) < 2:
        return {}
    together = float(logsumexp([credible[key][1] for key in good]))
    own, shared = np.log(1 - MISJUDGED), np.log(MISJUDGED / len(good)) + together
    return {key: (credible[key][0], float(np.logaddexp(own + credible[key][1], shared))) for key in good}


def _scores(judgement: Judgement) -> dict[Key, float]:
    """Log scores of all sets that were found, from the reference sweeps alone.

    If the reference sweeps do not show whether the analyser errs or an effect is missing, both are equally likely.
    """
    scores = {key: one.score for key, one in judgement.found.items()}
    return scores | {(): judgement.best.score} if judgement.undecided else scores


def informed(judgement: Judgement, rivals: Rivals) -> Judgement:
    """The judgement with updated scores; unchanged if there are no further measurements."""
    if not rivals.taught:
        return judgement
    weighed = {one.key: one.log_weight for one in rivals.members if not one.outside}
    own = [key for key in weighed if key in judgement.found]
    scores = _scores(judgement)
    best = max(scores[key] for key in own)
    # Sets too improbable to be updated keep their distance in score from the one that gained most.
    most = max(weighed[key] + best - scores[key] for key in own)
    found = {
        key: dataclasses.replace(one, score=best + weighed[key] if key in weighed else scores[key] + most) for key, one in judgement.found.items()
    }
    # If explanations with equally many effects reach `ONLY_ONE_LEFT` only together, one of them is true: they are a family.
    size, probabilities = len(rivals.likeliest.key), rivals.probabilities
    proven = sum(probabilities[one.key] for one in rivals.members if len(one.key) == size and not one.outside) >= ONLY_ONE_LEFT
    if proven:
        found |= {key: dataclasses.replace(one, score=best + weighed[key]) for key, one in judgement.aside.items() if key in weighed}
    return dataclasses.replace(decided(judgement.base, found, ONLY_ONE_LEFT, proven), whole=judgement.whole)


def departs(rivals: Rivals) -> bool:
    """Whether the further measurements contradict every explanation of the catalogue."""
    return bool(rivals.taught) and rivals.outside > 0.5


def confidence_of(rivals: Rivals, probability: float, verdict: str, before: float, nearly_described: bool = False) -> float:
    """Probability that an answer is true, from the probability of its set among those that were found.

    After further measurements, the probability of an effect outside the catalogue is the updated one, as far as the search is reliable. Sets that
    describe nearly all (`nearly_described`) may have laws that are only approximately the motor's: then their predictions fail as well, which says
    nothing about what is outside the catalogue (of a capacitor beside a winding in sections a wide sweep departed from both sets that were found).
    """
    if not rivals.taught or verdict == "data":
        return before
    if verdict == "unexplained":
        return max(min(rivals.outside, RELIABLE["unexplained"]), before) if departs(rivals) and not nearly_described else before
    # Serious findings and parameters at a bound reduce the confidence by the same factor as before.
    return min(before / max(probability, 1e-9), 1 - rivals.outside) * probability


def reasons_of(rivals: Rivals) -> list[str]:
    """The information that each further measurement gave, in words."""
    said = []
    for taught in rivals.taught:
        best, share = max(taught.probabilities.items(), key=lambda pair: pair[1])
        said.append(f"{taught.id} gave {taught.bits:.2g} bits of information: the probability of {best} was then {share:.2g}")
    if departs(rivals):
        said.append("what was measured departs from the prediction of every explanation of the catalogue")
    return said


def _remedy(mistake: Mistake) -> str:
    if mistake.kind == STRANGE_VALUE:
        return "check the reading and its unit"
    if mistake.used:
        return "make sure that it was done"
    return "repeat that measurement, or append it under the condition that it was taken in"


def of_the_operator(rivals: Rivals) -> list[Finding]:
    """The finding of sweeps and values that are not what was requested."""
    return [
        Finding(
            NOT_AS_ASKED,
            f"{one.says}; both possibilities are taken into account" if one.used else f"{one.says}; it is not used",
            _remedy(one),
            False,
        )
        for taught in rivals.taught
        for one in taught.mistakes
    ]
