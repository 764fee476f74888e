"""What the data show by themselves: a resistance below zero, sweeps that determine nothing."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from covariances import complex_normal
from few_effects import BENDING, FEW, seeking
from paper_circuit import DAMPED, impedance

import motoremi as me
from motoremi.data.measurement import Measurement
from motoremi.data.noise import Noise
from motoremi.diagnosis.findings import (
    NEGATIVE,
    OFTEN,
    UNDECLARED,
    of_the_amount,
    of_the_hardly_seen,
    of_the_noise,
    of_the_resistance,
    of_the_scatter,
    shows_nothing,
)
from motoremi.diagnosis.held_values import of_the_held, of_the_held_beside_an_effect

FREQUENCY_HZ = np.geomspace(150e3, 30e6, 201)


def swept(turned: np.ndarray | float, analyser: str) -> Measurement:
    """The open-circuit sweep of a motor, its phase turned by so many radians."""
    z = impedance(DAMPED, "open", FREQUENCY_HZ)
    noise = np.random.default_rng(1).standard_normal((2, FREQUENCY_HZ.size)).T @ [1, 1j]
    return Measurement.of([me.ImpedanceSweep("open", FREQUENCY_HZ, z * np.exp(1j * turned) * (1 + 1e-4 * noise))], analyser)


def test_a_negative_resistance_is_told_with_its_place():
    measurement = swept(np.where((FREQUENCY_HZ > 1e6) & (FREQUENCY_HZ < 3e6), np.pi, 0.0), "4294a")
    (finding,) = of_the_resistance(measurement)
    assert (finding.id, finding.sweep, finding.serious) == ("negative-resistance", "open", True)
    assert finding.band_hz == pytest.approx((1e6, 3e6), rel=0.03)
    assert "a passive motor has none" in finding.why


@pytest.mark.parametrize("analyser", ["4294a", "nanovna", "unknown"])
def test_a_motor_has_none(analyser):
    assert of_the_resistance(swept(0.0, analyser)) == []


def test_a_phase_that_any_analyser_may_err_by_is_not_blamed_where_none_is_declared():
    """Of a capacitor of 300 pF with little loss, whose phase errs by two thirds of what is allowed, and by three times that."""
    z = 1 / (2j * np.pi * FREQUENCY_HZ * 300e-12)
    for share, count in ((2 / 3, 0), (3.0, 1)):
        turned = z * np.exp(-1j * share * NEGATIVE * UNDECLARED)
        assert np.mean(turned.real < 0) > OFTEN
        assert len(of_the_resistance(Measurement.of([me.ImpedanceSweep("short", FREQUENCY_HZ, turned)], "unknown"))) == count


@pytest.mark.parametrize(("analyser", "scatter", "count"), [("4294a", 0.02, 1), ("4294a", 1e-3, 0), ("unknown", 0.02, 0), ("none", 0.02, 0)])
def test_sweeps_that_scatter_by_more_than_the_named_analyser_may_err_are_told(analyser, scatter, count):
    z, rng = impedance(DAMPED, "open", FREQUENCY_HZ), np.random.default_rng(1)
    noise = scatter * rng.standard_normal((3, FREQUENCY_HZ.size, 2)) @ [1, 1j]
    found = of_the_scatter(Measurement.of([me.ImpedanceSweep("open", FREQUENCY_HZ, z * (1 + one)) for one in noise], analyser))
    assert [(one.id, one.sweep) for one in found] == [("interference", "open")] * count


@pytest.mark.parametrize(("left_percent", "serious"), [(0.0, True), (2.0, True), (10.0, False)])
def test_small_differences_between_repeats_are_not_the_cause_of_a_large_error(left_percent, serious):
    """They are 1 %, ten times the noise. Their true size may be three times that, which does not explain an error of 10 %."""
    sigma = np.full(FREQUENCY_HZ.size, 1e-3)
    noise = Noise(sigma, "repeats", correlated=10 * sigma)
    measurement = SimpleNamespace(sweeps=swept(0.0, "4294a").sweeps, noise=(noise,))
    (finding,) = of_the_noise(SimpleNamespace(measurement=measurement), left_percent)  # type: ignore[arg-type]
    assert (finding.id, finding.serious) == ("correlated-noise", serious)


@pytest.mark.usefixtures("catalogue")
@pytest.mark.slow
def test_where_only_the_analyser_is_seen_no_motor_is_called_adequate():
    """Nothing connected to a network analyser: a tenth of a picofarad, far less than the stray capacitance of its own connector."""
    frequency = np.geomspace(1e6, 30e6, 101)
    noise = np.random.default_rng(2).standard_normal((2, 101)).T @ [1, 1j]
    reflection = 1 / (2j * np.pi * frequency * 1e-13)
    seen = (reflection - 50) / (reflection + 50) + 2e-4 * noise
    with seeking(FEW | BENDING):
        found = me.diagnose(me.fit(me.dc_motor(), [me.ImpedanceSweep("short", frequency, 50 * (1 + seen) / (1 - seen))], analyser="nanovna"))
    assert found.verdict in ("instrument", "data")
    assert "too-little" in {finding.id for finding in found.findings if finding.serious}
    assert not found.effects


@pytest.mark.slow
def test_sweeps_that_an_effect_comes_near_show_a_circuit_though_the_seven_elements_do_not():
    """A core of ferrite alone: no inductance of a constant value comes near it."""
    frequency = np.geomspace(1e4, 100e6, 101)
    permeability = 0.001 + 0.999 / (1 + (1j * frequency / 30e3) ** 0.75)
    noise = np.random.default_rng(3).standard_normal((2, 101)).T @ [1, 1j]
    sweep = me.ImpedanceSweep("short", frequency, 2j * np.pi * frequency * 1.9e-3 * permeability * (1 + 3e-3 * noise))
    base = me.fit(me.dc_motor(), [sweep])
    for nearest, told in ((base, 1), (base.add("permeability-relaxation"), 0)):
        assert sum("show no circuit" in finding.why for finding in of_the_amount(base, nearest)) == told


def test_an_open_sweep_of_which_two_resonances_may_be_exchanged_shows_a_circuit():
    """No element is determined, since each may be the winding's or the frame's; the curve is described to 0.1 %."""
    frequency = np.geomspace(150e3, 60e6, 201)
    s = 2j * np.pi * frequency
    winding = 1 / (1 / (590 + s * 784e-6) + s * 24.9e-12)
    frame = 1 / (1 / (24.7 + s * 7e-6 + 1 / (s * 424e-12)) + s * 345e-12)
    noise = 1e-4 * np.random.default_rng(4).standard_normal((3, frequency.size, 2)) @ [1, 1j]
    sweeps = [me.ImpedanceSweep("open", frequency, (winding + frame) * (1 + one)) for one in noise]
    fit = me.fit(me.dc_motor(), sweeps, analyser="4294a")
    assert fit.exchange is not None
    assert set(fit.undetermined()) == set(fit.parameters)
    assert not shows_nothing(fit)
    assert not [finding.why for finding in of_the_amount(fit, fit) if "show no circuit" in finding.why]


@pytest.mark.parametrize(("core_ohm", "found"), [(5e3, 1), (np.inf, 0)])
def test_a_circuit_that_errs_most_where_its_analyser_sees_nothing_is_told_with_the_place(core_ohm, found):
    """A resonance at 4.6 MHz of 5 kohm, which a network analyser cannot tell from one of 80 kohm, as a model without a core's loss has it."""
    frequency = np.geomspace(1e6, 30e6, 101)
    s = 2j * np.pi * frequency
    noise = np.random.default_rng(4).standard_normal((2, 101)).T @ [1, 1j]
    z = 1 / (1 / (100 + s * 100e-6) + s * 12e-12 + 1 / core_ohm)
    seen = (z - 50) / (z + 50) + 1e-4 * noise
    fit = me.fit(me.dc_motor(), [me.ImpedanceSweep("short", frequency, 50 * (1 + seen) / (1 - seen))], analyser="nanovna")
    told = of_the_hardly_seen(fit)
    assert len(told) == found
    for finding in told:
        assert (finding.id, finding.sweep, finding.serious) == ("too-little", "short", True)
        assert finding.band_hz is not None
        assert finding.band_hz[0] < 4.6e6 < finding.band_hz[1]


