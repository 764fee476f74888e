"""The simulated 4294A: sweeps, event register and fixture compensation on top of its profile."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.bench.clock import Clock
from motoremi.bench.simulated_device import SimulatedDevice, Wiring, definite_block

SWEEP_COMPLETE = 1
COMPENSATION_COMPLETE = 256
SECONDS_PER_POINT = (0.003, 0.006, 0.012, 0.06, 0.2)
SWEEP_OVERHEAD_S = 0.04
# An ordinary fixture: 30 mOhm and 15 nH in series, 4 pF and 10 nS across. Compensation has to take them out.
FIXTURE_OHM, FIXTURE_HENRY, FIXTURE_FARAD, FIXTURE_SIEMENS = 0.03, 15e-9, 4e-12, 1e-8
BINARY_FORMATS = {"FORM2": ">f4", "FORM3": ">f8", "FORM5": "<f4"}


class Simulated4294A(SimulatedDevice):
    """A 4294A with a fixture, connected to a test stand."""

    def __init__(self, wiring: Wiring, clock: Clock) -> None:
        self._format = "FORM4"
        self._events = 0
        self._running: tuple[float, int] | None = None
        self._measured: ComplexArray | None = None
        self._standards: dict[str, ComplexArray] = {}
        self._enabled = {"A": False, "B": False}
        super().__init__("agilent_4294a.yaml", wiring, clock)

    def commands(self) -> dict[str, Callable[[str], bytes | None]]:
        """What the 4294A computes."""
        formats = {name: self._choose(name) for name in (*BINARY_FORMATS, "FORM4")}
        return {
            **formats,
            "PRES": self._reset,
            "SING": lambda _: self._sweep(),
            "HOLD": lambda _: self._stop(),
            "COMA": lambda _: self._measure_standard("A"),
            "COMB": lambda _: self._measure_standard("B"),
            "COMSTA": lambda argument: self._enable("A", argument),
            "COMSTB": lambda argument: self._enable("B", argument),
            "COMSTA?": lambda _: b"1" if self._enabled["A"] else b"0",
            "COMSTB?": lambda _: b"1" if self._enabled["B"] else b"0",
            "ESB?": lambda _: self._read_events(),
            "OUTPSWPRM?": lambda _: self._array(self._axis()),
            "OUTPDTRC?": lambda _: self._array(self._trace()),
            "OUTPDATA?": lambda _: self._array(_pairs(self._data_or_zero())),
        }

    def busy_until(self) -> float:
        """When the running sweep or compensation ends."""
        return self._running[0] if self._running else self.clock.now()

    def status_byte(self) -> int:
        """Bit 2 summarises the event register, bit 5 the standard register, bit 6 requests service."""
        summary = super().status_byte() | (4 if self._events & int(self.value("event_mask")) else 0)
        return summary | (64 if summary & int(self.value("service_mask")) else 0)

    def _choose(self, name: str) -> Callable[[str], None]:
        def choose(_: str) -> None:
            self._format = name

        return choose

    def _axis(self) -> FloatArray:
        spaced = np.geomspace if self.value("spacing") == "LOG" else np.linspace
        axis: FloatArray = spaced(self.value("start"), self.value("stop"), self.value("points"))
        return axis

    def _begin(self, event: int) -> None:
        duration_s = SWEEP_OVERHEAD_S + self.value("points") * SECONDS_PER_POINT[self.value("bandwidth_factor") - 1]
        self._running = (self.clock.now() + duration_s, event)

    def _settle(self) -> None:
        """Let what has ended by now set its event bit."""
        if self._running and self.clock.now() >= self._running[0]:
            self._events |= self._running[1]
            self._running = None
        super()._settle()

    def _raw(self, frequency_hz: FloatArray) -> ComplexArray:
        """What the bridge sees: the device under test behind the fixture."""
        s = 2j * np.pi * frequency_hz
        device = self.wiring.impedance_ohm(frequency_hz, int(self.value("bandwidth_factor")))
        raw: ComplexArray = FIXTURE_OHM + s * FIXTURE_HENRY + device / (1 + device * (FIXTURE_SIEMENS + s * FIXTURE_FARAD))
        return raw

    def _sweep(self) -> None:
        impedance = self._raw(self._axis())
        short = self._standard("B", impedance.size)
        open_ = self._standard("A", impedance.size)
        if short is not None:
            impedance = impedance - short
        if open_ is not None:
            impedance = impedance / (1 - impedance / (open_ if short is None else open_ - short))
        self._measured = impedance
        self._begin(SWEEP_COMPLETE)

    def _standard(self, letter: str, points: int) -> ComplexArray | None:
        """What was read with a standard connected, if that compensation is on and has a value for each point."""
        standard = self._standards.get(letter)
        return standard if self._enabled[letter] and standard is not None and standard.size == points else None

    def _measure_standard(self, letter: str) -> None:
        """COMA reads what is left with nothing connected, COMB with a short; both switch their compensation on."""
        self._standards[letter] = self._raw(self._axis())
        self._enabled[letter] = True
        self._begin(COMPENSATION_COMPLETE)

    def _enable(self, letter: str, argument: str) -> None:
        if argument.upper() in ("ON", "1") and letter not in self._standards:
            self.error_response("no_compensation")
            return
        self._enabled[letter] = argument.upper() in ("ON", "1")

    def _stop(self) -> None:
        self._running = None

    def _read_events(self) -> bytes:
        events, self._events = self._events, 0
        return str(events).encode()

    def _clear_status(self, argument: str) -> None:
        super()._clear_status(argument)
        self._events = 0

    def _reset(self, argument: str) -> None:
        super()._reset(argument)
        self._format = "FORM4"
        self._stop()
        self._enabled = {"A": False, "B": False}

    def _data_or_zero(self) -> ComplexArray:
        if self._measured is None:
            return np.zeros(int(self.value("points")), dtype=np.complex128)
        return self._measured

    def _trace(self) -> FloatArray:
        """Two values a point; the second one matters for complex traces only."""
        impedance = self._data_or_zero()
        main = self.value("trace") == "A"
        match self.value("measurement"):
            case "IRIM":
                return _pairs(impedance.real if main else impedance.imag)
            case "IMPH":
                return _pairs(np.abs(impedance) if main else np.angle(impedance, deg=True))
            case _:
                return _pairs(impedance)

    def _array(self, values: FloatArray) -> bytes:
        if self._format == "FORM4":
            return ",".join(f"{value:+.11E}" for value in values).encode()
        return definite_block(values, BINARY_FORMATS[self._format])


def _pairs(values: ComplexArray | FloatArray) -> FloatArray:
    """Real and imaginary parts by turns."""
    pairs: FloatArray = np.column_stack([np.real(values), np.imag(values)]).ravel()
    return pairs
