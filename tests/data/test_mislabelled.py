"""Sweeps that were measured with the wrong termination."""

from __future__ import annotations

import numpy as np
import pytest

from motoremi.data.measurement import Measurement
from motoremi.data.mislabelled import measured_twice
from motoremi.data.sweep import ImpedanceSweep
from motoremi.diagnosis.diagnosis import diagnose
from motoremi.fitting.fit import fit
from motoremi.model.motor import dc_motor
from motoremi.simulate.analyser_errors import SimulatedAnalyser
from motoremi.simulate.simulated_motor import SimulatedMotor

FREQUENCY = np.geomspace(150e3, 30e6, 101)
MOTOR = SimulatedMotor.random(11, ())


def taken(termination: str, named: str, connection: int) -> ImpedanceSweep:
    """A sweep of one termination under the name of another or the same, on a connection of its own."""
    seen = SimulatedAnalyser(7).measure(termination, FREQUENCY, MOTOR.impedance(termination, FREQUENCY), connection=connection)
    return ImpedanceSweep(named, FREQUENCY, seen, metadata={"analyser": "4294a"})


SHORT = taken("short", "short", 1)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_a_repeat_that_is_the_other_termination_is_left_out_whenever_it_was_taken(order):
    opened = [taken("short", "open", 2), taken("open", "open", 3)]
    measurement = Measurement.of([SHORT, *(opened[place] for place in order)])

    assert measurement.mislabelled == ("open",)
    assert measurement.sweeps[1].repeats == 1
    np.testing.assert_array_equal(measurement.sweeps[1].mean_ohm, opened[1].impedance_ohm)
    assert measured_twice(measurement.sweeps, measurement.floors) is None


def test_where_both_terminations_are_nearly_the_same_every_repeat_is_used():
    """Behind a filter they differ by 1 to 3 %, and repeats of one of them by 2 %."""
    ohm = SHORT.impedance_ohm
    shorts = [ImpedanceSweep("short", FREQUENCY, (1 + away) * ohm) for away in (0.0, 0.02)]
    opened = [ImpedanceSweep("open", FREQUENCY, (1 + away) * ohm) for away in (0.01, 0.05)]
    assert Measurement.of([*shorts, *opened]).mislabelled == ()


@pytest.mark.slow
def test_what_was_left_out_is_a_finding_and_changes_no_verdict():
    found = diagnose(fit(dc_motor(), [SHORT, taken("open", "open", 3), taken("short", "open", 2)]))

    told = [finding for finding in found.findings if finding.id == "not-as-asked"]
    assert found.verdict == "adequate"
    assert [(finding.sweep, finding.serious) for finding in told] == [("open", False)]


def test_of_two_inductive_sweeps_the_open_one_is_wrong_and_of_two_capacitive_ones_the_short_one():
    inductive = Measurement.of([SHORT, taken("short", "open", 2)])
    capacitive = Measurement.of([taken("open", "short", 1), taken("open", "open", 2)])

    assert measured_twice(inductive.sweeps, inductive.floors).wrong == "open"
    assert measured_twice(capacitive.sweeps, capacitive.floors).wrong == "short"
    assert inductive.mislabelled == capacitive.mislabelled == ()


def test_sweeps_without_a_common_band_are_not_the_same():
    high = np.geomspace(40e6, 60e6, 31)
    elsewhere = ImpedanceSweep("open", high, MOTOR.impedance("short", high))

    assert measured_twice(Measurement.of([SHORT, elsewhere]).sweeps, Measurement.of([SHORT, elsewhere]).floors) is None
