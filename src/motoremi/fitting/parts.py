"""Numbers of parts (the sections of a winding): which are tried, and how one of them is chosen.

A number of parts is held while the other parameters are fitted, so each number takes a search of its own.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from motoremi.data.measurement import Measurement
from motoremi.errors import BadInput
from motoremi.fitting.polish import Polished, polish
from motoremi.fitting.problem import Problem
from motoremi.fitting.race import ALL, Round, Rounds, Trail, race
from motoremi.fitting.result import Fit
from motoremi.fitting.search import ROUGH, SEARCH_POINTS, Task, misses_by_far
from motoremi.fitting.seen_by import MODES, seen_across, seen_by
from motoremi.model.effects import find_effect
from motoremi.model.effects.start import with_start
from motoremi.model.motor import Motor
from motoremi.threads import one_blas_thread
from motoremi.workers import Map

# Number of points that are needed to determine one resonance.
POINTS_EACH = 3
# Steps that are made to compare several numbers of parts, and from how many of the best starts.
GLANCE_STEPS, GLANCE_STARTS = 12, 12
# The same if nothing is left to describe: then any number will do.
GLANCE_STARTS_IF_DESCRIBED = 3
# How a number of parts is chosen where it matters: of ten windings of 2 to 12 sections the right one is found for seven; by fewer steps or starts
# for three to six.
COUNTING = Rounds((Round(SEARCH_POINTS, 12, ALL, ALL), Round(SEARCH_POINTS, 40, 20, 6)), 0, SEARCH_POINTS)


def numbers_of_parts(motor: Motor) -> Iterator[tuple[str, tuple[float, ...]]]:
    """The parameters of a motor's effects that are numbers of parts, and the numbers that are tried."""
    for label in motor.effects:
        for short, tried in find_effect(label).effect.tried.items():
            yield f"{label}.{short}", tried


def most_parts(measurement: Measurement) -> int:
    """The largest number of parts, with a resonance each, that the points of a sweep can determine."""
    return max(len(sweep.frequency_hz) for sweep in measurement.sweeps) // POINTS_EACH


def possible(tried: Sequence[float], measurement: Measurement) -> list[float]:
    """Of numbers that are tried, those that these data can determine."""
    most = most_parts(measurement)
    return [value for value in tried if value <= most]


def checked_parts(name: str, value: float, before: Fit) -> float:
    """The number of parts that the user holds; refused if these data cannot determine as many."""
    most = most_parts(before.measurement)
    if not value == round(value) or not 1 <= value <= most:
        raise BadInput(f"{name} = {value:g}: hold a whole number from 1 to {most:g}; each adds a resonance, which needs {POINTS_EACH} points")
    return value


def parts_of(trail: Trail, effect: str) -> dict[str, float]:
    """The number of parts that was chosen for an effect, if it has one: to be held in further searches, since each number takes one of its own."""
    names = {f"{effect}.{name}" for name in find_effect(effect).effect.tried}
    return {name: value for name, value in trail.task.held.items() if name in names}


def counted(trail: Trail, each: Map = map) -> Trail:
    """The same with the number of parts, if an effect has one, that reaches the lowest objective from these start values."""
    trails = {
        (name, value): dataclasses.replace(trail, task=with_number(trail.task, name, value))
        for name, tried in numbers_of_parts(trail.task.motor)
        for value in possible(tried, trail.task.measurement)
    }
    reached = race(trails, COUNTING, each=each).reached
    return trails[min(reached, key=lambda number: reached[number].best)] if reached else trail


@one_blas_thread
def counted_near(trail: Trail) -> Trail:
    """`counted`, from start values that are right but for the number of parts."""
    for name, tried in numbers_of_parts(trail.task.motor):
        sweeping = dataclasses.replace(trail, task=trail.task.sweeping(name))
        if found := _least_of_each(sweeping.problem(SEARCH_POINTS), trail.starts, name, tried):
            trail = dataclasses.replace(trail, task=with_number(trail.task, name, min(found, key=lambda value: found[value])))
    return trail


def with_number(task: Task, name: str, value: float) -> Task:
    """The same with another number of parts."""
    return dataclasses.replace(task, held={**task.held, name: value})


