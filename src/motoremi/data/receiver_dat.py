"""The file that a Rohde & Schwarz receiver exports (.DAT, .ASC): `key;value;unit`, then `Values;N;` and rows, for one or more traces.

A list of final measurements, `TRACE 1 FINAL:`, has rows of trace, frequency, level and more, such as the line of the LISN.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from motoremi.arrays import FloatArray, JsonDict
from motoremi.data.detectors import DBUV_OF_0_DBM, detector_name
from motoremi.data.final_list import LEAST_FINAL_S, LINES, SECONDS
from motoremi.data.numbers import has_decimal_commas, looks_cut, looks_numeric, parse_number
from motoremi.data.repeated import Levels, spectrum_of
from motoremi.data.spectrum import DETECTORS, Spectrum
from motoremi.data.spectrum_header import kept_header
from motoremi.data.text import clean_text
from motoremi.data.text_file import file_name, of_file, split_lines
from motoremi.errors import BadInput
from motoremi.quantities import show

_SCAN = re.compile(r"scan (\d+)$")
_TRACE = re.compile(r"trace (\d+)( final)?$")
_HERTZ = {"hz": 1.0, "khz": 1e3, "mhz": 1e6, "ghz": 1e9}
_LEVELS = {"dbuv": 0.0, "dbm": DBUV_OF_0_DBM}
_DETECTOR_KEYS = ("detector", "scan detector")
_FINAL_DETECTOR_KEYS = ("final detector", "detector")
_FINAL_TIME_KEYS = ("final meas time", "meas time")
# Settings of a trace that may stand in the head: they are read, and are not those of every spectrum of the file.
_OF_A_TRACE = ("rbw", "detector", "scan detector", "trace mode", "x-unit", "y-unit")
# Settings and their lines, by key.
_Settings: TypeAlias = dict[str, tuple[list[str], int]]


@dataclass
class _Section:
    """Settings of the file's head, a scan, a trace or a list of final values."""

    settings: _Settings = field(default_factory=dict)
    rows: list[tuple[list[str], int]] = field(default_factory=list)


@dataclass
class _File:
    """The sections of a file; scans and traces by their headings."""

    head: _Section = field(default_factory=_Section)
    scans: dict[str, _Section] = field(default_factory=dict)
    traces: dict[str, _Section] = field(default_factory=dict)
    finals: list[_Section] = field(default_factory=list)


def is_receiver_dat(text: str) -> bool:
    """Whether the first line names a receiver."""
    return re.match(r"type\s*;", text.lstrip(), re.IGNORECASE) is not None


def parse_receiver_dat(text: str, name: str, with_finals: bool = False) -> tuple[list[Spectrum], list[Spectrum]]:
    """The spectra and, with `with_finals`, the final values of a file.

    One spectrum for each trace, and for each resolution bandwidth where the scans of a trace differ in it; one of a single point for each final
    value. Final values that are not returned are counted in the metadata `final_values_left_out` of the spectra. Detector and units of a trace may
    stand in the head of the file.

    Raises
    ------
    BadInput
        If a trace is cut off, or holds anything but levels of a known detector against frequency.
    """
    file = _sections(text, name)
    _check_end(text, file, name)
    if not file.traces:
        raise BadInput(f"{name}: holds no trace; export the scan with its data")
    comma = _decimal_comma([*file.traces.values(), *file.scans.values(), *(file.finals if with_finals else ()), file.head], name)
    metadata = kept_header({key: ";".join(cells) for key, (cells, _) in file.head.settings.items() if cells and key not in _OF_A_TRACE})
    finals, not_read = _finals(file, name, comma, metadata) if with_finals else ([], [(section, "") for section in file.finals])
    if left_out := _left_out(not_read, file.head, comma):
        metadata["final_values_left_out"] = left_out
    spectra: list[Spectrum] = []
    for label, trace in file.traces.items():
        detector, frequency, level = _trace(file, trace, f"{name}, {label}", comma)
        for part, bandwidth in _parts(file, trace, frequency, name, comma):
            levels = Levels(frequency[part], level[part])
            spectra.append(of_file(f"{name}, {label}", partial(spectrum_of, detector, levels, bandwidth, {**metadata, "trace": label})))
    return spectra, finals


