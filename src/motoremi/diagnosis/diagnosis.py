"""The verdict: what is missing, how sure that is, and what these data cannot tell apart."""

from __future__ import annotations

import html
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from motoremi.arrays import JsonDict
from motoremi.diagnosis.compare import compare
from motoremi.diagnosis.evidence import Candidate, effective_share, is_good, possible_effects, rank
from motoremi.diagnosis.following import next_measurement
from motoremi.fitting.fit import refit_with, refit_without
from motoremi.fitting.result import Fit
from motoremi.model.effects import find_effect
from motoremi.quantities import show_band

Verdict: TypeAlias = Literal["adequate", "missing-effect", "family", "instrument", "unexplained"]
Progress: TypeAlias = Callable[[str, int, int], None]

# Most effects that are sought at once.
MOST_EFFECTS = 3
# Odds against any effect before looking: half the motors that come to the bench need none, the rest share the catalogue.
PRIOR_OF_NONE = 0.5
# Log evidence that a further effect must bring, beyond its share of the prior, to be believed.
LEAST_GAIN = 4.0
# Members of a family have at least this share of the best one's posterior.
FAMILY_SHARE = 0.01
# How often the catalogue or the noise model is wrong in a way that no evidence shows; keeps stated confidence below 1.
DOUBT = 0.02


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
            "reasons": list(self.reasons),
            "caveats": self.base.measurement.caveats(),
        }

    def __repr__(self) -> str:
        lines = [f"Diagnosis: {self.verdict}" + (f" ({', '.join(self.effects)})" if self.effects else "")]
        lines += [f"  {reason}" for reason in self.reasons]
        lines.append(f"  confidence {self.confidence:.2f}; next: {self.following['why']}")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{html.escape(c.effect)}</td><td>{self.probabilities[c.effect]:.3g}</td><td>{c.fit.chi2_reduced:.4g}</td>"
            f"<td>{c.fit.rms_error_percent:.3g} %</td><td>{html.escape(c.describe())}</td></tr>"
            for c in self.candidates[:8]
        )
        head = "<tr><th>effect</th><th>probability</th><th>chi2</th><th>error</th><th>parameters</th></tr>"
        return f"<b>{html.escape(self.verdict)}</b> {html.escape('; '.join(self.reasons))}<table>{head}{rows}</table>"


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
    if is_good(fit) and (none >= 0.5 or weight * (candidates[0].log_evidence - fit.log_evidence) < LEAST_GAIN):
        return _adequate(fit, candidates, probabilities, none, where)
    steps, last = _forward(fit, candidates, progress)
    best = steps[-1]
    if not is_good(best):
        return _unexplained(fit, best, candidates, probabilities, steps, where)
    families, chance = _families(fit, best, last)
    return _named(fit, best, candidates, probabilities, steps, where, families, chance)


def _posterior(fit: Fit, candidates: Sequence[Candidate], weight: float) -> dict[str, float]:
    """Probability of each single effect, and of none with what is left; `weight` is the share of independent points."""
    share = np.log((1 - PRIOR_OF_NONE) / max(1, len(candidates)))
    scores = np.array([np.log(PRIOR_OF_NONE) + weight * fit.log_evidence, *(share + weight * c.log_evidence for c in candidates)])
    weights = np.exp(scores - scores.max())
    weights /= weights.sum()
    return {candidate.effect: float(weight) for candidate, weight in zip(candidates, weights[1:], strict=True)}


def _forward(fit: Fit, candidates: list[Candidate], progress: Progress | None) -> tuple[list[Fit], list[Candidate]]:
    """Add the best effect, look again, until the noise is reached, evidence ends, or enough is enough; then take out what is not needed."""
    steps = [fit]
    ranked = candidates
    while len(steps) <= MOST_EFFECTS:
        steps.append(ranked[0].fit)
        if ranked[0].good or len(steps) > MOST_EFFECTS:
            break
        further = rank(steps[-1], progress)
        if further[0].log_evidence - steps[-1].log_evidence < LEAST_GAIN:
            break
        ranked = further
    if len(steps) > 2 and is_good(steps[-1]):
        pruned = _pruned(fit, steps[-1])
        if pruned is not None:
            steps = [fit, *_ladder_to(fit, pruned)]
            ranked = rank(steps[-2], progress)
    return steps, ranked


def _pruned(base: Fit, full: Fit) -> Fit | None:
    """The model without the effects that it does as well without; None if all are needed."""
    best, shorter = full, None
    for effect in full.effects[len(base.effects) :]:
        if effect not in best.effects or len(best.effects) - len(base.effects) < 2:
            continue
        without = refit_without(best, effect)
        if is_good(without) and without.log_evidence > best.log_evidence - LEAST_GAIN:
            best = shorter = without
    return shorter


