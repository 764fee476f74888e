"""NanoVNA (H, H4 and others with the same shell), a handheld vector network analyser: impedance from S11."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.bench.driver import Setting
from motoremi.bench.impedance_analyser import Spacing, SweepSettings
from motoremi.bench.reflection import ReflectionAnalyser, pieces
from motoremi.bench.shell import ShellDriver, sweep_edges
from motoremi.bench.transport import Transport
from motoremi.errors import InstrumentError
from motoremi.quantities import show


class NanoVna(ShellDriver, ReflectionAnalyser):
    """The NanoVNA by the shell of its firmware (DiSlord's, 1.0 and newer); sources: that firmware's `main.c`.

    **Reference plane.** The instrument's own calibration with open, short and load puts it at the connector; `compensate` measures the
    fixture behind the connector and moves the plane to the fixture's terminals, by computation here because the firmware cannot do it.

    **Limits.** S11 is most sensitive to impedances near 50 Ohm. An S11 error of `GAMMA_ERROR` is 1 % of the impedance at 50 Ohm and 10 % at
    1.3 Ohm and 1.9 kOhm; the metadata count the points of a sweep beyond. The level of the test signal cannot be set.

    Attributes
    ----------
    BANDWIDTHS : tuple of int
        Argument of `bandwidth` for bandwidth factor 1 (4 kHz) to 5 (30 Hz).
    """

    vendor = "NanoVNA"
    model = r"NanoVNA.*"
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
    # Largest number of points of one `scan` that all variants since the H can measure; longer sweeps are done in several scans.
    SCAN_POINTS: ClassVar[int] = 101
    MOST_POINTS: ClassVar[int] = 1601
    # Mask of `scan`: frequencies; frequencies and S11.
    AXIS_ONLY: ClassVar[int] = 1
    AXIS_AND_S11: ClassVar[int] = 3

    def __init__(self, transport: Transport) -> None:
        super().__init__(transport)
        self._pieces: list[tuple[int, int, int]] = []
        self._spacing: Spacing = "log"

    def set_up(self, asked: SweepSettings) -> JsonDict:
        """Set the sweep up; see `SweepSettings`.

        The firmware sweeps linearly. A logarithmic sweep is done as one linear scan for each octave, so its points are spaced nearly as
        requested. `oscillator_volt` has no effect: the level cannot be set.
        """
        self.refuse_outside("points", asked.points, (2, self.MOST_POINTS))
        self.refuse_outside("bandwidth_factor", asked.bandwidth_factor, (1, len(self.BANDWIDTHS)))
        self._measured = None
        self.stop_hz = asked.stop_hz
        self.start_hz = asked.start_hz
        self.bandwidth_index = self.BANDWIDTHS[asked.bandwidth_factor - 1]
        self._spacing = asked.spacing
        self._pieces = pieces(round(asked.start_hz), round(asked.stop_hz), asked.points, asked.spacing, self.SCAN_POINTS)
        if "cal'ed" not in self.ask("cal").split():
            raise InstrumentError(
                f"{self}: is not calibrated; calibrate it at its connector (open, short, load on its screen) for "
                f"{show(asked.start_hz, 'Hz')} to {show(asked.stop_hz, 'Hz')}"
            )
        return self.settings()

    def settings(self) -> JsonDict:
        """Settings as the instrument reports them, and points and spacing of the sweep, which is made of several scans."""
        return {
            **super().settings(),
            "points": sum(count for _, _, count in self._pieces),
            "spacing": self._spacing,
            "calibration": self.ask("cal"),
        }

    def read_axis(self) -> FloatArray:
        """Frequencies of the sweep in hertz, as the firmware rounds them."""
        rows = [self.rows(piece, self.AXIS_ONLY, 1) for piece in self._pieces]
        return np.concatenate([row[:, 0] for row in rows])

    def scan(self) -> ComplexArray:
        """S11 of one sweep."""
        rows = np.concatenate([self.rows(piece, self.AXIS_AND_S11, 3) for piece in self._pieces])
        return rows[:, 1] + 1j * rows[:, 2]

    def rows(self, piece: tuple[int, int, int], mask: int, columns: int) -> FloatArray:
        """The lines of numbers that the shell prints of one piece of the sweep; the first number of each is its frequency.

        Raises
        ------
        InstrumentError
            If they are no numbers, or of other frequencies than asked for.
        """
        start, stop, points = piece
        # The slowest bandwidth takes a third of a second for a point.
        with self.transport.deadline(10.0 + 0.5 * points):
            rows = self.ask_rows(f"scan {start} {stop} {points} {mask}", points, columns)
        # The firmware rounds to whole hertz.
        if not np.allclose(rows[:, 0], np.linspace(start, stop, points), rtol=0, atol=1.0):
            raise InstrumentError(f"{self}: measured other frequencies than asked for; do not touch it during a sweep, and start it anew")
        return rows
