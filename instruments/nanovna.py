"""NanoVNA (H, H4 and others with the same shell), a pocket vector network analyser: impedance from S11."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import ClassVar

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.bench.analyser import ImpedanceAnalyser, Spacing, Standard
from motoremi.bench.driver import Setting
from motoremi.bench.shell import ShellDriver, sweep_edges
from motoremi.bench.transport import Transport
from motoremi.errors import BadInput, InstrumentError
from motoremi.quantities import show


class NanoVna(ShellDriver, ImpedanceAnalyser):
    """The NanoVNA by the shell of its firmware (DiSlord's, 1.0 and newer); sources: that firmware's `main.c`.

    **Reference plane.** The instrument's own open, short and load calibration puts it at the connector; `compensate` measures the
    fixture behind the connector and moves it to the fixture's terminals, computed here because the firmware has no fixture compensation.

    **Limits.** S11 tells impedances near 50 Ohm apart best. An error of S11 of `GAMMA_ERROR` is one of 1 % at 50 Ohm and of 10 % at
    1.3 Ohm and 1.9 kOhm; metadata say how many points of a sweep lie beyond. The level of the test signal cannot be set.

    Attributes
    ----------
    BANDWIDTHS : tuple of int
        Argument of `bandwidth` for bandwidth factor 1 (4 kHz) to 5 (30 Hz).
    """

    vendor = "NanoVNA"
    model = r"NanoVNA.*"
    analyser = "nanovna"
    safe_commands = ("resume",)

    start_hz, stop_hz = sweep_edges(50e3, 300e6)
    bandwidth_index = Setting(
        "bandwidth",
        "Control the receiver bandwidth: 4 kHz divided by the index plus one.",
        read=lambda text: int(text.split()[1]),
        write=str,
        span=(0, 511),
        query="bandwidth",
    )

    BANDWIDTHS: ClassVar[tuple[int, ...]] = (0, 3, 9, 39, 132)
    REFERENCE_OHM: ClassVar[float] = 50.0
    # Most points of one `scan`; all variants since the H have at least 101, and longer sweeps are done in pieces.
    SCAN_POINTS: ClassVar[int] = 101
    MOST_POINTS: ClassVar[int] = 1601
    # A tenth of what a careless calibration leaves: an estimate, not from a data sheet.
    GAMMA_ERROR: ClassVar[float] = 5e-3
    # Noise of a standard is in every sweep after it and does not show in their scatter: it has to be far below theirs.
    SCANS_OF_A_STANDARD: ClassVar[int] = 16
    # Mask of `scan`: frequencies; frequencies and S11.
    AXIS_ONLY: ClassVar[int] = 1
    AXIS_AND_S11: ClassVar[int] = 3

    def __init__(self, transport: Transport) -> None:
        super().__init__(transport)
        self._pieces: list[tuple[int, int, int]] = []
        self._spacing: Spacing = "log"
        self._measured: ComplexArray | None = None
        self._standards: dict[Standard, ComplexArray] = {}

    def configure(
        self,
        start_hz: float,
        stop_hz: float,
        points: int,
        spacing: Spacing = "log",
        bandwidth_factor: int = 3,
        oscillator_volt: float = 0.5,
    ) -> JsonDict:
        """Set the sweep up; see `ImpedanceAnalyser.configure`.

        The firmware sweeps linearly. A logarithmic sweep is done as one linear scan for each octave, so that its points are spaced
        nearly as asked for. `oscillator_volt` has no effect: the level cannot be set.
        """
        if not 2 <= points <= self.MOST_POINTS:
            raise BadInput(f"{self}: points = {points} is outside the range 2 to {self.MOST_POINTS}")
        if not 1 <= bandwidth_factor <= len(self.BANDWIDTHS):
            raise BadInput(f"{self}: bandwidth_factor = {bandwidth_factor} is outside the range 1 to {len(self.BANDWIDTHS)}")
        self._measured = None
        self.stop_hz = stop_hz
        self.start_hz = start_hz
        self.bandwidth_index = self.BANDWIDTHS[bandwidth_factor - 1]
        self._spacing = spacing
        self._pieces = pieces(round(start_hz), round(stop_hz), points, spacing, self.SCAN_POINTS)
        if "cal'ed" not in self.ask("cal").split():
            raise InstrumentError(
                f"{self}: is not calibrated; calibrate it at its connector (open, short, load on its screen) for "
                f"{show(start_hz, 'Hz')} to {show(stop_hz, 'Hz')}"
            )
        return self.settings()

    def settings(self) -> JsonDict:
        """What the instrument reports, and how the sweep is put together here."""
        return {
            **super().settings(),
            "points": sum(count for _, _, count in self._pieces),
            "spacing": self._spacing,
            "calibration": self.ask("cal"),
        }

    def metadata(self) -> JsonDict:
        """Reference plane, and how many points lie where S11 tells little."""
        magnitude = np.abs(self.read_impedance())
        error = self.GAMMA_ERROR * (magnitude + self.REFERENCE_OHM) ** 2 / (2 * self.REFERENCE_OHM * magnitude)
        return {
            "reference_plane": "fixture" if len(self._standards) == 2 else "connector",
            "reference_ohm": self.REFERENCE_OHM,
            "points_beyond_10_percent": int(np.count_nonzero(error > 0.1)),
        }

    def measure_standard(self, standard: Standard) -> None:
        """Measure the fixture with the standard that is connected."""
        self._standards.pop(standard, None)
        # The mean of S11, not of impedances: that of an open fixture is mostly noise.
        reflection = np.mean([self._reflection() for _ in range(self.SCANS_OF_A_STANDARD)], axis=0)
        self._standards[standard] = impedance_from_reflection(reflection, self.REFERENCE_OHM)

    def trigger(self) -> None:
        """Nothing to start: a scan answers when it is complete."""
        self._measured = None

    def wait_until_complete(self) -> None:
        """Scan, piece by piece, and take the fixture out."""
        at_connector = impedance_from_reflection(self._reflection(), self.REFERENCE_OHM)
        self._measured = without_fixture(at_connector, self._standards.get("open"), self._standards.get("short"))

    def read_axis(self) -> FloatArray:
        """Frequencies of the sweep in hertz, as the firmware rounds them."""
        rows = [self._rows(piece, self.AXIS_ONLY, 1) for piece in self._pieces]
        return np.concatenate([row[:, 0] for row in rows])

    def read_impedance(self) -> ComplexArray:
        """Impedance in ohm of the last complete sweep."""
        if self._measured is None:
            raise InstrumentError(f"{self}: the sweep is not complete; there are no data yet")
        return self._measured

    def _reflection(self) -> ComplexArray:
        """S11 of one sweep."""
        rows = np.concatenate([self._rows(piece, self.AXIS_AND_S11, 3) for piece in self._pieces])
        reflection: ComplexArray = rows[:, 1] + 1j * rows[:, 2]
        return reflection

    def _rows(self, piece: tuple[int, int, int], mask: int, columns: int) -> FloatArray:
        start, stop, points = piece
        # The slowest bandwidth takes a third of a second for a point.
        with self.transport.patience(10.0 + 0.5 * points):
            return self.ask_rows(f"scan {start} {stop} {points} {mask}", points, columns)


def pieces(start_hz: int, stop_hz: int, points: int, spacing: Spacing, most: int) -> list[tuple[int, int, int]]:
    """Linear scans, each with first and last frequency and number of points, that make up a sweep.

    Parameters
    ----------
    start_hz, stop_hz, points : int
        Of the whole sweep; both edges are measured.
    spacing : {"log", "linear"}
        Logarithmic sweeps change their step at each octave.
    most : int
        Most points of one scan.
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
            # The last point of a piece is the first one of the next.
            made.append((int(first), round(last - (last - first) / count), count))
    return made


def impedance_from_reflection(gamma: ComplexArray, reference_ohm: float) -> ComplexArray:
    """Z = Z0 (1 + S11)/(1 - S11), in ohm."""
    # Nothing connected may be read as exactly 1; half a step of the nine decimals that are printed keeps that finite.
    impedance: ComplexArray = reference_ohm * (1 + gamma) / np.where(gamma == 1, 5e-10, 1 - gamma)
    return impedance


def without_fixture(impedance: ComplexArray, open_ohm: ComplexArray | None, short_ohm: ComplexArray | None) -> ComplexArray:
    """Take out what was measured with the fixture open and shorted: a series impedance with an admittance behind it."""
    series = short_ohm if short_ohm is not None else np.zeros_like(impedance)
    behind = impedance - series
    result: ComplexArray = behind if open_ohm is None else behind / (1 - behind / (open_ohm - series))
    return result
