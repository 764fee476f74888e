"""Keysight E4990A impedance analyser, 20 Hz to 120 MHz."""

from __future__ import annotations

from typing import ClassVar

from motoremi.arrays import FloatArray, JsonDict
from motoremi.bench.bridge import BridgeAnalyser
from motoremi.bench.driver import choice, count, number, switch
from motoremi.bench.impedance_analyser import Standard, SweepSettings
from motoremi.bench.sweep_options import Bias, Segment, SweepOptions
from motoremi.bench.values import block_values
from motoremi.data.sweep import ImpedanceSweep
from motoremi.errors import InstrumentError
from motoremi.quantities import show


class KeysightE4990A(BridgeAnalyser):
    """The E4990A by SCPI; source: commands that public programs for this instrument send. Not tested with the instrument.

    The driver cannot set the current range of a bias, so the limit of its current is checked against what the instrument measured during the
    sweep. Unconfirmed: what the selection of a fixture changes in the data.

    Parameters
    ----------
    transport : Transport
    poll_s : float
        Seconds between two readings of the event register.
    """

    model = r"E4990A"
    analyser = "e4990a"
    error_query = ":SYST:ERR?"
    safe_commands = (":SOUR1:BIAS:STAT OFF", ":ABOR", ":TRIG:SOUR BUS", ":SOUR1:VOLT 0.005 V")

    start_hz = number(":SENS1:FREQ:STAR", "Hz", (20.0, 120e6), "Control the first frequency of the sweep.")
    stop_hz = number(":SENS1:FREQ:STOP", "Hz", (20.0, 120e6), "Control the last frequency of the sweep.")
    points = count(":SENS1:SWE:POIN", (2, 1601), "Control the number of points of the sweep.")
    spacing = choice(":SENS1:SWE:TYPE", {"log": "LOG", "linear": "LIN", "list": "SEGM"}, "Control how the points are spaced.")
    bandwidth_factor = count(":SENS1:APER:TIME", (1, 5), "Control the measuring time: 1 is fastest, 5 most accurate.")
    oscillator_volt = number(":SOUR1:VOLT", "V", (0.005, 1.0), "Control the level of the test signal.")

    adapter = choice(
        ":SENS1:ADAP:TYPE",
        {"none": "NONE", "1m": "E4M1", "2m": "E4M2", "42942A": "E4A7", "42941A": "E4PR"},
        "Control which adapter is connected; its set-up data are measured at the instrument.",
    )
    fixture = choice(
        ":SENS1:FIXT:SEL",
        {"none": "NONE", "16047E": "FIXT16047E", "16034G": "FIXT16034G", "16089": "FIXT16089", "leads": "ARB"},
        "Control which fixture is selected.",
    )
    sweep_averaging = switch(":CALC1:AVER", "Control whether sweeps are averaged.")
    sweep_averages = count(":CALC1:AVER:COUN", (1, 999), "Control how many sweeps are averaged.")
    averaging_trigger = switch(":TRIG:SEQ:AVER", "Control whether one trigger starts all sweeps of an average.")
    point_averaging = switch(":SENS1:AVER:STAT", "Control whether readings at a point are averaged.")
    point_averages = count(":SENS1:AVER:COUN", (1, 999), "Control how many readings are averaged at each point.")
    bias_on = switch(":SOUR1:BIAS:STAT", "Control whether the bias is across the motor.")
    bias_volt = number(":SOUR1:BIAS:VOLT", "V", (-40.0, 40.0), "Control the voltage of the bias.")
    bias_monitor = switch(":SENS1:DC:MEAS:ENAB", "Control whether voltage and current of the bias are measured.")
    load_ohm = number(":SENS1:CORR2:CKIT:LOAD:R", "", (1e-3, 1e6), "Control what resistance the load standard has, in ohm.")
    load_henry = number(":SENS1:CORR2:CKIT:LOAD:L", "", (-1e-3, 1e-3), "Control what inductance the load standard has, in henry.")

    RESTART_AVERAGE = ":CALC1:AVER:CLE"
    PARTS = ("parameter 1", "parameter 2")
    STANDARDS: ClassVar[dict[Standard, str]] = {"open": "OPEN", "short": "SHOR", "load": "LOAD"}

    def reset(self) -> None:
        """Bring the analyser into a known, idle state: it sweeps only after a trigger over the bus."""
        super().reset()
        self.tell(":TRIG:SOUR BUS", ":INIT1:CONT ON")

    def set_up(self, asked: SweepSettings) -> JsonDict:
        """Set the sweep up; see `SweepSettings`."""
        self.complete = False
        self.tell(":CALC1:PAR:COUN 2", ":CALC1:PAR1:DEF R", ":CALC1:PAR2:DEF X", ":FORM:DATA REAL", ":FORM:BORD NORM")
        self.spacing = asked.spacing
        self.start_hz = asked.start_hz
        self.stop_hz = asked.stop_hz
        self.points = asked.points
        self.tell(":SOUR1:MODE VOLT")
        self.oscillator_volt = asked.oscillator_volt
        self.bandwidth_factor = asked.bandwidth_factor
        return self.settings()

    def prepare(self, options: SweepOptions) -> JsonDict:
        """Set the options of a sweep; see `ImpedanceAnalyser.prepare`."""
        self.fixture = options.fixture
        self.averaging_trigger = options.sweep_averages > 1
        return super().prepare(options)

    def enter_list(self, segments: tuple[Segment, ...]) -> None:
        """Enter the table of a list sweep: start, stop and points of each segment; other settings are those of the sweep."""
        rows = [f"{one.start_hz:.12g},{one.stop_hz:.12g},{one.points}" for one in segments]
        self.tell(f":SENS1:SEGM:DATA 7,0,0,0,0,0,0,0,{','.join([str(len(rows)), *rows])}")

    def limit_bias(self, bias: Bias) -> None:
        """Switch on the instrument's measurement of the bias."""
        self.tell(":SOUR1:BIAS:MODE VOLT")
        self.bias_monitor = True
        self.tell(":SENS1:DC:MEAS:CLE")

    def check_bias(self, bias: Bias) -> JsonDict:
        """Voltage and current as the instrument measured them during the sweep."""
        volt, ampere = (float(self.ask(f":SENS1:DC:MEAS:DATA:{what}?")) for what in ("DCV", "DCI"))
        if abs(ampere) > bias.limit_a:
            raise InstrumentError(
                f"{self}: the bias of {show(bias.volt, 'V')} drove {show(ampere, 'A')}, more than its limit of {show(bias.limit_a, 'A')}; "
                "lower the bias, or raise its limit"
            )
        return {"measured_volt": volt, "measured_ampere": ampere}

    def metadata(self) -> JsonDict:
        """Which compensations are on as reported by the instrument, its load standard and the bias."""
        on = {f"{standard}_compensation": self._is_compensated(standard) for standard in self.STANDARDS}
        return {**on, **super().metadata()}

    def measure_standard(self, standard: Standard) -> None:
        """Measure the standard at the points of the sweep; the instrument switches its compensation on."""
        measure = f":SENS1:CORR2:COLL:ACQ:{self.STANDARDS[standard]}"
        self.tell(":SENS1:CORR:COLL:FPO USER")
        self._begin(measure)
        self._wait_for(measure)
        if not self._is_compensated(standard):
            raise InstrumentError(f"{self}: the {standard} compensation is not on after {measure!r}; check the standard")

    def begin(self, sweeps: int) -> None:
        """Start a sweep, and with averaging all of them."""
        self._begin(":TRIG:SING")

    def end(self, sweeps: int) -> None:
        """Wait until that many sweeps are complete."""
        self._wait_for(":TRIG:SING", sweeps)

    def read_axis(self) -> FloatArray:
        """Frequencies of the sweep in hertz."""
        return block_values(self, ":SENS1:FREQ:DATA?")

    def read_part(self, index: int) -> FloatArray:
        """Parameter 1 or 2."""
        self.tell(f":CALC1:PAR{index + 1}:SEL")
        return block_values(self, ":CALC1:DATA:FDAT?")

    def read_compensation(self, standard: Standard) -> ImpedanceSweep:
        """What the instrument measured with a standard, as R and X at its own frequencies."""
        header = f":SENS1:CORR2:ZME:{self.STANDARDS[standard]}"
        pairs = block_values(self, f"{header}:DATA?")
        return self.kept(standard, block_values(self, f"{header}:FREQ?"), pairs[::2] + 1j * pairs[1::2])

    def _is_compensated(self, standard: Standard) -> bool:
        return self.ask(f":SENS1:CORR2:{self.STANDARDS[standard]}?").strip("+") == "1"

    def _begin(self, command: str) -> None:
        self.tell("*CLS")
        self.request_service()
        self.tell(command, "*OPC")

    def _wait_for(self, command: str, sweeps: int = 1) -> None:
        self.wait_until(self.is_operation_complete, command, self.longest_s(sweeps))
