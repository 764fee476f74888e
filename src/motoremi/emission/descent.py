"""Levenberg-Marquardt with bounds, for residuals whose derivatives take much longer to compute than the residuals themselves.

An unknown at a bound is held for a step if the gradient points out of its range, and a step that would leave the range ends at the bound. The
derivatives are computed at accepted points only. scipy's `least_squares` with bounds is not used because it approaches a bound in many small
steps, and most models of a search have a solution at a bound: the size of an effect that is not present goes to its bound.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from motoremi.arrays import FloatArray

# Converged when both the actual and the predicted decrease of the cost in a step are below this share of the cost, which is
# some hundred log units.
_LEAST_GAIN = 1e-4
# Damping relative to the diagonal of the Gauss-Newton matrix: at the start, the smallest, and the largest, with which no step lowers the cost.
_FIRST, _LEAST, _MOST = 1e-2, 1e-7, 1e8


class Lowest(NamedTuple):
    """Result of a descent.

    Parameters
    ----------
    x : ndarray, shape (k,)
    cost : float
        Half the sum of the squared residuals.
    """

    x: FloatArray
    cost: float


def descend(
    residuals: Callable[[FloatArray], FloatArray],
    slopes: Callable[[FloatArray], FloatArray],
    start: FloatArray,
    low: FloatArray,
    high: FloatArray,
    steps: int,
) -> Lowest:
    """The local minimum below a start, or the point reached after `steps`.

    Parameters
    ----------
    residuals, slopes : callable
        Of the unknowns, shape (k,): residuals, shape (n,), and their derivatives, shape (n, k).
    start, low, high : ndarray, shape (k,)
    steps : int
        Largest number of evaluations of the slopes.
    """
    x, left = start, residuals(start)
    cost, damping = 0.5 * float(left @ left), _FIRST
    for _ in range(steps):
        jacobian = slopes(x)
        gradient, matrix = jacobian.T @ left, jacobian.T @ jacobian
        held = ((x <= low) & (gradient > 0)) | ((x >= high) & (gradient < 0))
        worse = 2.0
        while True:
            trial = np.clip(x + _step(gradient, matrix, held, damping), low, high)
            step = trial - x
            predicted = -float(gradient @ step + 0.5 * step @ matrix @ step)
            left_there = residuals(trial)
            gained = cost - 0.5 * float(left_there @ left_there)
            if gained > 0 and predicted > 0:
                break
            damping, worse = damping * worse, 2 * worse
            if damping > _MOST:
                return Lowest(x, cost)
        x, left, cost = trial, left_there, cost - gained
        # Nielsen's rule: the damping depends on how well the linear model predicted the decrease.
        damping = max(damping * max(0.1, 1 - (2 * gained / predicted - 1) ** 3), _LEAST)
        if max(gained, predicted) < _LEAST_GAIN * cost:
            break
    return Lowest(x, cost)


def _step(gradient: FloatArray, matrix: FloatArray, held: np.ndarray, damping: float) -> FloatArray:
    free = ~held
    system = matrix[np.ix_(free, free)]
    index = np.arange(len(system))
    system[index, index] = system[index, index] * (1 + damping) + 1e-12
    step = np.zeros_like(gradient)
    step[free] = -np.linalg.solve(system, gradient[free])
    return step
