"""Effects that have exchanged places with an element of the motor."""

from __future__ import annotations

import numpy as np
import pytest

import motoremi as me
from motoremi.model.effects import find_effect


def test_an_added_cell_is_smaller_than_the_winding() -> None:
    """A winding of 1.5 mH and a cell of 0.14 mH on a network analyser: with the two exchanged the error stayed at 31 %."""
    frequency = np.linspace(50e3, 20e6, 61)
    s = 2j * np.pi * frequency
    winding = 1 / (1 / (7.4 + s * 1.455e-3) + s * 17.9e-12) + 1 / (1 / (s * 141.6e-6) + s * 4.28e-12 + 1 / 10.2e3)
    frame = 1 / (1 / (35 + s * 10.2e-6 + 1 / (s * 32e-12)) + s * 27e-12)
    rng, sweeps = np.random.default_rng(1), []
    for termination, z in (("short", winding), ("open", winding + frame)):
        seen = (z - 50) / (z + 50) + 1e-4 * (rng.standard_normal((61, 2)) @ [1, 1j])
        sweeps.append(me.ImpedanceSweep(termination, frequency, 50 * (1 + seen) / (1 - seen)))
    added = me.fit(me.dc_motor(), sweeps, analyser="nanovna").add("second-resonance")
    assert added.chi2_reduced < 2
    assert added.parameters["La"] == pytest.approx(1.455e-3, rel=0.05)
    assert added.parameters["second-resonance.inductance_h"] == pytest.approx(141.6e-6, rel=0.05)


def test_a_cell_and_a_winding_that_exchange_twice_are_where_they_were() -> None:
    exchange = find_effect("second-resonance").effect.exchange
    assert exchange is not None
    values = {"La": 80e-6, "Ca": 9e-12, "Ra": 800.0, "inductance_h": 1e-3, "resonance_hz": 1e6, "resistance_ohm": 90e3, "series_share": 0.0}
    assert exchange(exchange(values)) == pytest.approx(values)
