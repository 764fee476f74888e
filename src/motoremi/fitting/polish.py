"""Levenberg-Marquardt for a batch of start points at once, with bounds.

Every member of the batch has its own damping; members that have converged leave the batch. Unknowns at a bound that the gradient
pushes outwards are held for that step. Steps follow a curved minimum by a geodesic correction (Transtrum and Sethna 2012), which costs
one evaluation and saves many if effects and elements are correlated. A step that increases the objective is not rejected at once: if the
slopes at its end predict an objective below that of its start, a second step follows them (a watchdog of one step, Chamberlain et al. 1982).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from motoremi.arrays import BoolArray, FloatArray
from motoremi.fitting.problem import Linearised, Problem
from motoremi.interrupts import checkpoint

# A solution has converged when an undamped step promises no more than so many times what a small step may gain.
UNDAMPED = 30.0
# In error bars: largest remaining step of a sharpened solution.
SHARP = 1e-6
# In error bars: a remaining step that is shorter changes the objective by less than a hundredth. Steps of a fine polish where it is longer.
STRAIGHT, CURVED_STEPS = 0.1, 200
# A step that gains less than this share of what the linear model promises is followed by corrected ones; and the largest correction, squared, as a
# share of the step (Transtrum and Sethna 2012).
PROMISED, GENTLE = 0.7, 0.16
# Least damping of a step back to a narrow minimum: it should not lead along the minimum.
BACK_DAMPING = 1e-5


class Precision(NamedTuple):
    """A solution has converged when a step is expected to gain less than `tolerance + relative * objective`."""

    tolerance: float
    relative: float


FINE = Precision(1e-3, 1e-5)


@dataclass(frozen=True)
class Polished:
    """The end point of each start.

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
        """The best solutions that are not the same local minimum, shape (at most count, k)."""
        return self.u[different(self.u, self.objective, count)]

    def joined(self, other: Polished) -> Polished:
        """Both batches as one."""
        return Polished(
            np.concatenate([self.u, other.u]),
            np.concatenate([self.objective, other.objective]),
            np.concatenate([self.converged, other.converged]),
            self.evaluations + other.evaluations,
        )


def different(u: FloatArray, objective: FloatArray, count: int) -> list[int]:
    """Indices of the best solutions that are not the same local minimum.

    Two are the same local minimum if their objectives agree to 1 % and no unknown differs by more than a factor of 1.6.
    """
    order = np.argsort(objective)
    taken = [int(order[0])]
    for index in order[1:]:
        if len(taken) >= count:
            break
        apart = np.max(np.abs(u[taken] - u[index]), axis=1) > 0.5
        worse = objective[index] > 1.01 * objective[taken]
        if np.all(apart | worse):
            taken.append(int(index))
    return taken


