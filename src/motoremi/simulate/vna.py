"""The simulated reflection measurement of a handheld network analyser.

It has three error terms, smooth in frequency and constant until the next calibration, and noise. If it is calibrated at its connector, they are
the residual errors of low-cost standards; if it sends raw data, they are those of its bridge. The sizes are estimates from publications of
users, not from a data sheet.
"""

from __future__ import annotations

import zlib
from functools import lru_cache

import numpy as np
from scipy.interpolate import PchipInterpolator

from motoremi.arrays import ComplexArray, FloatArray

REFERENCE_OHM = 50.0
# Directivity, match and tracking.
CALIBRATED = (2e-3, 5e-3, 3e-3)
RAW = (0.05, 0.05, 0.1)
# Noise of S11 at 1 kHz bandwidth; it grows with the root of the bandwidth.
_NOISE = 1e-4
# Of an error term, over ln(frequency in hertz).
_KNOTS = 5
_SPAN = (float(np.log(5e4)), float(np.log(3e8)))


class SimulatedVna:
    """A one-port network analyser with its error terms.

    Parameters
    ----------
    seed : int
    errors : (float, float, float)
        Sizes of directivity, match and tracking.
    """

    def __init__(self, seed: int, errors: tuple[float, float, float] = CALIBRATED) -> None:
        self.seed = seed
        self._errors = errors
        self._noise = np.random.default_rng([seed, zlib.crc32(b"vna noise")])

    def reflection(self, frequency_hz: FloatArray, impedance_ohm: ComplexArray, bandwidth_hz: float) -> ComplexArray:
        """The measured S11.

        Parameters
        ----------
        frequency_hz : ndarray, shape (n,)
        impedance_ohm : ndarray of complex, shape (n,)
            True impedance at the connector.
        bandwidth_hz : float
        """
        true = (impedance_ohm - REFERENCE_OHM) / (impedance_ohm + REFERENCE_OHM)
        place = np.clip(np.log(frequency_hz), *_SPAN)
        directivity, match, tracking = (
            size * (term[0] + 1j * term[1])
            for size, term in zip(self._errors, (_smooth(self.seed, name)(place) for name in ("directivity", "match", "tracking")), strict=True)
        )
        shown = directivity + (1 + tracking) * true / (1 - match * true)
        parts = self._noise.standard_normal((2, frequency_hz.size))
        return shown + _NOISE * np.sqrt(bandwidth_hz / 1e3) * (parts[0] + 1j * parts[1])


# A firmware that scans in pieces asks for the same terms many times in a sweep.
@lru_cache(maxsize=12)
def _smooth(seed: int, name: str) -> PchipInterpolator:
    """Real and imaginary part of an error term of size one over ln(frequency)."""
    rng = np.random.default_rng([seed, zlib.crc32(f"vna {name}".encode())])
    return PchipInterpolator(np.linspace(*_SPAN, _KNOTS), rng.standard_normal((2, _KNOTS)), axis=1)
