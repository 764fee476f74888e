"""The simulated bench: simulated instruments, motor and operator; drivers reach the instruments through PyVISA."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np
import pyvisa
from pyvisa.util import LibraryPath

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.bench.clock import Clock, VirtualClock
from motoremi.bench.connect import Options, attach, open_transport
from motoremi.bench.driver import Driver
from motoremi.bench.motor_connections import AT_THE_LISN, CONNECTIONS, ConnectionName
from motoremi.bench.traffic import TrafficSink
from motoremi.data.conditions import Condition, SingleValue
from motoremi.data.sweep import Termination
from motoremi.errors import BadInput
from motoremi.simulate import emission_in_time
from motoremi.simulate.analyser_errors import SimulatedAnalyser
from motoremi.simulate.arrangement import Arrangement
from motoremi.simulate.hidden_effects import split_effects
from motoremi.simulate.simulated_motor import SimulatedMotor
from motoremi.simulate.specimen import Specimen
from motoremi.simulate.stand import MotorStand
from motoremi.virtual.simulated_device import SimulatedDevice
from motoremi.virtual.virtual_instruments import VIRTUAL_INSTRUMENTS, virtual_instrument
from motoremi.virtual.visa_library import BenchLibrary

OPEN_STANDARD_OHM = 1e12
# Voltage and current limit of the operator's own supply, used if the bench has no supply.
OPERATORS_SUPPLY = (12.0, 5.0)
STANDARDS_OHM = {"short-standard": 0.0, "load-standard": 100.0}
# Difference of the level on the other line, because the test stand is not symmetric.
OTHER_LINE_DB = -1.5
_library_numbers = itertools.count(1)


class SimulatedBench:
    """A bench on which everything is simulated: the motor, the instruments, and the operator who connects them.

    Parameters
    ----------
    seed : int
        Draws the motor, the instruments' own errors and the noise.
    effects : sequence of str
        Hidden effects; those of the instrument go to the analyser, the others to the motor.
    clock : Clock, optional
        Virtual unless given, so that a sweep of a minute takes no time.
    """

    # Instruments that the bench has until a procedure names others.
    INSTRUMENTS: ClassVar[Mapping[str, str]] = {"analyser": "4294a", "receiver": "esr"}

    def __init__(self, seed: int, effects: Sequence[str] = (), clock: Clock | None = None) -> None:
        self.seed = seed
        self.effects = tuple(effects)
        self.clock = clock or VirtualClock()
        hidden, faults = split_effects(effects)
        self.motor = SimulatedMotor.random(seed, hidden)
        self._specimen = Specimen(self.motor, seed)
        self._arrangement = Arrangement(self._specimen)
        self.stand = MotorStand(self.clock.now)
        self._analyser = SimulatedAnalyser(seed, faults=faults)
        self._connected: ConnectionName = "open-standard"
        self._standards: set[str] = set()
        self._is_reference = True
        self._connection = 0
        self._line = ""
        self.devices: dict[str, SimulatedDevice] = {}
        self.resources: dict[str, str] = {}
        self._library = BenchLibrary(LibraryPath(f"motoremi-bench-{next(_library_numbers)}"))
        self._on_bench = dict(self.INSTRUMENTS)
        for role, name in self.INSTRUMENTS.items():
            self.place(role, name)
        self.resource_manager = pyvisa.ResourceManager(self._library)

    def open(self, role: str, driver: str, resource: str, sink: TrafficSink, options: Options | None = None) -> Driver:
        """Connect the driver of a role to the simulated instrument of that role, whatever resource the procedure names."""
        # A driver without a simulated instrument is connected to the present one, and refuses its identity.
        if driver != self._on_bench.get(role) and driver in VIRTUAL_INSTRUMENTS and VIRTUAL_INSTRUMENTS[driver].resource_as(role):
            self.place(role, driver)
        if role not in self.resources:
            raise BadInput(f"the simulated bench has no {role!r} with the driver {driver!r}; it has {', '.join(self.resources)}")
        self.devices[role].use(options or {})
        transport = open_transport(self.resource_manager, self.resources[role], clock=self.clock)
        return attach(transport, role, driver, sink, options)

    def place(self, role: str, name: str) -> None:
        """Add the simulated instrument of that name to the bench."""
        instrument = virtual_instrument(name)
        resource = instrument.resource_as(role)
        if resource is None:
            raise BadInput(f"a {name} cannot be the {role}")
        self._on_bench[role] = name
        self.devices[role] = instrument.make(self, self.clock)
        self.resources[role] = resource
        self._library.add(resource, self.devices[role])

    def _other_line_db(self) -> float:
        return OTHER_LINE_DB if self._line in ("N", "-") else 0.0

    def connect(self, what: ConnectionName) -> int:
        """Connect a standard, the motor in one of its terminations, or the LISN; every connection has its own residuals."""
        if what not in CONNECTIONS:
            raise BadInput(f"unknown connection {what!r}: use one of {', '.join(CONNECTIONS)}")
        # The first connection of a standard is the reference of the compensation; residual errors show from the second one on.
        self._is_reference = what not in self._standards
        self._standards.add(what)
        self._connected = what
        self._connection += 1
        if what in AT_THE_LISN.values() and "supply" not in self._on_bench:
            # The operator switches the supply.
            self.stand.drive(*OPERATORS_SUPPLY) if what == "lisn-motor-on" else self.stand.release()
        return self._connection

    def arrange(self, condition: Condition | None, terminations: Sequence[Termination], turn: int = 0) -> None:
        """Have the operator set up a condition for the following sweeps; None: undo it.

        Parameters
        ----------
        condition : Condition or None
        terminations : sequence of str
            Terminations of the following sweeps.
        turn : int
            How often the same condition was requested before.
        """
        self._arrangement = Arrangement(self._specimen, condition, tuple(terminations), turn)

    def single_value(self, name: str, turn: int = 0) -> SingleValue:
        """A value that the operator reads from another meter."""
        return Arrangement(self._specimen, turn=turn).single_value(name)

    def at_work(self, role: str) -> ConnectionName:
        """The connection with which an instrument of that role measures the motor."""
        return "open" if role == "analyser" else "lisn-motor-on"

    def truth(self) -> JsonDict:
        """The true motor, hidden effects and errors of this bench."""
        return {"seed": self.seed, "hidden": list(self.effects), **self.motor.truth(), **self._analyser.truth()}

    def close(self) -> None:
        """Close the resource manager."""
        self.resource_manager.close()

    def impedance_ohm(self, frequency_hz: FloatArray, bandwidth_factor: int, averages: int = 1) -> ComplexArray:
        """What the analyser would read without fixture, in ohm; the mean of `averages` readings."""
        connected_ohm = self.connected_ohm(frequency_hz)
        analyser: SimulatedAnalyser = self._arrangement.analyser(self._analyser)
        if self._connected in ("short", "open"):
            return analyser.measure(self._connected, frequency_hz, connected_ohm, self._connection, bandwidth_factor, averages)
        if self._is_reference and self._connected != "load-standard":
            return connected_ohm
        like: Termination = "short" if self._connected == "short-standard" else "open"
        return analyser.measure(like, frequency_hz, connected_ohm, self._connection, bandwidth_factor, averages)

    def connected_ohm(self, frequency_hz: FloatArray) -> ComplexArray:
        """True impedance of what is connected, in ohm."""
        if self._connected in ("short", "open"):
            return self._arrangement.impedance(self._connected, frequency_hz)
        if self._arrangement.on_the_fixture:
            return self._arrangement.impedance("open", frequency_hz)
        return np.full(frequency_hz.shape, STANDARDS_OHM.get(self._connected, OPEN_STANDARD_OHM), dtype=np.complex128)

    def at_line(self, line: str) -> None:
        """Switch the LISN to another line."""
        self._line = line

    def level_dbuv(self, frequency_hz: FloatArray, detector: str) -> FloatArray:
        """Level at the receiver's input, in dBuV; far below its noise unless the LISN is connected."""
        if self._connected == "lisn-motor-on":
            return self._other_line_db() + emission_in_time.spectrum(self.motor, frequency_hz, detector, self.seed)
        if self._connected == "lisn-motor-off":
            return emission_in_time.background(frequency_hz, detector, self.seed)
        return np.full(frequency_hz.shape, -200.0)
