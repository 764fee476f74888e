"""Keysight E4990A impedance analyser, 20 Hz to 120 MHz."""

from __future__ import annotations

from typing import ClassVar

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.bench.analyser import ImpedanceAnalyser, Spacing, Standard
from motoremi.bench.driver import choice, count, number
from motoremi.bench.transport import Transport
from motoremi.bench.values import block_values
from motoremi.errors import InstrumentError


class KeysightE4990A(ImpedanceAnalyser):
    """The E4990A by SCPI; source: commands that public programs for this instrument send. Not tried on hardware by us.

    Parameters
    ----------
    transport : Transport
    poll_s : float
        Seconds between two looks at the event register.
    """

    model = r"E4990A"
    analyser = "e4990a"
    error_query = ":SYST:ERR?"
    safe_commands = (":ABOR", ":TRIG:SOUR BUS", ":SOUR1:VOLT 0.005 V")

    start_hz = number(":SENS1:FREQ:STAR", "Hz", (20.0, 120e6), "Control the first frequency of the sweep.")
    stop_hz = number(":SENS1:FREQ:STOP", "Hz", (20.0, 120e6), "Control the last frequency of the sweep.")
    points = count(":SENS1:SWE:POIN", (2, 1601), "Control the number of points of the sweep.")
    spacing = choice(":SENS1:SWE:TYPE", {"log": "LOG", "linear": "LIN"}, "Control how the points are spaced.")
    bandwidth_factor = count(":SENS1:APER:TIME", (1, 5), "Control the measuring time: 1 is fastest, 5 most accurate.")
    oscillator_volt = number(":SOUR1:VOLT", "V", (0.005, 1.0), "Control the level of the test signal.")

    # Generous seconds per point for measuring time 1 to 5; only deadlines depend on them.
    SECONDS_PER_POINT: ClassVar[tuple[float, ...]] = (0.003, 0.006, 0.012, 0.06, 0.2)
    STANDARDS: ClassVar[dict[Standard, str]] = {"open": "OPEN", "short": "SHOR"}

    def __init__(self, transport: Transport, poll_s: float = 0.1) -> None:
        super().__init__(transport)
        self.poll_s = poll_s
        self._complete = False

    def reset(self) -> None:
        """Bring the analyser into a known, idle state: it sweeps only when told over the bus."""
        super().reset()
        self.tell(":TRIG:SOUR BUS", ":INIT1:CONT ON")

    def configure(
        self,
        start_hz: float,
        stop_hz: float,
        points: int,
        spacing: Spacing = "log",
        bandwidth_factor: int = 3,
        oscillator_volt: float = 0.5,
    ) -> JsonDict:
        """Set the sweep up; see `ImpedanceAnalyser.configure`."""
        self._complete = False
        self.tell(":CALC1:PAR:COUN 2", ":CALC1:PAR1:DEF R", ":CALC1:PAR2:DEF X", ":FORM:DATA REAL", ":FORM:BORD NORM")
        self.spacing = spacing
        self.start_hz = start_hz
        self.stop_hz = stop_hz
        self.points = points
        self.tell(":SOUR1:MODE VOLT")
        self.oscillator_volt = oscillator_volt
        self.bandwidth_factor = bandwidth_factor
        return self.settings()

    def metadata(self) -> JsonDict:
        """Which fixture is selected and which compensations the instrument says are on."""
        on = {f"{standard}_compensation": self._is_compensated(standard) for standard in self.STANDARDS}
        return {"fixture": self.ask(":SENS1:FIXT:SEL?"), **on}

    def measure_standard(self, standard: Standard) -> None:
        """Measure the standard at the points of the sweep; the instrument switches its compensation on."""
        measure = f":SENS1:CORR2:COLL:ACQ:{self.STANDARDS[standard]}"
        self.tell(":SENS1:CORR:COLL:FPO USER")
        self._begin(measure)
        self._wait_for(measure)
        if not self._is_compensated(standard):
            raise InstrumentError(f"{self}: the {standard} compensation is not on after {measure!r}; check the standard")

    def trigger(self) -> None:
        """Start a single sweep."""
        self._complete = False
        self._begin(":TRIG:SING")

    def wait_until_complete(self) -> None:
        """Wait for the end of the sweep."""
        self._wait_for(":TRIG:SING")
        self._complete = True

    def read_axis(self) -> FloatArray:
        """Frequencies of the sweep in hertz."""
        return block_values(self, ":SENS1:FREQ:DATA?")

    def read_impedance(self) -> ComplexArray:
        """Impedance in ohm: parameter 1 is R, parameter 2 is X, each point with a second value that is 0."""
        if not self._complete:
            raise InstrumentError(f"{self}: the sweep is not complete; the traces still hold older data")
        parts = []
        for parameter in (1, 2):
            self.tell(f":CALC1:PAR{parameter}:SEL")
            pairs = block_values(self, ":CALC1:DATA:FDAT?")
            if pairs.size % 2:
                raise InstrumentError(f"{self}: parameter {parameter} has {pairs.size} values, expected two for each point")
            parts.append(pairs[::2])
        if parts[0].size != parts[1].size:
            raise InstrumentError(f"{self}: parameter 1 has {parts[0].size} points, parameter 2 {parts[1].size}")
        impedance: ComplexArray = parts[0] + 1j * parts[1]
        return impedance

    def _is_compensated(self, standard: Standard) -> bool:
        return self.ask(f":SENS1:CORR2:{self.STANDARDS[standard]}?").strip("+") == "1"

    def _begin(self, command: str) -> None:
        self.tell("*CLS")
        self.request_service()
        self.tell(command, "*OPC")

    def _wait_for(self, command: str) -> None:
        expected_s = self.points * self.SECONDS_PER_POINT[self.bandwidth_factor - 1]
        self.wait_until(self.is_operation_complete, command, 10.0 + 3 * expected_s)