def _sections(text: str, name: str) -> _File:
    file = _File()
    current = file.head
    values_left = 0
    for number, raw in enumerate(split_lines(text), start=1):
        cells = [cell.strip() for cell in raw.split(";")]
        while len(cells) > 1 and not cells[-1]:
            cells.pop()
        key = re.sub(r"\s+", " ", cells[0].lower().rstrip(":").strip())
        if not key:
            continue
        if values_left:
            if not looks_numeric(cells[0]):
                raise BadInput(f"{name}, line {number}: {values_left} more rows were announced; the file is cut off")
            current.rows.append((cells, number))
            values_left -= 1
            continue
        scan, trace = _SCAN.match(key), _TRACE.match(key)
        if scan:
            current = file.scans.setdefault(key, _Section())
        elif trace:
            current = _Section()
            if key in file.traces:
                raise BadInput(f"{name}, line {number}: {key} occurs twice; export each trace once")
            if trace.group(2):
                file.finals.append(current)
            else:
                file.traces[key] = current
        elif key == "values":
            values_left = _count(cells, f"{name}, line {number}")
            if current is file.head or current in file.scans.values():
                # An export of a single trace may have no heading for it.
                if file.traces:
                    raise BadInput(f"{name}, line {number}: values outside a trace")
                current = file.traces["trace 1"] = _Section({**file.head.settings, **current.settings})
        elif looks_numeric(cells[0]):
            raise BadInput(f"{name}, line {number}: more rows than 'Values' announced")
        else:
            current.settings[key] = (cells[1:], number)
    if values_left:
        raise BadInput(f"{name}: {values_left} more rows were announced; the file is cut off")
    return file


def _check_end(text: str, file: _File, name: str) -> None:
    """Refuse a last line without a line end if its last number was cut off, or values behind it are missing."""
    *before, last = (line.strip() for line in split_lines(text))
    if not last:
        return
    rows = [cells for trace in file.traces.values() for cells, _ in trace.rows]
    if file.finals and file.finals[-1].rows:
        rows = [cells for cells, _ in file.finals[-1].rows]
    lost_its_end = bool(before) and before[-1].endswith(";") and not last.endswith(";")
    fewer = bool(rows) and len(rows[-1]) < max(map(len, rows))
    if lost_its_end or fewer or (rows and looks_cut(rows[-1][-1], [cells[-1] for cells in rows[:-1]])):
        raise BadInput(f"{name}: the last line has no end and is shorter than those before; the file is cut off")


def _count(cells: list[str], where: str) -> int:
    if len(cells) > 1 and cells[1].isascii() and cells[1].isdecimal() and len(cells[1]) < 9:
        return int(cells[1])
    raise BadInput(f"{where}: 'Values' needs the number of rows")


def _decimal_comma(sections: list[_Section], name: str) -> bool:
    rows: list[tuple[list[str], int]] = []
    for section in sections:
        rows += section.rows
        rows += [(cells[:1], line) for key, (cells, line) in section.settings.items() if key in ("start", "stop", "step", "rbw")]
    return has_decimal_commas(((cell, line) for cells, line in rows for cell in cells), name)


def _number(cell: str, where: str, comma: bool) -> float:
    return parse_number(cell.replace(",", ".", 1) if comma else cell, where)


def _trace(file: _File, trace: _Section, where: str, comma: bool) -> tuple[str, FloatArray, FloatArray]:
    settings = {**file.head.settings, **trace.settings}
    detector = _detector(file, trace, where)
    factor = _unit(settings, "x-unit", _HERTZ, "Hz", where)
    offset = _unit(settings, "y-unit", _LEVELS, "dBuV or dBm", where)
    for cells, line in trace.rows:
        if len(cells) != 2:
            raise BadInput(f"{where}, line {line}: {len(cells)} values where frequency and level are needed; the row or the file is cut off")
    numbers = np.array([[_number(cell, f"{where}, line {line}", comma) for cell in cells] for cells, line in trace.rows]).reshape(-1, 2)
    return detector, numbers[:, 0] * factor, numbers[:, 1] + offset


