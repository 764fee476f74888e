"""The evidence of a model of which the data hardly determine one parameter: searched and integrated along it.

Laplace's method (`marginal`) takes the likelihood for a Gaussian round one solution. Where a band shows little but a product of two parameters,
such as share and corner of a loop whose corner lies below it, the likely values form a long curved valley, which may have several local minima
that few points do not tell apart. With a rotor cage (corner 1.5 to 2 kHz, band from 150 kHz) the log evidence at the minimum that a search had
reached was too low by 9, and Laplace's method at the right one by 1.
"""

from __future__ import annotations

import numpy as np
from scipy.special import logsumexp

from motoremi.arrays import FloatArray
from motoremi.fitting.identify import following
from motoremi.fitting.known import Known, also_from
from motoremi.fitting.polish import FINE, polish, promised
from motoremi.fitting.problem import Problem
from motoremi.fitting.result import Fit
from motoremi.fitting.search import ARRIVAL_POINTS, AS_PROBABLE, CLOSE, misses_by_far
from motoremi.model.motor import BASE_PARAMETERS
from motoremi.threads import one_blas_thread

# Standard deviation of a parameter's logarithm: below the first, the likelihood is as good as Gaussian. Above the second, as a share of the
# deviation that its range allows, the data say nothing of it, and the prior alone is integrated exactly.
KNOWN, OPEN = 0.05, 0.8
# Values of the parameter: so many over its range, and round the solution in standard deviations.
VALUES, ROUND_IT = 20, (-4.5, -3.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 3.0, 4.5)
# Steps to the solution at each value, and from a neighbour's to a lower one; twice through all values, so that a solution is passed on; and steps
# on all points in the end.
STEPS, PASSES, LAST_STEPS = 20, 2, 40
# Values whose solution is less probable than the best by more than this factor (logarithm) add nothing.
NOTHING = 15.0
# Objectives that differ by less are of one solution.
SAME = 1.0


@one_blas_thread
def integrated(job: tuple[Fit, float]) -> tuple[Fit, float]:
    """A fit, or a better one of the same model along the least known parameter of its effects; and what integration along that parameter adds to
    the log evidence by Laplace's method.

    Nothing is added for a model without effects, with effects whose parameters are known, or with an error of per cents. The sizes of the
    discrepancy and of the analyser's errors are those of the fit.

    Parameters
    ----------
    job : tuple of Fit and float
        The fit, and by how much its log score is below that of the best model: of a model far behind only a better solution matters, so it is
        left as it is if few points show none.
    """
    fit, behind = job
    better, gained = _along_the_least_known(fit, behind)
    return (fit, gained) if better is fit else (better, _along_the_least_known(better, 0.0)[1])


def _along_the_least_known(fit: Fit, behind: float) -> tuple[Fit, float]:
    """As `integrated`; what is added is that of the given fit."""
    index = _least_known(fit)
    if index is None:
        return fit, 0.0
    along = _Along(fit, index)
    if behind > AS_PROBABLE and not along.shows_a_better_one:
        return fit, 0.0
    problem, here = fit.weighed, fit.linearised
    solutions = along.on_all_points()
    values = solutions[:, index]
    there = problem.linearised(solutions)
    best = int(np.argmin(there.objective))
    if fit.objective - there.objective[best] > SAME:
        return also_from(fit, [Known(problem.named(solutions[best]))]), 0.0
    if there.objective[best] - fit.objective > SAME:
        # The fit is not the likelihood's own solution (`better_than`), or it was not found again.
        return fit, 0.0
    densities = -0.5 * there.objective - 0.5 * _log_determinant(problem, np.delete(np.delete(there.matrix, index, 1), index, 2), index)
    gaps = np.diff(values)
    widths = 0.5 * (np.append(gaps, 0.0) + np.insert(gaps, 0, 0.0))
    laplace = -0.5 * fit.objective - 0.5 * float(_log_determinant(problem, here.matrix)) + 0.5 * np.log(2 * np.pi)
    gained = float(logsumexp(densities, b=widths) - laplace)
    return fit, gained if np.isfinite(gained) else 0.0


