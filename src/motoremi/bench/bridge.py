"""Base class of impedance analysers with four-terminal-pair ports: adapters, averaging, bias, load standard, list sweeps."""

from __future__ import annotations

import abc
import math
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import ClassVar

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.bench.driver import Setting
from motoremi.bench.impedance_analyser import ImpedanceAnalyser, Standard
from motoremi.bench.sweep_options import Bias, Segment, SweepOptions
from motoremi.bench.transport import Transport
from motoremi.data.sweep import ImpedanceSweep
from motoremi.errors import InstrumentError
from motoremi.quantities import show

# Duration of one step of a ramp, and the largest number of steps.
RAMP_STEP_S, MOST_RAMP_STEPS = 0.1, 20


class BridgeAnalyser(ImpedanceAnalyser):
    """An analyser that has the settings declared here and sends R and X as two traces, each with a second value of 0 at every point.

    Parameters
    ----------
    transport : Transport
    poll_s : float
        Seconds between two readings of the event register.

    Notes
    -----
    The bias is on only while a sweep runs: it is raised in steps before the trigger and removed after the sweep, and the safe state begins by
    switching it off. Between sweeps, when the operator touches the motor, it is off.
    """

    COMPENSATES = frozenset({"open", "short", "load"})
    OPTIONS = frozenset({"adapter", "sweep_averages", "point_averages", "bias", "segments"})
    # Settings that change within a step. They are stored with the sweep or standard that they were changed for, not as settings of the run.
    TEMPORARY: ClassVar[frozenset[str]] = frozenset({"bias_on", "bias_volt", "bias_range", "bias_monitor", "load_ohm", "load_henry"})
    RESTART_AVERAGE: ClassVar[str]
    # Names of the traces of R and X.
    PARTS: ClassVar[tuple[str, str]]
    # Upper estimates of the seconds per point for measuring times 1 to 5; used for deadlines only.
    SECONDS_PER_POINT: ClassVar[tuple[float, ...]] = (0.003, 0.006, 0.012, 0.06, 0.2)

    points: Setting[int]
    spacing: Setting[str]
    bandwidth_factor: Setting[int]
    adapter: Setting[str]
    sweep_averaging: Setting[bool]
    sweep_averages: Setting[int]
    point_averaging: Setting[bool]
    point_averages: Setting[int]
    bias_on: Setting[bool]
    bias_volt: Setting[float]
    load_ohm: Setting[float]
    load_henry: Setting[float]

    def __init__(self, transport: Transport, poll_s: float = 0.1) -> None:
        super().__init__(transport)
        self.poll_s = poll_s
        self.complete = False
        self._load: JsonDict = {}
        self._bias: JsonDict = {}

    @abc.abstractmethod
    def enter_list(self, segments: tuple[Segment, ...]) -> None:
        """Enter the table of a list sweep."""

    @abc.abstractmethod
    def read_part(self, index: int) -> FloatArray:
        """The trace of R (0) or X (1) as the instrument sends it: two values for each point."""

    @abc.abstractmethod
    def begin(self, sweeps: int) -> None:
        """Start that many sweeps."""

    @abc.abstractmethod
    def end(self, sweeps: int) -> None:
        """Wait until that many sweeps are complete."""

    def limit_bias(self, bias: Bias) -> None:
        """Set the current limit of a bias, before it is switched on."""

    def check_bias(self, bias: Bias) -> JsonDict:
        """The bias as the instrument measured it during the sweep that has just ended."""
        return {}

    def settings(self) -> JsonDict:
        """Every setting of a sweep, as the instrument itself reports it, in SI units."""
        return {name: getattr(self, name) for name in self.table() if name not in self.TEMPORARY}

    def prepare(self, options: SweepOptions) -> JsonDict:
        """Set up adapter, averaging and list; see `ImpedanceAnalyser.prepare`."""
        super().prepare(options)
        self.complete = False
        self.adapter = options.adapter
        self.sweep_averages = options.sweep_averages
        self.sweep_averaging = options.sweep_averages > 1
        self.point_averages = options.point_averages
        self.point_averaging = options.point_averages > 1
        if options.segments:
            self.enter_list(options.segments)
            self.spacing = "list"
            self._refuse_other_list(options.segments)
        return self.settings()

    def define_load(self, ohm: float, henry: float) -> None:
        """Set the value of the load standard, and read it back."""
        self.load_ohm, self.load_henry = ohm, henry
        self._load = {"load_standard": {"ohm": self.load_ohm, "henry": self.load_henry}}

    def metadata(self) -> JsonDict:
        """The load standard that the compensation uses, and the bias of the sweep."""
        bias, self._bias = self._bias, {}
        return {**self._load, **bias}

    def trigger(self) -> None:
        """Start a single sweep, or as many as are averaged."""
        self.complete = False
        if self.options.sweep_averages > 1:
            self.tell(self.RESTART_AVERAGE)
        self.begin(self.options.sweep_averages)

    def wait_until_complete(self) -> None:
        """Wait for the end of the sweep."""
        self.end(self.options.sweep_averages)
        self.complete = True

    def read_impedance(self) -> ComplexArray:
        """Impedance in ohm of the last complete sweep."""
        if not self.complete:
            raise InstrumentError(f"{self}: the sweep is not complete; the traces still hold older data")
        parts = []
        for index, name in enumerate(self.PARTS):
            pairs = self.read_part(index)
            if pairs.size % 2:
                raise InstrumentError(f"{self}: {name} has {pairs.size} values, expected two for each point")
            parts.append(pairs[::2])
        if parts[0].size != parts[1].size:
            raise InstrumentError(f"{self}: {self.PARTS[0]} has {parts[0].size} points, {self.PARTS[1]} {parts[1].size}")
        # No motor has R = X at every frequency: the instrument did not follow the selection of the trace, or answered an earlier query.
        if np.array_equal(parts[0], parts[1]):
            raise InstrumentError(
                f"{self}: {self.PARTS[0]} and {self.PARTS[1]} are the same at every point, one trace was sent twice; measure again"
            )
        return parts[0] + 1j * parts[1]

    @contextmanager
    def stimulus(self) -> Iterator[None]:
        """Raise the bias, and remove it even if the sweep fails."""
        bias = self.options.bias
        if bias.volt == 0:
            yield
            return
        try:
            self._raise_bias(bias)
            applied = {"volt": self.bias_volt, "limit_a": bias.limit_a, "ramp_s": bias.ramp_s}
            yield
            self._bias = {"bias": {**applied, **self.check_bias(bias)}}
            self._ramp(bias.volt, 0.0, bias.ramp_s)
        except BaseException:
            # The first error is raised, not a second one from switching the bias off; the safe state switches it off again.
            with suppress(InstrumentError):
                self.bias_on = False
            raise
        self.bias_on = False

    def longest_s(self, sweeps: int = 1) -> float:
        """Deadline in seconds for a number of sweeps."""
        each_s = self.points * self.SECONDS_PER_POINT[self.bandwidth_factor - 1] * self.options.point_averages
        return 10.0 + 3 * sweeps * each_s

    def kept(self, standard: Standard, frequency_hz: FloatArray, impedance_ohm: ComplexArray) -> ImpedanceSweep:
        """What the instrument measured with a standard, as data to store."""
        metadata = {"analyser": self.analyser, "resource": self.transport.resource_name, "compensation": standard}
        return ImpedanceSweep("short" if standard == "short" else "open", frequency_hz, impedance_ohm, metadata=metadata)

    def _raise_bias(self, bias: Bias) -> None:
        try:
            self.limit_bias(bias)
            self.bias_volt = 0.0
            self.bias_on = True
            self._ramp(0.0, bias.volt, bias.ramp_s)
            # The 4294A checks the current when the bias is switched on. Whether it also does at each step of the ramp is not known.
            self.bias_on = True
        except InstrumentError as error:
            raise InstrumentError(
                f"{self}: a bias of {show(bias.volt, 'V')} could not be raised within {show(bias.limit_a, 'A')} (the motor may need more current: "
                f"lower the bias, or raise its limit): {error}"
            ) from error

    def _ramp(self, first: float, last: float, seconds: float) -> None:
        steps = max(1, min(MOST_RAMP_STEPS, math.ceil(seconds / RAMP_STEP_S)))
        for volt in np.linspace(first, last, steps + 1)[1:]:
            self.bias_volt = float(volt)
            self.transport.clock.sleep(seconds / steps)

    def _refuse_other_list(self, segments: tuple[Segment, ...]) -> None:
        asked = np.concatenate([np.linspace(one.start_hz, one.stop_hz, one.points) for one in segments])
        came = self.read_axis()
        if came.size != asked.size or not np.allclose(came, asked, rtol=1e-6, atol=0):
            raise InstrumentError(f"{self}: sweeps {came.size} points, which are not the {asked.size} points of the list that was entered")