def _detector(file: _File, trace: _Section, where: str) -> str:
    """The detector of a trace, which the head states only if the file has no other trace."""
    written = _written_detector(trace.settings, _DETECTOR_KEYS)
    if not written and (of_all := _written_detector(file.head.settings, _DETECTOR_KEYS)):
        if len(file.traces) > 1:
            shown = clean_text(of_all, 40)
            raise BadInput(f"{where}: the detector {shown!r} is stated for the file and not for each of its traces; export each trace by itself")
        written = of_all
    detector = detector_name(written)
    if detector not in DETECTORS:
        raise BadInput(f"{where}: the detector is {clean_text(written, 40) or 'not stated'!r}; use one of {', '.join(DETECTORS)}")
    return detector


def _written_detector(settings: _Settings, keys: Sequence[str]) -> str:
    written = next((settings[key][0] for key in keys if key in settings), [])
    return written[0] if written else ""


def _unit(settings: _Settings, key: str, known: dict[str, float], wanted: str, where: str) -> float:
    cells = settings.get(key, ([], 0))[0]
    unit = cells[0].replace("µ", "u").replace("μ", "u") if cells else ""
    if unit.lower() not in known:
        raise BadInput(f"{where}: its {key} is {clean_text(unit, 20) or 'not stated'!r}; set it to {wanted} and export again")
    return known[unit.lower()]


def _finals(file: _File, name: str, comma: bool, metadata: JsonDict) -> tuple[list[Spectrum], list[tuple[_Section, str]]]:
    """The final values, and the lists that cannot be used with the reason in words; it is empty if that is their levels."""
    found: list[Spectrum] = []
    left: list[tuple[_Section, str]] = []
    for section in file.finals:
        try:
            readings = list(_final_readings(section, file.head, comma))
        except BadInput:
            left.append((section, ""))
            continue
        try:
            found += [_final(file, section, one, name, comma, metadata) for one in readings]
        except BadInput as error:
            left.append((section, str(error)))
    return found, left


def _final(file: _File, section: _Section, reading: _Reading, name: str, comma: bool, metadata: JsonDict) -> Spectrum:
    """One final value as a spectrum of a single point."""
    if reading.detector not in DETECTORS:
        raise BadInput(f"their detector is {clean_text(reading.detector, 40)}")
    seconds = _final_time_s(section, name, comma)
    if seconds is not None and seconds < LEAST_FINAL_S:
        raise BadInput(f"they were measured for {show(seconds, 's')} where {show(LEAST_FINAL_S, 's')} are needed")
    at_hz = np.array([reading.frequency_hz])
    ((_, bandwidth_hz),) = _parts(file, section, at_hz, file_name(name), comma)
    own = metadata | {"maximum_hz": reading.frequency_hz}
    own |= {} if seconds is None else {"dwell_s": seconds}
    own |= {"phase": reading.phase} if reading.phase else {}
    return Spectrum(reading.detector, at_hz, np.array([reading.level_dbuv]), bandwidth_hz, metadata=own)


def _final_time_s(section: _Section, name: str, comma: bool) -> float | None:
    """The measuring time of final values; None if it is not stated."""
    for key in _FINAL_TIME_KEYS:
        cells, line = section.settings.get(key, ([], 0))
        if cells and cells[0]:
            unit = cells[1].lower() if len(cells) > 1 else "s"
            if unit not in SECONDS:
                raise BadInput(f"the unit of their measuring time is {clean_text(unit, 20)!r}")
            return _number(cells[0], f"{name}, line {line}", comma) * SECONDS[unit]
    return None