def _least_known(fit: Fit) -> int | None:
    """The parameter of an added law with the largest standard deviation, among those that are neither known nor open; its index.

    None also for a fit with an error of per cents, or one that has not converged.
    """
    if misses_by_far(fit.sizes) or not fit.converged:
        return None
    problem = fit.weighed
    deviations = np.sqrt(np.diag(fit.covariance))
    open_ones = OPEN * 0.5 * (problem.high - problem.low)
    of_laws = [i for i, p in enumerate(problem.unknowns) if p not in BASE_PARAMETERS and problem.own[i] and p.scale == "log"]
    return max((i for i in of_laws if KNOWN < deviations[i] < open_ones[i]), key=lambda i: deviations[i], default=None)


def valley(fit: Fit) -> FloatArray:
    """Solutions along the least known parameter of a fit's effects, shape (m, k); none if there is no such parameter.

    They are likely start values where other data are to be described as well.
    """
    index = _least_known(fit)
    return np.empty((0, fit.unknowns.size)) if index is None else _Along(fit, index).on_all_points()


class _Along:
    """The solutions at several values of one unknown, first on few points.

    Attributes
    ----------
    shows_a_better_one : bool
        Whether few points show a solution with a lower objective than that of the fit.
    """

    def __init__(self, fit: Fit, index: int) -> None:
        problem, solution = fit.weighed, fit.unknowns
        low, high = float(problem.low[index]), float(problem.high[index])
        # Of the likelihood alone; the prior limits it where the data determine next to nothing.
        deviation = float(np.sqrt(fit.covariance[index, index]))
        values = np.unique(np.clip([*np.linspace(low, high, VALUES), *(solution[index] + deviation * np.array(ROUND_IT))], low, high))
        start = problem.clip(solution + following(fit.linearised.matrix, index) * (values - solution[index])[:, None])
        start[:, index] = values
        self._task, self._sizes = fit.task.sweeping(problem.unknowns[index].name), fit.sizes
        self._index, self._start = index, start
        self._coarse = self._task.likelihood(ARRIVAL_POINTS, fit.sizes)
        ends = polish(self._coarse, start, iterations=STEPS, precision=CLOSE)
        own = float(ends.objective[int(np.argmin(np.abs(values - solution[index])))])
        self._found, self._objective = ends.u, ends.objective
        for _ in range(PASSES):
            self._pass_on(1)
            self._pass_on(-1)
        self.shows_a_better_one = bool(self._objective.min() < own - SAME)

    def _pass_on(self, step: int) -> None:
        """Solve at each value from the solution at its neighbour, the last or the next one; what is better is kept."""
        here, neighbour = (slice(1, None), slice(None, -1)) if step > 0 else (slice(None, -1), slice(1, None))
        from_neighbour = self._found[neighbour].copy()
        from_neighbour[:, self._index] = self._start[here, self._index]
        found, objective = self._found[here], self._objective[here]
        # Most neighbours lead to the solution that is known already.
        other = np.flatnonzero(promised(self._coarse, from_neighbour) < objective - SAME)
        if not other.size:
            return
        ends = polish(self._coarse, from_neighbour[other], iterations=STEPS, precision=CLOSE)
        better = ends.objective < objective[other]
        found[other[better]], objective[other[better]] = ends.u[better], ends.objective[better]

    def on_all_points(self) -> FloatArray:
        """The solutions, shape (m, k): the likely ones solved on all points, the others as few points have them."""
        found = self._found.copy()
        likely = np.flatnonzero(self._objective < self._objective.min() + 2 * NOTHING)
        # Also from the given start values: on few points another local minimum may be the lowest.
        starts = np.concatenate([found[likely], self._start[likely]])
        ends = polish(self._task.likelihood(None, self._sizes), starts, iterations=LAST_STEPS, precision=FINE)
        again = ends.objective[likely.size :] < ends.objective[: likely.size]
        found[likely] = np.where(again[:, None], ends.u[likely.size :], ends.u[: likely.size])
        return found


def _log_determinant(problem: Problem, matrix: FloatArray, without: int | None = None) -> FloatArray:
    """Of a Gauss-Newton matrix, shape (..., k, k), with flat priors as in `marginal`; without one unknown if its row and column were taken out."""
    own = problem.flat_precision if without is None else np.delete(problem.flat_precision, without)
    diagonal = np.einsum("...ii->...i", matrix) + own
    scale = np.sqrt(np.maximum(diagonal, 1e-300))
    scaled = (matrix + own * np.eye(own.size)) / (scale[..., :, None] * scale[..., None, :]) + 1e-12 * np.eye(own.size)
    return np.asarray(np.linalg.slogdet(scaled)[1] + 2 * np.sum(np.log(scale), axis=-1))
