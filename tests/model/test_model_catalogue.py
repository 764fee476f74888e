"""Every effect over its whole range, alone, repeated and in pairs, on motors drawn from the whole range of the paper's circuit."""

from __future__ import annotations

import functools
import itertools

import numpy as np
import pytest

from motoremi.export.realise import impedance_of
from motoremi.inspection.element_circuit import whole_element
from motoremi.model.circuit import Tape
from motoremi.model.effects import add_effects, find_effect, identifiers
from motoremi.model.motor import BASE_PARAMETERS, BOTH, Motor, dc_motor

FREQUENCY_HZ = np.geomspace(40, 110e6, 161)
S = 2j * np.pi * FREQUENCY_HZ
PHYSICAL = [i for i in identifiers() if find_effect(i).effect.group != "instrument"]
# Rounding of a loss-free element: a real part of 1e-16 of the largest reactance in the circuit, which cancellation near a resonance
# makes up to some thousand times larger than |Z|.
ROUNDING = 1e-11


def tape(motor: Motor, termination: str) -> Tape:
    return Tape(motor.circuit(termination), [p.name for p in motor.parameters])


def drawn(motor: Motor, rng: np.random.Generator, count: int) -> np.ndarray:
    """Parameter sets over the full ranges, a third of the values at an end of theirs."""
    share = rng.uniform(size=(count, len(motor.parameters)))
    corner = rng.uniform(size=share.shape) < 1 / 3
    share = np.where(corner, np.round(share), share)
    low, high = (np.array([getattr(p, end) for p in motor.parameters]) for end in ("low", "high"))
    positive = low > 0
    ratio = np.where(positive, high / np.where(positive, low, 1.0), 1.0)
    return np.where(positive, low * ratio**share, low + (high - low) * share)


def loss_share(motor: Motor, values: np.ndarray) -> float:
    """Smallest Re Z / |Z| over terminations, frequencies and parameter sets."""
    worst = np.inf
    for termination in BOTH:
        impedance = tape(motor, termination).impedance(S, values)
        assert np.all(np.isfinite(impedance))
        worst = min(worst, float(np.min(impedance.real / np.abs(impedance))))
    return worst


@pytest.mark.parametrize("identifier", PHYSICAL)
def test_every_physical_effect_is_passive_on_any_motor(identifier):
    motor = find_effect(identifier).added_to(dc_motor())
    assert loss_share(motor, drawn(motor, np.random.default_rng(11), 400)) >= -ROUNDING


def go_together(first: str, second: str) -> bool:
    return find_effect(second).fits(find_effect(first).added_to(dc_motor()))


def pairs(first: str) -> list[str]:
    return [second for second in PHYSICAL if go_together(first, second)]


@pytest.mark.slow
@pytest.mark.parametrize("first", PHYSICAL)
def test_pairs_combine_and_stay_passive(first):
    rng = np.random.default_rng(12)
    for second in pairs(first):
        motor = add_effects(dc_motor(), (first, second))
        assert motor.effects == (first, second)
        assert loss_share(motor, drawn(motor, rng, 12)) >= -ROUNDING, second


@functools.cache
def elements_changed(identifier: str) -> set[str]:
    """Elements of the paper's circuit that an effect makes different."""
    motor = find_effect(identifier).added_to(dc_motor())
    return {p.name for p in BASE_PARAMETERS if whole_element(motor, p.name) != whole_element(dc_motor(), p.name)}


SAME_ELEMENT = [(a, b) for a, b in itertools.combinations(PHYSICAL, 2) if elements_changed(a) & elements_changed(b) and go_together(a, b)]


@pytest.mark.slow
@pytest.mark.parametrize(("first", "second"), SAME_ELEMENT)
def test_two_effects_on_one_element_stay_passive_and_do_not_depend_on_their_order(first, second):
    motor, other = add_effects(dc_motor(), (first, second)), add_effects(dc_motor(), (second, first))
    values = drawn(motor, np.random.default_rng(5), 250)
    assert loss_share(motor, values) >= -ROUNDING
    place = {p.name: index for index, p in enumerate(motor.parameters)}
    swapped = values[:, [place[p.name] for p in other.parameters]]
    for termination in BOTH:
        one, two = tape(motor, termination).impedance(S, values), tape(other, termination).impedance(S, swapped)
        # Rounding of the sum, which a resonance between 40 Hz and 110 MHz may magnify.
        np.testing.assert_allclose(one, two, rtol=1e-8)


def test_what_two_laws_change_of_one_element_adds_up():
    """Of a capacitance in the admittance, of La and Ra in the impedance, as shells, sheets and branches of a real part do."""
    for name, first, second in (
        ("Cf", "dielectric-loss@Cf", "dielectric-relaxation@Cf"),
        ("La", "eddy-laminations", "permeability-relaxation"),
        ("Ra", "skin-effect", "proximity-effect"),
    ):
        both = add_effects(dc_motor(), (first, second))
        values = started(both)

        def seen(effects, name=name, values=values):
            return impedance_of(whole_element(add_effects(dc_motor(), effects), name), values, FREQUENCY_HZ)

        if name == "Cf":
            np.testing.assert_allclose(1 / seen((first, second)), 1 / seen((first,)) + 1 / seen((second,)) - 1 / seen(()), rtol=1e-12)
        else:
            np.testing.assert_allclose(seen((first, second)), seen((first,)) + seen((second,)) - seen(()), rtol=1e-12)


