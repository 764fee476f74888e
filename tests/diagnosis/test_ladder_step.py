"""Steps of the ladder: errors per band, what parameters did, effects that lose their support."""

from __future__ import annotations

import json

import pytest
from conftest import FREQUENCY_HZ, simulated_sweeps

import motoremi as me
from motoremi.data.session import SessionWriter, load
from motoremi.diagnosis.ladder_step import ladder_step
from motoremi.simulate.simulated_motor import SimulatedMotor
from motoremi.workflow import add_to_session, drop_from_session, fit_session, opened

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def steps():
    """A motor whose core loss the base model has to lump into Ra."""
    sweeps, motor = simulated_sweeps(905, ("core-loss",))
    base = me.fit(me.dc_motor(), sweeps)
    return base, base.add("core-loss"), motor.truth()["elements"]["Ra"]


def test_ra_that_shrinks_back_to_its_dc_value_is_told(steps):
    base, better, truth = steps
    assert base.parameters["Ra"] > 1.2 * truth
    (told,) = [note for note in ladder_step(base, better, truth).notes if note.startswith("Ra")]
    assert "falls" in told
    assert "back at its DC value" in told
    (other,) = [note for note in ladder_step(base, better, 10 * truth).notes if note.startswith("Ra")]
    assert "back" not in other
    (unmeasured,) = [note for note in ladder_step(base, better).notes if note.startswith("Ra")]
    assert "losses of core-loss" in unmeasured


def test_a_step_has_its_errors_and_parameters_before_and_after(steps):
    base, better, _ = steps
    step = json.loads(json.dumps(ladder_step(base, better).to_dict(), allow_nan=False))
    assert step["added"] == "core-loss"
    assert step["unneeded"] == []
    bands = {(band["sweep"], band["band_hz"][0]): band for band in step["bands"]}
    assert len(bands) == 8
    for band in bands.values():
        assert band["rms_error_percent"] < band["rms_error_percent_before"]
    changes = {change["name"]: change for change in step["changes"]}
    assert changes["La"]["before"] == base.parameters["La"]
    assert changes["La"]["after"] == better.parameters["La"]
    assert changes["core-loss.resistance_ohm"]["before"] is None


def test_what_the_data_do_not_ask_for_is_unneeded(steps):
    _, better, _ = steps
    step = ladder_step(better, better.add("insulation-leakage@Cf"))
    assert step.unneeded == ("insulation-leakage@Cf",)
    assert any("is not needed" in note for note in step.notes)


def test_a_wrong_effect_loses_its_support_when_the_right_one_comes(steps):
    base, _, _ = steps
    first = base.add("dielectric-loss@Ca")
    assert ladder_step(base, first).unneeded == ()
    step = ladder_step(first, first.add("core-loss"))
    assert step.unneeded == ("dielectric-loss@Ca",)
    assert any("no longer needed" in note for note in step.notes)


def test_the_session_keeps_the_details_of_each_step(tmp_path):
    sweeps, motor = simulated_sweeps(905, ("core-loss",))
    assert isinstance(motor, SimulatedMotor)
    assert sweeps[0].frequency_hz.size == FREQUENCY_HZ.size
    path = tmp_path / "s"
    with SessionWriter.create(path, {"title": "ladder"}) as writer:
        for sweep in sweeps:
            writer.add_sweep(sweep.with_metadata(dc_resistance_ohm=f"{motor.truth()['elements']['Ra']} Ohm"))
        writer.close("done")
    with opened(path) as store:
        fit_session(store)
        add_to_session(store, "core-loss")
    base, step = load(path).ladder
    assert (base["added"], base["unneeded"]) == (None, [])
    assert step["added"] == "core-loss"
    assert any("back at its DC value" in note for note in step["notes"])
    with opened(path) as store:
        drop_from_session(store)
    assert load(path).ladder == [base]
