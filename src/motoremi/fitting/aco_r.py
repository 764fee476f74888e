"""The ant colony of this project, for continuous parameters (ACO_R).

The paper's ants choose among 30 fixed values for each parameter, and the nearest such point is hundreds of times worse than the noise.
Here the pheromone is an archive of good solutions (ACO_R: Socha and Dorigo, European Journal of Operational Research 185, 2008): an ant
picks a member by rank and walks from it by a normal step as wide as the archive is there. The search runs on ln(Z_model/Z_measured) over
a thinned grid, where the landscape is wide; the best and most different members are handed to the polish.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from motoremi.arrays import FloatArray
from motoremi.fitting.problem import Problem
from motoremi.interrupts import checkpoint

ARCHIVE = 60
ANTS = 60
RANK_WIDTH = 0.15
SPEED = 0.85


def scattered(problem: Problem, rng: np.random.Generator, count: int) -> FloatArray:
    """Solutions drawn from the whole range of each unknown."""
    return problem.low + rng.random((count, len(problem.unknowns))) * (problem.high - problem.low)


@dataclass
class Colony:
    """An archive of solutions that ants improve.

    Parameters
    ----------
    problem : Problem
    rng : numpy Generator
    seeds : ndarray, shape (m, k)
        Solutions worth starting from; may be empty.
    """

    problem: Problem
    rng: np.random.Generator
    seeds: FloatArray

    def __post_init__(self) -> None:
        problem = self.problem
        drawn = scattered(problem, self.rng, 4 * ARCHIVE)
        members = np.concatenate([self.seeds.reshape(-1, drawn.shape[1]), drawn])
        self.cost = problem.objective(members)
        self.evaluations = len(members)
        order = np.argsort(self.cost)[:ARCHIVE]
        self.members, self.cost = members[order], self.cost[order]

    def walk(self, generations: int) -> list[float]:
        """Let the ants go out `generations` times; returns the best mean square after each."""
        problem, rng = self.problem, self.rng
        size = len(problem.unknowns)
        ranks = np.arange(ARCHIVE)
        weight = np.exp(-0.5 * (ranks / (RANK_WIDTH * ARCHIVE)) ** 2)
        weight /= weight.sum()
        curve = []
        for _ in range(generations):
            checkpoint()
            chosen = rng.choice(ARCHIVE, size=ANTS, p=weight)
            origin = self.members[chosen]
            width = SPEED * np.mean(np.abs(self.members[None, :, :] - origin[:, None, :]), axis=1)
            ants = problem.clip(origin + rng.standard_normal((ANTS, size)) * width)
            cost = problem.objective(ants)
            self.evaluations += ANTS
            everyone = np.concatenate([self.members, ants])
            costs = np.concatenate([self.cost, cost])
            order = np.argsort(costs)[:ARCHIVE]
            self.members, self.cost = everyone[order], costs[order]
            curve.append(float(self.cost[0]) / problem.size)
        return curve

    def different(self, count: int) -> FloatArray:
        """The best member and others that are good and far from those already taken, shape (count, k)."""
        span = self.problem.high - self.problem.low
        places = self.members / np.where(span > 0, span, 1.0)
        taken = [0]
        while len(taken) < min(count, len(places)):
            distance = np.min(np.linalg.norm(places[:, None, :] - places[None, taken, :], axis=2), axis=1)
            merit = distance / (1 + np.arange(len(places)) / 20)
            merit[taken] = -1
            taken.append(int(np.argmax(merit)))
        return self.members[taken]
