"""Disturbances that are added to simulated sweeps: flicker noise, stations, a handheld analyser, a motor that warms."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from scipy.interpolate import BarycentricInterpolator, PchipInterpolator

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.sweep import Termination
from motoremi.simulate.analyser_errors import SimulatedAnalyser
from motoremi.simulate.hidden import uniform
from motoremi.simulate.simulated_motor import SimulatedMotor

Generator: TypeAlias = np.random.Generator

LINE_OHM = 50.0
# Noise of a handheld analyser's reflection coefficient at 1 kHz bandwidth.
REFLECTION_NOISE = 1e-4
# Medium wave and the short-wave broadcast bands, in hertz.
BROADCAST_HZ = (
    (531e3, 1602e3), (3.9e6, 4.0e6), (5.9e6, 6.2e6), (7.2e6, 7.45e6), (9.4e6, 9.9e6), (11.6e6, 12.1e6),
    (13.57e6, 13.87e6), (15.1e6, 15.83e6), (17.48e6, 17.9e6), (21.45e6, 21.85e6),
)  # fmt: skip
# Number of states at which a warming motor is computed; between them it is interpolated.
_STATES = 7


def flicker_noise(rng: Generator, points: int) -> FloatArray:
    """Noise with a 1/f power spectrum and unit variance: it is correlated in time, and averaging does not remove it."""
    count = points // 2 + 1
    amplitude = 1 / np.sqrt(np.maximum(np.arange(count), 1))
    series = np.fft.irfft(amplitude * (rng.standard_normal(count) + 1j * rng.standard_normal(count)), points)
    return series / series.std()


def smooth_error(rng: Generator, frequency_hz: FloatArray, size: float) -> ComplexArray:
    """A complex error, smooth in log frequency, whose magnitude is `size` rms on average."""
    knots = np.linspace(np.log(5e4), np.log(3e8), int(rng.integers(5, 9)))
    parts = PchipInterpolator(knots, rng.standard_normal((2, knots.size)), axis=1)(np.clip(np.log(frequency_hz), knots[0], knots[-1]))
    return size / np.sqrt(2) * (parts[0] + 1j * parts[1])


class ReflectionAnalyser:
    """A handheld network analyser: residuals of its three error terms after calibration with low-cost standards, and noise.

    Parameters
    ----------
    rng : Generator
    level : float
        Size of each error term.
    noise : Generator, optional
        Random stream of the noise; by default that of the errors.
    """

    def __init__(self, rng: Generator, level: float, noise: Generator | None = None) -> None:
        self._seeds = [int(seed) for seed in rng.integers(0, 2**31, 3)]
        self._noise = noise or rng
        self.level = level

    def measure(self, frequency_hz: FloatArray, impedance_ohm: ComplexArray) -> ComplexArray:
        """One sweep, as impedance."""
        true = (impedance_ohm - LINE_OHM) / (impedance_ohm + LINE_OHM)
        leak, match, tracking = (smooth_error(np.random.default_rng(seed), frequency_hz, self.level) for seed in self._seeds)
        noise = self._noise.standard_normal((2, frequency_hz.size))
        shown = leak + (1 + tracking) * true / (1 - match * true) + REFLECTION_NOISE * (noise[0] + 1j * noise[1])
        return LINE_OHM * (1 + shown) / (1 - shown)


class DoubledAnalyser(SimulatedAnalyser):
    """An analyser with twice the usual gain error."""

    def gain_error(self, frequency_hz: FloatArray) -> ComplexArray:
        """Twice the usual error."""
        return 2 * super().gain_error(frequency_hz)


def behind_fixture(impedance: ComplexArray, frequency_hz: FloatArray, ohm: float, henry: float, farad: float) -> ComplexArray:
    """Impedance at the input of a fixture: R and L in series with the motor, C across the input."""
    s = 2j * np.pi * frequency_hz
    series = impedance + ohm + s * henry
    return np.asarray(series / (1 + s * farad * series), dtype=np.complex128)


def warming(motor: SimulatedMotor, termination: Termination, frequency_hz: FloatArray, warmth: FloatArray, rises: dict[str, float]) -> ComplexArray:
    """Impedance of a motor that warms from point to point.

    Parameters
    ----------
    motor : SimulatedMotor
    termination : {"short", "open"}
    frequency_hz : ndarray, shape (n,)
    warmth : ndarray, shape (n,)
        0 (cold) to 1 (warm).
    rises : dict
        Relative increase of elements from cold to warm.
    """
    states = 0.5 - 0.5 * np.cos(np.pi * np.arange(_STATES) / (_STATES - 1))
    motors = [changed(motor, {name: 1 + rise * state for name, rise in rises.items()}) for state in states]
    curves = np.array([np.log(warmer.impedance(termination, frequency_hz)) for warmer in motors])
    curves = curves.real + 1j * np.unwrap(curves.imag, axis=0)
    weights = np.asarray(BarycentricInterpolator(states, np.eye(_STATES))(warmth))
    return np.exp(np.sum(weights.T * curves, axis=0))


def changed(motor: SimulatedMotor, factors: dict[str, float]) -> SimulatedMotor:
    """The motor with elements times factors."""
    return dataclasses.replace(motor, **{name: getattr(motor, name) * factor for name, factor in factors.items()})


def station_points(rng: Generator, frequency_hz: FloatArray) -> list[int]:
    """3 to 15 points in broadcast bands, in clusters of one to three."""
    wanted, chosen = int(rng.integers(3, 16)), set[int]()
    audible = [band for band in BROADCAST_HZ if band[0] < frequency_hz[-1] and band[1] > frequency_hz[0]]
    while len(chosen) < wanted:
        low, high = audible[int(rng.integers(len(audible)))]
        first = int(np.argmin(np.abs(frequency_hz - uniform(rng, low, high))))
        cluster = range(first, min(first + int(rng.integers(1, 4)), frequency_hz.size))
        chosen.update(list(cluster)[: wanted - len(chosen)])
    return sorted(chosen)


def point_errors(rng: Generator, points: Sequence[int], size: int, low: float, high: float) -> ComplexArray:
    """Errors of random phase and of magnitude `low` to `high` at these of `size` points, zero at the others."""
    error = np.zeros(size, dtype=np.complex128)
    magnitude = np.exp(rng.uniform(np.log(low), np.log(high), len(points)))
    error[list(points)] = magnitude * np.exp(2j * np.pi * rng.random(len(points)))
    return error
