"""The verdict: what is missing, how sure that is, and what these data cannot tell apart."""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

from motoremi.arrays import JsonDict, Progress
from motoremi.diagnosis.compare import compare
from motoremi.diagnosis.evidence import Candidate, effective_share, glances, has_shape, is_good, members, possible_effects, rank, refitted
from motoremi.diagnosis.following import next_measurement
from motoremi.diagnosis.pairs import RIVALS, crossed, rank_pairs
from motoremi.diagnosis.remainder import Remainder, remainder
from motoremi.diagnosis.scouts import nearest
from motoremi.diagnosis.validation import cross_validated
from motoremi.fitting.result import Fit
from motoremi.fitting.search import good_enough
from motoremi.model.effects import find_effect
from motoremi.quantities import show_band

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Verdict: TypeAlias = Literal["adequate", "missing-effect", "family", "instrument", "unexplained"]

# How often the two effects of a pair that explains everything are sought again in turn. More than two at once are not sought: with three
# free effects almost anything can be described, so a third is named only once the first two are in the ladder.
EXCHANGES = 2
# Odds against any effect before looking: half the motors that come to the bench need none, the rest share the catalogue.
PRIOR_OF_NONE = 0.5
# Log evidence that a further effect must bring, beyond its share of the prior, to be believed.
LEAST_GAIN = 4.0
# A model that describes the data is left alone unless the odds for a further effect are twenty to one.
LEAST_DOUBT = 0.05
# Members of a family have at least this share of the best one's posterior.
FAMILY_SHARE = 0.01
# More names than these tell nobody anything; what the others would add is taken off the confidence.
LARGEST_FAMILY = 3
# How often the catalogue or the noise model is wrong in a way that no evidence shows; keeps stated confidence below 1.
DOUBT = 0.02
# The same where two effects are named (something outside the catalogue may look like a pair) or none: set from blind cases of other seeds
# than those that are reported.
DOUBT_OF_PAIRS = 0.06
DOUBT_OF_UNEXPLAINED = 0.08


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The answer for one motor. Immutable.

    Parameters
    ----------
    verdict : {"adequate", "missing-effect", "family", "instrument", "unexplained"}
    effects : tuple of str
        What to add, best first; for a family, the best member.
    families : tuple of tuple of str
        Groups that these data cannot tell apart.
    confidence : float
        Probability that the verdict is right.
    base, best : Fit
        Before, and with the named effects (for `unexplained`: with the best that was found).
    candidates : tuple of Candidate
        Single effects on top of `base`, best evidence first.
    probabilities : dict
        Posterior of each candidate.
    steps : tuple of Fit
        From base to best, one effect at a time.
    where : tuple of dict
        Where the base model fails.
    following : dict
        The next measurement: id and why.
    reasons : tuple of str
        The verdict in words.
    validation : dict
        How much better `best` predicts left-out data than `base`, in nats: `bands` and `short_to_open`; empty where they are the same.
    """

    verdict: Verdict
    effects: tuple[str, ...]
    families: tuple[tuple[str, ...], ...]
    confidence: float
    base: Fit
    best: Fit
    candidates: tuple[Candidate, ...]
    probabilities: dict[str, float]
    steps: tuple[Fit, ...]
    where: tuple[JsonDict, ...]
    following: JsonDict
    reasons: tuple[str, ...]
    validation: JsonDict = field(default_factory=dict)

    @cached_property
    def left_over(self) -> Remainder | None:
        """For `unexplained`: what any causal model would reach, where the rest is, where to look; worked out when first asked for."""
        return remainder(self.base, self.best) if self.verdict == "unexplained" else None

    @property
    def said(self) -> tuple[str, ...]:
        """The reasons with what is left over; what is wrong with the data comes first."""
        if self.left_over is None:
            return self.reasons
        return (*self.left_over.reasons, *self.reasons) if self.left_over.about_the_data else (*self.reasons, *self.left_over.reasons)

    def to_dict(self) -> JsonDict:
        """The contract's JSON."""
        top = self.candidates[0].log_evidence if self.candidates else 0.0
        return {
            "schema": "motoremi.diagnosis/1",
            "verdict": self.verdict,
            "effects": list(self.effects),
            "families": [list(family) for family in self.families],
            "confidence": self.confidence,
            "base": _figures(self.base),
            "best": _figures(self.best),
            "where": [dict(span) for span in self.where],
            "candidates": [
                {
                    "effect": candidate.effect,
                    "family": find_effect(candidate.effect).effect.family,
                    "probability": self.probabilities[candidate.effect],
                    "chi2_reduced": candidate.fit.chi2_reduced,
                    "rms_error_percent": candidate.fit.rms_error_percent,
                    "delta_bic": 2 * (top - candidate.log_evidence),
                    "parameters": candidate.parameters(),
                    "plausible": candidate.plausible,
                }
                for candidate in self.candidates
            ],
            "next_measurement": dict(self.following),
            "floor_percent": self.base.floor_percent,
            "analyser": self.base.measurement.analyser.name,
            "reasons": list(self.said),
            **({} if self.left_over is None else {"remainder": self.left_over.to_dict()}),
            "cross_validation": dict(self.validation) or None,
            "caveats": self.base.measurement.caveats(),
        }

    def __repr__(self) -> str:
        lines = [f"Diagnosis: {self.verdict}" + (f" ({', '.join(self.effects)})" if self.effects else "")]
        lines += [f"  {reason}" for reason in self.said]
        lines.append(f"  confidence {self.confidence:.2f}; next: {self.following['why']}")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{html.escape(c.effect)}</td><td>{self.probabilities[c.effect]:.3g}</td><td>{c.fit.chi2_reduced:.4g}</td>"
            f"<td>{c.fit.rms_error_percent:.3g} %</td><td>{html.escape(c.describe())}</td></tr>"
            for c in self.candidates[:8]
        )
        head = "<tr><th>effect</th><th>probability</th><th>chi2</th><th>error</th><th>parameters</th></tr>"
        return f"<b>{html.escape(self.verdict)}</b> {html.escape('; '.join(self.said))}<table>{head}{rows}</table>"

    def plot(self) -> Figure:
        """The candidates by evidence, those named and those not told apart marked."""
        from motoremi.report.plots import ranking_figure

        return ranking_figure(self.to_dict())


