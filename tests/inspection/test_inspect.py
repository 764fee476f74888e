"""What an element would have to be: hidden laws are seen in it, whatever they bend elsewhere; formulas hold for circuits of any kind."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from conftest import FREQUENCY_HZ, simulated_sweeps
from paper_circuit import DAMPED
from paper_circuit import impedance as exact_impedance

import motoremi as me
from motoremi.data.measurement import Measurement
from motoremi.fitting.marginal import marginal
from motoremi.fitting.problem import AS_DECLARED
from motoremi.fitting.result import summarise
from motoremi.fitting.search import Found, Solution, Task
from motoremi.inspection.dispersion import BY_UNIT, fit_laws
from motoremi.inspection.element import ElementCurve, inspect, solve_bilinear
from motoremi.model.effects import find_effect

pytestmark = pytest.mark.slow

S = 2j * np.pi * FREQUENCY_HZ


@cache
def needed(effect: str, element: str, seed: int) -> tuple[me.Inspection, dict[str, float], dict[str, float]]:
    sweeps, motor = simulated_sweeps(seed, (effect,))
    truth = motor.truth()
    return inspect(me.fit(me.dc_motor(), sweeps), element), truth["elements"], truth["effects"][effect]


def check(curve, truth):
    """The needed value is the true one within four standard uncertainties (real and imaginary), and 1 % that the other elements are off."""
    known = curve.known
    assert known.sum() > 200
    allowed = (4 * np.sqrt(2) * curve.sigma_relative[known] + 0.01) * np.abs(truth[known])
    assert np.mean(np.abs(curve.value - truth)[known] < allowed) > 0.95


@pytest.mark.parametrize("seed", [900, 911])
def test_a_hidden_relaxation_is_seen_in_the_insulation(seed):
    found, elements, hidden = needed("dielectric-relaxation@Cf", "Cf", seed)
    (curve,) = found.curves
    # The simulated motor: a share of the capacitance relaxes, with one corner.
    truth = elements["Cf"] * (1 + hidden["strength"] / (1 + S / (2 * np.pi * hidden["corner_hz"])))
    check(curve, truth)
    best = found.laws["open"][0]
    assert best.law.effects == ("dielectric-relaxation",)
    assert best.parameters["corner_hz"] == pytest.approx(hidden["corner_hz"], rel=0.1)
    assert "relaxation" in found.readings["open"]


@pytest.mark.parametrize("seed", [900])
def test_a_hidden_diffusion_is_seen_in_the_winding(seed):
    found, _, hidden = needed("eddy-laminations", "La", seed)
    for termination in ("short", "open"):
        best = found.laws[termination][0]
        assert "eddy-laminations" in best.law.effects
        assert best.parameters["corner_hz"] == pytest.approx(hidden["corner_hz"], rel=0.15)
        assert best.parameters["share"] == pytest.approx(hidden["share"], rel=0.05)


@pytest.mark.parametrize("seed", [905])
def test_a_hidden_resonance_is_seen_in_the_winding(seed):
    found, _, hidden = needed("field-coupling", "La", seed)
    for termination in ("short", "open"):
        best = found.laws[termination][0]
        assert "field-coupling" in best.law.effects
        resonance_hz = 1 / (2 * np.pi * np.sqrt(hidden["field_inductance_h"] * hidden["field_capacitance_f"]))
        assert best.parameters["resonance_hz"] == pytest.approx(resonance_hz, rel=0.02)
        assert best.parameters["coupling"] == pytest.approx(hidden["coupling"], rel=0.02)


@pytest.mark.case
def test_constants_look_constant():
    """Nothing hidden: each element is what it is, at each frequency at which the sweeps tell."""
    sweeps, motor = simulated_sweeps(4)
    fit = me.fit(me.dc_motor(), sweeps)
    for element in ("La", "Ca", "Cf"):
        found = inspect(fit, element)
        for curve in found.curves:
            known = curve.known
            truth = motor.truth()["elements"][element]
            deviation = np.abs(curve.value[known] / truth - 1) / (np.sqrt(2) * curve.sigma_relative[known])
            assert np.mean(deviation < 4) > 0.95
        assert all("constant describes" in reading for reading in found.readings.values()), found


@pytest.mark.parametrize(
    ("effect", "unit"),
    [
        ("second-resonance", "Ohm"), ("brush-contact", "Ohm"), ("core-loss", "Ohm"), ("eddy-laminations", "1"), ("insulation-leakage@Cf", "Ohm"),
        ("lead-inductance", "Ohm"), ("terminal-capacitance", "F"), ("cable-delay", "s"), ("gain-error", "1"), ("dielectric-loss@Ca", "1"),
    ],
)  # fmt: skip
def test_an_effects_own_part_in_an_exact_model_is_what_the_model_has(effect, unit):
    """Sweeps computed by the model itself, without noise, at off-centre values: the part comes back at each point."""
    fit = exact_fit(effect)
    found = inspect(fit, effect)
    assert found.unit == unit
    for curve in found.curves:
        known = curve.known
        assert np.allclose(curve.value[known], curve.model[known], rtol=1e-4)
    assert any(curve.known.sum() > 10 for curve in found.curves)


def exact_fit(*effects: str) -> me.Fit:
    motor = me.dc_motor()
    for effect in effects:
        motor = find_effect(effect).added_to(motor)
    values = {"Ra": 8.0, "La": 2e-5, "Ca": 3e-11, "Rr": 30.0, "Lr": 2e-6, "Cr": 3e-10, "Cf": 2.5e-10}
    values |= {"brush-contact.resistance_ohm": 15.0, "brush-contact.capacitance_f": 1e-8}  # a film that shows beside Ra
    held = {p.name: values.get(p.name, p.middle if p.scale == "log" else 0.3 * p.high) for p in motor.parameters}
    sweeps = [me.ImpedanceSweep(t, FREQUENCY_HZ[::8], impedance(motor, t, held)) for t in ("short", "open")]
    task = Task(motor, Measurement.of(sweeps, "none"), {}, {})
    problem = task.likelihood()
    u = problem.vector(held)
    solution = Solution(problem.named(u), AS_DECLARED, marginal(problem, u), True, 0)
    return summarise(task, Found(solution, (), dict(solution.values)), "ant-colony", 1)


def impedance(motor, termination, values):
    from motoremi.model.circuit import Tape

    names = [p.name for p in motor.parameters if p.name in motor.used_parameters(termination)]
    return Tape(motor.circuit(termination), names).impedance(2j * np.pi * FREQUENCY_HZ[::8], np.array([values[name] for name in names]))


@pytest.mark.parametrize("element", ["La", "Cf"])
def test_elements_along_a_line_are_solved_by_iteration(element):
    """With the capacitance spread along the winding the impedance is not bilinear in the elements."""
    fit = exact_fit("distributed-winding")
    found = inspect(fit, element)
    for curve in found.curves:
        assert np.allclose(curve.value[curve.known], curve.model[curve.known], rtol=1e-3)
    assert any(curve.known.sum() > 10 for curve in found.curves)


def test_bilinear_maps_are_solved_exactly_at_their_probes_too():
    rng = np.random.default_rng(1)
    a, b, c, d, x = rng.normal(size=(5, 50)) + 1j * rng.normal(size=(5, 50))

    def z(x):
        return (a + b * x) / (c + d * x)

    probes = [x / 2, x + 1e-3, 2 * x]
    for wanted in (x, probes[0], probes[1], probes[2]):
        solved, slope = solve_bilinear(probes, [z(p) for p in probes], z(wanted))
        assert np.allclose(solved, wanted)
        assert np.allclose(slope, (c + d * wanted) ** 2 / (b * c - a * d))


@pytest.mark.parametrize("unit", ["H", "F", "Ohm"])
def test_each_law_is_recognised_in_its_own_curve(unit):
    rng = np.random.default_rng(7)
    frequency = np.geomspace(1e5, 3e7, 120)
    own = {
        "size": {"H": 2e-5, "F": 3e-10, "Ohm": 12.0}[unit], "share": 0.4, "corner_hz": 2e6, "coupling": 0.2, "resonance_hz": 3e6, "quality": 6.0,
        "resistance_ohm": 60.0 if unit == "Ohm" else 4e3, "tan_delta": 0.02, "strength": 0.3, "exponent": 0.8, "leak_hz": 3e4, "radius_m": 2e-4,
        "height_m": 1e-4, "layers": 6.0, "inductance_h": 2e-7,
    }  # fmt: skip
    sigma = np.full(frequency.size, 1e-3)
    for law in BY_UNIT[unit]:
        value = law.shape(2j * np.pi * frequency, *(own[name] for name in ("size", *law.starts)))
        noisy = value * (1 + 1e-3 * (rng.normal(size=120) + 1j * rng.normal(size=120)))
        best = fit_laws(BY_UNIT[unit], frequency, noisy, sigma)[0]
        assert best.law is law
        for name, fitted in best.parameters.items():
            assert fitted == pytest.approx(own[name], rel=0.05)


def test_wrong_elements_are_told():
    fit = exact_fit("distributed-winding")
    with pytest.raises(me.BadInput, match="unknown element"):
        inspect(fit, "Lx")
    with pytest.raises(me.BadInput, match="unknown element"):
        inspect(fit, "skin-effect")
    with pytest.raises(me.BadInput, match="not a single part"):
        inspect(fit, "distributed-winding")
    sweeps, _ = simulated_sweeps(1)
    with pytest.raises(me.BadInput, match="none of the sweeps"):
        inspect(me.fit(me.dc_motor(), [s for s in sweeps if s.termination == "short"]), "Cf")


def test_inspection_is_plain_data_and_a_figure():
    import json

    found, _, _ = needed("dielectric-relaxation@Cf", "Cf", 900)
    plain = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert f"<b>{found.element}" in found._repr_html_()
    assert plain["schema"] == "motoremi.inspection/1"
    (sweep,) = plain["sweeps"]
    assert len(sweep["real"]) == len(sweep["frequency_hz"]) == len(sweep["sigma"]) == FREQUENCY_HZ.size
    figure = found.plot()
    assert [axes.get_ylabel() for axes in figure.axes] == ["capacitance (F)", "loss tangent"]


def test_points_at_which_nothing_is_known_are_plain_data_without_a_warning():
    """`motoremi inspect --json` printed a warning of numpy with a path of the computer."""
    value = np.array([3 + 4j, np.nan])
    curve = ElementCurve("short", np.array([1e6, 2e6]), value, np.array([0.1, np.inf]), np.ones(2, dtype=complex))
    with np.errstate(all="raise"):
        assert curve.to_dict()["sigma"] == [pytest.approx(0.5), None]


def compared(sweeps) -> me.Comparison:
    return me.compare(me.fit(me.dc_motor(), sweeps))


def test_points_that_chance_puts_beyond_the_uncertainty_are_no_failure():
    """Random noise of 0.2 % puts 1.8 % of the points beyond twice its standard deviation, however good the model is."""
    random = np.random.default_rng(5)
    sweeps = []
    for termination in ("short", "open"):
        for _ in range(3):
            noise = 0.002 / np.sqrt(2) * (random.standard_normal(FREQUENCY_HZ.size) + 1j * random.standard_normal(FREQUENCY_HZ.size))
            exact = exact_impedance(DAMPED, termination)
            sweeps.append(me.ImpedanceSweep(termination, FREQUENCY_HZ, exact * (1 + noise), metadata={"analyser": "none"}))
    found = compared(sweeps)
    assert found.within_chance
    assert 0 < found.share_beyond_uncertainty < 0.03
    (line,) = found.where_in_words("fails")
    assert line.startswith(f"largest remaining deviation: {found.where[0]['sweep']} ")
    assert "fails" not in repr(found)
    assert "of all points are beyond the uncertainty, and chance gives 1.8 %" in repr(found)


def test_a_failing_model_fails_where_it_did():
    sweeps, _ = simulated_sweeps(900, ("dielectric-relaxation@Cf",))
    found = compared(sweeps)
    assert not found.within_chance
    assert len(found.where_in_words("fails")) == len(found.where) > 0
    assert f"  {'deviates' if found.passed else 'fails'} most: {found.where[0]['sweep']} " in repr(found)
