"""Agilent (Keysight) 4294A precision impedance analyser, 40 Hz to 110 MHz."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.bench.bridge import BridgeAnalyser
from motoremi.bench.driver import choice, count, number, switch
from motoremi.bench.impedance_analyser import Standard, SweepSettings
from motoremi.bench.sweep_options import Bias, Segment
from motoremi.bench.transport import Transport
from motoremi.bench.values import block_values, text_values
from motoremi.data.sweep import ImpedanceSweep
from motoremi.errors import BadInput


class Agilent4294A(BridgeAnalyser):
    """The 4294A by its own mnemonics; sources: Programming Manual, chapters on adapters, fixture compensation, data transfer, status.

    Unconfirmed on the 4294A: the words of E4TP other than OFF, M1 and M2, those of sweep averaging and of the list sweep (taken from the 4395A),
    and whether the bias range limits the current except by error 137 when the bias is switched on.

    Parameters
    ----------
    transport : Transport
    poll_s : float
        Seconds between two readings of the event register.

    Attributes
    ----------
    binary : bool
        64-bit blocks (FORM3) if True, ASCII (FORM4) if False, for GPIB adapters that corrupt binary data.
    """

    model = "4294A"
    analyser = "4294a"
    error_query = "OUTPERRO?"
    safe_commands = ("DCO OFF", "HOLD", "POWE 0.005 V")

    start_hz = number("STAR", "Hz", (40.0, 110e6), "Control the first frequency of the sweep.")
    stop_hz = number("STOP", "Hz", (40.0, 110e6), "Control the last frequency of the sweep.")
    points = count("POIN", (2, 801), "Control the number of points of the sweep.")
    spacing = choice("SWPT", {"log": "LOG", "linear": "LIN", "list": "LIST"}, "Control how the points are spaced.")
    bandwidth_factor = count("BWFACT", (1, 5), "Control the measuring bandwidth: 1 is fastest, 5 most accurate.")
    oscillator_volt = number("POWE", "V", (0.005, 1.0), "Control the level of the test signal.")
    measurement = choice(
        "MEAS",
        {"resistance-reactance": "IRIM", "magnitude-phase": "IMPH", "complex": "COMP"},
        "Control which quantities traces A and B show.",
    )
    adapter = choice(
        "E4TP",
        {"none": "OFF", "1m": "M1", "2m": "M2", "42942A": "APC7", "42941A": "PROBE"},
        "Control which adapter is connected; its set-up data are measured at the instrument.",
    )
    sweep_averaging = switch("AVER", "Control whether sweeps are averaged.")
    sweep_averages = count("AVERFACT", (1, 256), "Control how many sweeps are averaged.")
    point_averaging = switch("PAVER", "Control whether readings at a point are averaged.")
    point_averages = count("PAVERFACT", (1, 256), "Control how many readings are averaged at each point.")
    bias_on = switch("DCO", "Control whether the bias is across the motor.")
    bias_volt = number("DCV", "V", (-40.0, 40.0), "Control the voltage of the bias.")
    bias_range = choice("DCRNG", {"1 mA": "M1", "10 mA": "M10", "100 mA": "M100"}, "Control the largest current of the bias.")
    # These two commands take a bare number, so that no unit is sent.
    load_ohm = number("DCOMLOADR", "", (1e-3, 1e6), "Control what resistance the load standard has, in ohm.")
    load_henry = number("DCOMLOADL", "", (-1e-3, 1e-3), "Control what inductance the load standard has, in henry.")

    # Bits of the instrument event register (ESB?), whose summary is bit 2 of the status byte.
    SWEEP_COMPLETE: ClassVar[int] = 1
    COMPENSATION_COMPLETE: ClassVar[int] = 256
    REQUEST_AT_COMPLETION: ClassVar[tuple[str, ...]] = ("*SRE 4",)
    RESTART_AVERAGE = "AVERREST"
    PARTS = ("trace A", "trace B")
    STANDARDS: ClassVar[dict[Standard, str]] = {"open": "A", "short": "B", "load": "C"}
    BIAS_RANGES_A: ClassVar[dict[str, float]] = {"100 mA": 0.1, "10 mA": 0.01, "1 mA": 1e-3}

    def __init__(self, transport: Transport, poll_s: float = 0.1) -> None:
        super().__init__(transport, poll_s)
        self.binary = True

    def reset(self) -> None:
        """Bring the analyser into a known, idle state."""
        super().reset()
        self.tell("HOLD", "TRGS INT")

    def set_up(self, asked: SweepSettings) -> JsonDict:
        """Set the sweep up; see `SweepSettings`."""
        self.complete = False
        self.measurement = "resistance-reactance"
        self.tell("SWPP FREQ")
        self.spacing = asked.spacing
        self.start_hz = asked.start_hz
        self.stop_hz = asked.stop_hz
        self.points = asked.points
        self.tell("POWMOD VOLT")
        self.oscillator_volt = asked.oscillator_volt
        self.bandwidth_factor = asked.bandwidth_factor
        return self.settings()

    def enter_list(self, segments: tuple[Segment, ...]) -> None:
        """Enter the table of a list sweep, segment by segment."""
        self.tell("EDITLIST", "CLEL")
        for one in segments:
            self.tell("SADD", f"STAR {one.start_hz:.12g} HZ", f"STOP {one.stop_hz:.12g} HZ", f"POIN {one.points}", "SDON")
        self.tell("EDITDONE")

    def limit_bias(self, bias: Bias) -> None:
        """Choose the largest range of the current that is within the limit; the voltage is then kept constant."""
        fitting = [name for name, ampere in self.BIAS_RANGES_A.items() if ampere <= bias.limit_a]
        if not fitting:
            raise BadInput(f"{self}: has no bias range as small as {bias.limit_a:g} A; the smallest is 1 mA")
        self.tell("DCMOD CVOLT")
        self.bias_range = fitting[0]

    def measure_standard(self, standard: Standard) -> None:
        """Measure the open (COMA), short (COMB) or load (COMC) standard at the points of the sweep, and switch its compensation on."""
        measure = f"COM{self.STANDARDS[standard]}"
        self.tell("CALP USER")
        self._begin(measure, self.COMPENSATION_COMPLETE)
        self._wait_for(self.COMPENSATION_COMPLETE, measure)
        self.tell(f"COMST{self.STANDARDS[standard]} ON")

    def read_compensation(self, standard: Standard) -> ImpedanceSweep:
        """What the instrument measured with a standard: it sends conductance and susceptance of the open standard, R and X of the others."""
        pairs = self._read_array(f"OUTPCOMC{'ABC'.index(self.STANDARDS[standard]) + 1}?")
        values: ComplexArray = pairs[::2] + 1j * pairs[1::2]
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.kept(standard, self.read_axis(), np.reciprocal(values) if standard == "open" else values)

    def begin(self, sweeps: int) -> None:
        """Start that many sweeps."""
        self._begin(self._sweep_command(sweeps), self.SWEEP_COMPLETE)

    def end(self, sweeps: int) -> None:
        """Wait until that many sweeps are complete."""
        self._wait_for(self.SWEEP_COMPLETE, self._sweep_command(sweeps), sweeps)

    def read_axis(self) -> FloatArray:
        """Frequencies of the sweep in hertz."""
        return self._read_array("OUTPSWPRM?")

    def read_part(self, index: int) -> FloatArray:
        """Trace A or B."""
        self.tell(f"TRAC {'AB'[index]}")
        return self._read_array("OUTPDTRC?")

    def _sweep_command(self, sweeps: int) -> str:
        return "SING" if sweeps == 1 else f"NUMG {sweeps}"

    def _begin(self, command: str, event: int) -> None:
        # *CLS clears the event register. After the trigger it could clear the bit that is waited for.
        self.tell("*CLS", f"ESNB {event}")
        self.request_service()
        self.tell(command)

    def _wait_for(self, event: int, command: str, sweeps: int = 1) -> None:
        self.wait_until(lambda: bool(int(float(self.transport.query("ESB?"))) & event), command, self.longest_s(sweeps))

    def _read_array(self, query: str) -> FloatArray:
        self.transport.write("FORM3" if self.binary else "FORM4")
        return block_values(self, query) if self.binary else text_values(self, query)
