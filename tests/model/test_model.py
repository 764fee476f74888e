"""Laws, circuits, the paper's motor and the catalogue."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.special import iv, ive

from motoremi.errors import BadInput
from motoremi.model import laws, materials
from motoremi.model.circuit import Tape
from motoremi.model.effects import add_effects, catalogue, find_effect, identifiers
from motoremi.model.materials import COPPER_MU_SIGMA
from motoremi.model.motor import Motor, dc_motor

# Table 1 of the paper, Rr read as ohm, with a damped winding so that no point sits on a singular peak.
TABLE_1 = {"Ra": 8.0, "La": 12.1e-6, "Ca": 22e-12, "Rr": 39.8, "Lr": 1.6e-6, "Cr": 424e-12, "Cf": 210e-12}
FREQUENCY_HZ = np.geomspace(40, 110e6, 201)
S = 2j * np.pi * FREQUENCY_HZ


def values_of(motor: Motor, **changes: float) -> np.ndarray:
    effect_values = {}
    for identifier in motor.effects:
        effect = find_effect(identifier).effect
        for parameter in effect.parameters:
            # What is sought from zero is looked at a little away from it.
            effect_values[f"{identifier}.{parameter.name}"] = effect.starts[0][parameter.name] or 0.02 * parameter.high
    return np.array([{**TABLE_1, **effect_values, **changes}[p.name] for p in motor.parameters])


def tape(motor: Motor, termination: str) -> Tape:
    return Tape(motor.circuit(termination), [p.name for p in motor.parameters])


def test_base_motor_is_equations_1_and_2():
    ra, la, ca, rr, lr, cr, cf = TABLE_1.values()
    winding = (ra + S * la) / (1 + S * ra * ca + S**2 * la * ca)
    frame = (1 + S * rr * cr + S**2 * lr * cr) / (S * (cf + cr) + S**2 * rr * cr * cf + S**3 * lr * cr * cf)
    motor = dc_motor()
    # The polynomials of eq. (2) cancel by up to 6 digits where s^3 meets s; that bounds the agreement.
    np.testing.assert_allclose(tape(motor, "short").impedance(S, values_of(motor)), winding, rtol=1e-10)
    np.testing.assert_allclose(tape(motor, "open").impedance(S, values_of(motor)), winding + frame, rtol=1e-9)


@pytest.mark.parametrize("identifier", identifiers())
def test_effect_vanishes_in_its_limit(identifier):
    added = find_effect(identifier)
    motor = added.added_to(dc_motor())
    limit = {f"{identifier}.{name}": value for name, value in added.effect.limit_values.items()}
    for termination in ("short", "open"):
        expected = tape(dc_motor(), termination).impedance(S, values_of(dc_motor()))
        got = tape(motor, termination).impedance(S, values_of(motor, **limit))
        np.testing.assert_allclose(got, expected, rtol=1e-5)


@pytest.mark.parametrize("identifier", identifiers())
def test_effect_matters_away_from_its_limit(identifier):
    motor = find_effect(identifier).added_to(dc_motor())
    change = (
        max(
            np.max(np.abs(tape(motor, t).impedance(S, values_of(motor)) / tape(dc_motor(), t).impedance(S, values_of(dc_motor())) - 1))
            for t in ("short", "open")
            if identifier != "range-step"
        )
        if identifier != "range-step"
        else 1.0
    )
    assert change > 1e-4


@pytest.mark.parametrize("identifier", ["", *identifiers()])
@pytest.mark.parametrize("termination", ["short", "open"])
def test_derivatives_are_exact(identifier, termination):
    motor = add_effects(dc_motor(), (identifier,) if identifier else ())
    values = values_of(motor)
    runner = tape(motor, termination)
    _, gradient = runner.gradient(S, values)
    used = motor.used_parameters(termination)
    for index, parameter in enumerate(motor.parameters):
        if not parameter.vary:
            continue
        step = 1e-5 * abs(values[index])
        up, down = values.copy(), values.copy()
        up[index] += step
        down[index] -= step
        numeric = (runner.impedance(S, up) - runner.impedance(S, down)) / (2 * step)
        scale = np.abs(runner.impedance(S, values)) / abs(values[index])
        # Central differences: truncation 1e-10 of the third derivative, rounding 1e-16/1e-5.
        np.testing.assert_allclose(gradient[index] / scale, numeric / scale, atol=3e-8, rtol=1e-6)
        assert (parameter.name in used) or not np.any(gradient[index])


@pytest.mark.parametrize("order", [("distributed-winding", "second-resonance"), ("second-resonance", "distributed-winding")])
def test_first_turns_lie_in_front_of_a_distributed_winding(order):
    motor, line = add_effects(dc_motor(), order), add_effects(dc_motor(), ("distributed-winding",))
    henry, resonance_hz, ohm = 3e-7, 6e6, 500.0
    cell = {"inductance_h": henry, "resonance_hz": resonance_hz, "resistance_ohm": ohm, "series_share": 0.0}
    alone = 1 / (1 / (S * henry) + S / ((2 * np.pi * resonance_hz) ** 2 * henry) + 1 / ohm)
    values = values_of(motor, **{f"second-resonance.{name}": value for name, value in cell.items()})
    for termination in ("short", "open"):
        behind = tape(line, termination).impedance(S, values_of(line))
        np.testing.assert_allclose(tape(motor, termination).impedance(S, values), behind + alone, rtol=1e-12)


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
def test_the_damping_of_a_cell_across_it_and_in_series(share):
    """At the ends the circuits are plain; in between, the poles stay, and the resistance at low frequencies is that share of the one in series."""
    henry, resonance_hz, ohm = 3e-7, 6e6, 50.0
    farad = 1 / ((2 * np.pi * resonance_hz) ** 2 * henry)
    in_series = henry / (farad * ohm)
    given, _ = laws.resonant_cell(S, henry, resonance_hz, ohm, share)
    circuits = {0.0: 1 / (1 / (S * henry) + S * farad + 1 / ohm), 1.0: 1 / (1 / (in_series + S * henry) + S * farad)}
    wanted = circuits.get(share, (1 - share) * circuits[0.0] + share * circuits[1.0])
    np.testing.assert_allclose(given, wanted, rtol=1e-12)


def test_batches_equal_single_evaluations():
    motor = add_effects(dc_motor(), ("eddy-laminations", "distributed-winding", "lead-inductance"))
    runner = tape(motor, "open")
    batch = values_of(motor) * np.random.default_rng(1).uniform(0.8, 1.2, (5, len(motor.parameters)))
    together, slopes = runner.gradient(S, batch)
    for row, impedance, slope in zip(batch, together, slopes, strict=True):
        np.testing.assert_array_equal(runner.impedance(S, row), impedance)
        np.testing.assert_allclose(runner.gradient(S, row)[1], slope, rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("identifier", [i for i in identifiers() if find_effect(i).effect.group != "instrument"])
def test_physical_effects_are_passive_over_their_range(identifier):
    added = find_effect(identifier)
    motor = added.added_to(dc_motor())
    rng = np.random.default_rng(7)
    for _ in range(60):
        drawn = {}
        for p in added.effect.parameters:
            edge = rng.choice([0.0, 1.0, rng.uniform()])
            drawn[f"{identifier}.{p.name}"] = p.low * (p.high / p.low) ** edge if p.low > 0 else p.low + edge * (p.high - p.low)
        for termination in ("short", "open"):
            impedance = tape(motor, termination).impedance(S, values_of(motor, **drawn))
            # A loss-free element leaves a real part of rounding size beside its reactance.
            assert np.all(impedance.real >= -1e-9 * np.abs(impedance))


def evaluate_formula(text: str, names: dict[str, object]) -> np.ndarray:
    """The catalogue's formula text: an expression, then definitions after commas."""
    expression, *definitions = re.split(r",\s*(?=\w+ = )", text)
    scope = dict(names)
    for definition in reversed(definitions):
        name, body = definition.split(" = ", 1)
        scope[name] = eval(body, {"__builtins__": {}}, scope)
    return eval(expression, {"__builtins__": {}}, scope)


