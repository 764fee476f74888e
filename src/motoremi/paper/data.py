"""Simulated sweeps of the paper's motor."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from motoremi.arrays import FloatArray
from motoremi.data.sweep import TERMINATIONS, ImpedanceSweep
from motoremi.paper.printed import HIGHEST_HZ, LOWEST_HZ
from motoremi.simulate.hidden_effects import HiddenEffect
from motoremi.simulate.simulated_motor import SimulatedMotor

POINTS = 401
NOISE = 0.005


def grid_hz() -> FloatArray:
    """The paper's band, logarithmically spaced."""
    return np.geomspace(LOWEST_HZ, HIGHEST_HZ, POINTS)


def simulated(elements: Mapping[str, float], hidden: HiddenEffect | None = None) -> SimulatedMotor:
    """A motor with these seven elements and at most one hidden effect."""
    return SimulatedMotor(**elements, effects=() if hidden is None else (hidden,))


def sweeps(elements: Mapping[str, float], hidden: HiddenEffect | None = None, noise: float = NOISE, seed: int = 2011) -> list[ImpedanceSweep]:
    """Both sweeps; `noise` is the relative noise of the real and of the imaginary part. The sweeps always state 0.5 %, also with 0."""
    motor = simulated(elements, hidden)
    rng = np.random.default_rng(seed)
    frequency = grid_hz()
    measured = []
    for termination in TERMINATIONS:
        error = noise * (rng.normal(size=POINTS) + 1j * rng.normal(size=POINTS))
        measured.append(ImpedanceSweep(termination, frequency, motor.impedance(termination, frequency) * (1 + error), NOISE))
    return measured
