"""Intervals wider than the likelihood gives: a motor that changes while it is measured, resonances that may be exchanged."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from paper_circuit import DAMPED, impedance

import motoremi as me
from motoremi.blind.disturbances import warming
from motoremi.diagnosis.findings import of_the_amount
from motoremi.fitting.exchange import ELEMENTS, exchanged
from motoremi.fitting.warming import displacements
from motoremi.simulate.simulated_motor import SimulatedMotor

GRID_HZ = np.geomspace(150e3, 100e6, 201)
NOISE = 2e-4
RISES = {"Ra": 0.02, "Ca": 0.005}


def noisy(rng, termination, true):
    return me.ImpedanceSweep(termination, GRID_HZ, true * (1 + NOISE * (rng.normal(size=true.size) + 1j * rng.normal(size=true.size))))


@pytest.fixture(scope="module")
def warm():
    """A healthy motor that warms evenly through three repeats of each sweep."""
    rng, motor = np.random.default_rng(3), SimulatedMotor.random(11)
    sweeps = []
    for number in range(6):
        termination = "short" if number < 3 else "open"
        warmth = (number + np.linspace(0, 1, GRID_HZ.size)) / 6
        sweeps.append(noisy(rng, termination, warming(motor, termination, GRID_HZ, warmth, RISES)))
    return motor, me.fit(None, sweeps, analyser="none")


@pytest.fixture(scope="module")
def open_alone():
    rng = np.random.default_rng(4)
    motor = SimulatedMotor.random(11)
    return motor, me.fit(None, [noisy(rng, "open", motor.impedance("open", GRID_HZ)) for _ in range(3)], analyser="none")


def missed(fit, truth, deviations):
    """Elements whose 95 % interval leaves out all of the values that they had."""
    out = []
    for index, parameter in enumerate(fit.problem.unknowns):
        low, high = truth[parameter.name], truth[parameter.name] * (1 + RISES.get(parameter.name, 0.0))
        value, reach = fit.parameters[parameter.name], 1.96 * deviations[index] * fit.parameters[parameter.name]
        out += [] if value - reach <= high and value + reach >= low else [parameter.name]
    return out


@pytest.mark.slow
def test_intervals_hold_what_a_warming_motor_was(warm):
    motor, fit = warm
    assert all(noise.drift is not None for noise in fit.measurement.noise)
    # As if nothing had moved, they would not.
    assert missed(fit, motor.elements, np.sqrt(np.diag(fit.covariance)))
    assert missed(fit, motor.elements, np.sqrt(np.diag(fit.shown_covariance))) == []
    # No more than what moved: the inductance of the winding is as well known as before, nothing is off by more than what Ra went through.
    names = [parameter.name for parameter in fit.problem.unknowns]
    widened = np.sqrt(np.diag(fit.shown_covariance) / np.diag(fit.covariance))
    assert widened[names.index("La")] < 1.5
    assert all(fit.sigma[name] < 2 * RISES["Ra"] * fit.parameters[name] for name in names)


@pytest.mark.slow
def test_the_trend_tells_how_fast_each_element_moves(warm):
    _, fit = warm
    rows = displacements(fit.problem, fit.unknowns, fit.linearised, fit.covariance)
    names = [parameter.name for parameter in fit.problem.unknowns]
    # Ra by Ra in the short sweep: a third of all six passes' rise, half of it seen in this sweep and half in the other.
    own = np.abs(rows[:, names.index("Ra")])
    assert own.max() == pytest.approx(0.5 * RISES["Ra"], rel=0.3)


@pytest.mark.slow
def test_a_motor_that_warms_during_a_sweep_leaves_less_over(warm):
    """From the first point of each sweep to its last it warms by a sixth of all: 0.3 % of Ra, against a noise of 0.02 %."""
    _, fit = warm
    for noise in fit.measurement.noise:
        # Half a repeat, where the drift is one and a half.
        np.testing.assert_array_less(np.abs(noise.within), np.abs(noise.drift) / 3 * (1 + 1e-9))
        assert noise.within[100] == pytest.approx(0.0)
    still = [dataclasses.replace(noise, within=None) for noise in fit.measurement.noise]
    other = me.fit(None, dataclasses.replace(fit.measurement, noise=tuple(still)))
    assert fit.log_evidence > other.log_evidence + 10
    assert fit.unexplained_percent["value"] < other.unexplained_percent["value"]


def test_profile_is_as_wide_as_the_error_bar(warm):
    _, fit = warm
    interval = fit.interval("Cf")
    assert interval.high - interval.low == pytest.approx(2 * 1.96 * fit.sigma["Cf"], rel=0.15)


def test_a_motor_at_rest_is_shown_as_the_likelihood_has_it():
    rng = np.random.default_rng(5)
    sweeps = [noisy(rng, t, impedance(DAMPED, t, GRID_HZ)) for t in ("short", "open") for _ in range(3)]
    fit = me.fit(None, sweeps, analyser="none")
    assert fit.exchange is None
    np.testing.assert_array_equal(fit.shown_covariance, fit.covariance)


def test_exchanged_resonances_draw_the_same_open_circuit_curve():
    motor = SimulatedMotor.random(11)
    other = exchanged(motor.elements)
    curve, same = (impedance(values, "open", GRID_HZ) for values in (motor.elements, other))
    np.testing.assert_allclose(same, curve, rtol=1e-10)
    short, another = (impedance(values, "short", GRID_HZ) for values in (motor.elements, other))
    assert np.max(np.abs(another / short - 1)) > 0.5
    back = exchanged(other)
    assert [back[name] for name in ELEMENTS] == pytest.approx([motor.elements[name] for name in ELEMENTS], rel=1e-12)


@pytest.mark.slow
def test_intervals_of_the_open_sweep_alone_hold_both_assignments(open_alone):
    motor, fit = open_alone
    other = exchanged(fit.parameters)
    assert fit.exchange is not None
    for name in ELEMENTS:
        interval = fit.interval(name)
        for value in (motor.elements[name], other[name]):
            assert interval.low * 0.99 <= value <= interval.high * 1.01, name
            assert not fit.determined(name) or abs(value - fit.parameters[name]) <= 1.96 * fit.sigma[name], name
    assert {"La", "Ca"} <= set(fit.undetermined())
    assert any("measure the short-circuit sweep" in warning for warning in fit.warnings)
    assert any("can be exchanged" in finding.why for finding in of_the_amount(fit, fit))
    # What does not depend on the assignment is known as well as ever: both resonances together, their order not.
    assert fit.parameters["Cr"] + fit.parameters["Cf"] == pytest.approx(motor.elements["Cr"] + motor.elements["Cf"], rel=1e-2)


def test_of_two_assignments_the_winding_with_more_inductance_is_shown(open_alone):
    motor, fit = open_alone
    assert fit.parameters["La"] > exchanged(fit.parameters)["La"]
    assert fit.parameters["La"] == pytest.approx(motor.elements["La"], rel=1e-2)


def test_an_element_that_is_held_tells_the_resonances_apart(open_alone):
    motor, fit = open_alone
    held = me.fit(None, fit.measurement, held={"La": motor.elements["La"]})
    assert held.exchange is None
    assert "Ca" not in held.undetermined()


def test_both_sweeps_tell_the_resonances_apart(warm):
    assert warm[1].exchange is None


def test_an_analyser_that_is_off_as_a_whole_by_more_than_is_declared_is_within_the_error_bars() -> None:
    """As with a wrong calibration standard; a third of the tolerance is one standard deviation of what is declared."""
    rng, motor = np.random.default_rng(6), SimulatedMotor.random(11)
    percent = np.clip(GRID_HZ / 1e7, 0.075, 1.5)  # of a 4294A, basic accuracy
    gain = 1.6 * percent / 300
    sweeps = [noisy(rng, t, motor.impedance(t, GRID_HZ) * (1 + gain)) for t in ("short", "open") for _ in range(3)]
    fit = me.fit(None, [s.with_metadata(analyser="4294a") for s in sweeps])
    off = {name: (fit.parameters[name] - motor.elements[name]) / fit.sigma[name] for name in ELEMENTS}
    assert max(map(abs, off.values())) < 1.96
    # The likelihood alone is surer of it.
    names = [p.name for p in fit.problem.unknowns]
    likely = {name: fit.parameters[name] * np.sqrt(fit.covariance[names.index(name), names.index(name)]) for name in ELEMENTS}
    assert max(abs(fit.parameters[name] - motor.elements[name]) / likely[name] for name in ELEMENTS) > 2


@pytest.mark.parametrize(("analyser", "accuracy_percent", "off"), [("unknown", None, 0.004), ("unknown", 2.0, 0.015), ("none", 2.0, 0.015)])
def test_an_error_of_all_impedances_in_common_is_within_the_error_bars(analyser, accuracy_percent, off) -> None:
    """A common factor leaves nothing in the fit: only what is known of the analyser, or what the owner states, limits it."""
    rng, motor = np.random.default_rng(6), SimulatedMotor.random(11)
    stated = {"analyser": analyser} | ({} if accuracy_percent is None else {"accuracy_percent": accuracy_percent})
    sweeps = [noisy(rng, t, motor.impedance(t, GRID_HZ) * (1 + off)) for t in ("short", "open") for _ in range(3)]
    fit = me.fit(None, [s.with_metadata(**stated) for s in sweeps])
    for name in ELEMENTS:
        assert abs(fit.parameters[name] - motor.elements[name]) < 1.96 * fit.sigma[name]
        assert fit.sigma[name] >= 0.25 * off * motor.elements[name]


def test_an_ideal_analyser_has_no_error_in_common(warm) -> None:
    assert warm[1].measurement.scale_sigma == 0
