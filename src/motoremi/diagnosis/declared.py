"""Whether the data are those of the declared analyser: they are also searched under the others.

This is done only if the declared analyser leaves an undescribed part or needs errors beyond its specification, because each other analyser
costs a search. Another one is used if it is far more probable and a model is accepted with it.
"""

from __future__ import annotations

from dataclasses import dataclass

from motoremi.arrays import Progress
from motoremi.data.analyser import ANALYSERS, BETWEEN_PORTS, DEFAULT_ANALYSER, TRANSMISSION, Analyser
from motoremi.diagnosis.candidates import Candidate, candidate
from motoremi.diagnosis.decision import ONE_EFFECT, judge, of_every_winding
from motoremi.diagnosis.judgement import Judgement, accurate
from motoremi.diagnosis.thresholds import ALIKE, HALF, NEARLY_ALL
from motoremi.fitting.result import SPECIFIED_SIGMA, Fit, summarise
from motoremi.fitting.search import BEYOND_SIGMA, Found, Task, arrived_on_all
from motoremi.progress import part
from motoremi.workers import Map

# Log odds above which another analyser is used. In tests wrong names reached 43 to 87 and right ones never did, but the large errors of a network
# analyser can also describe part of what two effects leave.
TAKEN = 20.0
# A law that is nearly that of the motor leaves a part, which large errors of another analyser describe beside any circuit. With a varistor and with
# cables of other laws than the catalogue's, the circuit then erred 3.8 to 6.8 times as much as the best with the declared analyser; where the
# declaration was wrong, 1.1 to 2.4 times as much (9 motors of seeds 26112741 to 26112753).
AS_CLOSE = 3.0
# Number of other analysers: the most probable one for the base need not be the most probable one with the missing effect.
MOST_TRIED = 2


@dataclass(frozen=True, eq=False)
class Declared:
    """The judgement that is used, and the analyser it assumes.

    Parameters
    ----------
    judgement : Judgement
    instead : Analyser or None
        The analyser that is used instead of the declared one.
    log_odds : float
        Log odds for it.
    """

    judgement: Judgement
    instead: Analyser | None = None
    log_odds: float = 0.0


def likeliest(first: Judgement, progress: Progress | None = None, each: Map = map) -> Declared:
    """The judgement with the analyser that fits the data best.

    Parameters
    ----------
    first : Judgement
        With the declared analyser.
    progress : callable, optional
    each : callable
        As the built-in `map`.
    """
    declared, best, good_enough = first.base.measurement.analyser, first.best.fit, accurate(first.model.fit)
    enough = (first.acceptance == "explained" or good_enough) and first.model.fit.analyser_sigma <= BEYOND_SIGMA
    # Nothing is declared of an analyser without a name that data which are good enough could deny. An ideal one is checked even if a model fits: a
    # flexible law may describe the errors of the real one.
    if first.described or (good_enough and not declared.named) or (enough and (good_enough or not declared.ideal)):
        return Declared(first)
    others = hypotheses(declared)
    if not others or first.base.measurement.remark:
        return Declared(first)
    of_best = [_refitted(best, other) for other in others]
    if enough and max(fit.log_evidence for fit in of_best) <= best.log_evidence + TAKEN:
        return Declared(first)
    refitted = [(_refitted(first.base, other), fit) for other, fit in zip(others, of_best, strict=True)]
    # The most probable analysers, each for the base or for the most probable model.
    tried = sorted(refitted, key=lambda fits: -max(fit.log_evidence for fit in fits))
    for place, (base, _) in enumerate(tried[:MOST_TRIED]):
        taken = _taken(base, first.base, first.best, part(progress, place / MOST_TRIED, (place + 1) / MOST_TRIED), each)
        if taken is not None:
            return taken
    return Declared(first)


