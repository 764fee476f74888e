"""`refit_with` and `refit_without`: a fit with one effect more or less."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping, Sequence

import numpy as np

from motoremi.errors import BadInput
from motoremi.fitting.aco_r import Colony
from motoremi.fitting.base_fit import base_fit
from motoremi.fitting.marginal import NOTHING_LEFT
from motoremi.fitting.parts import between, counted, least, most_parts, neighbours, parts_of, with_number
from motoremi.fitting.polish import polish
from motoremi.fitting.race import Trail, raced_alone
from motoremi.fitting.result import Fit, on_fits, summarise
from motoremi.fitting.search import (
    AS_PROBABLE,
    BEYOND_SIGMA,
    CLOSER,
    FOLLOWED,
    GENERATIONS,
    PLAIN,
    ROUGH,
    SEARCH_POINTS,
    Found,
    Solution,
    Task,
    arrived_on_all,
    climb,
    misses_by_far,
    other_frames,
    relative_solution,
)
from motoremi.fitting.trail import trail_to, trail_without
from motoremi.fitting.vanishing import no_worse
from motoremi.model.effects import find_effect
from motoremi.model.motor import Motor
from motoremi.threads import one_blas_thread

# A solution takes the place of another one if it gains so much log evidence, or lowers an error of per cents by this share: less is rounding.
GAINED, LOWERED = 0.1, 1e-3


@one_blas_thread
def refit_with(
    before: Fit,
    effect: str,
    held: Mapping[str, float] | None = None,
    limits: Mapping[str, tuple[float, float]] | None = None,
    thorough: bool = True,
) -> Fit:
    """Add an effect to a fitted motor and fit again; if that would be worse, the effect is held at the values at which it vanishes."""
    added = find_effect(effect).effect
    shown = _shown(before, added.hides)
    fitted = hidden(_in_its_place(_with_effect(shown, effect, held, limits, thorough), effect, before.motor), added.hides)
    return no_worse(before, fitted, effect, (*(held or ()), *(limits or ())))


def _with_effect(
    before: Fit, effect: str, held: Mapping[str, float] | None, limits: Mapping[str, tuple[float, float]] | None, thorough: bool
) -> Fit:
    added = find_effect(effect).effect
    if misses_by_far(before.sizes) and (added.describes or (added.tried and before.motor.is_line)):
        return _described(trail_to(before, effect, held, limits, near=before.parameters), before)
    trail = trail_to(before, effect, held, limits)
    if not before.effects and not any(name in (held or {}) for name in parts_of(trail, effect)):
        trail = counted(trail)
    return followed(trail, before, thorough)


def _described(trail: Trail, before: Fit) -> Fit:
    """A descriptive effect added to a model that errs by much: from its present values to the least relative error, without the likelihood.

    The likelihood, and the values of a smaller model, would lead from one description into another. With each step the number of parts may
    change to a neighbouring one.
    """
    started = time.perf_counter()
    task, starts = trail.task, trail.starts[:: trail.group]
    ends = least(task.relative(), starts, FOLLOWED)
    for other in neighbours(task):
        near = least(other.relative(), starts, 1)
        if near.objective.min() < ends.objective.min():
            task, ends = other, near
    solution = relative_solution(task, ends, before.sizes)
    result = summarise(task, Found(solution, before.history, dict(solution.values)), before.method, before.seed)
    return dataclasses.replace(result, elapsed_s=time.perf_counter() - started)


def _in_its_place(fitted: Fit, effect: str, before: Motor) -> Fit:
    """If an effect has exchanged places with an element (`Effect.less_than`): the solution from where they exchange again, if that is better.

    Resistance in series with the winding cannot imitate the damping of a cell, so these are not alike: a cell of 1.1 mH beside a winding
    of 78 uH left 28 %, one of 0.14 mH beside 1.5 mH nothing.
    """
    found = find_effect(effect)
    label, exchange = found.label_in(before), found.effect.exchange
    if exchange is None or not found.effect.has_exchanged(label, fitted.parameters):
        return fitted
    own = {f"{label}.{p.name}": p.name for p in found.effect.parameters}
    values = {own.get(name, name): value for name, value in fitted.parameters.items()}
    other = {**values, **exchange(values)}
    start = {**fitted.nuisance, **{name: other[own.get(name, name)] for name in fitted.parameters}, **fitted.held}
    solution = arrived_on_all(fitted.task, [start])
    result = summarise(fitted.task, Found(solution, fitted.history, search_values(fitted.task, solution)), fitted.method, fitted.seed)
    return result if better_than(fitted, result) else fitted


def _shown(fit: Fit, names: Sequence[str]) -> Fit:
    """A fit in which parameters that were held because they had no visible influence are free again, at their last values."""
    shown = {name for name in names if name in fit.held and fit.held[name] == _least_value(fit, name)}
    if not shown:
        return fit
    held = {name: value for name, value in fit.held.items() if name not in shown}
    values = {**fit.parameters, **{name: fit.search_parameters.get(name, fit.parameters[name]) for name in shown}}
    return dataclasses.replace(fit, held=held, parameters=values)


def hidden(fit: Fit, names: Sequence[str]) -> Fit:
    """A fit with a large error, with parameters that are not needed held at their smallest value, if the error does not rise significantly."""
    if not names or not misses_by_far(fit.sizes):
        return fit
    loose = {name: _least_value(fit, name) for name in fit.undetermined() if name in names}
    if not loose:
        return fit
    task = dataclasses.replace(fit.task, held={**fit.held, **loose})
    problem = task.relative()
    ends = polish(problem, problem.vectors([fit.parameters]), iterations=100, precision=ROUGH)
    solution = relative_solution(task, ends, fit.sizes)
    without = summarise(task, Found(solution, fit.history, dict(fit.parameters)), fit.method, fit.seed)
    values = 2 * fit.measurement.points
    # The information criterion of Schwarz: so much a parameter takes off by chance.
    by_chance = float(np.exp(len(loose) * np.log(values) / (2 * values)))
    return dataclasses.replace(without, elapsed_s=fit.elapsed_s) if without.rms_error_percent <= by_chance * fit.rms_error_percent else fit


def _least_value(fit: Fit, name: str) -> float:
    """The low end of a parameter's range."""
    parameter = next(p for p in fit.motor.parameters if p.name == name)
    return fit.bounds.get(name, (parameter.low, parameter.high))[0]


