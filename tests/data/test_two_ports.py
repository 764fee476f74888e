"""A motor between two ports: what is measured, its errors and noise, how an error model is declared, and what is refused.

The errors are those of a chain of scattering matrices (`two_ports`), of which the error model knows no formula.
"""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest
from command_line import motoremi
from covariances import complex_normal
from paper_circuit import DAMPED, impedance
from two_ports import FREQUENCY_HZ, Strays, TwoPorts, s2p

import motoremi as me
from motoremi.data.analyser import BETWEEN_PORTS, UNKNOWN, find_analyser
from motoremi.data.conditions import parse_condition
from motoremi.data.declaration import declared_analyser
from motoremi.data.files import read_impedance
from motoremi.data.measurement import Measurement
from motoremi.data.noise import estimate_noise
from motoremi.data.quantity import REFLECTION, THROUGH, Quantity
from motoremi.data.session import SessionWriter, load
from motoremi.data.sweep import group_repeats
from motoremi.errors import BadInput
from motoremi.fitting.ports import with_ground_capacitance, with_line_inductance
from motoremi.fitting.problem import Problem, fixture_parameters
from motoremi.model.circuit import Leaf, Tape
from motoremi.model.laws import resistance_and_inductance
from motoremi.model.motor import dc_motor
from motoremi.model.parameter import Parameter
from motoremi.workflow import ladder_of

NAMES = [quantity.name for quantity in THROUGH]
# From a shorting bar to what only leaks.
WIDE_OHM = np.geomspace(1e-2, 1e6, 41) * np.exp(1j * np.linspace(-1.5, 1.5, 41))
SOUND = {"leakage": 0.0, "tracking": 0.0, "reflected": 0.0, "noise": 0.0}


def quantity_of(name: str) -> Quantity:
    return next(quantity for quantity in THROUGH if quantity.name == name)


def sweeps(fixture: str | None, termination: str = "short", **metadata: object) -> list[me.ImpedanceSweep]:
    told = metadata if fixture is None else {"fixture": fixture, **metadata}
    return [me.ImpedanceSweep(termination, FREQUENCY_HZ, impedance(DAMPED, termination, FREQUENCY_HZ), 1e-3, told)]


# What is measured


@pytest.mark.parametrize("quantity", [REFLECTION, *THROUGH], ids=lambda one: one.name)
def test_derivatives_are_those_by_finite_differences(quantity):
    coefficient, step = quantity.coefficient_of(WIDE_OHM), 1e-6 * WIDE_OHM
    by_ohm = (quantity.coefficient_of(WIDE_OHM + step) - quantity.coefficient_of(WIDE_OHM - step)) / (2 * step)
    # Where the coefficient is near an end of its range, a difference has few digits.
    np.testing.assert_allclose(by_ohm, quantity.slope_ohm / (WIDE_OHM + quantity.pole_ohm) ** 2, rtol=1e-3)
    np.testing.assert_allclose(by_ohm * WIDE_OHM * quantity.relative(WIDE_OHM), 1, rtol=1e-3)
    np.testing.assert_allclose(quantity.impedance_of(coefficient), WIDE_OHM, rtol=1e-9)
    assert pickle.loads(pickle.dumps(quantity)) == quantity


@pytest.mark.parametrize("name", NAMES)
def test_a_sound_analyser_shows_the_impedance(name):
    true = impedance(DAMPED, "open", FREQUENCY_HZ)
    np.testing.assert_allclose(quantity_of(name).impedance_of(TwoPorts(1, **SOUND).s21(name, true)), true, rtol=1e-6)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("term", ["leakage", "tracking", "reflected"])
