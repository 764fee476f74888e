"""tinySA, a handheld spectrum analyser: a first look at conducted emission, no compliance measurement."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from motoremi.arrays import FloatArray, JsonDict
from motoremi.bench.driver import Setting
from motoremi.bench.receiver import EmiReceiver, ScanSettings
from motoremi.bench.shell import ShellDriver, sweep_edges
from motoremi.bench.transport import Transport
from motoremi.data.spectrum import Spectrum
from motoremi.errors import BadInput, InstrumentError
from motoremi.quantities import show


def _below_usage(text: str) -> float:
    """The present value: a command without arguments prints its usage, and the value with its unit on the next line."""
    return float(text.splitlines()[1].strip().rstrip("Hzs"))


class TinySa(ShellDriver, EmiReceiver):
    """The tinySA by the shell of its firmware (1.4 and newer); source: that firmware's `main.c` and `sa_cmd.c`.

    **Limits.** No quasi-peak or average detector of CISPR, no 6 dB filter of 9 kHz (10 kHz is the nearest), no preselector: strong
    pulses of a motor overdrive the mixer, and the instrument does not report that. Put a transient limiter and a 10 dB attenuator behind the
    LISN, and check a level by adding another 10 dB: it must not change.
    """

    vendor = "tinySA"
    model = r"tinySA.*"
    USUAL_BANDWIDTH_HZ = 10e3
    safe_commands = ("resume",)

    start_hz, stop_hz = sweep_edges(100e3, 350e6)
    resolution_bandwidth_hz = Setting(
        "rbw",
        "Control the resolution bandwidth; the nearest filter is used.",
        read=_below_usage,
        write=lambda value: f"{value / 1e3:g}",
        unit="Hz",
        span=(2e3, 600e3),
        query="rbw",
    )
    attenuation_db = Setting(
        "attenuate",
        "Control the input attenuation.",
        read=_below_usage,
        write=lambda value: str(round(value)),
        unit="dB",
        span=(0.0, 31.0),
        query="attenuate",
    )

    DBUV_OF_0_DBM: ClassVar[float] = 106.98970004336019
    # Largest number of points of one `scan` on the smaller of the two models.
    SCAN_POINTS: ClassVar[int] = 290
    # Longest `sweeptime`.
    LONGEST_SCAN_S: ClassVar[float] = 60.0
    # Mask of `scan`: frequencies and the measured trace.
    AXIS_AND_LEVEL: ClassVar[int] = 3

    def __init__(self, transport: Transport) -> None:
        super().__init__(transport)
        self._step_hz = 0
        self._dwell_s = 0.0

    def set_up(self, asked: ScanSettings) -> JsonDict:
        """Set the scan up; see `ScanSettings`.

        Raises
        ------
        BadInput
            If the instrument has no such filter, or the dwell is too long for it.
        """
        self.refuse_step(asked, lowest_hz=1.0)
        if not 0 < asked.dwell_s <= self.LONGEST_SCAN_S / self.SCAN_POINTS:
            raise BadInput(
                f"{self}: dwell_s = {show(asked.dwell_s, 's')} is outside the range 0 s to {show(self.LONGEST_SCAN_S / self.SCAN_POINTS, 's')}"
            )
        self.stop_hz = asked.stop_hz
        self.start_hz = asked.start_hz
        self._step_hz = round(asked.step_hz)
        self._dwell_s = asked.dwell_s
        self.resolution_bandwidth_hz = asked.resolution_bandwidth_hz
        if (filter_hz := self.resolution_bandwidth_hz) != asked.resolution_bandwidth_hz:
            raise BadInput(
                f"{self}: has no filter of {show(asked.resolution_bandwidth_hz, 'Hz')}, the nearest is {show(filter_hz, 'Hz')}; ask for that one"
            )
        self.attenuation_db = asked.attenuation_db
        self.tell("calc 1 off")
        return self.settings()

    def settings(self) -> JsonDict:
        """Settings as the instrument reports them, and step and dwell of the scan, which is made of several instrument scans."""
        return {**super().settings(), "step_hz": float(self._step_hz), "dwell_s": self._dwell_s, "own_correction": False}

    def scan(self, detector: str) -> Spectrum:
        """Scan once, in several instrument scans.

        Raises
        ------
        BadInput
            For any detector but "peak".
        InstrumentError
            If the data are not a scan of the requested frequencies.
        """
        if detector != "peak":
            raise BadInput(f"{self}: has no {detector} detector of CISPR 16-1-1; use peak")
        # The instrument subtracts the gain of an external amplifier, which its shell can set but not read.
        self.tell("ext_gain 0")
        settings = self.settings()
        axis = np.arange(settings["start_hz"], settings["stop_hz"] + 0.5, self._step_hz)
        rows = np.concatenate([self._scanned(axis[first : first + self.SCAN_POINTS]) for first in range(0, axis.size, self.SCAN_POINTS)])
        if not np.allclose(rows[:, 0], axis, rtol=0, atol=1.0):
            raise InstrumentError(f"{self}: measured other frequencies than asked for")
        metadata = {"receiver": "tinysa", "resource": self.transport.resource_name, "settings": settings, "compliance": False}
        return Spectrum(detector, axis, rows[:, 1] + self.DBUV_OF_0_DBM, float(settings["resolution_bandwidth_hz"]), None, metadata)

    def _scanned(self, axis: FloatArray) -> FloatArray:
        duration_s = max(0.003, self._dwell_s * axis.size)
        self.tell(f"sweeptime {duration_s:g}")
        with self.transport.deadline(10.0 + 3 * duration_s):
            # Frequency, level in dBm, and a third column that holds nothing.
            return self.ask_rows(f"scan {axis[0]:.0f} {axis[-1]:.0f} {axis.size} {self.AXIS_AND_LEVEL}", axis.size, 3)
