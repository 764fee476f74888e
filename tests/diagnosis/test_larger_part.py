"""A winding of two groups of coils: each resonates, and only the larger one is also damped across, which the paper's winding is not."""

from __future__ import annotations

import numpy as np
import pytest
from few_effects import FEW, seeking

import motoremi as me

LARGE_H, SMALL_H = 85e-6, 4.3e-6


def sweeps() -> list[me.ImpedanceSweep]:
    """Twice each, with noise of 0.1 %."""
    rng = np.random.default_rng(29)
    frequency = np.geomspace(150e3, 30e6, 301)
    s = 2j * np.pi * frequency
    large = 1 / (1 / (420 + s * LARGE_H) + s * 11.4e-12 + 1 / 80e3)
    small = 1 / (1 / (44 + s * SMALL_H) + s * 24e-12)
    frame = 1 / (1 / (3 + s * 0.22e-6 + 1 / (s * 950e-12)) + s * 300e-12)
    found = []
    for termination, ohm in (("short", large + small), ("open", large + small + frame)) * 2:
        noise = 1 + 1e-3 * (rng.standard_normal(301) + 1j * rng.standard_normal(301))
        found.append(me.ImpedanceSweep(termination, frequency, ohm * noise))
    return found


@pytest.mark.slow
def test_the_larger_part_is_named_where_only_so_everything_is_described() -> None:
    """It was no candidate, and a cable of the analyser with coupled sections was named."""
    with seeking({*FEW, "second-resonance", "field-coupling", "cable-delay"}):
        found = me.diagnose(me.fit(me.dc_motor(), sweeps()))
    assert found.verdict in ("missing-effect", "family")
    assert found.effects == ("second-resonance",)
    assert found.best.parameters["second-resonance.inductance_h"] == pytest.approx(LARGE_H, rel=0.03)
    assert found.best.parameters["La"] == pytest.approx(SMALL_H, rel=0.05)
    assert any("so La, Ca and Ra are those of the smaller one" in reason for reason in found.said)
