"""What a session knows of a model is not lost by a search that misses it."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from paper_circuit import DAMPED

import motoremi as me
from motoremi import workflow
from motoremi.data.session import SessionWriter, load
from motoremi.fitting import refit
from motoremi.fitting.known import Known, also_from
from motoremi.fitting.marginal import marginal
from motoremi.fitting.result import Fit, summarise
from motoremi.fitting.search import Found, Solution
from motoremi.model.circuit import Tape
from motoremi.model.effects import add_effects
from motoremi.workflow import add_several_to_session, add_to_session, fit_session, opened

FREQUENCY = np.geomspace(150e3, 30e6, 41)
SUPPRESSOR = "suppressor-capacitor@frame"
# An effect that changes much, so that a miss is plain.
VALUES = {
    f"{SUPPRESSOR}.capacitance_f": 2.2e-9,
    f"{SUPPRESSOR}.esr_ohm": 0.3,
    f"{SUPPRESSOR}.esl_h": 8e-9,
    f"{SUPPRESSOR}.tan_delta": 0.01,
}
# Elements of a minimum that is none.
WRONG = {"La": 40e-6, "Rr": 400.0, "Lr": 10e-6, "Cr": 60e-12}


def sweeps(values: Mapping[str, float] = DAMPED, effects: Sequence[str] = ()) -> list[me.ImpedanceSweep]:
    """A motor at few points, with 0.1 % of noise, three repeats each."""
    rng, motor = np.random.default_rng(5), add_effects(me.dc_motor(), effects)
    measured = []
    for termination in ("short", "open"):
        names = sorted(motor.used_parameters(termination))
        ohm = Tape(motor.circuit(termination), names).impedance(2j * np.pi * FREQUENCY, np.array([values[name] for name in names]))
        for _ in range(3):
            noise = 1e-3 * (rng.standard_normal(FREQUENCY.size) + 1j * rng.standard_normal(FREQUENCY.size))
            measured.append(me.ImpedanceSweep(termination, FREQUENCY, ohm * (1 + noise)))
    return measured


def missed(fit: Fit, values: Mapping[str, float]) -> Fit:
    """What a search that misses the model makes of it: these values, which are not fitted."""
    likelihood = fit.task.likelihood(None, fit.sizes)
    solution = Solution(likelihood.named(likelihood.vector(values)), fit.sizes, marginal(likelihood, likelihood.vector(values)), True, 1)
    return summarise(fit.task, Found(solution, (), dict(values)), fit.method, fit.seed)


@pytest.fixture(scope="module")
def fitted() -> Fit:
    return me.fit(None, sweeps(), analyser="none")


@pytest.fixture
def session(tmp_path) -> Path:
    path = tmp_path / "s"
    with SessionWriter.create(path, {"title": "known"}) as writer:
        for sweep in sweeps({**DAMPED, **VALUES}, [SUPPRESSOR]):
            writer.add_sweep(sweep.with_metadata(analyser="none"))
        writer.close("done")
    return path


@pytest.fixture
def missing(monkeypatch):
    """From now on, no search for an effect finds anything."""

    def miss() -> None:
        def nothing(trail, before, thorough=True):
            elements = {**dict(before.parameters), **WRONG}
            start = {**VALUES, **elements, f"{SUPPRESSOR}.capacitance_f": 50e-9}
            stopped = dataclasses.replace(before, motor=trail.task.motor, bounds=trail.task.bounds, held=trail.task.held)
            return missed(stopped, {**start, **trail.task.held})

        monkeypatch.setattr(refit, "followed", nothing)

    return miss


def test_a_known_solution_is_taken_in_place_of_a_worse_one(fitted):
    worse = missed(fitted, {**fitted.parameters, **WRONG})
    assert worse.chi2_reduced > 100 * fitted.chi2_reduced
    found = also_from(worse, [Known(dict(fitted.parameters))])
    assert found.chi2_reduced == pytest.approx(fitted.chi2_reduced, rel=1e-3)
    assert found.parameters == pytest.approx(dict(fitted.parameters), rel=1e-3)
    assert found.seed == worse.seed


def test_a_known_solution_that_is_no_better_changes_nothing(fitted):
    worse = {**fitted.parameters, **WRONG}
    assert also_from(fitted, []) is fitted
    assert also_from(fitted, [Known(dict(fitted.parameters), fitted), Known(worse)]) is fitted


def test_a_known_solution_keeps_to_bounds_and_to_what_is_held(fitted):
    """It is fitted again: neither its values nor what it held are taken over."""
    low, high = 20e-6, 40e-6
    bounded = me.fit(None, sweeps(), analyser="none", bounds={"La": (low, high)}, held={"Ra": 25.0})
    known = Known(dict(fitted.parameters), fitted)
    found = also_from(missed(bounded, {**bounded.parameters, **WRONG}), [known], {"Ra": 25.0})
    assert low * (1 - 1e-9) <= found.parameters["La"] <= high * (1 + 1e-9)
    assert found.held == {"Ra": 25.0}
    assert found.parameters["Ra"] == 25.0
    # The circuit that they allow errs by much, and is compared by its error.
    assert found.rms_error_percent == pytest.approx(bounded.rms_error_percent, rel=1e-3)

    # And what was held by the known one is free.
    free = also_from(missed(fitted, {**fitted.parameters, **WRONG}), [Known(dict(bounded.parameters), bounded)])
    assert free.held == {}
    assert free.log_evidence > fitted.log_evidence - 0.1


@pytest.mark.slow
def test_a_fit_of_a_session_never_makes_a_step_worse(session, missing):
    with opened(session) as store:
        fit_session(store)
        _, added = add_to_session(store, SUPPRESSOR)
        assert added.chi2_reduced < 1.5
        missing()
        again = fit_session(store)
        assert again.chi2_reduced == pytest.approx(added.chi2_reduced, rel=1e-3)
        assert dict(again.parameters) == pytest.approx(dict(added.parameters), rel=1e-2)
        stored = load(session).ladder[-1]["fit"]
        # Whatever the seed, and again the same.
        assert fit_session(store, seed=2).chi2_reduced == pytest.approx(added.chi2_reduced, rel=1e-3)
        assert fit_session(store).parameters == pytest.approx(dict(again.parameters), rel=1e-12)
        assert load(session).ladder[-1]["fit"]["rms_error_percent"] == pytest.approx(stored["rms_error_percent"], rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("bound", [{"Cf": (100e-12, 150e-12)}, {"La": (20e-6, 30e-6)}])
def test_a_fit_with_other_bounds_keeps_to_them(session, missing, bound):
    with opened(session) as store:
        fit_session(store)
        add_to_session(store, SUPPRESSOR)
        missing()
        again = fit_session(store, bounds=bound)
    ((name, (low, high)),) = bound.items()
    assert low * (1 - 1e-9) <= again.parameters[name] <= high * (1 + 1e-9)
    assert load(session).ladder[-1]["fit"]["bounds"][name] == [low, high]


@pytest.mark.slow
def test_a_fit_that_holds_a_value_holds_it(session, missing):
    with opened(session) as store:
        fit_session(store)
        add_to_session(store, SUPPRESSOR)
        missing()
        name = f"{SUPPRESSOR}.capacitance_f"
        again = fit_session(store, held={"Ra": 21.0, name: 2.3e-9})
        assert (again.held["Ra"], again.held[name]) == (21.0, 2.3e-9)
        assert load(session).held == {"Ra": 21.0, name: 2.3e-9}
        # Released, both are fitted again.
        free = fit_session(store, held={})
        assert free.held == {}
        assert free.chi2_reduced < 1.5


@pytest.mark.parametrize("together", [False, True])
def test_an_effect_is_added_with_the_values_of_the_diagnosis(session, missing, monkeypatch, together):
    diagnosed = {**DAMPED, **VALUES}
    with opened(session) as store:
        fit_session(store)
        # Of another base, so that the ladder of the diagnosis is not taken as it is.
        best = {"effects": [SUPPRESSOR], "parameters": diagnosed, "rms_error_percent": 0.1}
        store.save_analysis("diagnosis", {"base": {"effects": ["other"]}, "best": best})
        missing()
        if together:
            monkeypatch.setattr(workflow, "added_together", lambda fit, names, each: [fit.add(name) for name in names])
            _, added = add_several_to_session(store, [SUPPRESSOR])
        else:
            _, added = add_to_session(store, SUPPRESSOR)
    assert added.chi2_reduced < 1.5
    for name, value in diagnosed.items():
        assert abs(added.parameters[name] - value) < 4 * added.sigma[name], name
    assert added.parameters["La"] == pytest.approx(diagnosed["La"], rel=0.01)


@pytest.mark.parametrize("parameters", [{"La": "much"}, {"La": {"value": None}}, {"La": "nan"}, None, ["La"]])
def test_values_that_cannot_be_read_are_left_out(session, parameters):
    with opened(session) as store:
        store.save_analysis("diagnosis", {"best": {"effects": [], "parameters": parameters}})
    stored = load(session)
    assert workflow.known_solutions(stored, (), workflow.measurement_of(stored)) == []


@pytest.mark.slow
def test_the_algorithm_as_printed_is_shown_as_it_is(session):
    with opened(session) as store:
        fit_session(store)
        printed = fit_session(store, method="paper")
        alone = me.fit(None, workflow.measurement_of(load(session)), method="paper")
    assert printed.parameters == alone.parameters