@one_blas_thread
def refit_without(before: Fit, effect: str | None = None, thorough: bool = True) -> Fit:
    """Take an effect (the last one by default) out of a fitted motor and fit again."""
    if not before.effects:
        raise BadInput("the model is the paper's circuit: there is no effect to drop")
    gone = effect if effect is not None else before.effects[-1]
    find_effect(gone)
    if gone not in before.effects:
        raise BadInput(f"{gone} is not in the model; it has {', '.join(before.effects)}")
    trail = trail_without(before, gone)
    if not trail.task.motor.effects:
        started = time.perf_counter()
        return dataclasses.replace(base_fit(trail.task, before.seed), elapsed_s=time.perf_counter() - started)
    return followed(trail, before, thorough)


def followed(trail: Trail, before: Fit, thorough: bool = True) -> Fit:
    """The fit from a model's start values, on all points; if that leaves an error, a `thorough` one also uses the ant colony."""
    started = time.perf_counter()
    raced = raced_alone(trail)
    solution = arrived_on_all(trail.task, [raced.values], searched=raced.searched)
    searched = search_values(trail.task, solution)
    if thorough and solution.marginal.nothing_left < 0.5:
        search = trail.task.thinned(SEARCH_POINTS)
        starts = search.vectors(trail.starts)
        colony = Colony(search, np.random.default_rng(before.seed), starts)
        colony.walk(GENERATIONS)
        ends = polish(search, colony.different(12), iterations=40, precision=ROUGH)
        ends = ends.joined(climb(trail.task, search, starts[np.argsort(search.objective(starts))[:12]]))
        other = arrived_on_all(trail.task, [search.named(row) for row in ends.distinct(3)])
        evaluations = solution.evaluations + other.evaluations + ends.evaluations
        if other.log_evidence > solution.log_evidence:
            solution, searched = other, search.named(ends.u[ends.best])
        solution = dataclasses.replace(solution, evaluations=evaluations)
    result = summarise(trail.task, Found(solution, before.history, searched), before.method, before.seed)
    return dataclasses.replace(result, elapsed_s=time.perf_counter() - started)


