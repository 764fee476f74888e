"""Keysight N9038A/B MXE and N9048B PXE EMI receivers, and X-series analysers with the EMI application N6141, in the EMI receiver mode."""

from __future__ import annotations

from math import ceil
from typing import ClassVar

import numpy as np

from motoremi.arrays import FloatArray, JsonDict
from motoremi.bench.driver import choice, count, number, switch
from motoremi.bench.receiver import EmiReceiver, ScanSettings
from motoremi.data.spectrum import Spectrum
from motoremi.errors import InstrumentError


class KeysightMXE(EmiReceiver):
    """Keysight N9038A/B MXE and N9048B PXE EMI receivers, in the EMI receiver mode.

    By row 2 of the frequency scan table; source: commands of a public program, and the X-Series EMI manual's trace queries. Not tested
    with the instrument. Unconfirmed: that `TIME` is the time of the whole scan, the detector's header, and the bit that reports an overload.
    """

    name: ClassVar[str] = "mxe"
    model = r"N90(38|48)[AB]"
    error_query = ":SYST:ERR?"
    safe_commands = (":ABOR", ":INIT2:CONT OFF")
    start_command = ":INIT2:IMM"

    start_hz = number(":FSC:SCAN2:STAR", "Hz", (2.0, 44e9), "Control the first frequency of the scan.")
    stop_hz = number(":FSC:SCAN2:STOP", "Hz", (2.0, 44e9), "Control the last frequency of the scan.")
    points = count(":FSC:SCAN2:POIN", (2, 4_000_001), "Control the number of points of the scan.")
    resolution_bandwidth_hz = number(":FSC:SCAN2:BAND", "Hz", (1.0, 10e6), "Control the 6 dB resolution bandwidth.")
    scan_time_s = number(":FSC:SCAN2:TIME", "s", (1e-3, 40e3), "Control the time of the whole scan.")
    attenuation_db = number(":FSC:SCAN2:INP:ATT", "dB", (0.0, 70.0), "Control the input attenuation.")
    preamplifier = switch(":FSC:SCAN2:POW:GAIN", "Control the preamplifier.")
    # A reset keeps corrections. A correction that the instrument applies itself must not be applied again.
    own_correction = switch(":CORR:CSET:ALL:STAT", "Control whether the instrument applies amplitude corrections by itself.")
    detector = choice(
        ":FSC:DET:TRAC1",
        {"peak": "POS", "quasi-peak": "QPE", "average": "AVER", "cispr-average": "EAV", "rms-average": "RAV"},
        "Control the detector of trace 1.",
    )

    OTHER_ROWS: ClassVar[tuple[int, ...]] = (1, 3, 4, 5, 6, 7, 8, 9, 10)
    # Integers are thousandths of a dBm, whatever unit is displayed.
    DB_OF_ONE: ClassVar[float] = 1e-3
    DBUV_OF_0_DBM: ClassVar[float] = 106.98970004336019
    # Bit of the questionable integrity register: input overload.
    OVERLOAD: ClassVar[int] = 16

    def set_up(self, asked: ScanSettings) -> JsonDict:
        """Set up receiver mode and one row of the scan table; see `ScanSettings`.

        The instrument takes a number of points, so the step is `step_hz`, or slightly less to make the last point fall on `stop_hz`.
        """
        self.refuse_step(asked)
        points = ceil((asked.stop_hz - asked.start_hz) / asked.step_hz - 1e-9) + 1
        self.tell(":INST:SEL EMI", ":CONF:FSC", ":CAL:AUTO OFF", ":FSC:SEQ SCAN", ":INIT2:CONT OFF")
        self.tell(*(f":FSC:SCAN{row}:STAT OFF" for row in self.OTHER_ROWS), ":FSC:SCAN2:STAT ON")
        self.own_correction = False
        self.start_hz = asked.start_hz
        self.stop_hz = asked.stop_hz
        self.points = points
        self.resolution_bandwidth_hz = asked.resolution_bandwidth_hz
        self.scan_time_s = asked.dwell_s * points
        self.attenuation_db = asked.attenuation_db
        self.preamplifier = False
        self.tell(":TRAC1:FSC:TYPE WRIT", ":TRAC1:FSC:UPD ON", ":FORM:DATA INT,32", ":FORM:BORD SWAP")
        return self.settings()

    def scan(self, detector: str) -> Spectrum:
        """Scan once; an overload during the scan marks all its points, because the register does not show at which points it occurred.

        Raises
        ------
        InstrumentError
            If the scan does not end in time or the number of levels does not fit the scan table.
        """
        self.detector = detector
        settings = self.settings()
        frequency_hz = np.linspace(settings["start_hz"], settings["stop_hz"], settings["points"])
        self.run_scan(10.0 + 3 * float(settings["scan_time_s"]))
        with self.transport.deadline(self.transfer_s(frequency_hz.size)):
            level_dbuv = self.read_levels()
        if level_dbuv.size != frequency_hz.size:
            raise InstrumentError(
                f"{self}: received {level_dbuv.size} levels for a scan table of {frequency_hz.size} points; was the scan stopped?"
            )
        metadata = {"receiver": self.name, "resource": self.transport.resource_name, "settings": settings}
        overload = np.full(frequency_hz.shape, self._was_overloaded())
        return Spectrum(detector, frequency_hz, level_dbuv, float(settings["resolution_bandwidth_hz"]), overload, metadata)

    def read_levels(self) -> FloatArray:
        """Levels of the trace in dBuV."""
        query = ":TRAC:FSC? TRACE1"
        block = self.transport.query_block(query)
        self.check_errors(query)
        if len(block) % 4:
            raise InstrumentError(f"{self}: the block in answer to {query!r} has {len(block)} bytes, not 4 for each level")
        return np.frombuffer(block, dtype="<i4") * self.DB_OF_ONE + self.DBUV_OF_0_DBM

    def _was_overloaded(self) -> bool:
        """Whether the input was overloaded during the scan (event) or still is (condition)."""
        bits = 0
        for query in (":STAT:QUES:INT:EVEN?", ":STAT:QUES:INT:COND?"):
            bits |= int(float(self.ask(query)))
        return bool(bits & self.OVERLOAD)


class KeysightN6141(KeysightMXE):
    """Keysight CXA, EXA, MXA, PXA and UXA with the EMI measurement application N6141.

    The frequency scan of the MXE; source: the application's manual for the EXA (N9010A), whose chapter on it has the same queries. Without
    a preselector strong pulses of a motor may drive the mixer at frequencies that are not displayed.
    """

    name = "n6141"
    model = r"N90([0123]0|21|4[01])[AB]"
