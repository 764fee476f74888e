"""What the simulated impedance analysers share: sweeps, triggering, and the compensation of a fixture."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.bench.clock import Clock
from motoremi.bench.simulated_device import SimulatedDevice, Wiring

SWEEP_OVERHEAD_S = 0.04
OVERFLOW_OHM = 9.9e37
# An ordinary fixture: 30 mOhm and 15 nH in series, 4 pF and 10 nS across. Compensation has to take them out.
FIXTURE_OHM, FIXTURE_HENRY, FIXTURE_FARAD, FIXTURE_SIEMENS = 0.03, 15e-9, 4e-12, 1e-8


class SimulatedBridge(SimulatedDevice):
    """An analyser with a fixture, connected to a test stand.

    The profile names its settings `start`, `stop`, `points`, `spacing` (LIN or LOG), `bandwidth_factor` and `load_ohm`.
    """

    # Order of magnitude; makers give no figures.
    SECONDS_PER_POINT: ClassVar[tuple[float, ...]] = (0.003, 0.006, 0.012, 0.06, 0.2)

    def __init__(self, profile: str, wiring: Wiring, clock: Clock) -> None:
        self._ends_s: float | None = None
        self._measured: ComplexArray | None = None
        self._measured_with: tuple[float, ...] = ()
        self._measured_until_s = 0.0
        self._continuous = True
        self._standards: dict[str, ComplexArray] = {}
        self._enabled = {"open": False, "short": False, "load": False}
        super().__init__(profile, wiring, clock)

    def busy_until(self) -> float:
        """When the running sweep or compensation ends."""
        return self.clock.now() if self._ends_s is None else self._ends_s

    def axis(self) -> FloatArray:
        """Frequencies of the sweep in hertz."""
        spaced = np.geomspace if self.value("spacing") == "LOG" else np.linspace
        axis: FloatArray = spaced(self.value("start"), self.value("stop"), self.value("points"))
        return axis

    def duration_s(self) -> float:
        """How long a sweep takes."""
        return SWEEP_OVERHEAD_S + float(self.value("points")) * self.SECONDS_PER_POINT[int(self.value("bandwidth_factor")) - 1]

    def begin(self) -> None:
        """Start whatever takes as long as a sweep."""
        self._ends_s = self.clock.now() + self.duration_s()

    def ended(self) -> None:
        """Called once when it has ended."""

    def sweep(self) -> None:
        """Start one sweep."""
        self._continuous = False
        self._measure()
        self.begin()

    def sweeps_continuously(self) -> bool:
        """Whether one sweep follows the other."""
        return self._continuous

    def set_continuous(self, on: bool) -> None:
        """Sweep again and again, or hold."""
        self._continuous = on
        if not on:
            self._ends_s = None

    def impedance_ohm(self) -> ComplexArray:
        """What the last sweep measured; an analyser that sweeps continuously has always just measured."""
        old = self.clock.now() - self._measured_until_s > self.duration_s()
        if self.sweeps_continuously() and (self._measured is None or self._measured_with != self._sweep_settings() or old):
            self._measure()
        return np.zeros(int(self.value("points")), dtype=np.complex128) if self._measured is None else self._measured

    def measure_standard(self, standard: str) -> None:
        """Read what is left with a standard connected, and switch its compensation on."""
        with np.errstate(divide="ignore", invalid="ignore"):
            self._standards[standard] = self._raw() if standard != "load" else self._between_open_and_short(self._raw())
        self._enabled[standard] = True
        self.begin()

    def is_enabled(self, standard: str) -> bool:
        """Whether this compensation is on."""
        return self._enabled[standard]

    def enable(self, standard: str, argument: str) -> None:
        """Switch a compensation on or off; an error if the standard was never measured."""
        on = argument.upper() in ("ON", "1")
        if on and standard not in self._standards:
            self.error_response("no_compensation")
            return
        self._enabled[standard] = on

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

    def _sweep_settings(self) -> tuple[float, ...]:
        return (*self.axis(), self.value("bandwidth_factor"))

    def _measure(self) -> None:
        # Standards that were one and the same thing leave nothing to divide by; instruments show 9.9E37 then.
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            impedance = self._between_open_and_short(self._raw())
            load = self._standard("load", impedance.size)
            impedance = impedance if load is None else impedance * self.value("load_ohm") / load
        self._measured = np.where(np.isfinite(impedance), impedance, OVERFLOW_OHM)
        self._measured_with = self._sweep_settings()
        self._measured_until_s = self.clock.now()

    def _raw(self) -> ComplexArray:
        """What the bridge sees: the device under test behind the fixture."""
        frequency_hz = self.axis()
        s = 2j * np.pi * frequency_hz
        device = self.wiring.impedance_ohm(frequency_hz, int(self.value("bandwidth_factor")))
        raw: ComplexArray = FIXTURE_OHM + s * FIXTURE_HENRY + device / (1 + device * (FIXTURE_SIEMENS + s * FIXTURE_FARAD))
        return raw

    def _between_open_and_short(self, impedance: ComplexArray) -> ComplexArray:
        short, open_ = self._standard("short", impedance.size), self._standard("open", impedance.size)
        if short is not None:
            impedance = impedance - short
        if open_ is not None:
            impedance = impedance / (1 - impedance / (open_ if short is None else open_ - short))
        return impedance

    def _standard(self, name: str, points: int) -> ComplexArray | None:
        """What was read with a standard connected, if that compensation is on and has a value for each point."""
        standard = self._standards.get(name)
        return standard if self._enabled[name] and standard is not None and standard.size == points else None


def pairs(values: ComplexArray | FloatArray) -> FloatArray:
    """Real and imaginary parts by turns."""
    interleaved: FloatArray = np.column_stack([np.real(values), np.imag(values)]).ravel()
    return interleaved
