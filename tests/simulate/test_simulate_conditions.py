"""Reactions of the simulated motor, leads, analyser and operator to requested conditions."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

from motoremi.arrays import ComplexArray
from motoremi.data.conditions import CONDITIONS, STANDARDS, VALUES, condition
from motoremi.data.sweep import TERMINATIONS, Termination
from motoremi.errors import BadInput
from motoremi.simulate.analyser_errors import SimulatedAnalyser
from motoremi.simulate.arrangement import Arrangement
from motoremi.simulate.hidden_effects import MOTOR_EFFECTS
from motoremi.simulate.operator import MISTAKEN, Mistake, Operator
from motoremi.simulate.response import COPPER_PER_KELVIN, SILENT, Responses
from motoremi.simulate.simulated_motor import SimulatedMotor
from motoremi.simulate.specimen import Specimen
from motoremi.simulate.stand import AMBIENT_DEGC

BAND = np.geomspace(150e3, 30e6, 61)
WARM = AMBIENT_DEGC + 30


def seen(motor: SimulatedMotor, name: str, termination: Termination = "open", value: float | None = None, seed: int = 5) -> ComplexArray:
    return Specimen(motor, seed).impedance(termination, BAND, name, value)


@pytest.mark.slow
@pytest.mark.parametrize("effect", MOTOR_EFFECTS)
def test_every_motor_is_passive_under_every_condition(effect: str) -> None:
    specimen = Specimen(SimulatedMotor.random(3, [effect]), 3)
    nothing_moves = {"wide-sweep", "sweep-downwards", "contacts-cleaned", "repeat-compensation"}
    for name in set(CONDITIONS) - set(STANDARDS) - nothing_moves:
        for termination in TERMINATIONS:
            impedance = specimen.impedance(termination, BAND, name)
            assert np.all(np.isfinite(impedance)), name
            # A lossless path may lose its last digit.
            assert np.all(impedance.real >= -1e-9 * np.abs(impedance)), name


def test_copper_answers_by_its_own_coefficient_in_every_motor() -> None:
    for seed in range(20):
        motor = SimulatedMotor.random(seed)
        assert Responses(motor, seed).under("second-temperature", WARM).Ra == pytest.approx(motor.Ra * (1 + 30 * COPPER_PER_KELVIN), rel=1e-12)


def test_a_motor_without_a_condition_is_the_motor_itself() -> None:
    motor = SimulatedMotor.random(4, ["eddy-laminations", "ground-strap-inductance"])
    for termination in TERMINATIONS:
        assert np.array_equal(seen(motor, "", termination), motor.impedance(termination, BAND))


def test_warm_copper_is_the_same_field_in_a_worse_conductor() -> None:
    """Skin effect: a wire of less conductivity is described by a thinner one of the same resistance; its internal inductance stays."""
    motor = SimulatedMotor.random(6, ["skin-effect"])
    warm = Responses(motor, 6).under("second-temperature", WARM)
    size = "radius_m"
    ratio = (warm.effects[0].sizes[size] / motor.effects[0].sizes[size]) ** 2 * warm.Ra / motor.Ra
    assert ratio == pytest.approx(1, rel=1e-12)


def test_one_effect_in_ten_does_not_answer_and_the_others_within_a_factor_of_two() -> None:
    motor = SimulatedMotor()
    strengths = np.array([Responses(motor, seed).strength("second-temperature", "dielectric-loss@Cf") for seed in range(2000)])
    silent = strengths == 0
    # Four standard deviations of a binomial share.
    assert abs(silent.mean() - SILENT) < 4 * np.sqrt(SILENT * (1 - SILENT) / strengths.size)
    assert strengths[~silent].min() >= 0.5
    assert strengths[~silent].max() <= 2.0
    assert np.median(strengths[~silent]) == pytest.approx(1, rel=0.1)


def responding(condition_name: str, name: str) -> int:
    """A seed for which this part of the motor responds."""
    return next(seed for seed in range(50) if Responses(SimulatedMotor(), seed).strength(condition_name, name) > 0.7)


@pytest.mark.parametrize(
    ("effect", "name", "size", "grows"),
    [
        ("dielectric-loss@Cf", "second-temperature", "tan_delta", True),
        ("dielectric-relaxation@Ca", "second-temperature", "corner_hz", True),
        ("insulation-leakage@Cf", "second-temperature", "resistance_ohm", False),
        ("insulation-leakage@Cf", "dried", "resistance_ohm", True),
        ("dielectric-loss@Cf", "dried", "tan_delta", False),
        ("second-resonance", "end-turn-touched", "capacitance_f", True),
        ("terminal-capacitance", "terminal-block", "capacitance_f", False),
        ("ground-strap-inductance", "longer-strap", "inductance_h", True),
        ("eddy-laminations", "second-temperature", "corner_hz", True),
    ],
)
def test_what_answers_answers_in_the_right_direction(effect: str, name: str, size: str, grows: bool) -> None:
    seed = responding(name, effect)
    motor = SimulatedMotor.random(8, [effect])
    after = Responses(motor, seed).under(name).effects[0].sizes[size] / motor.effects[0].sizes[size]
    assert (after > 1.02) if grows else (after < 0.98)


def test_a_bias_takes_the_iron_down_and_more_of_it_takes_more() -> None:
    seed = responding("dc-bias", "iron")
    motor = SimulatedMotor.random(9, ["eddy-laminations"])
    answers = Responses(motor, seed)
    share, corner = motor.effects[0].sizes["share"], motor.effects[0].sizes["corner_hz"]
    left = []
    for ampere in (0.5, 1.0, 4.0):
        biased = answers.under("dc-bias", ampere)
        permeability = answers.permeability(ampere)
        sizes = biased.effects[0].sizes
        # The inductance of the air stays, that of the iron is scaled by its permeability, the corner frequency by the inverse.
        assert biased.La * (1 - sizes["share"]) == pytest.approx(motor.La * (1 - share), rel=1e-12)
        assert biased.La * sizes["share"] == pytest.approx(motor.La * share * permeability, rel=1e-12)
        assert sizes["corner_hz"] == pytest.approx(corner / permeability, rel=1e-12)
        left.append(permeability)
    assert left == sorted(left, reverse=True)
    assert answers.under("dc-bias", -1.0).La == answers.under("dc-bias", 1.0).La


def test_a_shaft_is_somewhere_else_each_time() -> None:
    motor = SimulatedMotor.random(10, ["bearing-film"])
    answers = Responses(motor, responding("shaft-turned", "bearing-film"))
    first, again, second = (answers.under("shaft-turned", None, turn).effects[0].sizes["resistance_ohm"] for turn in (0, 0, 1))
    assert first == again != second


def test_a_longer_lead_is_about_what_it_is_said_to_be() -> None:
    motor = SimulatedMotor.random(11)
    added = (seen(motor, "longer-lead", "short", 50e-9) - seen(motor, "", "short")).imag / (2 * np.pi * BAND)
    assert added == pytest.approx(50e-9, rel=0.2)


def test_a_known_capacitor_lies_across_the_terminals() -> None:
    motor = SimulatedMotor.random(12)
    added = (1 / seen(motor, "known-capacitor", "open", 100e-12) - 1 / seen(motor, "", "open")).imag / (2 * np.pi * BAND)
    assert added == pytest.approx(100e-12, rel=0.05)


def test_the_far_end_on_the_frame_is_the_winding_behind_the_strap() -> None:
    plain, strapped = SimulatedMotor.random(13), SimulatedMotor.random(13, ["ground-strap-inductance"])
    assert seen(plain, "far-end-grounded") == pytest.approx(plain.impedance("short", BAND), rel=1e-9)
    strap = strapped.effects[0].sizes
    skin = strap["skin_ohm"] * (1 + 1j) * np.sqrt(BAND / 1e6)
    expected = plain.impedance("short", BAND) + strap["resistance_ohm"] + 2j * np.pi * BAND * strap["inductance_h"] + skin
    # The simulated strap is a round wire, whose penetration depth at 150 kHz is a sixth of its radius.
    assert seen(strapped, "far-end-grounded") == pytest.approx(expected, rel=1e-4)


def test_at_the_commutator_bars_brushes_and_suppressors_are_left_behind() -> None:
    hidden = SimulatedMotor.random(14, ["brush-contact", "suppressor-capacitor@pair"])
    bare = dataclasses.replace(hidden, effects=())
    # Except for the new contact positions it is the motor without brushes and suppressor.
    assert np.abs(np.log(seen(hidden, "brushes-lifted", "short") / bare.impedance("short", BAND)))[:20].max() < 0.2
    assert np.abs(np.log(hidden.impedance("short", BAND) / bare.impedance("short", BAND))).max() > 0.5


@pytest.mark.parametrize("with_copper", [False, True])
def test_the_first_sweep_repeated_shows_the_drift(with_copper: bool) -> None:
    motors = (SimulatedMotor.random(seed, ["temperature-drift"]) for seed in itertools.count(15))
    motor = next(one for one in motors if bool(one.effects[0].sizes["resistance_rise"]) == with_copper)
    steady = dataclasses.replace(motor, effects=())
    rise, copper = (motor.effects[0].sizes[f"{what}_rise"] for what in ("capacitance", "resistance"))
    capacitances = {name: getattr(steady, name) * (1 + rise) for name in ("Ca", "Cr", "Cf")}
    warm = dataclasses.replace(steady, Ra=steady.Ra * (1 + copper), **capacitances)
    assert seen(motor, "repeat-first-sweep", "short") == pytest.approx(warm.impedance("short", BAND), rel=1e-12)
    assert seen(motor, "", "short") == pytest.approx(steady.impedance("short", BAND), rel=1e-12)


def test_single_values_are_those_of_the_parts() -> None:
    motor = SimulatedMotor.random(16, ["lead-inductance"])
    specimen = Specimen(motor, 16)
    # A lead of the sweeps is not between the motor's own terminals.
    assert specimen.single_value("dc-resistance") == pytest.approx(motor.Ra, rel=1e-9)
    assert specimen.single_value("insulation-resistance") > 1e9
    assert specimen.single_value("capacitance-1khz") == pytest.approx(motor.Cf + motor.Cr, rel=1e-3)
    assert 0.05 < specimen.single_value("lead-length") < 0.5
    leaking = Specimen(SimulatedMotor.random(16, ["insulation-leakage@Cf"]), 16)
    assert leaking.single_value("insulation-resistance") == pytest.approx(leaking.motor.effects[0].sizes["resistance_ohm"], rel=0.01)
    with pytest.raises(BadInput, match="no single value 'mood'"):
        specimen.single_value("mood")


@pytest.mark.parametrize("name", VALUES)
def test_every_meter_states_an_uncertainty_that_holds(name: str) -> None:
    specimen = Specimen(SimulatedMotor.random(17, ["dielectric-loss@Cf"]), 17)
    truth = min(specimen.single_value(name), 1e10)
    off = [
        (Arrangement(specimen, turn=turn).single_value(name).value_si - truth) / Arrangement(specimen, turn=turn).single_value(name).sigma
        for turn in range(40)
    ]
    assert np.std(off) < 1.5


def test_repeating_the_compensation_mends_the_fixture_and_nothing_else() -> None:
    analyser = SimulatedAnalyser(18, faults=["open-residual", "range-step"])
    specimen = Specimen(SimulatedMotor.random(18), 18)
    after = Arrangement(specimen, condition("repeat-compensation")).analyser(analyser)
    assert set(after.faults) == {"range-step"}
    assert set(analyser.faults) == {"open-residual", "range-step"}
    assert Arrangement(specimen, condition("second-temperature", 53.0)).analyser(analyser) is analyser


def test_sweeps_say_what_they_are_under_and_share_the_analysers_errors() -> None:
    analyser = SimulatedAnalyser(19)
    specimen = Specimen(SimulatedMotor.random(19), 19)
    asked = condition("known-capacitor", 1e-10)
    sweeps = Arrangement(specimen, asked).sweeps(analyser.with_noise("a"), BAND, 7)
    assert [(sweep.termination, sweep.metadata["connection"], sweep.condition) for sweep in sweeps] == [("short", 7, asked), ("open", 8, asked)]
    error = sweeps[0].impedance_ohm / Arrangement(specimen, asked).impedance("short", BAND) - 1
    # Where residuals of the connection are small, the error is the gain error of the calibration.
    assert np.median(np.abs(error - analyser.gain_error(BAND))) < 1e-3


def test_an_operator_errs_as_often_as_said_and_the_same_way_when_asked_again() -> None:
    made = [Operator(seed).mistake("second-temperature") for seed in range(4000)]
    share = np.mean([mistake is not None for mistake in made])
    assert abs(share - MISTAKEN) < 4 * np.sqrt(MISTAKEN * (1 - MISTAKEN) / len(made))
    assert made[:50] == [Operator(seed).mistake("second-temperature") for seed in range(50)]
    assert Operator(1, mistaken=1.0).mistake("repeats") is None


def test_each_mistake_does_what_it_says() -> None:
    specimen = Specimen(SimulatedMotor.random(20), 20)
    asked = condition("known-capacitor", 1e-10)
    plain = specimen.impedance("open", BAND)
    forgotten = Arrangement(specimen, asked, mistake=Mistake("nothing done", 0))
    assert np.array_equal(forgotten.impedance("open", BAND), plain)
    swapped = Arrangement(specimen, asked, mistake=Mistake("other termination", 1))
    assert np.array_equal(swapped.impedance("open", BAND), specimen.impedance("short", BAND, "known-capacitor", 1e-10))
    assert np.array_equal(swapped.impedance("short", BAND), specimen.impedance("short", BAND, "known-capacitor", 1e-10))
    standard = Arrangement(specimen, condition("fixture-open"), mistake=Mistake("other standard", 0))
    assert np.abs(standard.impedance("open", BAND)).max() < 1
    wires = Arrangement(specimen, mistake=Mistake("two wires", 0)).single_value("dc-resistance")
    assert wires.value_si > Arrangement(specimen).single_value("dc-resistance").value_si + 0.05
    across = Arrangement(specimen, mistake=Mistake("terminals", 0)).single_value("insulation-resistance")
    assert across.value_si < 100
