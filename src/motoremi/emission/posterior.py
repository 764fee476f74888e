"""How well values describe the spectra: robust residuals with what is known beforehand, the receiver's ripple unknown beside the model."""

from __future__ import annotations

import itertools

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from motoremi.arrays import FloatArray, Progress
from motoremi.emission.spectrum_problem import Problem
from motoremi.interrupts import checkpoint
from motoremi.model.parameter import Parameter

# Beyond so many standard deviations a point (a glitch) counts in proportion only.
_ROBUST = 2.5
# Neighbours are read one after the other, but what a model does not know they share: so many points say as much as one.
CORRELATED = 2.0
# A station in the model is worth it if it explains more than its frequency and its two levels cost.
_STATION_COST = 8.0
# Curvature of the flat distribution that stands for a range: one that the data do not narrow counts nothing.
_FLAT = 2 * np.pi


def to_unit(parameter: Parameter, value: float) -> float:
    """Where in its range a value lies, 0 to 1."""
    if parameter.scale == "log":
        return float(np.log(value / parameter.low) / np.log(parameter.high / parameter.low))
    return (value - parameter.low) / (parameter.high - parameter.low)


def from_unit(parameter: Parameter, unit: float) -> float:
    """The value there."""
    if parameter.scale == "log":
        return float(parameter.low * (parameter.high / parameter.low) ** unit)
    return parameter.low + unit * (parameter.high - parameter.low)


class Posterior:
    """Residuals whose squares add up to twice the negative log posterior: of points and priors; the receiver's ripple is unknown too."""

    def __init__(self, problem: Problem, effects: tuple[str, ...]) -> None:
        self.problem, self.effects = problem, effects
        self.unknowns = problem.parameters(effects)
        self.size = len(self.unknowns)
        self.columns = -problem.ripple / problem.sigma_db[:, None]
        # The formulas are smooth but not exact to the last digit: wider steps than usual for the slopes. But line 1000 of a comb moves by its
        # spacing when the comb's frequency moves by a thousandth of it, and so does what the two edges of a pulse cancel.
        self.steps = np.array([1e-7 if p.name in ("chopper.frequency_hz", "chopper.width_s") else 1e-4 for p, _ in self.unknowns])
        self._last: tuple[FloatArray, FloatArray] | None = None

    def values(self, x: FloatArray) -> dict[str, float]:
        """By name."""
        return {p.name: from_unit(p, float(u)) for (p, _), u in zip(self.unknowns, x, strict=False)}

    def _errors(self, x: FloatArray) -> FloatArray:
        """In standard deviations, without the ripple."""
        if self._last is None or not np.array_equal(self._last[0], x):
            self._last = x.copy(), self.problem.error(self.effects, self.values(x)) / self.problem.sigma_db
        return self._last[1]

    def _priors(self, x: FloatArray) -> FloatArray:
        values = self.values(x)
        centre = {"floor_dbuv": self.problem.setup.receiver.floor_dbuv}
        return np.array(
            [
                ((np.log(values[p.name]) if p.scale == "log" else values[p.name]) - centre.get(p.name, 0.0)) / sigma
                for p, sigma in self.unknowns
                if sigma is not None
            ]
        )

    def residuals(self, x: FloatArray) -> FloatArray:
        """Of all unknowns: the model's in units of their ranges, then those of the ripple."""
        at, ripple = x[: self.size], x[self.size :]
        points = _softened(self._errors(at) + self.columns @ ripple) / np.sqrt(CORRELATED)
        return np.concatenate([points, self._priors(at), ripple])

    def slopes(self, x: FloatArray) -> FloatArray:
        """Of the residuals."""
        at, ripple = x[: self.size], x[self.size :]
        error, prior = self._errors(at), self._priors(at)
        raw, priors = np.empty((error.size, self.size)), np.empty((prior.size, self.size))
        for index, step in enumerate(self.steps):
            moved = at.copy()
            moved[index] += step if moved[index] + step <= 1 else -step
            by = moved[index] - at[index]
            raw[:, index], priors[:, index] = (self._errors(moved) - error) / by, (self._priors(moved) - prior) / by
        slopes = np.zeros((error.size + prior.size + ripple.size, x.size))
        hard = _softening(error + self.columns @ ripple)[:, None] / np.sqrt(CORRELATED)
        slopes[: error.size, : self.size], slopes[: error.size, self.size :] = hard * raw, hard * self.columns
        slopes[error.size : error.size + prior.size, : self.size] = priors
        slopes[error.size + prior.size :, self.size :] = np.eye(ripple.size)
        return slopes

    def at_start(self, x: FloatArray) -> float:
        """How bad a start is."""
        return float(np.sum(_softened(self._errors(x)) ** 2))

    def polished(self, start: FloatArray, steps: int = 25, progress: Progress | None = None) -> OptimizeResult:
        """The nearest minimum, or the way to it; `progress` is told of each step."""
        taken = itertools.count()

        def slopes(x: FloatArray) -> FloatArray:
            checkpoint()
            if progress is not None:
                progress("source and path", next(taken), steps)
            return self.slopes(x)

        free = self.columns.shape[1]
        low, high = (np.concatenate([np.full(self.size, end), np.full(free, far)]) for end, far in ((0.0, -np.inf), (1.0, np.inf)))
        return least_squares(
            self.residuals, np.concatenate([start, np.zeros(free)]), jac=slopes, bounds=(low, high),
            x_scale=np.concatenate([1e3 * self.steps, np.ones(free)]), max_nfev=steps, ftol=1e-4, xtol=1e-9, gtol=1e-6,
        )  # fmt: skip

    def volume(self, x: FloatArray) -> float:
        """Log determinant of the curvature at a minimum; a parameter that the data do not narrow at all counts as its own range does."""
        slopes = self.slopes(x)
        flat = [_FLAT if index < self.size and self.unknowns[index][1] is None else 0.0 for index in range(x.size)]
        return float(np.linalg.slogdet(slopes.T @ slopes + np.diag(flat))[1])

    def evidence(self, x: FloatArray, cost: float) -> float:
        """Log of the integral over all unknowns around a minimum (Laplace)."""
        problem = self.problem
        own = sum("." in p.name for p, _ in self.unknowns)
        stations = len(problem.stations) if "background-noise" in self.effects and problem.ambient is None else 0
        return float(-cost - 0.5 * self.volume(x) + 0.5 * own * np.log(_FLAT) - _STATION_COST * stations)

    def chi2_reduced(self, x: FloatArray) -> float:
        """Robust, over points, the ripple taken out."""
        left = _softened(self._errors(x[: self.size]) + self.columns @ x[self.size :])
        return float(np.sum(left**2)) / max(1, left.size - x.size)


def _softening(errors: FloatArray) -> FloatArray:
    """Slope of `_softened`."""
    size = np.maximum(np.abs(errors), _ROBUST)
    return np.where(np.abs(errors) <= _ROBUST, 1.0, _ROBUST / np.sqrt(_ROBUST * (2 * size - _ROBUST)))


def _softened(errors: FloatArray) -> FloatArray:
    """Residuals whose squares grow in proportion beyond a few standard deviations."""
    size = np.abs(errors)
    beyond = np.sqrt(_ROBUST * (2 * np.maximum(size, _ROBUST) - _ROBUST))
    return np.where(size <= _ROBUST, errors, np.sign(errors) * beyond)
