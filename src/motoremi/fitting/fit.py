"""`fit`: from sweeps to a circuit with error bars; `refit_with` and `refit_without`: one effect more or less."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from motoremi.arrays import ComplexArray, Progress
from motoremi.data.covariance import Sizes
from motoremi.data.measurement import Measurement
from motoremi.data.sweep import ImpedanceSweep
from motoremi.errors import BadInput
from motoremi.fitting.aco_r import Colony
from motoremi.fitting.band_scaling import scaled_ranges, scaled_starts
from motoremi.fitting.exchange import exchanged
from motoremi.fitting.marginal import NOTHING_LEFT, marginal
from motoremi.fitting.paper_colony import paper_colony
from motoremi.fitting.polish import Polished, polish
from motoremi.fitting.problem import Problem, checked_bounds
from motoremi.fitting.race import ALL, Round, Rounds, Trail, race, raced_alone
from motoremi.fitting.result import METHODS, Fit, on_fits, summarise
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
    relative_solution,
    search_base,
)
from motoremi.fitting.starts import base_starts, seen
from motoremi.fitting.vanishing import no_worse
from motoremi.given import real_number, refuse_other, seed_number
from motoremi.model.circuit import Tape
from motoremi.model.effects import add_effects, find_effect
from motoremi.model.effects.open_alone import Division, divisions
from motoremi.model.effects.seen import Across, Seen
from motoremi.model.effects.start import with_start
from motoremi.model.effects.validity import active_at
from motoremi.model.motor import BASE_PARAMETERS, Motor, dc_motor
from motoremi.model.parameter import Parameter
from motoremi.quantities import show
from motoremi.threads import one_blas_thread
from motoremi.workers import Map

# A step of gain is sought in so much of ln(f) on either side.
STEP_REACH = 0.15
# The effect that describes a resonance of the winding without a cause, and a capacitance of it that changes nothing.
MODES, NEXT_TO_NOTHING_F = "winding-modes", 1e-18
# Number of points that are needed to determine one resonance.
POINTS_EACH = 3
# Steps that are made to compare several numbers of parts, and from how many of the best starts.
GLANCE_STEPS, GLANCE_STARTS = 12, 12
# How a number of parts is chosen where it matters: of ten windings of 2 to 12 sections the right one is found for seven; by fewer steps or starts
# for three to six.
COUNTING = Rounds((Round(SEARCH_POINTS, 12, ALL, ALL), Round(SEARCH_POINTS, 40, 20, 6)), 0, SEARCH_POINTS)
# A known solution takes the place of one that was found anew if it gains so much log evidence, or lowers an error of per cents by this share: less
# is rounding, and the fit anew stays as it is.
GAINED, LOWERED = 0.1, 1e-3


@one_blas_thread
def fit(
    model: Motor | None,
    sweeps: Iterable[ImpedanceSweep] | Measurement,
    *,
    seed: int = 1,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    method: str = "ant-colony",
    analyser: str | None = None,
    held: Mapping[str, float] | None = None,
    progress: Progress | None = None,
) -> Fit:
    """Fit a motor's circuit to its impedance sweeps.

    Parameters
    ----------
    model : Motor
        `dc_motor()`, with or without effects.
    sweeps : iterable of ImpedanceSweep
        Short- and open-circuit sweeps; several of one termination are repeats and give the noise.
    seed : int
        The search is deterministic for a seed.
    bounds : mapping, optional
        Parameter name -> (low, high) in SI units, for example `{"La": (1e-6, 1e-4)}`.
    method : {"ant-colony", "paper"}
        The default searches with ants and polishes to the noise floor; `paper` is the algorithm as printed.
    analyser : str, optional
        Whose systematic errors to allow for: `4294a`, `e4990a`, `nanovna`, `none`, or `unknown`, whose size is estimated (default).
    held : mapping, optional
        Parameters that are not fitted, in SI units: for example Ra from a DC measurement.
    progress : callable, optional
        Called with a text, the work done and its total in each round of the search for the paper's circuit.

    Returns
    -------
    Fit

    Raises
    ------
    BadInput
        For sweeps, bounds, names or a seed that cannot be used.
    """
    started = time.perf_counter()
    motor = model if model is not None else dc_motor()
    refuse_other(motor, Motor, "fit needs a model first, dc_motor()")
    for option, given in (("bounds", bounds), ("held", held)):
        if given is not None:
            refuse_other(given, Mapping, f"{option} are a dictionary of parameters by name")
    seed = seed_number(seed)
    if method not in METHODS:
        raise BadInput(f"unknown method {method!r}: use one of {', '.join(METHODS)}")
    measurement = sweeps if isinstance(sweeps, Measurement) else Measurement.of(_sweeps(sweeps), analyser)
    _check_informative(measurement)
    limits, fixed = checked_bounds(motor, bounds), checked_held(motor, held)
    for p in motor.parameters:
        for value in limits.get(p.name, ()):
            _check_valid(p, value)
    _check_possible(limits, fixed)
    base = dc_motor()
    paper_names = {p.name for p in BASE_PARAMETERS}
    base_bounds = {n: b for n, b in limits.items() if n in paper_names}
    base_held = {n: v for n, v in fixed.items() if n in paper_names}
    if base.used_parameters(*measurement.terminations) <= base_held.keys():
        raise BadInput("all elements that these sweeps show are held, so nothing is left to fit: leave one of them free")
    task = Task(base, measurement, base_bounds, base_held)
    result = _by_the_paper(task, seed) if method == "paper" else _by_ants(task, seed, progress)
    for effect in motor.effects:
        result = refit_with(result, effect, {n: v for n, v in fixed.items() if n.startswith(effect)}, limits)
    return dataclasses.replace(result, elapsed_s=time.perf_counter() - started)


def _sweeps(given: object) -> list[ImpedanceSweep]:
    needs = "fit needs a list of ImpedanceSweep"
    refuse_other(given, Iterable, needs)
    listed = list(given)  # type: ignore[call-overload]
    for one in listed:
        refuse_other(one, ImpedanceSweep, f"{needs}, and nothing else in it")
    return listed


def checked_held(motor: Motor, held: Mapping[str, float] | None) -> dict[str, float]:
    """Values that can be held, or one clear line.

    Raises
    ------
    BadInput
        For an unknown parameter, a value that is no finite number, one that is not above 0 where only such are possible, an element beyond what
        motors have, or a value with which an effect would give energy away.
    """
    known = {p.name: p for p in motor.parameters}
    values = {name: real_number(value, f"the held value of {name}") for name, value in (held or {}).items()}
    for name, value in values.items():
        if name not in known:
            raise BadInput(f"held value for the unknown parameter {name!r}; the model has {', '.join(sorted(known))}")
        if not np.isfinite(value):
            raise BadInput(f"held value of {name} is not a finite number")
        if known[name].scale == "log" and value <= 0:
            raise BadInput(f"the held value of {name} must be above 0 {known[name].unit}, got {value:g}")
        if known[name] in BASE_PARAMETERS and not known[name].low <= value <= known[name].high:
            raise BadInput(f"the held value of {name}, {value:g} {known[name].unit}, is outside of what motors have: {_range(known[name])}")
        _check_valid(known[name], value)
    return values


def _check_possible(limits: Mapping[str, tuple[float, float]], held: Mapping[str, float]) -> None:
    """Refuse bounds of an element that leave out all that a motor can have, and bounds of one that is held."""
    for p in BASE_PARAMETERS:
        if p.name not in limits:
            continue
        if p.name in held:
            raise BadInput(f"{p.name} is held and has bounds: leave out one of them")
        low, high = limits[p.name]
        if high < p.low or low > p.high:
            raise BadInput(f"the bounds of {p.name}, {low:g} - {high:g} {p.unit}, are outside of what motors have: {_range(p)}")


def _range(parameter: Parameter) -> str:
    return f"{show(parameter.low, parameter.unit)} - {show(parameter.high, parameter.unit)} ({parameter.reason})"


def _check_valid(parameter: Parameter, value: float) -> None:
    """Refuse a value with which the law of an effect leaves its validity: a permeability below zero."""
    effect = parameter.name.rpartition(".")[0].partition("#")[0]
    # The analyser's errors are no part of a motor.
    if not effect or find_effect(effect).effect.group == "instrument":
        return
    if active_at(add_effects(dc_motor(), [effect]), [{f"{effect}.{parameter.short_name}": value}]) is not None:
        given = f"{parameter.name} = {value:g} {parameter.unit}".rstrip()
        raise BadInput(f"{given} makes the motor give energy away: keep it between {parameter.low:g} and {parameter.high:g}")


def _check_informative(measurement: Measurement) -> None:
    for sweep in measurement.sweeps:
        magnitude = np.abs(sweep.mean_ohm)
        if np.ptp(magnitude) < 1e-9 * magnitude.max() and np.ptp(np.angle(sweep.mean_ohm)) < 1e-9:
            raise BadInput(f"the {sweep.termination} sweep is the same at all frequencies: this is not a motor's impedance")


def _by_ants(task: Task, seed: int, progress: Progress | None = None) -> Fit:
    return with_larger_winding(summarise(task, search_base(task, seed, progress), "ant-colony", seed))


def with_larger_winding(fitted: Fit) -> Fit:
    """Of two assignments of the resonances that are as good, the one whose winding has more inductance than the path to the frame.

    A winding has many turns and the path to the frame has none. This is an assumption; the error bars do not depend on it.
    """
    if fitted.exchange is None:
        return fitted
    index = [parameter.name for parameter in fitted.problem.unknowns].index("La")
    if fitted.exchange[index] <= 0:
        return fitted
    values = fitted.problem.named(fitted.unknowns + fitted.exchange)
    searched = {**fitted.search_parameters, **exchanged(fitted.search_parameters)}
    found = Found(arrived_on_all(fitted.task, [values], fitted.sizes), fitted.history, searched)
    return summarise(fitted.task, found, fitted.method, fitted.seed)


def _by_the_paper(task: Task, seed: int) -> Fit:
    search = Problem(task.motor, task.measurement, task.bounds, task.held, weights="log")
    outcome = paper_colony(search, np.random.default_rng(seed))
    values = search.named(outcome.u)
    likelihood = task.likelihood()
    found = marginal(likelihood, likelihood.vector(values))
    whole = likelihood.named(likelihood.vector(values))
    solution = Solution(whole, found.likeliest, found, outcome.converged, outcome.evaluations)
    result = summarise(task, Found(solution, outcome.history, values), "paper", seed)
    remark = (
        f"the paper's colony met its stop rule (deviation {outcome.deviation:.3g} <= 0.1)"
        if outcome.converged
        else f"the paper's colony did not meet its stop rule: deviation {outcome.deviation:.3g}, wanted 0.1"
    )
    return dataclasses.replace(result, warnings=(*result.warnings, remark))


def trail_to(
    before: Fit,
    effect: str,
    held: Mapping[str, float] | None = None,
    limits: Mapping[str, tuple[float, float]] | None = None,
    near: Mapping[str, float] | None = None,
    rival: Fit | None = None,
) -> Trail:
    """Where to look for a fit with one more effect; a number of parts is chosen briefly (see `counted`).

    Parameters
    ----------
    near : mapping, optional
        Values of a solution with a rival in its place, in SI units: from there above all.
    rival : Fit, optional
        That solution. An equivalent circuit may need quite other values; they are read from its impedance, which has no noise.
    """
    added = find_effect(effect)
    label = added.label_in(before.motor)
    motor = added.added_to(before.motor)
    names = {p.name for p in motor.parameters}
    fixed = {**before.held, **(held or {})}
    unvaried = {f"{label}.{p.name}": added.effect.tried.get(p.name, ()) for p in added.effect.parameters if not p.vary}
    if any(not values for values in unvaried.values()) and not any(name in fixed for name in unvaried):
        fixed.update(_scanned_step(before, label))
    wider = scaled_ranges(added.effect, label, before.measurement)
    bounds = {name: b for name, b in {**wider, **before.bounds, **(limits or {})}.items() if name in names}
    task = Task(motor, before.measurement, bounds, fixed)
    own = {**before.parameters, **before.search_parameters}
    tried = scaled_starts(added.effect, before.measurement)
    if before.motor.across:
        # The impedance seen is that of what is across the winding; the winding's own is as the catalogue has it.
        tried += [dict(start) for start in added.effect.starts if start not in tried]
    if added.effect.reader is not None:
        seen_now = [_seen_by(before, added.place), *(() if rival is None else (_seen_in(rival, added.place),))]
        tried += [dict(start) for seen_one in seen_now for start in added.effect.reader(seen_one)]
        for one in _open_alone(before.measurement):
            seen_so = dataclasses.replace(one.seen, parameters=before.parameters, place=added.place)
            tried += [{**one.elements, **start} for start in added.effect.reader(seen_so)]
    if near:
        bases = [{**own, **near}, own]
    else:
        bases = base_starts(own, before.measurement.coarse, few=len(tried) > 9)
        if before.effects or before.sizes.discrepancy < PLAIN:
            # With effects, the search's best and the likelihood's may be different local minima. If little is undescribed, the analyser's errors
            # describe part of the effect: without them a start would be far above the fit without the effect.
            bases.append({**own, **before.parameters, **before.nuisance})
    if before.likeliest_parameters:
        bases.append({**own, **before.likeliest_parameters})
    if before.exchange is not None:
        # An effect distinguishes the two assignments: it fits with the right one only.
        bases += [{**base, **exchanged(base)} for base in bases]
    starts = [with_start(base, start, label) for start in tried for base in bases]
    parts = {
        name: _checked_parts(name, fixed[name], before) if name in fixed else _chosen(task, starts, len(bases), name, values, before)
        for name, values in unvaried.items()
        if values
    }
    return Trail(dataclasses.replace(task, held={**fixed, **parts}), starts, len(bases), before.sizes)


def parts_of(trail: Trail, effect: str) -> dict[str, float]:
    """The number of parts that was chosen for an effect, if it has one: to be held in further searches, since each number takes one of its own."""
    names = {f"{effect}.{name}" for name in find_effect(effect).effect.tried}
    return {name: value for name, value in trail.task.held.items() if name in names}


def counted(trail: Trail, each: Map = map) -> Trail:
    """The same with the number of parts, if an effect has one, that reaches the lowest objective from these start values."""
    trails: dict[float, Trail] = {}
    for label in trail.task.motor.effects:
        for name, values in find_effect(label).effect.tried.items():
            for value in values:
                if value <= most_parts(trail.task.measurement):
                    held = {**trail.task.held, f"{label}.{name}": value}
                    trails[value] = dataclasses.replace(trail, task=dataclasses.replace(trail.task, held=held))
    reached = race(trails, COUNTING, each=each).reached
    return trails[min(reached, key=lambda value: reached[value].best)] if reached else trail


@one_blas_thread
def counted_near(trail: Trail) -> Trail:
    """`counted`, from start values that are right but for the number of parts."""
    for label in trail.task.motor.effects:
        for short, values in find_effect(label).effect.tried.items():
            name = f"{label}.{short}"
            sweeping = dataclasses.replace(trail, task=trail.task.sweeping(name))
            if found := _least_of_each(sweeping.problem(SEARCH_POINTS), trail.starts, name, values):
                held = {**trail.task.held, name: min(found, key=lambda value: found[value])}
                trail = dataclasses.replace(trail, task=dataclasses.replace(trail.task, held=held))
    return trail


def _least_of_each(
    problem: Problem, starts: Sequence[Mapping[str, float]], name: str, values: Sequence[float], most: int = ALL
) -> dict[float, float]:
    """The lowest objective with each number of parts after a few steps from the best starts, at most `most`.

    All numbers are one batch, in which each member keeps its own: on few points a step takes as long for one start as for ten.
    """
    possible = [value for value in values if value <= most_parts(problem.measurement)]
    if not possible:
        return {}
    u = problem.vectors([{**start, name: value} for value in possible for start in starts]).reshape(len(possible), len(starts), -1)
    best = np.argsort(problem.objective(u), axis=1)[:, :most]
    chosen = np.take_along_axis(u, best[..., None], axis=1).reshape(-1, u.shape[-1])
    ends = polish(problem, chosen, iterations=GLANCE_STEPS, precision=ROUGH)
    return dict(zip(possible, ends.objective.reshape(best.shape).min(axis=1).tolist(), strict=True))


def _checked_parts(name: str, value: float, before: Fit) -> float:
    """The number of parts that the user holds; refused if these data cannot determine as many."""
    most = most_parts(before.measurement)
    if not value == round(value) or not 1 <= value <= most:
        raise BadInput(f"{name} = {value:g}: hold a whole number from 1 to {most:g}; each adds a resonance, which needs {POINTS_EACH} points")
    return value


def most_parts(measurement: Measurement) -> int:
    """The largest number of parts, with a resonance each, that the points of a sweep can determine."""
    return max(len(sweep.frequency_hz) for sweep in measurement.sweeps) // POINTS_EACH


def _chosen(task: Task, starts: Sequence[Mapping[str, float]], group: int, name: str, values: Sequence[float], before: Fit) -> float:
    """The value of a parameter that is not varied with the lowest objective after a few steps.

    Where a line misses by far, its resonances hide how many parts there are: each number is looked at with one mode beside it.
    """
    if not (before.motor.is_line and misses_by_far(before.sizes)):
        found = _least_of_each(task.sweeping(name).thinned(SEARCH_POINTS), starts, name, values, GLANCE_STARTS)
    else:
        found = {}
        for value in values:
            if value <= most_parts(task.measurement):
                one = dataclasses.replace(task, held={**task.held, name: value})
                problem = one.relative()
                ends = _least(problem, starts[::group], 1, GLANCE_STEPS)
                found[value] = float(_least(*_with_mode(one, problem.named(ends.u[ends.best]), before), 1, 2 * GLANCE_STEPS).objective.min())
    return min(found, key=lambda value: found[value], default=values[0])


def _with_mode(task: Task, values: Mapping[str, float], before: Fit) -> tuple[Problem, list[dict[str, float]]]:
    """The least relative error with one more mode, and where it may start."""
    added = find_effect(MODES)
    label, seen_now = added.label_in(task.motor), _seen_by(before)
    assert added.effect.reader is not None
    everything = {**{p.name: p.middle for p in task.motor.parameters}, **values}
    seen_so = dataclasses.replace(seen_now, across=seen_across(task.motor, everything, before.measurement.coarse), parameters=values)
    starts = [with_start(values, start, label) for start in added.effect.reader(seen_so)]
    motor = added.added_to(task.motor)
    return dataclasses.replace(task, motor=motor).relative(), starts or [dict(values)]


@lru_cache(maxsize=4)
def _seen_by(fit: Fit, place: str = "") -> Seen:
    """The sweeps beside what a fit makes of them, for an effect at a place."""
    across = seen_across(fit.motor, fit.parameters, fit.measurement.coarse)
    return dataclasses.replace(seen(fit.measurement.coarse), across=across, parameters=fit.parameters, place=place)


def seen_across(motor: Motor, values: Mapping[str, float], measurement: Measurement) -> Across | None:
    """What an admittance across the winding changes in the short-circuit sweep, or in the open-circuit one if that is the only one.

    It is what a mode of next to no capacitance changes, divided by the mode's admittance; None beside an effect that excludes modes.
    """
    if not find_effect(MODES).fits(motor):
        return None
    sweep = next((one for one in measurement.sweeps if one.termination == "short"), measurement.sweeps[0])
    added = find_effect(MODES)
    label, with_mode = added.label_in(motor), added.added_to(motor)
    own = {f"{label}.{name}": value for name, value in {**added.effect.limit_values, "capacitance_f": NEXT_TO_NOTHING_F}.items()}
    everything = {**own, **values}
    names = list(with_mode.used_parameters(sweep.termination))
    s: ComplexArray = np.asarray(2j * np.pi * sweep.frequency_hz, dtype=np.complex128)
    impedance, gradient = Tape(with_mode.circuit(sweep.termination), names).gradient(s, np.array([everything[name] for name in names]))
    x = s / (2 * np.pi * everything[f"{label}.resonance_hz"])
    decrease = -gradient[names.index(f"{label}.capacitance_f")] / impedance * (1 + x / everything[f"{MODES}.quality"] + x**2) / s
    return Across(sweep.frequency_hz, sweep.mean_ohm, impedance, np.asarray(decrease, dtype=np.complex128))


@lru_cache(maxsize=4)
def _open_alone(measurement: Measurement) -> list[Division]:
    """If there is only the open-circuit sweep: what both sweeps may be."""
    if measurement.terminations != ("open",):
        return []
    (sweep,) = measurement.coarse.sweeps
    return divisions(sweep.frequency_hz, sweep.mean_ohm)


@lru_cache(maxsize=4)
def _seen_in(fit: Fit, place: str) -> Seen:
    """A fit's own impedance in the place of the sweeps."""
    terminations = fit.measurement.terminations
    if "short" not in terminations:
        return Seen(parameters=fit.parameters, place=place)
    points = {sweep.termination: sweep.frequency_hz for sweep in fit.measurement.coarse.sweeps}
    own = Seen(points["short"], fit.model_ohm("short", points["short"]), parameters=fit.parameters, place=place)
    if "open" not in terminations:
        return own
    at = points["open"]
    return dataclasses.replace(own, frame_hz=at, open_ohm=fit.model_ohm("open", at), through_ohm=fit.model_ohm("short", at))


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
    fitted = _hidden(_in_its_place(_with_effect(shown, effect, held, limits, thorough), effect, before.motor), added.hides)
    return no_worse(before, fitted, effect, (*(held or ()), *(limits or ())))


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
    result = summarise(fitted.task, Found(solution, fitted.history, _searched(fitted.task, solution)), fitted.method, fitted.seed)
    return result if better_than(fitted, result) else fitted


