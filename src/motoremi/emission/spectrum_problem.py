"""Data of a fit of spectra: the points that are used, their uncertainty, and the set-up that belongs to a set of parameter values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.kernels import nearest_points, steps_beside
from motoremi.data.spectrum import Spectrum
from motoremi.emission.scatter import ripple_columns, scatter_db
from motoremi.emission.setup import REMEMBERED, Ambient, LevelModel, MotorImpedance, Setup
from motoremi.emission.source_effects import changed, find_source_effect
from motoremi.emission.stations import Station, find_stations
from motoremi.errors import BadInput
from motoremi.model.parameter import Parameter

# Points of each detector that a fit uses: all below this frequency, where the lines of combs are resolved, and this number above; if there are more
# than twice that number below, a part of them at equal distances.
ALL_BELOW_HZ = 1.2e6
POINTS_ABOVE = 260
# Error of the formulas compared with the time domain, without its part that is smooth along frequency.
_MODEL_DB = {"peak": 0.25, "quasi-peak": 0.25, "average": 0.15, "cispr-average": 0.15, "rms-average": 0.15}
# Relative uncertainty of the frequencies of the motor's resonances.
_DETUNING = 0.004

BASE: tuple[tuple[Parameter, float | None], ...] = (
    (Parameter("step_v", "V", 0.05, 4.0, "drop of a carbon brush, below the least voltage of an arc"), None),
    (Parameter("rise_s", "s", 5e-8, 5e-6, "time in which a segment leaves the brush"), None),
    (Parameter("floor_dbuv", "dBuV", -30.0, 12.0, "of the receiver, average; expected from noise figure and attenuator", scale="linear"), 8.0),
    (Parameter("offset_db", "dB", -4.0, 4.0, "error of the receiver", scale="linear"), 0.8),
    (Parameter("speed_factor", "", 0.9, 1.1, "true speed over the stated one"), 0.015),
    (Parameter("lisn_factor", "", 0.7, 1.4, "choke within its tolerance"), 0.08),
)


class Problem:
    """Measured spectra, the motor, and the set-up as stated.

    Parameters
    ----------
    spectra : sequence of Spectrum
        Spectra of the running motor; several of one detector at one frequency are averaged.
    motor : callable
        Impedance of the motor for the source.
    setup : Setup
    ambient : Ambient, optional
        Levels with the motor off.

    Raises
    ------
    BadInput
        If there is no usable spectrum.
    """

    def __init__(self, spectra: Sequence[Spectrum], motor: MotorImpedance, setup: Setup, ambient: Ambient | None = None) -> None:
        if not spectra:
            raise BadInput("there is no spectrum of the running motor to compare with")
        self.setup, self.ambient = replace(setup, ambient=None), ambient
        grid, whole = _common(spectra)
        if grid.size < 30:
            raise BadInput(f"{grid.size} points that are not overloaded, measured with every detector, are too few to say which effect is missing")
        self.detectors = tuple(whole)
        self.stations = find_stations(grid, whole, setup.receiver.band)
        chosen = _chosen(grid, self.stations)
        self.grid_hz = grid[chosen]
        self.measured_dbuv = np.concatenate([level[chosen] for level in whole.values()])
        self.frequency_hz = np.tile(self.grid_hz, len(self.detectors))
        size = self.grid_hz.size
        self.where = {detector: slice(index * size, (index + 1) * size) for index, detector in enumerate(self.detectors)}
        self.motor_ohm: ComplexArray = np.asarray(motor(self.grid_hz), dtype=np.complex128)
        self._model = LevelModel(self.grid_hz, self.motor_ohm, "quasi-peak" in self.where)
        # The receiver's offset, one of the parameters that slopes are taken of, is not part of what is predicted.
        self._predicted = lru_cache(REMEMBERED)(self._new_prediction)
        self.sigma_db = self._sigma(np.concatenate([scatter_db(level)[chosen] for level in whole.values()]))
        self.ripple = ripple_columns(self.grid_hz, len(self.detectors))
        self.grid = grid
        self.whole = whole

    def _sigma(self, scatter: FloatArray) -> FloatArray:
        transfer_db = 20 * np.log10(np.abs(self.setup.path.transfer(self.grid_hz, self.motor_ohm)))
        slope = np.abs(np.gradient(transfer_db, np.log(self.grid_hz))) * _DETUNING
        formula = np.concatenate([np.hypot(_MODEL_DB[detector], slope) for detector in self.detectors])
        return np.hypot(scatter, formula)

    @cached_property
    def repetition_known(self) -> bool:
        """Whether speed and segments, or the repetition, were stated."""
        return "source" not in self.setup.assumed

    def parameters(self, effects: Sequence[str]) -> list[tuple[Parameter, float | None]]:
        """Unknown parameters, each with the standard deviation of its prior or None."""
        found = [(p, (None if p.name == "speed_factor" and not self.repetition_known else sigma)) for p, sigma in BASE]
        if not self.repetition_known:
            found = [(replace(p, low=0.05, high=20.0) if p.name == "speed_factor" else p, sigma) for p, sigma in found]
        for name in effects:
            if name == "background-noise" and self.ambient is not None:
                continue
            found += [(replace(p, name=f"{name}.{p.name}"), None) for p in find_source_effect(name).parameters]
        return found

    def setup_for(self, effects: Sequence[str], values: Mapping[str, float]) -> Setup:
        """The set-up with these effects and parameter values."""
        stated = self.setup
        source = replace(
            stated.source,
            step_v=values["step_v"],
            rise_s=values["rise_s"],
            repetition_hz=stated.source.repetition_hz * values["speed_factor"],
        )
        path = replace(stated.path, lisn=stated.path.lisn.deviating(values["lisn_factor"]))
        ambient = self.ambient if "background-noise" in effects else None
        setup = replace(stated, source=source, path=path, floor_dbuv=values["floor_dbuv"], ambient=ambient)
        if "background-noise" in effects and ambient is None:
            setup = replace(setup, stations=self.stations)
        return changed(setup, [name for name in effects if not (name == "background-noise" and ambient is not None)], values)

    def error(self, effects: Sequence[str], values: Mapping[str, float]) -> FloatArray:
        """Measured minus model in dB."""
        others = tuple((name, value) for name, value in values.items() if name != "offset_db")
        return self.measured_dbuv - self._predicted(tuple(effects), others) - values["offset_db"]

    def _new_prediction(self, effects: tuple[str, ...], values: tuple[tuple[str, float], ...]) -> FloatArray:
        levels = self._model.levels(self.setup_for(effects, dict(values)))
        return np.concatenate([levels[detector] for detector in self.where])  # type: ignore[index]


def _common(spectra: Sequence[Spectrum]) -> tuple[FloatArray, dict[str, FloatArray]]:
    """The frequencies of the first detector that were measured with every detector, and the mean level of each detector there."""
    by_detector: dict[str, list[Spectrum]] = {}
    for spectrum in spectra:
        by_detector.setdefault(spectrum.detector, []).append(spectrum)
    first = next(iter(by_detector.values()))
    grid = np.unique(np.concatenate([spectrum.frequency_hz[~spectrum.overload] for spectrum in first]))
    whole = {detector: _mean_level(own, grid) for detector, own in by_detector.items()}
    known = np.all(np.isfinite(list(whole.values())), axis=0)
    return grid[known], {detector: level[known] for detector, level in whole.items()}


def _mean_level(spectra: Sequence[Spectrum], grid_hz: FloatArray) -> FloatArray:
    """Mean of the spectra that were measured at each frequency; NaN where none was."""
    levels = np.array([_level_at(spectrum, grid_hz) for spectrum in spectra])
    measured = np.isfinite(levels)
    count = measured.sum(axis=0)
    total = np.where(measured, levels, 0.0).sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _level_at(spectrum: Spectrum, grid_hz: FloatArray) -> FloatArray:
    """Level by interpolation; NaN where the nearest point that is not overloaded is more than a step away."""
    usable = ~spectrum.overload
    frequency = spectrum.frequency_hz[usable]
    if frequency.size < 2:
        return np.full(grid_hz.shape, np.nan)
    step = np.maximum(*steps_beside(spectrum.frequency_hz))[usable]
    nearest = nearest_points(frequency, grid_hz)
    near = np.abs(frequency[nearest] - grid_hz) <= step[nearest]
    return np.where(near, np.interp(grid_hz, frequency, spectrum.level_dbuv[usable]), np.nan)


def _chosen(grid: FloatArray, stations: Sequence[Station]) -> NDArray[np.intp]:
    low = np.flatnonzero(grid <= ALL_BELOW_HZ)
    high = np.flatnonzero(grid > ALL_BELOW_HZ)
    if high.size > POINTS_ABOVE:
        high = high[np.unique(np.searchsorted(grid[high], np.geomspace(grid[high[0]], grid[high[-1]], POINTS_ABOVE)).clip(0, high.size - 1))]
    if low.size > 2 * POINTS_ABOVE:
        low = low[:: low.size // POINTS_ABOVE]
    tops = np.searchsorted(grid, [station.frequency_hz for station in stations])
    beside = (tops[:, None] + np.arange(-2, 3)).ravel().clip(0, grid.size - 1)
    return np.unique(np.concatenate([low, high, beside])).astype(np.intp)
