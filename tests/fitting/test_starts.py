"""Start values that are computed from the sweeps."""

from __future__ import annotations

import numpy as np
import pytest

from motoremi.data.measurement import Measurement
from motoremi.data.sweep import ImpedanceSweep
from motoremi.fitting.starts import base_starts, data_driven_starts, seen
from motoremi.model.effects.rational_starts import frame_behind_strap, winding_behind_lead
from motoremi.model.effects.start import Set
from motoremi.model.path_to_frame import frames

FREQUENCY_HZ = np.geomspace(10e3, 60e6, 400)
WINDING = {"Ra": 3.6, "La": 0.72e-3, "Ca": 200e-12}
FRAME = {"Rr": 7.0, "Lr": 2.8e-6, "Cr": 3.8e-9, "Cf": 1.1e-9}


def path_to_frame(strap_h: float) -> np.ndarray:
    s = 2j * np.pi * FREQUENCY_HZ
    branch = FRAME["Rr"] + s * FRAME["Lr"] + 1 / (s * FRAME["Cr"])
    return 1 / (1 / branch + s * FRAME["Cf"]) + s * strap_h


def sweeps_behind(strap_h: float) -> Measurement:
    s = 2j * np.pi * FREQUENCY_HZ
    winding = 1 / (1 / (WINDING["Ra"] + s * WINDING["La"]) + s * WINDING["Ca"])
    rng = np.random.default_rng(5)
    noisy = [z * (1 + 1e-3 * (rng.normal(size=400) + 1j * rng.normal(size=400))) for z in (winding, winding + path_to_frame(strap_h))]
    return Measurement.of([ImpedanceSweep("short", FREQUENCY_HZ, noisy[0]), ImpedanceSweep("open", FREQUENCY_HZ, noisy[1])])


def test_the_path_to_the_frame_is_read_behind_a_strap():
    """The strap resonates with Cf at 16 MHz, more sharply than the frame at 1.5 MHz, and without it in the scan is taken for the frame."""
    measurement = sweeps_behind(90e-9)
    start = frame_behind_strap(seen(measurement))[0]
    for name, value in FRAME.items():
        assert start[Set(name)] == pytest.approx(value, rel=0.2)
    assert start["inductance_h"] == pytest.approx(90e-9, rel=0.01)
    assert abs(np.log(data_driven_starts(measurement)[0]["Lr"] / FRAME["Lr"])) > 1


@pytest.mark.parametrize("strap_h", [0.0, 20e-9, 300e-9])
def test_a_scan_with_a_strap_is_as_exact_as_its_steps_without_noise(strap_h):
    found = frames(FREQUENCY_HZ, path_to_frame(strap_h), np.abs(path_to_frame(strap_h)), has_strap=True)[0]
    for name, value in FRAME.items():
        assert found[name] == pytest.approx(value, rel=0.02)
    assert found["inductance_h"] == pytest.approx(strap_h, rel=2e-3, abs=1e-10)


@pytest.mark.parametrize("frame_anew", [True, False])
def test_few_starts_divide_the_capacitance_to_the_frame_anew_where_asked_for(frame_anew):
    lost = {**WINDING, **FRAME, "Cr": 4.9e-9, "Cf": 1e-13}
    starts = base_starts(lost, sweeps_behind(0.0), few=True, frame_anew=frame_anew)
    assert starts[0] == lost
    anew = [start for start in starts if start["Cf"] == pytest.approx(0.4 * 4.9e-9)]
    assert [start["Cr"] + start["Cf"] for start in anew] == [pytest.approx(4.9e-9)] * frame_anew


def test_the_winding_is_read_behind_a_lead():
    """The lead resonates with the winding's capacitance at 14 MHz."""
    s = 2j * np.pi * FREQUENCY_HZ
    winding = 1 / (1 / (WINDING["Ra"] + s * WINDING["La"]) + s * WINDING["Ca"])
    rng = np.random.default_rng(6)
    noisy = (winding + 0.05 + s * 640e-9) * (1 + 1e-3 * (rng.normal(size=400) + 1j * rng.normal(size=400)))
    (start,) = winding_behind_lead(seen(Measurement.of([ImpedanceSweep("short", FREQUENCY_HZ, noisy)])))
    for name, value in WINDING.items():
        assert start[Set(name)] == pytest.approx(value, rel=0.02)
    assert start["inductance_h"] == pytest.approx(640e-9, rel=0.01)


def test_no_open_circuit_sweep_gives_no_start():
    short = ImpedanceSweep("short", FREQUENCY_HZ, path_to_frame(0.0))
    assert frame_behind_strap(seen(Measurement.of([short]))) == []
