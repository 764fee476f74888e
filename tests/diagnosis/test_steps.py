"""Steps of gain: found where they are, on simulated sweeps and on a real motor's, and hardly ever where they are not."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import FREQUENCY_HZ, simulated_sweeps

import motoremi as me
from motoremi.diagnosis.steps import find_steps

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(("seed", "at", "size"), [(4, 610.75e3, 0.01), (5, 1.2655e6, -0.004 + 0.004j), (7, 5.36e6, 0.02j)])
def test_a_step_in_both_sweeps_is_found_between_its_points(seed, at, size):
    index = int(np.argmin(np.abs(FREQUENCY_HZ - at)))
    gain = np.exp(size * (FREQUENCY_HZ[index] <= FREQUENCY_HZ))
    sweeps = [me.ImpedanceSweep(s.termination, s.frequency_hz, s.impedance_ohm * gain) for s in simulated_sweeps(seed)[0]]
    first, second, *_ = find_steps(me.fit(me.dc_motor(), sweeps))
    assert {first.termination, second.termination} == {"short", "open"}
    for step in (first, second):
        assert (step.below_hz, step.above_hz) == (FREQUENCY_HZ[index - 1], FREQUENCY_HZ[index])
        assert abs(step.step - size) < 0.3 * abs(size)


def test_structure_that_the_model_lacks_is_no_step():
    """At most the simulated analyser's own step at 15 MHz, which is within its specification, and one chance find among 16 sweeps."""
    others = 0
    for seed in range(8):
        effect = ("second-resonance", "field-coupling")[seed % 2]
        steps = find_steps(me.fit(me.dc_motor(), simulated_sweeps(seed, (effect,))[0]))
        others += sum(not step.below_hz < 15e6 <= step.above_hz for step in steps)
    assert others <= 1
