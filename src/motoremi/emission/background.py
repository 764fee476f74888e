"""Spectra that were measured with the motor off, and their subtraction from the others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from motoremi.arrays import BoolArray, FloatArray
from motoremi.data.spectrum import Spectrum
from motoremi.emission.setup import Ambient

# Repeatability of the receiver; a smaller rise above the background is not significant.
REPEATABILITY_DB = 1.0
# Difference assumed for the detector that was not measured with the motor off: that of noise with a dwell of 50 ms.
_PEAK_ABOVE_AVERAGE_DB = 9.0


def split(spectra: Sequence[Spectrum]) -> tuple[list[Spectrum], list[Spectrum]]:
    """Spectra of the running motor, and of the background."""
    return [s for s in spectra if not s.is_background], [s for s in spectra if s.is_background]


def ambient_of(background: Sequence[Spectrum]) -> Ambient | None:
    """The background as the model needs it, or None if it was not measured."""
    by_detector = {spectrum.detector: spectrum for spectrum in background}
    average, peak = by_detector.get("average"), by_detector.get("peak")
    if average is None and peak is None:
        return None
    first = average if average is not None else peak
    assert first is not None
    grid = first.frequency_hz
    average_dbuv = first.level_dbuv if average is not None else first.level_dbuv - _PEAK_ABOVE_AVERAGE_DB
    peak_dbuv = average_dbuv + _PEAK_ABOVE_AVERAGE_DB
    if peak is not None:
        measured = (grid >= peak.frequency_hz[0]) & (grid <= peak.frequency_hz[-1])
        peak_dbuv = np.where(measured, np.interp(grid, peak.frequency_hz, peak.level_dbuv), peak_dbuv)
    return Ambient(grid, np.asarray(average_dbuv), np.asarray(peak_dbuv))


def subtract(level_dbuv: FloatArray, background_dbuv: FloatArray, uncertainty_db: float = REPEATABILITY_DB) -> tuple[FloatArray, BoolArray]:
    """Levels with the background subtracted in power.

    Parameters
    ----------
    level_dbuv, background_dbuv : ndarray, shape (n,)
        Levels of one detector at the same frequencies.
    uncertainty_db : float
        Variation of the background from one scan to the next.

    Returns
    -------
    ndarray, shape (n,)
        In dBuV; not below the level that this variation could cause.
    ndarray of bool, shape (n,)
        Points at which only this upper bound is known.
    """
    background = 10 ** (background_dbuv / 10)
    least = background * (10 ** (uncertainty_db / 10) - 1)
    left = 10 ** (level_dbuv / 10) - background
    return 10 * np.log10(np.maximum(left, least)), np.asarray(left <= least)
