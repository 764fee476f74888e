"""Base class of spectrum analysers that sweep with a limited number of points: partial sweeps, filter shapes, options, overload."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from math import ceil
from typing import ClassVar

import numpy as np

from motoremi.arrays import FloatArray, JsonDict
from motoremi.bench.driver import RefusedCommand, Setting, choice, number, switch
from motoremi.bench.receiver import EmiReceiver, ScanSettings
from motoremi.bench.transport import Transport
from motoremi.data.detectors import DBUV_OF_0_DBM
from motoremi.data.spectrum import Spectrum
from motoremi.errors import BadInput, InstrumentError
from motoremi.quantities import show

EMI_FILTER, GAUSS_FILTER = "6 dB EMI", "3 dB Gauss"
# Detectors that CISPR 16-1-1 defines for the 6 dB EMI filter only, with their time constants.
WEIGHTING = ("quasi-peak", "cispr-average", "rms-average")


def either(command: str, words: dict[str, tuple[str, ...]], doc: str) -> Setting[str]:
    """A setting with a few words, each of which an instrument may answer in several ways; the first one is sent."""
    back = {theirs: ours for ours, spellings in words.items() for theirs in spellings}
    return Setting(command, doc, lambda text: back[text.upper()], lambda ours: words[ours][0], words=dict.fromkeys(words, ""))


class SweptAnalyser(EmiReceiver):
    """A spectrum analyser as EMI receiver.

    A span that needs more points than one sweep has is measured in partial sweeps of equal width, each of which ends where the next one
    begins. The step is the requested one or less. The bandwidth selects the filter: the bandwidths of CISPR 16-1-1 have 6 dB EMI filters, an
    option of most analysers; all others are Gaussian with 3 dB and have no quasi-peak or other weighting detector.

    Attributes
    ----------
    name : str
        Name of the driver, for the metadata.
    points_possible : sequence of int
        Numbers of points of one sweep, in ascending order.
    points_command : str
        Command that sets the number of points; empty where it is fixed.
    emi_bandwidths_hz : tuple of float
        Bandwidths of the 6 dB EMI filter.
    emi_option : str
        Option that this filter and the weighting detectors need.
    mode_commands : tuple of str
        Commands that select swept mode, single sweeps, and traces as text.
    gains : tuple of str
        Settings in dB by which the instrument shifts levels; all are set to 0.
    trace_query : str
    overload_queries : tuple of str
        Queries of the registers that report an overload since `*CLS`; empty if the instrument has none.
    overload_bits : int
    """

    name: ClassVar[str]
    error_query = ":SYST:ERR?"
    safe_commands: ClassVar[tuple[str, ...]] = (":INIT:CONT OFF",)
    # Numbers go without unit: all of these instruments take them in Hz, s and dB.
    units_on_wire = False
    start_command = ":INIT"
    points_possible: ClassVar[Sequence[int]]
    points_command: ClassVar[str] = ""
    emi_bandwidths_hz: ClassVar[tuple[float, ...]] = (200.0, 9e3, 120e3, 1e6)
    emi_option: ClassVar[str]
    mode_commands: ClassVar[tuple[str, ...]]
    gains: ClassVar[tuple[str, ...]] = ("level_offset_db",)
    trace_query: ClassVar[str] = ":TRAC:DATA? TRACE1"
    overload_queries: ClassVar[tuple[str, ...]] = ()
    overload_bits: ClassVar[int] = 0
    # Much wider than the resolution filter: video filtering would lower pulses.
    VIDEO_BANDWIDTH_HZ: ClassVar[float] = 1e6

    start_hz = number(":FREQ:STAR", "Hz", (0.0, 50e9), "Control the first frequency of the sweep.")
    stop_hz = number(":FREQ:STOP", "Hz", (0.0, 50e9), "Control the last frequency of the sweep.")
    resolution_bandwidth_hz = number(":BWID", "Hz", (1.0, 10e6), "Control the resolution bandwidth.")
    video_bandwidth_hz = number(":BWID:VID", "Hz", (1.0, 50e6), "Control the video bandwidth.")
    sweep_time_s = number(":SWE:TIME", "s", (1e-6, 7.5e3), "Control the time of one sweep.")
    attenuation_db = number(":POW:ATT", "dB", (0.0, 70.0), "Control the input attenuation.")
    preamplifier = switch(":POW:GAIN", "Control the preamplifier.")
    # Levels are read in dBm, because some traces have that unit whatever unit the screen shows.
    level_unit = choice(":UNIT:POW", {"dBm": "DBM"}, "Control the unit of the levels.")
    # Corrections that the instrument applies itself must not be applied again to the levels that it sends.
    own_correction = switch(":CORR:CSET:ALL:STAT", "Control whether the instrument applies amplitude corrections by itself.")
    level_offset_db = number(":DISP:WINDOW:TRAC:Y:SCALE:RLEV:OFFS", "dB", (-300.0, 300.0), "Control the offset of the reference level.")
    filter_shape: Setting[str]
    detector: Setting[str]

    def __init__(self, transport: Transport) -> None:
        super().__init__(transport)
        self._parts = 1
        self._points, self._steps = 0, 1

    def set_up(self, asked: ScanSettings) -> JsonDict:
        """Set single sweeps up, without any correction of the instrument's own; see `ScanSettings`.

        Raises
        ------
        BadInput
            If the step does not fit the span, or the instrument has no such filter.
        """
        self.refuse_step(asked)
        intervals = ceil((asked.stop_hz - asked.start_hz) / asked.step_hz - 1e-9)
        self._parts = ceil(intervals / (self.points_possible[-1] - 1))
        self._steps = ceil(intervals / self._parts) + 1
        self._points = self.points_possible[bisect_left(self.points_possible, self._steps)]
        with self.transport.deadline(self.RESET_S):
            self.tell(*self.mode_commands)
        self._sweep_over(asked.start_hz, asked.stop_hz)
        self.own_correction = False
        for gain in self.gains:
            setattr(self, gain, 0.0)
        self.level_unit = "dBm"
        self._choose_filter(asked.resolution_bandwidth_hz)
        self.video_bandwidth_hz = self.VIDEO_BANDWIDTH_HZ
        self.attenuation_db = asked.attenuation_db
        self.preamplifier = False
        if self.points_command:
            self.tell(f"{self.points_command} {self._points}")
        # The dwell is that of each requested step. A sweep with more points takes the same time, so each frequency is in the filter as long.
        self.sweep_time_s = asked.dwell_s * self._steps
        return self.settings()

    def settings(self) -> JsonDict:
        """Settings as the instrument reports them, and the partial sweeps of the scan."""
        reported = super().settings()
        dwell_s = float(reported["sweep_time_s"]) / self._steps
        return {**reported, "dwell_s": dwell_s, "points": self._points, "partial_sweeps": self._parts}

    def scan(self, detector: str) -> Spectrum:
        """Scan once, in partial sweeps; an overload marks all points of its partial sweep, because the register does not show at which it occurred.

        Raises
        ------
        BadInput
            For a detector that the instrument, or its Gaussian filter, does not have.
        InstrumentError
            If a sweep does not end in time or has another number of points.
        """
        type(self).detector.checked(self, detector)
        if detector in WEIGHTING and self.filter_shape != EMI_FILTER:
            bandwidths = ", ".join(show(bandwidth, "Hz") for bandwidth in self.emi_bandwidths_hz)
            raise BadInput(f"{self}: {detector} needs the 6 dB EMI filter; ask for a bandwidth of {bandwidths}")
        with self._optional():
            self.detector = detector
        settings = self.settings()
        start_hz, stop_hz = settings["start_hz"], settings["stop_hz"]
        # Whole hertz, as the instruments take them.
        edges = np.round(np.linspace(start_hz, stop_hz, self._parts + 1))
        scanned = [self._scanned(low, high, float(settings["sweep_time_s"])) for low, high in pairwise(edges.tolist())]
        self._sweep_over(start_hz, stop_hz)
        frequency_hz, level_dbm, overload = (_joined([part[column] for part in scanned]) for column in range(3))
        metadata = {
            "receiver": self.name,
            "resource": self.transport.resource_name,
            "settings": settings,
            "overload_told": bool(self.overload_queries),
        }
        bandwidth_hz = float(settings["resolution_bandwidth_hz"])
        return Spectrum(detector, frequency_hz, level_dbm + DBUV_OF_0_DBM, bandwidth_hz, overload > 0, metadata)

    def _scanned(self, low_hz: float, high_hz: float, sweep_time_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Frequencies, levels in dBm and overload (0 or 1) of one partial sweep."""
        self._sweep_over(low_hz, high_hz)
        self.run_scan(10.0 + 3 * sweep_time_s)
        levels = self.read_levels()
        if levels.size != self._points:
            raise InstrumentError(f"{self}: received {levels.size} levels, but a sweep has {self._points}; was it stopped or set up by hand?")
        overload = any(int(float(self.ask(query))) & self.overload_bits for query in self.overload_queries)
        return np.linspace(low_hz, high_hz, self._points), levels, np.full(self._points, float(overload))

    def _sweep_over(self, low_hz: float, high_hz: float) -> None:
        # Partial sweeps go upwards, so the last frequency is set first: it must never lie below the first one.
        self.stop_hz = high_hz
        self.start_hz = low_hz

    def _choose_filter(self, bandwidth_hz: float) -> None:
        shape = EMI_FILTER if bandwidth_hz in self.emi_bandwidths_hz else GAUSS_FILTER
        with self._optional():
            self.filter_shape = shape
        self.resolution_bandwidth_hz = bandwidth_hz
        if (filter_hz := self.resolution_bandwidth_hz) != bandwidth_hz:
            raise BadInput(f"{self}: has no {shape} filter of {show(bandwidth_hz, 'Hz')}, the nearest is {show(filter_hz, 'Hz')}; ask for that one")

    @contextmanager
    def _optional(self) -> Iterator[None]:
        """Name the option that is needed if a command is refused."""
        try:
            yield
        except RefusedCommand as error:
            raise InstrumentError(f"{error}; the 6 dB EMI filter and quasi-peak need {self.emi_option}") from error

    def read_levels(self) -> FloatArray:
        """Levels of a trace, sent as text; some instruments put it into a block, and some end it with a comma."""
        with self.transport.deadline(self.transfer_s(self._points)):
            answer = self.ask(self.trace_query)
        try:
            text = answer[2 + int(answer[1]) :] if answer.startswith("#") else answer
            levels = np.array([float(field) for field in text.strip().rstrip(",").split(",")])
        except (ValueError, IndexError) as error:
            raise InstrumentError(f"{self}: {answer[:40]!r} in answer to {self.trace_query!r} is no list of levels") from error
        if not np.all(np.isfinite(levels)):
            raise InstrumentError(f"{self}: the answer to {self.trace_query!r} holds levels that are not finite")
        return levels


def _joined(parts: list[FloatArray]) -> FloatArray:
    """Partial sweeps as one array; of the two values where they meet, the higher one is kept."""
    joined = parts[0]
    for part in parts[1:]:
        joined = np.concatenate([joined[:-1], np.maximum(joined[-1:], part[:1]), part[1:]])
    return joined
