"""A snubber across the brushes and a long strap between frame and ground: two parts that a fit without them hides in elements of the wrong size."""

from __future__ import annotations

import numpy as np
import pytest
from few_effects import BENDING, FEW, seeking

import motoremi as me


def sweeps() -> list[me.ImpedanceSweep]:
    """A motor of 1.1 mH, 100 ohm and 10 nF across it, and its frame on 0.4 m of wire of 1 mm."""
    rng = np.random.default_rng(13)
    frequency = np.geomspace(1e3, 40e6, 201)
    s = 2j * np.pi * frequency
    winding = 1 / (1 / (14 + s * 1.1e-3) + s * 62e-12)
    snubber = 100 + s * 26e-9 + 1 / (s * 10e-9 * (1 - 0.0008j))
    shorted = 1 / (1 / winding + 1 / snubber)
    branch = 13 + s * 0.8e-6 + 1 / (s * 620e-12)
    # The skin effect of copper, where its depth is less than the radius: Schelkunoff's sqrt(j f) law.
    strap = s * 0.38e-6 + 0.4 / (2 * np.pi * 0.5e-3) * np.sqrt(s * 4e-7 * np.pi / 5.8e7)
    opened = shorted + 1 / (1 / branch + s * 380e-12) + strap
    noise = (2e-4 * (rng.standard_normal((2, 201)) + 1j * rng.standard_normal((2, 201)))) / np.sqrt(2)
    return [me.ImpedanceSweep("short", frequency, shorted * (1 + noise[0])), me.ImpedanceSweep("open", frequency, opened * (1 + noise[1]))]


@pytest.mark.case
@pytest.mark.slow
def test_a_strap_is_found_beside_a_snubber() -> None:
    with seeking({*FEW, *BENDING, "suppressor-capacitor"}):
        found = me.diagnose(me.fit(me.dc_motor(), sweeps(), analyser="4294a"))
    assert sorted(found.effects) == ["ground-strap-inductance", "suppressor-capacitor"]
    assert found.best.rms_error_percent < 0.1 < 40 < found.base.rms_error_percent
    values = found.best.parameters
    assert values["ground-strap-inductance.inductance_h"] == pytest.approx(0.38e-6, rel=0.02)
    assert values["suppressor-capacitor.esr_ohm"] == pytest.approx(100, rel=0.02)