@pytest.mark.parametrize("identifier", identifiers())
def test_formula_text_equals_the_code(identifier):
    added = find_effect(identifier)
    effect, place = added.effect, added.place
    motor = added.added_to(dc_motor())
    runner, base = tape(motor, "open"), tape(dc_motor(), "open")
    frequency = np.geomspace(150e3, 30e6, 60)
    s = 2j * np.pi * frequency
    start = {**effect.starts[0]}
    if identifier == "range-step":
        start.update(real_step=0.03, imaginary_step=-0.02, frequency_hz=5e6)
    if "end_share" in start:
        start.update(end_share=0.3)
    names: dict[str, object] = {
        **TABLE_1, **start, "s": s, "f": frequency, "pi": np.pi, "sqrt": np.sqrt, "tanh": np.tanh, "exp": np.exp, "atan": np.arctan,
        "I0": lambda x: iv(0, x), "I1": lambda x: iv(1, x), "mu0": 1.0, "sigma_copper": COPPER_MU_SIGMA,
    }  # fmt: skip
    termination = "short" if identifier in ("distributed-winding", "machine-winding", "winding-sections", "far-end-tie") else "open"
    if termination == "short":
        runner = tape(motor, "short")
    got = runner.impedance(s, values_of(motor, **{f"{identifier}.{k}": v for k, v in start.items()}))
    ra, la, ca, rr, lr, cr, cf = TABLE_1.values()
    element = {"Ra": ra, "La": s * la, "Ca": 1 / (s * ca), "Rr": rr, "Lr": s * lr, "Cr": 1 / (s * cr), "Cf": 1 / (s * cf)}

    def network(**change: np.ndarray) -> np.ndarray:
        e = {**element, **change}
        frame = 1 / (1 / (e["Rr"] + e["Lr"] + e["Cr"]) + 1 / e["Cf"])
        return 1 / (1 / (e["Ra"] + e["La"]) + 1 / e["Ca"]) + frame

    base_z = base.impedance(s, values_of(dc_motor()))
    text = effect.formula
    if effect.group == "insulation":
        formula = evaluate_formula(text, {**names, "C": TABLE_1[place]})
        # These formulas give a capacitance, or for leakage an impedance.
        expected = network(**{place: formula if effect.name == "insulation-leakage" else 1 / (s * formula)})
    elif effect.name in ("skin-effect", "proximity-effect", "brush-contact"):
        expected = network(Ra=evaluate_formula(text, names))
    elif effect.name in ("eddy-laminations", "permeability-relaxation", "core-loss", "field-coupling", "rotor-cage", "shorted-turn"):
        expected = network(La=evaluate_formula(text, names))
    elif effect.name == "bearing-film":
        expected = network(Rr=evaluate_formula(text, names))
    elif effect.name == "frame-eddy":
        expected = network(Lr=evaluate_formula(text, names))
    elif effect.name == "common-mode-flux":
        expected = network(La=evaluate_formula(text.removesuffix(" in the open-circuit sweep"), names))
    elif identifier == "far-end-tie":
        winding = tape(dc_motor(), "short").impedance(s, values_of(dc_motor()))
        expected = evaluate_formula(text, {**names, "Z_winding": winding, "Z_frame": base_z - winding})
    elif effect.name == "winding-modes":
        winding = tape(dc_motor(), "short").impedance(s, values_of(dc_motor()))
        expected = base_z - winding + evaluate_formula(text, {**names, "Z_winding": winding})
    elif identifier == "suppressor-capacitor":
        winding = tape(dc_motor(), "short").impedance(s, values_of(dc_motor()))
        expected = base_z - winding + evaluate_formula(text, {**names, "Z_across": winding})
    elif identifier in ("suppressor-capacitor@frame", "suppressor-capacitor@guarded"):
        expected = evaluate_formula(text, {**names, "Z_across": base_z})
    elif identifier == "suppressor-capacitor@pair":
        winding = tape(dc_motor(), "short").impedance(s, values_of(dc_motor()))
        frame = evaluate_formula(text, {**names, "Z_across": base_z - winding})
        expected = evaluate_formula(text, {**names, "Z_across": winding + frame})
    elif effect.name == "second-resonance":
        expected = base_z + evaluate_formula(text, names)
    elif effect.name in ("distributed-winding", "machine-winding"):
        expected = evaluate_formula(text, names)
    elif effect.name == "winding-sections":
        # The far end is joined to the frame: its node is left out.
        order = np.arange(int(start["sections"]))
        matrices = {
            "T": start["coupling"] ** np.abs(order[:, None] - order), "A": np.eye(order.size) - np.eye(order.size, k=1), "I": np.eye(order.size),
            "W": np.diag(np.where(order == 0, 0.5, 1.0)), "inv": np.linalg.inv, "sum": np.sum,
        }  # fmt: skip
        expected = np.array([evaluate_formula(text, {**names, **matrices, "s": one}) for one in s])
    elif effect.name == "ground-strap-inductance":
        frame = base_z - tape(dc_motor(), "short").impedance(s, values_of(dc_motor()))
        expected = base_z - frame + evaluate_formula(text, {**names, "Z_frame": frame})
    elif effect.name == "temperature-drift":
        insulation, copper = text.removesuffix(" in the open-circuit sweep").split(" and ")
        expected = network(Ca=1 / (s * evaluate_formula(insulation, names)), Ra=evaluate_formula(copper, names))
    elif effect.name == "contact-resistance":
        in_open, in_short = text.split(" sweep, ")
        assert in_short == "Z + short_ohm in the short-circuit sweep"
        expected = evaluate_formula(in_open.removesuffix(" in the open-circuit"), {**names, "Z": base_z})
    elif effect.name == "range-step":
        step = evaluate_formula(text.removesuffix(" from frequency_hz upwards"), {**names, "Z": base_z})
        expected = np.where(frequency >= start["frequency_hz"], step, base_z)
    else:
        expected = evaluate_formula(text, {**names, "Z": base_z})
    np.testing.assert_allclose(got, expected, rtol=1e-8)


