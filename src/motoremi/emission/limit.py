"""Limits: one line for each detector, with segments, gaps and the source of its values."""

from __future__ import annotations

import math
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from motoremi.arrays import FloatArray, JsonDict
from motoremi.data.corrections import UNITS
from motoremi.data.spectrum import DETECTORS, Detector
from motoremi.data.text import clean_text
from motoremi.data.text_file import show_name
from motoremi.data.toml_file import parse_toml, read_toml
from motoremi.emission.band import BAND_A, BAND_B
from motoremi.errors import BadInput

# Keys of a limit's file and of each of its lines.
KEYS, LINE_KEYS = ("title", "port", "lisn", "note", "unit", "line"), ("detector", "segments", "confirmed", "source")
# No CISPR band begins below.
LOWEST_HZ = BAND_A.span_hz[0]
LEVEL_UNITS = tuple(dict.fromkeys(UNITS.values()))


@dataclass(frozen=True)
class LimitLine:
    """The limit for one detector.

    Parameters
    ----------
    detector : str
    segments : tuple of (low_hz, high_hz, level at low, level at high)
        Levels in dBuV, interpolated linearly over the logarithm of frequency. At a common end of two segments the lower level applies;
        between segments there is no limit.
    confirmed : bool
        Whether the values were checked against the standard or an equal public source.
    source : str
    """

    detector: Detector
    segments: tuple[tuple[float, float, float, float], ...]
    confirmed: bool
    source: str

    def level_dbuv(self, frequency_hz: FloatArray) -> FloatArray:
        """The limit at each frequency; NaN if there is none."""
        level = np.full(frequency_hz.shape, np.inf)
        for low, high, first, last in self.segments:
            inside = (frequency_hz >= low) & (frequency_hz <= high)
            share = np.log(frequency_hz[inside] / low) / math.log(high / low)
            level[inside] = np.minimum(level[inside], first + share * (last - first))
        return np.where(np.isinf(level), np.nan, level)


@dataclass(frozen=True)
class Limit:
    """The limit lines of a standard.

    Parameters
    ----------
    name, title : str
    lines : tuple of LimitLine
        One for each detector.
    port : str
    lisn : str
        The LISN with which it is measured.
    note : str
    unit : {"dBuV", "dBuA", "dBuV/m"}
        Unit of all levels: dBuA for a current probe, dBuV/m for an antenna.
    """

    name: str
    title: str
    lines: tuple[LimitLine, ...]
    port: str = ""
    lisn: str = "50uH"
    note: str = ""
    unit: str = "dBuV"

    def line(self, detector: str) -> LimitLine | None:
        """The line of a detector, or None."""
        return next((line for line in self.lines if line.detector == detector), None)

    @property
    def is_of_mains_ports(self) -> bool:
        """Whether it is for voltages at a LISN of mains ports in band B only."""
        low, high = BAND_B.span_hz
        inside = all(segment[0] >= low and segment[1] <= high for line in self.lines for segment in line.segments)
        return inside and self.unit == "dBuV" and self.lisn == "50uH"

    @property
    def unconfirmed(self) -> tuple[str, ...]:
        """Detectors whose values were not checked."""
        return tuple(line.detector for line in self.lines if not line.confirmed)

    def remarks(self) -> list[str]:
        """Remarks for the report: values that are not confirmed, and the note."""
        found = [
            f"{self.title}, {line.detector} limit: NOT CONFIRMED ({line.source}); check it against the standard"
            for line in self.lines
            if not line.confirmed
        ]
        return [*found, f"{self.title}: {self.note}"] if self.note else found

    def to_dict(self) -> JsonDict:
        """Plain data."""
        return {
            "name": self.name,
            "title": self.title,
            "port": self.port,
            "lisn": self.lisn,
            "unit": self.unit,
            "lines": [
                {"detector": line.detector, "confirmed": line.confirmed, "source": line.source, "segments": [list(s) for s in line.segments]}
                for line in self.lines
            ],
        }


