"""Levenberg-Marquardt for a batch of start points at once, with bounds.

Every member of the batch has its own damping; members that have converged leave the batch. Unknowns at a bound that the gradient
pushes outwards are held for that step. Steps follow the curve of the valley by a geodesic correction (Transtrum and Sethna 2012),
which costs one evaluation and saves many where effects and elements trade off along a bent ridge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from motoremi.arrays import BoolArray, FloatArray
from motoremi.fitting.problem import Problem

# A solution has converged when an undamped step promises no more than so many times what a small step may gain.
UNDAMPED = 30.0
# In error bars: what is left to go once a solution is sharpened.
SHARP = 1e-6


@dataclass(frozen=True)
class Polished:
    """Where each start ended.

    Parameters
    ----------
    u : ndarray, shape (batch, k)
    objective : ndarray, shape (batch,)
    converged : ndarray of bool, shape (batch,)
    evaluations : int
        Evaluations of the model in all.
    """

    u: FloatArray
    objective: FloatArray
    converged: BoolArray
    evaluations: int

    @property
    def best(self) -> int:
        """Index of the lowest objective."""
        return int(np.argmin(self.objective))

    def distinct(self, count: int) -> FloatArray:
        """The best solutions that do not lie in the same valley, shape (at most count, k).

        Two are in one valley if their objectives agree to 1 % and no unknown differs by more than a factor of 1.6.
        """
        order = np.argsort(self.objective)
        taken = [int(order[0])]
        for index in order[1:]:
            apart = np.max(np.abs(self.u[taken] - self.u[index]), axis=1) > 0.5
            worse = self.objective[index] > 1.01 * self.objective[taken]
            if len(taken) < count and np.all(apart | worse):
                taken.append(int(index))
        return self.u[taken]

    def joined(self, other: Polished) -> Polished:
        """Both batches as one."""
        return Polished(
            np.concatenate([self.u, other.u]),
            np.concatenate([self.objective, other.objective]),
            np.concatenate([self.converged, other.converged]),
            self.evaluations + other.evaluations,
        )


def polish(
    problem: Problem,
    starts: FloatArray,
    iterations: int = 150,
    tolerance: float = 1e-3,
    relative: float = 1e-5,
    enough: float = -np.inf,
    damping: float = 1e-3,
) -> Polished:
    """Minimise the problem's objective from each start.

    Parameters
    ----------
    starts : ndarray, shape (batch, k)
    tolerance, relative : float
        Converged when a step is expected to gain less than `tolerance + relative * objective`.
    enough : float
        Leave all where they are once one has an objective below this.
    damping : float
        To begin with, relative to the diagonal of the Gauss-Newton matrix.
    """
    u = problem.clip(np.atleast_2d(np.array(starts, dtype=np.float64)))
    count, size = u.shape
    state = problem.linearised(u)
    damped = np.full(count, damping)
    converged = np.zeros(count, dtype=np.bool_)
    evaluations = count
    diagonal = np.arange(size)
    # Whether a step fell short of what the linear model promised: only then is the valley bent.
    bent = np.zeros(count, dtype=np.bool_)
    for _ in range(iterations):
        live = np.flatnonzero(~converged & (damped < 1e12))
        if not live.size or np.any(state.objective < enough):
            break
        here = state if live.size == count else state.subset(live)
        held = ((u[live] <= problem.low) & (here.gradient > 0)) | ((u[live] >= problem.high) & (here.gradient < 0))
        system, right = here.matrix.copy(), np.where(held, 0.0, here.gradient)
        system[held[:, :, None] | held[:, None, :]] = 0.0
        spread: FloatArray = here.matrix[:, diagonal, diagonal]
        system[:, diagonal, diagonal] = np.where(held, 1.0, spread * (1 + damped[live, None]) + 1e-12)
        newton: FloatArray = np.asarray(-np.linalg.solve(system, right[..., None])[..., 0], dtype=np.float64)
        step = _limited(newton)
        if np.any(bent[live]):
            bend = np.where(held, 0.0, problem.curvature_pull(here, u[live], step))
            turn = -0.5 * np.linalg.solve(system, bend[..., None])[..., 0]
            scale = np.sqrt(spread)
            gentle = np.linalg.norm(turn * scale, axis=1) < 0.4 * np.linalg.norm(step * scale, axis=1)
            corrected: FloatArray = np.where(gentle[:, None], step + turn, step)
            step = _limited(corrected)
            evaluations += live.size
        trial = problem.clip(u[live] + step)
        expected = -np.sum(step * (2 * right + (here.matrix @ step[..., None])[..., 0]), axis=1)
        new = problem.linearised(trial)
        evaluations += live.size
        better = new.objective <= here.objective
        bent[live] |= here.objective - new.objective < 0.7 * expected
        small = tolerance + relative * here.objective
        # A small step means convergence only where damping did not make it small: along a shallow valley even a little does.
        free = (damped[live] < 1e-2) | (damped[live] > 1e8)
        still = free & ((np.abs(expected) < small) | (better & (here.objective - new.objective < 0.1 * small)))
        if np.any(still):
            still[still] = (_decrement(here.matrix[still], right[still], held[still]) < UNDAMPED * small[still]) | (damped[live[still]] > 1e8)
        converged[live] = still
        taken = live[better]
        u[taken] = trial[better]
        state.put(taken, new.subset(np.flatnonzero(better)))
        damped[taken] = np.maximum(damped[taken] * 0.15, 1e-9)
        failed = live[~better]
        damped[failed] = np.maximum(damped[failed] * 6, 1e-6)
    return Polished(u, state.objective, converged, evaluations)


def sharpened(problem: Problem, solution: FloatArray, most: int = 6) -> tuple[FloatArray, int]:
    """Gauss-Newton on from where a polish ended, until what is left to go is a millionth of the error bars.

    The length of a step in error bars, sqrt(g' M^-1 g), bounds its share of each parameter's own. Near the minimum each step is a fixed
    share of the one before, usually about a hundredth, so two tell when to stop.

    Returns
    -------
    u : ndarray, shape (k,)
    evaluations : int
    """
    u, best, rate = solution, solution, 1.0
    objective = previous = np.inf
    for evaluations in range(1, most + 1):
        here = problem.linearised(u)
        if here.objective > objective * (1 + 1e-12):  # beyond rounding
            return best, evaluations
        held = ((u <= problem.low) & (here.gradient > 0)) | ((u >= problem.high) & (here.gradient < 0))
        scale = np.sqrt(np.diag(here.matrix)) + 1e-150
        system = here.matrix / np.outer(scale, scale)
        system[held[:, None] | held[None, :]] = 0.0
        system[np.diag_indices_from(system)] = 1.0 + 1e-13
        right = np.where(held, 0.0, here.gradient / scale)
        scaled = np.linalg.solve(system, right)
        length = float(np.sqrt(max(right @ scaled, 0.0)))
        if length >= previous:
            return u, evaluations
        if np.isfinite(previous):
            rate = length / previous
        best, objective, previous = u, float(here.objective), length
        u = problem.clip(u - scaled / scale)
        if length * rate < SHARP:
            break
    return u, evaluations


def _decrement(matrix: FloatArray, right: FloatArray, held: BoolArray) -> FloatArray:
    """What an undamped step would gain by the linear model, shape (batch,)."""
    system = matrix.copy()
    system[held[:, :, None] | held[:, None, :]] = 0.0
    diagonal = np.arange(matrix.shape[1])
    system[:, diagonal, diagonal] = np.where(held, 1.0, system[:, diagonal, diagonal] * (1 + 1e-12) + 1e-12)
    gain: FloatArray = np.sum(right * np.linalg.solve(system, right[..., None])[..., 0], axis=1)
    return gain


def _limited(step: FloatArray) -> FloatArray:
    """Steps of at most e^2 in a parameter: beyond, the linear model means nothing."""
    limited: FloatArray = step * np.minimum(1.0, 2.0 / np.maximum(np.max(np.abs(step), axis=1), 1e-300))[:, None]
    return limited
