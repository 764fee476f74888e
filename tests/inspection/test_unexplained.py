"""What is said where nothing explains the data: the floor of any causal model, where the rest is, and where to look."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from conftest import FREQUENCY_HZ, simulated_sweeps

import motoremi as me
from motoremi.diagnosis.findings import of_the_sweeps
from motoremi.inspection import causal
from motoremi.inspection.unexplained import Remainder, remainder

pytestmark = pytest.mark.slow


def left(sweeps: list[me.ImpedanceSweep]) -> tuple[Remainder, str]:
    fit = me.fit(me.dc_motor(), sweeps)
    found = remainder(fit, fit)
    return found, "; ".join(found.reasons)


@pytest.mark.parametrize(
    ("effect", "elements"),
    [
        # In series: whatever La may be as a function of frequency, Ra may be instead. Likewise a film in the rotor's branch.
        ("outside-rotor-coupling", {"La", "Ra"}),
        ("dielectric-relaxation@Cf", {"Cf"}),
        ("dielectric-loss@Ca", {"Ca"}),
        ("bearing-film", {"Rr", "Cr", "Cf"}),
    ],
)
def test_missing_physics_points_to_its_element_and_names_the_floor(effect, elements):
    found, said = left(simulated_sweeps(903, (effect,))[0])
    assert found.inspect[0] in elements
    assert f"--element {found.inspect[0]}" in said
    for termination, model in found.causality.models.items():
        # The noise is known from three repeats a point, pooled: to about 5 %.
        assert model.noise_multiple == pytest.approx(1.0, abs=0.1)
        assert found.noise_multiple[termination] > 5
        assert found.spans_hz[termination]
    assert "times the noise" in said
    assert not found.about_the_data
    assert json.loads(json.dumps(found.to_dict(), allow_nan=False))["inspect"] == list(found.inspect)


def test_the_span_is_where_the_effect_is():
    """A narrow resonance in the winding, far from the motor's own."""
    sweeps, _ = simulated_sweeps(1)
    bump = 1 + 0.2 / (1 + 20j * (FREQUENCY_HZ / 1e6 - 1e6 / FREQUENCY_HZ))
    found, _ = left([dataclasses.replace(s, impedance_ohm=s.impedance_ohm * bump) for s in sweeps])
    for spans in found.spans_hz.values():
        low, high = spans[0][0], spans[-1][1]
        assert low < 1e6 < high
        assert high / low < 6


def test_sweeps_of_two_motors_are_about_the_data():
    one, other = simulated_sweeps(1)[0], simulated_sweeps(2)[0]
    found, said = left([s for s in one if s.termination == "short"] + [s for s in other if s.termination == "open"])
    assert found.about_the_data
    assert "fit alone, not together" in said
    assert "--element" not in said


def test_single_bad_points_are_about_the_data():
    """A causal model that describes all points but two near the ends, which were not held against their neighbours, shows that those are wrong."""
    spikes = np.ones(FREQUENCY_HZ.size)
    spikes[[3, -4]] = 1.05, 0.96
    found, said = left(
        [dataclasses.replace(s, impedance_ohm=s.impedance_ohm * spikes) if s.termination == "open" else s for s in simulated_sweeps(1)[0]]
    )
    assert found.about_the_data
    assert found.together is None
    assert "open" in said.splitlines()[0]


def test_a_diagnosis_of_data_that_contradict_themselves_carries_the_remainder():
    """What is wrong with the data comes first."""
    one, other = simulated_sweeps(1)[0], simulated_sweeps(2)[0]
    fit = me.fit(me.dc_motor(), [s for s in one if s.termination == "short"] + [s for s in other if s.termination == "open"])
    rest = remainder(fit, fit)
    diagnosis = me.Diagnosis(
        verdict="data",
        effects=(),
        families=(),
        confidence=0.9,
        base=fit,
        best=fit,
        candidates=(),
        probabilities={},
        posterior={(): 1.0},
        steps=(fit,),
        where=(),
        findings=tuple(of_the_sweeps(rest)),
        following={"id": "repeat", "why": "repeat"},
        reasons=("something is missing",),
        left_over=rest,
    )
    plain = json.loads(json.dumps(diagnosis.to_dict(), allow_nan=False))
    assert "fit alone, not together" in plain["reasons"][0]
    assert "something is missing" in plain["reasons"]
    assert plain["remainder"]["together"]["belong"] is False
    assert "remainder" not in dataclasses.replace(diagnosis, left_over=None).to_dict()


def test_a_causal_model_that_is_worse_than_a_circuit_shows_nothing(monkeypatch):
    """The vector fit is kept from finding more than two poles, which the motor's circuit beats."""
    monkeypatch.setattr(causal, "MOST_PAIRS", 1)
    fit = me.fit(me.dc_motor(), simulated_sweeps(1)[0])
    found = remainder(fit, fit)
    assert not found.causality.causal
    assert not found.causality.disproved
    assert not found.about_the_data
    assert "shows nothing about the data" in "; ".join(found.reasons)


def test_a_single_short_sweep_with_a_spread_capacitance_has_a_remainder():
    """Spread along the winding, Cf shows in the short sweep while Cr does not."""
    sweeps = [s for s in simulated_sweeps(3, ("distributed-winding",))[0] if s.termination == "short"]
    fit = me.fit(me.dc_motor(), sweeps).add("distributed-winding")
    assert "Cr" not in fit.parameters
    assert set(remainder(fit, fit).inspect) <= {"Ra", "La", "Ca", "Cf"}
