"""An analyser that was declared ideal is doubted: no effect is named for the errors that every real one has."""

from __future__ import annotations

from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest
from few_effects import FEW, seeking
from paper_circuit import DAMPED, impedance

import motoremi as me
from motoremi.data.analyser import find_analyser
from motoremi.data.sweep import TERMINATIONS, ImpedanceSweep
from motoremi.diagnosis.declared import likeliest
from motoremi.diagnosis.motor_board import MotorBoard
from motoremi.simulate.analyser_errors import SimulatedAnalyser
from motoremi.simulate.simulated_motor import SimulatedMotor

FREQUENCY_HZ = np.geomspace(150e3, 30e6, 201)
pytestmark = pytest.mark.slow


def declared_ideal(seed: int, effects: tuple[str, ...] = ()) -> list[ImpedanceSweep]:
    """Three short-circuit sweeps, which show all of a winding; beside the open-circuit sweep the search would take twice as long."""
    motor, analyser = SimulatedMotor.random(seed, effects), SimulatedAnalyser(seed)
    true = motor.impedance("short", FREQUENCY_HZ)
    return [ImpedanceSweep("short", FREQUENCY_HZ, analyser.measure("short", FREQUENCY_HZ, true), metadata={"analyser": "none"}) for _ in range(3)]


@pytest.mark.parametrize(("seed", "hidden"), [(1, "core-loss"), pytest.param(2, "insulation-leakage@Ca", marks=pytest.mark.case)])
def test_a_real_analysers_errors_are_not_taken_for_the_motors(seed, hidden):
    """Both are told from each other by little; a relaxing permeability bends to what either and the analyser's errors make together."""
    with seeking({*FEW, "permeability-relaxation", "proximity-effect", "second-resonance", "field-coupling"}):
        found = me.diagnose(me.fit(me.dc_motor(), declared_ideal(seed, (hidden,))))
    assert set(found.effects) | {one for family in found.families for one in family} <= {"core-loss", "insulation-leakage@Ca"}
    assert found.verdict == "adequate" or "not-as-declared" in {finding.id for finding in found.findings}


@pytest.mark.usefixtures("catalogue")
def test_an_ideal_analyser_is_believed_where_it_is_one():
    motor = SimulatedMotor.random(3, ("core-loss",))
    noise = np.random.default_rng(3)
    sweeps = [
        ImpedanceSweep(
            name,
            FREQUENCY_HZ,
            motor.impedance(name, FREQUENCY_HZ) * (1 + 1e-4 * noise.standard_normal((2, 201)).T @ [1, 1j]),
            metadata={"analyser": "none"},
        )
        for name in TERMINATIONS
        for _ in range(3)
    ]
    found = me.diagnose(me.fit(me.dc_motor(), sweeps))
    assert "not-as-declared" not in {finding.id for finding in found.findings}
    assert found.base.measurement.analyser.ideal
    assert "core-loss" in {*found.effects, *(one for family in found.families for one in family)}


@pytest.mark.case
def test_a_cable_of_nearly_the_law_of_the_catalogue_does_not_make_the_declaration_wrong():
    """One metre of 95 ohm, whose impedance is real although it has losses: the catalogue's has the reactance that belongs to them."""
    rng = np.random.default_rng(4)
    through = np.tanh(0.3 / 8.686 * np.sqrt(FREQUENCY_HZ / 30e6) + 2j * np.pi * FREQUENCY_HZ * 5.2e-9)
    sweeps = []
    for termination in TERMINATIONS:
        motor = impedance(DAMPED, termination, FREQUENCY_HZ)
        true = 95 * (motor + 95 * through) / (95 + motor * through)
        for _ in range(3):
            noise = 2e-4 * (rng.normal(size=201) + 1j * rng.normal(size=201))
            sweeps.append(ImpedanceSweep(termination, FREQUENCY_HZ, true * (1 + noise), metadata={"analyser": "4294a"}))
    with seeking({*FEW, "supply-cable"}):
        found = me.diagnose(me.fit(me.dc_motor(), sweeps))
    assert found.effects == ("supply-cable",)
    assert "not-as-declared" not in {finding.id for finding in found.findings}


def test_a_healthy_motor_on_a_network_analyser_that_was_declared_as_an_impedance_analyser(monkeypatch):
    """Directivity, match and tracking of 0.1 % each: at large |Z| several per cent of it, far more than a 4294A errs.

    No pair of effects is compared before the other analyser is asked for, which would take most of the time.
    """
    monkeypatch.setattr(MotorBoard, "leading_pairs", lambda *_: pytest.fail("pairs were compared"))
    rng = np.random.default_rng((21, 1))

    def error():
        constant, slope = 1e-3 * (rng.normal(size=2) + 1j * rng.normal(size=2))
        return constant + slope * np.log(FREQUENCY_HZ / 1e6) / 3

    directivity, match, tracking = error(), error(), error()
    sweeps = []
    for termination in TERMINATIONS:
        true = impedance(DAMPED, termination, FREQUENCY_HZ)
        reflection = (true - 50) / (true + 50)
        read = directivity + (1 + tracking) * reflection / (1 - match * reflection)
        for _ in range(3):
            noisy = read + 1e-4 * (rng.normal(size=201) + 1j * rng.normal(size=201))
            sweeps.append(ImpedanceSweep(termination, FREQUENCY_HZ, 50 * (1 + noisy) / (1 - noisy), metadata={"analyser": "4294a"}))
    with seeking(FEW):
        found = me.diagnose(me.fit(me.dc_motor(), sweeps))
    assert found.verdict == "adequate"
    assert "not-as-declared" in {finding.id for finding in found.findings}


def test_data_that_are_good_enough_deny_nothing_of_an_analyser_without_a_name() -> None:
    """An air coil within the stated accuracy was taken for measured with a NanoVNA, and a core was the first candidate."""
    fit = SimpleNamespace(measurement=SimpleNamespace(accuracy_percent=5.0), explained=True, analyser_sigma=50.0)
    declared = SimpleNamespace(measurement=SimpleNamespace(analyser=find_analyser("unknown"), remark=""))
    first = SimpleNamespace(described=False, acceptance="explained", base=declared, best=SimpleNamespace(fit=fit), model=SimpleNamespace(fit=fit))
    with mock.patch("motoremi.diagnosis.declared.hypotheses", side_effect=AssertionError("others are tried")):
        assert likeliest(first).judgement is first
        declared.measurement.analyser = find_analyser("4294a")
        with pytest.raises(AssertionError, match="others are tried"):
            likeliest(first)
