"""Searches behind a fixture that nobody compensated: what a network analyser at its own connector sees of a motor."""

from __future__ import annotations

import dataclasses
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from motoremi.blind.sealed import HandheldAnalyser
from motoremi.data.measurement import Measurement
from motoremi.data.sweep import TERMINATIONS, ImpedanceSweep
from motoremi.diagnosis.candidates import Candidate, possible_effects
from motoremi.diagnosis.findings import of_the_analyser
from motoremi.fitting.fit import fit
from motoremi.fitting.problem import Problem
from motoremi.fitting.race import SINGLES, Best, race
from motoremi.fitting.result import Fit
from motoremi.fitting.search import rough
from motoremi.fitting.trail import trail_to
from motoremi.model.motor import dc_motor
from motoremi.simulate.simulated_motor import SimulatedMotor

# A motor whose proximity effect was lost in the race behind 30 nH of fixture.
MOTOR_SEED = 20261123


@cache
def sweeps() -> tuple[ImpedanceSweep, ...]:
    motor, analyser = SimulatedMotor.random(MOTOR_SEED, ("proximity-effect",)), HandheldAnalyser(5)
    frequency = np.geomspace(150e3, 30e6, 201)
    found = []
    for number, termination in enumerate(TERMINATIONS):
        seen = analyser.measure(termination, frequency, motor.impedance(termination, frequency), number)
        found.append(ImpedanceSweep(termination, frequency, seen, metadata={"analyser": "nanovna"}))
    return tuple(found)


@cache
def base() -> Fit:
    return fit(dc_motor(), Measurement.of(sweeps()))


@pytest.mark.slow
def test_a_search_knows_the_fixture_and_the_error_that_is_shown_does_not() -> None:
    log, relative = (Problem(dc_motor(), base().measurement, weights=weights) for weights in ("log", "relative"))
    assert [p.name for p in log.unknowns[7:]] == ["fixture R", "fixture L", "fixture G", "fixture C"]
    assert len(relative.unknowns) == 7
    # Three standard deviations of what a fixture of a few centimetres has.
    assert (log.low[7:], log.high[7:]) == (pytest.approx([-3.0] * 4), pytest.approx([3.0] * 4))


@pytest.mark.slow
def test_where_the_analyser_sees_nothing_a_point_counts_less() -> None:
    problem = Problem(dc_motor(), base().measurement, weights="log")
    systematic, weight = problem.observed.systematic, problem.observed.weight
    assert weight == pytest.approx(1 / np.hypot(1, systematic / 0.1))
    assert weight[np.argmax(systematic)] < 0.9 < weight.max()


@pytest.mark.slow
def test_a_loss_of_the_winding_arrives_behind_the_fixture() -> None:
    trails = {name: trail_to(base(), name) for name in possible_effects(base())}
    solutions = race(trails, SINGLES).solutions
    behind = Best().behind(solutions)
    assert min((name for name in solutions if not solutions[name].rough), key=lambda name: behind[name]) in (
        "proximity-effect",
        "eddy-laminations",
        "skin-effect",
    )
    assert behind["proximity-effect"] < 15


def weighed_with(error: np.ndarray | float) -> tuple[Problem, float]:
    """The rough evidence of the true circuit where a network analyser errs by so much, relative to Z."""
    plain = SimulatedMotor.random(MOTOR_SEED, ())
    frequency = np.geomspace(150e3, 30e6, 201)
    seen = np.concatenate([plain.impedance(t, frequency) for t in TERMINATIONS]) * (1 + error)
    sweeps = [ImpedanceSweep(t, frequency, z, metadata={"analyser": "nanovna"}) for t, z in zip(TERMINATIONS, np.split(seen, 2), strict=True)]
    problem = Problem(dc_motor(), Measurement.of(sweeps), weights="log")
    u = problem.vector({**plain.elements, **dict.fromkeys(("fixture R", "fixture L", "fixture G", "fixture C"), 0.0)})
    nothing = dataclasses.replace(base().marginal, log_evidence=-np.inf)
    return problem, rough(nothing, problem, u).log_evidence


@pytest.mark.slow
def test_a_circuit_that_errs_less_than_the_analyser_may_is_hardly_likelier() -> None:
    """One that errs by nothing at all is little likelier than one that errs as much as the analyser may; not so one that errs ten times that."""
    problem, perfect = weighed_with(0.0)
    # Far from 50 Ohm it may err by several times Z.
    allowed = np.minimum(problem.observed.systematic, 0.05)
    erring, far = (weighed_with(times * allowed)[1] for times in (1.0, 10.0))
    assert abs(perfect - erring) < 0.1 * (perfect - far)
    assert perfect - far > 50


@pytest.mark.slow
def test_a_fixture_of_a_long_lead_leaves_something_for_an_effect() -> None:
    """Of 410 nH, where a fixture of a few centimetres has 30 nH."""
    nothing_left = dataclasses.replace(base(), marginal=SimpleNamespace(nothing_left=1.0), analyser_sigma=1.0)  # type: ignore[arg-type]
    assert Candidate((), dataclasses.replace(nothing_left, nuisance={**base().nuisance, "fixture L": 30e-9}), 0.0, ()).done
    assert not Candidate((), dataclasses.replace(nothing_left, nuisance={**base().nuisance, "fixture L": 410e-9}), 0.0, ()).done
    findings = of_the_analyser(dataclasses.replace(base(), nuisance={**base().nuisance, "fixture L": 410e-9}), accepted=True)
    (why,) = (finding.why for finding in findings if finding.id == "not-compensated")
    assert "L = 410 nH" in why
    assert "up to 14 times what a fixture of a few centimetres has" in why


@pytest.mark.slow
def test_a_network_analyser_switches_no_ranges_of_impedance() -> None:
    assert "range-step" not in possible_effects(base())
    assert "gain-error" in possible_effects(base())
