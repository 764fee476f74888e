"""Solutions far from the best one that describe the sweeps about as well are in the error bars."""

from __future__ import annotations

import numpy as np
import pytest

import motoremi as me
from motoremi.model.effects import add_effects

FREQUENCY_HZ = np.geomspace(150e3, 30e6, 201)
S = 2j * np.pi * FREQUENCY_HZ
BIG = {"Ra": 1.2, "La": 2e-3, "Ca": 1e-9, "Rr": 25.0, "Lr": 3e-6, "Cr": 4e-9, "Cf": 2e-9}
SMALL = {"Ra": 1.5, "La": 5e-6, "Ca": 8e-12, "Rr": 15.0, "Lr": 0.3e-6, "Cr": 60e-12, "Cf": 30e-12}
# Two standard deviations are an interval of 95 %.
TWO = 2.0


def frame(p):
    return 1 / (1 / (p["Rr"] + S * p["Lr"] + 1 / (S * p["Cr"])) + S * p["Cf"])


def winding(p, core=1.0):
    return 1 / (1 / (p["Ra"] + S * p["La"] * core) + S * p["Ca"])


def sweeps(short_ohm, open_ohm, seed, noise):
    """Repeats with noise, and an analyser that errs by a tenth of a per cent."""
    rng = np.random.default_rng((11, seed))
    gain = 1 + 1e-3 * rng.normal()
    return [
        me.ImpedanceSweep(termination, FREQUENCY_HZ, ohm * gain * (1 + noise * (rng.normal(size=201) + 1j * rng.normal(size=201))))
        for termination, ohm in (("short", short_ohm), ("open", open_ohm))
        for _ in range(3)
    ]


def wrong(fit, truth):
    """Elements whose interval leaves the true value out although it is said to be determined."""
    return [
        name
        for name, true in truth.items()
        if fit.determined(name) and abs(np.log(fit.parameters[name] / true)) > TWO * fit.sigma[name] / fit.parameters[name] + 2e-3
    ]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_iron_with_a_corner_far_below_the_band(seed):
    """tanh(x)/x is a square root there: only a product of share and corner is seen."""
    x = np.sqrt(S / (np.pi * 5e3))
    short = winding(BIG, 1 - 0.6 + 0.6 * np.tanh(x) / x)
    fit = me.fit(add_effects(me.dc_motor(), ["eddy-laminations"]), sweeps(short, short + frame(BIG), seed, 1e-4), analyser="4294a")
    assert wrong(fit, {name: BIG[name] for name in ("Ra", "La")}) == []
    assert "eddy-laminations.corner_hz" in fit.another_solution()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_a_path_to_the_frame_hidden_by_capacitors(seed):
    """5 nF from either terminal to the frame: of the path beside them little more than its capacitance is seen."""
    capacitor = 0.2 + S * 5e-9 + 1 / (S * 4.7e-9)
    inner = winding(SMALL)
    short = 1 / (1 / inner + 1 / capacitor)
    beside = 1 / (1 / frame(SMALL) + 1 / capacitor)
    open_ohm = 1 / (1 / (inner + beside) + 1 / capacitor)
    fit = me.fit(add_effects(me.dc_motor(), ["suppressor-capacitor@pair"]), sweeps(short, open_ohm, seed, 1e-3), analyser="4294a")
    assert wrong(fit, SMALL) == []
    # The interval of a parameter agrees with its error bar.
    within = fit.interval("Cf")
    assert within.low <= SMALL["Cf"] <= within.high


def test_a_healthy_motor_has_no_other_solution():
    truth = {"Ra": 0.5, "La": 12.1e-6, "Ca": 22e-12, "Rr": 39.8, "Lr": 1.6e-6, "Cr": 424e-12, "Cf": 210e-12}
    fit = me.fit(me.dc_motor(), sweeps(winding(truth), winding(truth) + frame(truth), 0, 1e-3), analyser="4294a")
    assert fit.alternatives.shape == (0, len(fit.unknowns))
    assert fit.another_solution() is None
    assert fit.sigma == fit.local_sigma
