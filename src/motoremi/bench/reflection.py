"""Base class of network analysers that measure impedance by reflection: calibration, fixture, and the accuracy of S11 far from 50 Ohm."""

from __future__ import annotations

import abc
import math
from collections.abc import Mapping
from itertools import combinations, pairwise
from typing import ClassVar

import numpy as np

from motoremi.arrays import ComplexArray, JsonDict
from motoremi.bench.impedance_analyser import ImpedanceAnalyser, Spacing, Standard
from motoremi.bench.transport import Transport
from motoremi.errors import BadInput, InstrumentError
from motoremi.quantities import show


class ReflectionAnalyser(ImpedanceAnalyser):
    """A network analyser that measures S11 at one port.

    The fixture behind a calibrated connector is removed here, by what was measured with open and short. The driver of an analyser that sends
    raw data overrides `impedance_of`.
    """

    analyser = "nanovna"
    REFERENCE_OHM: ClassVar[float] = 50.0
    # Error of the reflection coefficient, a tenth of what a careless calibration leaves: an estimate, not from a data sheet.
    GAMMA_ERROR: ClassVar[float] = 5e-3
    # The noise of a standard enters every later sweep but not their scatter, so it has to be far below the noise of a sweep.
    SCANS_OF_A_STANDARD: ClassVar[int] = 16

    def __init__(self, transport: Transport) -> None:
        super().__init__(transport)
        self._measured: ComplexArray | None = None
        # S11 of each standard, as measured.
        self._standards: dict[Standard, ComplexArray] = {}

    @abc.abstractmethod
    def scan(self) -> ComplexArray:
        """S11 of one sweep, at the frequencies of `read_axis`."""

    def scan_mean(self, scans: int) -> ComplexArray:
        """Mean of S11 over a number of sweeps."""
        # S11 is averaged rather than impedance, because the impedance of an open fixture is mostly noise.
        return np.mean([self.scan() for _ in range(scans)], axis=0)

    def impedance_of(self, reflection: ComplexArray) -> ComplexArray:
        """Impedance in ohm, from the measured S11."""
        open_ohm, short_ohm = (
            impedance_from_reflection(self._standards[name], self.REFERENCE_OHM) if name in self._standards else None for name in ("open", "short")
        )
        return without_fixture(impedance_from_reflection(reflection, self.REFERENCE_OHM), open_ohm, short_ohm)

    def measure_standard(self, standard: Standard) -> None:
        """Measure the standard that is connected."""
        self._standards.pop(standard, None)
        self._standards[standard] = self.scan_mean(self.SCANS_OF_A_STANDARD)

    def trigger(self) -> None:
        """Discard the last sweep; the scan itself is done by `wait_until_complete`."""
        self._measured = None

    def wait_until_complete(self) -> None:
        """Scan, and convert S11 to impedance."""
        self._measured = self.impedance_of(self.scan_mean(1))

    def read_impedance(self) -> ComplexArray:
        """Impedance in ohm of the last complete sweep."""
        if self._measured is None:
            raise InstrumentError(f"{self}: the sweep is not complete; there are no data yet")
        return self._measured

    def metadata(self) -> JsonDict:
        """Reference plane, and at how many points an S11 error of `GAMMA_ERROR` makes more than 10 % of the impedance."""
        magnitude = np.abs(self.read_impedance())
        error = self.GAMMA_ERROR * (magnitude + self.REFERENCE_OHM) ** 2 / (2 * self.REFERENCE_OHM * magnitude)
        return {
            "reference_plane": "fixture" if {"open", "short"} <= self._standards.keys() else "connector",
            "reference_ohm": self.REFERENCE_OHM,
            "points_beyond_10_percent": int(np.count_nonzero(error > 0.1)),
        }

    def refuse_outside(self, name: str, value: float, span: tuple[float, float], unit: str = "") -> None:
        """Raise `BadInput` for a value that the instrument cannot take."""
        if not span[0] <= value <= span[1]:
            raise BadInput(
                f"{self}: {name} = {show(value, unit) if unit else value} is outside the range "
                f"{show(span[0], unit) if unit else span[0]} to {show(span[1], unit) if unit else span[1]}"
            )


