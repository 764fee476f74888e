"""What is decided of models that were found: what only leans on the analyser, what is within a stated accuracy, what the search must find."""

from __future__ import annotations

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

import motoremi as me
from motoremi.blind.cases import Case
from motoremi.diagnosis.belief import acceptance_of, believe
from motoremi.diagnosis.candidates import Candidate, changed_elements, prior_of_effects, unusual_values
from motoremi.diagnosis.decision import decided, judge
from motoremi.diagnosis.diagnosis import commonest_of_the_closest_first
from motoremi.diagnosis.judgement import Judgement, distributed
from motoremi.fitting.fit import fit
from motoremi.fitting.result import Fit
from motoremi.model.effects import add_effects, find_effect
from motoremi.model.motor import dc_motor


def left(percent: float, error_percent: float, analyser_sigma: float) -> SimpleNamespace:
    """A fit of which only that is known; noise and specification would leave 1 %."""
    return SimpleNamespace(
        unexplained_percent={"value": percent},
        rms_error_percent=error_percent,
        floor_percent=1.0,
        noise_percent=0.1,
        analyser_sigma=analyser_sigma,
        fixture_sigma=0.0,
        instrument_sigma=analyser_sigma,
        marginal=SimpleNamespace(nothing_left=0.0),
        explained=False,
        within_specification=False,
        measurement=SimpleNamespace(
            accuracy_percent=None,
            good_enough_percent=0.1,
            analyser=SimpleNamespace(named=False, by_waves=False),
            terminations=("short", "open"),
        ),
    )


def model(
    added: tuple[str, ...], score: float, error_percent: float, left_percent: float, unusual: tuple[str, ...] = (), analyser_sigma: float = 1.0
) -> SimpleNamespace:
    """A candidate of which only that is known."""
    fit = left(left_percent, error_percent, analyser_sigma)
    return SimpleNamespace(
        added=added,
        effect=added[-1] if added else "",
        score=score,
        fit=fit,
        unusual=unusual,
        plausible=True,
        ordinary=not unusual,
        done=False,
        leaves_nothing=False,
    )


def of(*models: SimpleNamespace) -> dict[tuple[str, ...], SimpleNamespace]:
    return {tuple(sorted(one.added)): one for one in models}


@pytest.mark.parametrize(("error_of_other", "acceptance"), [(1.97, "not"), (7.0, "slight")])
def test_unusual_values_are_not_accepted_if_another_law_errs_as_little(error_of_other, acceptance):
    """A tapped winding, which is not in the catalogue: two flexible laws fit it."""
    bent = model(("field-coupling",), 500.0, 2.0, 0.03, ("field-coupling.quality",))
    found = of(model((), 0.0, 36.0, 35.0), bent, model(("dielectric-relaxation@Ca",), 485.0, error_of_other, 0.09))
    judgement = Judgement(found[()].fit, found, believe(found))  # type: ignore[arg-type]
    assert judgement.acceptance == acceptance
    assert judgement.families == {"field-coupling": ()}


@pytest.mark.parametrize(("gain", "error_percent", "sigma", "named"), [(12.4, 1.1, 1.4, False), (40.0, 1.1, 1.4, True), (12.4, 1.1, 5.0, True)])
def test_an_error_near_a_resonance_that_the_analyser_accounts_for_needs_large_odds(gain, error_percent, sigma, named):
    """A sound motor of an independent generator: a little more than noise and specification leave on average, and 0.05 % beyond both."""
    found = of(model((), 0.0, error_percent, 0.049, (), sigma), model(("field-coupling",), gain, 0.4, 0.045, (), sigma))
    judgement = Judgement(found[()].fit, found, believe(found))  # type: ignore[arg-type]
    assert judgement.named == (("field-coupling",) if named else ())


def air_coil(core_share_is_usual: bool) -> Judgement:
    """Of five turns: a core of which 6 % relaxes describes it alone, skin effect beside two others; an analyser that nobody named."""
    unusual = () if core_share_is_usual else ("permeability-relaxation.share",)
    core, both = ("permeability-relaxation",), ("dielectric-relaxation@Ca", "permeability-relaxation")
    found = of(
        model((), 0.0, 1.23, 0.6),
        model(core, 130.0, 0.126, 0.13, unusual),
        model(both, 128.0, 0.113, 0.12, unusual),
        model(("skin-effect",), 100.0, 0.42, 0.42),
        model(("skin-effect", "second-resonance"), 126.0, 0.116, 0.12),
        model(("skin-effect", "dielectric-loss@Ca"), 119.0, 0.13, 0.13),
    )
    return decided(found[()].fit, found)  # type: ignore[arg-type]


def test_of_laws_that_do_as_well_the_one_with_usual_values_is_named_with_its_family():
    judgement = air_coil(core_share_is_usual=False)
    assert judgement.named == ("skin-effect", "second-resonance")
    assert judgement.families == {"skin-effect": (), "second-resonance": ("dielectric-loss@Ca",)}
    assert judgement.accepted


@pytest.mark.parametrize(
    ("third", "left_percent", "named"),
    [
        ("skin-effect", 0.11, ("shorted-turn", "far-end-tie")),
        # A part at another place, a pair that leaves more than a fiftieth, one that errs far more than noise and specification would leave.
        ("terminal-capacitance", 0.11, ("shorted-turn", "far-end-tie", "terminal-capacitance")),
        ("skin-effect", 0.4, ("shorted-turn", "far-end-tie", "skin-effect")),
        ("skin-effect", 0.0, ("shorted-turn", "far-end-tie", "skin-effect")),
    ],
)
def test_a_third_effect_that_only_corrects_a_loss_is_not_named(third, left_percent, named):
    """A turn of thick wire: its resistance rises with frequency, as that of the catalogue's turn does not, and skin effect describes the rest."""
    three = model(("shorted-turn", "far-end-tie", third), 4230.0, 0.15, 0.0, analyser_sigma=1.5)
    three.fit.marginal.nothing_left, three.fit.explained, three.leaves_nothing, three.done = 1.0, True, True, True
    pair = model(("shorted-turn", "far-end-tie"), 3950.0, 0.114 if left_percent else 2.5, left_percent or 0.11, analyser_sigma=9.1)
    found = of(
        model((), 0.0, 13.9, 13.8, analyser_sigma=30.0),
        model(("far-end-tie",), 1460.0, 2.24, 2.23, analyser_sigma=21.0),
        model(("shorted-turn",), 730.0, 13.7, 13.6, analyser_sigma=19.0),
        pair,
        three,
    )
    for one in found.values():
        one.fit.measurement.analyser.named = True
    judgement = decided(found[()].fit, found)  # type: ignore[arg-type]
    assert (judgement.named, judgement.accepted) == (named, True)
    assert [one.added for one in judgement.aside.values()] == ([three.added] if len(named) == 2 else [])


def test_two_losses_in_place_of_one_are_not_named():
    """A cage as a ladder and a leak: a shorted turn and a proximity effect together have nearly its law."""
    three = model(("proximity-effect", "insulation-leakage@Cf", "shorted-turn"), 10041.0, 0.14, 0.0, analyser_sigma=1.4)
    three.fit.marginal.nothing_left, three.fit.explained, three.leaves_nothing, three.done = 1.0, True, True, True
    found = of(
        model((), 5776.0, 16.8, 16.7, analyser_sigma=0.4),
        model(("insulation-leakage@Cf",), 5950.0, 15.4, 15.4),
        model(("rotor-cage",), 7710.0, 5.7, 5.5),
        model(("rotor-cage", "insulation-leakage@Cf"), 9662.0, 0.22, 0.21, analyser_sigma=19.9),
        model(("insulation-leakage@Cf", "proximity-effect"), 7000.0, 8.0, 7.9),
        three,
    )
    for one in found.values():
        one.fit.measurement.analyser.named = True
    judgement = decided(found[()].fit, found)  # type: ignore[arg-type]
    assert (judgement.named, judgement.accepted) == (("rotor-cage", "insulation-leakage@Cf"), True)


def test_a_second_effect_that_only_corrects_a_loss_is_not_named():
    """An insulation by Jonscher's law, whose loss angle is not quite constant."""
    loss, relaxation = ("dielectric-loss@Ca",), ("dielectric-loss@Ca", "dielectric-relaxation@Ca")
    both = model(relaxation, 5000.0, 0.25, 0.0)
    both.fit.marginal.nothing_left, both.fit.explained, both.leaves_nothing, both.done = 1.0, True, True, True
    found = of(model((), 0.0, 18.1, 18.1, analyser_sigma=30.0), model(loss, 4700.0, 0.4, 0.2, analyser_sigma=8.0), both)
    for one in found.values():
        one.fit.measurement.analyser.named = True
    judgement = decided(found[()].fit, found)  # type: ignore[arg-type]
    assert (judgement.named, judgement.accepted) == (loss, True)


