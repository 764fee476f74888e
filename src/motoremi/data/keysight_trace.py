"""The CSV of one trace that spectrum analysers and receivers of Keysight's X series save: `Trace`, lines `key,value`, `DATA`, rows."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np

from motoremi.arrays import FloatArray
from motoremi.data.detectors import DBUV_OF_0_DBM, detector_name
from motoremi.data.numbers import looks_cut, parse_number
from motoremi.data.repeated import Levels, spectrum_of
from motoremi.data.spectrum import DETECTORS, Spectrum
from motoremi.data.text import clean_text
from motoremi.data.text_file import of_file, split_lines
from motoremi.errors import BadInput
from motoremi.quantities import show

_FIRST = re.compile(r"(?:All)?Trace\s*[\r\n]", re.IGNORECASE)
_LEVELS = {"dbuv": 0.0, "dbm": DBUV_OF_0_DBM}
# Settings with which the stored levels are those of the detector at the input, and what they must be, in lower case.
_MUST_BE = {
    "trace type": ("maxhold", "clearwrite", "max hold", "clear write"),
    "trace math": ("off",),
    "normalize": ("off",),
    "x axis units": ("hz",),
    "rbw filter": ("gaussian",),
}
# Width of a Gaussian filter between its 6 dB points, relative to the one that is stated.
_TO_6_DB = {"6db": 1.0, "3db": math.sqrt(2)}


def is_keysight_trace(text: str) -> bool:
    """Whether the first line is `Trace` or `AllTrace` and one below is `DATA`."""
    return _FIRST.match(text) is not None and re.search(r"^DATA\s*$", text[:20_000], re.MULTILINE) is not None


def parse_keysight_trace(text: str, name: str) -> Spectrum:
    """The spectrum of a file.

    Raises
    ------
    BadInput
        If it holds several traces, is cut off, or a setting is not stated or changes what the levels mean.
    """
    lines = [line.strip() for line in split_lines(text)]
    if lines[0].lower() == "alltrace":
        raise BadInput(f"{name}: holds all traces of the analyser; save each trace by itself")
    data = lines.index("DATA")
    pairs = [line.partition(",") for line in lines[1:data]]
    settings = {key.strip().lower(): value.strip() for key, comma, value in pairs if comma}
    detector = of_file(name, lambda: _detector(settings))
    offset = _one_of(settings, "y axis units", _LEVELS, name)
    if "rbw" not in settings:
        raise BadInput(f"{name}: does not state the resolution bandwidth (RBW)")
    bandwidth = parse_number(settings["rbw"], f"{name}, RBW") * _one_of(settings, "rbw filter bw", _TO_6_DB, name)
    rows = _rows(lines, data + 1, name)
    if settings.get("number of points") != str(len(rows)) or (lines[-1] and looks_cut(lines[-1], lines[data + 1 : -1])):
        announced = clean_text(settings.get("number of points", "no number"), 20)
        raise BadInput(f"{name}: {len(rows)} rows, {announced} announced; the file is cut off")
    metadata = {"trace": settings.get("trace name", ""), "warnings": _warnings(settings, bandwidth)}
    levels = Levels(rows[:, 0], rows[:, 1] + offset)
    return of_file(name, lambda: spectrum_of(detector, levels, bandwidth, {key: value for key, value in metadata.items() if value}))


def _detector(settings: dict[str, str]) -> str:
    for key, known in _MUST_BE.items():
        if settings.get(key, "").lower() not in known:
            raise BadInput(f"the setting {key!r} is {clean_text(settings.get(key, 'not stated'), 40)!r}; set it to {known[0]} and save again")
    detector = detector_name(settings.get("detector", ""))
    if detector not in DETECTORS:
        raise BadInput(f"the detector is {detector or 'not stated'!r}; use one of {', '.join(DETECTORS)}")
    if detector == "average" and (kind := settings.get("average type", "not stated")).lower() != "voltage":
        raise BadInput(f"the setting 'average type' is {clean_text(kind, 40)!r}; set it to voltage and save again")
    return detector


def _one_of(settings: dict[str, str], key: str, known: dict[str, float], name: str) -> float:
    written = settings.get(key, "")
    plain = written.lower().replace("µ", "u").replace(" ", "")
    if plain not in known:
        raise BadInput(f"{name}: the setting {key!r} is {clean_text(written, 40) or 'not stated'!r}; set it to {' or '.join(known)} and save again")
    return known[plain]


def _rows(lines: Sequence[str], first: int, name: str) -> FloatArray:
    """Frequency and level of each row, shape (n, 2)."""
    rows = []
    for number, line in enumerate(lines[first:], start=first + 1):
        if not line:
            continue
        cells = line.split(",")
        if len(cells) != 2:
            raise BadInput(f"{name}, line {number}: {len(cells)} values where frequency and level are needed; the row or the file is cut off")
        rows.append([parse_number(cell, f"{name}, line {number}") for cell in cells])
    return np.array(rows, dtype=np.float64).reshape(-1, 2)


def _warnings(settings: dict[str, str], bandwidth: float) -> list[str]:
    found = []
    if settings["rbw filter bw"].lower().startswith("3"):
        found.append(f"its bandwidth is stated at 3 dB; at 6 dB, where CISPR 16-1-1 defines it, the filter has {show(bandwidth, 'Hz')}")
    for key in ("ref level offset", "external gain"):
        if settings.get(key, "0") not in ("0", "0.0"):
            found.append(f"the analyser has applied a {key} of {clean_text(settings[key], 20)} dB; it must not be in --corrections")
    return found
