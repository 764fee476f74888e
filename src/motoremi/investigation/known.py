"""What is known of a model's unknowns: the likelihood of the sweeps that it was fitted to, and what later data taught.

A direction that the sweeps leave open has its range. For data that move the unknowns far (another span or circuit, a single value) the likelihood
itself counts, otherwise the normal distribution round the fit that is like it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotrs

from motoremi.arrays import FloatArray
from motoremi.fitting.problem import Problem
from motoremi.fitting.result import Fit
from motoremi.fitting.search import misses_by_far

# Added to the diagonal of a scaled matrix: the arithmetic of nearly singular matrices.
NEARLY_SINGULAR = 1e-13


class Near(NamedTuple):
    """Minus twice a log density round a point, less that at the centre: `squares` - 2 `pull`.d + d.`precision`.d, with d from the centre."""

    squares: float
    pull: FloatArray
    precision: FloatArray


@dataclass(frozen=True, eq=False)
class Sweeps:
    """The likelihood of the sweeps that a model was fitted to, and what later data taught beside it.

    Parameters
    ----------
    likelihood : Problem
    taught, towards : ndarray, shapes (k, k), (k,)
        Of what later data taught minus twice the log is u.taught.u - 2 towards.u.
    fit : Fit
        Has other likely values to start from.
    """

    likelihood: Problem
    taught: FloatArray
    towards: FloatArray
    fit: Fit

    def after(self, learnt: Learnt) -> Sweeps:
        """The same with what data taught."""
        return replace(self, taught=self.taught + learnt.taught, towards=self.towards + learnt.towards)

    def objective(self, u: FloatArray) -> float:
        """Minus twice the log density, up to a constant."""
        return float(self.likelihood.objective(u[None])[0] + u @ self.taught @ u - 2 * self.towards @ u)


class Learnt(NamedTuple):
    """What data taught: the centre and precision of a model's unknowns afterwards, and of that the data's own part as in `Sweeps`."""

    centre: FloatArray
    precision: FloatArray
    taught: FloatArray
    towards: FloatArray


@dataclass(frozen=True, eq=False)
class Known:
    """The distribution of a model's unknowns within bounds.

    Parameters
    ----------
    centre : ndarray, shape (k,)
    precision : ndarray, shape (k, k)
        At the centre; positive definite.
    low, high : ndarray, shape (k,)
    sweeps : Sweeps, optional
        What it is the distribution of; without it, it is normal.
    """

    centre: FloatArray
    precision: FloatArray
    low: FloatArray
    high: FloatArray
    sweeps: Sweeps | None = None

    @classmethod
    def of(cls, fit: Fit) -> Known:
        """From a fit: directions that its sweeps leave open have a prior as wide as their range."""
        problem, k = fit.problem, fit.unknowns.size
        # Where a circuit errs by per cents its solution is the one of the least error, not of the likelihood.
        normal = misses_by_far(fit.sizes) or not fit.converged
        sweeps = None if normal else Sweeps(fit.weighed, np.zeros((k, k)), np.zeros(k), fit)
        return cls(fit.unknowns, _widened(problem, fit.linearised.matrix), problem.low, problem.high, sweeps)

    @cached_property
    def log_integral(self) -> float:
        """Of the density relative to that at the centre, by Laplace's method, without powers of 2 pi."""
        near = self.near(self.centre)
        least = within(near.precision, near.pull, self.low - self.centre, self.high - self.centre)
        gained = float(2 * near.pull @ least - least @ near.precision @ least)
        return 0.5 * gained - 0.5 * float(np.linalg.slogdet(near.precision)[1])

    @cached_property
    def normal(self) -> Known:
        """The normal distribution that is like it at the centre."""
        return replace(self, sweeps=None)

    def near(self, u: FloatArray) -> Near:
        """It round a point, to second order."""
        if self.sweeps is None:
            return Near(0.0, np.zeros(u.size), self.precision)
        here = self.sweeps.likelihood.linearised(u)
        gradient = here.gradient + self.sweeps.taught @ u - self.sweeps.towards
        precision = _widened(self.sweeps.likelihood, here.matrix) + self.sweeps.taught
        away, risen = u - self.centre, self.sweeps.objective(u) - self._at_centre
        return Near(risen - 2 * float(gradient @ away) + float(away @ precision @ away), precision @ away - gradient, precision)

    def bend(self, u: FloatArray, step: FloatArray) -> FloatArray:
        """Slopes times the second derivative, along a step, of what its squares are summed of, shape (k,); 0 for a normal distribution."""
        if self.sweeps is None:
            return np.zeros(u.size)
        likelihood = self.sweeps.likelihood
        return likelihood.curvature_pull(likelihood.linearised(u), u, step)

    @cached_property
    def _at_centre(self) -> float:
        return 0.0 if self.sweeps is None else self.sweeps.objective(self.centre)


def _widened(problem: Problem, matrix: FloatArray) -> FloatArray:
    """A precision with priors as wide as the range of what the sweeps leave open."""
    precision = matrix + np.diag(problem.flat_precision)
    # As the evidence of a fit does it: the arithmetic of nearly singular matrices.
    return precision + 1e-12 * np.diag(np.diag(precision))


def solved(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solution of a positive definite system."""
    scale = 1 / np.sqrt(np.diag(matrix))
    factor, failed = dpotrf(matrix * scale * scale[:, None] + NEARLY_SINGULAR * np.eye(len(scale)), lower=1)
    if failed:
        raise np.linalg.LinAlgError("the matrix of the normal equations is not positive definite")
    solution: FloatArray = scale * dpotrs(factor, scale * right, lower=1)[0]
    return solution


def within(matrix: FloatArray, right: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """The minimum of x.matrix.x - 2 right.x between bounds: what is pushed out of its range stays at the bound, and the others follow."""
    x = solved(matrix, right) if right.size else right
    held = np.zeros(x.size, dtype=np.bool_)
    while (out := ((x < low) | (x > high)) & ~held).any():
        held |= out
        free = ~held
        x = np.clip(x, low, high)
        x[free] = solved(matrix[np.ix_(free, free)], right[free] - matrix[np.ix_(free, held)] @ x[held])
    return x