@pytest.mark.parametrize(("errors_percent", "hardly"), [((83.0, 75.0), True), ((83.0, 40.0), False), ((300.0, 75.0), False)])
def test_a_circuit_that_still_misses_by_most_is_hardly_closer(errors_percent, hardly):
    before, after = errors_percent
    found = of(model((), 0.0, before, before), model(("terminal-capacitance",), 500.0, after, 0.1))
    found[("terminal-capacitance",)].fit.marginal.nothing_left = 1.0
    judgement = Judgement(found[()].fit, found, believe(found))  # type: ignore[arg-type]
    assert judgement.named
    assert judgement.hardly_closer is hardly
    # A fixture that was not compensated is part of the circuit's error.
    judgement.model.fit.fixture_sigma = 1.0  # type: ignore[misc]
    assert not judgement.hardly_closer


def test_three_effects_that_are_not_accepted_do_not_take_the_place_of_two_that_are(healthy):
    """Bearing film and laminations, between whose laws and the motor's a third effect makes a small difference beside any of the alike pairs."""
    found = of(
        model((), 0.0, 15.6, 15.6),
        model(("bearing-film",), 100.0, 9.0, 9.0),
        model(("bearing-film", "proximity-effect"), 500.0, 0.12, 0.035),
        model(("bearing-film", "brush-contact", "proximity-effect"), 508.0, 0.11, 0.03),
        model(("bearing-film", "skin-effect"), 450.0, 0.5, 0.4),
        model(("bearing-film", "brush-contact", "skin-effect"), 505.0, 0.15, 0.031),
    )
    for one in found.values():
        one.fit.measurement.analyser.named = True
        one.fit.explained = one.fit.within_specification = one.fit.rms_error_percent < 0.2
    judgement = decided(healthy, found)  # type: ignore[arg-type]
    assert (judgement.named, judgement.accepted) == (("bearing-film", "proximity-effect"), True)


def test_a_law_with_usual_values_is_named_as_before():
    assert air_coil(core_share_is_usual=True).named == ("permeability-relaxation",)


STEP = ("range-step",)


def test_a_step_that_is_slight_within_the_specification_is_not_named():
    """Of a sound motor on a quiet analyser: the step that its ranges may have takes the undescribed part from 0.12 to 0.096 %."""
    found = of(model((), 0.0, 0.17, 0.12), model(STEP, 83.0, 0.18, 0.096))
    assert decided(found[()].fit, found).named == ()  # type: ignore[arg-type]
    # Beyond what noise and specification would leave it is a fault.
    large = of(model((), 0.0, 2.0, 1.9), model(STEP, 83.0, 0.18, 0.096))
    assert decided(large[()].fit, large).named == STEP  # type: ignore[arg-type]


@pytest.mark.parametrize(("gain", "cf_pf", "named"), [(100.0, 180.0, True), (100.0, 262.0, False), (40.0, 180.0, False)])
def test_an_error_that_the_specification_allows_is_named_if_an_element_is_wrong_without_it(gain, cf_pf, named):
    """A cable of 12 cm beyond the calibration of a network analyser; the error bar of Cf is 7 pF."""
    delay = model(("cable-delay",), gain, 0.6, 0.0)
    delay.leaves_nothing, delay.fit.parameters = True, {"Cf": 1e-12 * cf_pf}
    found = of(model((), 0.0, 2.6, 0.16), delay)
    base = found[()].fit
    base.parameters, base.sigma, base.determined, base.floor_percent = {"Cf": 272e-12}, {"Cf": 7e-12}, lambda name: True, 18.0
    base.measurement.analyser.named = base.measurement.analyser.by_waves = True
    judgement = Judgement(base, found, believe(found))  # type: ignore[arg-type]
    assert judgement.named == (("cable-delay",) if named else ())


def test_beside_an_effect_that_leaves_no_more_than_the_specification_a_step_is_not_named():
    loss = ("dielectric-loss@Cf",)
    found = of(model((), 0.0, 1.7, 0.7), model(loss, 300.0, 0.16, 0.16), model(STEP, 1.0, 1.7, 0.7), model((*loss, *STEP), 480.0, 0.16, 0.03))
    assert decided(found[()].fit, found).named == loss  # type: ignore[arg-type]


@pytest.mark.parametrize(("second_leaves", "best"), [(8.4, ("permeability-relaxation",)), (2.0, ("permeability-relaxation", "eddy-laminations"))])
def test_a_further_effect_that_leaves_as_much_is_not_needed(second_leaves, best):
    """A toroid of ferrite: the analyser takes up more, the circuit errs by 39 instead of 9 %, and the evidence is higher."""
    found = {
        (): SimpleNamespace(added=(), score=0.0, fit=left(45.0, 46.0, 39.0), leaves_nothing=False),
        ("permeability-relaxation",): SimpleNamespace(
            added=("permeability-relaxation",),
            score=450.0,
            fit=left(7.9, 9.0, 13.0),
            plausible=True,
            unusual=(),
            ordinary=True,
            leaves_nothing=False,
        ),
        ("eddy-laminations", "permeability-relaxation"): SimpleNamespace(
            added=("permeability-relaxation", "eddy-laminations"), score=500.0, fit=left(second_leaves, 39.0, 21.0), leaves_nothing=False
        ),
    }
    for one in found.values():
        one.fit.measurement.analyser.named = True
    judgement = Judgement(found[()].fit, found, believe(found))  # type: ignore[arg-type]
    assert judgement.best.added == best


def test_a_pair_of_which_both_are_needed_is_named_beside_a_likelier_one_of_which_only_one_is(healthy):
    """Leakage on a poorly compensated fixture: a relaxation takes up fine structure; only the residual brings the analyser within its bounds."""
    leak = ("insulation-leakage@Cf",)
    found = of(
        model((), 0.0, 8.5, 8.1, analyser_sigma=17.0),
        model(leak, 1000.0, 3.7, 0.0, analyser_sigma=7.0),
        model((*leak, "dielectric-relaxation@Cf"), 1040.0, 3.7, 0.0, analyser_sigma=7.0),
        model((*leak, "short-residual"), 1022.0, 0.08, 0.0, analyser_sigma=2.0),
    )
    for key, one in found.items():
        one.fit.marginal.nothing_left = float(bool(key))
    judgement = decided(healthy, found)  # type: ignore[arg-type]
    assert set(judgement.best.added) == {*leak, "short-residual"}
    del found["insulation-leakage@Cf", "short-residual"]
    assert decided(healthy, found).best.added == leak  # type: ignore[arg-type]


def test_a_pair_at_a_physical_bound_gives_way_to_one_within_its_ranges(healthy):
    """Leads of a metre and a motor that drifted: a choke describes them too, with six more parameters and a corner beyond that of any ferrite."""
    choke, lead = ("suppressor-choke", "temperature-drift"), ("lead-inductance", "temperature-drift")
    found = of(model((), 0.0, 75.0, 75.0), model(choke, 6740.0, 0.29, 0.0), model(lead, 6734.0, 0.18, 0.0))
    for key in (choke, lead):
        one = found[tuple(sorted(key))]
        one.fit.marginal.nothing_left, one.done, one.fit.explained = 1.0, True, True
    assert decided(healthy, found).best.added == choke  # type: ignore[arg-type]
    at_bound = found[tuple(sorted(choke))]
    at_bound.plausible = at_bound.ordinary = False
    assert decided(healthy, found).best.added == lead  # type: ignore[arg-type]


@pytest.mark.parametrize(("floor_percent", "left_percent", "acceptance"), [(6.0, 1.4, "slight"), (140.0, 34.0, "not")])
def test_no_large_error_is_slight_because_moved_leads_change_a_resonance_by_more_than_itself(floor_percent, left_percent, acceptance):
    base, fitted = left(73.0, 73.0, 2.0), left(left_percent, 34.0, 2.0)
    fitted.floor_percent = floor_percent
    fitted.measurement.analyser.named = True
    assert acceptance_of(base, fitted) == acceptance  # type: ignore[arg-type]


@pytest.mark.parametrize(("left_percent", "acceptance"), [(49.0, "mostly"), (188.0, "not")])
def test_a_model_that_misses_by_more_than_half_is_not_accepted_however_much_the_base_misses(left_percent, acceptance):
    """Of an unconnected fixture nothing describes the sweeps, but an effect with extreme values leaves a small share of what the base leaves."""
    base, fitted = left(1600.0, 1600.0, 2.0), left(left_percent, left_percent, 2.0)
    fitted.measurement.analyser.named = True
    assert acceptance_of(base, fitted) == acceptance  # type: ignore[arg-type]