def _figures(fit: Fit) -> JsonDict:
    return {
        "effects": list(fit.effects),
        "chi2_reduced": fit.chi2_reduced,
        "rms_error_percent": fit.rms_error_percent,
        "rms_error_db": fit.rms_error_db,
    }


def diagnose(fit: Fit, progress: Progress | None = None) -> Diagnosis:
    """Which physical effect is missing from a fitted model.

    Parameters
    ----------
    fit : Fit
        The model to start from: the paper's circuit, or one with effects already.
    progress : callable, optional
        Told what is being tried, how much is done, and of how much.

    Returns
    -------
    Diagnosis
    """
    where = compare(fit).where
    candidates = rank(fit, progress)
    weight = effective_share(candidates[0].fit if candidates[0].good else fit)
    probabilities = _posterior(fit, candidates, weight)
    none = 1 - sum(probabilities.values())
    if is_good(fit) and (none >= LEAST_DOUBT or weight * (candidates[0].log_evidence - fit.log_evidence) < LEAST_GAIN):
        return _adequate(fit, candidates, probabilities, none, where)
    explanation = _explain(fit, candidates, progress)
    if not is_good(explanation.best):
        if fit.objective < good_enough(fit.problem) and explanation.best.log_evidence - fit.log_evidence < LEAST_GAIN:
            return _adequate(fit, candidates, probabilities, none, where)
        return _unexplained(fit, explanation, candidates, probabilities, where)
    return _named(fit, explanation, candidates, probabilities, where)


def _posterior(fit: Fit, candidates: Sequence[Candidate], weight: float) -> dict[str, float]:
    """Probability of each single effect, and of none with what is left; `weight` is the share of independent points."""
    share = np.log((1 - PRIOR_OF_NONE) / max(1, len(candidates)))
    scores = np.array([np.log(PRIOR_OF_NONE) + weight * fit.log_evidence, *(share + weight * c.log_evidence for c in candidates)])
    weights = np.exp(scores - scores.max())
    weights /= weights.sum()
    return {candidate.effect: float(weight) for candidate, weight in zip(candidates, weights[1:], strict=True)}


