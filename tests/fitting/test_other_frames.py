"""A model with an effect whose path to the frame has ended in a wrong minimum: others are tried, and taken if they are clearly better."""

from __future__ import annotations

import numpy as np
import pytest
from paper_circuit import impedance

import motoremi as me
from motoremi.fitting.race import Trail
from motoremi.fitting.refit import on_all_points
from motoremi.fitting.search import Solution, Task, arrive, other_frames
from motoremi.model.effects import add_effects

ELEMENTS = {"Ra": 55.0, "La": 26e-6, "Ca": 18e-12, "Rr": 16.0, "Lr": 0.4e-6, "Cr": 190e-12, "Cf": 90e-12}
# All of the capacitance to the frame in Cf, and next to nothing in the branch.
WRONG = {"Rr": 16e3, "Lr": 2.6e-3, "Cr": 3.5e-12, "Cf": 274e-12}
FREQUENCY_HZ = np.geomspace(150e3, 40e6, 201)
ADDED = {"terminal-capacitance.capacitance_f": 350e-12, "terminal-capacitance.tan_delta": 1e-3}


@pytest.fixture(scope="module")
def base() -> me.Fit:
    """Of a motor with a capacitance across its terminals."""
    rng = np.random.default_rng(14)
    s = 2j * np.pi * FREQUENCY_HZ
    sweeps = []
    for termination in ("short", "open"):
        seen = 1 / (1 / impedance(ELEMENTS, termination, FREQUENCY_HZ) + s * 350e-12)
        noise = 1e-4 * (rng.standard_normal(201) + 1j * rng.standard_normal(201))
        sweeps.append(me.ImpedanceSweep(termination, FREQUENCY_HZ, seen * (1 + noise)))
    return me.fit(me.dc_motor(), sweeps, analyser="none")


@pytest.fixture(scope="module")
def task(base: me.Fit) -> Task:
    return Task(add_effects(base.motor, ("terminal-capacitance",)), base.measurement, {}, {})


@pytest.fixture(scope="module")
def lost(task: Task) -> Solution:
    """Where the likelihood ends from a wrong path to the frame."""
    return arrive(task, [{**ELEMENTS, **ADDED, **WRONG}])


def test_the_right_path_is_found_from_a_wrong_one(task: Task, lost: Solution) -> None:
    assert lost.values["Cr"] < 0.2 * ELEMENTS["Cr"]
    best, *_ = other_frames(task, lost.values)
    assert best["Cr"] == pytest.approx(ELEMENTS["Cr"], rel=0.02)
    assert best["Rr"] == pytest.approx(ELEMENTS["Rr"], rel=0.02)


def test_from_the_right_path_none_is_better(task: Task) -> None:
    assert other_frames(task, {**ELEMENTS, **ADDED}) == []


def test_a_path_that_is_held_is_not_changed(task: Task) -> None:
    held = Task(task.motor, task.measurement, {}, {"Cr": 3.5e-12})
    assert other_frames(held, {**ELEMENTS, **ADDED, **WRONG}) == []


def test_on_all_points_the_right_path_is_taken(base: me.Fit, task: Task, lost: Solution) -> None:
    fitted = on_all_points((Trail(task, [lost.values], 1, base.sizes), lost, base))
    assert fitted.rms_error_percent < 0.03
    assert fitted.parameters["Cr"] == pytest.approx(ELEMENTS["Cr"], rel=0.01)
