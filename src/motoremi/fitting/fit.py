"""`fit`: from sweeps to a circuit with error bars; `refit_with` and `refit_without`: one effect more or less."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterable, Mapping

import numpy as np

from motoremi.data.measurement import Measurement
from motoremi.data.sweep import ImpedanceSweep
from motoremi.errors import BadInput
from motoremi.fitting.looks import POINTS, Scouted, Trail, settle, until_right
from motoremi.fitting.paper import paper_colony
from motoremi.fitting.problem import Problem, checked_bounds
from motoremi.fitting.readings import read_start
from motoremi.fitting.result import METHODS, Fit, summarise
from motoremi.fitting.scaling import scaled_ranges, scaled_starts
from motoremi.fitting.search import Found, Task, search_base
from motoremi.fitting.starts import base_starts
from motoremi.model.effects import add_effects, find_effect
from motoremi.model.motor import BASE_PARAMETERS, Motor, dc_motor

# A step of gain is sought in so much of ln(f) on either side.
STEP_REACH = 0.15
# What a start leaves of an element from which it takes more than there is.
LEAST_LEFT = 0.1


def fit(
    model: Motor | None,
    sweeps: Iterable[ImpedanceSweep] | Measurement,
    *,
    seed: int = 1,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    method: str = "ant-colony",
    analyser: str | None = None,
    held: Mapping[str, float] | None = None,
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
        Whose systematic errors to allow for: `4294a` (default), `e4990a`, `nanovna`, `none`.
    held : mapping, optional
        Parameters that are not fitted, in SI units: for example Ra from a DC measurement.

    Returns
    -------
    Fit

    Raises
    ------
    BadInput
        For sweeps, bounds or names that cannot be used.
    """
    started = time.perf_counter()
    motor = model if model is not None else dc_motor()
    if method not in METHODS:
        raise BadInput(f"unknown method {method!r}: use one of {', '.join(METHODS)}")
    measurement = sweeps if isinstance(sweeps, Measurement) else Measurement.of(sweeps, analyser)
    _check_informative(measurement)
    limits, fixed = checked_bounds(motor, bounds), _checked_held(motor, held)
    base = dc_motor()
    paper_names = {p.name for p in BASE_PARAMETERS}
    base_bounds = {n: b for n, b in limits.items() if n in paper_names}
    base_held = {n: v for n, v in fixed.items() if n in paper_names}
    task = Task(base, measurement, base_bounds, base_held)
    result = _by_the_paper(task, seed) if method == "paper" else _by_ants(task, seed)
    for effect in motor.effects:
        result = refit_with(result, effect, {n: v for n, v in fixed.items() if n.startswith(effect)}, limits)
    return dataclasses.replace(result, elapsed_s=time.perf_counter() - started)


def _checked_held(motor: Motor, held: Mapping[str, float] | None) -> dict[str, float]:
    names = {p.name for p in motor.parameters}
    for name, value in (held or {}).items():
        if name not in names:
            raise BadInput(f"held value for the unknown parameter {name!r}; the model has {', '.join(sorted(names))}")
        if not np.isfinite(value):
            raise BadInput(f"held value of {name} is not a finite number")
    return {name: float(value) for name, value in (held or {}).items()}


def _check_informative(measurement: Measurement) -> None:
    for sweep in measurement.sweeps:
        magnitude = np.abs(sweep.mean_ohm)
        if np.ptp(magnitude) < 1e-9 * magnitude.max() and np.ptp(np.angle(sweep.mean_ohm)) < 1e-9:
            raise BadInput(f"the {sweep.termination} sweep is the same at all frequencies: this is not a motor's impedance")


def _by_ants(task: Task, seed: int) -> Fit:
    found = search_base(task, seed)
    return summarise(task.full, found.u, found.converged, "ant-colony", seed, found.evaluations, found.history, found.searched)


