"""A winding that is coupled to La, with losses in its copper and across it: by nodal analysis, in ideal parts, and from a fit."""

from __future__ import annotations

import numpy as np
import pytest

import motoremi as me
from motoremi.export.ideal_network import resonant_loop
from motoremi.model import laws

FREQUENCY_HZ = np.geomspace(5e3, 30e6, 201)
S = 2j * np.pi * FREQUENCY_HZ
LA_H, FIELD_H, FIELD_F, COUPLING = 250e-6, 38e-3, 150e-12, 0.28


def coupled(copper_ohm: float, across_ohm: float) -> np.ndarray:
    """Two coils: the current in the second one flows through its copper into its capacitance, across which there is a resistance."""
    mutual = COUPLING * np.sqrt(LA_H * FIELD_H)
    mesh = S * FIELD_H + copper_ohm + 1 / (S * FIELD_F + 1 / across_ohm)
    return S * LA_H - (S * mutual) ** 2 / mesh


@pytest.mark.parametrize(("copper_ohm", "across_ohm"), [(800.0, 1e9), (800.0, 300e3), (1e-3, 150e3)])
def test_the_law_is_that_of_two_coils(copper_ohm: float, across_ohm: float) -> None:
    along, across = copper_ohm / FIELD_H, 1 / (across_ohm * FIELD_F)
    w = 1 / np.sqrt(FIELD_H * FIELD_F)
    parameters = (COUPLING, w / (2 * np.pi), w / (along + across), across / (along + across))
    factor, _ = laws.lossy_coupled_winding_factor(S, *parameters)
    np.testing.assert_allclose(S * LA_H * factor, coupled(copper_ohm, across_ohm), rtol=1e-9)
    loop = resonant_loop("La", COUPLING**2 * LA_H, w, along + across, across / (along + across))
    np.testing.assert_allclose(S * (1 - COUPLING**2) * LA_H + loop.impedance(S), coupled(copper_ohm, across_ohm), rtol=1e-9)


def test_without_a_share_across_it_is_the_simpler_law() -> None:
    w = 2 * np.pi * 2e6
    textbook = 1 - 0.3**2 * S**2 / (S**2 + S * w / 7.0 + w**2)
    plain, slopes = laws.coupled_winding_factor(S, 0.3, 2e6, 7.0)
    lossy, more = laws.lossy_coupled_winding_factor(S, 0.3, 2e6, 7.0, 0.0)
    np.testing.assert_allclose(plain, textbook, rtol=1e-13)
    np.testing.assert_allclose(lossy, plain, rtol=1e-14)
    np.testing.assert_allclose(more[:3], slopes, rtol=1e-9, atol=1e-18)


@pytest.mark.slow
def test_a_field_winding_with_losses_across_it_is_described_to_the_noise() -> None:
    """With all of the damping in its copper 0.3 % were left, and a resonant cell was named instead, with 0.06 %."""
    winding = 1 / (1 / (70 + coupled(800.0, 1.2e6)) + S * 117e-12)
    rng = np.random.default_rng(2)
    sweeps = [me.ImpedanceSweep("short", FREQUENCY_HZ, winding * (1 + 2e-4 * (rng.normal(size=201) + 1j * rng.normal(size=201)))) for _ in range(3)]
    fit = me.fit(me.dc_motor(), sweeps, analyser="4294a").add("field-coupling")
    assert fit.rms_error_percent < 0.05
    assert fit.parameters["field-coupling.coupling"] == pytest.approx(COUPLING, rel=0.02)
    assert fit.parameters["field-coupling.across_share"] == pytest.approx(1 / (1 + 800.0 / FIELD_H * 1.2e6 * FIELD_F), abs=0.05)
