"""Start values and ranges go with the band and the impedance: the same circuit, scaled, is found as surely as the paper's."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import FREQUENCY_HZ, simulated_sweeps

import motoremi as me
from motoremi.data.measurement import Measurement
from motoremi.diagnosis.whole_machine import added_near, added_together
from motoremi.fitting.band_scaling import bands, scaled_ranges, scaled_starts
from motoremi.model.effects import catalogue, find_effect
from motoremi.simulate.simulated_motor import SimulatedMotor


def scaled(sweeps: list[me.ImpedanceSweep], frequency: float, impedance: float) -> list[me.ImpedanceSweep]:
    return [me.ImpedanceSweep(s.termination, s.frequency_hz * frequency, s.impedance_ohm * impedance) for s in sweeps]


@pytest.mark.slow
@pytest.mark.parametrize("effect", [e for e in catalogue() if e.group != "instrument"], ids=lambda e: e.name)
def test_sweeps_like_the_papers_keep_the_catalogue_as_it_is(effect):
    measurement = Measurement.of(simulated_sweeps(3)[0])
    assert scaled_starts(effect, measurement) == [dict(start) for start in effect.starts]
    assert scaled_ranges(effect, effect.name, measurement) == {}


@pytest.mark.parametrize(("frequency", "impedance"), [(1e-3, 1.0), (1e-3, 30.0), (1.0, 40.0), (10.0, 0.1)])
def test_scaling_is_that_of_circuits(frequency, impedance):
    """Resonance, impedance and quality of a resonant cell's start values keep their place in a scaled sweep."""
    sweeps = simulated_sweeps(3)[0]
    effect = find_effect("second-resonance").effect
    measurement = Measurement.of(scaled(sweeps, frequency, impedance), "none")
    (band,) = bands(measurement)
    for start, base in zip(scaled_starts(effect, measurement), effect.starts, strict=True):
        assert start["resonance_hz"] == pytest.approx(base["resonance_hz"] * frequency, rel=0.01)
        quality = [s["resistance_ohm"] / (s["resonance_hz"] * s["inductance_h"]) for s in (start, base)]
        assert quality[0] == pytest.approx(quality[1])
        assert start["resistance_ohm"] / base["resistance_ohm"] == pytest.approx(band.impedance)
    for name, (low, high) in scaled_ranges(effect, "x", measurement).items():
        parameter = next(p for p in effect.parameters if name == f"x.{p.name}")
        assert low <= parameter.low
        assert high >= parameter.high


def test_a_wide_sweep_is_covered_in_bands_as_wide_as_the_papers():
    frequency = np.geomspace(100, 100e6, 401)
    sweep = me.ImpedanceSweep("short", frequency, SimulatedMotor.random(1).impedance("short", frequency))
    measurement = Measurement.of([sweep], "none")
    assert len(bands(measurement)) == 3
    effect = find_effect("second-resonance").effect
    resonances = np.sort([start["resonance_hz"] for start in scaled_starts(effect, measurement)])
    assert resonances[0] < 1e3
    assert resonances[-1] > 30e6
    # No wider gap between start values than the paper's band has, save where bands meet.
    assert np.max(np.diff(np.log(resonances))) < 2 * np.log(30e6 / 150e3) / 29 + 0.35
    low, high = scaled_ranges(effect, "x", measurement)["x.resonance_hz"]
    assert low < 1e3
    assert high > 100e6


def test_instrument_effects_are_the_analysers_whatever_the_motor():
    measurement = Measurement.of(scaled(simulated_sweeps(3)[0], 1e-3, 100.0), "none")
    for effect in catalogue():
        if effect.group == "instrument":
            assert scaled_starts(effect, measurement) == [dict(start) for start in effect.starts]
            assert scaled_ranges(effect, effect.name, measurement) == {}


@pytest.mark.slow
@pytest.mark.parametrize("effect", ["second-resonance", "core-loss", "permeability-relaxation", "dielectric-relaxation@Cf"])
def test_a_motor_a_hundred_times_slower_is_described_as_well(effect):
    """1.5 - 300 kHz at ten times the impedance: without scaling no start value would lie within the sweep."""
    rng = np.random.default_rng(5)
    motor = SimulatedMotor.random(905, (effect,))
    sweeps = [
        me.ImpedanceSweep(t, FREQUENCY_HZ * 1e-2, 10 * motor.impedance(t, FREQUENCY_HZ) * (1 + 1e-4 * rng.normal(size=(2, 401)).T @ [1, 1j]))
        for t in ("short", "open")
        for _ in range(3)
    ]
    found = me.fit(me.dc_motor(), sweeps, analyser="none").add(effect)
    assert found.chi2_reduced == pytest.approx(1.0, abs=0.25)
    assert found.rms_error_percent < 1.3 * found.floor_percent


def test_effects_added_together_have_the_ranges_of_each_alone():
    """A contact of kilohms at an input of megohms was found by a diagnosis and held at 100 Ohm when it was added."""
    fit = me.fit(me.dc_motor(), scaled(simulated_sweeps(3, repeats=1)[0], 1e-3, 100.0))
    names = ("brush-contact", "terminal-capacitance", "skin-effect")
    together = added_near(fit, names, {})[-1].bounds
    for name in names:
        alone = scaled_ranges(find_effect(name).effect, name, fit.measurement)
        assert alone
        assert alone.items() <= together.items()


@pytest.mark.slow
def test_effects_added_together_are_found_in_another_band():
    """A capacitor of 190 uF with a contact resistance behind a cable, 10 Hz - 50 kHz: its start value lay a million times lower."""
    frequency_hz = np.geomspace(10.0, 50e3, 101)
    s = 2j * np.pi * frequency_hz
    capacitor_ohm = 2.5 + 1 / (s * 190e-6)
    wave_ohm, delay_s, end = 50.0, 66e-9, 0.02
    behind_a_cable = end + wave_ohm * (capacitor_ohm + wave_ohm * np.tanh(s * delay_s)) / (wave_ohm + capacitor_ohm * np.tanh(s * delay_s))
    noise = 1e-4 * np.random.default_rng(3).normal(size=(2, len(s))).T @ [1, 1j]
    fit = me.fit(me.dc_motor(), [me.ImpedanceSweep("short", frequency_hz, behind_a_cable * (1 + noise))])
    steps = added_together(fit, ("supply-cable", "contact-resistance", "terminal-capacitance"))
    assert steps[-1].rms_error_percent < 0.2
    assert steps[-1].rms_error_percent <= steps[-2].rms_error_percent
