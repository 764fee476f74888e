"""Random motors with known truth, in three groups.

*hard*: lightly damped (Ra 0.02 - 20 Ohm), bounds one decade either way of the truth, off centre; *wide*: the same motors, two decades;
*damped*: Ra 10 - 200 Ohm, one decade. Two sweeps of 401 points, 1 % complex Gaussian noise.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.sweep import ImpedanceSweep

GROUPS = ("hard", "wide", "damped")
NAMES = ("Ra", "La", "Ca", "Rr", "Lr", "Cr", "Cf")
RANGES = {"La": (2e-6, 60e-6), "Ca": (5e-12, 100e-12), "Rr": (5, 200), "Lr": (0.3e-6, 8e-6), "Cr": (100e-12, 1500e-12), "Cf": (50e-12, 800e-12)}
RESISTANCE = {"hard": (0.02, 20.0), "wide": (0.02, 20.0), "damped": (10.0, 200.0)}
DECADES = {"hard": 1.0, "wide": 2.0, "damped": 1.0}
NOISE = 0.01


@dataclass(frozen=True)
class Case:
    """One motor: its truth, the bounds given to every method, the sweeps."""

    group: str
    number: int
    truth: FloatArray
    bounds: dict[str, tuple[float, float]]
    frequency_hz: FloatArray
    short_ohm: ComplexArray
    open_ohm: ComplexArray

    @property
    def sweeps(self) -> list[ImpedanceSweep]:
        """The sweeps with their noise stated."""
        return [
            ImpedanceSweep("short", self.frequency_hz, self.short_ohm, NOISE),
            ImpedanceSweep("open", self.frequency_hz, self.open_ohm, NOISE),
        ]


def impedances(logarithms: FloatArray, frequency_hz: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """Equations (1) and (2) for a batch of ln parameters, shape (..., 7); used by the other methods. Shapes (..., n)."""
    ra, la, ca, rr, lr, cr, cf = (np.exp(logarithms[..., i, None]) for i in range(7))
    s = 2j * np.pi * frequency_hz
    branch = ra + s * la
    short = branch / (1 + s * ca * branch)
    rotor = rr + s * lr + 1 / (s * cr)
    return short, short + rotor / (1 + s * cf * rotor)


def chi_squared(case: Case, logarithms: FloatArray) -> FloatArray:
    """Sum of squares of (Z_model - Z_measured) / (1 % of |Z_measured|)."""
    short, open_ = impedances(np.asarray(logarithms), case.frequency_hz)
    total: FloatArray = sum(
        np.sum(np.abs((model - measured) / (NOISE * np.abs(measured))) ** 2, axis=-1)
        for model, measured in ((short, case.short_ohm), (open_, case.open_ohm))
    )  # type: ignore[assignment]
    return total


def cases(group: str, count: int, seed: int = 2026, points: int = 401) -> Iterator[Case]:
    """`count` motors of a group; `hard` and `wide` share their motors."""
    frequency = np.geomspace(150e3, 30e6, points)
    for number in range(count):
        rng = np.random.default_rng((seed, number, group == "damped"))
        low, high = RESISTANCE[group]
        draws = [rng.uniform(np.log(low), np.log(high)), *(rng.uniform(np.log(a), np.log(b)) for a, b in RANGES.values())]
        truth = np.array(draws)
        short, open_ = impedances(truth, frequency)
        noisy = [z * (1 + NOISE * (rng.normal(size=points) + 1j * rng.normal(size=points))) for z in (short, open_)]
        half = DECADES[group] * np.log(10)
        centre = truth + rng.uniform(-0.6, 0.6, 7) * half
        bounds = {name: (float(np.exp(c - half)), float(np.exp(c + half))) for name, c in zip(NAMES, centre, strict=True)}
        yield Case(group, number, truth, bounds, frequency, noisy[0], noisy[1])
