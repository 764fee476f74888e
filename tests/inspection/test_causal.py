"""The unrestricted causal model: silent on good data of any motor, loud on data that no circuit can give; sweeps of different motors."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from conftest import FREQUENCY_HZ, simulated_sweeps

import motoremi as me
from motoremi.data.measurement import Measurement
from motoremi.inspection.causal import CausalCheck, check_causality
from motoremi.inspection.sweep_consistency import check_sweep_consistency
from motoremi.simulate.analyser_errors import noise_sd_ohm
from motoremi.simulate.hidden_effects import MOTOR_EFFECTS

pytestmark = pytest.mark.slow


def checked(sweeps: list[me.ImpedanceSweep]) -> CausalCheck:
    return check_causality(Measurement.of(sweeps))


def changed(sweeps: list[me.ImpedanceSweep], termination: str, change: object) -> list[me.ImpedanceSweep]:
    """The sweeps with the impedance of one termination changed."""
    return [
        dataclasses.replace(s, impedance_ohm=change(s.impedance_ohm)) if s.termination == termination else s  # type: ignore[operator]
        for s in sweeps
    ]


@pytest.mark.parametrize("seed", range(900, 900 + len(MOTOR_EFFECTS)))
def test_good_data_of_any_motor_are_causal(seed):
    """One motor for each hidden effect, those outside the catalogue among them, with the analyser's errors within specification."""
    effect = MOTOR_EFFECTS[seed - 900]
    sweeps, motor = simulated_sweeps(seed, (effect,))
    check = checked(sweeps)
    assert check.causal, check
    for termination, model in check.models.items():
        # What the model leaves is the noise, 0.02 % here, more of an ohm; against the truth there remains the analyser's error, up to
        # 0.7 % by fixture.
        truth = motor.impedance(termination, FREQUENCY_HZ)
        # Of the mean of three repeats, real and imaginary part together. Where |Z| is small at a few points these decide, and the sum of their
        # squares scatters: four standard deviations of it.
        variance = 2 * (noise_sd_ohm(FREQUENCY_HZ, truth, 3) / np.abs(truth)) ** 2 / 3
        noise_percent, scatter = 100 * np.sqrt(np.mean(variance)), np.sqrt(np.sum(variance**2)) / np.sum(variance)
        assert model.rms_error_percent < max(0.03, np.sqrt(1 + 4 * scatter) * noise_percent)
        assert model.remainder_hz == ()
        # Of a fraction of an ohm (a suppressor capacitor at resonance) the fixture's residuals are more.
        assert np.sqrt(np.mean(np.abs((model.impedance_ohm(FREQUENCY_HZ) - truth) / np.maximum(np.abs(truth), 10.0)) ** 2)) < 0.02
        assert np.all(model.poles.real < 0)


@pytest.mark.parametrize(("seed", "termination"), [(0, "short"), (1, "open")])
def test_conjugated_phase_over_a_band_is_not_causal(seed, termination):
    sweeps, _ = simulated_sweeps(seed)
    band = (FREQUENCY_HZ > 2e6) & (FREQUENCY_HZ < 4e6)
    check = checked(changed(sweeps, termination, lambda z: np.where(band, z.conj(), z)))
    assert not check.causal
    assert check.models[{"short": "open", "open": "short"}[termination]].describes_the_data
    assert termination in check.reasons[0]
    low, high = check.models[termination].remainder_hz[0][0], check.models[termination].remainder_hz[-1][1]
    assert low < 4e6
    assert high > 2e6


@pytest.mark.parametrize(("reached", "disproved"), [(4.9, False), (7.0, True), (11.0, False), (None, True)])
def test_a_small_rest_disproves_nothing_where_a_circuit_leaves_much_more(reached, disproved):
    """The noise of a single sweep is guessed: a causal model of twelve poles that leaves five times that, and the closest circuit more or less."""
    model = checked(simulated_sweeps(1)[0]).models["short"]
    model = dataclasses.replace(model, order=12, chi2_reduced=25.0, chi2_without_outliers=25.0, rms_error_percent=0.4)
    check = CausalCheck({"short": model}, {} if reached is None else {"short": reached})
    assert not check.causal
    assert check.disproved == disproved
    assert any("physics is most of what is missing" in reason for reason in check.reasons) == (reached == 11.0)


@pytest.mark.parametrize(("reached", "disproved"), [(8.0, True), (40.0, False)])
def test_a_few_points_that_stand_out_are_not_the_cause_of_a_large_error(reached, disproved):
    """All but they are described; with them five times the noise is left, by the closest circuit more."""
    model = checked(simulated_sweeps(1)[0]).models["short"]
    model = dataclasses.replace(model, chi2_reduced=25.0, chi2_without_outliers=1.0, outliers_hz=(5e6,), rms_error_percent=0.4)
    assert CausalCheck({"short": model}, {"short": reached}).disproved == disproved


