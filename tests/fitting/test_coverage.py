"""Stated error bars are right as often as they say."""

from __future__ import annotations

import numpy as np
import pytest
from paper_circuit import impedance

import motoremi as me

pytestmark = pytest.mark.slow

RANGES = {
    "Ra": (5.0, 100.0), "La": (4e-6, 40e-6), "Ca": (8e-12, 60e-12), "Rr": (10.0, 120.0),
    "Lr": (0.5e-6, 5e-6), "Cr": (150e-12, 1000e-12), "Cf": (80e-12, 600e-12),
}  # fmt: skip
MOTORS = 400
# Of as many motors as possible: whether an interval is right does not depend on how many points made it.
FREQUENCY_HZ = np.geomspace(150e3, 30e6, 101)


def pulls() -> dict[str, list[float]]:
    """(fitted - true) / standard deviation, of every parameter that the data determine."""
    found: dict[str, list[float]] = {name: [] for name in RANGES}
    for seed in range(MOTORS):
        rng = np.random.default_rng((5, seed))
        truth = {name: float(np.exp(rng.uniform(np.log(low), np.log(high)))) for name, (low, high) in RANGES.items()}
        sweeps = [
            me.ImpedanceSweep(
                t, FREQUENCY_HZ, impedance(truth, t, FREQUENCY_HZ) * (1 + 0.005 * (rng.normal(size=101) + 1j * rng.normal(size=101))), 0.005
            )
            for t in ("short", "open")
        ]
        fit = me.fit(me.dc_motor(), sweeps, analyser="none", seed=seed)
        for name, true in truth.items():
            if fit.determined(name):
                found[name].append((fit.parameters[name] - true) / fit.sigma[name])
    return found


def test_95_percent_interval_holds_the_truth_95_percent_of_the_time():
    """Of each element; in one test, since the workers of a test run would each fit all motors for theirs."""
    found = pulls()
    assert {name: len(values) for name, values in found.items() if len(values) <= 0.8 * MOTORS} == {}
    # 400 motors: binomial standard deviation 1.1 %, so 2.5 % is 2.3 of them.
    held = {name: float(np.mean(np.abs(values) < 1.96)) for name, values in found.items()}
    assert {name: share for name, share in held.items() if abs(share - 0.95) > 0.025} == {}


@pytest.mark.parametrize("load_ohm", [49.0, 51.4])
def test_the_load_of_a_calibration_is_in_the_error_bars(load_ohm):
    """A handheld analyser whose load is off by 1.4 Ohm, as measured of such kits, reads all impedances 2.8 % too low, and fits as well."""
    motors = []
    for seed in range(8):
        rng = np.random.default_rng((6, seed))
        truth = {name: float(np.exp(rng.uniform(np.log(low), np.log(high)))) for name, (low, high) in RANGES.items()}
        sweeps = []
        for t in ("short", "open"):
            noise = 2e-4 * (rng.normal(size=101) + 1j * rng.normal(size=101))
            read = impedance(truth, t, FREQUENCY_HZ) * 50 / load_ohm
            reflected = (read - 50) / (read + 50) + noise
            sweeps.append(me.ImpedanceSweep(t, FREQUENCY_HZ, 50 * (1 + reflected) / (1 - reflected)))
        fit = me.fit(me.dc_motor(), sweeps, analyser="nanovna", seed=seed)
        motors.append((truth, fit))
    pulled = [abs(fit.parameters["La"] - truth["La"]) / fit.sigma["La"] for truth, fit in motors]
    assert max(pulled) < 3
    assert min(fit.marginal.nothing_left for _, fit in motors) > 0.5