@dataclass(frozen=True, eq=False)
class _Explanation:
    """The best model that was found.

    Parameters
    ----------
    steps : tuple of Fit
        From base to best, one effect at a time.
    rivals : dict
        For each added effect, the candidates for its place, on top of all the others.
    """

    steps: tuple[Fit, ...]
    rivals: dict[str, list[Candidate]]

    @property
    def best(self) -> Fit:
        return self.steps[-1]


def _explain(fit: Fit, candidates: list[Candidate], progress: Progress | None) -> _Explanation:
    """One effect if one reaches the noise, else the best pair: each of the two is sought again with the other in place."""
    if candidates[0].good:
        return _alone(fit, candidates)
    start, ranked = rank_pairs(candidates, progress)
    if candidates[0].good or ranked[0].log_evidence - candidates[0].log_evidence < LEAST_GAIN:
        return _alone(fit, candidates)
    kept = start.fit
    for _ in range(EXCHANGES):
        pair = ranked[0]
        first = kept.effects[-1]
        found = _Explanation((fit, kept, pair.fit), {pair.effect: ranked, first: []})
        if not pair.good:
            break
        one, other = members(pair.fit, first, pair.effect)
        if one.good or other.good:
            single = max((one, other), key=lambda candidate: candidate.log_evidence)
            rest = (candidate for candidate in candidates if candidate.effect != single.effect)
            return _alone(fit, sorted((single, *rest), key=lambda candidate: -candidate.log_evidence))
        seconds = refitted(other.fit, glances(other.fit, RIVALS, pair.fit.parameters, first, progress))
        found.rivals[first] = seconds
        if seconds[0].log_evidence >= pair.log_evidence + LEAST_GAIN:
            kept, ranked = other.fit, seconds
            continue
        better = _both_replaced(candidates, pair, seconds, ranked)
        if better is None:
            break
        kept, ranked = better
    return found


def _both_replaced(
    singles: Sequence[Candidate], pair: Candidate, firsts: Sequence[Candidate], seconds: Sequence[Candidate]
) -> tuple[Fit, list[Candidate]] | None:
    """Two other effects that describe the data better than a pair, each from the rivals for one of its places."""
    alone = {candidate.effect: candidate for candidate in singles}
    others = [{one.effect: one.look for one in rivals if one.effect not in pair.fit.effects} for rivals in (firsts, seconds)]
    looks = {names: look for names, look in crossed(alone, pair.fit.parameters, *others).items() if look.right}
    if not looks:
        return None
    first, second = nearest(looks)[0]
    kept, near = alone[first].fit, looks[first, second]
    if refitted(kept, {second: near})[0].log_evidence < pair.log_evidence + LEAST_GAIN:
        return None
    return kept, refitted(kept, {**glances(kept, RIVALS, near.values(), second), second: near})


def _alone(fit: Fit, candidates: list[Candidate]) -> _Explanation:
    return _Explanation((fit, candidates[0].fit), {candidates[0].effect: candidates})


def _families(explanation: _Explanation) -> tuple[list[tuple[str, ...]], float]:
    """For each named effect, those that would do as well in its place; and the probability of the named set among all such."""
    families: list[tuple[str, ...]] = []
    chance = 1.0
    best = explanation.best
    weight = effective_share(best)
    for effect, rivals in explanation.rivals.items():
        evidence = {c.effect: c.log_evidence for c in rivals if c.good}
        prior = next((c.log_evidence - c.fit.log_evidence for c in rivals if c.effect == effect), 0.0)
        evidence[effect] = max(evidence.get(effect, -np.inf), best.log_evidence + prior)
        top = max(evidence.values())
        share = {name: float(np.exp(weight * (value - top))) for name, value in evidence.items()}
        total = sum(share.values())
        members = sorted((n for n, v in share.items() if n != effect and v >= FAMILY_SHARE), key=lambda n: -share[n])[: LARGEST_FAMILY - 1]
        if members:
            families.append((effect, *members))
        chance *= sum(share[name] for name in (effect, *members)) / total
    return families, chance


