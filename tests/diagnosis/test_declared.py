"""An analyser that was declared ideal is doubted: no effect is named for the errors that every real one has."""

from __future__ import annotations

import numpy as np
import pytest
from few_effects import FEW, seeking

import motoremi as me
from motoremi.data.sweep import TERMINATIONS, ImpedanceSweep
from motoremi.simulate.analyser_errors import SimulatedAnalyser
from motoremi.simulate.simulated_motor import SimulatedMotor

FREQUENCY_HZ = np.geomspace(150e3, 30e6, 201)
pytestmark = pytest.mark.slow


def declared_ideal(seed: int, effects: tuple[str, ...] = ()) -> list[ImpedanceSweep]:
    """Three short-circuit sweeps, which show all of a winding; beside the open-circuit sweep the search would take twice as long."""
    motor, analyser = SimulatedMotor.random(seed, effects), SimulatedAnalyser(seed)
    true = motor.impedance("short", FREQUENCY_HZ)
    return [ImpedanceSweep("short", FREQUENCY_HZ, analyser.measure("short", FREQUENCY_HZ, true), metadata={"analyser": "none"}) for _ in range(3)]


@pytest.mark.parametrize(("seed", "hidden"), [(1, "core-loss"), (2, "insulation-leakage@Ca")])
def test_a_real_analysers_errors_are_not_taken_for_the_motors(seed, hidden):
    """Both are told from each other by little; a relaxing permeability bends to what either and the analyser's errors make together."""
    with seeking({*FEW, "permeability-relaxation", "proximity-effect", "second-resonance", "field-coupling"}):
        found = me.diagnose(me.fit(me.dc_motor(), declared_ideal(seed, (hidden,))))
    assert set(found.effects) | {one for family in found.families for one in family} <= {"core-loss", "insulation-leakage@Ca"}
    assert found.verdict == "adequate" or "not-as-declared" in {finding.id for finding in found.findings}


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
