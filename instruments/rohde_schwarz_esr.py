"""Rohde & Schwarz ESR EMI test receiver, 10 Hz to 26.5 GHz, in receiver mode."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from motoremi.arrays import FloatArray, JsonDict
from motoremi.bench.driver import Setting, choice, number, switch
from motoremi.bench.receiver import EmiReceiver, ScanSettings
from motoremi.data.spectrum import Spectrum
from motoremi.errors import InstrumentError


def scan_edges(low_hz: float, high_hz: float) -> tuple[Setting[float], Setting[float]]:
    """First and last frequency of the scan table."""
    return (
        number("SCAN1:STAR", "Hz", (low_hz, high_hz), "Control the first frequency of the scan."),
        number("SCAN1:STOP", "Hz", (low_hz, high_hz), "Control the last frequency of the scan."),
    )


class RohdeSchwarzESR(EmiReceiver):
    """The ESR by its scan table; sources: ESR user manual, remote commands of the receiver application.

    Drivers of related receivers are in `motoremi.instruments.rohde_schwarz_receivers`. docs/instruments.md lists the source of each command.
    """

    name: ClassVar[str] = "esr"
    model = r"ESR\d*"
    error_query = "SYST:ERR?"
    safe_commands = ("ABOR", "INIT2:CONT OFF", "INP:ATT:PROT ON")
    start_command = "INIT2"

    start_hz, stop_hz = scan_edges(10.0, 26.5e9)
    step_hz = number("SCAN1:STEP", "Hz", (1.0, 1e9), "Control the step of the scan.")
    filter_shape = choice("BAND:TYPE", {"6 dB EMI": "PULS", "3 dB normal": "NORM"}, "Control the shape of the resolution filter.")
    resolution_bandwidth_hz = number("SCAN1:BAND:RES", "Hz", (10.0, 10e6), "Control the 6 dB resolution bandwidth.")
    dwell_s = number("SCAN1:TIME", "s", (50e-6, 100.0), "Control the measuring time at each step.")
    attenuation_db = number("SCAN1:INP:ATT", "dB", (0.0, 75.0), "Control the input attenuation.")
    # Read back with every scan, because another unit set by hand would falsify the levels silently.
    level_unit = choice("CALC:UNIT:POW", {"dBuV": "DBUV"}, "Control the unit of the levels.")
    preamplifier = switch("SCAN1:INP:GAIN:STAT", "Control the 20 dB preamplifier.")
    # A transducer factor that the receiver applies itself must not be applied again to its levels.
    own_correction = switch("CORR:TRAN", "Control whether the receiver applies a transducer factor by itself.")
    detector = choice(
        "DET1:REC",
        {"peak": "POS", "quasi-peak": "QPE", "average": "AVER", "cispr-average": "CAV", "rms-average": "CRMS"},
        "Control the detector of trace 1.",
    )

    # Bits of the questionable power register: RF overload, IF overload. Bit 1, underload, does not affect the levels.
    OVERLOAD: ClassVar[int] = 0b101
    # R&S marks a value that was not measured with 9.91E37.
    NOT_MEASURED: ClassVar[float] = 9e36

    def set_up(self, asked: ScanSettings) -> JsonDict:
        """Set up receiver mode and one range of the scan table; see `ScanSettings`."""
        self.tell("INST:SEL REC")
        self.own_correction = False
        self.level_unit = "dBuV"
        self.tell("DISP:WIND:TRAC1:MODE WRIT", "SWE:SPAC LIN", "SCAN:RANG:COUN 1")
        self.start_hz = asked.start_hz
        self.stop_hz = asked.stop_hz
        self.step_hz = asked.step_hz
        self.filter_shape = "6 dB EMI"
        self.resolution_bandwidth_hz = asked.resolution_bandwidth_hz
        self.dwell_s = asked.dwell_s
        self.tell("INP:ATT:PROT ON", "SCAN1:INP:ATT:AUTO OFF")
        self.attenuation_db = asked.attenuation_db
        self.preamplifier = False
        self.tell("TRAC:FEED:CONT ALW", "FORM ASC", "FORM:DEXP:DSEP POIN", "INIT2:CONT OFF")
        return self.settings()

    def switch_line(self, line: str) -> None:
        """Switch the LISN at the user port; the command is of a public catalogue of R&S receivers, unconfirmed by a manual page."""
        self.tell(f"INP:LISN:PHAS {line}")
        reported = self.ask("INP:LISN:PHAS?")
        if reported.strip() != line:
            raise InstrumentError(f"{self}: the LISN was switched to {line}, but reports {reported.strip()!r}")

    def scan(self, detector: str) -> Spectrum:
        """Scan once; an overload during the scan marks all its points, because the register does not show at which points it occurred.

        Raises
        ------
        InstrumentError
            If the scan does not end in time or the number of levels does not fit the scan table.
        """
        self.detector = detector
        settings = self.settings()
        frequency_hz = self._axis(settings)
        # `run_scan` begins with *CLS, which clears the event registers, so an overload found afterwards belongs to this scan.
        self.run_scan(10.0 + 3 * frequency_hz.size * float(settings["dwell_s"]))
        with self.transport.deadline(self.transfer_s(frequency_hz.size)):
            level_dbuv = self.read_levels("TRAC? TRACE1")
        if level_dbuv.size != frequency_hz.size:
            raise InstrumentError(f"{self}: received {level_dbuv.size} levels for a scan table of {frequency_hz.size} steps; was the scan stopped?")
        metadata = {"receiver": self.name, "resource": self.transport.resource_name, "settings": settings}
        overload = np.full(frequency_hz.shape, self._was_overloaded())
        return Spectrum(detector, frequency_hz, level_dbuv, float(settings["resolution_bandwidth_hz"]), overload, metadata)

    @staticmethod
    def _axis(settings: JsonDict) -> FloatArray:
        """The receiver sends levels only; the frequencies follow from the scan table as it reports it."""
        start, stop, step = settings["start_hz"], settings["stop_hz"], settings["step_hz"]
        # The small addition keeps a last step that rounding would lose.
        return start + step * np.arange(int((stop - start) / step + 1e-6) + 1)

    def read_levels(self, query: str) -> FloatArray:
        """Levels of a trace in dBuV."""
        answer = self.ask(query)
        try:
            levels = np.array([float(field) for field in answer.split(",")])
        except ValueError as error:
            raise InstrumentError(f"{self}: {answer[:40]!r} in answer to {query!r} is no list of levels") from error
        if not np.all(np.abs(levels) < self.NOT_MEASURED):
            raise InstrumentError(f"{self}: the scan holds points that were not measured; repeat it")
        return levels

    def _was_overloaded(self) -> bool:
        """Whether the input was overloaded during the scan (event) or still is (condition)."""
        bits = 0
        for query in ("STAT:QUES:POW:EVEN?", "STAT:QUES:POW:COND?"):
            bits |= int(float(self.ask(query)))
        return bool(bits & self.OVERLOAD)