def test_effects_combine_and_repeat():
    motor = add_effects(dc_motor(), ("second-resonance", "second-resonance", "dielectric-loss@Cf", "insulation-leakage@Cf"))
    names = [p.name for p in motor.parameters]
    assert "second-resonance.resonance_hz" in names
    assert "second-resonance#2.resonance_hz" in names
    with pytest.raises(BadInput, match="already"):
        add_effects(motor, ("dielectric-loss@Cf",))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("eddy-lamination", "did you mean eddy-laminations"),
        ("dielectric-loss", "needs a place"),
        ("dielectric-loss@La", "cannot be at La"),
        ("core-loss@La", "only one place"),
        ("__import__('os')", "not an effect"),
    ],
)
def test_unknown_effects_are_named_clearly(text, message):
    with pytest.raises(BadInput, match=message):
        find_effect(text)


def test_catalogue_tells_what_a_person_needs():
    names = {effect.name for effect in catalogue()}
    for effect in catalogue():
        for text in (effect.title, effect.limit, effect.signature, effect.deciding, effect.source):
            assert len(text) > 5
        assert {look.partition("@")[0] for look in effect.look_alikes} <= names
        for parameter in effect.parameters:
            assert parameter.low < parameter.high
            assert parameter.reason


@pytest.mark.parametrize("radius_m", [1e-12, 1e-7, 1e-5, 1e-4, 1.5e-3, 2e-2, 1.0])
def test_table_of_round_wires_is_the_bessel_functions(radius_m):
    s = 2j * np.pi * np.geomspace(40, 110e6, 301)
    value, (slope,) = materials.skin_factor(s, np.array([radius_m]))
    x = radius_m * np.sqrt(s * COPPER_MU_SIGMA)
    exact = x * ive(0, x) / ive(1, x) / 2
    # A tiny real part keeps the law off the table.
    _, (exact_slope,) = materials.skin_factor(s * (1 + 1e-15j), np.array([radius_m]))
    # Cubics in steps of 0.0025 err by h^4/384 of the fourth derivative, their slopes by h^3/24 of it.
    np.testing.assert_allclose(value, exact, rtol=1e-11)
    np.testing.assert_allclose(slope * radius_m, exact_slope * radius_m, atol=1e-8 * np.abs(exact).max())