def test_a_value_just_outside_its_usual_range_is_not_unusual_where_the_law_leaves_more(healthy):
    with_relaxation = healthy.add("dielectric-relaxation@Cf")
    label = "dielectric-relaxation@Cf.strength"
    values = {**with_relaxation.parameters, label: 2.004, "dielectric-relaxation@Cf.exponent": 0.8}
    rough = dataclasses.replace(with_relaxation, parameters=values, marginal=SimpleNamespace(nothing_left=0.0))
    assert Candidate(("dielectric-relaxation@Cf",), rough, 0.0, ()).unusual == (label,)
    assert Candidate(("dielectric-relaxation@Cf",), rough, 0.0, (), left_share=0.01).unusual == ()


@pytest.fixture(scope="module")
def healthy():
    return me.fit(me.dc_motor(), Case(1, 0, "none", (), 5).sweeps(points=51))


@pytest.mark.parametrize(
    ("first_leaves", "further", "gain", "named"),
    [
        (0.04, "second-resonance", 165.0, False),
        (0.15, "second-resonance", 165.0, True),
        (0.04, "frame-eddy", 165.0, True),
        (0.04, "frame-eddy", 20.0, False),
    ],
)
def test_no_further_effect_only_corrects_the_law_of_one_that_describes_the_motor_as_well_as_is_asked_for(
    first_leaves, further, gain, named, healthy
):
    """A choke whose ferrite is not quite of the catalogue's law: a resonance beside it takes the rest, by odds of e^165."""
    choke = model(("suppressor-choke",), 6000.0, 3.2, first_leaves)
    choke.fit.explained = first_leaves <= 0.1
    found = of(model((), 0.0, 15.0, 14.6), choke, model(("suppressor-choke", further), 6000.0 + gain, 2.6, 0.0))
    judgement = Judgement(healthy, found, believe(found))  # type: ignore[arg-type]
    assert judgement.best.added == (("suppressor-choke", further) if named else ("suppressor-choke",))


@pytest.mark.parametrize(("left_percent", "sigma", "accepted"), [(0.3, 1.0, True), (0.3, 4.0, False), (0.8, 1.0, False)])
def test_a_pair_that_describes_nine_tenths_with_an_analyser_within_its_specification_is_credible(left_percent, sigma, accepted):
    found = of(model((), 0.0, 6.0, 5.0), model(("lead-inductance", "skin-effect"), 400.0, 1.5, left_percent, analyser_sigma=sigma))
    for one in found.values():
        one.fit.measurement.analyser.named = True
    judgement = Judgement(found[()].fit, found, believe(found))  # type: ignore[arg-type]
    assert judgement.accepted == accepted


def test_a_pair_with_unusual_values_does_not_take_the_place_of_one_effect_that_is_enough(healthy):
    """A coupling leaves 0.03 %; a resonance beside it only corrects its law, and two other effects describe everything with unusual values."""
    coupling = model(("field-coupling",), 3394.0, 2.2, 0.03)
    coupling.fit.explained = True
    others = model(("permeability-relaxation", "second-resonance"), 3402.0, 0.5, 0.0, ("permeability-relaxation.share",))
    both = model(("field-coupling", "second-resonance"), 3434.0, 0.8, 0.0)
    for one in (others, both):
        one.fit.marginal.nothing_left, one.done = 1.0, True
    decision = decided(healthy, of(model((), 0.0, 12.0, 11.0), coupling, others, both))  # type: ignore[arg-type]
    assert decision.named == ("field-coupling",)


@pytest.mark.parametrize(("gain", "leaves_nothing", "named"), [(100.0, True, True), (40.0, True, False), (100.0, False, False)])
def test_less_than_counts_is_named_only_by_clear_odds_if_nothing_is_left(gain, leaves_nothing, named):
    loss = model(("dielectric-loss@Cr",), gain, 0.7, 0.0)
    loss.leaves_nothing = leaves_nothing
    found = of(model((), 0.0, 0.9, 0.07), loss)
    judgement = Judgement(found[()].fit, found, believe(found))  # type: ignore[arg-type]
    assert judgement.named == (("dielectric-loss@Cr",) if named else ())
    assert judgement.hardly_matters == named


@pytest.mark.parametrize(("analyser_is_named", "left_percent", "hardly"), [(False, 0.2, True), (True, 0.2, False), (False, 0.4, False)])
def test_a_small_part_of_the_errors_of_an_analyser_without_a_name_hardly_matters(analyser_is_named, left_percent, hardly):
    """A frame strap whose loss looked like the film of a bearing: 0.1 % was left where 1 % may be the analyser's."""
    found = of(model((), 0.0, 0.9, left_percent), describing(("bearing-film",), 130.0))
    found[()].fit.measurement.analyser.named = analyser_is_named
    judgement = Judgement(found[()].fit, found, believe(found))  # type: ignore[arg-type]
    assert judgement.named == ("bearing-film",)
    assert judgement.hardly_matters == hardly


@pytest.mark.parametrize(("sigma", "named"), [(4.5, False), (8.0, True)])
def test_a_further_effect_that_only_reduces_the_analysers_error_is_named_if_that_is_twice_its_specification(sigma, named, healthy):
    layers = model(("proximity-effect",), 6000.0, 1.0, 0.0, analyser_sigma=sigma)
    found = of(model((), 0.0, 70.0, 70.0), layers, model(("cable-delay", "proximity-effect"), 6018.0, 0.9, 0.0, analyser_sigma=1.3))
    judgement = Judgement(healthy, found, believe(found))  # type: ignore[arg-type]
    assert len(judgement.best.added) == (2 if named else 1)


def bead(closest_is_usual: bool = True) -> Judgement:
    """Of ferrite, on a network analyser far beyond its specification: the likeliest effect errs three times as much as a relaxing core."""
    unusual = () if closest_is_usual else ("permeability-relaxation.exponent",)
    found = of(
        model((), 0.0, 81.0, 80.0),
        model(("proximity-effect",), 584.0, 29.0, 28.8),
        model(("permeability-relaxation",), 568.0, 8.4, 8.2, unusual),
        model(("field-coupling", "proximity-effect"), 807.0, 12.0, 11.0),
    )
    return Judgement(found[()].fit, found, believe(found))  # type: ignore[arg-type]


def test_where_nothing_stands_what_removes_most_of_the_circuits_error_is_named():
    assert not bead().accepted
    closest = bead().of_closest
    assert closest is not None
    assert closest.named == ("permeability-relaxation",)
    assert closest.acceptance == "mostly"
    assert bead(closest_is_usual=False).of_closest is None


def test_one_effect_that_errs_less_than_the_likeliest_two_is_named():
    """Two others let the analyser take up more: the pair has the higher evidence and twice the error."""
    found = of(
        model((), 0.0, 60.0, 59.0),
        model(("permeability-relaxation",), 869.0, 7.8, 4.3),
        model(("core-loss", "eddy-laminations"), 892.0, 15.9, 15.0),
    )
    for one in found.values():
        one.plausible = True
    assert decided(found[()].fit, found).named == ("permeability-relaxation",)  # type: ignore[arg-type]


@pytest.mark.parametrize(("sigma_of_one", "named"), [(6.2, ("second-resonance", "ground-strap-inductance")), (3.5, ("second-resonance",))])
def test_a_pair_within_the_specification_is_named_instead_of_one_effect_that_needs_more(sigma_of_one, named):
    """A motor of an independent generator: a cell of 1.1 uH, and a strap that the analyser would otherwise have to describe."""
    found = of(
        model((), 4453.7, 9.66, 9.62),
        model(("second-resonance",), 6468.0, 1.03, 0.94, analyser_sigma=sigma_of_one),
        model(("ground-strap-inductance",), 4457.1, 9.66, 9.65),
        model(("second-resonance", "ground-strap-inductance"), 6506.8, 0.176, 0.054, analyser_sigma=0.59),
    )
    for one in found.values():
        one.fit.measurement.analyser.named = True
        one.fit.floor_percent = 0.53
    assert decided(found[()].fit, found).named == named  # type: ignore[arg-type]


@pytest.mark.parametrize(("error_of_two", "named"), [(1.9, True), (1.2, False)])
def test_one_effect_is_named_beside_two_others_that_err_about_as_little(error_of_two, named):
    """A choke of ferrite: two others are likelier, and take an error of 46 % to 1.9 instead of 2.6 %."""
    found = of(
        model((), 0.0, 46.0, 46.0),
        model(("permeability-relaxation",), 1251.0, 2.6, 2.6),
        model(("suppressor-choke",), 1212.0, 2.7, 2.6),
        model(("second-resonance", "suppressor-choke"), 1293.0, error_of_two, error_of_two),
    )
    single = Judgement(found[()].fit, found, believe(found)).of_singles  # type: ignore[arg-type]
    assert (single is not None and single.named == ("permeability-relaxation",)) == named


