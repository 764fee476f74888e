"""Two sweeps of one termination under two names are no motor's: the finding says so, and no motor's own pair of sweeps is taken for it."""

from __future__ import annotations

import numpy as np
import pytest
from few_effects import seeking

import motoremi as me
from motoremi.data.measurement import Measurement
from motoremi.data.sweep import ImpedanceSweep
from motoremi.diagnosis.findings import the_same_twice
from motoremi.export.realise import impedance_of
from motoremi.simulate.analyser_errors import SimulatedAnalyser
from motoremi.simulate.simulated_motor import SimulatedMotor

FREQUENCY_HZ = np.geomspace(150e3, 30e6, 201)


def measured(seed: int, termination: str, as_termination: str, connection: int) -> ImpedanceSweep:
    motor, analyser = SimulatedMotor.random(seed), SimulatedAnalyser(seed)
    ohm = analyser.measure(termination, FREQUENCY_HZ, motor.impedance(termination, FREQUENCY_HZ), connection)
    return ImpedanceSweep(as_termination, FREQUENCY_HZ, ohm, metadata={"analyser": "4294a"})


@pytest.mark.usefixtures("catalogue")
@pytest.mark.slow
@pytest.mark.parametrize("twice", ["short", pytest.param("open", marks=pytest.mark.case)])
def test_one_sweep_under_two_names_is_told_and_nothing_is_named(twice):
    # Motors 7 to 10 are all answered like this; 8 is the quickest.
    sweeps = [measured(8, twice, "short", 0), measured(8, twice, "open", 1)]
    found = me.diagnose(me.fit(me.dc_motor(), sweeps))
    assert found.verdict == "data"
    assert found.effects == ()
    assert "sweeps-disagree" in {finding.id for finding in found.findings if finding.serious}
    assert "measured twice" in str(found)


@pytest.mark.usefixtures("catalogue")
@pytest.mark.slow
def test_no_motors_own_sweeps_are_taken_for_it():
    for seed in range(200):
        assert the_same_twice(Measurement.of([measured(seed, "short", "short", 0), measured(seed, "open", "open", 1)])) is None


@pytest.mark.parametrize("seed", [1, 28, 33, 41])
def test_a_pair_of_suppressors_hides_the_far_end_at_most_points_and_is_no_sweep_measured_twice(seed):
    motor, analyser, frequency_hz = (
        SimulatedMotor.random(seed, ("suppressor-capacitor@pair",)),
        SimulatedAnalyser(seed),
        np.linspace(150e3, 30e6, 401),
    )
    sweeps = [
        ImpedanceSweep(
            name, frequency_hz, analyser.measure(name, frequency_hz, motor.impedance(name, frequency_hz), at), metadata={"analyser": "4294a"}
        )
        for at, name in enumerate(("short", "open"))
    ]
    short, opened = (sweep.impedance_ohm for sweep in sweeps)
    assert np.quantile(np.abs(np.log(short / opened)), 0.9) < 0.02
    assert the_same_twice(Measurement.of(sweeps)) is None


@pytest.mark.usefixtures("catalogue")
@pytest.mark.slow
def test_one_motor_whose_sweeps_hardly_differ_is_not_said_to_be_measured_twice():
    """A frame of a hundred times the winding's capacitance, on an analyser that errs by more than the sweeps differ: one circuit describes both."""
    frequency_hz = np.linspace(1e6, 50e6, 101)
    elements = {"Ra": 60.0, "La": 0.8e-3, "Ca": 10e-12, "Rr": 20.0, "Lr": 1.2e-6, "Cr": 0.4e-9, "Cf": 1e-9}
    rng = np.random.default_rng(3)
    sweeps = []
    for termination in ("short", "open"):
        circuit = me.dc_motor().circuit(termination)
        true = impedance_of(circuit, elements, frequency_hz)
        seen = true * (1 + 2e-4 * (rng.normal(size=101) + 1j * rng.normal(size=101)))
        sweeps.append(ImpedanceSweep(termination, frequency_hz, seen, metadata={"analyser": "nanovna"}))
    assert the_same_twice(Measurement.of(sweeps)) is not None
    assert me.diagnose(me.fit(me.dc_motor(), sweeps)).verdict == "adequate"


def test_sweeps_over_different_bands_are_compared_where_they_overlap():
    whole = measured(7, "short", "short", 0)
    part = measured(7, "short", "open", 1)
    inside = part.frequency_hz > 1e6
    again = ImpedanceSweep("open", part.frequency_hz[inside], part.impedance_ohm[inside], metadata=part.metadata)
    assert the_same_twice(Measurement.of([whole, again])) is not None


@pytest.mark.usefixtures("catalogue")
@pytest.mark.slow
def test_exchanged_sweeps_are_data_and_no_effect():
    renamed = {"short": "open", "open": "short"}
    sweeps = [measured(7, termination, renamed[termination], connection) for connection, termination in enumerate(("short", "open"))]
    with seeking():
        found = me.diagnose(me.fit(me.dc_motor(), sweeps))
    assert (found.verdict, found.effects) == ("data", ())
    assert found.findings[0].id == "sweeps-exchanged"
    assert found.reasons == (found.findings[0].why,)
    assert found.following == {"id": "repeats", "why": found.findings[0].remedy}
    assert found.question is not None
    assert found.findings[0].remedy in found.question.why