def pieces(start_hz: int, stop_hz: int, points: int, spacing: Spacing, most: int) -> list[tuple[int, int, int]]:
    """Linear scans, each with first and last frequency and number of points, that make up a sweep.

    Parameters
    ----------
    start_hz, stop_hz, points : int
        Of the whole sweep; both edges are measured.
    spacing : {"log", "linear"}
        Logarithmic sweeps change their step at each octave.
    most : int
        Largest number of points of one scan.
    """
    if spacing == "linear":
        axis = np.linspace(start_hz, stop_hz, points)
        knots = np.unique(np.append(np.arange(0, points - 1, most - 1), points - 1))
    else:
        axis = np.geomspace(start_hz, stop_hz, points)
        octaves = max(1, math.ceil(np.log2(stop_hz / start_hz)), -(-(points - 1) // (most - 1)))
        knots = np.unique(np.linspace(0, points - 1, min(octaves, points - 1) + 1).round().astype(int))
    edges = axis[knots].round().astype(int)
    made = []
    for index, (first, last) in enumerate(pairwise(edges)):
        count = int(knots[index + 1] - knots[index])
        if index == len(edges) - 2:
            made.append((int(first), int(last), count + 1))
        else:
            # A scan ends one step before the first point of the next one.
            made.append((int(first), round(last - (last - first) / count), count))
    return made


def impedance_from_reflection(gamma: ComplexArray, reference_ohm: float) -> ComplexArray:
    """Z = Z0 (1 + S11)/(1 - S11), in ohm."""
    # With nothing connected S11 may be exactly 1. Half of the ninth decimal, the last one that is printed, keeps the impedance finite.
    return reference_ohm * (1 + gamma) / np.where(gamma == 1, 5e-10, 1 - gamma)


def without_fixture(impedance: ComplexArray, open_ohm: ComplexArray | None, short_ohm: ComplexArray | None) -> ComplexArray:
    """Remove the fixture, a series impedance followed by a parallel admittance, by what was measured with it open and shorted."""
    series = short_ohm if short_ohm is not None else np.zeros_like(impedance)
    behind = impedance - series
    return behind if open_ohm is None else behind / (1 - behind / (open_ohm - series))


def calibrated(raw: ComplexArray, standards: Mapping[Standard, ComplexArray], known: Mapping[Standard, complex | ComplexArray]) -> ComplexArray:
    """Reflection coefficient at the plane where three known standards were measured.

    The three-term error model of one port (D. Rytting, Network Analyzer Error Models and Calibration Methods, one-port case): with
    directivity e00, match e11 and tracking e01, raw = e00 + e01 G/(1 - e11 G) for a reflection coefficient G. Multiplied out it is linear,
    raw = a + b G + c G raw with a = e00, b = e01 - e00 e11, c = e11, and three standards determine a, b, c at each frequency.

    Parameters
    ----------
    raw : ndarray of complex, shape (n,)
    standards : mapping
        Raw reflection of open, short and load, shape (n,) each.
    known : mapping
        Their true reflection coefficients, numbers or shape (n,).

    Raises
    ------
    InstrumentError
        If two of them have the same reflection, which means that a standard was not connected.
    """
    for one, other in combinations(known, 2):
        # The true reflections differ by 1 or 2. A working analyser shows more than a tenth of that, whatever its errors.
        if np.any(np.abs(standards[one] - standards[other]) < 0.02 * np.abs(known[one] - known[other])):
            raise InstrumentError(f"the {one} and the {other} standard read alike; was each of them connected? Compensate again")
    measured = np.stack([standards[name] for name in known], axis=1)
    true = np.stack([np.broadcast_to(known[name], raw.shape) for name in known], axis=1)
    matrix = np.stack([np.ones_like(measured), true, true * measured], axis=2)
    a, b, c = np.linalg.solve(matrix, measured[:, :, None])[:, :, 0].T
    return (raw - a) / (b + c * raw)