@pytest.mark.slow
def test_a_held_value_that_the_sweeps_deny_is_the_finding() -> None:
    """Ra is held 8 % too high; with the true value, or with an effect missing as well, no value is blamed."""
    rng, frequency = np.random.default_rng(2), np.geomspace(150e3, 30e6, 201)
    sweeps = [
        me.ImpedanceSweep(name, frequency, impedance(DAMPED, name, frequency) * (1 + 1e-4 * complex_normal(rng, 201))) for name in ("short", "open")
    ]
    ohm = {"off": 1.08 * DAMPED["Ra"], "right": DAMPED["Ra"]}
    held = {name: me.fit(me.dc_motor(), sweeps, analyser="none", held={"Ra": value}) for name, value in ohm.items()}
    (finding,) = of_the_held(held["off"])
    assert finding.id == "held-value"
    assert finding.serious
    assert finding.why.startswith("Ra is held at")
    assert not of_the_held(held["right"])
    lossy = [me.ImpedanceSweep(s.termination, frequency, s.impedance_ohm + 0.2 * np.sqrt(frequency / 1e6)) for s in sweeps]
    assert not of_the_held(me.fit(me.dc_motor(), lossy, analyser="none", held={"Ra": ohm["off"]}))


@pytest.mark.case
@pytest.mark.slow
def test_a_held_value_is_blamed_beside_an_effect_too() -> None:
    """A leaking insulation, and Ra held at twice its value: no effect describes both, and the analyser was blamed."""
    rng, frequency = np.random.default_rng(2), np.geomspace(1e3, 30e6, 61)
    short, frame = (impedance(DAMPED, name, frequency) for name in ("short", "open"))
    frame = 1 / (1 / (frame - short) + 1 / 20e3)
    sweeps = [
        me.ImpedanceSweep(name, frequency, z * (1 + 1e-4 * complex_normal(rng, 61))) for name, z in (("short", short), ("open", short + frame))
    ]
    fits = {factor: me.fit(me.dc_motor(), sweeps, analyser="none", held={"Ra": factor * DAMPED["Ra"]}) for factor in (2, 1)}
    (finding,) = of_the_held_beside_an_effect(fits[2])
    assert finding.id == "held-value"
    assert "the circuit with insulation-leakage@Cf leaves nothing" in finding.why
    assert not of_the_held_beside_an_effect(fits[1])


