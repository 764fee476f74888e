"""The ant colony as printed by Liu, Wang and Nan (2011), section 3.

What the paper fixes: m = 7 parameters of N = 30 candidate values each, M = 150 ants, choice by eq. (3), pheromone by eq. (4) with
rho = 0.7 (what persists), Q = 700, tau(0) = 3, at most NcMAX = 1000 loops, stop at deviation E <= 0.1.

What it leaves open, and our reading: candidates are spaced evenly in the logarithm over each parameter's bounds (an even spacing in the
value would put nearly all of them in the top decade); the deviation of an ant is the mean of |Z_model - Z_measured| / |Z_measured| over
all points of both sweeps; every ant lays Q / deviation on each value that it chose (no elitism); the answer is the best ant ever seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from motoremi.arrays import FloatArray, JsonDict
from motoremi.fitting.problem import Problem

CANDIDATES = 30
ANTS = 150
PERSISTENCE = 0.7
DEPOSIT = 700.0
LOOPS = 1000
STOP_DEVIATION = 0.1
FIRST_PHEROMONE = 3.0


@dataclass(frozen=True)
class PaperOutcome:
    """Best ant, its deviation, whether the stop rule was met, and the training curve (the paper's Fig. 6)."""

    u: FloatArray
    deviation: float
    converged: bool
    evaluations: int
    history: tuple[JsonDict, ...]


def paper_colony(problem: Problem, rng: np.random.Generator, loops: int = LOOPS) -> PaperOutcome:
    """Run the printed algorithm.

    Parameters
    ----------
    problem : Problem
        Its bounds give the candidate grid, its points the deviation.
    """
    size = len(problem.unknowns)
    grid = np.linspace(problem.low, problem.high, CANDIDATES, axis=1)
    pheromone = np.full((size, CANDIDATES), FIRST_PHEROMONE)
    columns = np.arange(size)
    best, best_deviation = grid[:, CANDIDATES // 2], np.inf
    history: list[JsonDict] = []
    evaluations = 0
    for loop in range(loops):
        # Eq. (3): value j of parameter i with probability tau_ij / sum_g tau_ig.
        edges = np.cumsum(pheromone / pheromone.sum(axis=1, keepdims=True), axis=1)
        draws = rng.random((ANTS, size))
        choice = np.minimum((draws[:, :, None] > edges[None]).sum(axis=2), CANDIDATES - 1)
        ants = grid[columns, choice]
        deviation = np.mean(np.abs(np.exp(-problem.deviation(ants)) - 1), axis=1)
        evaluations += ANTS
        winner = int(np.argmin(deviation))
        if deviation[winner] < best_deviation:
            best, best_deviation = ants[winner], float(deviation[winner])
        history.append({"evaluations": evaluations, "loop": loop + 1, "rms_deviation_percent": 100 * best_deviation})
        if best_deviation <= STOP_DEVIATION:
            break
        # Eq. (4): tau <- rho tau + sum of Q / deviation over the ants that chose the value.
        pheromone *= PERSISTENCE
        for column in columns:
            pheromone[column] += np.bincount(choice[:, column], weights=DEPOSIT / deviation, minlength=CANDIDATES)
    return PaperOutcome(best, best_deviation, best_deviation <= STOP_DEVIATION, evaluations, tuple(history))
