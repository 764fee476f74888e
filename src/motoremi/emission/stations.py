"""Stations: single narrow lines, such as broadcast that comes in over the mains, which no motor and no chopper makes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d, median_filter

from motoremi.arrays import BoolArray, FloatArray
from motoremi.emission.band import Band
from motoremi.emission.reading import Readings
from motoremi.emission.scatter import even_steps

# A station stands out from its surroundings (so many points either side), and is over so many points beside its top.
_STANDS_OUT_DB = 5.0
_AROUND, _OVER = 20, 3
# More lines than this near each other are a comb, more than that in the whole span as well.
_MOST_NEAR, _MOST = 4, 40


@dataclass(frozen=True)
class Station:
    """One line.

    Parameters
    ----------
    frequency_hz : float
    average_dbuv, peak_dbuv : float
        Without what it stands on; modulation lifts the peak.
    """

    frequency_hz: float
    average_dbuv: float
    peak_dbuv: float


def find_stations(frequency_hz: FloatArray, levels_dbuv: Mapping[str, FloatArray], band: Band) -> tuple[Station, ...]:
    """The stations of a scan; none where the steps are too wide to tell.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
        In equal steps but for points that were left out.
    levels_dbuv : mapping
        Detector -> levels at those frequencies.
    band : Band
    """
    if frequency_hz.size < 4 * _AROUND:
        return ()
    even_hz, step = even_steps(frequency_hz)
    if step > 0.6 * band.bandwidth_hz:
        return ()
    levels = {detector: np.interp(even_hz, frequency_hz, level) for detector, level in levels_dbuv.items()}
    average = levels.get("average", next(iter(levels.values())))
    peak = levels.get("peak", average)
    # On the peak a station may hide below the commutation.
    tops = np.flatnonzero(_stands_out(average))
    near = np.array([np.sum(np.abs(tops - top) <= _AROUND) for top in tops])
    if tops.size > _MOST or np.any(near > _MOST_NEAR):
        return ()
    found = []
    fall_db = 6.02 * (2 * step / band.bandwidth_hz) ** 2
    for top in tops:
        offset = float(np.clip((average[top + 1] - average[top - 1]) / (4 * fall_db), -0.5, 0.5))
        around = slice(max(0, top - _AROUND), top + _AROUND)
        # On the average it stands in power on its surroundings, on the peak in voltage.
        tuned_hz, beside_db = float(even_hz[top] + offset * step), fall_db * offset**2
        own_average = 10 * np.log10(10 ** (average[top] / 10) - 10 ** (np.median(average[around]) / 10))
        own_peak = 20 * np.log10(max(10 ** (peak[top] / 20) - 10 ** (np.median(peak[around]) / 20), 1e-9))
        found.append(Station(tuned_hz, float(own_average + beside_db), float(max(own_peak, own_average) + beside_db)))
    return tuple(found)


def _stands_out(level_dbuv: FloatArray) -> BoolArray:
    """Points that are the highest nearby, well above their surroundings, and on one side at least over as quickly as the filter allows."""
    inner = slice(_OVER, -_OVER)
    highest = maximum_filter1d(level_dbuv, 2 * _OVER - 1) == level_dbuv
    above = level_dbuv - median_filter(level_dbuv, size=2 * _AROUND + 1, mode="nearest") > _STANDS_OUT_DB
    narrow = np.zeros(level_dbuv.size, dtype=bool)
    beside = np.minimum(level_dbuv[: -2 * _OVER], level_dbuv[2 * _OVER :])
    narrow[inner] = level_dbuv[inner] - beside > _STANDS_OUT_DB - 1
    return np.asarray(highest & above & narrow)


def read_stations(frequency_hz: FloatArray, stations: tuple[Station, ...], band: Band) -> Readings:
    """What the detectors read of them."""
    tuned = np.array([station.frequency_hz for station in stations])
    passed = np.exp(-((frequency_hz[:, None] - tuned) ** 2) / (2 * band.sigma_hz**2))
    average, peak = (
        np.sqrt(np.sum((1e-6 * 10 ** (np.array(level) / 20) * passed) ** 2, axis=1))
        for level in zip(*((station.average_dbuv, station.peak_dbuv) for station in stations), strict=True)
    )
    return Readings(peak, peak, average, average)