def test_sweeps_of_which_an_effect_is_named_show_a_circuit(monkeypatch):
    """Two terms of the permeability of a bead: none of their values is known by itself, and both together are beyond doubt."""
    monkeypatch.setattr("motoremi.diagnosis.findings.shows_nothing", lambda fit: True)
    sweep = SimpleNamespace(frequency_hz=np.geomspace(1e6, 1e9, 201), termination="short")
    fit = SimpleNamespace(measurement=SimpleNamespace(sweeps=[sweep], terminations=("short",)), exchange=None)
    for named in (False, True):
        said = " ".join(finding.why for finding in of_the_amount(fit, fit, named))  # type: ignore[arg-type]
        assert ("show no circuit" in said) != named
        assert "no open-circuit sweep" in said


def nanovna_to_900_mhz(seed: int) -> list[me.ImpedanceSweep]:
    """A small motor behind 30 nH of leads that nobody compensated, in equal steps: beyond 100 MHz the leads are most of what is measured."""
    frequency = np.linspace(50e3, 900e6, 401)
    s = 2j * np.pi * frequency
    short = 1 / (1 / (8 + s * 14e-6) + s * 90e-12) + s * 30e-9
    frame = 1 / (1 / (35 + s * 0.4e-6 + 1 / (s * 420e-12)) + s * 160e-12)
    noise = np.random.default_rng(seed).standard_normal((2, 401, 2)) @ [1, 1j]
    seen = [(one - 50) / (one + 50) + 3e-4 * scatter for one, scatter in zip((short, short + frame), noise, strict=True)]
    pairs = zip(("short", "open"), seen, strict=True)
    return [me.ImpedanceSweep(termination, frequency, 50 * (1 + one) / (1 - one)) for termination, one in pairs]


@pytest.mark.usefixtures("catalogue")
@pytest.mark.slow
@pytest.mark.parametrize("seed", [4, pytest.param(11, marks=pytest.mark.case)])
def test_leads_that_are_most_of_what_a_nanovna_measures_hide_no_motor_and_are_no_effect(seed):
    """The circuit alone misses most points by far; a resonance beyond the band was ahead by e^140, with errors of 2.5 specifications."""
    with seeking({"second-resonance", "lead-inductance", "supply-cable", "suppressor-choke"}):
        found = me.diagnose(me.fit(me.dc_motor(), nanovna_to_900_mhz(seed), analyser="nanovna"))
    assert found.verdict == "adequate"
    assert found.base.parameters["Cr"] == pytest.approx(420e-12, rel=0.02)
    assert found.base.nuisance["fixture L"] == pytest.approx(30e-9, rel=0.02)
    serious = {finding.id for finding in found.findings if finding.serious}
    assert serious == {"not-compensated", "too-little"}
    assert not [finding.why for finding in found.findings if "show no circuit" in finding.why]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_capacitor_with_an_ideal_analyser_shows_a_circuit(seed):
    """It determines no single element of the circuit, but the analyser has no errors that could be as large."""
    frequency = np.geomspace(150e3, 30e6, 301)
    s = 2j * np.pi * frequency
    noise = 2e-3 * np.random.default_rng(seed).standard_normal((301, 2)) @ [1, 1j]
    sweep = me.ImpedanceSweep("open", frequency, (0.05 + s * 8e-9 + 1 / (s * 1e-9)) * (1 + noise))
    fit = me.fit(me.dc_motor(), [sweep], analyser="none")
    assert not shows_nothing(fit)
