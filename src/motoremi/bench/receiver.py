"""What every EMI receiver can do."""

from __future__ import annotations

import abc

from motoremi.arrays import JsonDict
from motoremi.bench.driver import Driver
from motoremi.data.spectrum import Spectrum


class EmiReceiver(Driver):
    """A receiver that scans conducted emission with CISPR detectors."""

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
        detector : {"peak", "quasi-peak", "average", "rms-average"}
        """