def polish(
    problem: Problem,
    starts: FloatArray,
    iterations: int = 150,
    precision: Precision = FINE,
    enough: float = -np.inf,
    damping: float = 1e-3,
    bending: bool = True,
) -> Polished:
    """Minimise the problem's objective from each start.

    Parameters
    ----------
    starts : ndarray, shape (batch, k)
    precision : Precision
        When a solution has converged.
    enough : float
        Leave all where they are once one has an objective below this.
    damping : float
        To begin with, relative to the diagonal of the Gauss-Newton matrix.
    bending : bool
        Use the geodesic correction. It saves steps near the end, fewer in a fixed number of first steps.
    """
    u = problem.clip(np.atleast_2d(np.array(starts, dtype=np.float64)))
    count = len(u)
    ends = Polished(u.copy(), np.empty(count), np.zeros(count, dtype=np.bool_), count)
    evaluations = count
    # Of those that are still on their way: their places among all, and their state.
    live = np.arange(count)
    here = problem.linearised(u)
    damped = np.full(count, damping)
    # Whether a step gained less than the linear model predicted: only then the correction is needed.
    bent = np.zeros(count, dtype=np.bool_)
    for to_come in range(iterations - 1, -1, -1):
        if not live.size or (here.objective < enough).any():
            break
        checkpoint()
        newton = _newton(problem, u, here, damped)
        step, right = newton.step, newton.right
        if bending and bent.any():
            bend = np.where(newton.held, 0.0, problem.curvature_pull(here, u, step))
            turn = -0.5 * np.linalg.solve(newton.system, bend[..., None])[..., 0]
            spread = _diagonal(here.matrix)
            gentle = np.einsum("ij,ij->i", turn**2, spread) < GENTLE * np.einsum("ij,ij->i", step**2, spread)
            corrected: FloatArray = np.where(gentle[:, None], step + turn, step)
            step = _limited(corrected)
            evaluations += live.size
        trial = problem.clip(u + step)
        expected = _expected(here, right, step)
        evaluations += live.size
        if not to_come:  # its slopes are not needed
            reached = problem.objective(trial)
            better = reached <= here.objective
            u, here.objective = np.where(better[:, None], trial, u), np.where(better, reached, here.objective)
            break
        new = problem.linearised(trial)
        if bending:
            evaluations += watchdog_step(problem, trial, new, here.objective, damped)
        gained = here.objective - new.objective
        better = gained >= 0
        bent |= gained < PROMISED * expected
        small = precision.tolerance + precision.relative * here.objective
        # A small step means convergence only if damping did not make it small: along a shallow minimum even a little damping does.
        free = (damped < 1e-2) | (damped > 1e8)
        still = free & ((np.abs(expected) < small) | (better & (gained < 0.1 * small)))
        if still.any():
            still[still] = (_decrement(here.matrix[still], right[still], newton.held[still]) < UNDAMPED * small[still]) | (damped[still] > 1e8)
        u = np.where(better[:, None], trial, u)
        # Copy those that are fewer.
        if 2 * np.count_nonzero(better) < live.size:
            here.put(better, new)
        else:
            new.put(~better, here)
            here = new
        damped = np.where(better, np.maximum(damped * 0.15, 1e-9), np.maximum(damped * 6, 1e-6))
        leaving = still | (damped >= 1e12)
        if leaving.any():
            ends.converged[live[still]] = True
            ends.u[live], ends.objective[live] = u, here.objective
            if (here.objective < enough).any():
                break
            stay = ~leaving
            live, u, here, damped, bent = live[stay], u[stay], here.subset(stay), damped[stay], bent[stay]
    ends.u[live], ends.objective[live] = u, here.objective
    return dataclasses.replace(ends, evaluations=evaluations)


class _Newton(NamedTuple):
    """A damped Gauss-Newton step for a batch, with what it was solved from."""

    step: FloatArray
    right: FloatArray
    held: BoolArray
    system: FloatArray


def _held(problem: Problem, u: FloatArray, here: Linearised) -> BoolArray:
    """Unknowns at a bound that the gradient pushes outwards."""
    return ((u <= problem.low) & (here.gradient > 0)) | ((u >= problem.high) & (here.gradient < 0))


def _newton(problem: Problem, u: FloatArray, here: Linearised, damped: FloatArray) -> _Newton:
    held = _held(problem, u, here)
    right = np.where(held, 0.0, here.gradient)
    system = _free_part(here.matrix, held)
    _diagonal(system)[...] = np.where(held, 1.0, _diagonal(here.matrix) * (1 + damped[:, None]) + 1e-12)
    return _Newton(_limited(np.asarray(-np.linalg.solve(system, right[..., None])[..., 0])), right, held, system)


def _expected(here: Linearised, right: FloatArray, step: FloatArray) -> FloatArray:
    """What a step gains by the linear model, shape (batch,)."""
    return -np.einsum("ij,ij->i", step, 2 * right + (here.matrix @ step[..., None])[..., 0])


def promised(problem: Problem, u: FloatArray) -> FloatArray:
    """The objective that an undamped step from each start would reach by the linear model, shape (batch,)."""
    here = problem.linearised(u)
    held = _held(problem, u, here)
    return here.objective - _decrement(here.matrix, np.where(held, 0.0, here.gradient), held)