@one_blas_thread
def on_all_points(job: tuple[Trail, Solution, Fit]) -> Fit:
    """A solution on few points, refined on all points, as a fit like the one before."""
    trail, solution, before = job
    # Of a network analyser a fixture may be most of what was measured.
    described = before.measurement.analyser.by_waves and before.marginal.nothing_left >= 0.5 and before.analyser_sigma <= BEYOND_SIGMA

    def fitted(task: Task, whole: Solution) -> Fit:
        return summarise(task, Found(whole, before.history, search_values(task, whole)), before.method, before.seed)

    def arrived(task: Task, values: Mapping[str, float]) -> Fit:
        return fitted(task, arrived_on_all(task, [values], solution.sizes, solution.searched, wanders=not described))

    best = arrived(trail.task, solution.values)
    if best.rms_error_percent > before.rms_error_percent and misses_by_far(best.sizes):
        # Of a model that comes no closer than the one without the effect, no number of parts matters.
        return best
    # The numbers of parts between those that the search tries: half as far with each step.
    for name, step in between(trail.task, before):
        # Where nothing is left no other number is better.
        while (step := step // 2) >= 1 and best.sizes.discrepancy > NOTHING_LEFT:
            for count in (best.held[name] - step, best.held[name] + step):
                if count <= most_parts(before.measurement):
                    other = arrived(with_number(best.task, name, count), {**best.parameters, **best.nuisance, name: count})
                    if better_than(best, other):
                        best = other
                        break
    if not NOTHING_LEFT < best.sizes.discrepancy < PLAIN:
        return best
    starts = other_frames(best.task, {**best.parameters, **best.nuisance})
    if not starts:
        return best
    other = fitted(best.task, arrived_on_all(best.task, starts, wanders=not described))
    # Along a flat valley a search that has not converged is no better one.
    clearly = other.converged and other.log_evidence > best.log_evidence + 2 * AS_PROBABLE
    return other if clearly and better_than(best, other) else best


def better_than(fitted: Fit, found: Fit) -> bool:
    """Whether another solution of the same problem is better, compared as in a search: by probability, or by an error of per cents."""
    if misses_by_far(fitted.sizes) and misses_by_far(found.sizes):
        return found.rms_error_percent < (1 - LOWERED) * fitted.rms_error_percent
    other, likelier = sorted((fitted, found), key=lambda one: one.log_evidence)
    # The analyser's errors may absorb what the circuit does not describe.
    comparable = likelier.analyser_sigma > BEYOND_SIGMA or other.log_evidence > likelier.log_evidence - AS_PROBABLE
    if comparable and other.rms_error_percent < CLOSER * likelier.rms_error_percent:
        return other is found
    return found.log_evidence > fitted.log_evidence + GAINED


def search_values(task: Task, solution: Solution) -> dict[str, float]:
    """Start values for the next effect: the least relative error near a solution that leaves an error, else the solution."""
    if solution.sizes.discrepancy >= PLAIN:
        return dict(solution.values)
    search = task.thinned(SEARCH_POINTS)
    ends = polish(search, search.vectors([solution.values]), iterations=15, precision=ROUGH)
    return search.named(ends.u[0])


on_fits.refit_with = lambda before, effect, held, thorough: refit_with(before, effect, held, thorough=thorough)
on_fits.refit_without = refit_without