def limit_names() -> tuple[str, ...]:
    """Names of the limits that come with motoremi."""
    return tuple(sorted(file.name.removesuffix(".toml") for file in _folder().iterdir() if file.name.endswith(".toml")))


def _folder() -> Any:
    return files("motoremi.emission") / "limits"


def find_limit(name: str | Path) -> Limit:
    """A limit that comes with motoremi, by name, or the user's own, by the path of its TOML file.

    Raises
    ------
    BadInput
        If there is none, or the file cannot be used.
    """
    text = str(name)
    if text in limit_names():
        return _limit(parse_toml((_folder() / f"{text}.toml").read_bytes(), text), text, text)
    if text.endswith(".toml"):
        return _limit(read_toml(text), Path(text).stem, show_name(text))
    raise BadInput(f"unknown limit {clean_text(text, 60)!r}: use {', '.join(limit_names())}, or the path of your own .toml file")


def _limit(content: JsonDict, name: str, shown: str) -> Limit:
    _refuse_other_keys(content, KEYS, shown)
    lines = content.get("line")
    if not isinstance(lines, list) or not lines:
        raise BadInput(f"{shown}: a limit needs at least one [[line]] with a detector and segments")
    parsed = tuple(_line(entry, shown) for entry in lines)
    if len({line.detector for line in parsed}) < len(parsed):
        raise BadInput(f"{shown}: two lines for one detector")
    for line in parsed:
        last_hz = min(segment[1] for segment in line.segments)
        if last_hz <= LOWEST_HZ:
            raise BadInput(f"{shown}, {line.detector}: a segment ends at {last_hz:g} Hz; frequencies are in hertz, as in [150000, 500000, 66, 56]")
    plain = {
        key: clean_text(str(content.get(key, default)), 200) for key, default in (("title", name), ("port", ""), ("lisn", "50uH"), ("note", ""))
    }
    unit = str(content.get("unit", "dBuV"))
    if unit not in LEVEL_UNITS:
        raise BadInput(f"{shown}: the unit {clean_text(unit, 20)!r} is unknown; use one of {', '.join(LEVEL_UNITS)}")
    return Limit(clean_text(name), plain["title"], parsed, plain["port"], plain["lisn"], plain["note"], unit)


def _refuse_other_keys(table: JsonDict, known: tuple[str, ...], shown: str) -> None:
    """Refuse keys that have no meaning: levels are always interpolated over the logarithm of frequency, for example."""
    for key in table:
        if key not in known:
            raise BadInput(f"{shown}: the key {clean_text(str(key), 40)!r} is unknown; use {', '.join(known)}")


def _line(entry: Any, shown: str) -> LimitLine:
    detector = entry.get("detector") if isinstance(entry, dict) else None
    if detector not in DETECTORS:
        raise BadInput(f"{shown}: a limit line belongs to a detector: write detector = one of {', '.join(DETECTORS)}")
    _refuse_other_keys(entry, LINE_KEYS, f"{shown}, {detector}")
    segments: list[tuple[float, float, float, float]] = []
    for segment in entry.get("segments", []):
        numbers = [value for value in segment if isinstance(value, (int, float)) and math.isfinite(value)] if isinstance(segment, list) else []
        if len(numbers) != 4 or not 0 < numbers[0] < numbers[1]:
            raise BadInput(f"{shown}, {detector}: a segment is [low_hz, high_hz, level_dbuv, level_dbuv] with 0 < low < high, not {segment}")
        if segments and numbers[0] < segments[-1][1]:
            raise BadInput(f"{shown}, {detector}: segments overlap at {numbers[0]:g} Hz; give them in order of frequency")
        segments.append((float(numbers[0]), float(numbers[1]), float(numbers[2]), float(numbers[3])))
    if not segments:
        raise BadInput(f"{shown}, {detector}: no segments")
    source = clean_text(str(entry.get("source", "the user's own")), 300)
    return LimitLine(detector, tuple(segments), entry.get("confirmed") is True, source)