def watchdog_step(problem: Problem, trial: FloatArray, new: Linearised, before: FloatArray, damped: FloatArray) -> int:
    """Make a second step, in place, from trials that raised the objective, if it predicts a value below `before`; returns their number."""
    uphill = np.flatnonzero(new.objective > before)
    if not uphill.size:
        return 0
    there = new.subset(uphill)
    back = _newton(problem, trial[uphill], there, np.maximum(damped[uphill], BACK_DAMPING))
    hopeful = there.objective - _expected(there, back.right, back.step) < before[uphill]
    chosen = uphill[hopeful]
    if chosen.size:
        trial[chosen] = problem.clip(trial[chosen] + back.step[hopeful])
        new.take(chosen, problem.linearised(trial[chosen]))
    return int(chosen.size)


def sharpened(problem: Problem, solution: FloatArray, most: int = 6) -> tuple[FloatArray, int]:
    """From the end of a polish by Gauss-Newton steps, until the remaining step is a millionth of the error bars.

    Along a curved minimum such steps lead nowhere, and a polish stops where it is shallow: of a rotor cage whose corner lies below the band, a
    solution that had converged for a search was above its minimum by 28 in the objective. There a fine polish goes before further steps.

    Returns
    -------
    u : ndarray, shape (k,)
    evaluations : int
    """
    u, evaluations, left = _gauss_newton(problem, solution, most)
    if left < STRAIGHT:
        return u, evaluations
    ends = polish(problem, u, iterations=CURVED_STEPS, precision=FINE, damping=BACK_DAMPING)
    u, further, _ = _gauss_newton(problem, ends.u[0], most)
    return u, evaluations + ends.evaluations + further


def _gauss_newton(problem: Problem, solution: FloatArray, most: int) -> tuple[FloatArray, int, float]:
    """The solution, the number of evaluations, and the length of the next step in error bars.

    That length, sqrt(g' M^-1 g), bounds its share of each parameter's own. Near the minimum each step is a fixed share of the one before, usually
    about a hundredth, so two tell when to stop.
    """
    u, best, rate = solution, solution, 1.0
    objective = previous = np.inf
    for evaluations in range(1, most + 1):
        here = problem.linearised(u)
        if here.objective > objective * (1 + 1e-12):  # beyond rounding
            return best, evaluations, previous
        held = _held(problem, u, here)
        scale = np.sqrt(np.diag(here.matrix)) + 1e-150
        system = here.matrix / np.outer(scale, scale)
        system[held[:, None] | held[None, :]] = 0.0
        system[np.diag_indices_from(system)] = 1.0 + 1e-13
        right = np.where(held, 0.0, here.gradient / scale)
        scaled = np.linalg.solve(system, right)
        length = float(np.sqrt(max(right @ scaled, 0.0)))
        if length >= previous:
            return u, evaluations, length
        if np.isfinite(previous):
            rate = length / previous
        best, objective, previous = u, float(here.objective), length
        u = problem.clip(u - scaled / scale)
        if length * rate < SHARP:
            break
    return u, evaluations, previous * rate


def _decrement(matrix: FloatArray, right: FloatArray, held: BoolArray) -> FloatArray:
    """What an undamped step would gain by the linear model, shape (batch,)."""
    system = _free_part(matrix, held)
    diagonal = _diagonal(system)
    diagonal[...] = np.where(held, 1.0, diagonal * (1 + 1e-12) + 1e-12)
    return np.sum(right * np.linalg.solve(system, right[..., None])[..., 0], axis=1)


def _limited(step: FloatArray) -> FloatArray:
    """Steps of at most e^2 in a parameter: beyond, the linear model means nothing."""
    return step * np.minimum(1.0, 2.0 / np.maximum(np.abs(step).max(axis=1), 1e-300))[:, None]


def _free_part(matrix: FloatArray, held: BoolArray) -> FloatArray:
    """A copy without the rows and columns of unknowns that are held."""
    system = matrix.copy()
    if held.any():
        system[held[:, :, None] | held[:, None, :]] = 0.0
    return system


def _diagonal(matrix: FloatArray) -> FloatArray:
    """A view of the diagonals of a batch, shape (batch, k)."""
    return np.einsum("...ii->...i", matrix)
