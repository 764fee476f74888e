"""The verdict: the missing effects, the confidence, and the effects that these data cannot distinguish."""

from __future__ import annotations

import dataclasses
import html
from collections.abc import Container, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from math import inf
from typing import TYPE_CHECKING

from motoremi.arrays import JsonDict, Progress
from motoremi.data.measurement import Measurement
from motoremi.diagnosis.belief import RELIABLE, Verdict, after_verdict
from motoremi.diagnosis.candidates import Candidate, large_elements
from motoremi.diagnosis.decision import ONE_EFFECT, judge
from motoremi.diagnosis.declared import Declared, likeliest, of_the_base
from motoremi.diagnosis.explore import Key, best_of, ranked
from motoremi.diagnosis.findings import (
    Finding,
    exchanged_in,
    hardly_seen,
    of_the_amount,
    of_the_analyser,
    of_the_declaration,
    of_the_hardly_seen,
    of_the_labels,
    of_the_noise,
    of_the_resistance,
    of_the_scatter,
    of_the_sweeps,
    of_the_values,
    repeats_disagree_in,
    shows_nothing,
    the_same_twice,
    wrong_phase_in,
)
from motoremi.diagnosis.held_values import of_the_held, of_the_held_beside_an_effect
from motoremi.diagnosis.informed import confidence_of, departs, informed, of_the_operator, reasons_of, rivals_in
from motoremi.diagnosis.judgement import COMMONEST_FIRST, Judgement, distributed
from motoremi.diagnosis.machine_modes import machine_with_modes
from motoremi.diagnosis.needed import of_the_analyser_alone
from motoremi.diagnosis.outliers import outlying
from motoremi.diagnosis.reasons import reasons_for, short_strap_h
from motoremi.diagnosis.thresholds import ALIKE, CLEAR_GAIN, HALF, NEARLY_ALIKE
from motoremi.diagnosis.validation import cross_validated
from motoremi.diagnosis.whole_machine import whole_machine
from motoremi.drawing import figure_of
from motoremi.errors import BadInput
from motoremi.fitting.fit import fit as fit_again
from motoremi.fitting.result import Fit
from motoremi.fitting.search import BEYOND_SIGMA, PLAIN, arrived_on_all
from motoremi.given import refuse_other
from motoremi.inspection.compare import compare
from motoremi.inspection.unexplained import Remainder, remainder
from motoremi.investigation.next_measurement import next_measurement
from motoremi.investigation.question import Question, next_question
from motoremi.investigation.rivals import Rivals
from motoremi.model.effects import find_effect
from motoremi.model.effects.names import as_sum
from motoremi.progress import part
from motoremi.quantities import percent
from motoremi.threads import one_blas_thread
from motoremi.workers import Map, own_processes

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

# Largest number of names in a family; the probability of further members is subtracted from the confidence.
LARGEST_FAMILY = 6
# Serious findings for which the verdict is `data` if no model is accepted.
ABOUT_THE_DATA = frozenset(
    {"wrong-phase", "sweeps-disagree", "interference", "drift", "correlated-noise", "negative-resistance", "values-disagree"}
)
# Findings that make the data useless whatever the model, and the kind of their verdict.
CONTRADICTIONS = {
    "wrong-phase": "a phase that no passive part has",
    "sweeps-exchanged": "exchanged sweeps",
    "sweeps-disagree": "sweeps that contradict each other",
}
# Number of searches for outliers, each without those found before.
LOOKS = 3
# A new search without the outliers is made only if the base or one of so many single effects, the most probable ones, describes all other points.
# The outliers are as far from all smooth models, so they hardly change which of these are the most probable.
LIKELIEST = 4
# Sets of effects that are listed.
LISTED = 12
# Resonances of a winding that are missing cost more than this.
SEVERAL_PERCENT = 5.0
# Progress, as shares of the longest diagnosis, at the end of the search, of the second one without outliers, and of those under other analysers.
SEARCH, AGAIN, TOGETHER = 0.5, 0.6, 0.75