def _shown(fit: Fit, names: Sequence[str]) -> Fit:
    """A fit in which parameters that were held because they had no visible influence are free again, at their last values."""
    shown = {name for name in names if name in fit.held and fit.held[name] == _least_value(fit, name)}
    if not shown:
        return fit
    held = {name: value for name, value in fit.held.items() if name not in shown}
    values = {**fit.parameters, **{name: fit.search_parameters.get(name, fit.parameters[name]) for name in shown}}
    return dataclasses.replace(fit, held=held, parameters=values)


def _hidden(fit: Fit, names: Sequence[str]) -> Fit:
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
    ends = _least(task.relative(), starts, FOLLOWED)
    for other in _neighbours(task):
        near = _least(other.relative(), starts, 1)
        if near.objective.min() < ends.objective.min():
            task, ends = other, near
    solution = relative_solution(task, ends, before.sizes)
    result = summarise(task, Found(solution, before.history, dict(solution.values)), before.method, before.seed)
    return dataclasses.replace(result, elapsed_s=time.perf_counter() - started)


def _neighbours(task: Task) -> Iterator[Task]:
    """The same with one number of parts next to that which the search has chosen."""
    for name, value in task.held.items():
        label, _, short = name.rpartition(".")
        tried = find_effect(label.partition("#")[0]).effect.tried.get(short, ()) if label else ()
        if value in tried:
            at = tried.index(value)
            for other in tried[max(at - 1, 0) : at + 2]:
                if other != value and other <= most_parts(task.measurement):
                    yield dataclasses.replace(task, held={**task.held, name: other})


