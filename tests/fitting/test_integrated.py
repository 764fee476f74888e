"""Models of which a band shows little but a product of two parameters: a cage in the rotor, and laminations, whose corner lies below it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.special import logsumexp

import motoremi as me
from motoremi.fitting.integrated import integrated
from motoremi.fitting.marginal import marginal
from motoremi.fitting.polish import FINE, UNDAMPED, polish
from motoremi.fitting.result import Fit
from motoremi.fitting.search import Task


def with_a_cage(share: float, corner_hz: float, skin_hz: float) -> Fit:
    """A fit of the paper's circuit to both sweeps of a motor whose winding is coupled to a deep bar."""
    frequency = np.geomspace(150e3, 30e6, 101)
    s = 2j * np.pi * frequency
    depth = np.sqrt(s / (2 * np.pi * skin_hz))
    bar = 2 * np.pi * corner_hz * depth / np.tanh(depth)
    coil = s * 9e-6 * (1 - share) + share * 9e-6 * bar * s / (s + bar)
    winding = 1 / (1 / (0.25 + coil) + s * 30e-12)
    frame = 1 / (1 / (50 + s * 2e-6 + 1 / (s * 300e-12)) + s * 350e-12)
    rng, sweeps = np.random.default_rng(3), []
    for termination, z in (("short", winding), ("open", winding + frame)):
        for _ in range(3):
            sweeps.append(me.ImpedanceSweep(termination, frequency, z * np.exp(3e-4 * (rng.standard_normal((101, 2)) @ [1, 1j]))))
    return me.fit(me.dc_motor(), sweeps, analyser="4294a")


@pytest.fixture(scope="module")
def base() -> Fit:
    return with_a_cage(0.5, 1.5e3, 2.7e3)


@pytest.mark.parametrize("effect", ["rotor-cage", "eddy-laminations", "skin-effect"])
def test_a_solution_is_at_its_minimum_also_along_a_valley(base: Fit, effect: str) -> None:
    found = base.add(effect)
    further = polish(found.weighed, found.unknowns, iterations=300, precision=FINE)
    # What a step may still promise when a fine polish ends, and once more for the curve.
    assert found.objective - further.objective[0] < 2 * UNDAMPED * (FINE.tolerance + FINE.relative * found.objective)


def test_a_cage_is_not_left_in_a_local_minimum(base: Fit) -> None:
    """What a cage does in this band is share * corner / sqrt(skin), whatever each of them is."""
    found = integrated((base.add("rotor-cage"), 0.0))[0]
    share, corner, skin = (found.parameters[f"rotor-cage.{name}"] for name in ("share", "corner_hz", "skin_hz"))
    assert share * corner / np.sqrt(skin) * found.parameters["La"] == pytest.approx(0.5 * 1.5e3 / np.sqrt(2.7e3) * 9e-6, rel=0.05)


def test_the_evidence_is_that_of_fits_with_the_parameter_held_at_each_of_its_values(base: Fit) -> None:
    found, gained = integrated((base.add("eddy-laminations"), 0.0))
    # The least known one, which its range limits; along the other the result would contain shares above one.
    name = "eddy-laminations.share"
    index = [p.name for p in found.weighed.unknowns].index(name)
    low, high, middle = found.weighed.low[index], found.weighed.high[index], found.weighed.centre[index]
    values = np.linspace(low, high, 81)
    start, logs = {**found.parameters, **found.nuisance}, []
    task = Task(found.motor, found.measurement, found.bounds, found.held)
    # From the solution outwards on both sides, each from its neighbour.
    for side in (values[values >= found.unknowns[index]], values[values < found.unknowns[index]][::-1]):
        near = start
        for value in side:
            held = {**found.held, name: float(np.exp(value))}
            problem = dataclasses.replace(task, held=held).likelihood(None, found.sizes)
            ends = polish(problem, problem.vector({**near, **held}), iterations=200, precision=FINE)
            near = problem.named(ends.u[0])
            prior = -0.5 * found.weighed.precision[index] * (value - middle) ** 2 + 0.5 * np.log(found.weighed.precision[index] / (2 * np.pi))
            logs.append(marginal(problem, ends.u[0]).log_evidence + prior)
    total = float(logsumexp(logs) + np.log(values[1] - values[0]))
    # Here the sizes of the errors are those of the solution, there the evidence of each value is summed over them.
    assert found.log_evidence + gained == pytest.approx(total, abs=0.5)
    assert gained < -1.5


def test_a_fit_without_effects_is_left_alone(base: Fit) -> None:
    assert integrated((base, 0.0)) == (base, 0.0)