@dataclass(frozen=True, eq=False)
class Searched:
    """Result of the search in the reference sweeps, without the other measurements.

    Parameters
    ----------
    fit : Fit
        The fit from which the search started.
    declared : Declared
    """

    fit: Fit
    declared: Declared


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The answer for one set of sweeps. Immutable.

    Parameters
    ----------
    verdict : str
        `adequate`, `missing-effect`, `family` (these data do not distinguish its members), `instrument`, `data` (they contradict
        themselves) or `unexplained`.
    effects : tuple of str
        What to add, the best of each family.
    families : tuple of tuple of str
        For each named effect with alternatives: all of them, the best first.
    confidence : float
        Probability that the answer is true.
    base, best : Fit
        Before, and with the named effects (for `unexplained`: with the best that was found).
    candidates : tuple of Candidate
        Single effects added to `base`, the most probable first.
    probabilities : dict
        Posterior of each effect, shared among the effects of a set.
    posterior : dict
        Posterior of each set that was fitted on all points.
    steps : tuple of Fit
        From base to best, one effect at a time.
    where : tuple of dict
        Where the base model fails.
    findings : tuple of Finding
        What the data themselves show.
    following : dict
        The next measurement: id and why.
    reasons : tuple of str
        The verdict in words.
    validation : dict
        How much better `best` predicts left-out data than `base`, in nats: `bands` and `short_to_open`; empty if they are the same.
    left_over : Remainder, optional
        If nothing explains the data: error of the best causal model, frequencies of the rest, elements to inspect.
    rivals : Rivals, optional
        The remaining explanations, with the information of sweeps under conditions and single values (`rivals.taught`).
    question : Question, optional
        The next measurement to distinguish them.
    searched : Searched, optional
        The search from which the diagnosis was made.
    """

    verdict: Verdict
    effects: tuple[str, ...]
    families: tuple[tuple[str, ...], ...]
    confidence: float
    base: Fit
    best: Fit
    candidates: tuple[Candidate, ...]
    probabilities: Mapping[str, float]
    posterior: Mapping[Key, float]
    steps: tuple[Fit, ...]
    where: tuple[JsonDict, ...]
    findings: tuple[Finding, ...]
    following: JsonDict
    reasons: tuple[str, ...]
    validation: JsonDict = field(default_factory=dict)
    left_over: Remainder | None = None
    rivals: Rivals | None = None
    question: Question | None = None
    searched: Searched | None = None

    @one_blas_thread
    def informed_by(self, measurement: Measurement) -> Diagnosis:
        """The diagnosis with other sweeps under conditions and other single values; nothing is searched again.

        Parameters
        ----------
        measurement : Measurement
            Its reference sweeps are those of this diagnosis.
        """
        if self.searched is None:
            raise BadInput("this diagnosis was not made by a search: diagnose the fit again")
        return _informed(self.searched, measurement)

    @property
    def said(self) -> tuple[str, ...]:
        """The reasons with the findings; what is serious comes first."""
        serious = tuple(finding.why for finding in self.findings if finding.serious)
        others = tuple(finding.why for finding in self.findings if not finding.serious)
        rest = () if self.left_over is None else self.left_over.reasons
        said = (*serious, *self.reasons, *rest, *others) if self.verdict == "data" else (*self.reasons, *rest, *serious, *others)
        return tuple(dict.fromkeys(said))

    def to_dict(self) -> JsonDict:
        """Plain data in the schema `motoremi.diagnosis/2`."""
        top = max((candidate.score for candidate in self.candidates), default=0.0)
        left = self.best.unexplained_percent
        return {
            "schema": "motoremi.diagnosis/2",
            "verdict": self.verdict,
            "effects": list(self.effects),
            "families": [list(family) for family in self.families],
            "confidence": self.confidence,
            "findings": [finding.to_dict() for finding in self.findings],
            "base": _figures(self.base),
            "best": {**_figures(self.best), "parameters": dict(self.best.parameters)},
            "unexplained_percent": dict(left),
            "floor_percent": self.best.floor_percent,
            "noise_percent": self.best.noise_percent,
            "accuracy_percent": self.base.measurement.accuracy_percent,
            "where": [dict(span) for span in self.where],
            "candidates": [
                {
                    "effect": candidate.effect,
                    "family": find_effect(candidate.effect).effect.family,
                    "probability": self.probabilities[candidate.effect],
                    "chi2_reduced": candidate.fit.chi2_reduced,
                    "rms_error_percent": candidate.fit.rms_error_percent,
                    "unexplained_percent": candidate.fit.unexplained_percent["value"],
                    "delta_bic": 2 * (top - candidate.score),
                    "parameters": candidate.parameters(),
                    "plausible": candidate.plausible,
                }
                for candidate in self.candidates
            ],
            "sets": [{"effects": list(key), "probability": share} for key, share in self.likeliest_sets],
            "next_measurement": dict(self.following),
            **({} if self.question is None else {"question": self.question.to_dict()}),
            **({} if self.rivals is None or not self.rivals.taught else {"taught": [one.to_dict() for one in self.rivals.taught]}),
            "analyser": self.base.measurement.analyser.name,
            "reasons": list(self.said),
            **({} if self.left_over is None else {"remainder": self.left_over.to_dict()}),
            "cross_validation": dict(self.validation) or None,
            "caveats": self.base.measurement.caveats(),
        }

    def to_frame(self) -> pd.DataFrame:
        """A pandas table of the candidates by effect: family, probability, chi2_reduced, errors in percent, delta_bic, plausible."""
        import pandas as pd

        rows = [{name: value for name, value in one.items() if name != "parameters"} for one in self.to_dict()["candidates"]]
        columns = ["family", "probability", "chi2_reduced", "rms_error_percent", "unexplained_percent", "delta_bic", "plausible"]
        return pd.DataFrame(rows, columns=["effect", *columns]).set_index("effect")

    @property
    def likeliest_sets(self) -> list[tuple[Key, float]]:
        """Sets of effects and their probabilities, the most probable first."""
        return sorted(self.posterior.items(), key=lambda pair: -pair[1])[:LISTED]

    def __repr__(self) -> str:
        families = {family[0]: " or ".join(family) for family in self.families}
        named = ", ".join(families.get(effect, effect) for effect in self.effects)
        lines = [f"Diagnosis: {self.verdict}" + (f" ({named})" if named else "")]
        lines += [f"  {reason}" for reason in self.said]
        lines.append(f"  confidence {self.confidence:.2f}; next: {self.following['why']}")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{html.escape(c.effect)}</td><td>{after_verdict(self.probabilities[c.effect], self.verdict, self.confidence):.3g}</td>"
            f"<td>{percent(c.fit.rms_error_percent)}</td>"
            f"<td>{percent(c.fit.unexplained_percent['value'], 2)}</td><td>{html.escape(c.describe())}</td></tr>"
            for c in self.candidates[:8]
        )
        head = "<tr><th>effect</th><th>probability</th><th>error</th><th>undescribed</th><th>parameters</th></tr>"
        return f"<b>{html.escape(self.verdict)}</b> {html.escape('; '.join(self.said))}<table>{head}{rows}</table>"

    def plot(self) -> Figure:
        """The candidates by evidence; named effects and their families are marked."""
        return figure_of(self)


def _figures(fit: Fit) -> JsonDict:
    return {
        "effects": list(fit.effects),
        "chi2_reduced": fit.chi2_reduced,
        "rms_error_percent": fit.rms_error_percent,
        "rms_error_db": fit.rms_error_db,
        "corrected_error_percent": fit.corrected_error_percent,
        "analyser_sigma": fit.analyser_sigma,
        "unexplained_percent": fit.unexplained_percent["value"],
    }


@one_blas_thread
def diagnose(fit: Fit, progress: Progress | None = None, map: Map | None = None) -> Diagnosis:
    """Find the physical effect that is missing from a fitted model.

    Parameters
    ----------
    fit : Fit
        The model to start from: the paper's circuit, or one with effects already.
    progress : callable, optional
        Called with a text, the work done and its total.
    map : callable, optional
        Distributes the work: takes a function and the jobs, and returns the results in their order, as `Executor.map` does. By default processes
        of its own, one for each core, if that is safe. The result does not depend on it.

    Returns
    -------
    Diagnosis
    """
    refuse_other(fit, Fit, "diagnose needs a Fit")
    if map is not None and not callable(map):
        raise BadInput("map must be a function such as the built-in map, or Executor.map")
    search, again = part(progress, 0.0, SEARCH), part(progress, SEARCH, AGAIN)
    with own_processes() if map is None else nullcontext(map) as each:
        if any(contradicts(fit.measurement) is not None for contradicts in (wrong_phase_in, exchanged_in, the_same_twice, repeats_disagree_in)):
            # No model will be accepted, unless the base or one effect makes both sweeps those of one motor; the others are ranked for display.
            alone = Declared(judge(fit, search, ONE_EFFECT, each))
            if contradiction_in(fit.measurement, alone.judgement) is not None:
                return _informed(Searched(fit, alone), fit.measurement, each)
        under_others, last = part(progress, AGAIN, TOGETHER), part(progress, TOGETHER, 1.0)
        of_base: Declared | None = None

        def is_as_declared(best: Candidate) -> bool:
            nonlocal of_base
            of_base = of_the_base(fit, best, under_others, each)
            return of_base is None

        first = judge(fit, search, each=each, further=is_as_declared)
        declared = of_base or likeliest(_cleaned(first, again, each), under_others, each)
        declared = _with_whole_machine(declared, last, each)
        return _informed(Searched(fit, declared), fit.measurement, each)


def _informed(searched: Searched, measurement: Measurement, each: Map = map) -> Diagnosis:
    """The diagnosis from the search in the reference sweeps, updated by sweeps under conditions and single values."""
    declared = searched.declared
    rivals = rivals_in(declared.judgement, measurement)
    judgement = informed(declared.judgement, rivals)
    against = contradiction_in(searched.fit.measurement, declared.judgement)
    left = None if judgement.accepted or against is not None else remainder(judgement.base, judgement.closest.fit, not judgement.described, each)
    findings = (*(() if against is None else (against,)), *_findings(searched.fit, declared, left, each), *of_the_operator(rivals))
    return dataclasses.replace(_concluded(judgement, findings, left, rivals, measurement, against, each), searched=searched)


def _cleaned(first: Judgement, progress: Progress | None, each: Map) -> Judgement:
    """The judgement without outliers, if there are any; `first` otherwise.

    A point is an outlier only if no effect with usual values describes it too; a resonance narrower than the point spacing fits any single point.
    """
    if first.model.done and not first.model.unusual:
        return first
    return _without_outliers(first, first.base, progress, each) or _without_outliers(first, first.best.fit, progress, each) or first


def _with_whole_machine(declared: Declared, progress: Progress | None, each: Map) -> Declared:
    """With the ordinary parts of a machine together, if nothing is accepted and they come much closer, else with modes of its winding beside them.

    They are not tried if less than a per cent is left: the laws of machines are not known more accurately than that.
    """
    judgement = declared.judgement
    left_percent = 0.0 if judgement.accepted else judgement.closest_found.fit.unexplained_percent["value"]
    if left_percent <= 100 * PLAIN:
        return declared
    closest_percent = judgement.closest_found.fit.rms_error_percent
    with_modes = left_percent > SEVERAL_PERCENT
    # Modes may begin at any parts; without them only parts that come closer are of use.
    whole = whole_machine(judgement.base, each, part(progress, 0.0, 0.5), inf if with_modes else closest_percent)
    if with_modes and (whole is None or whole.fit.rms_error_percent > SEVERAL_PERCENT):
        whole = machine_with_modes(judgement.base, whole, each, part(progress, 0.5, 1.0)) or whole
    if whole is None:
        return declared
    # The analyser's errors are in the circuit's error, which falls no further than to their size.
    described = whole.fit.unexplained_percent["value"] <= HALF * left_percent and whole.fit.rms_error_percent <= closest_percent
    if whole.fit.rms_error_percent > HALF * closest_percent and not described:
        return declared
    return dataclasses.replace(declared, judgement=dataclasses.replace(judgement, whole=whole))


def contradiction_in(measurement: Measurement, judgement: Judgement) -> Finding | None:
    """The finding that makes the data useless: a phase that no passive part has, repeats that differ, exchanged sweeps, or one under two names.

    Sweeps are not exchanged if a model describes them as they are.
    """
    in_themselves = wrong_phase_in(measurement) or repeats_disagree_in(measurement)
    return in_themselves or (None if judgement.accepted else exchanged_in(measurement)) or twice_in(measurement, judgement)


def twice_in(measurement: Measurement, judgement: Judgement) -> Finding | None:
    """The finding that both sweeps are one and the same; None if a model with usual values makes both sweeps those of one motor.

    A capacitor across a winding hides its far end. One sweep under two names is described only with a path to the frame of almost no impedance.
    """
    same, model = the_same_twice(measurement), judgement.model
    if same is None or not (judgement.accepted and model.ordinary):
        return same
    frame = [p for p in model.fit.motor.parameters if p.name in ("Cr", "Cf")]
    return None if all(p.usual is None or model.fit.parameters[p.name] <= p.usual[1] for p in frame) else same


def _without_outliers(first: Judgement, seen_by: Fit, progress: Progress | None, each: Map) -> Judgement | None:
    """The judgement without outliers.

    None if there are none, if no model describes all other points, or if that model also describes the outliers: then the first model was
    incomplete.
    """
    fit = first.base
    base, cleaned = seen_by, fit.measurement
    # From the base this is repeated, since the worst outliers hide others; from a model with effects it is not, since the refit of the base would
    # mark what the base lacks.
    for _ in range(LOOKS if seen_by is fit else 1):
        points = outlying(base)
        if not points:
            break
        cleaned = cleaned.with_outliers(points)
        base = fit_again(fit.motor, cleaned, seed=fit.seed, bounds=fit.bounds, held=fit.held)
    likeliest_singles = [one.fit for one in ranked(first.found, 1)[:LIKELIEST]]
    if cleaned is fit.measurement or not any(_describes(one, cleaned) for one in (fit, *likeliest_singles)):
        return None
    found = judge(base, progress, ONE_EFFECT, each)
    if not (found.accepted and found.model.done):
        return None
    return None if _describes(found.model.fit, fit.measurement) else found


def _describes(fit: Fit, measurement: Measurement) -> bool:
    """Whether the circuit of a fit, from its solution, describes another set of points of the same sweeps: nothing is left of them."""
    task = dataclasses.replace(fit.task, measurement=measurement)
    return arrived_on_all(task, [{**fit.parameters, **fit.nuisance}]).marginal.nothing_left >= 0.5


def _findings(fit: Fit, declared: Declared, left: Remainder | None, each: Map = map) -> tuple[Finding, ...]:
    judgement = declared.judgement
    found = (
        of_the_noise(judgement.base, 0.0 if judgement.accepted else judgement.closest_found.fit.unexplained_percent["value"])
        + of_the_resistance(fit.measurement)
        + of_the_scatter(judgement.base.measurement)
        + of_the_analyser(judgement.model.fit, judgement.accepted)
        + of_the_sweeps(left)
    )
    held = of_the_held(judgement.base)
    if not held and (not judgement.accepted or any(one.serious and one.id == "beyond-specification" for one in found)):
        held = of_the_held_beside_an_effect(judgement.base, each)
    found += held + of_the_labels(fit.measurement) + of_the_values(fit.measurement)
    found += of_the_amount(fit, (judgement.model if judgement.accepted else judgement.closest).fit, judgement.accepted and bool(judgement.named))
    if judgement.accepted and not judgement.named:
        found += of_the_hardly_seen(judgement.model.fit)
    if declared.instead is not None:
        found.insert(0, of_the_declaration(fit.measurement.analyser, declared.instead, declared.log_odds))
    return tuple(found)


def _concluded(
    judgement: Judgement,
    findings: tuple[Finding, ...],
    left: Remainder | None,
    rivals: Rivals,
    measurement: Measurement,
    against: Finding | None,
    each: Map,
) -> Diagnosis:
    """The diagnosis for a judgement; with a finding `against` the data the verdict is `data`."""
    question = next_question(rivals, measurement, each=each)
    base, belief = judgement.base, judgement.belief
    unknown = departs(rivals)
    named = () if judgement.accurate or not judgement.accepted or unknown else judgement.named
    best = judgement.model if judgement.accepted else judgement.closest
    families = tuple((name, *judgement.families[name])[:LARGEST_FAMILY] for name in named if judgement.families[name])
    verdict: Verdict
    if against is not None:
        verdict = "data"
    elif unknown and judgement.accepted:
        # What departs from every explanation may be one of two values that contradict each other.
        verdict = "data" if any(one.id == "values-disagree" for one in findings) else "unexplained"
    else:
        verdict = _verdict(judgement, named, families, findings, left)
    singles = [one for key, one in judgement.found.items() if len(key) == 1]
    inclusion = belief.inclusion
    probabilities = {one.effect: inclusion.get(one.effect, 0.0) for one in singles}
    if against is None:
        confidence = _confidence(judgement, verdict, named, families, findings, left, bool(rivals.taught))
    else:
        confidence = RELIABLE[CONTRADICTIONS[against.id]]
    validation: JsonDict = {} if best.fit is base else cross_validated(best.fit).gain_over(cross_validated(base))
    if verdict in ("unexplained", "data"):
        singles.sort(key=closeness)
        if base.measurement.terminations == ("short",):
            singles = commonest_of_the_closest_first(singles)
        remedies = [one.remedy for one in findings if one.serious and one.id in {*ABOUT_THE_DATA, *CONTRADICTIONS}]
        if verdict == "data" and remedies:
            following: JsonDict = {"id": "repeats", "why": remedies[0]}
            question = dataclasses.replace(question, why=f"these sweeps show nothing about the motor until they are right: {remedies[0]}")
        else:
            following = next_measurement(base, question, measurement.done)
    else:
        told = {name for family in families for name in family}
        singles = in_order(singles, judgement, (named, told))
        following = next_measurement(best.fit if named else base, question, measurement.done)
        if named and (correlated := _correlated(findings)) is not None:
            # Names from such data are not sure, whatever is measured besides.
            following = {"id": "repeats", "why": correlated.remedy}
            question = dataclasses.replace(question, why=f"{correlated.remedy}; after that: {question.why}")
    if against is not None:
        reasons = [against.why]
    elif unknown and judgement.accepted:
        reasons = [
            f"the reference sweeps alone are described by {as_sum(judgement.named) or 'the circuit'}: what was measured besides contradicts that"
        ]
    else:
        reasons = reasons_for(judgement, verdict, named, families, validation)
        if judgement.accepted:
            reasons += large_elements(judgement.model.fit)
    return Diagnosis(
        verdict=verdict,
        effects=tuple(named) if verdict not in ("unexplained", "data") else (),
        families=families if verdict not in ("unexplained", "data") else (),
        confidence=confidence_of(rivals, judgement.probability, verdict, confidence, not judgement.accepted and judgement.nearly_described),
        base=base,
        best=base if verdict == "adequate" else best.fit,
        candidates=tuple(singles),
        probabilities=probabilities,
        posterior=belief.posterior,
        steps=(base,) if verdict == "adequate" else judgement.steps(best),
        where=compare(base).where,
        findings=findings,
        following=following,
        reasons=(*reasons, *reasons_of(rivals)),
        validation=validation if named or verdict == "unexplained" else {},
        left_over=left,
        rivals=rivals,
        question=question,
    )


def _correlated(findings: Sequence[Finding]) -> Finding | None:
    """The finding that the points are correlated by so much that an effect could be named for it."""
    return next((one for one in findings if one.serious and one.id == "correlated-noise"), None)


def closeness(one: Candidate) -> float:
    """Sort key if no model is accepted: the circuit's error, doubled for unusual values or a parameter at a bound."""
    return one.fit.rms_error_percent * (1 if one.ordinary else ALIKE)


