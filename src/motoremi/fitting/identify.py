"""What the data determine: intervals from the profile likelihood, and derived quantities with error bars."""

from __future__ import annotations

import dataclasses
import math
from typing import NamedTuple

import numpy as np

from motoremi.arrays import FloatArray
from motoremi.errors import BadInput
from motoremi.fitting.intervals import Derived, Interval
from motoremi.fitting.polish import Precision, polish
from motoremi.fitting.result import Fit, on_fits
from motoremi.threads import one_blas_thread

# 95 % point of chi-squared with one degree of freedom: how much the objective may rise within the interval.
RISE_95 = 3.841
# A profile is needed to a hundredth of that rise.
ALONG_PROFILE = Precision(0.02, 1e-5)


@one_blas_thread
def profile(fit: Fit, name: str) -> Interval:
    """The 95 % interval of a parameter, all others refitted at each value (Raue et al., Bioinformatics 25, 2009).

    Unlike an error bar from the curvature, it is right where a parameter is poorly determined or near a bound. The sizes of the discrepancy
    and of the declared errors are those of the fit. It is widened like the error bar by what the likelihood does not contain: a motor that changed,
    two resonances that may be exchanged, and it contains other solutions that are about as probable.

    Raises
    ------
    BadInput
        For a parameter that is not a fitted, positive one.
    """
    index = next((i for i, p in enumerate(fit.problem.unknowns) if p.name == name and p.scale == "log"), None)
    if index is None:
        raise BadInput(f"{name} has no profile: it is not a fitted positive parameter of this model")
    along = Along(fit, index)
    other = 0.0 if fit.exchange is None else float(fit.exchange[index])
    limit = fit.objective + RISE_95 * float((fit.local_covariance[index, index] - other**2) / fit.covariance[index, index])

    def edge(bound: float) -> tuple[float, bool]:
        reached = along.walk(bound, limit)
        if reached.outside is None:
            return bound, True
        inside, values, outside = reached.inside, reached.values, reached.outside
        for _ in range(7):
            middle = 0.5 * (inside + outside)
            found = along.below(limit, middle, values)
            if found is None:
                outside = middle
            else:
                inside, values = middle, found
        return 0.5 * (inside + outside), False

    low, open_below = edge(float(fit.problem.low[index]))
    high, open_above = edge(float(fit.problem.high[index]))
    others = (other, *fit.alternatives[:, index])
    low, high = min(low, along.best + min(others)), max(high, along.best + max(others))
    return Interval(name, fit.problem.unknowns[index].unit, float(np.exp(low)), float(np.exp(high)), open_below, open_above)


class Reached(NamedTuple):
    """Where a walk along one unknown ended.

    Parameters
    ----------
    inside : float
        The last value of the unknown at which the objective was below the limit.
    values : dict
        The solution there, SI units.
    outside : float or None
        The next value, with the objective above the limit; None if the walk reached the bound.
    """

    inside: float
    values: dict[str, float]
    outside: float | None


class Along:
    """The likelihood of a fit along one unknown: held at other values, with all other unknowns fitted there.

    Parameters
    ----------
    fit : Fit
    index : int
        Of the unknown.
    points : int, optional
        On about so many points a sweep; all by default.
    """

    def __init__(self, fit: Fit, index: int, points: int | None = None) -> None:
        self.best = float(fit.unknowns[index])
        self._fit, self._index, self._points = fit, index, points
        self._name = fit.problem.unknowns[index].name
        self._solution = {**fit.parameters, **fit.nuisance}
        self._direction = following(fit.linearised.matrix, index)

    def below(self, limit: float, value: float, start: dict[str, float]) -> dict[str, float] | None:
        """Values in SI units with an objective below a limit at a value of the unknown; None if there are none."""
        fit, problem = self._fit, self._fit.problem
        # From the neighbour, from the solution, and from the values that the others need if the data determine only a product.
        moved = problem.clip(fit.unknowns + self._direction * (value - self.best))
        along = problem.named(np.where(np.arange(moved.size) == self._index, value, moved))
        task = dataclasses.replace(fit.task, held={**fit.held, self._name: along[self._name]})
        held = task.likelihood(self._points, fit.sizes)
        end = polish(held, held.vectors([start, self._solution, along]), iterations=100, precision=ALONG_PROFILE, enough=limit)
        return held.named(end.u[end.best]) if end.objective[end.best] <= limit else None

    def walk(self, bound: float, limit: float) -> Reached:
        """Away from the solution in steps that double, until the objective is above a limit or the bound is reached."""
        inside, values = self.best, self._solution
        # The error bar from the curvature is the right size to start with, where there is one.
        deviation = float(np.sqrt(self._fit.local_covariance[self._index, self._index]))
        step = min(max(deviation, 1e-6), 0.2) * float(np.sign(bound - self.best))
        while True:
            trial = inside + step
            past = abs(trial - self.best) >= abs(bound - self.best)
            trial = bound if past else trial
            found = self.below(limit, trial, values)
            if found is None:
                return Reached(inside, values, trial)
            if past:
                return Reached(trial, found, None)
            inside, values, step = trial, found, 2 * step


def following(matrix: FloatArray, index: int) -> FloatArray:
    """How the other unknowns move when one does; what the data leave open stays where it is."""
    others = np.arange(len(matrix)) != index
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix / np.outer(scale, scale)
    direction = np.zeros(len(matrix))
    direction[index] = 1.0
    direction[others] = -np.linalg.pinv(scaled[np.ix_(others, others)], rcond=1e-8) @ scaled[others, index] * scale[index] / scale[others]
    return direction


# Each is a product of powers of elements, so its logarithm is linear in theirs: name, unit, factor, powers.
_PRODUCTS: tuple[tuple[str, str, float, dict[str, float]], ...] = (
    ("parallel resonance of La and Ca", "Hz", 1 / (2 * np.pi), {"La": -0.5, "Ca": -0.5}),
    ("characteristic impedance of La and Ca", "Ohm", 1.0, {"La": 0.5, "Ca": -0.5}),
    ("Q of La and Ca", "", 1.0, {"La": 0.5, "Ca": -0.5, "Ra": -1.0}),
    ("series resonance of Lr and Cr", "Hz", 1 / (2 * np.pi), {"Lr": -0.5, "Cr": -0.5}),
    ("characteristic impedance of Lr and Cr", "Ohm", 1.0, {"Lr": 0.5, "Cr": -0.5}),
    ("Q of Lr and Cr", "", 1.0, {"Lr": 0.5, "Cr": -0.5, "Rr": -1.0}),
)


def derived(fit: Fit) -> list[Derived]:
    """Resonances, quality factors and characteristic impedances, with error bars that respect the correlations."""
    names = [p.name for p in fit.problem.unknowns]
    covariance = fit.shown_covariance
    quantities = []
    for title, unit, factor, powers in _PRODUCTS:
        if not all(name in fit.parameters for name in powers):
            continue
        value = factor * float(np.prod([fit.parameters[name] ** power for name, power in powers.items()]))
        weights = np.zeros(len(names))
        for name, power in powers.items():
            if name in names:  # a held element has no error of its own
                weights[names.index(name)] = power
        variance = max(float(weights @ covariance @ weights), 0.0)
        quantities.append(Derived(title, value, abs(value) * math.sqrt(variance), unit))
    return quantities


on_fits.profile = profile
on_fits.derived = derived
