"""Coils of which the sweeps show hardly more of the path to the frame than its capacitance: it resonates far beyond the band."""

from __future__ import annotations

import numpy as np
import pytest

import motoremi as me

FREQUENCY_HZ = np.geomspace(1e3, 4e6, 121)


def measured(impedance_ohm: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """With errors as an impedance analyser has: smooth ones, residuals of its compensation, and noise."""
    s = 2j * np.pi * FREQUENCY_HZ
    along = np.linspace(-1, 1, FREQUENCY_HZ.size)
    smooth = np.polynomial.chebyshev.chebval(along, (rng.normal(size=5) + 1j * rng.normal(size=5)) / np.arange(1, 6))
    smooth *= 4e-4 * (1 + FREQUENCY_HZ / 15e6) / np.sqrt(np.mean(np.abs(smooth) ** 2))
    conductance, capacitance, resistance, inductance = 0.35 * rng.normal(size=4) * (1e-9, 2e-15, 5e-4, 2e-11)
    seen = 1 / (1 / impedance_ohm + conductance + s * capacitance) + resistance + s * inductance
    noise = rng.normal(size=FREQUENCY_HZ.size) + 1j * rng.normal(size=FREQUENCY_HZ.size)
    return seen * (1 + smooth) * (1 + 1e-4 * noise)


@pytest.mark.parametrize("seed", range(40, 46))
def test_a_coil_above_a_plate_leaves_nothing(seed: int) -> None:
    """One in ten such coils ended with a branch of 1 MOhm to the frame and an error of 0.7 %."""
    rng, s = np.random.default_rng(seed), 2j * np.pi * FREQUENCY_HZ
    winding = 1 / (1 / (2.6 + s * 96e-6) + s * 4.4e-12)
    frame = 1 / (1 / (1.2 + s * 0.11e-6 + 1 / (s * 2.6e-12)) + s * 7.7e-12)
    sweeps = [me.ImpedanceSweep(name, FREQUENCY_HZ, measured(ohm, rng)) for name, ohm in (("short", winding), ("open", winding + frame))]

    assert me.fit(me.dc_motor(), sweeps, analyser="e4990a").unexplained_percent["value"] < 0.02
