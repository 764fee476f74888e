"""Looks at a fit with one more effect: begun on few points, followed, pursued, searched through, settled.

Each stage takes what the one before found and costs several times as much, so a diagnosis follows only what begins well. Stages return
plain arrays, which may come from another process.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from motoremi.arrays import FloatArray
from motoremi.fitting.colony import Colony
from motoremi.fitting.polish import Polished, Precision, polish
from motoremi.fitting.problem import Problem
from motoremi.fitting.search import GENERATIONS, ROUGH, Found, Task, climb, good_enough, moved, surely_right, winner

# Points a sweep for searching, and to begin with where many effects are looked at; to settle all are used.
POINTS = 80
FEW_POINTS = 40
# The first steps: for all start values, and for so many of the best.
STEPS_OF_ALL = 1
FIRST_STEPS = 3
MOST_KEPT = 12
# Further steps for so many of the better ones, then for the best few.
FURTHER_STEPS = 10
FURTHER_LEADERS = 6
MORE_STEPS = 5
MOST_LEADERS = 9
# A search may stop once it leaves so much less than the model before.
MUCH_BETTER = 0.02
# Steps by the likelihood straight after the first, and more of them below so many times the chi-squared of noise: of 174 trials of true
# effects 150 got to the noise so; of the others 15 were above that, of these 150 one.
TRIED_STEPS = 4
PROMISING = 1000.0
DIRECT_STEPS = 8
# Steps by the likelihood otherwise.
FEW_STEPS = 8
# Steps for all start values where they are searched through.
THOROUGH_STEPS = 7
# Of what leaves less than so many times the chi-squared of noise alone, but more than that, the two best ends are settled.
UNSURE_FACTOR = 10.0
# Steps of a pursuit in a round by the likelihood, and how much of what is too much a round must take away for another one to follow.
PURSUED_STEPS = 15
MORE_ROUNDS = 3
WORTH_A_ROUND = 0.1
# When a polish by the likelihood has converged as far as a look is concerned.
CLOSE = Precision(0.1, 1e-3)
# Damping to begin with close to the solution, where the linear model holds.
WARM = 1e-6


@dataclass(frozen=True)
class Trail:
    """Where a look starts.

    Parameters
    ----------
    task : Task
    starts : sequence of mapping
        Start values in SI units, by parameter.
    group : int
        Each so many of them in turn start an effect alike, from different values of the elements.
    before : float
        Mean square of ln(Z_model/Z_measured) that is to be improved upon.
    points : int
        A sweep, to begin with.
    by_likelihood : bool
        Search by the likelihood from the beginning: near the noise the other residual, which knows nothing of it, tells no more.
    """

    task: Task
    starts: Sequence[Mapping[str, float]]
    group: int = 1
    before: float = np.inf
    points: int = POINTS
    by_likelihood: bool = False

    @cached_property
    def search(self) -> Problem:
        """The search problem."""
        return self.likelihood if self.by_likelihood else self.task.thinned(POINTS)

    @cached_property
    def few(self) -> Problem:
        """The search problem to begin with."""
        if self.points == POINTS:
            return self.search
        return self.task.likelihood(self.points) if self.by_likelihood else self.task.thinned(self.points)

    @cached_property
    def likelihood(self) -> Problem:
        """The likelihood on the same grid."""
        return self.task.likelihood(POINTS)

    @cached_property
    def first(self) -> FloatArray:
        """Start values as unknowns of the search problem, shape (m, k)."""
        return self.search.vectors(self.starts)

    def enough(self, search: Problem) -> float:
        """An objective of the search that will do."""
        if self.by_likelihood:
            return 0.9 * surely_right(search)
        return min(0.1 * search.observed.expected_objective, MUCH_BETTER * self.before * search.size)


@dataclass(frozen=True)
class Begun:
    """A trail after the first steps, which tell whether it is worth following."""

    trail: Trail
    ends: Polished

    @property
    def objective(self) -> float:
        """Sum of squares that the best of them leaves."""
        return float(self.ends.objective[self.ends.best])


@dataclass(frozen=True)
class Ends:
    """Where a trail led: ends of the search, and where the likelihood took the best of them."""

    found: Polished
    likely: Polished

    def joined(self, other: Ends) -> Ends:
        """Those of both."""
        return Ends(self.found.joined(other.found), self.likely.joined(other.likely))


@dataclass(frozen=True)
class Scouted:
    """A trail that was followed."""

    trail: Trail
    ends: Ends

    @cached_property
    def right(self) -> bool:
        """Whether nothing but noise is left."""
        return self.objective < surely_right(self.trail.likelihood)

    @property
    def objective(self) -> float:
        """Minus twice the log likelihood of the best end, on the thinned grid."""
        return float(self.ends.likely.objective[self.ends.likely.best])

    @property
    def searched(self) -> float:
        """Sum of squares that the search left, on the thinned grid."""
        return float(self.ends.found.objective[self.ends.found.best])

    def values(self) -> dict[str, float]:
        """Parameters of the best end in SI units."""
        return self.trail.likelihood.named(self.ends.likely.u[self.ends.likely.best])


def begin(trail: Trail) -> Polished:
    """A few steps for all start values, which need not lead anywhere."""
    few = trail.few
    enough = trail.enough(few)
    ends = polish(few, few.vectors(trail.starts), iterations=STEPS_OF_ALL, precision=ROUGH, enough=enough)
    kept = _leaders(ends.objective, trail.group, MOST_KEPT)
    further = polish(few, ends.u[kept], iterations=FIRST_STEPS, precision=ROUGH, enough=enough, bending=False)
    return ends.replaced(kept, further)


def advance(begun: Begun) -> Polished:
    """Some more steps for the better ones of what was begun, still on few points."""
    trail = begun.trail
    starts = begun.ends.u[_leaders(begun.ends.objective, trail.group, FURTHER_LEADERS)]
    part = polish(trail.few, starts, iterations=FURTHER_STEPS, precision=ROUGH, enough=trail.enough(trail.few), bending=False)
    return dataclasses.replace(part, evaluations=part.evaluations + begun.ends.evaluations)


def follow(advanced: Begun, hopeless: float = np.inf) -> Ends:
    """Some steps for the best few of what was advanced, and a few by the likelihood; none of these for what still leaves `hopeless`."""
    trail, search = advanced.trail, advanced.trail.search
    if advanced.objective > hopeless:
        return Ends(advanced.ends, _judged(trail, advanced.ends, 0))
    found = polish(search, advanced.ends.distinct(3), iterations=MORE_STEPS, precision=ROUGH, enough=trail.enough(search))
    found = dataclasses.replace(found, evaluations=found.evaluations + advanced.ends.evaluations)
    if found.objective[found.best] > hopeless:
        return Ends(found, _judged(trail, found, 0))
    return Ends(found, _judged(trail, found, FEW_STEPS))


def pursue(scouted: Scouted, tried: bool = True) -> Ends:
    """What was followed, to its end; where the likelihood was `tried` from what is good enough for the search, that was not good enough."""
    if scouted.right:
        return scouted.ends
    trail = scouted.trail
    if trail.by_likelihood:
        found = scouted.ends.likely
    else:
        wanted = trail.enough(trail.search)
        stop = -np.inf if tried and scouted.searched < wanted else wanted
        found = polish(trail.search, scouted.ends.found.u, iterations=40, precision=ROUGH, enough=stop)
    likelihood = trail.likelihood
    enough, before = 0.9 * surely_right(likelihood), scouted.objective
    likely = _judged(trail, found, PURSUED_STEPS)
    for _ in range(MORE_ROUNDS):
        now = float(likely.objective[likely.best])
        if now < enough or before - now < WORTH_A_ROUND * (before - enough):
            break
        before, done = now, likely.evaluations
        likely = polish(likelihood, likely.u, iterations=PURSUED_STEPS, precision=CLOSE, enough=enough, damping=WARM)
        likely = dataclasses.replace(likely, evaluations=likely.evaluations + done)
    return Ends(found, likely).joined(scouted.ends)


def search_through(scouted: Scouted) -> Ends:
    """The same starts once more without haste: more steps before the best are chosen, and the low end of the band comes first."""
    trail, search = scouted.trail, scouted.trail.search
    enough = trail.enough(search)
    first = polish(search, trail.first, iterations=THOROUGH_STEPS, precision=ROUGH)
    found = polish(search, first.u[_leaders(first.objective, trail.group)], iterations=40, precision=ROUGH, enough=enough)
    if found.objective[found.best] > enough and not trail.by_likelihood:
        found = found.joined(climb(trail.task, search, trail.first[_leaders(first.objective, trail.group, MOST_KEPT)]))
    found = found.joined(scouted.ends.found)
    return Ends(found, _judged(trail, found, 60).joined(scouted.ends.likely))


def glance(trail: Trail) -> Scouted:
    """Begin and follow a trail; where the likelihood leads straight from the first steps to the noise, nothing needs following."""
    begun = Begun(trail, begin(trail))
    direct = _direct(begun)
    return direct if direct.right else Scouted(trail, follow(Begun(trail, advance(begun))))


def until_right(trail: Trail) -> Scouted:
    """As far as it takes: straight by the likelihood, by the search to its end, or through all starts again."""
    begun = Begun(trail, begin(trail))
    look = _direct(begun)
    if not look.right:
        ahead = advance(begun)
        ends = _ends_at(trail.search, ahead.distinct(3), ahead.evaluations)
        tried = begun.objective < trail.enough(trail.search)
        look = Scouted(trail, pursue(Scouted(trail, Ends(ends, look.ends.likely)), tried))
    return look if look.right else Scouted(trail, search_through(look))


def _direct(begun: Begun) -> Scouted:
    """The likelihood straight from the first steps, for as long as it looks as if it leads to the noise."""
    trail = begun.trail
    likelihood = trail.likelihood
    right = surely_right(likelihood)
    likely = _judged(trail, begun.ends, TRIED_STEPS)
    if 0.9 * right < likely.objective[likely.best] < PROMISING * right:
        likely = polish(likelihood, likely.u, iterations=DIRECT_STEPS, precision=CLOSE, enough=0.9 * right, damping=WARM)
    return Scouted(trail, Ends(_ends_at(trail.search, moved(likely.u, likelihood, trail.search), begun.ends.evaluations), likely))


def _ends_at(search: Problem, u: FloatArray, evaluations: int) -> Polished:
    """Solutions as ends of the search."""
    return Polished(u, search.objective(u), np.zeros(len(u), dtype=np.bool_), evaluations)


def settle(scouted: Scouted, seed: int, thorough: bool, polished: bool = True) -> Found:
    """Polish on all points; `thorough` searches the starts through, and sends ants out, where they do not lead down to the noise.

    Without `polished`, the solution on the thinned grid is taken as it is.
    """
    trail, ends = scouted.trail, scouted.ends
    full, search = trail.task.full, trail.search
    # Both problems of the likelihood have the same unknowns. Near the noise a few points may not tell which of two ends is the right one.
    unsure = not scouted.right and scouted.objective < UNSURE_FACTOR * surely_right(trail.likelihood)
    final = polish(full, ends.likely.distinct(2 if unsure else 1), iterations=150 if polished else 0, damping=WARM)
    if thorough and scouted.right and final.objective[final.best] > good_enough(full):
        # What looked right on a few points is not on all.
        ends = search_through(scouted)
        final = final.joined(polish(full, ends.likely.distinct(2), damping=WARM))
    found = ends.found
    if thorough and final.objective[final.best] > good_enough(full):
        colony = Colony(search, np.random.default_rng(seed), np.concatenate([trail.first, found.u]))
        colony.walk(GENERATIONS)
        more = polish(search, colony.different(12), iterations=40, precision=ROUGH)
        final = final.joined(polish(full, moved(more.distinct(3), search, full)))
        found = found.joined(more)
    u, converged, evaluations = winner(full, final)
    evaluations += found.evaluations + ends.likely.evaluations + final.evaluations
    return Found(u, converged, evaluations, (), search.named(found.u[found.best]))


def _leaders(objective: FloatArray, group: int, most: int = MOST_LEADERS) -> np.ndarray:
    """Indices of those to go on with: the best of each group, since the best of all may lie in one false valley; then the best of the rest."""
    best = np.array([at + int(np.argmin(objective[at : at + group])) for at in range(0, len(objective), group)])
    rest = np.setdiff1d(np.arange(len(objective)), best)
    return np.concatenate([best[np.argsort(objective[best])], rest[np.argsort(objective[rest])]])[:most]


def _judged(trail: Trail, found: Polished, iterations: int) -> Polished:
    """The best ends of a search polished by the likelihood, still on the thinned grid."""
    likelihood = trail.likelihood
    ends = moved(found.distinct(3), trail.search, likelihood)
    return polish(likelihood, ends, iterations=iterations, precision=CLOSE, enough=0.9 * surely_right(likelihood))