def _adequate(fit: Fit, candidates: list[Candidate], probabilities: dict[str, float], none: float, where: tuple[JsonDict, ...]) -> Diagnosis:
    reason = (
        f"the model describes the sweeps down to noise and analyser (chi2_reduced {fit.chi2_reduced:.3g}, error "
        f"{fit.rms_error_percent:.2g} %, floor {fit.floor_percent:.2g} %)"
    )
    shaped = has_shape(fit)
    reasons = [reason]
    if shaped:
        reasons.append("what is left swings along frequency slightly more than by chance, and no effect describes that: repeat the sweeps")
    reasons.append("an effect too weak to be seen by this analyser over this band cannot be ruled out")
    return Diagnosis(
        verdict="adequate",
        effects=(),
        families=(),
        confidence=(1 - (DOUBT_OF_UNEXPLAINED if shaped else DOUBT)) * max(none, 0.5),
        base=fit,
        best=fit,
        candidates=tuple(candidates),
        probabilities=probabilities,
        steps=(fit,),
        where=where,
        following=next_measurement(fit, []),
        reasons=tuple(reasons),
    )


def _unexplained(
    fit: Fit,
    explanation: _Explanation,
    candidates: list[Candidate],
    probabilities: dict[str, float],
    where: tuple[JsonDict, ...],
) -> Diagnosis:
    best = explanation.best
    left = compare(best).where
    spans = "; ".join(f"{span['sweep']} {show_band(*span['band_hz'])}" for span in left[:3]) or "spread over both sweeps"
    tried = len(possible_effects(fit))
    return Diagnosis(
        verdict="unexplained",
        effects=(),
        families=(),
        confidence=1 - DOUBT_OF_UNEXPLAINED,
        base=fit,
        best=best,
        candidates=tuple(candidates),
        probabilities=probabilities,
        steps=explanation.steps,
        where=where,
        following=next_measurement(fit, [c.fit for c in candidates[:3]]),
        reasons=(
            f"something is missing (error {fit.rms_error_percent:.3g} %, floor {fit.floor_percent:.2g} %) and none of {tried} effects, "
            "nor two of them together, explains it",
            f"closest: {' + '.join(best.effects) or 'none'}, which leaves {best.rms_error_percent:.3g} % ({spans})",
        ),
    )


def _named(
    fit: Fit,
    explanation: _Explanation,
    candidates: list[Candidate],
    probabilities: dict[str, float],
    where: tuple[JsonDict, ...],
) -> Diagnosis:
    best = explanation.best
    families, chance = _families(explanation)
    validation = cross_validated(best).gain_over(cross_validated(fit))
    added = best.effects[len(fit.effects) :]
    groups = [{find_effect(n).effect.group for n in family} for family in families]
    all_instrument = all(find_effect(n).effect.group == "instrument" for n in added)
    reasons = [
        f"adding {' and '.join(added)} takes the error from {fit.rms_error_percent:.3g} % to {best.rms_error_percent:.3g} % "
        f"(noise floor {best.floor_percent:.2g} %)"
    ]
    verdict: Verdict
    if all_instrument and all(group == {"instrument"} for group in groups):
        verdict = "instrument"
        reasons.append("the analyser or its fixture is beyond its specification; the motor's circuit needs nothing")
    elif families:
        verdict = "family"
    else:
        verdict = "missing-effect"
    reasons += [f"these sweeps cannot tell {', '.join(family[:-1])} and {family[-1]} apart" for family in families]
    if min(gain for gain in validation.values() if gain is not None) < 0:
        reasons.append("but it predicts left-out parts of the sweeps no better than before: repeat the sweeps before you rely on it")
    rivals = [c.fit for family in families for c in explanation.rivals[family[0]] if c.effect in family]
    return Diagnosis(
        verdict=verdict,
        effects=tuple(added),
        families=tuple(families),
        confidence=(1 - (DOUBT if len(added) == 1 else DOUBT_OF_PAIRS)) * chance,
        base=fit,
        best=best,
        candidates=tuple(candidates),
        probabilities=probabilities,
        steps=explanation.steps,
        where=where,
        following=next_measurement(best, rivals),
        reasons=tuple(reasons),
        validation=validation,
    )
