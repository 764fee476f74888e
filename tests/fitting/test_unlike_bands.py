"""Sweeps of unlike bands: the short-circuit sweep ends below the winding's resonance, so that only the open-circuit sweep shows Ca."""

from __future__ import annotations

import numpy as np
import pytest

import motoremi as me
from motoremi.data.measurement import Measurement
from motoremi.fitting.starts import starts_without_ca

NOISE = 1e-3
SHORT_HZ, OPEN_HZ = np.geomspace(1e3, 100e3, 101), np.geomspace(1e6, 30e6, 101)
# Ra, La, Ca, Rr, Lr, Cr, Cf of motors whose path to the frame was found with kilohms in it, at errors of 2 %.
MOTORS = (
    (17.5, 22.4e-6, 39.6e-12, 2.42, 121e-9, 244e-12, 47.9e-12),
    (17.7, 71.6e-6, 37.1e-12, 6.71, 131e-9, 194e-12, 35.1e-12),
)


def impedance_ohm(frequency_hz: np.ndarray, termination: str, motor: tuple[float, ...]) -> np.ndarray:
    ra, la, ca, rr, lr, cr, cf = motor
    s = 2j * np.pi * frequency_hz
    winding = 1 / (1 / (ra + s * la) + s * ca)
    return winding if termination == "short" else winding + 1 / (1 / (rr + s * lr + 1 / (s * cr)) + s * cf)


def sweep(termination: str, motor: tuple[float, ...], seed: int) -> me.ImpedanceSweep:
    frequency_hz = SHORT_HZ if termination == "short" else OPEN_HZ
    rng = np.random.default_rng(seed)
    noise = 1 + NOISE * (rng.standard_normal(101) + 1j * rng.standard_normal(101))
    return me.ImpedanceSweep(termination, frequency_hz, impedance_ohm(frequency_hz, termination, motor) * noise)


@pytest.mark.slow
@pytest.mark.parametrize("motor", MOTORS, ids=["22 uH", "72 uH"])
def test_the_path_to_the_frame_is_found(motor: tuple[float, ...]) -> None:
    sweeps = [sweep("short", motor, 1), sweep("open", motor, 2)]
    fit = me.fit(me.dc_motor(), sweeps)
    noise_percent = 100 * np.sqrt(2) * NOISE
    assert fit.rms_error_percent < 2 * noise_percent
    # Ra, La and the resonances are seen; of the capacitances to the frame, their sum.
    for name, value in zip(("Ra", "La", "Ca"), motor, strict=False):
        assert fit.parameters[name] == pytest.approx(value, rel=0.01)
    assert fit.parameters["Cr"] + fit.parameters["Cf"] == pytest.approx(motor[5] + motor[6], rel=0.02)
    assert fit.parameters["Rr"] == pytest.approx(motor[3], rel=0.2)


def test_resonances_are_tried_where_only_the_open_circuit_sweep_is() -> None:
    measurement = Measurement.of([sweep("short", MOTORS[0], 1), sweep("open", MOTORS[0], 2)])
    starts = starts_without_ca(measurement)
    resonances_hz = np.array([1 / (2 * np.pi * np.sqrt(start["La"] * start["Ca"])) for start in starts])
    assert resonances_hz.min() > SHORT_HZ[-1]
    assert resonances_hz.max() >= OPEN_HZ[-1]
    assert np.max(np.diff(np.log(np.unique(resonances_hz)))) < 0.08


def test_nothing_is_tried_where_both_sweeps_end_alike() -> None:
    frequency_hz = OPEN_HZ
    both = [me.ImpedanceSweep(name, frequency_hz, impedance_ohm(frequency_hz, name, MOTORS[0])) for name in ("short", "open")]
    assert starts_without_ca(Measurement.of(both)) == []
