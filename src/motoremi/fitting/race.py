"""Comparison of many models (a race): all from their start values on few points, fewer and fewer on more, the last few by the likelihood.

Successive halving (Jamieson and Talwalkar, AISTATS 2016): each round continues with the best models, so most work is spent on those.
The rounds contain all settings of a race.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from motoremi.arrays import FloatArray, Progress
from motoremi.data.covariance import ROUGH_SHARE, Sizes
from motoremi.fitting.marginal import SMALLEST
from motoremi.fitting.polish import polish
from motoremi.fitting.problem import Problem
from motoremi.fitting.search import CLOSE, LITTLE_LEFT, MOST_DECLARED, PLAIN, ROUGH, Solution, Task, arrive, rough
from motoremi.threads import one_blas_thread
from motoremi.workers import Map

Name = TypeVar("Name", bound=Hashable)
Given = TypeVar("Given")
Reached = TypeVar("Reached")


class Round(NamedTuple):
    """One round of a race.

    Parameters
    ----------
    points : int
        Points of each sweep.
    steps : int
        Steps from each start.
    starts, models : int
        Largest number of starts of each model, and of models.
    likely : bool
        By the likelihood with a small discrepancy, whatever the models leave: near the noise, equal weights of the points distinguish nothing.
    """

    points: int
    steps: int
    starts: int
    models: int
    likely: bool = False


class Rounds(NamedTuple):
    """A whole race: its rounds, and how many models are then fitted by the likelihood (`arriving`), on how many points a sweep."""

    rounds: tuple[Round, ...]
    arriving: int
    points: int


# Undescribed part below which a further effect is compared by the likelihood: twice that at which the search itself changes to the likelihood.
LITTLE = 2 * PLAIN
ALL = 10_000
# Of the models fitted by the likelihood, so many, and all that are so near the best in log evidence, are refined until their error sizes are the
# most probable; those whose sizes still change by much may gain more by it.
FINISHING, BEHIND, BEHIND_UNSETTLED = 3, 15.0, 50.0
# One effect: some forty of them, with up to a hundred starts each, and each with the best single effect if that leaves little. No start is left out
# before seven steps: a resonance behind a suppressor (seed 25112702) was in a wrong local minimum after two steps and after four, and of one open
# sweep all starts with winding and frame in their own places were behind after two, and in front after seven. None of the effects is left out
# before thirty, since pairs start from the values that each has reached: with a fixture without compensation a skin effect was 28th of 34 at first.
SINGLES = Rounds((Round(40, 7, ALL, ALL), Round(40, 12, 8, ALL), Round(40, 15, 4, ALL), Round(80, 12, 3, 8)), 8, 80)
# A further effect with a set: no later race starts from the values that each has reached. Of seven motors of two generators the pair that was named
# was among the first nine of 39 to 162 after each round.
BESIDE = Rounds((Round(40, 7, ALL, ALL), Round(40, 12, 8, 40), Round(40, 15, 4, 16), Round(80, 12, 3, 8)), 8, 80)
# Two effects: eight hundred pairs, first with few steps from a few starts each. In 24 motors by the protocol (seed 660001) the true pair was among
# the first 54 after the first round, whatever the number of starts; a line with another effect (seed 90311701) was after six steps, not after
# four. If half of the pairs were left after two steps, a resonance beside a suppressor was in a worse minimum, and hid a choke beside it.
GLANCE = Rounds((Round(40, 6, ALL, ALL), Round(40, 12, 3, 150)), 0, 80)
# The leaders, of which `IN_FULL` start anew from all their start values: with a winding of sharp resonances few starts are near the right local
# minimum. Twelve of them take eighteen steps: a suppressor with the inductance of the frame strap was in a wrong minimum after six. Many pairs
# with one true effect are as good on few points of equal weight; the likelihood then distinguishes them.
PAIRS = Rounds((Round(80, 6, ALL, ALL), Round(80, 12, 12, ALL), Round(80, 15, 4, ALL), Round(80, 12, 2, ALL, likely=True)), 0, 80)
LEADERS, IN_FULL = 80, 24
# Number of pairs that are fitted by the likelihood, and largest number of them with one and the same effect: if that effect describes most by
# itself, every other one fits beside it.
ARRIVING, ALIKE_ARRIVING = Rounds((), 14, 80), 6
# From the solution of another effect: few starts, which begin near the end; and look-alikes, with more steps on more points. Of 58 starts of a
# choke in the place of a resonant cell, those in a wrong minimum (inductances exchanged) were in front after three steps, not after ten.
LOOK_NEAR = Rounds((Round(40, 3, ALL, ALL), Round(40, 8, 4, 10), Round(80, 10, 2, 5)), 5, 80)
LOOK_ALIKE = Rounds((Round(80, 3, ALL, ALL), Round(80, 8, 12, ALL), Round(80, 15, 4, ALL)), 8, 80)
# Of those that a race has left behind: points of each sweep, starts of each model, steps from them by the likelihood of the model before, and how
# many are then fitted. Where a stray capacitance caused most of the error, the true effect was first.
LEFT_POINTS, LEFT_STARTS, LEFT_STEPS, LEFT_ARRIVING = 80, 2, 6, 3
# For a single model, with more steps.
THOROUGH = Rounds((Round(80, 7, ALL, 1), Round(80, 40, 9, 1)), 1, 120)


def little_is_left(sizes: Sizes) -> bool:
    """Whether the undescribed part is small, and not because the analyser's errors were increased until they absorbed it."""
    return sizes.discrepancy < LITTLE and sizes.declared <= MOST_DECLARED