def _by_the_paper(task: Task, seed: int) -> Fit:
    search = Problem(task.motor, task.measurement, task.bounds, task.held, weights="log")
    outcome = paper_colony(search, np.random.default_rng(seed))
    u = task.full.vector(search.named(outcome.u))
    result = summarise(task.full, u, outcome.converged, "paper", seed, outcome.evaluations, outcome.history)
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
    points: int = POINTS,
    by_likelihood: bool = False,
) -> Trail:
    """Where to look for a fit with one more effect; given the values of a solution `near`, with a rival in its place, from there above all."""
    added = find_effect(effect)
    label = added.label_in(before.motor)
    motor = added.added_to(before.motor)
    names = {p.name for p in motor.parameters}
    fixed = {**before.held, **(held or {})}
    scanned = any(not p.vary for p in added.effect.parameters)
    if scanned and not any(name.startswith(f"{label}.") for name in fixed):
        fixed.update(_scanned_step(before, label))
    wider = scaled_ranges(added.effect, label, before.measurement)
    bounds = {name: b for name, b in {**wider, **before.bounds, **(limits or {})}.items() if name in names}
    task = Task(motor, before.measurement, bounds, fixed)
    own = {**before.parameters, **before.search_parameters}
    tried = scaled_starts(added.effect, before.measurement)
    if read := read_start(before.measurement, added.effect.name):
        tried.append(dict(read))
    if near:
        bases = [{**own, **near}, own]
    else:
        bases = base_starts(own, before.measurement, few=len(tried) > 9)
        if before.effects:
            # With effects, the search's best and the likelihood's may lie in different valleys.
            bases.append({**own, **before.parameters})
    starts = [_started(base, start, label) for start in tried for base in bases]
    return Trail(task, starts, len(bases), (before.motor_error_percent / 100) ** 2, points, by_likelihood)


def _started(base: Mapping[str, float], start: Mapping[str, float], label: str) -> dict[str, float]:
    """Elements and an effect's start values together; a start may set an element, scale it, or take something off it."""
    changed = {
        name: start.get(f"={name}", max(value * start.get(f"*{name}", 1.0) - start.get(f"-{name}", 0.0), LEAST_LEFT * value))
        for name, value in base.items()
    }
    return {**changed, **{f"{label}.{name}": value for name, value in start.items() if not name.startswith(("=", "*", "-"))}}


def refit_with(
    before: Fit,
    effect: str,
    held: Mapping[str, float] | None = None,
    limits: Mapping[str, tuple[float, float]] | None = None,
    thorough: bool = True,
) -> Fit:
    """Add an effect to a fitted motor and fit again."""
    return settled(until_right(trail_to(before, effect, held, limits)), before, thorough)


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
    return settled(until_right(trail), before, thorough)


def trail_without(before: Fit, gone: str) -> Trail:
    """Where to look for a fit with one effect less."""
    kept = list(before.effects)
    del kept[len(kept) - 1 - kept[::-1].index(gone)]
    motor = add_effects(dc_motor(), kept)
    names = {p.name for p in motor.parameters}
    task = Task(
        motor,
        before.measurement,
        {name: b for name, b in before.bounds.items() if name in names},
        {name: value for name, value in before.held.items() if name in names},
    )
    own = {name: value for name, value in before.parameters.items() if name in names}
    return Trail(task, [{**own, **base} for base in base_starts(own, before.measurement, few=False)])


def settled(scouted: Scouted, before: Fit, thorough: bool) -> Fit:
    """The fit that a look leads to, on all points."""
    started = time.perf_counter()
    result = told(scouted.trail.task, settle(scouted, before.seed, thorough), before)
    return dataclasses.replace(result, elapsed_s=time.perf_counter() - started)


def told(task: Task, found: Found, before: Fit) -> Fit:
    """A solution found from a fit, with its statistics."""
    return summarise(task.full, found.u, found.converged, before.method, before.seed, found.evaluations, before.history, found.searched)


def _scanned_step(before: Fit, label: str) -> dict[str, float]:
    """The frequency at which a step of gain would explain most, over all points."""
    problem = before.problem
    order = np.argsort(problem.observed.frequency_hz, kind="stable")
    position = np.log(problem.observed.frequency_hz[order])
    white = problem.less_gain_error(problem.deviation(before.unknowns))[order]
    variance = np.concatenate([noise.sigma for noise in before.measurement.noise])[order] ** 2
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