@pytest.mark.parametrize(("next_best", "named"), [((911.0, 38.0), True), ((1160.0, 38.0), False), ((911.0, 20.0), False)])
def test_one_effect_is_named_beside_two_others_where_no_single_one_comes_near_it(next_best, named):
    """A choke of nanocrystalline ribbon: two others with unusual values reduce an error of 97 % to 1.4 instead of 11 %."""
    found = of(
        model((), 754.0, 97.0, 97.0),
        model(("permeability-relaxation",), 1196.0, 10.8, 10.7),
        model(("second-resonance",), next_best[0], next_best[1], next_best[1]),
        model(("machine-winding", "suppressor-choke"), 1350.0, 1.4, 1.2, ("machine-winding.cage_hz",)),
    )
    single = Judgement(found[()].fit, found, believe(found)).of_singles  # type: ignore[arg-type]
    assert (single is not None and single.named == ("permeability-relaxation",)) == named


@pytest.mark.parametrize(("sigma", "unusual"), [(0.0, True), (0.2, True), (0.9, False), (float("inf"), False)])
def test_a_value_is_unusual_only_beyond_what_the_data_leave_open(sigma, unusual):
    """Most relaxations have a strength of 0.02 to 2."""
    label = "dielectric-relaxation@Ca"
    motor = find_effect(label).added_to(me.dc_motor())
    values = {f"{label}.strength": 2.5, f"{label}.corner_hz": 1e6, f"{label}.exponent": 0.8}
    sigmas = dict.fromkeys(values, sigma)
    assert bool(unusual_values(motor, {label}, values, sigmas)) == unusual
    assert unusual_values(motor, {label}, values) == (f"{label}.strength",)


@pytest.mark.parametrize(("resistance_ohm", "overdamped"), [(61.0, True), (64.0, False)])
def test_a_cell_that_does_not_resonate_is_unusual(resistance_ohm, overdamped):
    """An inductance of 2 uH that resonates at 10 MHz (126 Ohm) is critically damped by 63 Ohm across it."""
    label = "second-resonance"
    motor = find_effect(label).added_to(me.dc_motor())
    values = {"inductance_h": 2e-6, "resonance_hz": 1e7, "resistance_ohm": resistance_ohm, "series_share": 0.0}
    own = {f"{label}.{name}": value for name, value in values.items()}
    assert bool(unusual_values(motor, {label}, own)) == overdamped
    nothing, sigma = SimpleNamespace(nothing_left=1.0), dict.fromkeys(own, 0.0)
    fit = SimpleNamespace(effects=(label,), motor=motor, parameters=own, exact_sigma=sigma, marginal=nothing)
    said = Candidate((label,), fit, 0.0, ()).unusual_in_words  # type: ignore[arg-type]
    assert said == ("second-resonance.resistance_ohm = 61 Ohm, second-resonance is overdamped, so nothing resonates" if overdamped else "")


@pytest.mark.parametrize(("error_percent", "sigma", "accepted"), [(100.0, 24.0, False), (100.0, 2.0, True), (20.0, 24.0, True)])
def test_a_larger_error_that_is_described_by_large_analyser_errors_is_not_accepted(error_percent, sigma, accepted):
    named = model(("eddy-laminations",), 500.0, error_percent, 3.0)
    named.fit.analyser_sigma = sigma
    found = of(model((), 0.0, 80.0, 79.0), named)
    judgement = Judgement(found[()].fit, found, believe(found))  # type: ignore[arg-type]
    assert judgement.accepted == accepted


@pytest.mark.parametrize(
    ("by_waves", "sigma", "left_percent", "accepted"),
    [(False, 14.0, 5.3, False), (False, 4.0, 5.3, True), (True, 9.5, 5.3, True), (True, 14.0, 5.3, False), (False, 14.0, 2.3, True)],
)
def test_an_error_beyond_what_an_analyser_can_cause_is_accepted_if_it_is_a_small_part(by_waves, sigma, left_percent, accepted):
    """A tapped winding, or three effects at once: one law leaves what is no error of a 4294A, or is not quite the motor's law.

    On real cores a NanoVNA needed three times its specification, 9.7 standard deviations.
    """
    loss = model(("dielectric-loss@Ca",), 5300.0, left_percent + 0.5, left_percent)
    loss.fit.analyser_sigma = sigma
    loss.fit.measurement.analyser = SimpleNamespace(named=True, by_waves=by_waves)
    found = of(model((), 0.0, 44.8, 44.8), loss, model(("core-loss",), 5290.0, left_percent + 0.7, left_percent + 0.2))
    assert Judgement(found[()].fit, found, believe(found)).accepted == accepted  # type: ignore[arg-type]


def test_a_cage_is_less_probable_in_a_dc_motor_than_another_effect():
    assert prior_of_effects(()) == prior_of_effects(("eddy-laminations", "dielectric-loss@Cf")) == 0
    assert prior_of_effects(("rotor-cage", "dielectric-loss@Cf")) == pytest.approx(math.log(0.2))


def test_a_pair_with_values_that_few_motors_have_does_not_hide_the_closest_effect():
    """A binocular core on an analyser that nobody named: two effects leave almost nothing, and the likeliest single one errs by 42 %."""
    found = of(
        model((), 0.0, 59.7, 59.0),
        model(("proximity-effect",), 619.0, 41.6, 41.4),
        model(("permeability-relaxation",), 604.0, 3.05, 2.95),
        model(("field-coupling", "permeability-relaxation"), 721.0, 0.79, 0.68, ("field-coupling.coupling",)),
    )
    for one in found.values():
        one.plausible = True
    judgement = Judgement(found[()].fit, found, believe(found))  # type: ignore[arg-type]
    assert not judgement.accepted
    closest = judgement.of_closest
    assert closest is not None
    assert closest.named == ("permeability-relaxation",)


def test_a_law_with_unusual_values_that_leaves_a_per_cent_only_bends():
    """A cell of salt water as the winding of a machine."""
    for left_percent, acceptance in ((8.6, "not"), (0.9, "mostly")):
        found = of(model((), 0.0, 51.0, 50.0), model(("machine-winding",), 900.0, 8.7, left_percent, ("machine-winding.iron_hz",)))
        assert Judgement(found[()].fit, found, believe(found)).acceptance == acceptance  # type: ignore[arg-type]


@pytest.mark.parametrize(("floor_percent", "accepted"), [(9.0, True), (870.0, False)])
def test_an_error_is_not_small_by_comparison_with_one_that_no_analyser_has(floor_percent, accepted):
    """A ceramic coil measured between two ports: two effects leave 2 or 3 %, an analyser that nobody named could err by more."""
    pair = model(("permeability-relaxation", "suppressor-capacitor@frame"), 900.0, 2.2 if accepted else 3.3, 3.1)
    pair.fit.floor_percent, pair.fit.within_specification, pair.distributed = floor_percent, True, False
    found = of(model((), 0.0, 20.4, 20.0), pair)
    assert Judgement(found[()].fit, found, believe(found)).accepted == accepted  # type: ignore[arg-type]


def test_no_analyser_errs_by_hundreds_of_times_its_specification():
    fit = left(0.0, 30.0, 310.0)
    fit.marginal.nothing_left = 1.0
    assert acceptance_of(fit, fit) == "not"  # type: ignore[arg-type]
    fit.analyser_sigma = 290.0
    assert acceptance_of(fit, fit) == "explained"  # type: ignore[arg-type]


def test_two_relaxations_at_one_place_are_one_part_of_distributed_resistance():
    assert distributed(("dielectric-relaxation@Ca", "dielectric-relaxation@Ca"))
    assert distributed(("bearing-film", "dielectric-relaxation@Cf"))
    assert not distributed(("dielectric-relaxation@Ca", "dielectric-relaxation@Cf"))
    assert not distributed(("dielectric-relaxation@Ca",))


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
    assert judgement.accepted
    assert not judgement.named


@pytest.mark.slow
def test_a_circuit_within_the_stated_accuracy_stands_whatever_fits_better_and_is_not_believed(stated):
    # The likeliest model leaves something, so it would not stand by itself.
    pair = Candidate(("range-step", "gain-error"), stated, 100.0, ())
    found = {(): Candidate((), stated, 0.0, ()), ("gain-error", "range-step"): pair}
    judgement = decided(stated, found)
    assert judgement.accepted
    assert not judgement.named
    assert judgement.model.added == ()


