"""The set-up of an emission test: source, path, receiver; from a TOML file or plain data."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path as File
from typing import Any, TypeAlias

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.data.corrections import Corrections
from motoremi.data.spectrum import Detector
from motoremi.data.text_file import show_name
from motoremi.data.toml_file import read_toml
from motoremi.emission.band import BAND_B, BANDS, Band
from motoremi.emission.commutation import Commutation, commutation_time
from motoremi.emission.path import LISN_50UH, Cable, Path, find_lisn
from motoremi.emission.reading import Readings
from motoremi.emission.receiver_formula import Background, Receiver
from motoremi.emission.source import Source, repetition_hz
from motoremi.emission.stations import Station, read_stations
from motoremi.errors import BadInput

# Frequencies in hertz, shape (n,) -> impedance in ohm.
MotorImpedance: TypeAlias = Callable[[FloatArray], ComplexArray]
# Number of cached results: while slopes with respect to the parameters of path and chopper are computed one after the other, the values at the
# starting point stay in the cache.
REMEMBERED = 16


@dataclass(frozen=True, eq=False)
class Ambient:
    """Levels with the motor off.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
    average_dbuv, peak_dbuv : ndarray, shape (n,)
        Measured with the motor off; they include the receiver's own noise.
    """

    frequency_hz: FloatArray
    average_dbuv: FloatArray
    peak_dbuv: FloatArray


@dataclass(frozen=True)
class Setup:
    """Source, path and receiver with which spectra are measured or predicted.

    Parameters
    ----------
    source : Source
    path : Path
    receiver : Receiver
    floor_dbuv : float, optional
        Average reading of the receiver's noise, if it was measured.
    broadband_dbuv, broadband_slope_db : float, optional
        Ambient noise at 1 MHz with the average detector, and its decrease in dB per decade.
    stations : tuple of Station
        Broadcast stations in the ambient noise.
    ambient : Ambient, optional
        Levels with the motor off.
    corrections : Corrections
        Corrections for the parts in front of the receiver. Levels are corrected ones, so the correction is added to the receiver's own noise.
    assumed : tuple of str
        Parts of the set-up that were not stated.
    """

    source: Source = field(default_factory=Source)
    path: Path = field(default_factory=Path)
    receiver: Receiver = field(default_factory=Receiver)
    floor_dbuv: float | None = None
    broadband_dbuv: float | None = None
    broadband_slope_db: float = 0.0
    stations: tuple[Station, ...] = ()
    ambient: Ambient | None = None
    corrections: Corrections = field(default_factory=Corrections)
    assumed: tuple[str, ...] = ("source", "cable", "receiver")

    def levels(self, frequency_hz: FloatArray, motor_ohm: ComplexArray, weigh: bool = True) -> dict[Detector, FloatArray]:
        """Predicted levels in dBuV of all detectors.

        Parameters
        ----------
        frequency_hz : ndarray, shape (n,)
        motor_ohm : ndarray of complex, shape (n,)
            Z_open (common mode) or Z_short (differential mode).
        weigh : bool
            Whether to compute the quasi-peak levels, which take most of the time; without it they are left out.
        """
        return LevelModel(frequency_hz, motor_ohm, weigh).levels(self)

    def noise(self, frequency_hz: FloatArray) -> Readings:
        """What the receiver reads with the motor off: as measured, and its own noise where that was not measured."""
        own = self._own_noise(frequency_hz)
        if self.ambient is None:
            return self.receiver.noise(own)
        known = self.ambient
        measured = (frequency_hz >= known.frequency_hz[0]) & (frequency_hz <= known.frequency_hz[-1])
        average, peak = (np.interp(frequency_hz, known.frequency_hz, level) for level in (known.average_dbuv, known.peak_dbuv))
        found = self.receiver.noise(np.where(measured, average, own))
        return replace(found, peak=np.where(measured, 1e-6 * 10 ** (peak / 20), found.peak))

    def _own_noise(self, frequency_hz: FloatArray) -> FloatArray:
        """Average level of the receiver's noise, with a broadband ambient if one is known, in dBuV."""
        floor = np.full(frequency_hz.shape, self.receiver.floor_dbuv if self.floor_dbuv is None else self.floor_dbuv)
        floor = floor + self.corrections.added_db("receiver", frequency_hz)
        if self.broadband_dbuv is not None:
            ambient = self.broadband_dbuv - self.broadband_slope_db * np.log10(frequency_hz / 1e6)
            floor = 10 * np.log10(10 ** (floor / 10) + 10 ** (ambient / 10))
        return floor

    def to_dict(self) -> JsonDict:
        """Plain data, SI units; `from_dict` reads it back. Ambient levels and corrections are not included: they are in the session."""
        cable = self.path.cable
        path: JsonDict = {"lisn": self.path.lisn.name, "mode": self.path.mode, "stray_f": self.path.stray_f}
        if cable is not None:
            path["cable"] = dict(vars(cable))
        keys = ("noise_figure_db", "attenuation_db", "preamplifier", "dwell_s")
        return {
            "source": self.source.to_dict(),
            "path": path,
            "receiver": {"band": self.receiver.band.name, **{key: getattr(self.receiver, key) for key in keys}},
            "floor_dbuv": self.floor_dbuv,
            "assumed": list(self.assumed),
        }

    @classmethod
    def from_dict(cls, content: JsonDict) -> Setup:
        """From plain data or the content of a set-up file.

        Tables: `source` (fields of `Source`, or `speed_rpm`, `segments`, `interleaved` instead of `repetition_hz`), `commutation`
        (fields of `Commutation`, or `brush_width_m`, `commutator_diameter_m` and the speed instead of `time_s`), `path` (`lisn`, `mode`,
        `stray_f`, `cable`), `receiver` (fields of `Receiver`).

        Raises
        ------
        BadInput
            For an unknown name or a value out of range.
        """
        unknown = set(content) - {"source", "commutation", "path", "receiver", "floor_dbuv", "assumed"}
        if unknown:
            raise BadInput(f"the set-up has no {', '.join(sorted(unknown))}; it has source, commutation, path, receiver, floor_dbuv")
        assumed = [part for part in ("source", "path", "receiver") if part not in content]
        try:
            floor = content.get("floor_dbuv")
            return cls(
                _source(dict(content.get("source", {})), content.get("commutation")),
                _path(dict(content.get("path", {}))),
                _receiver(dict(content.get("receiver", {}))),
                None if floor is None else float(floor),
                assumed=tuple(content.get("assumed", assumed)),
            )
        except BadInput:
            raise
        except (TypeError, ValueError) as error:
            raise BadInput(f"the set-up cannot be read: {error}") from error