@dataclass(frozen=True)
class Trail:
    """A model and its start values.

    Parameters
    ----------
    task : Task
    starts : sequence of mapping
        Start values in SI units, by parameter.
    group : int
        Number of consecutive starts with the same values of the effect and different values of the elements.
    left : Sizes
        Error sizes of the model before: if they are small, the search is by the likelihood from the beginning, since equal weights of the
        points distinguish nothing near the noise.
    """

    task: Task
    starts: Sequence[Mapping[str, float]]
    group: int
    left: Sizes

    @cached_property
    def by_likelihood(self) -> bool:
        """Whether the search is by the likelihood from the beginning."""
        return little_is_left(self.left)

    @property
    def averaged(self) -> Trail:
        """The same with averaged points, if the sweeps have many thousands: the search uses only averages."""
        measurement = self.task.measurement.coarse
        if measurement is self.task.measurement:
            return self
        return dataclasses.replace(self, task=dataclasses.replace(self.task, measurement=measurement))

    def problem(self, points: int, likely: bool = False) -> Problem:
        """The least-squares problem of a round; `likely` as in `Round`."""
        # A tenth of the undescribed part: the discrepancy must not absorb what an effect would describe.
        little = max(0.1 * self.left.discrepancy, SMALLEST)
        if self.by_likelihood:
            return self.task.likelihood(points, Sizes(little, self.left.declared), ROUGH_SHARE)
        if likely:
            return self.task.likelihood(points, Sizes(min(little, LITTLE_LEFT), 1.0), ROUGH_SHARE)
        return self.task.thinned(points)


@dataclass(frozen=True)
class Standing:
    """The state of one model in the race, as plain data.

    Parameters
    ----------
    starts : sequence of dict
        The values that its starts have reached, SI units, the best first.
    objective : ndarray
        Objective of each.
    """

    starts: Sequence[Mapping[str, float]]
    objective: FloatArray

    @property
    def best(self) -> float:
        """The lowest objective."""
        return float(self.objective.min())


class Raced(NamedTuple, Generic[Name]):
    """The result of a race: solutions by the likelihood, the best evidence first, and the last state of each model."""

    solutions: dict[Name, Solution]
    reached: dict[Name, Standing]


def race(trails: Mapping[Name, Trail], rounds: Rounds, kept: Sequence[Name] = (), progress: Progress | None = None, each: Map = map) -> Raced[Name]:
    """Fit models from their start values on few points, fewer and fewer of them.

    Parameters
    ----------
    trails : mapping
        By name.
    rounds : Rounds
    kept : sequence
        Models that take part in every round, whatever their objective.
    progress : callable, optional
    each : callable
        Like the built-in `map`; called once for each round.
    """
    course = _Course(trails, each, progress, len(rounds.rounds) + 1)
    standing = {name: Standing(trail.starts, np.zeros(len(trail.starts))) for name, trail in trails.items()}
    reached = dict(standing)
    for one in rounds.rounds:
        chosen = _ahead(standing, one.models, kept)
        order = sorted(chosen, key=lambda name: -len(standing[name].starts))
        standing = course.round(_run, {name: (standing[name], one) for name in order})
        reached |= standing
    chosen = _ahead(standing, rounds.arriving, kept)
    found = course.round(_arrive, {name: (standing[name], rounds.points) for name in chosen})
    leading = sorted(found, key=lambda name: -found[name].log_evidence)
    behind = Best().behind(found)
    near = [name for name in leading if name in leading[:FINISHING] or behind[name] <= _reach(found[name])]
    found |= course.round(_finish, {name: (found[name], rounds.points) for name in near})
    return Raced(dict(sorted(found.items(), key=lambda pair: -pair[1].log_evidence)), reached)


def left_behind(trails: Mapping[Name, Trail], reached: Mapping[Name, Standing], each: Map = map) -> dict[Name, Solution]:
    """Solutions of those models that the likelihood of the model before prefers, of those that a race has left behind.

    If that model attributes most of the error to the analyser, points of equal weight say little about an effect that describes the rest.

    Parameters
    ----------
    trails, reached : mapping
        By name: the models, and their last state in the race.
    each : callable
        Like the built-in `map`.
    """
    course = _Course(trails, each, None, 1)
    objective = course.round(_objective_by_likelihood, dict.fromkeys(trails, LEFT_POINTS))
    chosen = sorted(objective, key=lambda name: objective[name])[:LEFT_ARRIVING]
    found = course.round(_arrive, {name: (reached[name], LEFT_POINTS) for name in chosen})
    return course.round(_finish, {name: (solution, LEFT_POINTS) for name, solution in found.items()})


def raced_alone(trail: Trail) -> Solution:
    """The solution of a single model."""
    return race({"": trail}, THOROUGH).solutions[""]


