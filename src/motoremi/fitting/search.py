"""How solutions are searched: ants, start values, continuation in frequency, and the polish that ends each of them.

Searching happens on the residual `log` over a thinned grid, where the landscape is wide; the likelihood on all points has the last word.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from motoremi.arrays import FloatArray, JsonDict
from motoremi.data.measurement import Measurement
from motoremi.fitting.colony import Colony
from motoremi.fitting.polish import Polished, polish, sharpened
from motoremi.fitting.problem import Problem
from motoremi.fitting.starts import data_driven_starts
from motoremi.model.motor import Motor

# Points a sweep for searching; the final polish uses all.
SEARCH_POINTS = 48
FIRST_POINTS = 40
EFFECT_POINTS = 80
# Steps for all start values on few points; for those near a solution with another effect.
FIRST_STEPS = 4
RIVAL_STEPS = 12
# Steps of a glance beyond these: for the best of each group (so many groups at most), for the best few.
GLANCE_STEPS = (12, 12)
MOST_LEADERS = 9
# A search may stop once it leaves so much less than the model before.
MUCH_BETTER = 0.02
# Steps by the likelihood: few, but more where the analyser's errors blur what the search can see.
FEW_STEPS = 6
STEPS_IF_BLURRED = 20
# Steps for all start values where they are searched through, and how many at least go on up the band.
THOROUGH_STEPS = 7
FOLLOWED = 6
GENERATIONS = 12
ROUNDS = 3
# Damping to begin with close to the solution, where the linear model holds.
WARM = 1e-6
ROUGH = {"tolerance": 1e-7, "relative": 1e-4}


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
    seeds = np.array([search.vector(start) for start in data_driven_starts(task.measurement)]).reshape(-1, len(search.unknowns))
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
        rough = polish(search, candidates, iterations=40, **ROUGH, enough=likely)
        if round_number > 0 and rough.objective[rough.best] > likely:
            rough = rough.joined(_climb(task, search, candidates))
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
    u, converged, more = _winner(full, best)
    return Found(u, converged, evaluations + more, tuple(history), searched)


def _winner(problem: Problem, ends: Polished) -> tuple[FloatArray, bool, int]:
    """The best end, sharpened if it converged; whether it did; evaluations spent."""
    u, converged = ends.u[ends.best], bool(ends.converged[ends.best])
    if not converged:
        return u, False, 0
    sharp, evaluations = sharpened(problem, u)
    return sharp, True, evaluations


@dataclass(frozen=True)
class Scouted:
    """Where start values led.

    Parameters
    ----------
    task : Task
    search : Problem
        On a thinned grid.
    thinned : Problem
        The likelihood on the same grid.
    starts : ndarray, shape (m, k)
        As unknowns of `search`.
    group : int
        Each so many of them in turn start an effect alike, from different values of the elements.
    enough : float
        An objective of the search that will do.
    found : Polished
        Where they ended.
    likely : Polished
        Where the likelihood took the best of those ends.
    """

    task: Task
    search: Problem
    thinned: Problem
    starts: FloatArray
    group: int
    enough: float
    found: Polished
    likely: Polished

    @property
    def right(self) -> bool:
        """Whether nothing but noise is left."""
        return self.objective < surely_right(self.thinned)

    @property
    def objective(self) -> float:
        """Minus twice the log likelihood of the best end, on the thinned grid."""
        return float(self.likely.objective[self.likely.best])

    def values(self) -> dict[str, float]:
        """Parameters of the best end in SI units."""
        return self.thinned.named(self.likely.u[self.likely.best])


def _judged(search: Problem, thinned: Problem, found: Polished, iterations: int) -> Polished:
    """The best ends of a search polished by the likelihood, still on the thinned grid."""
    ends = moved(found.distinct(3), search, thinned)
    return polish(thinned, ends, iterations=iterations, tolerance=0.1, relative=1e-3, enough=0.9 * surely_right(thinned))


@dataclass(frozen=True)
class Begun:
    """Start values after their first steps, on few points: that tells which effects are worth following.

    Parameters
    ----------
    task : Task
    starts : ndarray, shape (m, k)
    group : int
        See `Scouted`.
    before : float
        Mean square of ln(Z_model/Z_measured) that is to be improved upon.
    ends : Polished
    """

    task: Task
    starts: FloatArray
    group: int
    before: float
    ends: Polished

    @property
    def objective(self) -> float:
        """Sum of squares that the best of them leaves."""
        return float(self.ends.objective[self.ends.best])


def _enough(search: Problem, before: float) -> float:
    return min(0.1 * search.observed.expected_objective, MUCH_BETTER * before * search.size)


def begin(
    task: Task, starts: Sequence[Mapping[str, float]], group: int = 1, before: float = np.inf, steps: int = FIRST_STEPS
) -> Begun:
    """A few steps for all start values, which need not lead anywhere; parameters as those of `Begun`."""
    search = task.thinned(FIRST_POINTS)
    first = np.array([search.vector(start) for start in starts])
    ends = polish(search, first, iterations=steps, **ROUGH, enough=_enough(search, before))
    return Begun(task, first, group, before, ends)


def followed(begun: Begun) -> Scouted:
    """Some more steps for the better ones of what was begun, and a few by the likelihood."""
    task = begun.task
    search = task.thinned(EFFECT_POINTS)
    thinned = Problem(task.motor, task.measurement, task.bounds, task.held, points=EFFECT_POINTS)
    enough = _enough(search, begun.before)
    u, evaluations = begun.ends.u[_leaders(begun.ends.objective, begun.group)[:MOST_LEADERS]], begun.ends.evaluations
    for steps in GLANCE_STEPS:
        part = polish(search, u, iterations=steps, **ROUGH, enough=enough)
        u, evaluations = part.distinct(3), evaluations + part.evaluations
    found = dataclasses.replace(part, evaluations=evaluations)
    blurred = found.objective[found.best] < search.observed.expected_objective
    likely = _judged(search, thinned, found, STEPS_IF_BLURRED if blurred else FEW_STEPS)
    return Scouted(task, search, thinned, begun.starts, begun.group, enough, found, likely)


def _leaders(objective: FloatArray, group: int) -> np.ndarray:
    """Indices of the best of each group, best first: the best of all would follow one valley only, where false ones are easier to reach."""
    best = np.array([at + int(np.argmin(objective[at : at + group])) for at in range(0, len(objective), group)])
    return best[np.argsort(objective[best])]


def pursued(glanced: Scouted) -> Scouted:
    """What a glance found, followed to its end."""
    if glanced.right:
        return glanced
    search, thinned = glanced.search, glanced.thinned
    found = polish(search, glanced.found.u, iterations=40, **ROUGH, enough=glanced.enough)
    return dataclasses.replace(glanced, found=found.joined(glanced.found), likely=_judged(search, thinned, found, 60).joined(glanced.likely))


def searched_through(glanced: Scouted) -> Scouted:
    """The same starts once more without haste: more steps before the best are chosen, and the low end of the band comes first."""
    search = glanced.search
    first = polish(search, glanced.starts, iterations=THOROUGH_STEPS, **ROUGH)
    leaders = _leaders(first.objective, glanced.group)
    found = polish(search, first.u[leaders[:MOST_LEADERS]], iterations=40, **ROUGH, enough=glanced.enough)
    if found.objective[found.best] > glanced.enough:
        found = found.joined(_climb(glanced.task, search, glanced.starts[leaders]))
    found = found.joined(glanced.found)
    return dataclasses.replace(glanced, found=found, likely=_judged(search, glanced.thinned, found, 60).joined(glanced.likely))


def until_right(glanced: Scouted) -> Scouted:
    """As far as it takes: to the end of the glance, or through all starts again."""
    followed = pursued(glanced)
    return followed if followed.right else searched_through(followed)


def settle(scouted: Scouted, seed: int, thorough: bool, polished: bool = True) -> Found:
    """Polish on all points; `thorough` sends ants out as well where the starts do not lead down to the noise.

    Without `polished`, the solution on the thinned grid is taken as it is.
    """
    full = scouted.task.full
    # Both problems of the likelihood have the same unknowns.
    final = polish(full, scouted.likely.distinct(1 if scouted.right else 2), iterations=150 if polished else 0, damping=WARM)
    if polished and scouted.right and final.objective[final.best] > good_enough(full):
        # What looked right on a few points is not on all.
        scouted = searched_through(scouted)
        final = final.joined(polish(full, scouted.likely.distinct(2), damping=WARM))
    search, found = scouted.search, scouted.found
    if thorough and final.objective[final.best] > good_enough(full):
        colony = Colony(search, np.random.default_rng(seed), np.concatenate([scouted.starts, found.u]))
        colony.walk(GENERATIONS)
        ends = polish(search, colony.different(12), iterations=40, **ROUGH)
        final = final.joined(polish(full, moved(ends.distinct(3), search, full)))
        found = found.joined(ends)
    u, converged, more = _winner(full, final)
    return Found(
        u,
        converged,
        found.evaluations + scouted.likely.evaluations + final.evaluations + more,
        (),
        search.named(found.u[found.best]),
    )


def _climb(task: Task, search: Problem, starts: FloatArray) -> Polished:
    """Fit the low end of the band first and raise its upper edge: a wrong resonance higher up cannot mislead what it does not reach."""
    lowest, highest = float(search.observed.frequency_hz.min()), float(search.observed.frequency_hz.max())
    u, evaluations = starts, 0
    for share in (0.36, 0.5, 0.63, 0.75, 0.88):
        part = task.thinned(60, lowest * (highest / lowest) ** share)
        stage = polish(part, u, iterations=25, tolerance=1e-6, relative=1e-3)
        evaluations += stage.evaluations
        u = stage.u[np.argsort(stage.objective)[: max(FOLLOWED, len(u) // 2)]]
    last = polish(search, u, iterations=40, **ROUGH)
    return dataclasses.replace(last, evaluations=last.evaluations + evaluations)


def base_starts(parameters: Mapping[str, float], measurement: Measurement, few: bool) -> list[dict[str, float]]:
    """Values of the elements to start an effect from.

    A model that lacks an effect bends its elements, so besides the fit itself there are the values that the data give away (the frame's
    from the difference of the two sweeps, which no effect in the winding touches), and Ra without the losses that it had to carry.
    """
    searched = dict(parameters)
    bases = [searched, *({**searched, **start} for start in data_driven_starts(measurement)[:1])]
    if few:
        return bases
    bases = [{**base, "Ra": base.get("Ra", 1.0) * ra} for base in bases for ra in (1.0, 0.1)]
    if searched.keys() >= {"Cr", "Cf"}:
        bases.append({**searched, **_neutral_frame(searched["Cr"] + searched["Cf"], measurement)})
    return bases


def _neutral_frame(capacitance_f: float, measurement: Measurement) -> dict[str, float]:
    """A frame that keeps its low-frequency capacitance and resonates, well damped, a third of the way below the end of the band."""
    omega = 2 * np.pi * 0.35 * max(sweep.frequency_hz[-1] for sweep in measurement.sweeps)
    cr, cf = 0.6 * capacitance_f, 0.4 * capacitance_f
    in_series = cr * cf / (cr + cf)
    lr = 1 / (omega**2 * in_series)
    return {"Cr": cr, "Cf": cf, "Lr": lr, "Rr": 0.7 * float(np.sqrt(lr / in_series))}
