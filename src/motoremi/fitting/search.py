"""How solutions are searched: ants, start values, continuation in frequency, and the polish that ends each of them.

Searching happens on the residual `log` over a thinned grid, where the landscape is wide; the likelihood on all points has the last word.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from motoremi.arrays import FloatArray, JsonDict
from motoremi.data.measurement import Measurement
from motoremi.fitting.colony import Colony
from motoremi.fitting.polish import Polished, Precision, polish, sharpened
from motoremi.fitting.problem import Problem
from motoremi.fitting.starts import data_driven_starts
from motoremi.model.motor import Motor

# Points a sweep for searching; the final polish uses all.
SEARCH_POINTS = 48
# How many start values at least go on up the band.
FOLLOWED = 6
GENERATIONS = 12
ROUNDS = 3
# Of the residual `log`.
ROUGH = Precision(1e-7, 1e-4)


@dataclass(frozen=True)
class Task:
    """What is to be fitted: a motor's circuit to a measurement, within bounds, some parameters held."""

    motor: Motor
    measurement: Measurement
    bounds: Mapping[str, tuple[float, float]]
    held: Mapping[str, float]

    @cached_property
    def full(self) -> Problem:
        """The likelihood on all points."""
        return Problem(self.motor, self.measurement, self.bounds, self.held)

    def thinned(self, points: int, highest_hz: float = np.inf) -> Problem:
        """The search problem on about `points` points a sweep."""
        return Problem(self.motor, self.measurement, self.bounds, self.held, points=points, weights="log", highest_hz=highest_hz)

    def likelihood(self, points: int) -> Problem:
        """The likelihood on about `points` points a sweep."""
        return Problem(self.motor, self.measurement, self.bounds, self.held, points=points)


@dataclass(frozen=True)
class Found:
    """A solution of the likelihood, and the best of the search on the way there.

    Parameters
    ----------
    u : ndarray, shape (k,)
    converged : bool
    evaluations : int
    history : tuple of dict
    searched : dict
        Parameters of the best solution of the search problem, SI units: where the next effect starts from.
    """

    u: FloatArray
    converged: bool
    evaluations: int
    history: tuple[JsonDict, ...]
    searched: dict[str, float]


def good_enough(problem: Problem) -> float:
    """An objective that only the right valley reaches.

    Three standard deviations above its expectation, with the noise known no better than its repeats allow and the analyser's error
    described to 2 %; more where only scatter tells the noise.
    """
    measurement, degrees = problem.measurement, problem.degrees_of_freedom
    return measurement.doubt * degrees * (1.02 + 3 * float(np.hypot(np.sqrt(2 / degrees), measurement.noise_error)))


def surely_right(problem: Problem) -> float:
    """An objective at which a search need not go on: three standard deviations above its expectation."""
    return problem.degrees_of_freedom + 3 * float(np.sqrt(2 * problem.degrees_of_freedom))


def moved(u: FloatArray, source: Problem, target: Problem) -> FloatArray:
    """Unknowns of one problem as those of another, shape (batch, k)."""
    return np.array([target.vector(source.named(row)) for row in u])


def search_base(task: Task, seed: int) -> Found:
    """The paper's circuit: start values from the data first, then rounds of ants until the noise floor is reached or rounds end."""
    search, full = task.thinned(SEARCH_POINTS), task.full
    seeds = search.vectors(data_driven_starts(task.measurement))
    colony: Colony | None = None
    best: Polished | None = None
    searched: dict[str, float] = {}
    searched_objective = np.inf
    evaluations = 0
    history: list[JsonDict] = []
    # The search problem is down to noise and analyser; the likelihood tells whether that was the right valley.
    likely = 2 * search.observed.expected_objective
    for round_number in range(ROUNDS + 1):
        if round_number == 0:
            if not len(seeds):
                continue
            candidates = seeds
        else:
            if colony is None:
                colony = Colony(search, np.random.default_rng(seed), seeds)
            done = colony.evaluations
            for index, mean_square in enumerate(colony.walk(GENERATIONS)):
                count = evaluations + (index + 1) * (colony.evaluations - done) // GENERATIONS
                history.append({"evaluations": count, "rms_deviation_percent": 100 * float(np.sqrt(mean_square))})
            evaluations += colony.evaluations - done
            candidates = colony.different(8)
        rough = polish(search, candidates, iterations=40, precision=ROUGH, enough=likely)
        if round_number > 0 and rough.objective[rough.best] > likely:
            rough = rough.joined(climb(task, search, candidates))
        evaluations += rough.evaluations
        if rough.objective[rough.best] < searched_objective:
            searched, searched_objective = search.named(rough.u[rough.best]), float(rough.objective[rough.best])
        # On few points noise may favour a wrong valley: unless the first try is clear, let the likelihood choose among several.
        count = 1 if round_number == 0 and searched_objective < likely else 3
        final = polish(full, moved(rough.distinct(count), search, full))
        evaluations += final.evaluations
        if best is None or final.objective[final.best] < best.objective[best.best]:
            best = final
        assert best is not None
        mean_square = float(np.mean(np.abs(full.deviation(best.u[best.best])) ** 2))
        history.append({"evaluations": evaluations, "rms_deviation_percent": 100 * float(np.sqrt(mean_square))})
        if best.objective[best.best] < surely_right(full):
            break
    assert best is not None
    u, converged, more = winner(full, best)
    return Found(u, converged, evaluations + more, tuple(history), searched)


def winner(problem: Problem, ends: Polished) -> tuple[FloatArray, bool, int]:
    """The best end, sharpened if it converged; whether it did; evaluations spent."""
    u, converged = ends.u[ends.best], bool(ends.converged[ends.best])
    if not converged:
        return u, False, 0
    sharp, evaluations = sharpened(problem, u)
    return sharp, True, evaluations


def climb(task: Task, search: Problem, starts: FloatArray) -> Polished:
    """Fit the low end of the band first and raise its upper edge: a wrong resonance higher up cannot mislead what it does not reach."""
    lowest, highest = float(search.observed.frequency_hz.min()), float(search.observed.frequency_hz.max())
    u, evaluations = starts, 0
    for share in (0.36, 0.5, 0.63, 0.75, 0.88):
        part = task.thinned(60, lowest * (highest / lowest) ** share)
        stage = polish(part, u, iterations=25, precision=Precision(1e-6, 1e-3))
        evaluations += stage.evaluations
        u = stage.u[np.argsort(stage.objective)[: max(FOLLOWED, len(u) // 2)]]
    last = polish(search, u, iterations=40, precision=ROUGH)
    return dataclasses.replace(last, evaluations=last.evaluations + evaluations)