class Best:
    """The best solutions of races between the same models: the rough one, and the one of a likelihood, which are not compared with each other."""

    def __init__(self) -> None:
        self._log_evidence = {False: -np.inf, True: -np.inf}

    def behind(self, found: Mapping[Name, Solution]) -> dict[Name, float]:
        """By how much each solution is below the best of its kind in log evidence, these ones included."""
        for one in found.values():
            self._log_evidence[one.rough] = max(self._log_evidence[one.rough], one.log_evidence)
        return {name: self._log_evidence[one.rough] - one.log_evidence for name, one in found.items()}


class _Course(Generic[Name]):
    """Distributes the work on the models in rounds, and reports the model that is being computed."""

    def __init__(self, trails: Mapping[Name, Trail], each: Map, progress: Progress | None, stages: int) -> None:
        # Only averages are sent to other processes, not sweeps of many thousand points.
        self._trails = {name: trail.averaged for name, trail in trails.items()}
        self._each, self._progress, self._stages, self._done = each, progress, stages, 0

    def round(self, work: Callable[[tuple[Trail, Given]], Reached], given: Mapping[Name, Given]) -> dict[Name, Reached]:
        """The results of a round of work, by name, in the order given."""
        results = iter(self._each(work, [(self._trails[name], one) for name, one in given.items()]))
        found = {}
        for name in given:
            if self._progress is not None:
                self._progress(" + ".join(name) if isinstance(name, tuple) else str(name), self._done, self._stages)
            found[name] = next(results)
        self._done = min(self._done + 1, self._stages - 1)
        return found


def _ahead(standing: Mapping[Name, Standing], most: int, kept: Sequence[Name]) -> list[Name]:
    order = sorted(standing, key=lambda name: standing[name].best)
    return list(dict.fromkeys([*order[:most], *(name for name in kept if name in standing)]))


@one_blas_thread
def _run(job: tuple[Trail, tuple[Standing, Round]]) -> Standing:
    """Some steps of the best starts of one model."""
    trail, (standing, one) = job
    problem = trail.problem(one.points, one.likely)
    first = len(standing.starts) == len(trail.starts)
    chosen = _leaders(standing.objective, trail.group if first else 1, one.starts)
    precision = CLOSE if trail.by_likelihood or one.likely else ROUGH
    ends = polish(problem, problem.vectors([standing.starts[i] for i in chosen]), iterations=one.steps, precision=precision, bending=one.steps > 5)
    order = range(len(chosen)) if len(chosen) == len(trail.starts) else np.argsort(ends.objective)
    return Standing([problem.named(ends.u[i]) for i in order], ends.objective[list(order)])


def _leaders(objective: FloatArray, group: int, most: int) -> np.ndarray:
    """Indices of the starts that continue: the best of each group, since the best of all may be in one wrong minimum; then the best of the rest."""
    if len(objective) <= most:
        return np.arange(len(objective))
    best = np.array([at + int(np.argmin(objective[at : at + group])) for at in range(0, len(objective), group)])
    rest = np.setdiff1d(np.arange(len(objective)), best)
    return np.concatenate([best[np.argsort(objective[best])], rest[np.argsort(objective[rest])]])[:most]


@one_blas_thread
def _objective_by_likelihood(job: tuple[Trail, int]) -> float:
    """The objective after some steps by the likelihood of the model before, from the start values."""
    trail, points = job
    problem = trail.task.likelihood(points, trail.left, ROUGH_SHARE)
    starts = problem.vectors(trail.starts)
    chosen = np.argsort(problem.objective(starts))[:LEFT_STARTS]
    return float(polish(problem, starts[chosen], iterations=LEFT_STEPS, precision=CLOSE).objective.min())


@one_blas_thread
def _arrive(job: tuple[Trail, tuple[Standing, int]]) -> Solution:
    trail, (standing, points) = job
    problem = trail.problem(points)
    starts = problem.vectors(standing.starts)
    order = np.argsort(problem.objective(starts))[:3]
    solution = arrive(trail.task, [standing.starts[i] for i in order], points, most=1, steps=15)
    if trail.by_likelihood:
        return solution
    searched = standing.starts[order[0]]
    solution = dataclasses.replace(solution, searched=searched)
    if solution.sizes.discrepancy < PLAIN:
        return solution
    found = rough(solution.marginal, problem, starts[order[0]])
    if found.log_evidence == solution.log_evidence:
        return solution
    return dataclasses.replace(solution, values={**solution.values, **searched}, marginal=found, rough=True)


def _reach(solution: Solution) -> float:
    return BEHIND if solution.marginal.settled(solution.sizes) else BEHIND_UNSETTLED


@one_blas_thread
def _finish(job: tuple[Trail, tuple[Solution, int]]) -> Solution:
    trail, (solution, points) = job
    if solution.converged and solution.marginal.settled(solution.sizes):
        return solution
    further = arrive(trail.task, [solution.values], points, most=3, sizes=solution.marginal.likeliest, steps=25)
    return max(solution, dataclasses.replace(further, searched=solution.searched), key=lambda one: one.log_evidence)