def of_the_base(base: Fit, best: Candidate, progress: Progress | None = None, each: Map = map) -> Declared | None:
    """The judgement with another analyser, if with that the base describes everything, far more probably than an effect with the declared one.

    It is asked for before pairs of effects are compared, which takes most of the time of a search. If an effect with the declared analyser leaves
    little, a pair may be as probable.

    Parameters
    ----------
    base : Fit
        With the declared analyser.
    best : Candidate
        The most probable single effect with it, or none.
    progress : callable, optional
    each : callable
        As the built-in `map`.
    """
    if best.left_share <= NEARLY_ALL or base.measurement.remark:
        return None
    others = [_refitted(base, other) for other in hypotheses(base.measurement.analyser)]
    describing = [fit for fit in others if candidate(fit, fit).done and fit.log_evidence > best.fit.log_evidence + TAKEN]
    if not describing:
        return None
    taken = _taken(max(describing, key=lambda fit: fit.log_evidence), base, best, progress, each)
    return None if taken is None or taken.judgement.named else taken


def _taken(base: Fit, declared: Fit, best: Candidate, progress: Progress | None, each: Map) -> Declared | None:
    """The judgement with another analyser; None if it is not to be used instead of the declared one.

    Parameters
    ----------
    base, declared : Fit
        The base with the other analyser, and with the declared one.
    best : Candidate
        The most probable model with the declared one.
    """
    # Only single effects: two of them and the large errors of a network analyser would describe anything.
    other = judge(base, progress, ONE_EFFECT, each)
    odds = other.best.score - best.score
    # It counts only if it needs no errors beyond its own specification.
    within = other.model.fit.analyser_sigma <= SPECIFIED_SIGMA and _as_close(other.model, best.fit, declared)
    # Nor if the effect that it leaves room for describes less than half: that is a cause outside the catalogue, and the analyser is as declared
    # (a driven machine on the shaft: 3.9 % became 3.0 % with a coupled winding and the errors of a network analyser).
    describes = not other.named or other.model.left_share <= HALF
    if odds <= TAKEN or not (other.accepted and within and describes):
        return None
    return Declared(of_every_winding(other, not declared.measurement.analyser.named), base.measurement.analyser, float(odds))


def _as_close(model: Candidate, best: Fit, base: Fit) -> bool:
    """Whether the circuit that is accepted with another analyser errs little more than those with the declared one.

    The base alone may err more, within that analyser's specification: it has no law that large errors could complete. With reflections that err by
    0.1 to 0.4 % it erred up to 4.3 times as much.

    Parameters
    ----------
    model : Candidate
        With the other analyser.
    best, base : Fit
        With the declared one.
    """
    if not model.added and model.fit.within_specification:
        return True
    # An ideal analyser leaves its errors to the effects, so that only the base is compared; so it is if the best effect leaves as much undescribed
    # as the base: it then only takes the place of the analyser's errors.
    describes = best.unexplained_percent["value"] <= HALF * base.unexplained_percent["value"]
    limits = [ALIKE * base.rms_error_percent]
    if describes and not best.measurement.analyser.ideal:
        limits.append(AS_CLOSE * best.rms_error_percent)
    return model.fit.rms_error_percent <= min(limits)


def hypotheses(declared: Analyser) -> list[Analyser]:
    """Analysers that could have been used instead, at one port or between two as the declared one."""
    named = declared.instrument
    if declared.ports:
        # Real analysers between two ports have the same error terms and differ in size only.
        possible = [one for one in ANALYSERS if one.name in TRANSMISSION and one.named and not one.ideal] if declared.ideal else []
        return [BETWEEN_PORTS[declared.ports].measured_by(one.with_compensated_fixture()) for one in possible]
    # A network analyser with an uncompensated fixture could absorb a lead or a stray capacitance. All impedance analysers have errors of one shape.
    others = [one.with_compensated_fixture() for one in ANALYSERS if not one.ideal and one.name not in (named, "e4990a", DEFAULT_ANALYSER)]
    if not declared.named:
        return [one for one in others if one.by_waves != declared.by_waves]
    return [one for one in others if not (named == "e4990a" and one.name == "4294a")]


def _refitted(fit: Fit, analyser: Analyser) -> Fit:
    measurement = fit.measurement.with_analyser(analyser)
    task = Task(fit.motor, measurement, fit.bounds, fit.held)
    own = dict(fit.parameters)
    solution = arrived_on_all(task, [own, {**own, **fit.search_parameters}])
    return summarise(task, Found(solution, fit.history, dict(fit.search_parameters)), fit.method, fit.seed)