def chosen(task: Task, starts: Sequence[Mapping[str, float]], group: int, name: str, tried: Sequence[float], before: Fit) -> float:
    """The number of parts with the lowest objective after a few steps; the smallest one if these data can determine none.

    Where a line misses by far, its resonances hide how many parts there are: each number is looked at with one mode beside it.
    """
    if not (before.motor.is_line and misses_by_far(before.sizes)):
        most = GLANCE_STARTS if before.marginal.nothing_left < 0.5 else GLANCE_STARTS_IF_DESCRIBED
        found = _least_of_each(task.sweeping(name).thinned(SEARCH_POINTS), starts, name, tried, most)
    else:
        found = {}
        for value in possible(tried, task.measurement):
            one = with_number(task, name, value)
            problem = one.relative()
            ends = least(problem, starts[::group], 1, GLANCE_STEPS)
            found[value] = float(least(*_with_mode(one, problem.named(ends.u[ends.best]), before), 1, 2 * GLANCE_STEPS).objective.min())
    return min(found, key=lambda value: found[value], default=tried[0])


def _least_of_each(
    problem: Problem, starts: Sequence[Mapping[str, float]], name: str, tried: Sequence[float], most: int = ALL
) -> dict[float, float]:
    """The lowest objective with each number of parts after a few steps from the best starts, at most `most`.

    All numbers are one batch, in which each member keeps its own: on few points a step takes as long for one start as for ten.
    """
    numbers = possible(tried, problem.measurement)
    if not numbers:
        return {}
    u = problem.vectors([{**start, name: value} for value in numbers for start in starts]).reshape(len(numbers), len(starts), -1)
    best = np.argsort(problem.objective(u), axis=1)[:, :most]
    leading = np.take_along_axis(u, best[..., None], axis=1).reshape(-1, u.shape[-1])
    ends = polish(problem, leading, iterations=GLANCE_STEPS, precision=ROUGH)
    return dict(zip(numbers, ends.objective.reshape(best.shape).min(axis=1).tolist(), strict=True))


def _with_mode(task: Task, values: Mapping[str, float], before: Fit) -> tuple[Problem, list[dict[str, float]]]:
    """The least relative error with one more mode, and where it may start."""
    added = find_effect(MODES)
    label, seen_now = added.label_in(task.motor), seen_by(before)
    assert added.effect.reader is not None
    everything = {**{p.name: p.middle for p in task.motor.parameters}, **values}
    seen_so = dataclasses.replace(seen_now, across=seen_across(task.motor, everything, before.measurement.coarse), parameters=values)
    starts = [with_start(values, start, label) for start in added.effect.reader(seen_so)]
    motor = added.added_to(task.motor)
    return dataclasses.replace(task, motor=motor).relative(), starts or [dict(values)]


def least(problem: Problem, starts: Sequence[Mapping[str, float]], followed: int, steps: int = 100) -> Polished:
    """A few steps from each start, then to the end from those that are ahead."""
    first = polish(problem, problem.vectors(starts), iterations=GLANCE_STEPS, precision=ROUGH)
    ends = polish(problem, first.distinct(followed), iterations=steps, precision=ROUGH)
    return dataclasses.replace(ends, evaluations=first.evaluations + ends.evaluations)


def neighbours(task: Task) -> Iterator[Task]:
    """The same with one number of parts next to that which the search has chosen."""
    for name, tried in numbers_of_parts(task.motor):
        numbers = possible(tried, task.measurement)
        if (value := task.held.get(name)) in numbers:
            at = numbers.index(value)
            for other in (*numbers[max(at - 1, 0) : at], *numbers[at + 1 : at + 2]):
                yield with_number(task, name, other)


def between(task: Task, before: Fit) -> Iterator[tuple[str, float]]:
    """Each number of parts that the search chose, and the distance to the next one that it tries, or from the last but one to the last."""
    for name, tried in numbers_of_parts(task.motor):
        if (value := task.held.get(name)) in tried and name not in before.held:
            low = min(tried.index(value), len(tried) - 2)
            yield name, tried[low + 1] - tried[low]
