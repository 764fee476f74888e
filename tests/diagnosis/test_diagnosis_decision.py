"""What is decided of models that were found: what only leans on the analyser, what is within a stated accuracy, what the search must find."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import pytest

import motoremi as me
from motoremi.blind.cases import draw
from motoremi.diagnosis.belief import believe
from motoremi.diagnosis.candidates import Candidate
from motoremi.diagnosis.judgement import Judgement, decided, judge
from motoremi.fitting.fit import fit
from motoremi.fitting.result import Fit
from motoremi.model.motor import dc_motor


def left(percent: float, error_percent: float, analyser_sigma: float) -> SimpleNamespace:
    """A fit of which only that is known; noise and specification would leave 1 %."""
    return SimpleNamespace(
        unexplained_percent={"value": percent},
        rms_error_percent=error_percent,
        floor_percent=1.0,
        analyser_sigma=analyser_sigma,
        marginal=SimpleNamespace(nothing_left=0.0),
    )


@pytest.mark.parametrize(("second_leaves", "best"), [(8.4, ("permeability-relaxation",)), (2.0, ("permeability-relaxation", "eddy-laminations"))])
def test_a_further_effect_that_leaves_as_much_is_not_needed(second_leaves, best):
    """A toroid of ferrite: the analyser takes up more, the circuit errs by 39 instead of 9 %, and the evidence is higher."""
    found = {
        (): SimpleNamespace(added=(), score=0.0, fit=left(45.0, 46.0, 39.0)),
        ("permeability-relaxation",): SimpleNamespace(added=("permeability-relaxation",), score=450.0, fit=left(7.9, 9.0, 13.0)),
        ("eddy-laminations", "permeability-relaxation"): SimpleNamespace(
            added=("permeability-relaxation", "eddy-laminations"), score=500.0, fit=left(second_leaves, 39.0, 21.0)
        ),
    }
    judgement = Judgement(found[()].fit, found, believe(found))  # type: ignore[arg-type]
    assert judgement.best.added == best


@pytest.fixture(scope="module")
def stated(measure_once) -> Fit:
    """A motor whose circuit misses by some per cent, measured once, with 20 % stated as good enough."""
    sweeps = [dataclasses.replace(one, metadata={**one.metadata, "accuracy_percent": "20"}) for one in measure_once]
    return fit(dc_motor(), sweeps)


@pytest.fixture(scope="module")
def measure_once() -> list[me.ImpedanceSweep]:
    from conftest import simulated_sweeps

    return simulated_sweeps(2, ("eddy-laminations", "insulation-leakage@Cf"), repeats=1)[0]


@pytest.mark.slow
def test_a_circuit_within_the_stated_accuracy_is_searched_for_one_effect_only(stated):
    assert 1 < stated.rms_error_percent < 20
    judgement = judge(stated)
    assert {len(key) for key in judgement.found} == {0, 1}
    assert judgement.stands
    assert not judgement.named


@pytest.mark.slow
def test_a_circuit_within_the_stated_accuracy_stands_whatever_fits_better_and_is_not_believed(stated):
    # The likeliest model leaves something, so it would not stand by itself.
    pair = Candidate(("range-step", "gain-error"), stated, 100.0, ())
    found = {(): Candidate((), stated, 0.0, ()), ("gain-error", "range-step"): pair}
    judgement = decided(stated, found)
    assert judgement.stands
    assert not judgement.named
    assert judgement.model.added == ()


@pytest.mark.slow
def test_a_pair_of_suppressors_is_found_that_the_bare_circuit_misses_by_far():
    case = draw(4711, 9)
    assert case.hidden == ("suppressor-capacitor@pair",)
    judgement = judge(fit(dc_motor(), case.sweeps()))
    assert judgement.named == case.hidden
    assert judgement.stands
