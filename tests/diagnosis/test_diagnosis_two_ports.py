"""Diagnoses of motors between two ports: analyser and fixture are a chain of scattering matrices (`two_ports`)."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from two_ports import Strays, TwoPorts, measured

import motoremi as me
from motoremi.data.analyser import find_analyser
from motoremi.data.declaration import declared_analyser
from motoremi.diagnosis.declared import hypotheses, likeliest
from motoremi.simulate.simulated_motor import SimulatedMotor

SOUND = Strays()
NOT_COMPENSATED = Strays(0.1, 20e-9, 2e-12, ground_farads=(3e-12, 2e-12), line_henries=(15e-9, 8e-9))


def test_a_transmission_is_none_of_an_analyser_with_one_port():
    names = {declared: [one.name for one in hypotheses(find_analyser(declared))] for declared in ("none", "nanovna", "unknown")}
    assert names == {"none": ["4294a", "nanovna"], "nanovna": ["4294a"], "unknown": ["nanovna"]}
    for ports in ("series-through", "shunt-through"):
        names = {declared: [one.name for one in hypotheses(find_analyser(f"{declared}+{ports}"))] for declared in names}
        assert names == {"none": [f"nanovna+{ports}"], "nanovna": [], "unknown": []}
    assert hypotheses(find_analyser("none+series-through"))[0].fixture is None


def test_reflections_of_an_unnamed_analyser_are_those_of_a_network_analyser_with_its_fixture():
    saved = [me.ImpedanceSweep("short", np.arange(1, 9) * 1e6, np.full(8, 10.0), metadata={"read_as": how}) for how in ("S parameters", "R and X")]
    network, bridge = (declared_analyser([one])[0] for one in saved)
    assert (network.name, network.by_waves, network.named, network.fixture is None) == ("unknown", True, False, False)
    assert (bridge.name, bridge.by_waves, bridge.named) == ("unknown", False, False)
    assert declared_analyser(saved[:1], "4294a")[0] == find_analyser("4294a")
    # An impedance analyser may save reflections as well.
    assert [one.name for one in hypotheses(network)] == ["4294a"]
    assert all(one.fixture is None for one in (*hypotheses(bridge), *hypotheses(find_analyser("4294a"))))


def test_what_has_no_common_error_model_is_taken_as_it_is():
    remark = "the sweeps were measured in different ways"
    measurement = SimpleNamespace(analyser=find_analyser("unknown"), remark=remark, accuracy_percent=None)
    fit = SimpleNamespace(measurement=measurement, analyser_sigma=9.0)
    first = SimpleNamespace(base=fit, best=SimpleNamespace(fit=fit), model=SimpleNamespace(fit=fit), acceptance="not", described=False)
    assert likeliest(first).instead is None


def test_a_network_analyser_is_not_taken_where_the_circuit_alone_errs_by_far_more(monkeypatch):
    """A line on a NanoVNA with 0.5 % of directivity: its circuit errs by 77 %, far from 50 ohm, with the analyser's errors taken out of it."""

    def measured_by(analyser):
        return SimpleNamespace(analyser=analyser, remark="", accuracy_percent=None, with_analyser=measured_by)

    def fitted(measurement, log_evidence):
        return SimpleNamespace(
            measurement=measurement, motor=None, bounds={}, held={}, parameters={}, search_parameters={}, history=(), method="", seed=1,
            log_evidence=log_evidence, analyser_sigma=9.0, rms_error_percent=31.0, unexplained_percent={"value": 0.3},
        )  # fmt: skip

    before = fitted(measured_by(find_analyser("unknown")), 0.0)
    first = SimpleNamespace(
        base=before, best=SimpleNamespace(fit=before, score=0.0), model=SimpleNamespace(fit=before), acceptance="not", described=False
    )
    model = SimpleNamespace(fit=SimpleNamespace(rms_error_percent=77.0, analyser_sigma=2.0, within_specification=False), added=())
    monkeypatch.setattr("motoremi.diagnosis.declared.Task", lambda motor, measurement, bounds, held: measurement)
    monkeypatch.setattr("motoremi.diagnosis.declared.arrived_on_all", lambda task, starts: task)
    monkeypatch.setattr("motoremi.diagnosis.declared.Found", lambda measurement, history, values: measurement)
    monkeypatch.setattr("motoremi.diagnosis.declared.summarise", lambda task, measurement, method, seed: fitted(measurement, 100.0))
    monkeypatch.setattr(
        "motoremi.diagnosis.declared.judge",
        lambda *given: SimpleNamespace(best=SimpleNamespace(score=100.0), model=model, accepted=True, named=()),
    )
    assert likeliest(first).instead is None  # type: ignore[arg-type]
    model.fit.rms_error_percent = 31.0
    instead = likeliest(first).instead  # type: ignore[arg-type]
    assert instead is not None
    assert instead.by_waves
    # With an effect of which it leaves room for little: something outside the catalogue, measured with the analyser that was declared.
    for share, taken in ((0.78, False), (0.3, True)):
        named = SimpleNamespace(fit=model.fit, added=("field-coupling",), left_share=share)
        one = SimpleNamespace(best=SimpleNamespace(score=100.0), model=named, accepted=True, named=named.added)
        with monkeypatch.context() as patch:
            patch.setattr("motoremi.diagnosis.declared.judge", lambda *given, one=one: one)
            patch.setattr("motoremi.diagnosis.declared.of_every_winding", lambda judgement, assumed: judgement)
            assert (likeliest(first).instead is not None) == taken  # type: ignore[arg-type]
    # An effect whose circuit errs a fifth as much: it counts if it describes what the base leaves, not if it only takes the place of the
    # analyser's errors (a sound motor on a NanoVNA that was declared as a 4294A: a loss across the winding).
    for left, taken in ((0.3, True), (0.1, False)):
        effect = fitted(measured_by(find_analyser("unknown")), 0.0)
        effect.rms_error_percent, effect.unexplained_percent = 6.0, {"value": left}
        other = SimpleNamespace(
            base=before, best=SimpleNamespace(fit=effect, score=0.0), model=SimpleNamespace(fit=effect), acceptance="not", described=False
        )
        assert (likeliest(other).instead is not None) == taken  # type: ignore[arg-type]