def in_limit(motor: Motor, values: dict[str, float], identifier: str, label: str) -> dict[str, float]:
    return {**values, **{f"{label}.{name}": value for name, value in find_effect(identifier).effect.limit_values.items()}}


def started(motor: Motor) -> dict[str, float]:
    """A moderate motor with each effect at its first start value."""
    values = {"Ra": 8.0, "La": 12.1e-6, "Ca": 22e-12, "Rr": 39.8, "Lr": 1.6e-6, "Cr": 424e-12, "Cf": 210e-12}
    for parameter in motor.parameters:
        label, _, name = parameter.name.rpartition(".")
        if label:
            values[parameter.name] = find_effect(label.partition("#")[0]).effect.starts[0][name]
    return values


def cuts_a_line(*pair: str) -> bool:
    """Sections beside a line are that line cut up: they vanish as they become many, see `test_sections`."""
    return "winding-sections" in pair and not {"distributed-winding", "machine-winding"}.isdisjoint(pair)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("first", "second"), [pair for pair in itertools.combinations(identifiers(), 2) if go_together(*pair) and not cuts_a_line(*pair)]
)
def test_an_effect_in_its_limit_leaves_the_other_alone(first, second):
    """Effects nest in each other as they nest in the paper's circuit, in both orders."""
    for one, other in ((first, second), (second, first)):
        both, alone = add_effects(dc_motor(), (one, other)), add_effects(dc_motor(), (other,))
        values = in_limit(both, started(both), one, one)
        for termination in BOTH:
            got = tape(both, termination).impedance(S, np.array([values[p.name] for p in both.parameters]))
            expected = tape(alone, termination).impedance(S, np.array([values[p.name] for p in alone.parameters]))
            # Limits are deep but finite: a leakage of 1e18 Ohm, a share of 1e-12.
            np.testing.assert_allclose(got, expected, rtol=1e-5)


def test_repeated_cells_are_independent_and_each_can_vanish():
    """Two and three second resonances: sum of their own impedances, exact derivatives of each."""
    motor = add_effects(dc_motor(), ("second-resonance",) * 3)
    values = started(motor)
    for number, label in enumerate(("second-resonance", "second-resonance#2", "second-resonance#3")):
        values[f"{label}.resonance_hz"] = (3e6, 8e6, 20e6)[number]
        values[f"{label}.resistance_ohm"] = (50.0, 200.0, 800.0)[number]
        values[f"{label}.inductance_h"] = (1e-7, 3e-8, 2e-8)[number]
    base = np.array([values[p.name] for p in dc_motor().parameters])
    vector = np.array([values[p.name] for p in motor.parameters])
    for termination in BOTH:
        expected = tape(dc_motor(), termination).impedance(S, base)
        for label in ("second-resonance", "second-resonance#2", "second-resonance#3"):
            inductance, resonance, resistance = (values[f"{label}.{n}"] for n in ("inductance_h", "resonance_hz", "resistance_ohm"))
            expected = expected + 1 / (1 / (S * inductance) + S / ((2 * np.pi * resonance) ** 2 * inductance) + 1 / resistance)
        got, gradient = tape(motor, termination).gradient(S, vector)
        np.testing.assert_allclose(got, expected, rtol=1e-10)
        for index, parameter in enumerate(motor.parameters):
            size = vector[index] or 1.0
            step = 1e-5 * size
            up, down = vector.copy(), vector.copy()
            up[index] += step
            down[index] -= step
            numeric = (tape(motor, termination).impedance(S, up) - tape(motor, termination).impedance(S, down)) / (2 * step)
            scale = np.abs(got) / size
            np.testing.assert_allclose(gradient[index] / scale, numeric / scale, atol=3e-8, rtol=1e-6, err_msg=parameter.name)


def test_a_range_step_may_occur_twice_at_different_frequencies():
    motor = add_effects(dc_motor(), ("range-step", "range-step"))
    values = started(motor)
    values.update({"range-step.real_step": 0.01, "range-step.frequency_hz": 1e5, "range-step#2.real_step": 0.02, "range-step#2.frequency_hz": 1e7})
    base = np.array([values[p.name] for p in dc_motor().parameters])
    ratio = tape(motor, "short").impedance(S, np.array([values[p.name] for p in motor.parameters])) / tape(dc_motor(), "short").impedance(S, base)
    expected = np.exp(0.01 * (FREQUENCY_HZ >= 1e5) + 0.02 * (FREQUENCY_HZ >= 1e7))
    np.testing.assert_allclose(ratio, expected, rtol=1e-12)


def test_ranges_of_the_papers_elements_are_positive():
    assert all(0 < p.low < p.high and p.reason for p in BASE_PARAMETERS)


def test_a_capacitance_under_two_laws_may_drift_between_the_sweeps():
    names = ("dielectric-loss@Ca", "dielectric-relaxation@Ca", "temperature-drift")
    motor = add_effects(dc_motor(), names)
    values = started(motor)
    still, warm = ({**values, "temperature-drift.capacitance_change": change} for change in (0.0, 0.1))
    names_of = [p.name for p in motor.parameters]
    runner = tape(motor, "open")
    got = runner.impedance(S, np.array([warm[name] for name in names_of]))
    grown = {**still, "Ca": 1.1 * still["Ca"]}
    np.testing.assert_allclose(got, runner.impedance(S, np.array([grown[name] for name in names_of])), rtol=1e-12)