def test_each_error_is_as_derived(name, term):
    quantity, true = quantity_of(name), impedance(DAMPED, "short", FREQUENCY_HZ)
    analyser = TwoPorts(3, **{**SOUND, term: 1e-6})
    leak, tracking, source, load = analyser.errors()
    row = {"leakage": 0, "tracking": 1, "reflected": 2}[term]
    size = (leak, tracking, (source + load) * (1 if name == "series-through" else -1))[row]
    expected = quantity.relative(true) * size * quantity.error_terms(quantity.coefficient_of(true))[row]
    shown = quantity.impedance_of(analyser.s21(name, true)) / true - 1
    np.testing.assert_allclose(shown, expected, atol=3e-3 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("name", "strays"),
    [
        ("series-through", Strays(0.2, 30e-9, 3e-12, ground_farads=(4e-12, 4e-12))),
        ("shunt-through", Strays(0.2, 30e-9, 3e-12, line_henries=(20e-9, 20e-9))),
    ],
)
def test_strays_are_those_of_the_chain(name, strays):
    """With equal strays at both sides they are exact."""
    true = impedance(DAMPED, "short", FREQUENCY_HZ)
    s = 2j * np.pi * FREQUENCY_HZ
    seen = 1 / (1 / (true + strays.lead_ohm + s * strays.lead_henry) + s * strays.across_farad)
    wrap = with_ground_capacitance if name == "series-through" else with_line_inductance
    total = sum(strays.ground_farads if name == "series-through" else strays.line_henries)
    leaf = Leaf("Z", lambda s, _: (seen, (0 * seen,)), (Parameter("one", "1", 0.5, 2.0, "a test"),))
    found = Tape(wrap(leaf, Parameter("stray", "F", 0.0, 1.0, "a test")), ["one", "stray"]).impedance(s, np.array([1.0, total]))
    np.testing.assert_allclose(quantity_of(name).impedance_of(TwoPorts(1, **SOUND).s21(name, true, strays)), found, rtol=1e-6)


@pytest.mark.parametrize("wrap", [with_ground_capacitance, with_line_inductance])
def test_derivatives_of_strays(wrap):
    s = 2j * np.pi * FREQUENCY_HZ
    leaf = Leaf("Z", resistance_and_inductance, (Parameter("R", "Ohm", 1.0, 100.0, "a test"), Parameter("L", "H", 1e-9, 1e-3, "a test")))
    scale = 3e-12 if wrap is with_ground_capacitance else 3e-8
    tape = Tape(wrap(leaf, Parameter("stray", "", -1.0, 1.0, "a test")), ["R", "L", "stray"])
    at, step = np.array([20.0, 3e-6, scale]), 1e-3 * np.diag([20.0, 3e-6, scale])
    slopes = tape.gradient(s, at)[1]
    for slope, one in zip(slopes, step, strict=True):
        change = (tape.impedance(s, at + one) - tape.impedance(s, at - one)) / (2 * one.sum())
        np.testing.assert_allclose(slope, change, rtol=1e-4)


@pytest.mark.parametrize("analyser", ["nanovna+series-through", "nanovna+shunt-through", "unknown+series-through"])
def test_the_likelihood_has_the_derivatives_of_what_is_measured(analyser):
    problem = Problem(dc_motor(), Measurement.of(sweeps(None) + sweeps(None, "open"), analyser))
    u = problem.vector(DAMPED) + 0.02
    here = problem.linearised(u)
    for index in range(u.size):
        step = 1e-5 * np.eye(u.size)[index]
        change = (problem.residual(u + step) - problem.residual(u - step)) / 2e-5 * problem.observed.weight
        np.testing.assert_allclose(here.slopes[index] * here.chain[index], change, atol=1e-4 * np.abs(change).max())


# Errors and noise


@pytest.mark.parametrize(
    ("name", "good", "bad"),
    [("series-through", (10.0, 5e3), (0.01, 1e6)), ("shunt-through", (0.1, 100.0), (1e-3, 1e5))],
)
def test_uncertainty_says_what_a_connection_sees_well(name, good, bad):
    analyser = find_analyser(f"nanovna+{name}")
    frequency = np.full(2, 150e3)
    inside, outside = (analyser.uncertainty(frequency, np.array(ends, dtype=np.complex128)) for ends in (good, bad))
    assert np.all(inside < 0.15)
    assert np.all(outside > 1)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("repeats", [1, 3])
def test_noise_is_white_in_the_transmission(name, repeats):
    quantity, white = quantity_of(name), 5e-5
    true = impedance(DAMPED, "short", FREQUENCY_HZ)
    coefficient = quantity.coefficient_of(true)
    expected = white * np.abs(quantity.relative(true))
    assert expected.max() > 10 * expected.min()
    ratios = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        shown = [quantity.impedance_of(coefficient + white * complex_normal(rng, true.size)) for _ in range(repeats)]
        group = group_repeats(me.ImpedanceSweep("short", FREQUENCY_HZ, one) for one in shown)[0]
        ratios.append(estimate_noise(group, quantity).sigma * np.sqrt(repeats) / expected)
    assert np.median(ratios) == pytest.approx(1, abs=0.1)
    assert np.all(np.abs(np.log(np.mean(ratios, axis=0))) < 0.4)