@pytest.mark.case
@pytest.mark.slow
def test_a_pair_of_suppressors_is_found_that_the_bare_circuit_misses_by_far():
    case = Case(4711, 9, "one", ("suppressor-capacitor@pair",), 363251374)
    judgement = judge(fit(dc_motor(), case.sweeps()))
    assert judgement.named == case.hidden
    assert judgement.accepted


def describing(added: tuple[str, ...], score: float, unusual: tuple[str, ...] = ()) -> SimpleNamespace:
    """A candidate that leaves nothing."""
    one = model(added, score, 0.5, 0.0, unusual)
    one.fit.marginal, one.fit.explained, one.done, one.leaves_nothing = SimpleNamespace(nothing_left=1.0), True, True, not unusual
    return one


@pytest.mark.parametrize(("behind", "named"), [(12.0, "shorted-turn"), (142.0, "permeability-relaxation")])
def test_an_effect_with_usual_values_takes_the_place_of_one_with_unusual_values_unless_the_odds_are_clear(behind, named):
    """A shorted turn, of which a core that relaxes by 3 % has nearly the same impedance."""
    bent = describing(("permeability-relaxation",), 300.0, ("permeability-relaxation.share",))
    found = of(model((), 0.0, 3.0, 2.8), bent, describing(("shorted-turn",), 300.0 - behind))
    judgement = decided(found[()].fit, found)  # type: ignore[arg-type]
    assert judgement.named == (named,)
    assert judgement.unusual_instead is (None if named == bent.added[0] else bent)


@pytest.mark.parametrize(("within", "odds"), [(True, 191.0), (False, 191.0), (False, 40.0)])
def test_two_effects_within_noise_and_analyser_are_named_before_two_with_unusual_values_whatever_the_odds(within, odds):
    """A film of brushes that relaxes twice, with a leak to the frame; a resonance that does not resonate, with the leak, is closer."""
    bare = model((), 0.0, 1.86, 1.8)
    bare.fit.measurement.floors = [[0.01]]
    bent = describing(("insulation-leakage@Cr", "second-resonance"), 900.0, ("second-resonance.resistance_ohm",))
    right = model(("brush-contact", "insulation-leakage@Cr"), 900.0 - odds, 0.2, 0.06)
    right.fit.explained, right.fit.within_specification = True, within
    judgement = decided(bare.fit, of(bare, model(("second-resonance",), 300.0, 1.2, 1.1), bent, right))  # type: ignore[arg-type]
    assert judgement.accepted == (within or odds < 60)
    if judgement.accepted:
        assert judgement.named == right.added
        assert judgement.unusual_instead is (bent if odds > 60 else None)


FLUX, AND_EDDY = ("common-mode-flux",), ("common-mode-flux", "eddy-laminations")


def with_three(third: SimpleNamespace) -> Judgement:
    """A motor of which one effect leaves most, and two leave more than noise and analyser would."""
    bare = model((), 0.0, 10.0, 9.0)
    bare.fit.measurement.floors = [[0.01]]
    found = of(bare, model(FLUX, 200.0, 4.5, 4.0), model(AND_EDDY, 300.0, 1.0, 0.5), third)
    return decided(bare.fit, found)  # type: ignore[arg-type]


def test_three_effects_are_named_if_they_describe_everything_with_usual_values():
    three = (*AND_EDDY, "dielectric-loss@Cf")
    named = with_three(describing(three, 500.0))
    assert named.named == three
    assert named.accepted
    # Otherwise the decision is the one without them, as the two relaxations at one place are.
    for rejected in (
        model(three, 500.0, 0.6, 0.2),
        describing(three, 500.0, ("eddy-laminations.corner_hz",)),
        describing((*FLUX, "dielectric-relaxation@Cf", "bearing-film"), 500.0),
    ):
        judgement = with_three(rejected)
        assert not judgement.accepted
        assert max(len(key) for key in judgement.found) == 2


def test_three_effects_beside_an_analyser_beyond_its_specification_are_not_named():
    third = describing((*AND_EDDY, "dielectric-loss@Cf"), 500.0)
    third.fit.analyser_sigma = 3.5
    assert not with_three(third).accepted


def test_a_step_of_the_range_does_not_hide_what_is_missing_beside_it():
    """A line of a few centimetres, measured with an analyser that changes its range within the specification."""
    bare = model((), 0.0, 1.05, 1.0)
    bare.fit.measurement.floors = [[0.01]]
    found = of(bare, model(("range-step",), 100.0, 1.0, 0.95), model(("cable-delay",), 80.0, 0.44, 0.2))
    assert decided(bare.fit, found).named == ("cable-delay",)  # type: ignore[arg-type]
    del found[("cable-delay",)]
    assert not decided(bare.fit, found).accepted  # type: ignore[arg-type]


def composite_inductor(analyser_sigma: float = 30.0) -> dict[tuple[str, ...], SimpleNamespace]:
    """Of a maker's table, between two ports, on an analyser that nobody named: a law of core loss lets the analyser take up more."""
    return of(
        model((), 0.0, 68.0, 67.0, analyser_sigma=analyser_sigma),
        model(("core-loss",), 510.0, 6.45, 5.7, analyser_sigma=24.7),
        model(("permeability-relaxation",), 500.0, 1.18, 0.66, analyser_sigma=9.3),
    )


def test_an_effect_that_leaves_less_comes_before_a_more_probable_one_that_leaves_per_cents():
    found = composite_inductor()
    assert Judgement(found[()].fit, found, believe(found)).acceptance == "mostly"  # type: ignore[arg-type]
    assert decided(found[()].fit, found).named == ("permeability-relaxation",)  # type: ignore[arg-type]
    found[("permeability-relaxation",)].fit.rms_error_percent = 4.0
    assert decided(found[()].fit, found).named == ("core-loss",)  # type: ignore[arg-type]


@pytest.mark.parametrize(("base_sigma", "sigma", "told"), [(30.0, 1.0, True), (30.0, 5.0, False), (3.0, 1.0, False)])
def test_an_effect_with_which_the_analyser_is_within_its_specification_is_told_beside_an_analyser_beyond_it(base_sigma, sigma, told):
    core = describing(("permeability-relaxation",), 1.0)
    core.fit.analyser_sigma, core.leaves_nothing = sigma, True
    found = of(model((), 0.0, 6.8, 0.0, analyser_sigma=base_sigma), core, model(("core-loss",), 2.0, 2.9, 1.9, analyser_sigma=11.0))
    judgement = Judgement(found[()].fit, found, believe(found))  # type: ignore[arg-type]
    assert judgement.named == ()
    assert judgement.instead_of_the_analyser is (core if told else None)


def test_elements_that_another_model_gives_otherwise_are_told():
    def known(**values: float) -> SimpleNamespace:
        return SimpleNamespace(parameters=values, sigma=dict.fromkeys(values, 1e-8), determined=lambda name: name != "Ca")

    here, other = known(La=12e-6, Ca=30e-12, Cr=1e-9), known(La=40e-6, Ca=90e-12, Cr=1.1e-9)
    assert changed_elements(here, {"skin-effect": other}) == "La is 12 uH here and 40 uH with skin-effect"  # type: ignore[arg-type, dict-item]
    assert not changed_elements(here, {"skin-effect": here})  # type: ignore[arg-type, dict-item]


def test_a_base_that_is_explained_is_adequate_though_a_bent_law_is_more_probable(healthy):
    """A sound motor across the line of a network analyser: a choke of an unusual ferrite lets the analyser err less."""
    base = model((), 0.0, 62.5, 0.07, analyser_sigma=4.3)
    base.fit.explained = True
    found = of(base, model(("suppressor-choke",), 9.5, 26.0, 0.07, ("suppressor-choke.share",), 1.8), model(("field-coupling",), 0.0, 23.0, 0.07))
    base.fit.measurement.floors = healthy.measurement.floors
    decision = decided(base.fit, found)  # type: ignore[arg-type]
    assert decision.accepted
    assert decision.named == ()


def test_a_cell_that_is_larger_than_the_winding_has_exchanged_places_with_it(healthy):
    added = healthy.add("second-resonance")
    label, henry = "second-resonance.inductance_h", healthy.parameters["La"]
    # With a thousandth of the winding's capacitance it resonates beyond the sweeps: nothing shows that La and Ca are a part of the winding.
    beyond = {**added.parameters, "Ca": 1e-3 * healthy.parameters["Ca"]}
    for factor, larger in ((0.1, False), (10.0, True)):
        one = dataclasses.replace(added, parameters={**beyond, label: factor * henry, "La": henry})
        assert Candidate(("second-resonance",), one, 0.0, ()).exchanged == larger
        seen = dataclasses.replace(one, parameters={**one.parameters, "Ca": healthy.parameters["Ca"]})
        model = Candidate(("second-resonance",), seen, 0.0, ())
        assert (model.larger_than_winding, model.exchanged) == (larger, False)


