"""An effect as it would show on a user's motor."""

from __future__ import annotations

import json

import numpy as np
import pytest
from conftest import simulated_sweeps

import motoremi as me
from motoremi.inspection.effect_signature import signature
from motoremi.model.effects import find_effect, identifiers

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def fit():
    return me.fit(me.dc_motor(), simulated_sweeps(4)[0])


@pytest.mark.parametrize("effect", identifiers())
def test_every_effect_has_a_signature_that_a_refit_bears_out(fit, effect):
    found = signature(fit, effect)
    assert 1 <= len(found.sizes) <= 3
    for size in found.sizes:
        # Adapting the elements never makes the weighted change larger.
        weight = np.concatenate([1 / noise.sigma for noise in fit.measurement.noise])
        change, left = (np.concatenate(list(one.values())) for one in (size.change, size.remaining))
        assert np.all(np.isfinite(change))
        assert 0 < np.linalg.norm(left * weight) <= np.linalg.norm(change * weight) * (1 + 1e-9)
    json.dumps(found.to_dict(), allow_nan=False)


def test_the_change_is_that_of_the_model(fit):
    found = signature(fit, "core-loss")
    motor = find_effect("core-loss").added_to(fit.motor)
    assert motor.effects == ("core-loss",)
    size = found.sizes[0]
    s = 2j * np.pi * found.frequency_hz["short"]
    value = fit.parameters
    branch = s * value["La"] * size.parameters["resistance_ohm"] / (s * value["La"] + size.parameters["resistance_ohm"])
    with_loss = 1 / (1 / (value["Ra"] + branch) + s * value["Ca"])
    assert np.allclose(np.exp(size.change["short"]), with_loss / fit.model_ohm("short"))


def test_what_the_elements_can_take_over_is_taken():
    """A lead's inductance and resistance far below the winding's look like a little more of them at low frequency."""
    fit = me.fit(me.dc_motor(), [s for s in simulated_sweeps(4)[0] if s.termination == "short"])
    size = signature(fit, "brush-contact").sizes[0]
    assert np.abs(size.remaining["short"]).max() < 0.5 * np.abs(size.change["short"]).max()
    with pytest.raises(me.BadInput, match="none of these sweeps"):
        signature(fit, "dielectric-loss@Cf")


def test_an_effect_in_the_model_is_shown_as_fitted():
    fit = me.fit(me.dc_motor(), simulated_sweeps(905, ("core-loss",))[0]).add("core-loss")
    (size,) = signature(fit, "core-loss").sizes
    assert size.parameters["resistance_ohm"] == fit.parameters["core-loss.resistance_ohm"]
    assert len(signature(fit, "core-loss").plot().axes) == 4


@pytest.mark.parametrize("termination", ["short", "open"])
def test_of_an_effect_with_a_value_for_each_sweep_one_sweep_shows_one(termination):
    alone = me.fit(me.dc_motor(), [sweep for sweep in simulated_sweeps(4)[0] if sweep.termination == termination])
    added = alone.add("contact-resistance")
    for found in (signature(alone, "contact-resistance"), signature(added, "contact-resistance")):
        assert found.sizes
        assert all(set(size.parameters) == {f"{termination}_ohm"} for size in found.sizes)