def _ladder_to(base: Fit, target: Fit) -> list[Fit]:
    """Steps from base to target, one effect at a time."""
    steps: list[Fit] = []
    current = base
    added = list(target.effects[len(base.effects) :])
    for effect in added[:-1]:
        current = refit_with(current, effect, thorough=False)
        steps.append(current)
    return [*steps, target]


def _families(base: Fit, best: Fit, ranked: Sequence[Candidate]) -> tuple[list[tuple[str, ...]], float]:
    """For each named effect, those that would do as well in its place; and the probability of the named set among all such."""
    added = best.effects[len(base.effects) :]
    families: list[tuple[str, ...]] = []
    chance = 1.0
    weight = effective_share(best)
    for effect in added:
        # What could stand in this effect's place: a ranking on top of all the others.
        rivals = ranked if effect == added[-1] else rank(refit_without(best, effect))
        evidence = {c.effect: c.log_evidence for c in rivals if c.good}
        top = max(evidence.values(), default=best.log_evidence)
        share = {name: float(np.exp(weight * (value - top))) for name, value in evidence.items()}
        members = sorted((n for n, v in share.items() if v >= FAMILY_SHARE), key=lambda n: -share[n])
        if effect in members:
            members.remove(effect)
        total = sum(share.values())
        if members:
            families.append((effect, *members))
            chance *= min(1.0, (share.get(effect, 1.0) + sum(share[m] for m in members)) / max(total, 1e-300))
        elif total > 0:
            chance *= share.get(effect, 1.0) / total
    return families, min(chance, 1.0)


def _adequate(fit: Fit, candidates: list[Candidate], probabilities: dict[str, float], none: float, where: tuple[JsonDict, ...]) -> Diagnosis:
    reason = (
        f"the model describes the sweeps down to noise and analyser (chi2_reduced {fit.chi2_reduced:.3g}, error "
        f"{fit.rms_error_percent:.2g} %, floor {fit.floor_percent:.2g} %)"
    )
    return Diagnosis(
        verdict="adequate",
        effects=(),
        families=(),
        confidence=(1 - DOUBT) * max(none, 0.5),
        base=fit,
        best=fit,
        candidates=tuple(candidates),
        probabilities=probabilities,
        steps=(fit,),
        where=where,
        following=next_measurement(fit, []),
        reasons=(reason, "an effect too weak to be seen by this analyser over this band cannot be ruled out"),
    )


def _unexplained(
    fit: Fit,
    best: Fit,
    candidates: list[Candidate],
    probabilities: dict[str, float],
    steps: list[Fit],
    where: tuple[JsonDict, ...],
) -> Diagnosis:
    left = compare(best).where
    spans = "; ".join(f"{span['sweep']} {show_band(*span['band_hz'])}" for span in left[:3]) or "spread over both sweeps"
    tried = len(possible_effects(fit))
    return Diagnosis(
        verdict="unexplained",
        effects=(),
        families=(),
        confidence=1 - DOUBT,
        base=fit,
        best=best,
        candidates=tuple(candidates),
        probabilities=probabilities,
        steps=tuple(steps),
        where=where,
        following=next_measurement(fit, [c.fit for c in candidates[:3]]),
        reasons=(
            f"something is missing (error {fit.rms_error_percent:.3g} %, floor {fit.floor_percent:.2g} %) and none of {tried} effects, "
            f"nor up to {MOST_EFFECTS} of them together, explains it",
            f"closest: {' + '.join(best.effects) or 'none'}, which leaves {best.rms_error_percent:.3g} % ({spans})",
        ),
    )


def _named(
    fit: Fit,
    best: Fit,
    candidates: list[Candidate],
    probabilities: dict[str, float],
    steps: list[Fit],
    where: tuple[JsonDict, ...],
    families: list[tuple[str, ...]],
    chance: float,
) -> Diagnosis:
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
    rivals = [c.fit for c in candidates if any(c.effect in family for family in families)]
    return Diagnosis(
        verdict=verdict,
        effects=tuple(added),
        families=tuple(families),
        confidence=(1 - DOUBT) * chance,
        base=fit,
        best=best,
        candidates=tuple(candidates),
        probabilities=probabilities,
        steps=tuple(steps),
        where=where,
        following=next_measurement(best, rivals),
        reasons=tuple(reasons),
    )
