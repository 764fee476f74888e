"""Cages and coupled sections are recognised in sweeps that begin far above their corner frequencies, by skin effect and resonances."""

from __future__ import annotations

import numpy as np
import pytest
from few_effects import FEW, seeking

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


@pytest.mark.case
@pytest.mark.slow
@pytest.mark.parametrize("count", [14, 36])
def test_a_ladder_with_its_capacitance_across_the_ends_is_recognised(count: int) -> None:
    """Sections that link no flux, each with its capacitance to the frame; Ca is that of connections and brush holders, not of turns."""
    frequency_hz = np.geomspace(150e3, 30e6, 401)
    s = 2j * np.pi * frequency_hz
    ra, la, ca, spread = 40.0, 120e-6, 50e-12, 550e-12
    a, b, c, d = 1 + 0 * s, 0 * s, 0 * s, 1 + 0 * s
    series, half = (ra + s * la) / count, 0.5 * s * spread / count
    # Of one section: half of its capacitance at either end.
    own = (1 + series * half, series, half * (2 + series * half), 1 + series * half)
    for _ in range(count):
        a, b, c, d = a * own[0] + b * own[2], a * own[1] + b * own[3], c * own[0] + d * own[2], c * own[1] + d * own[3]
    near, far, between = d / b + s * ca, a / b + s * ca, 1 / b + s * ca
    frame = 1 / (26.0 + s * 0.9e-6 + 1 / (s * 600e-12)) + s * 90e-12
    seen = {"short": 1 / near, "open": 1 / (near - between**2 / (far + frame))}
    sweeps = [swept(frequency_hz, ohm, name, at) for at, (name, ohm) in enumerate(seen.items())]
    with seeking(FEW | {"distributed-winding", "winding-sections"}):
        found = me.diagnose(me.fit(me.dc_motor(), sweeps))
    assert "winding-sections" in named_or_in_family(found)
    values = found.best.parameters
    assert values["winding-sections.sections"] == count
    assert values["winding-sections.end_share"] > 0.9
    assert values["La"] == pytest.approx(la, rel=0.02)
