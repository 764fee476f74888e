"""Compare and diagnose, on motors whose impedance the catalogue's formulas did not make."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from diagnosis_contract import check_contract
from few_effects import FEW, seeking
from places import DATA
from scipy.optimize import least_squares

import motoremi as me
from motoremi.blind.cases import Case
from motoremi.data.measurement import Measurement
from motoremi.diagnosis.candidates import at_bounds, possible_effects
from motoremi.diagnosis.candidates import candidate as weighed
from motoremi.diagnosis.diagnosis import closeness
from motoremi.errors import BadInput
from motoremi.inspection.compare import Tolerance
from motoremi.simulate.hidden_effects import DEMO_EFFECTS

pytestmark = pytest.mark.slow


# One motor in some dozens hides its effect behind another; how many do is for the blind test to say.
MISSED = 1


@pytest.mark.parametrize("first", [0, *(pytest.param(first, marks=pytest.mark.case) for first in (1, 2, 3))])
def test_hidden_effects_are_named_and_the_error_falls_to_the_noise(measure, first):
    """Each effect in a motor of its own, every fourth one in each test."""
    missed = []
    for seed, effect in list(enumerate(DEMO_EFFECTS, start=21))[first::4]:
        fit = me.fit(me.dc_motor(), measure(seed, (effect,))[0])
        diagnosis = me.diagnose(fit)
        check_contract(diagnosis.to_dict())
        assert (diagnosis.verdict == "instrument") <= (effect == "open-residual")
        named = {*diagnosis.effects, *(member for family in diagnosis.families for member in family)}
        if effect not in named or len(named) > 3 or diagnosis.verdict not in ("missing-effect", "family", "instrument"):
            missed.append((effect, diagnosis))
            continue
        after = fit.add(diagnosis.effects[0])
        assert after.rms_error_percent < 1.5 * after.floor_percent
        assert after.rms_error_percent < fit.rms_error_percent
        assert after.chi2_reduced < 1.2
    assert len(missed) <= MISSED, missed


@pytest.mark.parametrize("seed", [31, *(pytest.param(seed, marks=pytest.mark.case) for seed in (32, 33))])
def test_motor_that_hides_nothing_is_adequate(measure, seed):
    sweeps, _ = measure(seed)
    diagnosis = me.diagnose(me.fit(me.dc_motor(), sweeps))
    check_contract(diagnosis.to_dict())
    assert diagnosis.verdict == "adequate"
    assert diagnosis.effects == ()


@pytest.mark.case
def test_a_slight_wander_of_the_noise_is_no_effect():
    # One draw of noise in a hundred or so swings slowly enough to look like a shape; this motor hides nothing.
    fit = me.fit(me.dc_motor(), Case(61133490, 135, "none", (), 407090743).sweeps())
    diagnosis = me.diagnose(fit)
    check_contract(diagnosis.to_dict())
    assert diagnosis.verdict == "adequate"
    assert diagnosis.confidence > 0.5
    left = fit.unexplained_percent
    assert left["value"] == left["low"] == 0
    assert left["high"] < fit.noise_percent
    assert fit.corrected_error_percent < 1.2 * fit.noise_percent


@pytest.mark.case
def test_what_passes_for_right_on_few_points_is_sought_again():
    # Two valleys side by side, 58 units of chi-squared apart on the thinned grid: both may be right there, one is on all points.
    diagnosis = me.diagnose(me.fit(me.dc_motor(), Case(85083618, 283, "one", ("eddy-laminations",), 632884074).sweeps()))
    assert diagnosis.effects == ("eddy-laminations",)
    assert diagnosis.best.chi2_reduced < 1.05


def test_two_hidden_effects_are_both_named(measure):
    sweeps, _ = measure(2, ("eddy-laminations", "insulation-leakage@Cf"))
    with seeking({*FEW, "permeability-relaxation", "proximity-effect", "dielectric-relaxation@Cf", "bearing-film"}):
        diagnosis = me.diagnose(me.fit(me.dc_motor(), sweeps))
    named = {*diagnosis.effects, *(member for family in diagnosis.families for member in family)}
    assert {"eddy-laminations", "insulation-leakage@Cf"} <= named
    assert diagnosis.best.rms_error_percent < 1.5 * diagnosis.best.floor_percent


@pytest.mark.case
def test_the_cable_between_analyser_and_motor_is_named(measure):
    """A metre or two: leads, a capacitance across the terminals or a cable of 50 Ohm leave several times as much."""
    sweeps, motor = measure(3, ("supply-cable",))
    with seeking({*FEW, "supply-cable", "cable-delay", "distributed-winding"}):
        diagnosis = me.diagnose(me.fit(me.dc_motor(), sweeps))
    assert diagnosis.effects == ("supply-cable",)
    assert diagnosis.families == ()
    sizes = motor.effects[0].sizes
    found = diagnosis.best.parameters
    assert found["supply-cable.wave_ohm"] == pytest.approx(np.sqrt(sizes["inductance_h"] / sizes["capacitance_f"]), rel=0.02)
    assert found["supply-cable.delay_s"] == pytest.approx(np.sqrt(sizes["inductance_h"] * sizes["capacitance_f"]), rel=0.02)


@pytest.mark.case
def test_three_hidden_effects_are_all_named():
    """Two of them leave 0.15 %, which the third describes."""
    hidden = ("insulation-leakage@Cf", "bearing-film", "frame-eddy")
    base = me.fit(me.dc_motor(), Case(26113101, 56, "two", hidden, 1158718690).sweeps())
    with seeking({*FEW, *hidden}):
        found = me.diagnose(base)
    assert set(found.effects) == set(hidden)
    assert found.best.unexplained_percent["value"] == 0
    assert found.best.rms_error_percent < found.best.floor_percent < base.rms_error_percent


def test_diagnosis_goes_on_from_the_ladder(measure):
    sweeps, _ = measure(2, ("eddy-laminations",))
    solved = me.fit(me.dc_motor(), sweeps).add("eddy-laminations")
    assert me.diagnose(solved).verdict == "adequate"


def test_comparison_finds_where_a_wrong_model_fails(measure):
    sweeps, _ = measure(4, ("second-resonance",))
    comparison = me.compare(me.fit(me.dc_motor(), sweeps))
    assert not comparison.passed
    assert comparison.where
    assert comparison.where[0]["share"] == max(span["share"] for span in comparison.where)
    edges = {tuple(band["band_hz"]) for band in comparison.bands}
    assert (500e3, 5e6) in edges
    worst = max(comparison.bands, key=lambda band: band["max_error_percent"])
    assert worst["verdict"] == "fail"
    assert worst["fails_hz"]
    json.dumps(comparison.to_dict(), allow_nan=False)


def test_comparison_judges_by_the_tolerance_and_by_the_uncertainty(measure):
    sweeps, _ = measure(4)
    fit = me.fit(me.dc_motor(), sweeps)
    assert me.compare(fit).passed
    # A tolerance finer than the measurement itself fails nothing: what is within the uncertainty is not the model's fault.
    fine = me.compare(fit, Tolerance(error_percent=1e-6))
    beyond = [np.mean(curve.significant) for curve in fine.curves.values()]
    assert fine.passed == (max(beyond) == 0)
    curve = me.compare(fit).curves["short"]
    assert np.all(curve.uncertainty_percent > 0)
    with pytest.raises(BadInput, match="above 0"):
        Tolerance(magnitude_db=-1)


def test_effects_are_sought_only_where_the_sweeps_can_see_them(measure):
    sweeps, _ = measure(4)
    short_only = me.fit(me.dc_motor(), [s for s in sweeps if s.termination == "short"])
    names = possible_effects(short_only)
    assert "ground-strap-inductance" not in names
    assert "dielectric-loss@Cf" not in names
    assert "eddy-laminations" in names


def test_parameter_pushed_against_its_bound_is_told(measure):
    sweeps, _ = measure(3, ("insulation-leakage@Cf",))
    fit = me.fit(me.dc_motor(), sweeps, bounds=None)
    wrong = fit.add("dielectric-relaxation@Cr", thorough=False)
    right = fit.add("insulation-leakage@Cf", thorough=False)
    assert at_bounds(right, ("insulation-leakage@Cf",)) == ()
    assert at_bounds(wrong, ("dielectric-relaxation@Cr",))
    # If no model is accepted, the smaller error comes first; at the end of what physics allows it has to be smaller by a factor of two.
    pushed, free = weighed(wrong, fit), weighed(right, fit)
    assert free.fit.rms_error_percent < pushed.fit.rms_error_percent
    assert closeness(free) < closeness(pushed)
    assert closeness(dataclasses.replace(free, at_bound=("its parameter",))) == pytest.approx(2 * free.fit.rms_error_percent)
    assert closeness(pushed) == pytest.approx(2 * pushed.fit.rms_error_percent)


def test_real_inductor_is_not_called_a_motor():
    from motoremi.data.files import read_impedance

    file = DATA / "eth_4294A_inductor" / "impedance.txt"
    sweep = read_impedance(file, "short")
    assert Measurement.of([sweep]).analyser.name == "4294a"
    fit = me.fit(me.dc_motor(), [sweep])
    # The file's own description: 204 uH and about 0.3 ohm.
    assert fit.parameters["La"] == pytest.approx(204e-6, rel=0.01)
    assert fit.parameters["Ra"] == pytest.approx(0.3, rel=0.2)
    assert {"Rr", "Lr", "Cr", "Cf"} == set(fit.unseen())
    # What is left is within the specification altogether. Its lowest frequencies ask for ten standard deviations of a residual, so that what
    # is called undescribed is the error with no more taken off than the specification allows; a tenth more than any three values would leave.
    assert fit.rms_error_percent < fit.floor_percent
    assert fit.unexplained_percent["high"] <= fit.corrected_error_percent < 0.15
    s, z = 2j * np.pi * sweep.frequency_hz, sweep.impedance_ohm

    def error(u):
        winding = np.exp(u[0]) + s * np.exp(u[1])
        return (winding / (1 + s * np.exp(u[2]) * winding) / z - 1).view(float)

    least = least_squares(error, np.log([0.3, 204e-6, 3e-11]), xtol=1e-12)
    assert fit.rms_error_percent < 1.2 * 100 * np.sqrt(2 * least.cost / len(sweep))


@pytest.mark.usefixtures("few_effects")
def test_results_show_themselves(measure):
    sweeps, _ = measure(4, ("core-loss",))
    fit = me.fit(me.dc_motor(), sweeps)
    diagnosis = me.diagnose(fit)
    for result in (fit, me.compare(fit), diagnosis, sweeps[0]):
        assert len(repr(result)) > 20
        assert "<" in result._repr_html_()
        assert isinstance(result.to_dict(), dict)


@pytest.mark.case
def test_a_choke_between_a_capacitor_and_the_brushes_is_not_one_outside_of_it():
    """As in a filter that lets the noise of the brushes meet the choke first."""
    hidden = ("suppressor-capacitor@frame", "suppressor-choke@brushes")
    base = me.fit(me.dc_motor(), Case(1, 0, "two", hidden, 1).sweeps())
    with seeking({*hidden, "suppressor-choke", "second-resonance", "lead-inductance"}):
        found = me.diagnose(base)
    assert set(found.effects) == set(hidden)
    # Without the capacitor it would be the usual place of a choke under another name.
    assert "suppressor-choke@brushes" not in {candidate.effect for candidate in found.candidates}
