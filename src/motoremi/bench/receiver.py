"""Base class of the drivers of EMI receivers."""

from __future__ import annotations

import abc
from dataclasses import dataclass
from typing import ClassVar

from motoremi.arrays import JsonDict
from motoremi.bench.driver import Driver
from motoremi.data.spectrum import Spectrum
from motoremi.errors import BadInput
from motoremi.quantities import show


@dataclass(frozen=True)
class ScanSettings:
    """Settings of a scan.

    Parameters
    ----------
    start_hz, stop_hz, step_hz : float
        Scan range and step in hertz.
    resolution_bandwidth_hz : float
        6 dB bandwidth in hertz.
    dwell_s : float
        Measuring time at each step in seconds.
    attenuation_db : float
        Input attenuation in dB.
    """

    start_hz: float
    stop_hz: float
    step_hz: float
    resolution_bandwidth_hz: float
    dwell_s: float
    attenuation_db: float


class EmiReceiver(Driver):
    """A receiver that scans conducted emission with CISPR detectors.

    Attributes
    ----------
    start_command : str
        Command that starts a scan and returns at once.
    """

    start_command: ClassVar[str]
    # The resolution bandwidth of `configure`, if none is given.
    USUAL_BANDWIDTH_HZ: ClassVar[float] = 9e3

    @classmethod
    def detectors(cls) -> tuple[str, ...]:
        """The detectors that it has; an instrument without a setting for it has the peak detector."""
        setting = cls.table().get("detector")
        return tuple(setting.words) if setting is not None else ("peak",)

    def configure(
        self,
        start_hz: float,
        stop_hz: float,
        step_hz: float,
        resolution_bandwidth_hz: float | None = None,
        dwell_s: float = 0.05,
        attenuation_db: float = 10.0,
    ) -> JsonDict:
        """Set the scan up and return the settings as the instrument reports them; parameters as in `ScanSettings`."""
        bandwidth_hz = self.USUAL_BANDWIDTH_HZ if resolution_bandwidth_hz is None else resolution_bandwidth_hz
        return self.set_up(ScanSettings(start_hz, stop_hz, step_hz, bandwidth_hz, dwell_s, attenuation_db))

    def set_up(self, asked: ScanSettings) -> JsonDict:
        """Set the scan up and return the settings as the instrument reports them; every driver defines this, or `configure`."""
        raise NotImplementedError

    def refuse_step(self, asked: ScanSettings, lowest_hz: float = 0.0) -> None:
        """Raise `BadInput` for a step that is 0, below `lowest_hz`, or wider than the range of the scan."""
        widest_hz = asked.stop_hz - asked.start_hz
        if not lowest_hz <= asked.step_hz <= widest_hz or asked.step_hz == 0:
            raise BadInput(f"{self}: step_hz = {show(asked.step_hz, 'Hz')} is outside the range {show(lowest_hz, 'Hz')} to {show(widest_hz, 'Hz')}")

    @abc.abstractmethod
    def scan(self, detector: str) -> Spectrum:
        """Scan once with one detector.

        Parameters
        ----------
        detector : {"peak", "quasi-peak", "average", "cispr-average", "rms-average"}
        """

    def switch_line(self, line: str) -> None:
        """Switch the LISN that the receiver controls to another line.

        Raises
        ------
        BadInput
            If this receiver controls no LISN.
        InstrumentError
            If the LISN does not follow.
        """
        raise BadInput(f'{self}: controls no LISN; write line_switch = "operator" in [spectrum], and switch to {line} by hand')

    def transfer_s(self, points: int) -> float:
        """Deadline in seconds for reading that many levels: GPIB, the slowest of the links, carries 10 000 numbers a second and more."""
        return self.transport.timeout_s + points / 10e3

    def run_scan(self, longest_s: float) -> None:
        """Scan, and wait for the end: by a service request where the link carries them, else by polling the event register.

        `*WAI` and `*OPC?` are not used: they delay every later message until the scan has ended, including the one that stops it. That a
        receiver answers `*ESR?` while it scans follows from IEEE 488.2 and the manuals on overlapped commands; unconfirmed on hardware.

        Raises
        ------
        InstrumentError
            If the scan does not end in time, or ends with an error.
        """
        self.tell("*CLS")
        self.request_service()
        self.transport.write(f"{self.start_command};*OPC")
        self.wait_until(self.is_operation_complete, self.start_command, longest_s)