@pytest.mark.parametrize(("named", "effects"), [(False, "permeability-relaxation"), (True, "dielectric-relaxation@Ca")])
def test_of_an_analyser_without_a_name_the_circuit_that_comes_closer_is_taken(named, effects):
    """A ferrite bead: two terms of its permeability err by 0.9 %, and with one of its capacitance the assumed analyser by 35 %."""
    core = "permeability-relaxation"
    found = of(model((), 0.0, 23.5, 23.0), model((core, "dielectric-relaxation@Ca"), 290.0, 35.0, 0.0), model((core, core), 255.0, 0.9, 0.0))
    for one in found.values():
        one.fit.measurement.analyser.named = named
        if one.added:
            one.fit.marginal.nothing_left, one.done, one.leaves_nothing, one.fit.explained = 1.0, True, True, True
    decision = decided(found[()].fit, found)  # type: ignore[arg-type]
    assert decision.accepted
    assert effects in decision.named
    assert (decision.absorbing_instead is None) == named


def of_a_winding_alone(*models: SimpleNamespace) -> dict[tuple[str, ...], SimpleNamespace]:
    """As `of`, for one short-circuit sweep."""
    found = of(*models)
    for one in found.values():
        one.fit.measurement.terminations = ("short",)
    return found


def test_of_a_winding_alone_what_is_commonest_is_named_first_in_its_family():
    """A core with four turns: a choke of the same ferrite beside a winding errs a little less than a winding with a core."""
    models = (
        model((), 0.0, 75.8, 74.0),
        model(("suppressor-choke",), 600.0, 3.07, 3.0),
        model(("permeability-relaxation",), 560.0, 3.84, 3.7),
        model(("core-loss",), 500.0, 13.0, 12.0),
    )
    found = of_a_winding_alone(*models)
    judgement = decided(found[()].fit, found)  # type: ignore[arg-type]
    assert judgement.named == ("permeability-relaxation",)
    assert judgement.families == {"permeability-relaxation": ("suppressor-choke",)}
    assert judgement.commoner_than is models[1]
    for one in models:
        one.fit.measurement.terminations = ("short", "open")
    judgement = decided(found[()].fit, found)  # type: ignore[arg-type]
    assert (judgement.named, judgement.commoner_than) == (("suppressor-choke",), None)


@pytest.mark.parametrize(("error_of_both", "named"), [(0.13, ("skin-effect", "dielectric-loss@Ca")), (0.3, ("permeability-relaxation",))])
def test_losses_of_copper_and_insulation_come_before_a_core_that_describes_a_winding_no_better(error_of_both, named, monkeypatch):
    """Five turns in air: two effects, but no coincidence, and the likelihood of assumed errors of an analyser does not decide."""
    found = of_a_winding_alone(
        model((), 0.0, 1.23, 1.2),
        model(("permeability-relaxation",), 560.0, 0.126, 0.12),
        model(("skin-effect",), 100.0, 0.42, 0.42),
        model(("dielectric-loss@Ca",), 90.0, 0.82, 0.8),
        model(("skin-effect", "dielectric-loss@Ca"), 500.0, error_of_both, error_of_both),
    )
    for key in (("permeability-relaxation",), ("dielectric-loss@Ca", "skin-effect")):
        one = found[key]
        one.fit.marginal.nothing_left, one.done, one.leaves_nothing, one.fit.explained = 1.0, True, True, True
    monkeypatch.setattr(Candidate, "unusual", ())
    found = {key: Candidate(one.added, one.fit, one.score, ()) if len(key) == 2 else one for key, one in found.items()}
    judgement = decided(found[()].fit, found)  # type: ignore[arg-type]
    assert judgement.named == named
    if len(named) == 2:
        assert judgement.probability == pytest.approx(0.5, abs=0.01)
        assert judgement.instead_of_every_winding is found[("permeability-relaxation",)]


@pytest.mark.parametrize(("analyser_is_named", "needed"), [(True, True), (False, False)])
def test_what_little_an_effect_leaves_is_no_further_error_of_an_analyser_without_a_name(analyser_is_named, needed):
    """A drum core: a gain error takes 0.036 % to 0.018 %, and the sizes of such errors are estimated from the sweep anyway."""
    core, both = ("dielectric-relaxation@Ca",), ("dielectric-relaxation@Ca", "gain-error")
    one, two = model(core, 300.0, 0.756, 0.036, analyser_sigma=55.0), model(both, 330.0, 0.571, 0.018, analyser_sigma=43.0)
    found = of(model((), 0.0, 22.0, 21.0), one, two)
    for one in found.values():
        one.fit.measurement.analyser.named = analyser_is_named
    judgement = Judgement(found[()].fit, found, believe(found))  # type: ignore[arg-type]
    assert (judgement.best.added == both) == needed


@pytest.mark.parametrize(("quality", "overdamped"), [(0.4, True), (0.67, False)])
def test_a_winding_that_does_not_resonate_is_none_that_is_coupled(quality, overdamped):
    label = "field-coupling"
    motor = add_effects(dc_motor(), [label])
    own = {f"{label}.coupling": 0.3, f"{label}.resonance_hz": 2.5e6, f"{label}.quality": quality}
    # However little the sweep says about its damping: without a resonance it is a loss, which has other causes.
    said = unusual_values(motor, {label}, own, {name: 10 * value for name, value in own.items()})
    assert bool(said) == overdamped


def test_where_nothing_is_accepted_the_commonest_of_the_closest_effects_is_shown_first():
    """A drum core to 200 kHz: a shorted turn and a cage come as close as its own losses."""
    ranked = [
        model(("shorted-turn",), 0.0, 0.416, 0.35),
        model(("eddy-laminations",), 0.0, 0.459, 0.4),
        model(("skin-effect",), 0.0, 0.464, 0.4),
        model(("dielectric-loss@Ca",), 0.0, 0.9, 0.8),
    ]
    names = [one.effect for one in commonest_of_the_closest_first(ranked)]  # type: ignore[arg-type]
    assert names == ["skin-effect", "eddy-laminations", "shorted-turn", "dielectric-loss@Ca"]


def test_a_circuit_that_only_large_errors_of_the_analyser_complete_leaves_something():
    """A core of ferrite: core loss and a gain error of 30 % leave 3.8 %, which the likelihood gives to the analyser; a relaxing core errs less."""
    found = of(
        model((), 0.0, 65.8, 65.0),
        model(("core-loss",), 500.0, 12.5, 11.0),
        model(("permeability-relaxation",), 497.0, 3.67, 2.9),
        model(("core-loss", "gain-error"), 560.0, 5.75, 3.8, analyser_sigma=8.8),
    )
    found[("core-loss", "gain-error")].fit.marginal.nothing_left = 0.8
    judgement = decided(found[()].fit, found)  # type: ignore[arg-type]
    assert judgement.named == ("permeability-relaxation",)


@pytest.mark.parametrize("of_waves", [False, True])
def test_a_further_effect_that_takes_the_circuit_further_away_is_not_needed_beside_assumed_errors(of_waves):
    """A drum core on an analyser that nobody named: what a choke beside a relaxing capacitance takes is what the analyser was assumed to do."""
    core, both = ("dielectric-relaxation@Ca",), ("dielectric-relaxation@Ca", "suppressor-choke")
    one, two = model(core, 300.0, 0.618, 0.42, analyser_sigma=40.0), model(both, 900.0, 1.14, 0.14, analyser_sigma=0.7)
    found = of(model((), 0.0, 17.0, 17.0), one, two)
    for each in found.values():
        each.fit.measurement.analyser.by_waves = of_waves
    judgement = Judgement(found[()].fit, found, believe(found))  # type: ignore[arg-type]
    assert judgement.best.added == (both if of_waves else core)


def by_a_named_analyser(*models: SimpleNamespace) -> dict[tuple[str, ...], SimpleNamespace]:
    for one in models:
        one.fit.measurement.analyser.named = True
    return of(*models)


@pytest.mark.parametrize(
    ("left_percent", "sigma", "unusual", "named"),
    [
        # A choke at the brushes behind a capacitor.
        (0.065, 8.0, (), True),
        # More than a fiftieth of what the circuit leaves, or than a tenth of what the capacitor does.
        (1.4, 8.0, (), False),
        (0.5, 8.0, (), False),
        # As large errors of the analyser as with the capacitor alone, or values that no motor has.
        (0.065, 45.0, (), False),
        (0.065, 8.0, ("suppressor-choke@brushes.share",), False),
    ],
)
def test_a_pair_is_named_before_one_effect_that_is_worse_and_needs_larger_errors(left_percent, sigma, unusual, named):
    pair = ("suppressor-capacitor", "suppressor-choke@brushes")
    found = by_a_named_analyser(
        model((), 0.0, 63.7, 63.7, (), 44.5),
        model(pair[:1], 3700.0, 4.18, 4.18, (), 40.7),
        model(pair, 6700.0, 0.66, left_percent, unusual, sigma),
    )
    judgement = decided(found[()].fit, found)  # type: ignore[arg-type]
    assert judgement.named == (pair if named else pair[:1])
    assert judgement.accepted