def in_order(singles: Sequence[Candidate], judgement: Judgement, first: Sequence[Container[str]]) -> list[Candidate]:
    """Single effects in the order in which they are told, if a model is accepted.

    First those of each container in `first`, then those of sets with usual values to which the odds are not clear: a coil of copper and air is no
    shorted turn, which had unusual values and odds of e^9. Of effects that are in the most probable sets equally often the one that describes more
    by itself comes first.
    """
    least = best_of(judgement.found.values()).score - CLEAR_GAIN
    usual = {name for one in judgement.found.values() if one.score > least and not one.unusual for name in one.added}
    inclusion = judgement.belief.inclusion
    return sorted(
        singles,
        key=lambda one: (
            *(one.effect not in names for names in (*first, usual)),
            -round(inclusion.get(one.effect, 0.0), 2),
            -one.score,
        ),
    )


def commonest_of_the_closest_first(ranked: Sequence[Candidate]) -> list[Candidate]:
    """Of those that come about as close as the first, the ones that need least of the device before the others: a sweep may be of any coil."""
    limit = NEARLY_ALIKE * closeness(ranked[0]) if ranked else 0.0
    close = [one for one in ranked if closeness(one) <= limit]
    ordered = sorted(close, key=lambda one: COMMONEST_FIRST.index(find_effect(one.effect).effect.needs_a))
    return ordered + list(ranked[len(close) :])


