"""What the data determine: intervals from the profile likelihood, and derived quantities with error bars."""

from __future__ import annotations

import math

import numpy as np

from motoremi.arrays import FloatArray
from motoremi.errors import BadInput
from motoremi.fitting.intervals import Derived, Interval
from motoremi.fitting.polish import Precision, polish
from motoremi.fitting.problem import Problem
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
    two resonances that may be exchanged.

    Raises
    ------
    BadInput
        For a parameter that is not a fitted, positive one.
    """
    problem = fit.problem
    index = next((i for i, p in enumerate(problem.unknowns) if p.name == name and p.scale == "log"), None)
    if index is None:
        raise BadInput(f"{name} has no profile: it is not a fitted positive parameter of this model")
    parameter = problem.unknowns[index]
    other = 0.0 if fit.exchange is None else float(fit.exchange[index])
    limit = fit.objective + RISE_95 * float((fit.shown_covariance[index, index] - other**2) / fit.covariance[index, index])
    best = float(fit.unknowns[index])
    # The error bar from the curvature is the right size to start with, where there is one.
    first = min(max(fit.sigma[name] / fit.parameters[name], 1e-6), 0.2)

    solution = {**fit.parameters, **fit.nuisance}
    direction = _following(fit.linearised.matrix, index)

    def excess(value: float, start: dict[str, float]) -> tuple[float, dict[str, float]]:
        held = Problem(fit.motor, fit.measurement.coarse, fit.bounds, {**fit.held, name: float(np.exp(value))}, sizes=fit.sizes)
        # From the neighbour, from the solution, and from the values that the others need if the data determine only a product.
        along = problem.named(problem.clip(fit.unknowns + direction * (value - best)))
        end = polish(held, np.array([held.vector(values) for values in (start, solution, along)]), iterations=100, precision=ALONG_PROFILE)
        return float(end.objective[end.best]) - limit, held.named(end.u[end.best])

    def edge(bound: float) -> tuple[float, bool]:
        inside, values = best, solution
        step = first * float(np.sign(bound - best))
        while True:
            trial = inside + step
            past = abs(trial - best) >= abs(bound - best)
            trial = bound if past else trial
            over, found = excess(trial, values)
            if over > 0:
                break
            if past:
                return bound, True
            inside, values, step = trial, found, 2 * step
        outside = trial
        for _ in range(7):
            middle = 0.5 * (inside + outside)
            over, found = excess(middle, values)
            if over > 0:
                outside = middle
            else:
                inside, values = middle, found
        return 0.5 * (inside + outside), False

    low, open_below = edge(float(problem.low[index]))
    high, open_above = edge(float(problem.high[index]))
    low, high = min(low, best + other), max(high, best + other)
    return Interval(name, parameter.unit, float(np.exp(low)), float(np.exp(high)), open_below, open_above)


def _following(matrix: FloatArray, index: int) -> FloatArray:
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