@pytest.mark.parametrize(
    ("error_percent", "one_error_percent", "named"),
    [
        (0.3, 5.1, True),
        # No tenth of what the wire alone misses by, more than noise and specification leave, or a wire that these already explain.
        (0.6, 5.1, False),
        (2.5, 30.0, False),
        (0.15, 1.9, False),
    ],
)
def test_a_pair_whose_circuit_errs_a_tenth_as_much_is_named_before_one_effect(error_percent, one_error_percent, named):
    """Skin effect of a thick strip behind half a metre of wire: the pair needs larger errors of the analyser than the wire alone."""
    pair = ("lead-inductance", "skin-effect")
    found = by_a_named_analyser(
        model((), 0.0, 160.0, 160.0, (), 0.1),
        model(pair[:1], 2200.0, one_error_percent, one_error_percent, (), 0.9),
        model(pair, 3800.0, error_percent, error_percent, (), 14.9),
    )
    for one in found.values():
        one.fit.floor_percent = 2.1
    judgement = decided(found[()].fit, found)  # type: ignore[arg-type]
    assert (judgement.named, judgement.pair_is_better) == (pair if named else pair[:1], named)


@pytest.mark.parametrize(
    ("left_percent", "error_percent", "unusual", "by_waves", "named"),
    [
        (0.79, 0.83, (), False, True),
        # More than a hundredth, an error of the circuit that the analyser absorbs, values that no motor has, a network analyser.
        (0.95, 0.96, (), False, False),
        (0.79, 2.0, (), False, False),
        (0.79, 0.83, ("distributed-winding.share",), False, False),
        (0.79, 0.83, (), True, False),
    ],
)
def test_a_pair_that_leaves_hardly_anything_is_named_if_nothing_else_is_accepted(left_percent, error_percent, unusual, by_waves, named):
    """A winding of sixty sections behind 0.7 m of leads, whose laws are not quite the catalogue's; neither alone comes near."""
    pair = ("distributed-winding", "lead-inductance")
    found = by_a_named_analyser(
        model((), 0.0, 88.3, 88.3, (), 40.0),
        model(pair[:1], 3700.0, 71.0, 70.0, (), 35.0),
        model(pair, 6700.0, error_percent, left_percent, unusual, 14.0),
    )
    for one in found.values():
        one.fit.measurement.analyser.by_waves = by_waves
    found[()].fit.measurement.floors = (np.full(3, 0.01),)
    judgement = decided(found[()].fit, found)  # type: ignore[arg-type]
    assert (judgement.accepted, judgement.pair_is_better) == (named, named)
    assert judgement.named == pair


@pytest.mark.parametrize(("sigma", "named"), [(5.4, True), (7.0, False)])
def test_a_pair_that_leaves_next_to_nothing_may_need_twice_the_specification(sigma, named):
    """A cable with a lossy slot liner; beyond twice the specification one effect alone, with small errors of the analyser, is named."""
    pair = ("dielectric-loss@Cf", "supply-cable")
    found = by_a_named_analyser(
        model((), 0.0, 76.5, 76.5),
        model(("supply-cable",), 5100.0, 1.96, 1.96, (), 1.0),
        model(pair, 7100.0, 0.43, 0.033, (), sigma),
    )
    judgement = decided(found[()].fit, found)  # type: ignore[arg-type]
    assert sorted(judgement.named) == (list(pair) if named else ["supply-cable"])


def describes_all(one: SimpleNamespace) -> SimpleNamespace:
    one.fit.marginal.nothing_left, one.fit.explained, one.leaves_nothing, one.done = 1.0, True, True, True
    return one


@pytest.mark.parametrize(
    ("second", "error_percent", "left_percent", "by_waves", "behind", "named"),
    [
        ("brush-contact", 0.21, 0.24, False, 6.0, ("rotor-cage",)),
        # A circuit that comes clearly closer, an effect that leaves more than a tenth, a network analyser, a fault of the analyser, a second effect
        # that alone describes the rest.
        ("brush-contact", 0.17, 0.24, False, 6.0, ("rotor-cage", "brush-contact")),
        ("brush-contact", 0.21, 1.2, False, 6.0, ("rotor-cage", "brush-contact")),
        ("brush-contact", 0.21, 0.24, True, 6.0, ("rotor-cage", "brush-contact")),
        ("open-residual", 0.21, 0.24, False, 6.0, ("rotor-cage", "open-residual")),
        ("brush-contact", 0.21, 0.24, False, 40.0, ("rotor-cage", "brush-contact")),
    ],
)
def test_one_effect_within_noise_and_specification_is_not_turned_into_a_pair(second, error_percent, left_percent, by_waves, behind, named):
    """A steel sleeve as a ladder of eight cylinders: its law is not quite that of a cage, and any of four effects describes the rest."""
    others = ("eddy-laminations", "proximity-effect")
    found = by_a_named_analyser(
        model((), 6000.0, 11.6, 11.6, analyser_sigma=4.5),
        model(("rotor-cage",), 10526.0, 0.254, left_percent, analyser_sigma=24.0),
        describes_all(model(("rotor-cage", second), 10900.0, error_percent, 0.0, analyser_sigma=2.0)),
        *(describes_all(model(("rotor-cage", name), 10900.0 - behind, 0.215, 0.0, analyser_sigma=2.0)) for name in others),
    )
    for one in found.values():
        one.fit.floor_percent, one.fit.measurement.analyser.by_waves = 0.33, by_waves
    judgement = decided(found[()].fit, found)  # type: ignore[arg-type]
    assert (judgement.named, judgement.accepted) == (named, True)


@pytest.mark.parametrize(("error_percent", "named"), [(0.2, 2), (0.15, 3)])
def test_a_third_effect_with_which_the_circuit_errs_clearly_more_is_not_named(error_percent, named):
    """A cage of deep bars and a moist slot liner: a resonance of 2 uH beside them only lets the analyser err less."""
    pair, third = ("rotor-cage", "dielectric-relaxation@Cf"), "second-resonance"
    found = by_a_named_analyser(
        model((), 5000.0, 10.6, 10.6, analyser_sigma=5.0),
        model(pair[:1], 11600.0, 3.1, 3.1, analyser_sigma=9.0),
        model(pair, 14010.0, 0.133, 0.132, analyser_sigma=34.0),
        describes_all(model((*pair, third), 14250.0, error_percent, 0.0, analyser_sigma=2.2)),
    )
    judgement = decided(found[()].fit, found)  # type: ignore[arg-type]
    assert (len(judgement.named), judgement.accepted) == (named, True)


def test_a_pair_is_named_before_the_closest_effect_if_the_likeliest_one_describes_nothing(healthy):
    """A suppressor capacitor before a ferrite core: core loss alone is likelier than the capacitor alone, and leaves all of the error."""
    pair = ("core-loss", "suppressor-capacitor")
    found = by_a_named_analyser(
        model((), 10850.0, 64.1, 64.1, analyser_sigma=80.0),
        model(pair[:1], 13225.0, 64.1, 64.1, analyser_sigma=3440.0),
        model(pair[1:], 12748.0, 2.36, 0.65, analyser_sigma=47.0),
        model(pair, 13744.0, 1.23, 0.064, analyser_sigma=7.4),
    )
    found[()].fit.measurement.floors = (np.full(3, 0.3),)
    judgement = decided(found[()].fit, found)  # type: ignore[arg-type]
    assert (judgement.named, judgement.accepted, judgement.pair_is_better) == (pair, True, True)


def test_where_no_set_is_accepted_one_with_usual_values_that_errs_alike_is_shown():
    """Sections of a winding behind leads: a choke with values at their bounds is likelier than the leads, by e^32, and errs as much."""
    spread = "distributed-winding"
    usual = model((spread, "lead-inductance"), 6700.0, 0.83, 0.79, (), 28.0)
    found = by_a_named_analyser(
        model((), 0.0, 88.3, 88.3, (), 40.0),
        model((spread,), 3700.0, 71.0, 70.0, (), 35.0),
        usual,
        model((spread, "suppressor-choke"), 6732.0, 0.83, 0.79, ("suppressor-choke.share",), 25.0),
    )
    found[()].fit.measurement.floors = (np.full(3, 0.01),)
    judgement = decided(found[()].fit, found)  # type: ignore[arg-type]
    assert (judgement.named, judgement.accepted) == (usual.added, True)


