"""Likelihood of new data under a model fitted to the earlier sweeps, by Laplace's method around the most likely unknowns.

Unknown are the model's parameters, as the likelihood of the sweeps at hand has them: for data that move them far (another span or circuit, a
single value) that likelihood itself, otherwise the normal distribution round the fit that is like it (a direction that they leave open has its
range); the response numbers; the analyser's errors; and what no model describes of the change, whose size is summed over.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import NamedTuple, Protocol, TypeAlias
from weakref import WeakKeyDictionary

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotrs
from scipy.special import logsumexp

from motoremi.arrays import BoolArray, FloatArray, IntArray
from motoremi.fitting.integrated import valley
from motoremi.fitting.polish import BACK_DAMPING, UNDAMPED
from motoremi.fitting.problem import Problem
from motoremi.fitting.result import Fit
from motoremi.fitting.search import PLAIN, misses_by_far

# Relative size of what no model describes of a change -> prior. The least is what a motor repeats to. An assumption; unconfirmed.
UNDESCRIBED = {5e-4: 0.45, 2e-3: 0.3, 8e-3: 0.17, 3e-2: 0.08}
# The same in a circuit or over a span in which the model was not fitted.
UNDESCRIBED_ELSEWHERE = {5e-4: 0.2, 2e-3: 0.22, 8e-3: 0.22, 3e-2: 0.2, 0.1: 0.12, 0.4: 0.04}
# The same for an effect outside the catalogue, if the condition changes the motor itself: half of them respond like
# any other motor.
UNDESCRIBED_OUTSIDE = {5e-4: 0.23, 2e-3: 0.2, 8e-3: 0.2, 3e-2: 0.17, 0.1: 0.13, 0.4: 0.07}
# Share of their prior width by which elements, and parameters of effects, change without a predicted response -> prior. It is one number for all
# elements and one for all effects: otherwise a model with many parameters, none of which changed, would be penalised for each. An assumption;
# unconfirmed.
UNPREDICTED = {0.01: 0.4, 0.1: 0.3, 1.0: 0.3}
# The same for an effect outside the catalogue: it may change the elements that describe it by more than any element of a motor.
UNPREDICTED_OUTSIDE = {0.01: 0.3, 0.1: 0.25, 1.0: 0.25, 10.0: 0.2}
# Where the search for the best ends: at a size in the middle.
MIDDLE = 2e-3
# White noise that is added at first and reduced in stages: probable responses are then found before every point is fitted.
BLURS = (0.3, 0.03, 0.0)
# Largest number of steps of each part, and its first damping.
STEPS, DAMPING = 25, 1e-3
# Least damping after a step that failed: along a curved valley more of it makes all steps small.
LEAST_DAMPING = 1e-8
# Standard deviations beyond which no response is looked for: a capacitance that usually repeats to 2 % may then halve. A search that ends here
# has no solution, and its likelihood means nothing.
FARTHEST_RESPONSE = 40.0
# A step that gains less than this share of what the linear model promised is bent; its second derivative is taken over this share of it; and the
# largest correction, squared, as a share of the step (Transtrum and Sethna 2012).
PROMISED, AHEAD, GENTLE = 0.7, 0.1, 0.16
# Smallest gain of a step, and the same as a share of the cost: an explanation whose cost is thousands need not be refined.
CONVERGED, CONVERGED_SHARE = 1e-2, 1e-4
# Added to the diagonal of a scaled matrix: the arithmetic of nearly singular matrices.
NEARLY_SINGULAR = 1e-13
# In the corner of a matrix whose root has the misfit: more than any misfit that a solution can gain.
LARGE = 1e6
# Size of what no model describes, and shares of the unpredictable changes of elements and of effects.
Scale: TypeAlias = tuple[float, float, float]


class Prediction(Protocol):
    """The common interface of `Outcome` and `ValueOutcome`."""

    @property
    def size(self) -> int:
        """Number of response numbers."""

    @property
    def moving(self) -> BoolArray:
        """The model's unknowns on which it depends by more than a little, shape (k,)."""

    @property
    def elsewhere(self) -> bool:
        """Whether the circuit or span differs from that of the fit."""

    @property
    def unpredicted(self) -> IntArray:
        """Which response numbers belong to changes that cannot be predicted, shape (size,): 1 of an element, 2 of an effect, 0 elsewhere."""

    @property
    def sigma(self) -> FloatArray:
        """White noise of each number, shape (n,)."""

    @property
    def density(self) -> float:
        """Logarithm of what turns a density of these numbers into one of ln Z; 0 where they are that."""

    @property
    def smooth(self) -> FloatArray:
        """Columns, shape (p, n), of what no model describes, for a size of one."""

    @property
    def errors(self) -> FloatArray:
        """Columns, shape (p, n), of the analyser's smooth errors."""

    def at(self, u: FloatArray, eta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Prediction and its derivatives for the model's unknowns and for the response numbers."""

    def residual(self, mean: FloatArray) -> FloatArray:
        """Data less a prediction."""


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
            step[free] = -_solved(precision[np.ix_(free, free)], gradient[free])
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
            step = _solved(near.precision + damping * np.diag(np.diag(near.precision)), near.pull)
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
        return likelihood.curvature_pull(likelihood.linearised(u), u, step, AHEAD)

    @cached_property
    def _at_centre(self) -> float:
        return 0.0 if self.sweeps is None else self.sweeps.objective(self.centre)


def _valley(fit: Fit) -> FloatArray:
    if fit not in _VALLEYS:
        _VALLEYS[fit] = valley(fit)
    return _VALLEYS[fit]


# Each takes tenths of a second and is asked for at every measurement of another span or circuit.
_VALLEYS: WeakKeyDictionary[Fit, FloatArray] = WeakKeyDictionary()


def _widened(problem: Problem, matrix: FloatArray) -> FloatArray:
    """A precision with priors as wide as the range of what the sweeps leave open."""
    precision = matrix + np.diag(problem.flat_precision)
    # As the evidence of a fit does it: the arithmetic of nearly singular matrices.
    return precision + 1e-12 * np.diag(np.diag(precision))


@dataclass(frozen=True, eq=False)
class Weighed:
    """The result of new data for one model.

    Parameters
    ----------
    log_likelihood : float
        Of the data, all unknowns integrated over; comparable among models, and among explanations of the same sweeps.
    known : Known
        Distribution of the model's own unknowns afterwards.
    unchanged : float
        Probability that the data show the motor as it was.
    """

    log_likelihood: float
    known: Known
    unchanged: float = 0.0


def weigh(prediction: Prediction, known: Known, sizes: dict[float, float] | None = None) -> Weighed:
    """The likelihood of data under one prediction.

    Parameters
    ----------
    prediction : Outcome or ValueOutcome
    known : Known
        Distribution of the model's unknowns before these data.
    sizes : dict, optional
        Sizes of what no model describes -> prior.
    """
    sizes = sizes or UNDESCRIBED
    # Of a change the unknowns that do not respond stay, in a linear model.
    whole, known = known, known if prediction.moving.all() else known.normal
    # First with the largest size, then with a typical one: with the latter alone, a resonance that moved by more than its width is not found.
    most, middle = max(sizes), min(sizes, key=lambda size: abs(np.log(size / MIDDLE)))
    here = _Point.of(prediction, known.centre, np.zeros(prediction.size))
    for blur in BLURS:
        white = _Whitening(prediction, blur)
        smooth = _Smooth.of(white(prediction.smooth))
        best = _best_near(_System(prediction, known, here, white, smooth), prediction, white, smooth, (most, 1.0, 1.0))
        here = best.here
    best = _best_near(best, prediction, white, smooth, (middle, 1.0, 1.0))
    if prediction.elsewhere and known.sweeps is not None:
        # The least known parameter may have to move far along a valley.
        best = _best_from(_valley(known.sweeps.fit), best, prediction, white, smooth, (middle, 1.0, 1.0))
        if best.likeliest([(size, 1.0, 1.0) for size in sizes])[0] >= PLAIN:
            # It misses by per cents: a resonance that the sweeps at hand do not show may be in the wrong place.
            others = known.sweeps.fit.unknowns + known.sweeps.fit.alternatives
            best = _best_from(others, best, prediction, white, smooth, (middle, 1.0, 1.0))
    noise = prediction.density + white.log_density
    unpredicted = UNPREDICTED_OUTSIDE if sizes is UNDESCRIBED_OUTSIDE else UNPREDICTED
    elements, effects = (unpredicted if np.any(prediction.unpredicted == kind) else {1.0: 1.0} for kind in (1, 2))
    priors = {
        (size, *widths): float(np.log(prior * elements[widths[0]] * effects[widths[1]]))
        for size, prior in sizes.items()
        for widths in product(elements, effects)
    }
    scales, log_priors = list(priors), np.array(list(priors.values()))
    best = _best_near(best, prediction, white, smooth, best.likeliest(scales, log_priors))
    logs = noise + best.log_integrals(scales) + log_priors
    return Weighed(float(logsumexp(logs)), whole.after(best.learnt(scales[int(np.argmax(logs))]), prediction.moving))


def _best_from(starts: FloatArray, best: _System, prediction: Prediction, white: _Whitening, smooth: _Smooth, at: Scale) -> _System:
    """The best of a search so far, or that from the likeliest of other start values, shape (m, k)."""
    others = [_System(prediction, best.known, _Point.of(prediction, u, best.here.eta), white, smooth) for u in starts]
    if not others:
        return best
    other = _best_near(min(others, key=lambda one: one.cost(at)), prediction, white, smooth, at)
    return min(best, other, key=lambda one: one.cost(at))


def _best_near(best: _System, prediction: Prediction, white: _Whitening, smooth: _Smooth, at: Scale) -> _System:
    """The most likely unknowns for one size of the discrepancy (Levenberg and Marquardt, with a geodesic correction along curved valleys)."""
    known, k = best.known, best.known.centre.size

    def within(wanted: FloatArray) -> FloatArray:
        # The linear model of the unknowns is valid near the fit only: unknowns on which the prediction hardly depends are not changed.
        u = np.where(prediction.moving, np.clip(known.centre + wanted[:k], known.low, known.high), known.centre)
        return np.concatenate([u - known.centre, np.clip(wanted[k:], -FARTHEST_RESPONSE, FARTHEST_RESPONSE)])

    def moved(wanted: FloatArray) -> _System:
        return _System(prediction, known, _Point.of(prediction, known.centre + wanted[:k], wanted[k:]), white, smooth)

    damping, cost, failed, bent = DAMPING, best.cost(at), False, False
    for _ in range(STEPS):
        wanted = within(best.damped(at, damping))
        promised = cost - best.cost(at, wanted)
        if bent:
            wanted = within(best.corrected(at, damping, wanted, prediction))
        trial = moved(wanted)
        if trial.cost(at) > cost > trial.least(at):
            # Along a curved valley: a second step, back to its floor.
            trial = moved(within(trial.damped(at, max(damping, BACK_DAMPING))))
        gained = cost - trial.cost(at)
        bent |= gained < PROMISED * promised
        if gained > 0:
            # Right after a failure the damping is kept: with less, the next step would fail again.
            best, cost, damping, failed = trial, cost - gained, damping if failed else damping / 10, False
        else:
            damping, failed = max(10 * damping, LEAST_DAMPING), True
        small = max(CONVERGED, CONVERGED_SHARE * cost)
        # A small gain means convergence only if damping did not make the step small.
        if abs(gained) < small and (damping > 1 or cost - best.least(at) < UNDAMPED * small):
            break
    return best


def anything(prediction: Prediction, known: Known, sizes: Sequence[float]) -> float:
    """Log likelihood of data that depart from a prediction at each point by itself, by one of these sizes: from what is no law at all.

    Without it, what no smooth departure describes would be put down to the least wrong explanation.
    """
    mean, _, _ = prediction.at(known.centre, np.zeros(prediction.size))
    squares = prediction.residual(mean) ** 2
    variance = prediction.sigma**2 + np.array(sizes)[:, None] ** 2
    logs = -0.5 * np.sum(np.log(2 * np.pi * variance) + squares / variance, axis=1)
    return prediction.density + float(logsumexp(logs) - np.log(len(sizes)))


def mixed(cases: Sequence[tuple[float, Weighed]]) -> Weighed:
    """The result if one of several cases, each with its probability, is true: the likelihood of all, and the unknowns of the most probable one."""
    logs = np.array([np.log(share) + case.log_likelihood for share, case in cases])
    total = float(logsumexp(logs))
    unchanged = float(np.exp(logs - total) @ [case.unchanged for _, case in cases])
    return replace(cases[int(np.argmax(logs))][1], log_likelihood=total, unchanged=unchanged)


class _Whitening:
    """Numbers relative to white noise, to which a blur may be added, and the analyser's smooth errors together.

    The errors have few columns C, so the symmetric root of the inverse of I + C^T C leaves all but their directions V unchanged:
    I - V (1 - 1/sqrt(1 + s^2)) V^T with the singular values s of C.
    """

    def __init__(self, prediction: Prediction, blur: float = 0.0) -> None:
        self._weight = 1 / np.hypot(prediction.sigma, blur)
        columns = prediction.errors * self._weight
        _, singular, self._directions = np.linalg.svd(columns, full_matrices=False)
        self._less = 1 - 1 / np.hypot(1, singular)
        together = float(np.sum(np.log(np.hypot(1, singular))))
        self.log_density = float(np.sum(np.log(self._weight))) - together - 0.5 * self._weight.size * float(np.log(2 * np.pi))

    def __call__(self, rows: FloatArray) -> FloatArray:
        """Rows, shape (m, n), with unit covariance."""
        weighted: FloatArray = rows * self._weight
        if not self._less.size:
            return weighted
        return weighted - ((weighted @ self._directions.T) * self._less) @ self._directions


class _Smooth(NamedTuple):
    """Smooth columns, shape (p, n), and their inner products, which are the same at every point of a search."""

    rows: FloatArray
    gram: FloatArray

    @classmethod
    def of(cls, rows: FloatArray) -> _Smooth:
        return cls(rows, rows @ rows.T)


class _Point(NamedTuple):
    """Values of the unknowns, what is left of the data there, and the derivatives of the prediction."""

    u: FloatArray
    eta: FloatArray
    left: FloatArray
    slopes: FloatArray

    @classmethod
    def of(cls, prediction: Prediction, u: FloatArray, eta: FloatArray) -> _Point:
        mean, by_u, by_eta = prediction.at(u, eta)
        return cls(u, eta, prediction.residual(mean), np.concatenate([by_u, by_eta]))


class _System:
    """The least-squares problem round one point: unknowns are u less its centre, eta, and coefficients of the smooth columns."""

    def __init__(self, prediction: Prediction, known: Known, here: _Point, white: Callable[[FloatArray], FloatArray], smooth: _Smooth) -> None:
        self.known, self.here = known, here
        slopes = white(here.slopes)
        away = np.concatenate([here.u - known.centre, here.eta])
        self._slopes, self._smooth, self._white = slopes, smooth, white
        # The prediction as if it were linear from the centre on.
        self._left = white(here.left[None])[0] + away @ slopes
        self._own, self._undescribed = len(slopes), len(smooth.rows)
        self._gram = np.empty((self._own + self._undescribed,) * 2)
        self._gram[: self._own, : self._own] = slopes @ slopes.T
        self._gram[: self._own, self._own :] = crossed = slopes @ smooth.rows.T
        self._gram[self._own :, : self._own] = crossed.T
        self._gram[self._own :, self._own :] = smooth.gram
        self._pull = np.concatenate([slopes @ self._left, smooth.rows @ self._left])
        self._squares = float(self._left @ self._left)
        prior = np.eye(len(self._pull))
        k = known.centre.size
        self._before = near = known.near(here.u)
        prior[:k, :k] = near.precision
        self._pull[:k] += near.pull
        self._squares += near.squares
        self._prior = prior
        self._k = k
        self._unpredicted = np.zeros(len(self._pull), dtype=np.intp)
        self._unpredicted[k : k + here.eta.size] = prediction.unpredicted
        self._equations: dict[Scale, tuple[FloatArray, FloatArray]] = {}
        self._away = np.concatenate([away, np.zeros(len(smooth.rows))])
        # In these the prediction is looked at where they are, in all others it is linear.
        self._moving = np.arange(len(self._pull)) < self._own
        self._moving[:k] &= prediction.moving

    def _scales(self, at: Scale) -> FloatArray:
        """The unit of each unknown in the normal equations: a width for unpredictable changes, and the size of what no model describes."""
        size, *widths = at
        return np.concatenate([np.ones(self._own), np.full(self._undescribed, size)]) * np.array([1.0, *widths])[self._unpredicted]

    def _normal(self, at: Scale) -> tuple[FloatArray, FloatArray]:
        """Matrix, priors included, and right-hand side of the normal equations, for unknowns in the units of `_scales`."""
        if at not in self._equations:
            scales = self._scales(at)
            self._equations[at] = self._gram * scales * scales[:, None] + self._prior, self._pull * scales
        return self._equations[at]

    def damped(self, at: Scale, damping: float) -> FloatArray:
        """The best of the model's unknowns, less their centre, and of eta, if the prediction were linear and a step cost something."""
        matrix, pull = self._normal(at)
        scales = self._scales(at)
        held = np.where(self._moving, damping * np.diag(matrix), 0.0)
        solution = _solved(matrix + np.diag(held), pull + held * self._away / scales)
        return (solution * scales)[: self._own]

    def corrected(self, at: Scale, damping: float, wanted: FloatArray, prediction: Prediction) -> FloatArray:
        """The end of a step after a geodesic correction (Transtrum and Sethna 2012), or the same end if the correction is large."""
        k, own = self._k, self._own
        step = wanted - self._away[:own]
        ahead, _, _ = prediction.at(self.here.u + AHEAD * step[:k], self.here.eta + AHEAD * step[k:])
        turned = self._white((self.here.left - prediction.residual(ahead))[None])[0]
        second = (2 / AHEAD) * (turned / AHEAD - step @ self._slopes)
        bend = np.concatenate([self._slopes @ second, self._smooth.rows @ second])
        bend[:k] += self.known.bend(self.here.u, step[:k])
        matrix, _ = self._normal(at)
        scales, diagonal = self._scales(at), np.diag(matrix)
        turn = -0.5 * (_solved(matrix + np.diag(np.where(self._moving, damping * diagonal, 0.0)), bend * scales) * scales)[:own]
        weights = np.where(self._moving, diagonal / scales**2, 0.0)[:own]
        return wanted + turn if turn**2 @ weights < GENTLE * (step**2 @ weights) else wanted

    def least(self, at: Scale) -> float:
        """The lowest cost by the linear model."""
        matrix, pull = self._normal(at)
        return self._squares - float(pull @ _solved(matrix, pull))

    def cost(self, at: Scale, there: FloatArray | None = None) -> float:
        """Minus twice the log of likelihood times prior at this very point, or at another one by the linear model.

        All in which the prediction is linear is at its best.
        """
        matrix, pull = self._normal(at)
        moving, still = np.flatnonzero(self._moving), np.flatnonzero(~self._moving)
        point = self._away if there is None else np.concatenate([there, self._away[self._own :]])
        away = (point / self._scales(at))[moving]
        left = pull[still] - matrix[np.ix_(still, moving)] @ away
        squares = self._squares - 2 * float(away @ pull[moving]) + float(away @ matrix[np.ix_(moving, moving)] @ away)
        taken = float(left @ np.linalg.solve(matrix[np.ix_(still, still)], left)) if left.size else 0.0
        return squares - taken

    def log_integrals(self, scales: Sequence[Scale]) -> FloatArray:
        """Log of likelihood times prior, integrated over all unknowns, less the noise's own term; for each of the scales."""
        units = np.array([self._scales(at) for at in scales])
        matrix = self._gram * units[:, :, None] * units[:, None, :] + self._prior
        inverse = 1 / np.sqrt(np.diagonal(matrix, axis1=1, axis2=2))
        count = inverse.shape[1]
        # One more row, the right-hand side, so that the root also has the solution's share of the misfit.
        wider = np.empty((len(units), count + 1, count + 1))
        wider[:, :count, :count] = matrix * inverse[:, :, None] * inverse[:, None, :] + NEARLY_SINGULAR * np.eye(count)
        wider[:, count, :count] = wider[:, :count, count] = self._pull * units * inverse
        wider[:, count, count] = 2 * abs(self._squares) + LARGE
        root = np.linalg.cholesky(wider)
        least = self._squares - np.sum(root[:, count, :count] ** 2, axis=1)
        diagonal = np.diagonal(root, axis1=1, axis2=2)[:, :count]
        logdet = 2 * np.sum(np.log(diagonal), axis=1) - 2 * np.sum(np.log(inverse), axis=1)
        found: FloatArray = -0.5 * least - 0.5 * logdet - self.known.log_integral
        return found

    def likeliest(self, scales: Sequence[Scale], log_priors: FloatArray | float = 0.0) -> Scale:
        """The most probable one of some scales."""
        return scales[int(np.argmax(self.log_integrals(scales) + log_priors))]

    def learnt(self, at: Scale) -> Learnt:
        """What is then known of the model's own unknowns."""
        matrix, pull = self._normal(at)
        solution = _solved(matrix, pull)
        k = self._k
        inner, known = matrix[k:, k:], self.known
        others = np.linalg.solve(inner, np.column_stack([matrix[k:, :k], pull[k:]]))
        precision = matrix[:k, :k] - matrix[:k, k:] @ others[:, :k]
        precision = 0.5 * (precision + precision.T)
        # Where the prediction was looked at is a point of the search; a last step of the linear model could lead far from it.
        centre = np.where(self._moving[:k], self.here.u, np.clip(known.centre + solution[:k], known.low, known.high))
        # These data taught the difference from what was known before.
        taught = precision - self._before.precision
        towards = pull[:k] - matrix[:k, k:] @ others[:, k] - self._before.pull + taught @ known.centre
        return Learnt(centre, precision, taught, towards)


def _solved(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solution of a positive definite system."""
    scale = 1 / np.sqrt(np.diag(matrix))
    factor, failed = dpotrf(matrix * scale * scale[:, None] + NEARLY_SINGULAR * np.eye(len(scale)), lower=1)
    if failed:
        raise np.linalg.LinAlgError("the matrix of the normal equations is not positive definite")
    solution: FloatArray = scale * dpotrs(factor, scale * right, lower=1)[0]
    return solution