def _least(problem: Problem, starts: Sequence[Mapping[str, float]], followed: int, steps: int = 100) -> Polished:
    """A few steps from each start, then to the end from those that are ahead."""
    first = polish(problem, problem.vectors(starts), iterations=GLANCE_STEPS, precision=ROUGH)
    ends = polish(problem, first.distinct(followed), iterations=steps, precision=ROUGH)
    return dataclasses.replace(ends, evaluations=first.evaluations + ends.evaluations)


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
        return dataclasses.replace(_by_ants(trail.task, before.seed), elapsed_s=time.perf_counter() - started)
    return followed(trail, before, thorough)


def task_without(before: Fit, gone: str) -> Task:
    """What a fit with one effect less has to fit: without the last of that name."""
    kept = list(before.effects)
    del kept[len(kept) - 1 - kept[::-1].index(gone)]
    motor = add_effects(dc_motor(), kept)
    names = {p.name for p in motor.parameters}
    return Task(
        motor,
        before.measurement,
        {name: b for name, b in before.bounds.items() if name in names},
        {name: value for name, value in before.held.items() if name in names},
    )


def values_without(before: Fit, motor: Motor) -> dict[str, float]:
    """Values of a fit for a motor with one effect less, in SI units by name.

    Two lines have one share of the capacitance to the frame and one of Ca, parameters of the first one: they keep their values if only the other
    one is left. Any other parameter that the fit does not have is in the middle of its range.
    """
    used = motor.used_parameters(*before.measurement.terminations)
    values = dict(before.parameters)
    for now, then in ((motor.distribution, before.motor.distribution), (motor.ends, before.motor.ends)):
        if now is not None and then is not None:
            values[now.name] = values[then.name]
    return {p.name: values.get(p.name, p.middle) for p in motor.parameters if p.name in used}


