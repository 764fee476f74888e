"""Where to look for a fit with one effect more or less: start values, and what is held."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from motoremi.data.covariance import Sizes
from motoremi.fitting.band_scaling import scaled_ranges, scaled_starts
from motoremi.fitting.exchange import exchanged
from motoremi.fitting.parts import checked_parts, chosen
from motoremi.fitting.race import Trail
from motoremi.fitting.result import Fit
from motoremi.fitting.search import PLAIN, Task, misses_by_far
from motoremi.fitting.seen_by import open_alone, seen_by, seen_in
from motoremi.fitting.starts import base_starts
from motoremi.model.effects import add_effects, find_effect
from motoremi.model.effects.start import with_start
from motoremi.model.motor import Motor, dc_motor
from motoremi.threads import one_blas_thread

# A step of gain is sought in so much of ln(f) on either side.
STEP_REACH = 0.15


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
        seen_now = [seen_by(before, added.place), *(() if rival is None else (seen_in(rival, added.place),))]
        tried += [dict(start) for seen_one in seen_now for start in added.effect.reader(seen_one)]
        for one in open_alone(before.measurement):
            seen_so = dataclasses.replace(one.seen, parameters=before.parameters, place=added.place)
            tried += [{**one.elements, **start} for start in added.effect.reader(seen_so)]
    if near:
        bases = [{**own, **near}, own]
    else:
        # With a snubber and a strap of 0.38 uH the fit of the snubber alone had put all of the capacitance to the frame into Cr, and from there no
        # pair left less than 9 %. Not for a first effect: two of the five parts of a machine then came to 1.3 %, and the others were not shown.
        frame_anew = bool(before.effects) and misses_by_far(before.sizes)
        bases = base_starts(own, before.measurement.coarse, few=len(tried) > 9, frame_anew=frame_anew)
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
        name: checked_parts(name, fixed[name], before) if name in fixed else chosen(task, starts, len(bases), name, values, before)
        for name, values in unvaried.items()
        if values
    }
    return Trail(dataclasses.replace(task, held={**fixed, **parts}), starts, len(bases), before.sizes)


@one_blas_thread
def trail_from(job: tuple[Fit, str, Mapping[str, Any]]) -> Trail:
    """`trail_to` as a job for another process: the fit, the effect, and further arguments by name."""
    fit, effect, further = job
    return trail_to(fit, effect, **further)


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
