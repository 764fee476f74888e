"""Stations: single narrow lines from outside, such as radio broadcast, which are not caused by the motor or a chopper."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d, median_filter

from motoremi.arrays import BoolArray, FloatArray
from motoremi.emission.band import Band
from motoremi.emission.reading import Readings
from motoremi.emission.scatter import even_steps

# Least height of a station above its surroundings (number of points on either side), and the number of points within which it falls off.
_PROMINENT_DB = 5.0
_AROUND, _OVER = 20, 3
# More lines than these, near each other or in the whole span, are a comb.
_MOST_NEAR, _MOST = 4, 40


@dataclass(frozen=True)
class Station:
    """One station.

    Parameters
    ----------
    frequency_hz : float
    average_dbuv, peak_dbuv : float
        Levels without the surrounding noise; with modulation the peak is higher.
    """

    frequency_hz: float
    average_dbuv: float
    peak_dbuv: float


def find_stations(frequency_hz: FloatArray, levels_dbuv: Mapping[str, FloatArray], band: Band) -> tuple[Station, ...]:
    """The stations of a scan; none if the steps are too wide to recognise them.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
        In equal steps, apart from points that were left out.
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
    # The average is used, because with the peak detector a station may be below the level of the commutation.
    tops = np.flatnonzero(_prominent(average))
    near = np.array([np.sum(np.abs(tops - top) <= _AROUND) for top in tops])
    if tops.size > _MOST or np.any(near > _MOST_NEAR):
        return ()
    found = []
    fall_db = 6.02 * (2 * step / band.bandwidth_hz) ** 2
    for top in tops:
        offset = float(np.clip((average[top + 1] - average[top - 1]) / (4 * fall_db), -0.5, 0.5))
        around = slice(max(0, top - _AROUND), top + _AROUND)
        # A station adds to its surroundings in power with the average detector, in voltage with the peak detector.
        tuned_hz, beside_db = float(even_hz[top] + offset * step), fall_db * offset**2
        own_average = 10 * np.log10(10 ** (average[top] / 10) - 10 ** (np.median(average[around]) / 10))
        own_peak = 20 * np.log10(max(10 ** (peak[top] / 20) - 10 ** (np.median(peak[around]) / 20), 1e-9))
        found.append(Station(tuned_hz, float(own_average + beside_db), float(max(own_peak, own_average) + beside_db)))
    return tuple(found)


def _prominent(level_dbuv: FloatArray) -> BoolArray:
    """Points that are the highest nearby, well above their surroundings, and fall off as fast as the filter allows on at least one side."""
    inner = slice(_OVER, -_OVER)
    highest = maximum_filter1d(level_dbuv, 2 * _OVER - 1) == level_dbuv
    above = level_dbuv - median_filter(level_dbuv, size=2 * _AROUND + 1, mode="nearest") > _PROMINENT_DB
    narrow = np.zeros(level_dbuv.size, dtype=bool)
    beside = np.minimum(level_dbuv[: -2 * _OVER], level_dbuv[2 * _OVER :])
    narrow[inner] = level_dbuv[inner] - beside > _PROMINENT_DB - 1
    return np.asarray(highest & above & narrow)


def read_stations(frequency_hz: FloatArray, stations: tuple[Station, ...], band: Band) -> Readings:
    """Readings of the stations."""
    tuned = np.array([station.frequency_hz for station in stations])
    passed = np.exp(-((frequency_hz[:, None] - tuned) ** 2) / (2 * band.sigma_hz**2))
    average, peak = (
        np.sqrt(np.sum((1e-6 * 10 ** (np.array(level) / 20) * passed) ** 2, axis=1))
        for level in zip(*((station.average_dbuv, station.peak_dbuv) for station in stations), strict=True)
    )
    return Readings(peak, peak, average, average)
