"""Posterior of a model of spectra: robust residuals and priors; the receiver's ripple is unknown in addition to the parameters."""

from __future__ import annotations

import itertools

import numpy as np

from motoremi.arrays import FloatArray, Progress
from motoremi.emission.descent import Lowest, descend
from motoremi.emission.spectrum_problem import Problem
from motoremi.interrupts import checkpoint
from motoremi.model.parameter import Parameter

# Number of standard deviations beyond which the cost of a point (a glitch) grows linearly instead of quadratically (Huber).
_ROBUST = 2.5
# Number of neighbouring points that count as one independent point, because errors of the model are correlated along frequency.
CORRELATED = 2.0
# Cost of a station in log evidence, for its frequency and its two levels.
_STATION_COST = 8.0
# Curvature of the flat prior over a range: a parameter that the data do not determine then does not change the evidence.
_FLAT = 2 * np.pi


def to_unit(parameter: Parameter, value: float) -> float:
    """Position of a value in its range, 0 to 1."""
    if parameter.scale == "log":
        return float(np.log(value / parameter.low) / np.log(parameter.high / parameter.low))
    return (value - parameter.low) / (parameter.high - parameter.low)


def from_unit(parameter: Parameter, unit: float) -> float:
    """The value at a position 0 to 1 in the range."""
    if parameter.scale == "log":
        return float(parameter.low * (parameter.high / parameter.low) ** unit)
    return parameter.low + unit * (parameter.high - parameter.low)


class Posterior:
    """Residuals of points, priors and ripple whose squares add up to twice the negative log posterior."""

    def __init__(self, problem: Problem, effects: tuple[str, ...]) -> None:
        self.problem, self.effects = problem, effects
        self.unknowns = problem.parameters(effects)
        self.size = len(self.unknowns)
        self.columns = -problem.ripple / problem.sigma_db[:, None]
        # Steps of the finite differences are wider than usual, because the formulas are interpolated from tables. Those of the chopper are small:
        # line 1000 of a comb moves by its spacing if the comb's frequency changes by a thousandth; the same holds for the zeros of a pulse.
        self.steps = np.array([1e-7 if p.name in ("chopper.frequency_hz", "chopper.width_s") else 1e-4 for p, _ in self.unknowns])
        self._last: tuple[FloatArray, FloatArray] | None = None

    def values(self, x: FloatArray) -> dict[str, float]:
        """Parameter values by name."""
        return {p.name: from_unit(p, float(u)) for (p, _), u in zip(self.unknowns, x, strict=False)}

    def _errors(self, x: FloatArray) -> FloatArray:
        """Errors of the points in standard deviations, without the ripple."""
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
        """Residuals for all unknowns: the model's parameters in units of their ranges, then the ripple."""
        at, ripple = x[: self.size], x[self.size :]
        points = _softened(self._errors(at) + self.columns @ ripple) / np.sqrt(CORRELATED)
        return np.concatenate([points, self._priors(at), ripple])

    def slopes(self, x: FloatArray) -> FloatArray:
        """Derivatives of the residuals."""
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
        """Cost of a start, without ripple and priors."""
        return float(np.sum(_softened(self._errors(x)) ** 2))

    def polished(self, start: FloatArray, steps: int = 25, progress: Progress | None = None) -> Lowest:
        """The nearest local minimum, or the point reached after `steps`; `progress` is called at each step.

        Parameters
        ----------
        start : ndarray, shape (k,) or (k + r,)
            The model's parameters in units of their ranges; the ripple begins at 0 unless it is given as well.
        """
        taken = itertools.count()

        def slopes(x: FloatArray) -> FloatArray:
            checkpoint()
            if progress is not None:
                progress("source and path", next(taken), steps)
            return self.slopes(x)

        count = self.columns.shape[1]
        low, high = (np.concatenate([np.full(self.size, end), np.full(count, far)]) for end, far in ((0.0, -np.inf), (1.0, np.inf)))
        whole = np.concatenate([start, np.zeros(self.size + count - start.size)])
        return descend(self.residuals, slopes, whole, low, high, steps)

    def volume(self, x: FloatArray) -> float:
        """Log determinant of the curvature at a minimum; for a parameter that the data do not determine it is that of its range."""
        slopes = self.slopes(x)
        flat = [_FLAT if index < self.size and self.unknowns[index][1] is None else 0.0 for index in range(x.size)]
        return float(np.linalg.slogdet(slopes.T @ slopes + np.diag(flat))[1])

    def evidence(self, x: FloatArray, cost: float) -> float:
        """Log of the integral of the posterior over all unknowns around a minimum (Laplace's approximation)."""
        problem = self.problem
        own = sum("." in p.name for p, _ in self.unknowns)
        stations = len(problem.stations) if "background-noise" in self.effects and problem.ambient is None else 0
        return float(-cost - 0.5 * self.volume(x) + 0.5 * own * np.log(_FLAT) - _STATION_COST * stations)

    def chi2_reduced(self, x: FloatArray) -> float:
        """Robust chi2 over points, with the ripple removed."""
        left = _softened(self._errors(x[: self.size]) + self.columns @ x[self.size :])
        return float(np.sum(left**2)) / max(1, left.size - x.size)


def _softening(errors: FloatArray) -> FloatArray:
    """Derivative of `_softened`."""
    size = np.maximum(np.abs(errors), _ROBUST)
    return np.where(np.abs(errors) <= _ROBUST, 1.0, _ROBUST / np.sqrt(_ROBUST * (2 * size - _ROBUST)))


def _softened(errors: FloatArray) -> FloatArray:
    """Residuals whose squares grow linearly beyond a few standard deviations (Huber's function)."""
    size = np.abs(errors)
    beyond = np.sqrt(_ROBUST * (2 * np.maximum(size, _ROBUST) - _ROBUST))
    return np.where(size <= _ROBUST, errors, np.sign(errors) * beyond)
