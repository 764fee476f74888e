"""The bands of CISPR 16-1-1: bandwidth at -6 dB and the time constants of the weighting detectors."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from motoremi.arrays import BoolArray, FloatArray
from motoremi.errors import BadInput


@dataclass(frozen=True)
class Band:
    """One band.

    Parameters
    ----------
    name : str
    span_hz : tuple of float
    bandwidth_hz : float
        Bandwidth at -6 dB.
    charge_s, discharge_s, meter_s : float
        Time constants of the quasi-peak detector; the critically damped meter is common to all weighting detectors.
    rms_corner_hz : float
        Corner frequency of the RMS-average detector.
    """

    name: str
    span_hz: tuple[float, float]
    bandwidth_hz: float
    charge_s: float
    discharge_s: float
    meter_s: float
    rms_corner_hz: float

    def accepts(self, resolution_bandwidth_hz: float) -> bool:
        """Whether a bandwidth is that of this band, within its tolerance."""
        return abs(resolution_bandwidth_hz / self.bandwidth_hz - 1) <= BANDWIDTH_TOLERANCE

    @property
    def sigma_hz(self) -> float:
        """Standard deviation of the Gaussian filter that approximates the intermediate-frequency filter."""
        return self.bandwidth_hz / (2 * math.sqrt(2 * math.log(2)))

    @property
    def impulse_bandwidth_hz(self) -> float:
        """Peak of the envelope divided by the density of an impulse; 1.06 times the bandwidth for a Gaussian filter (usual value: 1.05)."""
        return self.sigma_hz * math.sqrt(2 * math.pi)

    @property
    def noise_bandwidth_hz(self) -> float:
        """Bandwidth of the rectangular filter that passes the same noise power."""
        return self.sigma_hz * math.sqrt(math.pi)

    @property
    def pulse_sigma_s(self) -> float:
        """Standard deviation of the Gaussian envelope of an impulse behind the filter."""
        return 1 / (2 * math.pi * self.sigma_hz)


# Corner frequencies of the RMS-average detector: manual of an R&S ESR. The meter's 160 ms for it and for the average: not confirmed.
BAND_A = Band("A", (9e3, 150e3), 200.0, 45e-3, 500e-3, 160e-3, 10.0)
BAND_B = Band("B", (150e3, 30e6), 9e3, 1e-3, 160e-3, 160e-3, 100.0)
BANDS = (BAND_A, BAND_B)
# Bands C and D: detectors there are not computed, only their bandwidth is compared. Time constants from memory, not checked against the standard.
ABOVE_BAND_B = Band("C and D", (30e6, 1e9), 120e3, 1e-3, 550e-3, 100e-3, 100.0)

# Increase of level, in dB, that a pulse train of another rate needs for the same quasi-peak reading as at 25 Hz (band A) or 100 Hz (band B).
# Pulse table of CISPR 16-1-1 from memory, not checked against the standard.
PULSE_TABLE_DB = {
    "A": {100.0: -4.0, 60.0: -3.0, 25.0: 0.0, 10.0: 4.0, 5.0: 7.5, 2.0: 13.0, 1.0: 17.0},
    "B": {1000.0: -4.5, 100.0: 0.0, 20.0: 6.5, 10.0: 10.0, 2.0: 20.5, 1.0: 22.5},
}
# Impulse area (EMF, V s) with the quasi-peak reading of a sine of 66 dBuV EMF (60 dBuV at the input) at the reference rate; not confirmed.
REFERENCE_PULSE_VS = {"A": 13.5e-6, "B": 0.316e-6}

# Deviation of a bandwidth from the nominal one: 8 to 10 kHz in band B and 180 to 220 Hz in band A, CISPR 16-1-1 from memory, not checked against
# the standard. Spectrum analysers without EMI filters have 10 kHz.
BANDWIDTH_TOLERANCE = 0.12


def band_of(resolution_bandwidth_hz: float) -> Band:
    """The band that a bandwidth belongs to.

    Raises
    ------
    BadInput
        If no band has that bandwidth.
    """
    for band in BANDS:
        if band.accepts(resolution_bandwidth_hz):
            return band
    known = ", ".join(f"{band.bandwidth_hz:g} Hz (band {band.name})" for band in BANDS)
    raise BadInput(f"a resolution bandwidth of {resolution_bandwidth_hz:g} Hz belongs to no known band: {known}")


def band_at(frequency_hz: float) -> Band:
    """The band of a frequency; the nearest one outside of all."""
    return min((*BANDS, ABOVE_BAND_B), key=lambda band: max(band.span_hz[0] / frequency_hz, frequency_hz / band.span_hz[1]))


def misread(frequency_hz: FloatArray, resolution_bandwidth_hz: float, low: bool) -> BoolArray:
    """Points at which a bandwidth is too narrow for the band, so that it reads too low (`low`), or too wide.

    At a common end of two bands either bandwidth is right; outside of all bands any.
    """
    wrong, right = np.zeros((2, *frequency_hz.shape), dtype=np.bool_)
    for band in (*BANDS, ABOVE_BAND_B):
        inside = (frequency_hz >= band.span_hz[0]) & (frequency_hz <= band.span_hz[1])
        if not band.accepts(resolution_bandwidth_hz) and (resolution_bandwidth_hz < band.bandwidth_hz) == low:
            wrong |= inside
        else:
            right |= inside
    return wrong & ~right