@pytest.mark.parametrize(("percent", "disproved"), [(0.05, False), (0.2, True)])
def test_an_error_that_range_switches_of_a_good_analyser_may_leave_disproves_nothing(percent, disproved):
    """Of a motor by other laws on an analyser with steps of 0.06 %, the causal model left twice the noise, 0.03 %."""
    model = checked(simulated_sweeps(1)[0]).models["short"]
    model = dataclasses.replace(model, order=12, chi2_reduced=6.0, chi2_without_outliers=6.0, rms_error_percent=percent)
    check = CausalCheck({"short": model}, {"short": 4.0})
    assert check.disproved == disproved
    assert any("range switches" in reason for reason in check.reasons) == (not disproved)


@pytest.mark.parametrize(
    ("analyser", "accuracy", "least", "most"), [("4294a", None, 0.08, 0.08), ("nanovna", None, 0.1, 1.0), ("4294a", "2", 2.0, 2.0)]
)
def test_what_an_analyser_may_err_by_says_how_large_an_error_shows_anything(analyser, accuracy, least, most):
    """A wound core on a NanoVNA: 0.13 %, where it may err by 5 %, were told as data that no fixed circuit describes."""
    more = {} if accuracy is None else {"accuracy_percent": accuracy}
    sweeps = [one.with_metadata(analyser=analyser, **more) for one in simulated_sweeps(1)[0]]
    assert least <= checked(sweeps).models["short"].accuracy_percent <= most


def test_a_point_that_does_not_raise_the_error_above_the_noise_is_told_and_disproves_nothing():
    """A station in the sweep of a motor with a choke whose law is not the catalogue's: an analyser beyond its specification describes the rest."""
    model = checked(simulated_sweeps(1)[0]).models["short"]
    check = CausalCheck({"short": dataclasses.replace(model, chi2_reduced=1.0, outliers_hz=(5e6,))}, {"short": 1.1})
    assert not check.disproved
    assert "outliers at 5e+06 Hz" in check.reasons[0]


def test_a_line_with_more_resonances_than_the_model_has_poles_is_told():
    """A shorted line of 200 m: about forty resonances below 30 MHz, and about seven of one of 30 m."""
    frequency, rng = np.geomspace(150e3, 30e6, 1201), np.random.default_rng(1)
    noise = 1 + 1e-4 * (rng.normal(size=frequency.size) + 1j * rng.normal(size=frequency.size))
    for metres, more in ((200.0, True), (30.0, False)):
        angle = metres * (2j * np.pi * frequency / 2e8 + 2e-3 * np.sqrt(frequency / 1e6))
        assert checked([me.ImpedanceSweep("short", frequency, 50 * np.tanh(angle) * noise)]).needs_more_poles == more


@pytest.mark.parametrize("seed", range(2))
def test_half_a_sweep_from_a_warmer_motor_is_not_causal(seed):
    """The upper half is of a motor whose resonances lie 2 % lower: two runs put together."""
    sweeps, motor = simulated_sweeps(seed)
    warm = motor.impedance("open", FREQUENCY_HZ * 1.02) / motor.impedance("open", FREQUENCY_HZ)
    upper = FREQUENCY_HZ > 3e6
    assert not checked(changed(sweeps, "open", lambda z: np.where(upper, z * warm, z))).causal


def test_an_outlier_is_named_by_its_frequency():
    """One near the end of a sweep, where it is not held against its neighbours before."""
    sweeps, _ = simulated_sweeps(4)
    spike = np.ones(FREQUENCY_HZ.size)
    spike[2] = 1.02
    check = checked(changed(sweeps, "open", lambda z: z * spike))
    assert not check.causal
    assert any(abs(f / FREQUENCY_HZ[2] - 1) < 1e-6 for f in check.models["open"].outliers_hz)


def test_the_check_is_plain_data():
    check = checked(simulated_sweeps(1)[0])
    document = check.to_dict()
    assert document["causal"] is True
    assert {entry["sweep"] for entry in document["sweeps"]} == {"short", "open"}
    assert "reaches the noise" in repr(check)


def test_sweeps_of_two_motors_fit_alone_but_not_together():
    first, _ = simulated_sweeps(21)
    second, _ = simulated_sweeps(22)
    mixed = [s for s in first if s.termination == "short"] + [s for s in second if s.termination == "open"]
    found = check_sweep_consistency(me.fit(me.dc_motor(), mixed))
    assert found is not None
    assert not found.belong
    assert "two different motors" in found.sentence
    assert {d.element for d in found.disagreements} >= {"La"}


def test_sweeps_of_one_motor_belong_together_and_one_sweep_says_nothing():
    sweeps, _ = simulated_sweeps(21)
    found = check_sweep_consistency(me.fit(me.dc_motor(), sweeps))
    assert found is not None
    assert found.belong
    assert "can be of one motor" in found.sentence
    assert check_sweep_consistency(me.fit(me.dc_motor(), sweeps[:3])) is None


def test_a_missing_effect_is_not_blamed_on_the_sweeps():
    sweeps, _ = simulated_sweeps(7, ("eddy-laminations",))
    found = check_sweep_consistency(me.fit(me.dc_motor(), sweeps))
    assert found is not None
    assert found.belong
    assert "something is missing in the model" in found.sentence
