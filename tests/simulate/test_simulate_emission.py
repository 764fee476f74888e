"""The simulated emission (events, waveform, network, receiver), checked without the formulas of `emission`."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest
from ngspice import needs_ngspice, solve

from motoremi.errors import BadInput
from motoremi.simulate import emission_in_time
from motoremi.simulate.emission_in_time import SAMPLE_RATE_HZ, SOURCE_EFFECTS, Stand, background, measure, motor_off, spectrum, transfer, waveform
from motoremi.simulate.network import to_spice
from motoremi.simulate.simulated_motor import SimulatedMotor

SCAN_HZ = 150e3 + 45e3 * np.arange(664)


def test_it_shares_nothing_with_the_formulas():
    folder = Path(emission_in_time.__file__).parent
    for file in folder.glob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.ImportFrom):
                assert not str(node.module).startswith(("motoremi.emission", "motoremi.model", "motoremi.fitting")), file


def test_transfer_of_an_independent_computation():
    """From the project's physics notes (not in this repository), section D.4, to 1 dB; at 150 kHz -40.1 dB: 16.4 Ohm against 1.65 kOhm."""
    stand = Stand(1e3, 1.0, 1e-6)
    decibel = 20 * np.log10(np.abs(transfer(SimulatedMotor(), stand, np.array([150e3, 1e6, 1.74e6, 3e6, 5e6, 11e6, 30e6]))))
    np.testing.assert_allclose(decibel, [-40.1, -17, -5, -17.5, -26, -42, -21.5], atol=0.6)


@needs_ngspice
def test_transfer_from_three_impedances_is_what_ngspice_finds():
    motor, frequency_hz = SimulatedMotor.random(3), np.geomspace(150e3, 30e6, 15)
    # Three driving-point impedances of the same network by ngspice.
    network = motor.network("open").with_node("G", "source").with_node("X", "line")
    lines = [*to_spice(network).splitlines()]
    for name in "12":
        lines += [f"Llisn{name} line choke{name} 50e-6", f"Rdamp{name} choke{name} earth 5", f"Rrec{name} line earth 50"]
    source, line, between = (solve(lines, *pair, frequency_hz) for pair in (("source", "earth"), ("line", "earth"), ("source", "line")))
    expected = (source + line - between) / (2 * source)
    np.testing.assert_allclose(np.abs(transfer(motor, Stand(1e3, 1.0, 1e-6), frequency_hz)), np.abs(expected), rtol=1e-6)


def test_a_ladder_of_sections_is_a_line():
    motor, frequency_hz = SimulatedMotor.random(4), np.geomspace(150e3, 30e6, 40)
    coarse = transfer(motor, Stand(1e3, 1.0, 1e-6, cable_m=5.0), frequency_hz)
    assert np.abs(20 * np.log10(np.abs(coarse / transfer(motor, Stand(1e3, 1.0, 1e-6), frequency_hz)))).max() > 3.0


@pytest.mark.slow
def test_levels_of_an_independent_computation():
    """From the same source: a 12 V arc of 20 ns gives 65 dBuV peak at 150 kHz, 78 at 1.74 MHz, 48 at 5 MHz (LISN and detuning to a few dB)."""
    stand = Stand(1e3, 0.0, 1e-6, arc_v=12.0, arc_rise_s=2e-8, floor_dbuv=-30.0)
    read = measure(SimulatedMotor(Ra=5.0), stand, 150e3 + 10e3 * np.arange(500), 1, quasi_peak=False)
    found = [read.peak[0], read.peak[140:180].max(), read.peak[485]]
    np.testing.assert_allclose(found, [65, 78, 48], atol=2.0)


@pytest.mark.slow
def test_the_waveform_is_made_of_the_drawn_steps():
    stand = Stand(1000.0, 2.0, 5e-7)
    volt = waveform(SimulatedMotor.random(1), stand, 1)
    assert volt.size == round(0.05 * SAMPLE_RATE_HZ)
    assert np.isfinite(volt).all()
    assert np.abs(np.mean(volt)) < 1e-6
    twice = waveform(SimulatedMotor.random(1), Stand(1000.0, 4.0, 5e-7), 1)
    np.testing.assert_allclose(twice, 2 * volt, atol=1e-12)


@pytest.mark.slow
def test_detectors_and_seeds():
    motor = SimulatedMotor.random(2)
    peak, average = (spectrum(motor, SCAN_HZ, name, 3) for name in ("peak", "average"))
    rate = Stand.random(3).repetition_hz
    strong = average > 30
    assert strong.any()
    # Peak of a scattering arc is above its mean.
    assert np.median((peak - average)[strong]) == pytest.approx(20 * np.log10(9.58e3 / rate), abs=4.0)
    assert np.array_equal(peak, spectrum(motor, SCAN_HZ, "peak", 3))
    assert not np.array_equal(peak, spectrum(motor, SCAN_HZ, "peak", 4))
    quiet = background(SCAN_HZ, "average", 3)
    assert np.median(quiet) == pytest.approx(Stand.random(3).floor_dbuv + Stand.random(3).offset_db, abs=1.0)
    assert np.median(average - quiet) > 10
    with pytest.raises(BadInput, match="detector"):
        spectrum(motor, SCAN_HZ, "rms", 3)


def test_what_is_hidden_leaves_the_rest_alone():
    plain = Stand.random(9)
    for name in SOURCE_EFFECTS:
        changed = {key for key, value in vars(Stand.random(9, (name,))).items() if value != getattr(plain, key)}
        assert changed, name
        assert not changed & {"repetition_hz", "step_v", "rise_s", "floor_dbuv", "offset_db"}, name
    with pytest.raises(BadInput, match="unknown source effect"):
        Stand.random(9, ("arc",))


@pytest.mark.slow
def test_background_stays_with_the_motor_off():
    stand = Stand.random(11, ("background-noise",))
    off = motor_off(stand, SCAN_HZ, 11, quasi_peak=False)
    assert np.median(off.average[:60]) > stand.floor_dbuv + stand.offset_db + 6
    # Noise in 50 ms: the peak stands about 9 dB above the average.
    assert np.median(off.peak - off.average) == pytest.approx(9.0, abs=2.0)
