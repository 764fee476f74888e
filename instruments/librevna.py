"""LibreVNA, a network analyser with an open design, through the SCPI server of its program: impedance from S11."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.bench.driver import Identity, Setting, choice, count, number
from motoremi.bench.impedance_analyser import SweepSettings
from motoremi.bench.reflection import ReflectionAnalyser
from motoremi.bench.transport import Transport
from motoremi.errors import InstrumentError
from motoremi.quantities import show


class LibreVna(ReflectionAnalyser):
    """The LibreVNA-GUI (1.6 and newer) on TCP port 19542; sources: its SCPI Programming Guide, and its `vna.cpp` and `scpi.cpp`.

    **Calibration.** The program applies its own calibration, made there with open, short and load at port 1; a sweep without one that corrects
    S11 is refused. Beyond the frequencies of the calibration the program uses its last point, and no command reports that: calibrate over the
    whole sweep. `compensate` measures the fixture behind the port, which is corrected here.

    **Limits.** Those of `NanoVna`. The driver does not change the level, for which the calibration was made. A trace has numbers of six digits.

    Attributes
    ----------
    CORRECTS_S11 : tuple of str
        Types of calibration that correct S11; `ThroughNormalization` does not.
    EXPECTED : mapping of str to str
        Queries and the answers with which the trace S11 holds the last sweep of S11.
    """

    model = r"LibreVNA-GUI"
    error_query = "*ESR?"
    units_on_wire = False
    safe_commands = (":VNA:ACQ:STOP",)

    start_hz = number(":VNA:FREQ:START", "Hz", (100e3, 6e9), "Control the first frequency of the sweep.")
    stop_hz = number(":VNA:FREQ:STOP", "Hz", (100e3, 6e9), "Control the last frequency of the sweep.")
    points = count(":VNA:ACQ:POINTS", (2, 4501), "Control the number of points of the sweep.")
    spacing = choice(":VNA:SWEEPTYPE", {"log": "LOG", "linear": "LIN"}, "Control how the points are spaced.")
    bandwidth_hz = number(":VNA:ACQ:IFBW", "Hz", (10.0, 50e3), "Control the receiver bandwidth.")
    averages = count(":VNA:ACQ:AVG", (1, 100), "Control how many sweeps the program averages.")
    level_dbm = Setting(":VNA:STIM:LVL", "Control the level of the test signal, in dBm.", float, str)

    BANDWIDTHS_HZ: ClassVar[tuple[float, ...]] = (10e3, 3e3, 1e3, 300.0, 100.0)
    CORRECTS_S11: ClassVar[tuple[str, ...]] = ("OSL", "SOLT", "SOLTwithoutRxMatch", "TRL")
    EXPECTED: ClassVar[dict[str, str]] = {
        ":DEV:MODE?": "VNA",
        ":VNA:SWEEP?": "FREQUENCY",
        ":VNA:TRAC:PARAM? S11": "S11",
        ":VNA:TRAC:TYPE? S11": "OVERWRITE",
        ":VNA:TRAC:PAUSED? S11": "FALSE",
    }
    # Bits of the event status register: query, device, execution and command error.
    ERRORS: ClassVar[int] = 4 + 8 + 16 + 32

    def __init__(self, transport: Transport) -> None:
        super().__init__(transport)
        self._axis: FloatArray | None = None

    def identify(self) -> Identity:
        """Read the identity; a program without an instrument is refused."""
        identity = super().identify()
        if identity.serial.lower() == "not connected":
            raise InstrumentError(f"{self.transport.resource_name}: the LibreVNA-GUI is not connected to a LibreVNA; connect it there")
        return identity

    def reset(self) -> None:
        """Bring the program into a known state, without `*RST`, which would delete the calibration."""
        self.transport.write("*CLS")
        self.tell(":DEV:MODE VNA", ":VNA:SWEEP FREQUENCY", ":VNA:ACQ:SINGLE TRUE", ":VNA:ACQ:STOP")
        self.sent_settings.clear()

    def set_up(self, asked: SweepSettings) -> JsonDict:
        """Set the sweep up; see `SweepSettings`. `oscillator_volt` has no effect: a calibration belongs to its level."""
        self.refuse_outside("bandwidth_factor", asked.bandwidth_factor, (1, len(self.BANDWIDTHS_HZ)))
        self._measured = self._axis = None
        self.start_hz, self.stop_hz, self.points, self.spacing = round(asked.start_hz), round(asked.stop_hz), asked.points, asked.spacing
        self.bandwidth_hz, self.averages = self.BANDWIDTHS_HZ[asked.bandwidth_factor - 1], 1
        settings = self.settings()
        kind, _, ports = str(settings["calibration"]).partition("_")
        if kind not in self.CORRECTS_S11 or "1" not in ports:
            raise InstrumentError(
                f"{self}: no calibration of port 1 is active ({settings['calibration']}); calibrate in the LibreVNA-GUI (open, short, load at "
                f"port 1) for {show(asked.start_hz, 'Hz')} to {show(asked.stop_hz, 'Hz')}"
            )
        return settings

    def settings(self) -> JsonDict:
        """Settings as the program reports them, and which calibration it applies."""
        return {**super().settings(), "calibration": self.ask(":VNA:CAL:ACTIVE?")}

    def metadata(self) -> JsonDict:
        """De-embedding of the trace, and whether the level was reached, as the program reports them."""
        reported = {"deembedding": self._is_true(":VNA:TRAC:DEEMB:ACTIVE? S11"), "level_reached": not self._is_true(":DEV:STA:UNLEV?")}
        return {**super().metadata(), **reported}

    def read_axis(self) -> FloatArray:
        """Frequencies of the sweep in hertz; the instrument rounds them down to whole hertz."""
        if self._axis is None:
            spaced = np.geomspace if self.spacing == "log" else np.linspace
            self._axis = np.floor(spaced(self.start_hz, self.stop_hz, self.points) + 1e-3)
        return self._axis

    def scan_mean(self, scans: int) -> ComplexArray:
        """Mean of S11 over a number of sweeps."""
        for query, wanted in self.EXPECTED.items():
            if (found := self.ask(query)) != wanted:
                raise InstrumentError(f"{self}: {query!r} is answered {found!r}, expected {wanted!r}; undo that in the LibreVNA-GUI")
        return super().scan_mean(scans)

    def scan(self) -> ComplexArray:
        """S11 of one sweep, as calibrated by the program."""
        # Restarts a running sweep; the program then reports FALSE until the new sweep is complete.
        self.tell(":VNA:ACQ:RUN")
        longest_s = 10.0 + 20.0 * self.points / self.bandwidth_hz
        self.wait_until(lambda: self._is_true(":VNA:ACQ:FIN?"), ":VNA:ACQ:RUN", longest_s)
        if self._is_true(":DEV:STA:ADCOVER?"):
            raise InstrumentError(f"{self}: the receiver was overdriven; lower the level in the LibreVNA-GUI and calibrate again")
        return self._trace()

    def check_errors(self, command: str) -> None:
        """Read the event status register; the program has no error queue."""
        answer = self.transport.query(self.error_query)
        if not answer.isdigit() or int(answer) & self.ERRORS:
            raise InstrumentError(f"{self}: {command!r} was refused (event status {answer[:20]!r})")

    def _trace(self) -> ComplexArray:
        query = ":VNA:TRAC:DATA? S11"
        answer = self.ask(query)
        try:
            rows = np.array([[float(value) for value in row.split(",")] for row in answer.strip("[]").split("],[")])
        except ValueError as error:
            raise InstrumentError(f"{self}: {answer[:40]!r} in answer to {query!r} is no list of frequency, real and imaginary part") from error
        axis = self.read_axis()
        # One hertz of rounding, and six digits in old versions.
        if rows.shape != (axis.size, 3) or not np.all(np.isfinite(rows)) or not np.allclose(rows[:, 0], axis, rtol=1e-5, atol=2.0):
            raise InstrumentError(f"{self}: the trace S11 is no sweep of the frequencies asked for; do not touch the LibreVNA-GUI during a sweep")
        return rows[:, 1] + 1j * rows[:, 2]

    def _is_true(self, query: str) -> bool:
        answer = self.ask(query)
        if answer not in ("TRUE", "FALSE"):
            raise InstrumentError(f"{self}: {answer[:20]!r} in answer to {query!r}, expected TRUE or FALSE")
        return answer == "TRUE"
