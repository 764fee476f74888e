"""A model in which one element may vary over frequency, fitted again.

The other elements then have the values that they have when they need not compensate for a law that this one lacks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.fitting.marginal import NOTHING_LEFT
from motoremi.fitting.polish import polish
from motoremi.fitting.race import Trail, raced_alone
from motoremi.fitting.result import Fit, summarise
from motoremi.fitting.search import Found, Task, arrived_on_all
from motoremi.fitting.starts import base_starts
from motoremi.inspection.element_circuit import with_element
from motoremi.model import laws
from motoremi.model.circuit import Scaled
from motoremi.model.motor import Motor
from motoremi.model.parameter import Parameter

# A free element is a sum of this many relaxations. Their strengths have these prior standard deviations; a resistance may grow by far.
CORNERS = 9
STRENGTH = {"R": 3.0, "L": 0.3, "C": 0.3}
SEARCH_POINTS = 120
GLANCE_POINTS, GLANCE_STEPS = 60, 30
# Discrepancy above which the remaining error is far above the noise.
MUCH = 1e-3


def with_free(fit: Fit, element: str) -> Fit:
    """The model fitted again with one element that may vary over frequency.

    Its value becomes a sum of relaxations with fixed corner frequencies, which approximates any law without a resonance. If an error remains,
    a resonance at any frequency is added. Strengths have a wide prior about zero.
    """
    own = {**fit.parameters, **fit.nuisance}
    smooth = _freed(fit, element, False, [{**own, **base} for base in base_starts(own, fit.measurement, few=False)])
    if smooth.sizes.discrepancy <= NOTHING_LEFT:
        return smooth
    return max(smooth, _freed(fit, element, True, [_resonating(fit, element)]), key=lambda found: found.log_evidence)


def roughly_freed(fit: Fit, element: str) -> float:
    """The objective after a few steps on a few points with one element that may vary smoothly: an estimate of what freeing it would gain.

    If the error is large, every point has the same weight. Otherwise the objective is the likelihood without a discrepancy, which would absorb
    what the free element is to describe.
    """
    task = _free_task(fit, element, False)
    problem = task.thinned(GLANCE_POINTS) if fit.sizes.discrepancy >= MUCH else task.likelihood(GLANCE_POINTS)
    own = {**fit.parameters, **fit.nuisance}
    starts = problem.vectors([*({**own, **base} for base in base_starts(own, fit.measurement, few=True)), {**own, **fit.search_parameters}])
    return float(polish(problem, starts, iterations=GLANCE_STEPS).objective.min())


def _freed(fit: Fit, element: str, resonant: bool, starts: Sequence[Mapping[str, float]]) -> Fit:
    task = _free_task(fit, element, resonant)
    # Without a discrepancy, which would absorb what the free element is to describe.
    thinned = task.likelihood(SEARCH_POINTS)
    near = polish(thinned, thinned.vectors(starts), iterations=80)
    solution = arrived_on_all(task, [thinned.named(row) for row in near.distinct(2)])
    return summarise(task, Found(solution, (), dict(solution.values)), fit.method, fit.seed)


def _free_task(fit: Fit, element: str, resonant: bool) -> Task:
    frequency, width = fit.problem.observed.frequency_hz, STRENGTH[element[0]]
    corners = np.geomspace(frequency.min() / 2, 2 * frequency.max(), CORNERS)
    parameters = [Parameter(f"free {i}", "", -20 * width, 20 * width, "free", "linear", width) for i in range(CORNERS)]
    motor = _scaled(fit.motor, element, corners, [*parameters, *(_resonance(frequency) if resonant else [])])
    return Task(motor, fit.measurement, fit.bounds, fit.held)


def _resonance(frequency_hz: FloatArray) -> list[Parameter]:
    low, high = float(frequency_hz.min()), float(frequency_hz.max())
    return [
        Parameter("free strength", "", -1.0, 1.0, "free", "linear", 0.3),
        Parameter("free resonance", "Hz", low / 2, 2 * high, "free, within the sweep"),
        Parameter("free quality", "", 0.05, 200.0, "free"),
    ]


def _resonating(fit: Fit, element: str) -> dict[str, float]:
    """Values of all elements with a resonance added to one, sought from a grid of start values over the sweep."""
    frequency = fit.problem.observed.frequency_hz
    motor = _scaled(fit.motor, element, np.array([]), _resonance(frequency))
    own = {**fit.parameters, **fit.search_parameters}
    bases = base_starts(own, fit.measurement, few=True)
    tried = [(0.002, f, 10.0) for f in np.geomspace(frequency.min(), frequency.max(), 24)]
    tried += [(0.04, f, q) for f in np.geomspace(frequency.min(), frequency.max(), 6) for q in (0.5, 10.0)]
    starts = [{**base, "free strength": b, "free resonance": f, "free quality": q} for b, f, q in tried for base in bases]
    trail = Trail(Task(motor, fit.measurement, fit.bounds, fit.held), starts, len(bases), fit.sizes)
    return raced_alone(trail).values


def _scaled(motor: Motor, element: str, corners_hz: FloatArray, parameters: Sequence[Parameter]) -> Motor:
    law = _free_law(element[0], 2 * np.pi * corners_hz, resonant=len(parameters) > corners_hz.size)
    return with_element(motor, element, lambda whole: Scaled(whole, law, tuple(parameters)))


def _free_law(kind: str, corners: FloatArray, resonant: bool) -> laws.Law:
    """The factor 1 + sum of a / (1 + s/w), with a resonance also + b s^2 / (s^2 + s w/Q + w^2).

    For a capacitance its reciprocal scales the impedance; for a resistance the relaxations increase with frequency.
    """

    def law(s: ComplexArray, *own: FloatArray) -> laws.ValueAndSlopes:
        slopes = [1 / (1 + s / w) + 0 * own[0] for w in corners]
        if kind == "R":
            slopes = [1 - slope for slope in slopes]
        total = 1 + sum(a * slope for a, slope in zip(own, slopes, strict=False))
        if resonant:
            strength, resonance_hz, quality = own[corners.size :]
            # The law of a coupled winding, in which the strength stands for the squared coupling and may be negative.
            value, (_, by_resonance, by_quality) = laws.coupled_winding_factor(s, 1.0, resonance_hz, quality)
            total = total + strength * (1 - value)
            slopes += [1 - value, -strength * by_resonance, -strength * by_quality]
        if kind == "C":
            return 1 / total, tuple(-slope / total**2 for slope in slopes)
        return total, tuple(slopes)

    return law
