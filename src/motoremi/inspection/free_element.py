"""A model with one element free to vary over frequency, refitted: what the others are when they need not make up for what it lacks."""

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

# A free element is a sum of so many relaxations; strengths have this standard deviation (resistances grow a great deal).
CORNERS = 9
STRENGTH = {"R": 3.0, "L": 0.3, "C": 0.3}
SEARCH_POINTS = 120
GLANCE_POINTS, GLANCE_STEPS = 60, 30
# A discrepancy that is no matter of noise.
MUCH = 1e-3


def with_free(fit: Fit, element: str) -> Fit:
    """The model refitted with one element free to vary, so that the others need not make up for what it lacks.

    Its value becomes a sum of relaxations with fixed corners, which any law without a resonance is; where that leaves something, a
    resonance at any frequency joins them. Strengths have a wide prior round zero.
    """
    own = {**fit.parameters, **fit.nuisance}
    smooth = _freed(fit, element, False, [{**own, **base} for base in base_starts(own, fit.measurement, few=False)])
    if smooth.sizes.discrepancy <= NOTHING_LEFT:
        return smooth
    return max(smooth, _freed(fit, element, True, [_resonating(fit, element)]), key=lambda found: found.log_evidence)


def promise(fit: Fit, element: str) -> float:
    """The objective that a look at the model with one element free to vary smoothly ends at: a few steps on a few points.

    Where much is left every point counts alike; else the likelihood tells, without a discrepancy, which would take what the element would.
    """
    task = _free_task(fit, element, False)
    problem = task.thinned(GLANCE_POINTS) if fit.sizes.discrepancy >= MUCH else task.likelihood(GLANCE_POINTS)
    own = {**fit.parameters, **fit.nuisance}
    starts = problem.vectors([*({**own, **base} for base in base_starts(own, fit.measurement, few=True)), {**own, **fit.search_parameters}])
    return float(polish(problem, starts, iterations=GLANCE_STEPS).objective.min())


def _freed(fit: Fit, element: str, resonant: bool, starts: Sequence[Mapping[str, float]]) -> Fit:
    task = _free_task(fit, element, resonant)
    # Without a discrepancy, which would take what the element would.
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
    """Values of all elements with a resonance in one, sought from a grid over the sweep."""
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
