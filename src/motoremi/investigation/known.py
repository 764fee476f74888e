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

from motoremi.arrays import BoolArray, FloatArray
from motoremi.fitting.problem import Problem
from motoremi.fitting.result import Fit
from motoremi.fitting.search import misses_by_far

# Largest number of steps to a maximum, first damping, and smallest gain of a step.
STEPS, DAMPING, CONVERGED = 25, 1e-3, 1e-2
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
        gained = float(near.pull @ np.linalg.solve(near.precision, near.pull))
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
        outwards = ((u <= self.low) & (gradient > 0)) | ((u >= self.high) & (gradient < 0))
        if outwards.any():
            # What is pushed out of its range stays at the bound: the gradient is one whose step moves the others alone, so that the precision, and
            # with it the integral, is the same as where nothing is pushed.
            free = np.flatnonzero(~outwards)
            step = np.zeros(u.size)
            step[free] = -solved(precision[np.ix_(free, free)], gradient[free])
            gradient = -precision @ step
        away, risen = u - self.centre, self.sweeps.objective(u) - self._at_centre
        return Near(risen - 2 * float(gradient @ away) + float(away @ precision @ away), precision @ away - gradient, precision)

    def after(self, learnt: Learnt, moving: BoolArray) -> Known:
        """It after data; `moving` are the unknowns that were searched, all others were taken for linear."""
        if self.sweeps is None:
            return replace(self, centre=learnt.centre, precision=learnt.precision)
        sweeps = replace(self.sweeps, taught=self.sweeps.taught + learnt.taught, towards=self.sweeps.towards + learnt.towards)
        return replace(self, sweeps=sweeps)._centred_from(learnt.centre if moving.all() else self.centre)

    def _centred_from(self, start: FloatArray) -> Known:
        """The same with its centre at the maximum near a point (Levenberg and Marquardt): what later data teach may move it along a curve."""
        here, damping = replace(self, centre=start), 0.0
        for _ in range(STEPS):
            near = here.near(here.centre)
            step = solved(near.precision + damping * np.diag(np.diag(near.precision)), near.pull)
            there = replace(here, centre=np.clip(here.centre + step, self.low, self.high))
            gained = here._at_centre - there._at_centre
            here, damping = (there, damping / 10) if gained > 0 else (here, max(10 * damping, DAMPING))
            if abs(gained) < CONVERGED:
                break
        return replace(here, precision=here.near(here.centre).precision)

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
