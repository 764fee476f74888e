"""A further effect never fits worse than the circuit without it: if the data exclude it, it vanishes."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import simulated_sweeps
from workbench_tools import make_fitted_session

import motoremi as me
from motoremi.diagnosis.ladder_step import ladder_step
from motoremi.fitting.refit import followed
from motoremi.fitting.result import restore
from motoremi.fitting.trail import trail_to
from motoremi.model.circuit import Tape
from motoremi.model.effects import add_effects
from motoremi.workbench import desk
from motoremi.workbench.desk import Desk


@pytest.fixture(scope="module")
def ladder() -> list[me.Fit]:
    """Little noise, so that whatever is wrong is far above it."""
    steps = [me.fit(None, simulated_sweeps(7, ("eddy-laminations",), repeats=12)[0], analyser="4294a")]
    for effect in ("eddy-laminations", "lead-inductance", "dielectric-relaxation@Cf", "core-loss", "proximity-effect"):
        steps.append(steps[-1].add(effect))
    return steps


@pytest.mark.slow
def test_no_step_of_a_ladder_is_worse_than_the_one_before(ladder):
    assert all(fit.converged for fit in ladder)
    assert ladder[1].rms_error_percent < 0.34
    for before, after in pairwise(ladder):
        assert after.rms_error_percent <= 1.05 * before.rms_error_percent, after.effects[-1]


@pytest.mark.slow
def test_what_vanishes_is_held_and_told(ladder):
    before, after = ladder[1:3]
    # 15 nH of leads, the least of the catalogue, would be more than these sweeps have.
    assert after.held["lead-inductance.inductance_h"] == 0.0
    assert {name: after.parameters[name] for name in before.parameters} == before.parameters
    assert (after.sigma["Ra"], after.log_evidence) == (pytest.approx(before.sigma["Ra"], rel=1e-3), before.log_evidence)
    told = [text for text in after.warnings if text.startswith("lead-inductance: ")]
    assert len(told) == 1
    assert "the error would rise from 0.33 to" in told[0]
    assert not any(text.startswith("lead-inductance: ") for text in before.warnings)
    assert ladder_step(before, after).unneeded == ("lead-inductance",)


@pytest.mark.slow
def test_it_can_be_stored_dropped_and_stays_vanished(ladder):
    before, after = ladder[1:3]
    again = restore(after.to_dict(), after.measurement)
    assert (again.parameters, again.held, again.warnings) == (after.parameters, after.held, after.warnings)
    assert again.rms_error_percent == pytest.approx(after.rms_error_percent, rel=1e-9)
    dropped = after.drop("lead-inductance")
    assert dropped.held == {}
    assert dropped.rms_error_percent == pytest.approx(before.rms_error_percent, rel=0.01)
    assert ladder[-1].held["lead-inductance.inductance_h"] == 0.0


@pytest.mark.slow
def test_an_effect_that_is_asked_for_as_it_is_stays(ladder):
    held = ladder[1].add("lead-inductance", {"lead-inductance.inductance_h": 1e-6})
    assert held.parameters["lead-inductance.inductance_h"] == 1e-6
    assert held.rms_error_percent > 1.0


@pytest.mark.slow
def test_a_page_keeps_of_a_diagnosis_what_the_command_would_add(tmp_path, monkeypatch):
    """The search tries an effect within its range, whatever comes of it."""
    session = Desk(make_fitted_session(tmp_path / "s"))
    searched = followed(trail_to(session.top, "suppressor-capacitor@frame"), session.top)
    assert searched.rms_error_percent > 1.05 * session.top.rms_error_percent
    found = SimpleNamespace(base=session.top, candidates=(SimpleNamespace(effect="suppressor-capacitor@frame", fit=searched),))
    monkeypatch.setattr(desk, "diagnose_session", lambda *_, **__: found)
    session.diagnose()
    assert session.prepared("suppressor-capacitor@frame").parameters == session.top.add("suppressor-capacitor@frame").parameters


@pytest.mark.slow
def test_a_fit_of_an_earlier_version_is_restored_without_what_its_laws_have_been_given_since():
    """Then a terminal capacitance had no loss, and was held at zero if the data excluded it."""
    sweeps, _ = simulated_sweeps(3, ("terminal-capacitance",), repeats=1)
    label = "terminal-capacitance"
    fitted = me.fit(add_effects(me.dc_motor(), [label]), sweeps, held={f"{label}.tan_delta": 1e-4})
    stored = fitted.to_dict()
    del stored["parameters"][f"{label}.tan_delta"], stored["held"][f"{label}.tan_delta"]
    again = restore(stored, fitted.measurement)
    assert again.parameters == pytest.approx(dict(fitted.parameters), rel=1e-9)
    assert again.rms_error_percent == pytest.approx(fitted.rms_error_percent, rel=1e-9)
    stored["parameters"][f"{label}.capacitance_f"]["value"] = stored["held"][f"{label}.capacitance_f"] = 0.0
    without = {name: value for name, value in fitted.parameters.items() if not name.startswith(label)}
    s = 2j * np.pi * sweeps[0].frequency_hz
    names = [p.name for p in me.dc_motor().parameters]
    plain = Tape(me.dc_motor().circuit("short"), names).impedance(s, np.array([without[name] for name in names]))
    np.testing.assert_allclose(restore(stored, fitted.measurement).model_ohm("short", sweeps[0].frequency_hz), plain, rtol=1e-9)