# Names


def test_an_error_model_between_two_ports_has_a_name():
    for name in NAMES:
        named, unnamed, ideal = (find_analyser(f"{first}+{name}") for first in ("nanovna", "unknown", " None"))
        assert [one.name for one in (named, unnamed, ideal)] == [f"nanovna+{name}", f"unknown+{name}", f"none+{name}"]
        assert all(one.quantity == quantity_of(name) for one in (named, unnamed, ideal))
        assert (named.by_waves, unnamed.by_waves, ideal.by_waves) == (True, True, False)
        assert (named.named, unnamed.named) == (True, False)
        assert unnamed.scales == UNKNOWN
        assert ideal.ideal
        assert not np.any(ideal.uncertainty(FREQUENCY_HZ, impedance(DAMPED, "short", FREQUENCY_HZ)))
        sent = pickle.loads(pickle.dumps(unnamed))
        assert (sent.name, sent.named, sent.quantity) == (unnamed.name, False, unnamed.quantity)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("4294a+series-through", "4294a measures no transmission between two ports; for series-through use one of nanovna, unknown, none"),
        ("nanovna+sideways", r"'sideways' is not .*; use nanovna alone or nanovna\+series-through or \+shunt-through"),
        ("nanovna+series-through+leads", "'series-through' is not an adapter or fixture of it"),
        ("vna9+series-through", "use one of 4294a, e4990a, nanovna, unknown, none"),
    ],
)
def test_names_that_are_none(name, says):
    with pytest.raises(BadInput, match=says):
        find_analyser(name)


def test_a_fixture_between_ports_has_strays_of_its_own():
    names = {name: [one.name for one in fixture_parameters(find_analyser(f"nanovna+{name}"))] for name in NAMES}
    common = ["fixture R", "fixture L", "fixture G", "fixture C"]
    assert names == {"series-through": [*common, "fixture C to ground"], "shunt-through": [*common, "fixture L of the line"]}
    assert fixture_parameters(find_analyser("unknown+series-through")) == ()
    compensated = [one.with_metadata(compensated=["open", "short"]) for one in sweeps("series-through", analyser="nanovna")]
    assert Measurement.of(compensated).analyser.fixture is None


@pytest.mark.parametrize(
    ("told", "argument", "name"),
    [
        ({"analyser": "nanovna"}, None, "nanovna+series-through"),
        ({"analyser": "NanoVNA"}, None, "nanovna+series-through"),
        ({}, None, "unknown+series-through"),
        ({"analyser": "none"}, None, "none+series-through"),
        ({"analyser": "4294a"}, "nanovna", "nanovna+series-through"),
        ({"analyser": "nanovna+series-through"}, None, "nanovna+series-through"),
    ],
)
def test_sweeps_between_ports_have_their_error_model_by_themselves(told, argument, name):
    measurement = Measurement.of(sweeps("series-through", **told), argument)
    assert measurement.analyser.name == name
    assert not measurement.remark
    assert measurement.with_analyser(find_analyser("nanovna")).noise[0].sigma.shape == FREQUENCY_HZ.shape


def test_what_a_fixture_does_not_say_is_left_alone():
    for other in ("leads", "16047E", "none"):
        assert declared_analyser(sweeps(other, analyser="4294a"))[0].name == "4294a"
    with pytest.raises(BadInput, match=r"were measured series-through, but the analyser is declared as nanovna\+shunt-through"):
        Measurement.of(sweeps("series-through"), "nanovna+shunt-through")


def test_an_impedance_analyser_that_was_declared_for_a_transmission_is_doubted():
    """As sessions of before may have it: they still load."""
    measurement = Measurement.of(sweeps("series-through", analyser="4294a"))
    assert measurement.analyser.name == "4294a"
    assert "4294a measures no transmission between two ports: name the network analyser" in measurement.caveats()[0]


@pytest.mark.parametrize("other", [None, "shunt-through"])
def test_sweeps_that_were_measured_differently_share_no_error_model(other):
    measurement = Measurement.of(sweeps(other, analyser="nanovna") + sweeps("series-through", "open", analyser="nanovna"))
    assert measurement.analyser.name == "unknown"
    assert f"({' and '.join(sorted([other or 'one port', 'series-through']))})" in measurement.caveats()[0]
    appended = sweeps(other, "open")[0].under(parse_condition("dried"))
    assert Measurement.of([*sweeps("series-through"), appended]).analyser.name == "unknown"


