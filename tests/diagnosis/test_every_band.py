"""Cages and coupled sections are recognised in sweeps that begin far above their corner frequencies, by skin effect and resonances."""

from __future__ import annotations

import numpy as np
import pytest

import motoremi as me
from motoremi.simulate.analyser_errors import SimulatedAnalyser
from motoremi.simulate.simulated_motor import SimulatedMotor

ELEMENTS = {"Ra": 6.7, "La": 77e-6, "Ca": 150e-12, "Rr": 33.0, "Lr": 0.32e-6, "Cr": 0.9e-9, "Cf": 0.18e-9}


def swept(frequency_hz, impedance_ohm, termination: str, connection: int) -> me.ImpedanceSweep:
    seen = SimulatedAnalyser(3).measure(termination, frequency_hz, impedance_ohm, connection=connection)
    return me.ImpedanceSweep(termination, frequency_hz, seen, metadata={"analyser": "4294a"})


def named_or_in_family(found: me.Diagnosis) -> set[str]:
    return {*found.effects, *(name for family in found.families for name in family)}


@pytest.mark.slow
def test_a_deep_bar_is_recognised_from_50_khz() -> None:
    """The bar as a ladder of 25 layers of metal and flux, its corner at 5 kHz."""
    frequency_hz = np.geomspace(50e3, 30e6, 201)
    s = 2j * np.pi * frequency_hz
    depth = s / (2 * np.pi * 600.0)
    bar = 51.0 + 0 * s
    for layer in range(24, -1, -1):
        bar = (2 * layer + 1) + depth / bar
    inductive = s * ELEMENTS["La"] * (1 - 0.6 * s / (s + 2 * np.pi * 5e3 * bar))
    winding = 1 / (1 / (ELEMENTS["Ra"] + inductive) + s * ELEMENTS["Ca"])
    frame = 1 / (1 / (ELEMENTS["Rr"] + s * ELEMENTS["Lr"] + 1 / (s * ELEMENTS["Cr"])) + s * ELEMENTS["Cf"])
    sweeps = [swept(frequency_hz, ohm, name, at) for at, (name, ohm) in enumerate((("short", winding), ("open", winding + frame)))]
    found = me.diagnose(me.fit(me.dc_motor(), sweeps))
    assert found.verdict in ("missing-effect", "family")
    assert "rotor-cage" in named_or_in_family(found)


@pytest.mark.slow
def test_coupled_sections_are_recognised_from_150_khz() -> None:
    frequency_hz = np.geomspace(150e3, 30e6, 201)
    motor = SimulatedMotor.random(4, ("winding-sections",))
    sweeps = [swept(frequency_hz, motor.impedance(name, frequency_hz), name, at) for at, name in enumerate(("short", "open"))]
    found = me.diagnose(me.fit(me.dc_motor(), sweeps))
    assert "winding-sections" in named_or_in_family(found)
