"""What the impedance analysers with four-terminal-pair ports share: adapters, averaging, a bias, a load standard, list sweeps."""

from __future__ import annotations

import abc
import math
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import ClassVar

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.bench.analyser import ImpedanceAnalyser, Standard
from motoremi.bench.driver import Setting
from motoremi.bench.sweep_options import Bias, Segment, SweepOptions
from motoremi.bench.transport import Transport
from motoremi.data.sweep import ImpedanceSweep
from motoremi.errors import InstrumentError
from motoremi.quantities import show

# A ramp goes in steps of this time, but in no more than so many.
RAMP_STEP_S, MOST_RAMP_STEPS = 0.1, 20


class BridgeAnalyser(ImpedanceAnalyser):
    """An analyser whose table has the rows named here, and whose traces are R and X, each point with a second value that is 0.

    Parameters
    ----------
    transport : Transport
    poll_s : float
        Seconds between two looks at the event register.

    Notes
    -----
    The bias is on only while a sweep runs: raised in steps before the trigger, taken away after it, and switched off first of all in the
    safe state. Between sweeps, when the operator touches the motor, there is none.
    """

    COMPENSATES = frozenset({"open", "short", "load"})
    OPTIONS = frozenset({"adapter", "sweep_averages", "point_averages", "bias", "segments"})
    # Rows of the table that a step changes by itself; they are told with what they were changed for.
    PASSING: ClassVar[frozenset[str]] = frozenset({"bias_on", "bias_volt", "bias_range", "bias_monitor", "load_ohm", "load_henry"})
    RESTART_AVERAGE: ClassVar[str]
    # What the instrument calls the traces of R and X.
    PARTS: ClassVar[tuple[str, str]]
    # Generous seconds per point for measuring time 1 to 5; only deadlines depend on them.
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
        self._complete = False
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
        """Have the instrument keep to the largest current of a bias, before it is switched on."""

    def check_bias(self, bias: Bias) -> JsonDict:
        """What the instrument says of the bias during the sweep that has just ended."""
        return {}

    def settings(self) -> JsonDict:
        """Every setting of a sweep, as the instrument itself reports it, in SI units."""
        return {name: getattr(self, name) for name in self.table() if name not in self.PASSING}

    def prepare(self, options: SweepOptions) -> JsonDict:
        """Set up adapter, averaging and list; see `ImpedanceAnalyser.prepare`."""
        super().prepare(options)
        self._complete = False
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
        """Tell the analyser what the load standard is."""
        self.load_ohm, self.load_henry = ohm, henry
        self._load = {"load_standard": {"ohm": self.load_ohm, "henry": self.load_henry}}

    def metadata(self) -> JsonDict:
        """The load standard that the compensation rests on, and the bias of the sweep."""
        bias, self._bias = self._bias, {}
        return {**self._load, **bias}

    def trigger(self) -> None:
        """Start a single sweep, or as many as are averaged."""
        self._complete = False
        if self.options.sweep_averages > 1:
            self.tell(self.RESTART_AVERAGE)
        self.begin(self.options.sweep_averages)

    def wait_until_complete(self) -> None:
        """Wait for the end of the sweep."""
        self.end(self.options.sweep_averages)
        self._complete = True

    def read_impedance(self) -> ComplexArray:
        """Impedance in ohm of the last complete sweep."""
        if not self._complete:
            raise InstrumentError(f"{self}: the sweep is not complete; the traces still hold older data")
        parts = []
        for index, name in enumerate(self.PARTS):
            pairs = self.read_part(index)
            if pairs.size % 2:
                raise InstrumentError(f"{self}: {name} has {pairs.size} values, expected two for each point")
            parts.append(pairs[::2])
        if parts[0].size != parts[1].size:
            raise InstrumentError(f"{self}: {self.PARTS[0]} has {parts[0].size} points, {self.PARTS[1]} {parts[1].size}")
        impedance: ComplexArray = parts[0] + 1j * parts[1]
        return impedance

    @contextmanager
    def stimulus(self) -> Iterator[None]:
        """Raise the bias, and take it away however the sweep ends."""
        bias = self.options.bias
        if bias.volt == 0:
            yield
            return
        try:
            self._raise_bias(bias)
            told = {"volt": self.bias_volt, "limit_a": bias.limit_a, "ramp_s": bias.ramp_s}
            yield
            self._bias = {"bias": {**told, **self.check_bias(bias)}}
            self._ramp(bias.volt, 0.0, bias.ramp_s)
        except BaseException:
            # What went wrong is told, not what that did to switching the bias off; the safe state does it once more.
            with suppress(InstrumentError):
                self.bias_on = False
            raise
        self.bias_on = False

    def longest_s(self, sweeps: int = 1) -> float:
        """The deadline for so many sweeps."""
        each_s = self.points * self.SECONDS_PER_POINT[self.bandwidth_factor - 1] * self.options.point_averages
        return 10.0 + 3 * sweeps * each_s

    def kept(self, standard: Standard, frequency_hz: FloatArray, impedance_ohm: ComplexArray) -> ImpedanceSweep:
        """What the instrument holds of a standard, as data to store."""
        metadata = {"analyser": self.analyser, "resource": self.transport.resource_name, "compensation": standard}
        return ImpedanceSweep("short" if standard == "short" else "open", frequency_hz, impedance_ohm, metadata=metadata)

    def _raise_bias(self, bias: Bias) -> None:
        try:
            self.limit_bias(bias)
            self.bias_volt = 0.0
            self.bias_on = True
            self._ramp(0.0, bias.volt, bias.ramp_s)
            # The 4294A is known to look at the current when the bias is switched on; whether it does so at each step is not.
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
            raise InstrumentError(f"{self}: sweeps {came.size} points that are not the {asked.size} of the list that was entered")
