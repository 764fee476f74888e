"""Base class of the simulated impedance analysers: sweeps, triggering, and compensation of a fixture."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import ClassVar

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.bench.sweep_options import Segment
from motoremi.virtual.simulated_device import SimulatedDevice

SWEEP_OVERHEAD_S = 0.04
OVERFLOW_OHM = 9.9e37
# A typical fixture: 30 mOhm and 15 nH in series, 4 pF and 10 nS in parallel. Compensation has to remove them.
FIXTURE_OHM, FIXTURE_HENRY, FIXTURE_FARAD, FIXTURE_SIEMENS = 0.03, 15e-9, 4e-12, 1e-8
# Frequency at which the conductance gives the direct current through a device: low enough that capacitors conduct next to nothing.
NEARLY_DIRECT_HZ = 40.0


class SimulatedBridge(SimulatedDevice):
    """An analyser with a fixture, connected to a test stand.

    The profile names its settings `start`, `stop`, `points`, `spacing` (LIN, LOG or the word for a list), `bandwidth_factor`,
    `point_averaging`, `point_averages`, `sweep_averaging`, `sweep_averages`, `bias`, `bias_volt`, and the values of its standards
    `open_siemens`, `open_farad`, `short_ohm`, `short_henry`, `load_ohm`, `load_henry`.
    """

    # Value of `spacing` for a list sweep.
    LIST: ClassVar[str]

    # Estimates of the right order of magnitude; makers give no figures.
    SECONDS_PER_POINT: ClassVar[tuple[float, ...]] = (0.003, 0.006, 0.012, 0.06, 0.2)

    def power_on(self) -> None:
        """Sweeping continuously, nothing compensated."""
        super().power_on()
        self._ends_s: float | None = None
        self._measured: ComplexArray | None = None
        self._measured_with: tuple[float, ...] = ()
        self._measured_until_s = 0.0
        self._continuous = True
        self._segments: tuple[Segment, ...] = ()
        # Number of sweeps in the average.
        self._averaged = 0
        self._standards: dict[str, ComplexArray] = {}
        self._standard_axes: dict[str, FloatArray] = {}
        self._enabled = {"open": False, "short": False, "load": False}

    def busy_until(self) -> float:
        """When the running sweep or compensation ends."""
        return self.clock.now() if self._ends_s is None else self._ends_s

    def axis(self) -> FloatArray:
        """Frequencies of the sweep in hertz."""
        if self.value("spacing") == self.LIST:
            return np.concatenate([np.linspace(one.start_hz, one.stop_hz, one.points) for one in self._segments])
        spaced = np.geomspace if self.value("spacing") == "LOG" else np.linspace
        return spaced(self.value("start"), self.value("stop"), self.value("points"))

    def duration_s(self) -> float:
        """How long a sweep takes."""
        per_point_s = self.SECONDS_PER_POINT[int(self.value("bandwidth_factor")) - 1] * self._point_averages()
        return SWEEP_OVERHEAD_S + self.axis().size * per_point_s

    def begin(self, sweeps: int = 1) -> None:
        """Start a measurement that takes as long as that many sweeps."""
        self._ends_s = self.clock.now() + sweeps * self.duration_s()

    def ended(self) -> None:
        """Called once when it has ended."""

    def sweep(self, sweeps: int = 1) -> None:
        """Start one sweep or several; each counts for the average of sweeps."""
        self._continuous = False
        self._averaged += sweeps
        self._measure()
        self.begin(sweeps)

    def restart_average(self) -> None:
        """Restart the average of sweeps."""
        self._averaged = 0

    def bias_current_a(self) -> float:
        """Direct current through what is connected."""
        if self.value("bias") != "1" or not self.value("bias_volt"):
            return 0.0
        connected_ohm = complex(self.wiring.connected_ohm(np.array([NEARLY_DIRECT_HZ]))[0])
        conductance = (1 / connected_ohm).real if connected_ohm else np.inf
        return float(self.value("bias_volt")) * conductance

    def sweeps_continuously(self) -> bool:
        """Whether one sweep follows the other."""
        return self._continuous

    def set_continuous(self, on: bool) -> None:
        """Sweep continuously, or hold."""
        self._continuous = on
        if not on:
            self._ends_s = None

    def impedance_ohm(self) -> ComplexArray:
        """Data of the last sweep; if the analyser sweeps continuously, of a sweep with the present settings."""
        old = self.clock.now() - self._measured_until_s > self.duration_s()
        if self.sweeps_continuously() and (self._measured is None or self._measured_with != self._sweep_settings() or old):
            self._measure()
        return np.zeros(self.axis().size, dtype=np.complex128) if self._measured is None else self._measured

    def measure_standard(self, standard: str) -> None:
        """Measure a standard, and switch its compensation on."""
        self.keep_standard(standard, self._raw(self._point_averages()))
        self._enabled[standard] = True
        self.begin()

    def keep_standard(self, standard: str, raw_ohm: ComplexArray) -> None:
        """Store the uncorrected measurement of a standard, at the frequencies of the sweep."""
        self._standards[standard] = raw_ohm
        self._standard_axes[standard] = self.axis()

    def kept_standard(self, standard: str) -> tuple[FloatArray, ComplexArray] | None:
        """Frequencies in hertz and the uncorrected measurement of a standard, in ohm; None if it was not measured."""
        return (self._standard_axes[standard], self._standards[standard]) if standard in self._standards else None

    def is_enabled(self, standard: str) -> bool:
        """Whether this compensation is on."""
        return self._enabled[standard]

    def enable(self, standard: str, argument: str) -> None:
        """Switch a compensation on or off; an error if the standard was never measured."""
        on = argument.upper() in ("ON", "1")
        if on and standard not in self._standards:
            self.note_error("no_compensation")
            return
        self._enabled[standard] = on

    def assign(self, name: str, argument: str) -> None:
        """Set a setting; start above stop moves the other one too, and a list sweep needs a list."""
        if name == "spacing" and self.fold_word(argument) == self.LIST and not self._segments:
            self.note_error("no_list")
            return
        super().assign(name, argument)
        if name in ("start", "stop") and self.value("start") > self.value("stop"):
            self.set_value("stop" if name == "start" else "start", float(self.value(name)))

    def take_list(self, segments: Sequence[Segment]) -> None:
        """Set the list of segments; an error if it is empty, too long or not ascending."""
        edges = [hertz for one in segments for hertz in (one.start_hz, one.stop_hz)]
        ascending = all(first < last for first, last in pairwise(edges))
        fits = all(one.points >= 2 for one in segments) and sum(one.points for one in segments) <= self.limits("points")[1]
        if not (segments and ascending and fits and edges[0] >= self.limits("start")[0] and edges[-1] <= self.limits("stop")[1]):
            self.note_error("execution_error")
            return
        self._segments = tuple(segments)

    def _settle(self) -> None:
        if self._ends_s is not None and self.clock.now() >= self._ends_s:
            self._ends_s = None
            self.ended()
        super()._settle()

    def _reset(self, argument: str) -> None:
        super()._reset(argument)
        self.set_continuous(True)
        self._ends_s = None
        self._enabled = dict.fromkeys(self._enabled, False)
        self._segments = ()
        self._averaged = 0

    def _sweep_settings(self) -> tuple[float, ...]:
        return (*self.axis(), self.value("bandwidth_factor"))

    def _point_averages(self) -> int:
        return int(self.value("point_averages")) if self.value("point_averaging") == "1" else 1

    def _averages(self) -> int:
        """Number of readings that are averaged at each point."""
        if self.value("sweep_averaging") != "1":
            return self._point_averages()
        most = int(self.value("sweep_averages"))
        return self._point_averages() * (most if self.sweeps_continuously() else max(1, min(self._averaged, most)))

    def _measure(self) -> None:
        # With identical standards the correction divides by zero; instruments show 9.9E37 then.
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            impedance = self._between_open_and_short(self._raw(self._averages()))
            load = self._standard("load", impedance.size)
            if load is not None:
                s = 2j * np.pi * self.axis()
                impedance = impedance * (self.value("load_ohm") + s * self.value("load_henry")) / self._between_open_and_short(load)
        self._measured = np.where(np.isfinite(impedance), impedance, OVERFLOW_OHM)
        self._measured_with = self._sweep_settings()
        self._measured_until_s = self.clock.now()

    def _raw(self, averages: int) -> ComplexArray:
        """Uncorrected measurement: the device under test behind the fixture."""
        frequency_hz = self.axis()
        s = 2j * np.pi * frequency_hz
        device = self.wiring.impedance_ohm(frequency_hz, int(self.value("bandwidth_factor")), averages)
        return FIXTURE_OHM + s * FIXTURE_HENRY + device / (1 + device * (FIXTURE_SIEMENS + s * FIXTURE_FARAD))

    def _between_open_and_short(self, impedance: ComplexArray) -> ComplexArray:
        """Remove the fixture's series impedance, measured with the short standard, and parallel admittance, measured with the open standard."""
        short, open_ = self._standard("short", impedance.size), self._standard("open", impedance.size)
        s = 2j * np.pi * self.axis()
        series = 0.0 if short is None else short - self.value("short_ohm") - s * self.value("short_henry")
        behind: ComplexArray = impedance - series
        if open_ is None:
            return behind
        across = 1 / (open_ - series) - self.value("open_siemens") - s * self.value("open_farad")
        return behind / (1 - behind * across)

    def _standard(self, name: str, points: int) -> ComplexArray | None:
        """Uncorrected measurement of a standard, if its compensation is on and has a value for each point; else None."""
        standard = self._standards.get(name)
        return standard if self._enabled[name] and standard is not None and standard.size == points else None


def pairs(values: ComplexArray | FloatArray) -> FloatArray:
    """Real and imaginary parts in alternation."""
    return np.column_stack([np.real(values), np.imag(values)]).ravel()
