"""Motors of which only the open-circuit sweep was measured: the model with the hidden effect describes it."""

from __future__ import annotations

import itertools

import pytest

from motoremi.blind.departures import HardCase
from motoremi.fitting.fit import fit
from motoremi.model.motor import dc_motor

MOTORS = 3


@pytest.mark.slow
@pytest.mark.parametrize("effect", ["field-coupling", "permeability-relaxation", "bearing-film"])
def test_an_effect_is_fitted_to_the_open_sweep_alone(effect):
    cases = (HardCase(1, 0, "one-termination", (effect,), seed) for seed in itertools.count(1))
    sweeps = [sweeps for case in itertools.islice(cases, 4 * MOTORS) if (sweeps := case.sweeps())[0].termination == "open"][:MOTORS]
    assert len(sweeps) == MOTORS
    assert [fit(dc_motor(), each).add(effect).marginal.nothing_left > 0.5 for each in sweeps] == [True] * MOTORS
