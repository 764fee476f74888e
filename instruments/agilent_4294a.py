"""Agilent (Keysight) 4294A precision impedance analyser, 40 Hz to 110 MHz."""

from __future__ import annotations

from typing import ClassVar

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.bench.analyser import ImpedanceAnalyser, Spacing, Standard
from motoremi.bench.driver import choice, count, number
from motoremi.bench.transport import Transport
from motoremi.bench.values import block_values, text_values
from motoremi.errors import InstrumentError


class Agilent4294A(ImpedanceAnalyser):
    """The 4294A by its own mnemonics; sources: Programming Manual, chapters on fixture compensation, data transfer and status.

    Parameters
    ----------
    transport : Transport
    poll_s : float
        Seconds between two looks at the event register.

    Attributes
    ----------
    binary : bool
        64-bit blocks (FORM3) if True, ASCII (FORM4) if False, for adapters that spoil binary data.
    """

    model = "4294A"
    analyser = "4294a"
    error_query = "OUTPERRO?"
    safe_commands = ("HOLD", "POWE 0.005 V")

    start_hz = number("STAR", "Hz", (40.0, 110e6), "Control the first frequency of the sweep.")
    stop_hz = number("STOP", "Hz", (40.0, 110e6), "Control the last frequency of the sweep.")
    points = count("POIN", (2, 801), "Control the number of points of the sweep.")
    spacing = choice("SWPT", {"log": "LOG", "linear": "LIN"}, "Control how the points are spaced.")
    bandwidth_factor = count("BWFACT", (1, 5), "Control the measuring bandwidth: 1 is fastest, 5 most accurate.")
    oscillator_volt = number("POWE", "V", (0.005, 1.0), "Control the level of the test signal.")
    measurement = choice(
        "MEAS",
        {"resistance-reactance": "IRIM", "magnitude-phase": "IMPH", "complex": "COMP"},
        "Control which quantities traces A and B show.",
    )

    # Bits of the instrument event register (ESB?), which bit 2 of the status byte sums up.
    SWEEP_COMPLETE: ClassVar[int] = 1
    COMPENSATION_COMPLETE: ClassVar[int] = 256
    REQUEST_AT_COMPLETION: ClassVar[tuple[str, ...]] = ("*SRE 4",)
    # Typical seconds per point for BWFACT 1 to 5; only deadlines depend on them, so they are generous.
    SECONDS_PER_POINT: ClassVar[tuple[float, ...]] = (0.003, 0.006, 0.012, 0.06, 0.2)
    STANDARDS: ClassVar[dict[Standard, tuple[str, str]]] = {"open": ("COMA", "COMSTA"), "short": ("COMB", "COMSTB")}

    def __init__(self, transport: Transport, poll_s: float = 0.1) -> None:
        super().__init__(transport)
        self.poll_s = poll_s
        self.binary = True
        self._complete = False

    def reset(self) -> None:
        """Bring the analyser into a known, idle state."""
        super().reset()
        self.tell("HOLD", "TRGS INT")

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
        self.measurement = "resistance-reactance"
        self.tell("SWPP FREQ")
        self.spacing = spacing
        self.start_hz = start_hz
        self.stop_hz = stop_hz
        self.points = points
        self.tell("POWMOD VOLT")
        self.oscillator_volt = oscillator_volt
        self.bandwidth_factor = bandwidth_factor
        return self.settings()

    def measure_standard(self, standard: Standard) -> None:
        """Measure the open (COMA) or short (COMB) standard at the points of the sweep, and switch the compensation on."""
        measure, enable = self.STANDARDS[standard]
        self.tell("CALP USER")
        self._begin(measure, self.COMPENSATION_COMPLETE)
        self._wait_for(self.COMPENSATION_COMPLETE, measure)
        self.tell(f"{enable} ON")

    def trigger(self) -> None:
        """Start a single sweep."""
        self._complete = False
        self._begin("SING", self.SWEEP_COMPLETE)

    def wait_until_complete(self) -> None:
        """Wait for the end of the sweep."""
        self._wait_for(self.SWEEP_COMPLETE, "SING")
        self._complete = True

    def read_axis(self) -> FloatArray:
        """Frequencies of the sweep in hertz."""
        return self._read_array("OUTPSWPRM?")

    def read_impedance(self) -> ComplexArray:
        """Impedance in ohm: trace A is R, trace B is X, each point with a second value that is 0."""
        if not self._complete:
            raise InstrumentError(f"{self}: the sweep is not complete; the traces still hold older data")
        parts = []
        for trace in "AB":
            self.tell(f"TRAC {trace}")
            pairs = self._read_array("OUTPDTRC?")
            if pairs.size % 2:
                raise InstrumentError(f"{self}: trace {trace} has {pairs.size} values, expected two for each point")
            parts.append(pairs[::2])
        if parts[0].size != parts[1].size:
            raise InstrumentError(f"{self}: trace A has {parts[0].size} points, trace B {parts[1].size}")
        impedance: ComplexArray = parts[0] + 1j * parts[1]
        return impedance

    def _begin(self, command: str, event: int) -> None:
        # *CLS clears the event register. After the trigger it could clear the very bit that is waited for.
        self.tell("*CLS", f"ESNB {event}")
        self.request_service()
        self.tell(command)

    def _wait_for(self, event: int, command: str) -> None:
        expected_s = self.points * self.SECONDS_PER_POINT[self.bandwidth_factor - 1]
        self.wait_until(lambda: bool(int(float(self.transport.query("ESB?"))) & event), command, 10.0 + 3 * expected_s)

    def _read_array(self, query: str) -> FloatArray:
        self.transport.write("FORM3" if self.binary else "FORM4")
        return block_values(self, query) if self.binary else text_values(self, query)