def trail_without(before: Fit, gone: str) -> Trail:
    """Start values of a fit with one effect less."""
    task = task_without(before, gone)
    own = values_without(before, task.motor)
    bases = [own, *({**own, **base} for base in base_starts(own, before.measurement.coarse, few=False))]
    # Without the effect the discrepancy is larger, by an unknown amount.
    return Trail(task, bases, len(bases), Sizes(1.0, before.sizes.declared))


def followed(trail: Trail, before: Fit, thorough: bool = True) -> Fit:
    """The fit from a model's start values, on all points; if that leaves an error, a `thorough` one also uses the ant colony."""
    started = time.perf_counter()
    raced = raced_alone(trail)
    solution = arrived_on_all(trail.task, [raced.values], searched=raced.searched)
    searched = _searched(trail.task, solution)
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

    def arrived(task: Task, values: Mapping[str, float]) -> Fit:
        whole = arrived_on_all(task, [values], solution.sizes, solution.searched, wanders=not described)
        return summarise(task, Found(whole, before.history, _searched(task, whole)), before.method, before.seed)

    best = arrived(trail.task, solution.values)
    # The numbers of parts between those that the search tries: half as far with each step.
    for name, step in _steps_of_parts(trail.task, before):
        # Where nothing is left no other number is better.
        while (step := step // 2) >= 1 and best.sizes.discrepancy > NOTHING_LEFT:
            for count in (best.held[name] - step, best.held[name] + step):
                if count <= most_parts(before.measurement):
                    task = dataclasses.replace(trail.task, held={**best.held, name: count})
                    other = arrived(task, {**best.parameters, **best.nuisance, name: count})
                    if better_than(best, other):
                        best = other
                        break
    return best


def _steps_of_parts(task: Task, before: Fit) -> Iterator[tuple[str, float]]:
    """Each number of parts that the search chose, and how far the next one that it tries is."""
    for label in task.motor.effects:
        for short, tried in find_effect(label).effect.tried.items():
            value = task.held.get(name := f"{label}.{short}")
            if value in tried and name not in before.held:
                yield name, tried[min(tried.index(value) + 1, len(tried) - 1)] - value


class Known(NamedTuple):
    """A solution of a model that an earlier fit or a diagnosis has found, perhaps for other data, bounds or held values.

    Parameters
    ----------
    values : dict
        Parameters, and nuisances if they are known, in SI units.
    fit : Fit, optional
        The fit that they are of.
    """

    values: Mapping[str, float]
    fit: Fit | None = None


@one_blas_thread
def also_from(fitted: Fit, known: Iterable[Known], held: Mapping[str, float] | None = None) -> Fit:
    """A fit, or one of the same model from values that are known already, if that is better.

    A search may miss what another one has found. Each known solution is only a place to start from: it is fitted to these data, moved into these
    bounds, and what is held keeps its value.

    Parameters
    ----------
    held : mapping, optional
        What the user holds, in SI units. What an effect keeps while it is fitted, such as a number of parts, is that of the known solution.
    """
    for one in known:
        found = _unless_the_same(one.fit, _from_known(fitted, one, held or {}), fitted)
        if found is not None and better_than(fitted, found):
            fitted = found
    return fitted


def _unless_the_same(stored: Fit | None, found: Fit | None, fitted: Fit) -> Fit | None:
    """What was found from a stored fit, or that fit itself where nothing is gained: fits that are repeated do not wander among equals."""
    if stored is None or found is None or (stored.bounds, stored.held, stored.method) != (found.bounds, found.held, found.method):
        return found
    if better_than(stored, found) or better_than(found, stored):
        return found
    return dataclasses.replace(stored, seed=fitted.seed, history=found.history, evaluations=found.evaluations, elapsed_s=found.elapsed_s)


def _from_known(fitted: Fit, known: Known, held: Mapping[str, float]) -> Fit | None:
    """The model of a fit from a known solution; None if that has more parts than these data can determine."""
    started = time.perf_counter()
    fixed = {p.name: held[p.name] for p in fitted.motor.parameters if p.name in held}
    tried = {f"{label}.{name}" for label in fitted.effects for name in find_effect(label.partition("#")[0]).effect.tried}
    for p in fitted.motor.parameters:
        if not p.vary and p.name not in fixed:
            value = known.values.get(p.name, fitted.held.get(p.name))
            if value is None or (p.name in tried and value > most_parts(fitted.measurement)):
                return None
            fixed[p.name] = value
    task = dataclasses.replace(fitted.task, held=fixed)
    effects = [find_effect(label.partition("#")[0]).effect for label in fitted.effects]
    sizes, known_search = (None, {}) if known.fit is None else (known.fit.sizes, dict(known.fit.search_parameters))
    if sizes is not None and misses_by_far(sizes) and any(effect.describes for effect in effects):
        # As in `_described`: the likelihood would lead to another description.
        problem = task.relative()
        ends = polish(problem, problem.vectors([known.values]), iterations=100, precision=ROUGH)
        solution = relative_solution(task, ends, sizes)
    else:
        solution = arrived_on_all(task, [known.values], sizes, known_search)
    searched = known_search or _searched(task, solution)
    result = summarise(task, Found(solution, fitted.history, searched), fitted.method, fitted.seed)
    result = _hidden(result, [name for effect in effects for name in effect.hides]) if effects else with_larger_winding(result)
    elapsed_s = fitted.elapsed_s + time.perf_counter() - started
    return dataclasses.replace(result, evaluations=fitted.evaluations + result.evaluations, elapsed_s=elapsed_s)


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


def _searched(task: Task, solution: Solution) -> dict[str, float]:
    """Start values for the next effect: the least relative error near a solution that leaves an error, else the solution."""
    if solution.sizes.discrepancy >= PLAIN:
        return dict(solution.values)
    search = task.thinned(SEARCH_POINTS)
    ends = polish(search, search.vectors([solution.values]), iterations=15, precision=ROUGH)
    return search.named(ends.u[0])


def _scanned_step(before: Fit, label: str) -> dict[str, float]:
    """The frequency at which a step of gain would explain most, over all points."""
    problem, measurement = before.weighed, before.measurement.coarse
    order = np.argsort(problem.observed.frequency_hz, kind="stable")
    position = np.log(problem.observed.frequency_hz[order])
    white = problem.less_allowed_error(before.unknowns)[order]
    variance = np.concatenate([noise.sigma for noise in measurement.noise])[order] ** 2
    places = np.unique(position)[2:-2]
    # A step is seen in the change between the few points on either side, in every sweep that covers it.
    low, here, high = (np.searchsorted(position, places + shift) for shift in (-STEP_REACH, 0.0, STEP_REACH))
    below, above = here - low, high - here
    whites, variances = (np.concatenate([[0.0], np.cumsum(values)]) for values in (white, variance))
    with np.errstate(all="ignore"):
        jump = (whites[high] - whites[here]) / above - (whites[here] - whites[low]) / below
        noise = (variances[high] - variances[low]) / (high - low) * (1 / above + 1 / below)
        gain = np.where((below >= 2) & (above >= 2), np.abs(jump) ** 2 / noise, 0.0)
    step = problem.observed.frequency_hz[order][np.searchsorted(position, places[int(np.argmax(gain))])]
    return {f"{label}.frequency_hz": float(step)}


on_fits.refit_with = lambda before, effect, held, thorough: refit_with(before, effect, held, thorough=thorough)
on_fits.refit_without = refit_without