def test_an_effect_at_a_bound_that_comes_as_close_is_told_as_family():
    """A rod choke, of which all flux is in the ferrite at the bound: a resonant cell describes it as well."""
    cell, choke = model(("second-resonance",), 7500.0, 2.66, 2.52, (), 14.0), model(("suppressor-choke",), 7570.0, 2.7, 2.59, (), 14.0)
    choke.plausible = choke.ordinary = False
    found = by_a_named_analyser(model((), 0.0, 81.2, 81.2, (), 80.0), cell, choke)
    found[()].fit.measurement.floors = (np.full(3, 0.04),)
    judgement = decided(found[()].fit, found)  # type: ignore[arg-type]
    named = {judgement.named[0], *judgement.families[judgement.named[0]]}
    assert judgement.accepted
    assert named == {"second-resonance", "suppressor-choke"}


def test_instead_of_unusual_values_the_likeliest_that_does_as_well_is_named():
    """A bad short compensation: a capacitor of 413 pF is likelier, and so is a lead with which the analyser errs beyond its specification."""
    residual = model(("short-residual",), 64.0, 0.65, 0.04)
    residual.fit.explained = True
    found = by_a_named_analyser(
        model((), 0.0, 25.5, 20.3, (), 14.6),
        describes_all(model(("suppressor-capacitor",), 100.0, 0.19, 0.0, ("suppressor-capacitor.capacitance_f",))),
        model(("lead-inductance",), 95.0, 0.33, 0.2, (), 10.6),
        residual,
    )
    judgement = decided(found[()].fit, found)  # type: ignore[arg-type]
    assert (judgement.named, judgement.accepted) == (("short-residual",), True)


@pytest.mark.parametrize(("error_percent", "named"), [(2.2, 1), (8.5, 2)])
def test_of_an_analyser_without_a_name_a_pair_has_to_come_clearly_closer_than_one_effect(error_percent, named):
    """A ferrite bead up to 3 GHz: assumed errors of 33 % make two pairs more probable by e^320 than the core alone, whose circuit errs less."""
    core = "permeability-relaxation"
    found = of(
        model((), 0.0, 98.4, 98.3, analyser_sigma=258.0),
        model((core,), 364.0, error_percent, 0.0, analyser_sigma=4.3),
        describes_all(model(("suppressor-capacitor", "core-loss"), 692.0, 10.2, 0.0)),
        describes_all(model(("suppressor-capacitor", core), 685.0, 3.8, 0.0)),
    )
    found[(core,)].fit.marginal.nothing_left = 0.87
    judgement = decided(found[()].fit, found)  # type: ignore[arg-type]
    assert core in judgement.named
    assert (len(judgement.named), judgement.accepted) == (named, True)


@pytest.mark.parametrize(("error_percent", "named"), [(0.315, ()), (0.29, ("field-coupling",))])
def test_less_than_what_counts_is_named_only_if_the_circuit_comes_closer(error_percent, named):
    """A sound motor with flicker between its repeats: a coupled winding takes 0.02 % to nothing, and its circuit errs more than without it."""
    coupled = describes_all(model(("field-coupling",), 81.0, error_percent, 0.0, analyser_sigma=2.1))
    found = by_a_named_analyser(model((), 0.0, 0.302, 0.02, analyser_sigma=2.0), coupled)
    assert decided(found[()].fit, found).named == named  # type: ignore[arg-type]


@pytest.mark.parametrize(("sigma", "named"), [(70.8, "supply-cable"), (6.6, "second-resonance")])
def test_an_effect_with_errors_far_beyond_the_specification_gives_way_to_one_without(sigma, named):
    """A shorted cable of 0.3 m on a NanoVNA; up to four times its specification a network analyser may err."""
    found = by_a_named_analyser(
        model((), 851.0, 1469.0, 876.0, analyser_sigma=40.5),
        model(("second-resonance",), 934.7, 37.9, 36.3, analyser_sigma=sigma),
        describes_all(model(("supply-cable",), 924.9, 56.9, 0.0, analyser_sigma=1.4)),
    )
    found[("second-resonance",)].fit.marginal.nothing_left = 0.82
    for one in found.values():
        one.fit.measurement.analyser.by_waves, one.fit.floor_percent = True, 32.6
    judgement = decided(found[()].fit, found)  # type: ignore[arg-type]
    assert (judgement.named, judgement.accepted) == ((named,), True)


@pytest.mark.parametrize(("error_percent", "named"), [(25.1, 1), (12.0, 2)])
def test_a_second_effect_with_which_the_circuit_errs_beyond_its_floor_is_not_named(error_percent, named):
    """A capacitor of 82 nF across the brushes: leads beside it take the circuit's error from 1 to 25 %, and only the analyser errs less."""
    pair = ("suppressor-capacitor", "lead-inductance")
    found = by_a_named_analyser(
        model((), 9023.0, 75.9, 16.2, analyser_sigma=8.4),
        model(pair[:1], 9202.0, 0.97, 0.69, analyser_sigma=6.6),
        describes_all(model(pair, 9400.0, error_percent, 0.0, analyser_sigma=2.0)),
    )
    for one in found.values():
        one.fit.floor_percent = 20.3
    judgement = decided(found[()].fit, found)  # type: ignore[arg-type]
    assert (judgement.named, judgement.accepted) == (pair[:named], True)


@pytest.mark.parametrize(("thirds", "named"), [(("skin-effect", "brush-contact", "field-coupling"), 2), (("skin-effect", "brush-contact"), 3)])
def test_a_third_effect_that_any_of_several_laws_replaces_is_not_named(thirds, named):
    """A copper sleeve on the magnets beside a wire from the far end: each of the thirds describes what the law of the sleeve leaves."""
    pair = ("shorted-turn", "far-end-tie")
    found = by_a_named_analyser(
        model((), 6000.0, 10.4, 10.4, analyser_sigma=5.0),
        model(pair[:1], 7530.0, 7.47, 7.37, analyser_sigma=17.5),
        model(pair, 10131.0, 0.397, 0.356, analyser_sigma=26.1),
        *(describes_all(model((*pair, third), 10495.0 - at, 0.344, 0.0, analyser_sigma=1.3)) for at, third in enumerate(thirds)),
    )
    for one in found.values():
        one.fit.floor_percent = 0.63
    judgement = decided(found[()].fit, found)  # type: ignore[arg-type]
    assert (len(judgement.named), judgement.accepted) == (named, True)


@pytest.mark.parametrize(("floor_percent", "accepted"), [(46.2, True), (1.0, False)])
def test_a_pair_that_leaves_hardly_anything_may_err_by_what_noise_and_specification_leave(floor_percent, accepted):
    """Laminations beside feed-through capacitors, at whose resonance the impedance is a few milliohms."""
    pair = ("proximity-effect", "suppressor-capacitor@pair")
    found = by_a_named_analyser(
        model((), 6339.0, 47.0, 47.0, analyser_sigma=35.6),
        model(pair[1:], 9786.0, 11.9, 11.86, analyser_sigma=20.8),
        model(pair, 12846.0, 3.63, 0.061, analyser_sigma=7.8),
    )
    for one in found.values():
        one.fit.floor_percent = floor_percent
    found[()].fit.measurement.floors = (np.full(3, 0.01),)
    judgement = decided(found[()].fit, found)  # type: ignore[arg-type]
    assert (judgement.named == pair and judgement.accepted) == accepted


@pytest.mark.parametrize(("left_percent", "acceptance"), [(2.05, "mostly"), (20.0, "not")])
def test_what_describes_nearly_all_is_accepted_whatever_the_analyser_would_err_by(left_percent, acceptance):
    """Two lengths of cable in a box, described as one cable."""
    assert acceptance_of(left(89.3, 89.3, 2154.0), left(left_percent, left_percent, 323.0)) == acceptance  # type: ignore[arg-type]


@pytest.mark.parametrize(("left_percent", "told"), [(0.06, True), (0.12, False)])
def test_a_family_holds_what_leaves_less_than_counts(left_percent, told):
    """A leak in a wet slot, of which a film of the same resistance has nearly the same impedance."""
    film, leak = ("bearing-film",), ("insulation-leakage@Cf",)
    found = of(
        model((), 2011.0, 4.62, 4.6, analyser_sigma=27.7),
        model(film, 2856.0, 0.111, 0.028, analyser_sigma=3.6),
        model(leak, 2805.0, 0.145, left_percent, analyser_sigma=3.7),
    )
    judgement = decided(found[()].fit, found)  # type: ignore[arg-type]
    assert (judgement.named, judgement.families) == (film, {film[0]: leak if told else ()})