def _verdict(judgement: Judgement, named: Key, families: Sequence[Key], findings: Sequence[Finding], left: Remainder | None) -> Verdict:
    serious = {finding.id for finding in findings if finding.serious}
    if not judgement.accepted:
        about_data = left is not None and left.about_the_data
        return "data" if about_data or serious & ABOUT_THE_DATA else "unexplained"
    if not named:
        fit = judgement.model.fit
        # Nobody knows the specification of an analyser without a name; where the circuit errs by no more than is assumed of it, none is exceeded.
        as_assumed = not fit.measurement.analyser.named and fit.rms_error_percent <= fit.floor_percent
        excessive = fit.analyser_sigma > BEYOND_SIGMA and not judgement.accurate and not as_assumed
        # Sweeps that determine no element show only the analyser's errors.
        return "instrument" if excessive or "negative-resistance" in serious or shows_nothing(fit) else "adequate"
    groups = [{find_effect(name).effect.group for name in (effect, *judgement.families[effect])} for effect in named]
    if all(group == {"instrument"} for group in groups):
        return "instrument"
    return "family" if families else "missing-effect"


def _confidence(
    judgement: Judgement,
    verdict: Verdict,
    named: Key,
    families: Sequence[Key],
    findings: Sequence[Finding],
    left: Remainder | None,
    measured: bool,
) -> float:
    """Probability of the named set times the lowest `RELIABLE` of all kinds that apply."""
    kinds: list[str] = [verdict if verdict not in ("missing-effect", "family") else "family" if families else "one name"]
    if named and judgement.of_several is not None and not measured:
        # Further measurements have updated it, as the probability of an effect outside the catalogue (`rivals_in`).
        kinds.append(judgement.of_several)
    if named and judgement.model.unusual:
        kinds.append("unusual values")
    if named and judgement.base.measurement.terminations == ("open",):
        kinds.append("named from the open-circuit sweep alone")
    if judgement.unusual_instead is not None or judgement.absorbing_instead is not None:
        kinds.append("instead of unusual values")
    if len(named) == 1 and find_effect(named[0]).imitated_by:
        kinds.append("imitated")
    if named and short_strap_h(judgement) is not None:
        kinds.append("a strap as short as leads")
    if judgement.hardly_matters:
        kinds.append("hardly matters")
    if named and (judgement.beyond_specification or judgement.pair_is_better):
        kinds.append("names beyond the specification")
    if named and judgement.hardly_closer:
        kinds.append("names with which the circuit errs by much")
    if named and _correlated(findings) is not None:
        kinds.append("names, neighbouring points correlated")
    if named and any(finding.id == "not-as-declared" for finding in findings):
        kinds.append("names, not as declared")
    if judgement.acceptance in ("mostly", "slight"):
        kinds.append(judgement.acceptance)
    if verdict == "unexplained" and judgement.nearly_described:
        relaxing = distributed(judgement.closest_found.added)
        kinds.append("unexplained, two relaxations at one place" if relaxing else "unexplained, nearly all described")
    if verdict == "unexplained" and left is not None and left.causality.needs_more_poles:
        kinds.append("unexplained, more resonances than a causal model has")
    if verdict == "adequate" and hardly_seen(judgement.model.fit):
        kinds.append("adequate, hardly seen")
    if named and (judgement.model.at_bound or judgement.gain < CLEAR_GAIN):
        kinds.append("weak")
    if verdict == "adequate" and judgement.undecided and not of_the_analyser_alone(judgement.belief.named):
        kinds.append("adequate, a weak effect unnamed")
    if verdict == "instrument" and not named and (judgement.belief.named or judgement.instead_of_the_analyser is not None):
        kinds.append("instrument, an effect unnamed")
    # A fixture without compensation is part of every model, so this finding lowers the confidence only if no model is accepted.
    if any(finding.serious and (finding.id != "not-compensated" or verdict == "unexplained") for finding in findings):
        kinds.append("adequate, with a serious finding" if verdict == "adequate" else "with a serious finding")
    # `adequate` is also true if what is missing is too weak to be seen, so the posterior of the empty set is not used.
    return min(RELIABLE[kind] for kind in kinds) * (judgement.probability if named else 1.0)
