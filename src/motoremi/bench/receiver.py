"""What every EMI receiver can do."""

from __future__ import annotations

import abc
from typing import ClassVar

from motoremi.arrays import JsonDict
from motoremi.bench.driver import Driver
from motoremi.data.spectrum import Spectrum
from motoremi.errors import BadInput


class EmiReceiver(Driver):
    """A receiver that scans conducted emission with CISPR detectors.

    Attributes
    ----------
    start_command : str
        What starts a scan, and returns at once.
    """

    start_command: ClassVar[str]

    @classmethod
    def detectors(cls) -> tuple[str, ...]:
        """The detectors that it has; an instrument that lets none be chosen has the peak detector."""
        setting = cls.table().get("detector")
        return tuple(setting.words) if setting is not None else ("peak",)

    @abc.abstractmethod
    def configure(
        self,
        start_hz: float,
        stop_hz: float,
        step_hz: float,
        resolution_bandwidth_hz: float = 9e3,
        dwell_s: float = 0.05,
        attenuation_db: float = 10.0,
    ) -> JsonDict:
        """Set the scan up and return the settings as the instrument reports them.

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
        """Deadline for reading so many levels: GPIB, the slowest of the links, carries 10 000 numbers a second and more."""
        return self.transport.timeout_s + points / 10e3

    def run_scan(self, longest_s: float) -> None:
        """Scan, and wait for the end: for a service request where the link carries them, by polling the event register elsewhere.

        Never by `*WAI` or `*OPC?`: they hold up every later message until the scan has ended, the one that stops it too. That a receiver
        answers `*ESR?` while it scans is what IEEE 488.2 and the manuals say of overlapped commands; unconfirmed on hardware.

        Raises
        ------
        InstrumentError
            If the scan does not end in time, or ends with an error.
        """
        self.tell("*CLS")
        self.request_service()
        self.transport.write(f"{self.start_command};*OPC")
        self.wait_until(self.is_operation_complete, self.start_command, longest_s)
