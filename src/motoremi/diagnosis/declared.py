"""Whether the data are those of the analyser that was declared: they are judged under the others as well.

Only where the declared one leaves something, or has to err beyond its specification, since the others cost a search each. Another one is
taken if the data prefer it clearly and a model stands under it.
"""

from __future__ import annotations

from dataclasses import dataclass

from motoremi.arrays import Progress
from motoremi.data.analyser import ANALYSERS, BETWEEN_PORTS, TRANSMISSION, Analyser
from motoremi.diagnosis.judgement import ALIKE, GLANCE, Judgement, accurate, judge
from motoremi.fitting.result import SPECIFIED_SIGMA, Fit, summarise
from motoremi.fitting.search import BEYOND_SIGMA, Found, Task, arrived_on_all
from motoremi.progress import part
from motoremi.workers import Map

# Log odds beyond which the data deny the declared analyser. In trials before this, wrong declarations were denied by 43 to 87 and true ones never;
# but a network analyser's wide errors can also take up a part of what two effects leave.
TAKEN = 20.0
# Other analysers that are searched under: the second where the likeliest for the bare circuit is not the likeliest with the missing effect.
MOST_TRIED = 2


@dataclass(frozen=True, eq=False)
class Declared:
    """The judgement that is used, and the analyser it assumes.

    Parameters
    ----------
    judgement : Judgement
    instead : Analyser or None
        What the data say it was, where they deny the declared one.
    log_odds : float
        For that one.
    """

    judgement: Judgement
    instead: Analyser | None = None
    log_odds: float = 0.0


def likeliest(first: Judgement, progress: Progress | None = None, each: Map = map) -> Declared:
    """The judgement under the analyser that fits the data best.

    Parameters
    ----------
    first : Judgement
        Under the declared analyser.
    progress : callable, optional
    each : callable
        As the built-in `map`.
    """
    declared, best, good_enough = first.base.measurement.analyser, first.best.fit, accurate(first.model.fit)
    enough = (first.standing == "explained" or good_enough) and first.model.fit.analyser_sigma <= BEYOND_SIGMA
    # No real analyser is ideal: a law that bends may have taken up its errors.
    if first.described or (enough and (good_enough or not declared.ideal)):
        return Declared(first)
    others = hypotheses(declared)
    if not others or first.base.measurement.remark:
        return Declared(first)
    of_best = [_refitted(best, other) for other in others]
    if enough and max(fit.log_evidence for fit in of_best) <= best.log_evidence + TAKEN:
        return Declared(first)
    refitted = [(_refitted(first.base, other), fit) for other, fit in zip(others, of_best, strict=True)]
    # The alternatives: the likeliest analyser for the bare circuit, and for the likeliest model.
    tried = sorted(refitted, key=lambda fits: -max(fit.log_evidence for fit in fits))
    for place, (base, _) in enumerate(tried[:MOST_TRIED]):
        # One effect at most: beside two the wide errors of a network analyser would describe anything.
        other = judge(base, part(progress, place / MOST_TRIED, (place + 1) / MOST_TRIED), GLANCE, each)
        odds = other.best.score - first.best.score
        # One that needs more than the other's specification says nothing of which one it was, nor does a circuit that errs far more.
        as_close = other.model.fit.rms_error_percent <= ALIKE * first.base.rms_error_percent
        within = other.model.fit.analyser_sigma <= SPECIFIED_SIGMA and as_close
        if odds > TAKEN and other.stands and within:
            return Declared(other, base.measurement.analyser, float(odds))
    return Declared(first)


def hypotheses(declared: Analyser) -> list[Analyser]:
    """What the analyser could have been instead, for data that were measured at one port or between two as these were."""
    # A network analyser with an uncompensated fixture could absorb a lead or a stray capacitance: only its owner can declare that.
    named = declared.instrument
    if declared.ports:
        # The errors of a real one are those of every other, in another size.
        possible = [one for one in ANALYSERS if one.name in TRANSMISSION and one.named and not one.ideal] if declared.ideal else []
        return [BETWEEN_PORTS[declared.ports].measured_by(one.with_compensated_fixture()) for one in possible]
    others = [one.with_compensated_fixture() for one in ANALYSERS if not one.ideal and one.name not in (named, "e4990a", "unknown")]
    return [one for one in others if not (named in ("e4990a", "unknown") and one.name == "4294a")]


def _refitted(fit: Fit, analyser: Analyser) -> Fit:
    measurement = fit.measurement.with_analyser(analyser)
    task = Task(fit.motor, measurement, fit.bounds, fit.held)
    own = dict(fit.parameters)
    solution = arrived_on_all(task, [own, {**own, **fit.search_parameters}])
    return summarise(task, Found(solution, fit.history, dict(fit.search_parameters)), fit.method, fit.seed)
