"""The file that a Rohde & Schwarz receiver exports (.DAT, .ASC): `key;value;unit`, then `Values;N;` and rows, for one or more traces."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from motoremi.arrays import FloatArray, JsonDict
from motoremi.data.detectors import DBUV_OF_0_DBM, detector_name
from motoremi.data.numbers import looks_cut, looks_numeric, parse_number
from motoremi.data.spectrum import DETECTORS, Spectrum
from motoremi.data.text import clean_text
from motoremi.data.text_file import split_lines
from motoremi.errors import BadInput

_SCAN = re.compile(r"scan (\d+)$")
_TRACE = re.compile(r"trace (\d+)( final)?$")
_HERTZ = {"hz": 1.0, "khz": 1e3, "mhz": 1e6, "ghz": 1e9}
_LEVELS = {"dbuv": 0.0, "dbm": DBUV_OF_0_DBM}
_DETECTOR_KEYS = ("detector", "scan detector")


@dataclass
class _Section:
    """Settings of the file's head, a scan or a trace, with the line of each."""

    settings: dict[str, tuple[list[str], int]] = field(default_factory=dict)
    rows: list[tuple[list[str], int]] = field(default_factory=list)


def is_receiver_dat(text: str) -> bool:
    """Whether the first line names a receiver."""
    return re.match(r"type\s*;", text.lstrip(), re.IGNORECASE) is not None


def parse_receiver_dat(text: str, name: str) -> list[Spectrum]:
    """One spectrum for each trace, and for each resolution bandwidth where the scans of a trace differ in it.

    Lists of final measurements are left out: they are single frequencies, not spectra.

    Raises
    ------
    BadInput
        If a trace is cut off, or holds anything but levels of a known detector against frequency.
    """
    head, scans, traces = _sections(text, name)
    _check_end(text, traces, name)
    if not traces:
        raise BadInput(f"{name}: holds no trace; export the scan with its data")
    comma = _decimal_comma([*traces.values(), *scans.values(), head], name)
    metadata = {key: ";".join(cells) for key, (cells, _) in head.settings.items() if cells}
    spectra: list[Spectrum] = []
    for label, trace in traces.items():
        detector, frequency, level = _trace(trace, f"{name}, {label}", comma)
        for part, bandwidth in _parts(head, scans, trace, frequency, name, comma):
            spectra.append(_spectrum(name, label, detector, frequency[part], level[part], bandwidth, metadata))
    return spectra


def _spectrum(name: str, label: str, detector: str, frequency: FloatArray, level: FloatArray, bandwidth: float, metadata: JsonDict) -> Spectrum:
    try:
        return Spectrum(detector, frequency, level, bandwidth, None, {**metadata, "trace": label})
    except BadInput as error:
        raise BadInput(f"{name}, {label}: {error}") from error


def _sections(text: str, name: str) -> tuple[_Section, dict[str, _Section], dict[str, _Section]]:
    head = current = _Section()
    scans: dict[str, _Section] = {}
    traces: dict[str, _Section] = {}
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
            current = scans.setdefault(key, _Section())
        elif trace:
            current = _Section()
            if key in traces:
                raise BadInput(f"{name}, line {number}: {key} occurs twice; export each trace once")
            if not trace.group(2):
                traces[key] = current
        elif key == "values":
            values_left = _count(cells, f"{name}, line {number}")
            if current is head or current in scans.values():
                # An export of a single trace may have no heading for it.
                if traces:
                    raise BadInput(f"{name}, line {number}: values outside a trace")
                current = traces["trace 1"] = _Section({**head.settings, **current.settings})
        elif looks_numeric(cells[0]):
            raise BadInput(f"{name}, line {number}: more rows than 'Values' announced")
        else:
            current.settings[key] = (cells[1:], number)
    if values_left:
        raise BadInput(f"{name}: {values_left} more rows were announced; the file is cut off")
    return head, scans, traces


def _check_end(text: str, traces: dict[str, _Section], name: str) -> None:
    """Refuse a last line without a line end if its last number was cut off."""
    *before, last = (line.strip() for line in split_lines(text))
    if not last:
        return
    rows = [cells for trace in traces.values() for cells, _ in trace.rows]
    lost_its_end = bool(before) and before[-1].endswith(";") and not last.endswith(";")
    if lost_its_end or (rows and looks_cut(rows[-1][-1], [cells[-1] for cells in rows[:-1]])):
        raise BadInput(f"{name}: the last line has no end and is shorter than those before; the file is cut off")


def _count(cells: list[str], where: str) -> int:
    if len(cells) > 1 and cells[1].isascii() and cells[1].isdecimal() and len(cells[1]) < 9:
        return int(cells[1])
    raise BadInput(f"{where}: 'Values' needs the number of rows")


def _decimal_comma(sections: list[_Section], name: str) -> bool:
    comma = point = 0
    for section in sections:
        numeric = [(cells[:1], line) for key, (cells, line) in section.settings.items() if key in ("start", "stop", "step", "rbw")]
        for cells, line in (*section.rows, *numeric):
            for cell in cells:
                if looks_numeric(cell):
                    comma = comma or ("," in cell and line)
                    point = point or ("." in cell and line)
    if comma and point:
        raise BadInput(f"{name}, line {comma}: a decimal comma, but line {point} has a decimal point; use one of them")
    return bool(comma)


def _number(cell: str, where: str, comma: bool) -> float:
    return parse_number(cell.replace(",", ".", 1) if comma else cell, where)


def _trace(trace: _Section, where: str, comma: bool) -> tuple[str, FloatArray, FloatArray]:
    written = next((trace.settings[key][0] for key in _DETECTOR_KEYS if key in trace.settings), [])
    detector = detector_name(written[0]) if written else ""
    if detector not in DETECTORS:
        raise BadInput(f"{where}: the detector is {clean_text(written[0], 40) if written else 'not stated'!r}; use one of {', '.join(DETECTORS)}")
    factor = _unit(trace, "x-unit", _HERTZ, "Hz", where)
    offset = _unit(trace, "y-unit", _LEVELS, "dBuV or dBm", where)
    for cells, line in trace.rows:
        if len(cells) != 2:
            raise BadInput(f"{where}, line {line}: {len(cells)} values where frequency and level are needed; the row or the file is cut off")
    numbers = np.array([[_number(cell, f"{where}, line {line}", comma) for cell in cells] for cells, line in trace.rows]).reshape(-1, 2)
    return detector, numbers[:, 0] * factor, numbers[:, 1] + offset


def _unit(trace: _Section, key: str, known: dict[str, float], wanted: str, where: str) -> float:
    cells = trace.settings.get(key, ([], 0))[0]
    unit = cells[0].replace("µ", "u").replace("μ", "u") if cells else ""
    if unit.lower() not in known:
        raise BadInput(f"{where}: its {key} is {clean_text(unit, 20) or 'not stated'!r}; set it to {wanted} and export again")
    return known[unit.lower()]


def _parts(head: _Section, scans: dict[str, _Section], trace: _Section, frequency: FloatArray, name: str, comma: bool) -> list[tuple[slice, float]]:
    """The points of each resolution bandwidth; all points if the scans share one bandwidth."""
    own = [_quantity(section, "rbw", name, comma) for section in (trace, *scans.values(), head) if "rbw" in section.settings]
    if not own:
        raise BadInput(f"{name}: does not state the resolution bandwidth (RBW)")
    if "rbw" in trace.settings or len(set(own)) == 1:
        return [(slice(None), own[0])]
    bands = []
    for label, scan in scans.items():
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