def _left_out(sections: Sequence[tuple[_Section, str]], head: _Section, comma: bool) -> str:
    """What is left out of lists of final measurements, in words, with the highest value of each detector; empty if nothing is."""
    count = sum(len(section.rows) for section, _ in sections)
    if not count:
        return ""
    text = "1 final value in the file is left out" if count == 1 else f"{count} final values in the file are left out"
    try:
        readings = [one for section, _ in sections for one in _final_readings(section, head, comma)]
    except BadInput:
        return f"{text}; their levels cannot be read"
    highest: dict[str, tuple[float, float]] = {}
    for one in readings:
        highest[one.detector] = max((one.level_dbuv, one.frequency_hz), highest.get(one.detector, (-np.inf, 0.0)))
    each = [f"{level:.1f} dBuV at {show(frequency, 'Hz')} ({detector})" for detector, (level, frequency) in highest.items()]
    why = "; ".join(dict.fromkeys(reason for _, reason in sections if reason))
    return f"{text}, {'' if count == 1 else 'the highest '}{' and '.join(each)}{': ' if why else ''}{why}"


@dataclass(frozen=True)
class _Reading:
    """One row of a list of final values; `phase` is the line of the LISN, empty if it is not stated."""

    detector: str
    level_dbuv: float
    frequency_hz: float
    phase: str


def _final_readings(section: _Section, head: _Section, comma: bool) -> Iterator[_Reading]:
    """Each final value; a row is trace, frequency, level and more."""
    settings = {**head.settings, **section.settings}
    detector = detector_name(_written_detector(section.settings, _FINAL_DETECTOR_KEYS)) or "detector not stated"
    factor, offset = _unit(settings, "x-unit", _HERTZ, "Hz", ""), _unit(settings, "y-unit", _LEVELS, "dBuV", "")
    for cells, line in section.rows:
        if len(cells) < 3:
            raise BadInput(f"line {line}: no final value")
        level, frequency = (_number(cells[column], f"line {line}", comma) for column in (2, 1))
        phase = next((cell.upper() for cell in cells[3:] if LINES.fullmatch(cell)), "")
        yield _Reading(detector, level + offset, frequency * factor, phase)


def _parts(file: _File, trace: _Section, frequency: FloatArray, name: str, comma: bool) -> list[tuple[slice, float]]:
    """The points of each resolution bandwidth; all points if the scans share one bandwidth."""
    own = [_quantity(section, "rbw", name, comma) for section in (trace, *file.scans.values(), file.head) if "rbw" in section.settings]
    if not own:
        raise BadInput(f"{name}: does not state the resolution bandwidth (RBW)")
    if "rbw" in trace.settings or len(set(own)) == 1:
        return [(slice(None), own[0])]
    bands = []
    for label, scan in file.scans.items():
        if not {"start", "stop", "rbw"} <= set(scan.settings):
            raise BadInput(f"{name}, {label}: needs Start, Stop and RBW, since the scans differ in bandwidth")
        bands.append(tuple(_quantity(scan, key, name, comma) for key in ("start", "stop", "rbw")))
    bands.sort()
    if any(second[0] < first[1] for first, second in pairwise(bands)):
        raise BadInput(f"{name}: its scans overlap and differ in bandwidth; export one scan at a time")
    inside = np.any([(frequency >= start) & (frequency <= stop) for start, stop, _ in bands], axis=0)
    if not inside.all() or np.any(np.diff(frequency) < 0):
        raise BadInput(f"{name}: some points lie in none of its scans; export one scan at a time")
    # The first point of a scan is at its start: where two scans meet, the last point at that frequency belongs to the second scan.
    cuts = [0, *(int(np.searchsorted(frequency, start)) + max(0, int(np.sum(frequency == start)) - 1) for start, _, _ in bands[1:]), frequency.size]
    return [(slice(low, high), band[2]) for (low, high), band in zip(pairwise(cuts), bands, strict=True) if high > low]


def _quantity(section: _Section, key: str, name: str, comma: bool) -> float:
    cells, line = section.settings[key]
    unit = cells[1].lower() if len(cells) > 1 else "hz"
    if not cells or unit not in _HERTZ:
        raise BadInput(f"{name}, line {line}: {key} needs a number and a unit of frequency")
    return _number(cells[0], f"{name}, line {line}", comma) * _HERTZ[unit]
