"""Ladders against the continuum (textbook closed forms, allowed here only) and against finer ladders."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import ArrayLike
from scipy.special import ive

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.simulate import ladders
from motoremi.simulate.hidden_effects import HiddenEffect
from motoremi.simulate.network import Network, impedance
from motoremi.simulate.simulated_motor import SimulatedMotor

BAND = np.geomspace(150e3, 30e6, 201)
WIDE = np.geomspace(40.0, 110e6, 201)


def one_port(network: Network, frequency: FloatArray) -> ComplexArray:
    return impedance(network, "in", "out", frequency)


def worst(value: ArrayLike, expected: ArrayLike) -> float:
    return float(np.max(np.abs(np.asarray(value) / np.asarray(expected) - 1)))


@pytest.mark.slow
@pytest.mark.parametrize("corner_hz", [1e3, 1e4, 1e5])
def test_lamination_is_the_tanh_of_the_textbook(corner_hz: float) -> None:
    def textbook(frequency: FloatArray) -> ComplexArray:
        x = (1 + 1j) * np.sqrt(frequency / corner_hz)
        return 2j * np.pi * frequency * 1e-5 * np.tanh(x) / x

    sheet = ladders.lamination(1e-5, corner_hz)
    assert worst(one_port(sheet, BAND), textbook(BAND)) < 3e-5
    assert worst(one_port(sheet, WIDE), textbook(WIDE)) < 6e-5


@pytest.mark.parametrize(("ohm", "radius_m"), [(30.0, 1e-4), (5.0, 2.3e-4), (1.0, 5e-4)])
def test_round_wire_is_the_bessel_quotient_of_the_textbook(ohm: float, radius_m: float) -> None:
    def textbook(frequency: FloatArray) -> ComplexArray:
        x = radius_m * np.sqrt(2j * np.pi * frequency * ladders.MU_0 * ladders.COPPER_S_PER_M)
        return np.asarray(ohm * x / 2 * ive(0, x) / ive(1, x), dtype=np.complex128)

    wire = ladders.round_wire(ohm, radius_m)
    assert worst(one_port(wire, BAND), textbook(BAND)) < 3e-5
    assert worst(one_port(wire, WIDE), textbook(WIDE)) < 6e-5
    slow = one_port(wire, np.array([1.0]))[0]
    assert slow.imag / (2 * np.pi) == pytest.approx(ladders.wire_inductance(ohm, radius_m), rel=1e-4)


@pytest.mark.parametrize(("height_m", "layers"), [(2e-4, 1), (2e-4, 2), (5e-4, 6)])
def test_foil_winding_is_dowell(height_m: float, layers: int) -> None:
    ohm = 0.3

    def dowell(frequency: FloatArray) -> ComplexArray:
        x = (1 + 1j) * height_m * np.sqrt(np.pi * frequency * ladders.MU_0 * ladders.COPPER_S_PER_M)
        own: ComplexArray = x / np.tanh(x)
        return ohm * (own + (layers**2 - 1) / 3 * 2 * x * np.tanh(x / 2))

    foil = ladders.foil_winding(ohm, height_m, layers)
    assert worst(one_port(foil, BAND), dowell(BAND)) < 3e-5
    assert worst(one_port(foil, WIDE), dowell(WIDE)) < 6e-5
    slow = one_port(foil, np.array([1.0]))[0]
    assert slow.imag / (2 * np.pi) == pytest.approx(ladders.foil_inductance(ohm, height_m, layers), rel=1e-4)


@pytest.mark.parametrize("tan_delta", [0.002, 0.02, 0.05])
def test_constant_phase_is_constant(tan_delta: float) -> None:
    exponent = 2 / np.pi * np.arctan(tan_delta)
    for frequency, limit in ((BAND, 1e-6), (WIDE, 5e-6)):
        expected = 1 / (2j * np.pi * frequency * 210e-12 * (1j * frequency / 1e6) ** -exponent)
        value = one_port(ladders.constant_phase(210e-12, tan_delta), frequency)
        assert worst(value, expected) < limit
        finer = one_port(ladders.constant_phase(210e-12, tan_delta, per_decade=8), frequency)
        assert worst(value, finer) < limit


def test_resistive_line_is_the_coth_of_the_textbook() -> None:
    x = np.sqrt(2j * np.pi * WIDE * 5e3 * 1e-10)
    assert worst(one_port(ladders.resistive_line(5e3, 1e-10), WIDE), 5e3 / x / np.tanh(x)) < 6e-5


def test_finer_meshes_change_nothing() -> None:
    for usual, finer in (
        (ladders.lamination(1e-5, 3e3), ladders.lamination(1e-5, 3e3, refine=2)),
        (ladders.round_wire(10.0, 2e-4), ladders.round_wire(10.0, 2e-4, refine=2)),
        (ladders.foil_winding(0.3, 3e-4, 4), ladders.foil_winding(0.3, 3e-4, 4, refine=2)),
        (ladders.resistive_line(5e3, 1e-10), ladders.resistive_line(5e3, 1e-10, refine=2)),
    ):
        assert worst(one_port(usual, WIDE), one_port(finer, WIDE)) < 1e-4


@pytest.mark.parametrize("share", [0.03, 0.3])
def test_line_of_cells_is_the_telegraph_line(share: float) -> None:
    base = SimulatedMotor.random(1)
    motor = dataclasses.replace(base, effects=(HiddenEffect("distributed-winding", {"share": share}),))
    s = 2j * np.pi * BAND
    branch = 1 / (1 / (base.Ra + s * base.La) + s * base.Ca)
    shunt = share * s * base.Cf
    far = 1 / (1 / (base.Rr + s * base.Lr + 1 / (s * base.Cr)) + (1 - share) * s * base.Cf)
    angle, wave = np.sqrt(branch * shunt), np.sqrt(branch / shunt)
    short = wave * np.tanh(angle)
    assert worst(motor.impedance("short", BAND), short) < 1e-4
    assert worst(motor.impedance("open", BAND), wave * (far + short) / (wave + far * np.tanh(angle))) < 1e-4


@pytest.mark.parametrize("seed", range(5))
def test_line_of_twice_the_cells(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    motor = SimulatedMotor.random(seed, ["distributed-winding"])
    before = motor.impedance("open", BAND)
    monkeypatch.setattr(ladders, "LINE_CELLS", 2 * ladders.LINE_CELLS)
    assert worst(before, motor.impedance("open", BAND)) < 1e-4