# Import


def written(folder: Path, name: str, fixture: str = "series-through", comment: bool = False) -> Path:
    path = folder / f"{name}.s2p"
    text = s2p(TwoPorts(1).s21(fixture, impedance(DAMPED, name, FREQUENCY_HZ)), fixture)
    path.write_text(text if comment else text.partition("\n")[2])
    return path


@pytest.mark.parametrize(
    ("options", "name"),
    [
        ((), "unknown+series-through"),
        (("--analyser", "nanovna"), "nanovna+series-through"),
        (("--analyser", "nanovna+series-through"), "nanovna+series-through"),
    ],
)
def test_an_import_says_which_error_model_it_is(tmp_path, options, name):
    files = ("--short", written(tmp_path, "short"), "--open", written(tmp_path, "open"))
    done = motoremi("import", tmp_path / "s", *files, "--fixture", "series-through", *options, "--json")
    assert (done.returncode, done.stderr) == (0, "")
    assert f'"analyser": "{name}"' in done.stdout
    session = load(tmp_path / "s")
    assert Measurement.of(session.sweeps).analyser.name == name
    # What is brought later is as what is there.
    again = motoremi("import", tmp_path / "s", "--append", "--short", written(tmp_path, "short"), "--fixture", "series-through")
    assert again.returncode == 0
    assert Measurement.of(load(tmp_path / "s").sweeps).analyser.name == name


@pytest.mark.parametrize(
    ("kind", "options", "says"),
    [
        ("s2p", ("--fixture", "series-through", "--analyser", "4294a"), "was measured series-through, but 4294a measures no transmission"),
        ("s2p", ("--fixture", "series-through", "--analyser", "nanovna+shunt-through"), "declared as nanovna+shunt-through"),
        ("s1p", ("--fixture", "series-through"), "--fixture is for Touchstone files of two ports"),
        (
            "s1p",
            ("--analyser", "nanovna+series-through"),
            "holds the reflection at one port, but the analyser is declared as nanovna+series-through",
        ),
        ("said", (), "its header says fixture shunt-through, but it holds the reflection at one port"),
        ("csv", (), "its header says fixture series-through, but it holds the reflection at one port"),
    ],
)
def test_bad_input_is_one_clear_line(tmp_path, kind, options, says):
    reflected = [
        f"{f:.3f} {g.real:.9g} {g.imag:.9g}" for f, g in zip(FREQUENCY_HZ, REFLECTION.coefficient_of(sweeps(None)[0].impedance_ohm), strict=True)
    ]
    texts = {
        "s1p": "\n".join(["# HZ S RI R 50", *reflected]),
        "said": "\n".join(["! fixture: shunt-through", "# HZ S RI R 50", *reflected]),
        "csv": "\n".join(["# fixture: series-through", "frequency_hz,s11_real,s11_imag", *(row.replace(" ", ",") for row in reflected)]),
    }
    path = written(tmp_path, "short") if kind == "s2p" else tmp_path / "short.txt"
    if kind != "s2p":
        path.write_text(texts[kind] + "\n")
    done = motoremi("import", tmp_path / "s", "--short", path, *options)
    assert done.returncode == 2
    assert says in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "s").exists()


def test_a_table_of_impedances_may_say_how_they_were_measured(tmp_path):
    """As sessions store them."""
    one = sweeps(None)[0]
    rows = [f"{f},{z.real},{z.imag}" for f, z in zip(one.frequency_hz, one.impedance_ohm, strict=True)]
    path = tmp_path / "short.csv"
    path.write_text("\n".join(["# analyser: nanovna", "# fixture: Shunt-through", "frequency_hz,resistance_ohm,reactance_ohm", *rows]) + "\n")
    assert Measurement.of([read_impedance(path, "short")]).analyser.name == "nanovna+shunt-through"
    assert set(BETWEEN_PORTS) == set(NAMES)


def test_models_that_were_fitted_with_another_error_model_are_fitted_anew(tmp_path):
    with SessionWriter.create(tmp_path / "s", {"title": "from an earlier version"}) as writer:
        writer.add_sweep(sweeps("series-through")[0])
        writer.save_analysis("ladder", {"schema": "motoremi.ladder/1", "steps": [{"fit": {"analyser": "unknown", "effects": []}}]})
        writer.close("done")
    assert ladder_of(load(tmp_path / "s")) == []
