"""A model with one element free to vary over frequency, refitted: what the others are when they need not make up for what it lacks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.diagnosis.evidence import is_good
from motoremi.diagnosis.parts import with_element
from motoremi.fitting.looks import Trail, until_right
from motoremi.fitting.polish import polish
from motoremi.fitting.problem import Problem
from motoremi.fitting.result import Fit, summarise
from motoremi.fitting.search import Task
from motoremi.fitting.starts import base_starts
from motoremi.model import laws
from motoremi.model.circuit import Scaled
from motoremi.model.motor import Motor
from motoremi.model.parameter import Parameter

# A free element is a sum of so many relaxations; strengths have this standard deviation (resistances grow a great deal).
CORNERS = 9
STRENGTH = {"R": 3.0, "L": 0.3, "C": 0.3}
SEARCH_POINTS = 120
GLANCE_POINTS, GLANCE_STEPS = 60, 30


def with_free(fit: Fit, element: str) -> Fit:
    """The model refitted with one element free to vary, so that the others need not make up for what it lacks.

    Its value becomes a sum of relaxations with fixed corners, which any law without a resonance is; where that does not reach the noise, a
    resonance at any frequency joins them. Strengths have a wide prior round zero.
    """
    own = {**fit.parameters, **fit.nuisance}
    smooth = _freed(fit, element, False, [{**own, **base} for base in base_starts(own, fit.measurement, few=False)])
    if is_good(smooth):
        return smooth
    return min(smooth, _freed(fit, element, True, [_resonating(fit, element)]), key=lambda found: found.objective)


def promise(fit: Fit, element: str) -> float:
    """The objective that a look at the model with one element free to vary smoothly ends at: a few steps on a few points."""
    problem = _free_problem(fit, element, False, GLANCE_POINTS)
    own = {**fit.parameters, **fit.nuisance}
    starts = np.array([problem.vector({**own, **base}) for base in base_starts(own, fit.measurement, few=True)])
    return float(polish(problem, starts, iterations=GLANCE_STEPS).objective.min())


def _freed(fit: Fit, element: str, resonant: bool, starts: Sequence[Mapping[str, float]]) -> Fit:
    thinned, full = (_free_problem(fit, element, resonant, points) for points in (SEARCH_POINTS, None))
    near = polish(thinned, np.array([thinned.vector(start) for start in starts]), iterations=80)
    found = polish(full, near.distinct(2), iterations=60)
    return summarise(full, found.u[found.best], True, fit.method, fit.seed, 0, ())


def _free_problem(fit: Fit, element: str, resonant: bool, points: int | None) -> Problem:
    frequency, width = fit.problem.observed.frequency_hz, STRENGTH[element[0]]
    corners = np.geomspace(frequency.min() / 2, 2 * frequency.max(), CORNERS)
    parameters = [Parameter(f"free {i}", "", -20 * width, 20 * width, "free", "linear", width) for i in range(CORNERS)]
    motor = _scaled(fit.motor, element, corners, [*parameters, *(_resonance(frequency) if resonant else [])])
    return Problem(motor, fit.measurement, fit.bounds, fit.held, points=points)


def _resonance(frequency_hz: FloatArray) -> list[Parameter]:
    low, high = float(frequency_hz.min()), float(frequency_hz.max())
    return [
        Parameter("free strength", "", -1.0, 1.0, "free", "linear", 0.3),
        Parameter("free resonance", "Hz", low / 2, 2 * high, "free, within the sweep"),
        Parameter("free quality", "", 0.05, 200.0, "free"),
    ]


def _resonating(fit: Fit, element: str) -> dict[str, float]:
    """Values of all elements with a resonance in one, sought from a grid over the sweep."""
    frequency = fit.problem.observed.frequency_hz
    motor = _scaled(fit.motor, element, np.array([]), _resonance(frequency))
    own = {**fit.parameters, **fit.search_parameters}
    bases = base_starts(own, fit.measurement, few=True)
    tried = [(0.002, f, 10.0) for f in np.geomspace(frequency.min(), frequency.max(), 24)]
    tried += [(0.04, f, q) for f in np.geomspace(frequency.min(), frequency.max(), 6) for q in (0.5, 10.0)]
    starts = [{**base, "free strength": b, "free resonance": f, "free quality": q} for b, f, q in tried for base in bases]
    found = until_right(Trail(Task(motor, fit.measurement, fit.bounds, fit.held), starts, len(bases)))
    return found.values()


def _scaled(motor: Motor, element: str, corners_hz: FloatArray, parameters: Sequence[Parameter]) -> Motor:
    law = _free_law(element[0], 2 * np.pi * corners_hz, resonant=len(parameters) > corners_hz.size)
    return with_element(motor, element, lambda whole: Scaled(whole, law, tuple(parameters)))


def _free_law(kind: str, corners: FloatArray, resonant: bool) -> laws.Law:
    """1 + sum of a / (1 + s/w), and b s^2 / (s^2 + s w/Q + w^2).

    Inverted for a capacitance, whose impedance it scales; with rising relaxations for a resistance.
    """

    def law(s: ComplexArray, *own: FloatArray) -> laws.ValueAndSlopes:
        slopes = [1 / (1 + s / w) + 0 * own[0] for w in corners]
        if kind == "R":
            slopes = [1 - slope for slope in slopes]
        total = 1 + sum(a * slope for a, slope in zip(own, slopes, strict=False))
        if resonant:
            strength, resonance_hz, quality = own[corners.size :]
            # The law of a coupled winding in the square of its coupling, which may have either sign here.
            value, (_, by_resonance, by_quality) = laws.coupled_winding_factor(s, 1.0, resonance_hz, quality)
            total = total + strength * (1 - value)
            slopes += [1 - value, -strength * by_resonance, -strength * by_quality]
        if kind == "C":
            return 1 / total, tuple(-slope / total**2 for slope in slopes)
        return total, tuple(slopes)

    return law
