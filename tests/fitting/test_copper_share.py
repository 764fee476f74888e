"""Copper is only a part of Ra: a winding of foil, as a network of half sheets, in series with a resistance that does not depend on frequency."""

from __future__ import annotations

import numpy as np
import pytest

from motoremi.data.measurement import Measurement
from motoremi.data.sweep import ImpedanceSweep
from motoremi.fitting.fit import fit
from motoremi.model.effects import add_effects
from motoremi.model.motor import dc_motor
from motoremi.simulate import ladders
from motoremi.simulate.network import impedance

COPPER_OHM, HEIGHT_M, LAYERS, REST_OHM, LA = 1.0, 3e-4, 4, 280.0, 50e-6


def sweeps() -> Measurement:
    frequency = np.geomspace(150e3, 30e6, 201)
    s = 2j * np.pi * frequency
    copper = impedance(ladders.foil_winding(COPPER_OHM, HEIGHT_M, LAYERS), "in", "out", frequency)
    winding = 1 / (1 / (REST_OHM + s * LA + copper) + s * 40e-12)
    frame = 1 / (1 / (3.0 + s * 50e-9 + 1 / (s * 330e-12)) + s * 60e-12)
    rng = np.random.default_rng(5)
    noisy = [z * (1 + 3e-4 * (rng.normal(size=201) + 1j * rng.normal(size=201))) for z in (winding, winding + frame) for _ in range(2)]
    named = zip(("short", "short", "open", "open"), noisy, strict=True)
    return Measurement.of([ImpedanceSweep(termination, frequency, z, metadata={"analyser": "4294a"}) for termination, z in named])


@pytest.mark.slow
def test_the_copper_of_a_winding_whose_ra_is_mostly_something_else():
    found = fit(add_effects(dc_motor(), ("proximity-effect",)), sweeps())
    values = found.parameters
    assert found.rms_error_percent < 0.1
    # The catalogue's law has a porosity of 0.8, the foil has none.
    expected = {
        "Ra": REST_OHM + COPPER_OHM,
        "La": LA,
        "proximity-effect.height_m": HEIGHT_M / np.sqrt(0.8),
        "proximity-effect.layers": LAYERS,
        "proximity-effect.share": COPPER_OHM / (REST_OHM + COPPER_OHM),
    }
    for name, value in expected.items():
        assert abs(np.log(values[name] / value)) < 4 * found.sigma[name] / values[name], name
    # If the law were exact: one that changes by half a per cent along frequency makes it 68 %.
    assert found.exact_sigma["proximity-effect.share"] < 0.2 * values["proximity-effect.share"]
