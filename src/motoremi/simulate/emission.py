"""The common-mode spectrum that a receiver would show: commutation pulses, motor, LISN (physics notes B.2, D.3, D.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from motoremi.arrays import FloatArray
from motoremi.errors import BadInput
from motoremi.simulate.hidden import log_uniform, uniform
from motoremi.simulate.motor import SimulatedMotor
from motoremi.simulate.network import Network, impedance

# Impulse bandwidth of the 9 kHz filter of CISPR band B.
IMPULSE_BANDWIDTH_HZ = 9.45e3
_LISN = Network().inductor("L", "line", "damped", 50e-6).resistor("R", "damped", "ground", 5.0).resistor("receiver", "line", "ground", 50.0)
# How much higher each detector reads on receiver noise than the average does, in dB.
_NOISE_ABOVE_AVERAGE_DB = {"average": 0.0, "quasi-peak": 6.0, "peak": 11.0}


@dataclass(frozen=True)
class CommutationPulses:
    """Voltage steps when a brush leaves a segment.

    Parameters
    ----------
    step_v : float
        Height of the arc's step.
    rise_s : float
    repetition_hz : float
        Segments per second.
    """

    step_v: float
    rise_s: float
    repetition_hz: float

    @classmethod
    def random(cls, seed: int) -> CommutationPulses:
        """Draw the source of one running motor."""
        rng = np.random.default_rng([seed, 1])
        return cls(uniform(rng, 12.0, 20.0), log_uniform(rng, 2e-8, 1e-7), log_uniform(rng, 500.0, 2500.0))

    def density(self, frequency_hz: FloatArray) -> FloatArray:
        """Fourier integral of one step, in volt seconds: a ramp of `rise_s` in place of the jump."""
        return self.step_v / (2 * np.pi * frequency_hz) * np.abs(np.sinc(frequency_hz * self.rise_s))


def transfer(motor: SimulatedMotor, frequency_hz: FloatArray) -> FloatArray:
    """Voltage at the receiver per volt of the source: the motor feeds two LISNs in parallel."""
    common_mode = impedance(_LISN, "line", "ground", frequency_hz) / 2
    return np.abs(common_mode / (common_mode + motor.impedance("open", frequency_hz)))


def spectrum(motor: SimulatedMotor, frequency_hz: ArrayLike, detector: str, seed: int) -> FloatArray:
    """Level at the receiver.

    Parameters
    ----------
    motor : SimulatedMotor
    frequency_hz : array_like, shape (n,)
        150 kHz to 30 MHz.
    detector : {"peak", "quasi-peak", "average"}
    seed : int
        One seed is one source and one receiver; ripple and noise differ between detectors, which are scanned one by one.

    Returns
    -------
    ndarray, shape (n,)
        In dBuV.
    """
    _check_detector(detector)
    frequency: FloatArray = np.asarray(frequency_hz, dtype=np.float64)
    pulses = CommutationPulses.random(seed)
    density = np.sqrt(2) * pulses.density(frequency) * transfer(motor, frequency)
    peak_dbuv = _dbuv(density * IMPULSE_BANDWIDTH_HZ)
    signal_dbuv = {
        "peak": peak_dbuv,
        "quasi-peak": peak_dbuv - _peak_above_quasi_peak_db(pulses.repetition_hz),
        "average": _dbuv(density * pulses.repetition_hz),
    }[detector]
    receiver = np.random.default_rng([seed, 2])
    offset_db, floor_dbuv = receiver.normal(0.0, 0.7), receiver.uniform(-10.0, 5.0)
    scan = np.random.default_rng([seed, 3, list(_NOISE_ABOVE_AVERAGE_DB).index(detector)])
    ripple_db = scan.normal(0.0, 0.5, frequency.size)
    noise_dbuv = floor_dbuv + _NOISE_ABOVE_AVERAGE_DB[detector] + scan.normal(0.0, 1.0, frequency.size)
    level: FloatArray = 10 * np.log10(10 ** ((signal_dbuv + offset_db + ripple_db) / 10) + 10 ** (noise_dbuv / 10))
    return level


def background(frequency_hz: ArrayLike, detector: str, seed: int) -> FloatArray:
    """Level at the receiver with the motor off, in dBuV, shape (n,): the same receiver's noise, drawn anew."""
    _check_detector(detector)
    size = np.asarray(frequency_hz).size
    receiver = np.random.default_rng([seed, 2])
    receiver.normal(0.0, 0.7)
    floor_dbuv = receiver.uniform(-10.0, 5.0)
    scan = np.random.default_rng([seed, 4, list(_NOISE_ABOVE_AVERAGE_DB).index(detector)])
    level: FloatArray = floor_dbuv + _NOISE_ABOVE_AVERAGE_DB[detector] + scan.normal(0.0, 1.0, size)
    return level


def _check_detector(detector: str) -> None:
    if detector not in _NOISE_ABOVE_AVERAGE_DB:
        raise BadInput(f"unknown detector {detector!r}: use {', '.join(_NOISE_ABOVE_AVERAGE_DB)}")


def _dbuv(volt: FloatArray) -> FloatArray:
    level: FloatArray = 20 * np.log10(volt / 1e-6)
    return level


def _peak_above_quasi_peak_db(repetition_hz: float) -> float:
    """6.5 dB at 100 Hz, 2 dB at 1 kHz (pulse table of CISPR 16-1-1, band B), never negative."""
    return float(max(0.0, 6.5 - 4.5 * np.log10(repetition_hz / 100.0)))