class LevelModel:
    """Predicted levels at fixed frequencies with a fixed motor, for many set-ups: what several of them have in common is computed once.

    A fit changes one parameter at a time to get its slopes; most of them leave the path and the chopper's comb, which cost the most, as they are.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
    motor_ohm : ndarray of complex, shape (n,)
    weigh : bool
        As in `Setup.levels`.
    """

    def __init__(self, frequency_hz: FloatArray, motor_ohm: ComplexArray, weigh: bool = True) -> None:
        self._frequency_hz, self._motor_ohm, self._weigh = frequency_hz, motor_ohm, weigh
        self._transfer = lru_cache(REMEMBERED)(self._new_transfer)
        self._steady = lru_cache(REMEMBERED)(self._new_steady)
        self._background = lru_cache(REMEMBERED)(self._new_background)

    def levels(self, setup: Setup) -> dict[Detector, FloatArray]:
        """Levels in dBuV of all detectors."""
        source = setup.source
        background = self._background(replace(setup, source=Source(chopper=source.chopper, high_pass=source.high_pass)))
        return setup.receiver.read_over(background, source, self._frequency_hz, self._transfer(setup.path), self._weigh)

    def _new_transfer(self, path: Path) -> ComplexArray:
        return path.transfer(self._frequency_hz, self._motor_ohm)

    def _new_background(self, setup: Setup) -> Background:
        return Background.of(self._steady(setup.receiver, setup.source, setup.path, setup.stations), setup.noise(self._frequency_hz))

    def _new_steady(self, receiver: Receiver, source: Source, path: Path, stations: tuple[Station, ...]) -> Readings | None:
        lines = read_stations(self._frequency_hz, stations, receiver.band) if stations else None
        return receiver.steady(source, self._frequency_hz, self._transfer(path), lines, self._weigh)


def _source(values: dict[str, Any], commutation: JsonDict | None) -> Source:
    speed = values.pop("speed_rpm", None)
    if speed is not None:
        if "segments" not in values:
            raise BadInput("the source has speed_rpm but not segments: both are needed for the repetition")
        values["repetition_hz"] = repetition_hz(float(speed), int(values.pop("segments")), bool(values.pop("interleaved", False)))
    if commutation is None:
        return Source.from_dict(values)
    given = dict(commutation)
    if "brush_width_m" in given:
        if speed is None:
            raise BadInput("the commutation time from the brush's width needs the source's speed_rpm too")
        given["time_s"] = commutation_time(float(given.pop("brush_width_m")), float(given.pop("commutator_diameter_m")), float(speed))
    coil = Commutation(**{name: float(value) for name, value in given.items()})
    made = Source.of(coil, float(values.get("repetition_hz", Source().repetition_hz)))
    return Source.from_dict({**made.to_dict(), **values})


def _path(values: dict[str, Any]) -> Path:
    lisn = find_lisn(str(values.pop("lisn", LISN_50UH.name)))
    cable = values.pop("cable", None)
    return Path(lisn, None if cable is None else Cable(**{name: float(value) for name, value in cable.items()}), **values)


def _receiver(values: dict[str, Any]) -> Receiver:
    name = str(values.pop("band", "B"))
    band = next((band for band in BANDS if band.name == name), None)
    if band is None:
        raise BadInput(f"unknown band {name!r}: use A or B")
    return Receiver(band, **values)


def read_setup(path: str | File) -> Setup:
    """A set-up from a TOML file.

    Raises
    ------
    BadInput
        If it cannot be read.
    """
    shown = show_name(path)
    try:
        return Setup.from_dict(read_toml(path))
    except BadInput as error:
        raise BadInput(f"{shown}: {error}" if shown not in str(error) else str(error)) from error


def scan_frequencies(band: Band = BAND_B) -> FloatArray:
    """The usual scan of a band in steps of half the bandwidth: 150 kHz to 30 MHz in 4.5 kHz."""
    low, high = band.span_hz
    step = band.bandwidth_hz / 2
    return np.asarray(low + step * np.arange(int((high - low) / step + 1e-9) + 1), dtype=np.float64)
