"""A winding on a core, on a network analyser whose errors have fine structure: no smooth error describes that, and none of any size is needed."""

from __future__ import annotations

import numpy as np
import pytest
from few_effects import FEW, seeking

import motoremi as me
from motoremi.data.covariance import Sizes
from motoremi.data.measurement import Measurement
from motoremi.fitting.problem import Problem
from motoremi.model.motor import dc_motor

CORE = {"resistance_ohm": 0.143, "inductance_h": 1.43e-6, "share": 0.872, "corner_hz": 89e3, "exponent": 0.6}
# Relative, and over what distance in ln f it changes.
FINE, LENGTH = 0.004, 0.3


def wandering(rng: np.random.Generator, frequency_hz: np.ndarray) -> np.ndarray:
    """An error of unit size whose correlation falls exponentially over ln f."""
    white = rng.standard_normal((frequency_hz.size, 2)) @ [1, 1j] / np.sqrt(2)
    kept = np.exp(-np.diff(np.log(frequency_hz), prepend=-np.inf) / LENGTH)
    error = np.zeros(frequency_hz.size, dtype=np.complex128)
    for index, (share, step) in enumerate(zip(kept, white, strict=True)):
        error[index] = share * error[index - 1] + np.sqrt(1 - share**2) * step
    return error


def sweep(seed: int, loss: bool = True) -> me.ImpedanceSweep:
    """Two turns on a ferrite core (permeability by Cole and Cole), or on none."""
    rng, frequency = np.random.default_rng(seed), np.linspace(150e3, 15e6, 1000)
    relaxed = (1j * frequency / CORE["corner_hz"]) ** CORE["exponent"]
    inductance = CORE["inductance_h"] * (1 - CORE["share"] * relaxed / (1 + relaxed) * loss)
    ohm = CORE["resistance_ohm"] + 2j * np.pi * frequency * inductance
    ohm = ohm * (1 + FINE * wandering(rng, frequency) + 3e-4 * (rng.standard_normal(1000) + 1j * rng.standard_normal(1000)))
    return me.ImpedanceSweep("short", frequency, ohm, metadata={"accuracy_percent": 5.0} if loss else {})


def test_no_error_of_the_analyser_is_needed_beyond_what_is_left() -> None:
    """With a discrepancy of 6 % that cancels it, an error of 42 standard deviations described what 0.4 % of fine structure had left."""
    measurement = Measurement.of([sweep(3, loss=False)], "nanovna")
    problem = Problem(dc_motor(), measurement, sizes=Sizes(0.065, 4.0))
    u = problem.vector({"Ra": CORE["resistance_ohm"], "La": CORE["inductance_h"], "Ca": 1e-14})
    left = np.abs(problem.residual(u))
    assert np.sqrt(np.mean(left**2)) < 2 * FINE
    assert np.max(np.abs(problem.smooth_error(u))) < 3 * np.max(left)
    assert problem.analyser_sigma(u) < 3


@pytest.mark.slow
def test_what_the_analyser_cannot_distinguish_is_a_family() -> None:
    """It was `unexplained`: 15 times the specification was more probable than any effect."""
    with seeking({*FEW, "permeability-relaxation", "proximity-effect", "suppressor-choke"}):
        found = me.diagnose(me.fit(me.dc_motor(), [sweep(1)], analyser="nanovna"))
    assert found.verdict in ("family", "missing-effect")
    assert "permeability-relaxation" in {name for family in (found.effects, *found.families) for name in family}
    assert found.best.rms_error_percent < 5 < found.base.rms_error_percent
    assert found.confidence < 0.8
