"""White noise of a single sweep: as large as it is, whatever part of the analyser's law it follows, and beside any resonance."""

from __future__ import annotations

import numpy as np
import pytest

import motoremi as me
from motoremi.data.noise import estimate_noise
from motoremi.data.quantity import Reflection
from motoremi.data.sweep import ImpedanceSweep, group_repeats

FREQUENCY_HZ = np.geomspace(150e3, 30e6, 401)
ELEMENTS = {"Ra": 2.3, "La": 24e-6, "Ca": 95e-12, "Rr": 1.8, "Lr": 0.7e-6, "Cr": 310e-12, "Cf": 150e-12}


def impedance(termination, frequency_hz=FREQUENCY_HZ, e=ELEMENTS):
    """Of ideal parts; short: a parallel resonance of Q 220, open: two more, one of them a sharp minimum."""
    s = 2j * np.pi * frequency_hz
    winding = 1 / (1 / (e["Ra"] + s * e["La"]) + s * e["Ca"])
    if termination == "short":
        return winding
    return winding + 1 / (1 / (e["Rr"] + s * e["Lr"] + 1 / (s * e["Cr"])) + s * e["Cf"])


def true_sigma(law, true):
    """Relative to Z; each reaches 1 % where the impedance is lowest or highest."""
    magnitude = np.abs(true)
    return {
        "relative": np.full(true.size, 1e-3),
        "ohm": 0.01 * magnitude.min() / magnitude,
        "siemens": 0.01 * magnitude / magnitude.max(),
        "reflection": 2e-4 * np.abs((true + 50) ** 2 / (100 * true)),
    }[law]


@pytest.mark.parametrize("law", ["relative", "ohm", "siemens", "reflection"])
@pytest.mark.parametrize("termination", ["short", "open"])
def test_noise_of_every_law_is_seen_where_it_is(termination, law):
    true = impedance(termination)
    sigma = true_sigma(law, true)
    # Less than the least noise that is assumed is not estimated.
    seen = sigma > 2e-5
    ratios = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        measured = true * (1 + sigma * (rng.normal(size=true.size) + 1j * rng.normal(size=true.size)))
        (sweep,) = group_repeats([ImpedanceSweep(termination, FREQUENCY_HZ, measured)])
        ratios.append(estimate_noise(sweep, Reflection() if law == "reflection" else None).sigma / sigma)
    # The law is fitted to some hundred independent residuals, and the correction along frequency to 31: 12 sweeps average to a few percent.
    typical = np.median(ratios, axis=0)[seen]
    assert np.median(typical) == pytest.approx(1.0, abs=0.06)
    # At a resonance of a few points the residuals are those of the curve too.
    assert typical.min() > 0.5
    assert typical.max() < 2.0


@pytest.mark.parametrize("count", [8, 9, 30])
@pytest.mark.parametrize("curve", ["constant", "as the reference", "inductor", "capacitor"])
def test_sweeps_without_noise_and_of_few_points_have_a_noise(count, curve):
    frequency_hz = np.geomspace(150e3, 30e6, count)
    shapes = {"constant": 5 + 0j, "as the reference": 50 + 0j, "inductor": 5 + 6e-6j * frequency_hz, "capacitor": -1e9j / frequency_hz}
    (sweep,) = group_repeats([ImpedanceSweep("short", frequency_hz, shapes[curve] * np.ones(count))])
    for quantity in (None, Reflection()):
        sigma = estimate_noise(sweep, quantity).sigma
        assert np.all(np.isfinite(sigma) & (sigma > 0))


@pytest.mark.slow
@pytest.mark.parametrize("law", ["relative", *(pytest.param(law, marks=pytest.mark.case) for law in ("ohm", "siemens"))])
def test_intervals_from_single_sweeps_hold_the_truth(law):
    """With noise of constant size in ohm, those of Rr held it in 60 % when the noise was taken for one that is relative to Z."""
    frequency_hz = FREQUENCY_HZ[::2]
    held = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        sweeps = []
        for termination in ("short", "open"):
            true = impedance(termination, frequency_hz)
            noise = true_sigma(law, true) * (rng.normal(size=true.size) + 1j * rng.normal(size=true.size))
            sweeps.append(ImpedanceSweep(termination, frequency_hz, true * (1 + noise), metadata={"analyser": "none"}))
        fit = me.fit(me.dc_motor(), sweeps, seed=1)
        held.append([abs(np.log(fit.parameters[name] / value)) < 1.96 * fit.sigma[name] / value for name, value in ELEMENTS.items()])
    # Three standard deviations of 20 draws below 95 %.
    assert np.mean(held, axis=0).min() >= 0.8


def test_noise_that_grows_towards_the_low_end_is_seen_in_sweeps_of_equal_distances():
    """A coil of 1.4 uH from 50 kHz to 30 MHz: below 300 kHz, at nine points of 1023, the reflection scatters eight times as much."""
    frequency = np.linspace(50e3, 30e6, 1023)
    true = 0.1 + 2j * np.pi * frequency * 1.4e-6
    reflection = (true - 50) / (true + 50)
    sigma = np.where(frequency < 300e3, 4e-3, 5e-4)
    ratios = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        read = reflection + sigma * (rng.normal(size=true.size) + 1j * rng.normal(size=true.size))
        (sweep,) = group_repeats([ImpedanceSweep("short", frequency, 50 * (1 + read) / (1 - read))])
        # A reflection changes Z by so much of itself.
        seen = estimate_noise(sweep, Reflection()).sigma / np.abs((true + 50) ** 2 / (100 * true))
        ratios.append(seen / sigma)
    typical = np.median(ratios, axis=0)
    assert 0.4 < np.median(typical[:6]) < 1.6
    assert np.median(typical[50:]) == pytest.approx(1.0, abs=0.1)