def diagnosed(folder, fixture, seed, effects=(), analyser="unknown", strays=SOUND):
    motor = SimulatedMotor.random(seed, effects)
    sweeps = [one.with_metadata(analyser=analyser) for one in measured(folder, motor, TwoPorts(seed), fixture, strays)]
    found = me.diagnose(me.fit(me.dc_motor(), sweeps))
    assert found.base.measurement.analyser.name == f"{analyser}+{fixture}"
    assert "not-as-declared" not in {finding.id for finding in found.findings}
    return found


@pytest.mark.usefixtures("catalogue")
@pytest.mark.slow
@pytest.mark.parametrize(
    ("fixture", "seed"),
    [
        ("series-through", 1),
        *(pytest.param(*one, marks=pytest.mark.case) for one in (("series-through", 2), ("shunt-through", 1), ("shunt-through", 2))),
    ],
)
def test_a_healthy_motor_is_adequate(tmp_path, fixture, seed):
    found = diagnosed(tmp_path, fixture, seed)
    assert (found.verdict, found.effects) == ("adequate", ())


# Of eight motors in each fixture most leave a family after a search of pairs, which takes eight times as long.
@pytest.mark.slow
@pytest.mark.parametrize(("fixture", "seed"), [pytest.param(*one, marks=pytest.mark.case) for one in (("series-through", 4), ("shunt-through", 6))])
def test_a_hidden_effect_is_named(tmp_path, fixture, seed):
    found = diagnosed(tmp_path, fixture, seed, ("eddy-laminations",))
    assert found.verdict in ("missing-effect", "family")
    assert "eddy-laminations" in {*found.effects, *(one for family in found.families for one in family)}


@pytest.mark.usefixtures("catalogue")
@pytest.mark.slow
def test_a_fixture_that_nobody_compensated_is_no_effect(tmp_path):
    found = diagnosed(tmp_path, "series-through", 1, (), "nanovna", NOT_COMPENSATED)
    assert (found.verdict, found.effects) == ("adequate", ())
    finding = next(one for one in found.findings if one.id == "not-compensated")
    assert "through and isolation" in finding.remedy
