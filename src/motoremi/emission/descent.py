"""Levenberg-Marquardt in a box, for residuals whose slopes cost much more than themselves.

Unknowns at a bound that the gradient pushes outwards are held for that step, and a step that would leave the box ends at its face. The slopes are
worked out at accepted points only. It replaces scipy's `least_squares` with bounds, which approaches a bound in many small steps: the size of an
effect that is not there ends at its bound, so that is what most models of a search do.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from motoremi.arrays import FloatArray

# A minimum is reached when a step gains, and was promised, less than this share of the cost (of some hundred log units).
_LEAST_GAIN = 1e-4
# Damping relative to the diagonal of the Gauss-Newton matrix: at the start, the least, and the one beyond which no step leads downhill.
_FIRST, _LEAST, _MOST = 1e-2, 1e-7, 1e8


class Lowest(NamedTuple):
    """Where a descent ended.

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
        Most evaluations of the slopes.
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
            promised = -float(gradient @ step + 0.5 * step @ matrix @ step)
            left_there = residuals(trial)
            gained = cost - 0.5 * float(left_there @ left_there)
            if gained > 0 and promised > 0:
                break
            damping, worse = damping * worse, 2 * worse
            if damping > _MOST:
                return Lowest(x, cost)
        x, left, cost = trial, left_there, cost - gained
        # Nielsen's rule: the damping follows how well the linear model foretold the gain.
        damping = max(damping * max(0.1, 1 - (2 * gained / promised - 1) ** 3), _LEAST)
        if max(gained, promised) < _LEAST_GAIN * cost:
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
