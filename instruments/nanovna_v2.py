"""NanoVNA V2 (S-A-A-2, V2 Plus, Plus4) and LiteVNA: impedance from S11, calibrated by the computer."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.bench.impedance_analyser import Spacing, Standard, SweepSettings
from motoremi.bench.reflection import ReflectionAnalyser, calibrated, impedance_from_reflection, pieces
from motoremi.bench.registers import RegisterDriver, register
from motoremi.bench.transport import Transport
from motoremi.data.quantity import REFLECTION
from motoremi.errors import InstrumentError


class NanoVnaV2(RegisterDriver, ReflectionAnalyser):
    """The NanoVNA V2 by its registers; source: `main2.cpp` and `command_parser.hpp` of its firmware (1.3).

    **Calibration.** The data are raw, even if the instrument was calibrated on its screen. `compensate` therefore needs open, short and load,
    at the place where the motor will be connected; a sweep without all three is refused. A LiteVNA can send calibrated data (3 in register
    0x26); this driver always uses 0.

    **Limits.** Those of `NanoVna`. The level cannot be set, and the bandwidth is fixed: bandwidth factors are numbers of sweeps.

    Attributes
    ----------
    SWEEPS : tuple of int
        How many sweeps are averaged for bandwidth factor 1 to 5.
    SETTLING_SWEEPS : int
        Number of sweeps that are discarded after a change of frequencies, in which the firmware measures its internal reference (`ecalState`).
    """

    model = r"(NanoVNA V2|LiteVNA).*"
    # Register 0x26: 0 sends raw data, 2 returns to sweeping for the screen.
    safe_commands = ("write1 0x26 2",)
    COMPENSATES: ClassVar[frozenset[Standard]] = frozenset({"open", "short", "load"})
    REQUIRED = COMPENSATES

    first_hz = register(0x00, 8, (50e3, 300e6), "Control the first frequency of a scan.", "Hz")
    step_hz = register(0x10, 8, (1, 300e6), "Control the step of a scan.", "Hz")
    scan_points = register(0x20, 2, (1, 255), "Control the number of points of a scan.")
    values_per_frequency = register(0x22, 2, (1, 255), "Control how many values are sent for each frequency.")
    data_mode = register(0x26, 1, (0, 3), "Control what the queue holds: 0 is raw data.")

    SPAN_HZ: ClassVar[tuple[float, float]] = (50e3, 300e6)
    SWEEPS: ClassVar[tuple[int, ...]] = (1, 2, 3, 5, 8)
    SETTLING_SWEEPS: ClassVar[int] = 2
    # Largest number of values that one command reads from the queue.
    MOST_VALUES: ClassVar[int] = 255
    MOST_POINTS: ClassVar[int] = 1601
    # Waves leaving port 1, reflected at port 1 and arriving at port 2; number of the point; the last byte is a checksum in new firmware.
    RECORD: ClassVar[np.dtype[np.void]] = np.dtype([("waves", "<i4", (3, 2)), ("point", "<u2"), ("reserved", "V6")])

    def __init__(self, transport: Transport) -> None:
        super().__init__(transport)
        self._pieces: list[tuple[int, int, int]] = []
        self._spacing: Spacing = "log"
        self._sweeps = 1
        self._load_ohm_henry = (self.REFERENCE_OHM, 0.0)

    def set_up(self, asked: SweepSettings) -> JsonDict:
        """Set the sweep up; see `SweepSettings`.

        The firmware sweeps linearly with a step in whole hertz. A logarithmic sweep is one scan for each octave; the last frequency may
        be up to 254 Hz below the requested one. `oscillator_volt` has no effect.
        """
        self.refuse_outside("start_hz", asked.start_hz, self.SPAN_HZ, "Hz")
        self.refuse_outside("stop_hz", asked.stop_hz, self.SPAN_HZ, "Hz")
        self.refuse_outside("points", asked.points, (2, self.MOST_POINTS))
        self.refuse_outside("bandwidth_factor", asked.bandwidth_factor, (1, len(self.SWEEPS)))
        self._measured = None
        self._sweeps, self._spacing = self.SWEEPS[asked.bandwidth_factor - 1], asked.spacing
        self._pieces = [
            (first, max(1, (last - first) // max(1, count - 1)), count)
            for first, last, count in pieces(round(asked.start_hz), round(asked.stop_hz), asked.points, asked.spacing, self.MOST_VALUES)
        ]
        self.data_mode = 0
        self.values_per_frequency = 1
        return self.settings()

    def settings(self) -> JsonDict:
        """Settings as the instrument reports them, and the sweep, which is made of several scans."""
        reported: JsonDict = {"data_mode": self.data_mode, "values_per_frequency": self.values_per_frequency}
        if not self._pieces:
            return reported
        axis = self.read_axis()
        sweep = {"start_hz": float(axis[0]), "stop_hz": float(axis[-1]), "points": axis.size, "spacing": self._spacing}
        return {**sweep, "sweeps_averaged": self._sweeps, **reported}

    def trigger(self) -> None:
        """Refuse a sweep if a standard is missing."""
        super().trigger()
        if missing := sorted(self.REQUIRED - self._standards.keys()):
            raise InstrumentError(f"{self}: sends raw data; compensate with open, short and load before a sweep (missing: {', '.join(missing)})")

    def define_load(self, ohm: float, henry: float) -> None:
        """Set the value of the load standard: a resistance with an inductance in series."""
        self._load_ohm_henry = (ohm, henry)

    def impedance_of(self, reflection: ComplexArray) -> ComplexArray:
        """Impedance in ohm, with the errors of analyser and fixture removed by the three standards."""
        ohm, henry = self._load_ohm_henry
        load = REFLECTION.coefficient_of((ohm + 2j * np.pi * self.read_axis() * henry).astype(np.complex128))
        known: dict[Standard, complex | ComplexArray] = {"open": 1.0, "short": -1.0, "load": load}
        try:
            gamma = calibrated(reflection, self._standards, known)
        except InstrumentError as error:
            raise InstrumentError(f"{self}: {error}") from error
        return impedance_from_reflection(gamma, self.REFERENCE_OHM)

    def read_axis(self) -> FloatArray:
        """Frequencies of the sweep in hertz, as the registers hold them."""
        return np.concatenate([first + step * np.arange(float(count)) for first, step, count in self._pieces])

    def scan(self) -> ComplexArray:
        """Raw S11 of one sweep."""
        return self.scan_mean(1)

    def scan_mean(self, scans: int) -> ComplexArray:
        """Mean of raw S11 over a number of sweeps, scan by scan."""
        return np.concatenate([self._scanned(piece, scans * self._sweeps) for piece in self._pieces])

    def _scanned(self, piece: tuple[int, int, int], sweeps: int) -> ComplexArray:
        self.first_hz, self.step_hz, self.scan_points = piece
        self.tell("write1 0x30 0")
        points, wanted = piece[2], self.SETTLING_SWEEPS + sweeps
        at_once = self.MOST_VALUES // points
        raw = np.concatenate([self._read_queue(points, min(at_once, wanted - done)) for done in range(0, wanted, at_once)])
        # Read after the data, because an instrument that has restarted meanwhile has measured other frequencies.
        if (held := (self.first_hz, self.step_hz, self.scan_points)) != piece:
            raise InstrumentError(f"{self}: start, step and points were set to {piece}, but the registers hold {held}; did it restart?")
        return np.mean(raw[self.SETTLING_SWEEPS :], axis=0)

    def _read_queue(self, points: int, sweeps: int) -> ComplexArray:
        """Raw S11 of several sweeps, shape (sweeps, points)."""
        values = points * sweeps
        # About 100 values a second; slower below 1 MHz.
        with self.transport.deadline(10.0 + 0.1 * values):
            records = np.frombuffer(self.ask_bytes(f"fifo 0x30 {values}", values * self.RECORD.itemsize), self.RECORD)
        # The instrument sweeps continuously, so the first value may be that of any point.
        first = int(records["point"][0])
        forward, back, _ = (records["waves"].astype(np.float64) @ np.array([1.0, 1j])).T
        if not np.array_equal(records["point"], (first + np.arange(values)) % points) or not forward.all():
            raise InstrumentError(f"{self}: a scan of {points} points is incomplete; values were lost on the link, measure again")
        return np.roll((back / forward).reshape(sweeps, points), first, axis=1)
