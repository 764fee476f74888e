"""What the rows of a table of levels state beside them, as EMI software writes lists of final values: line of the LISN, bandwidth, measuring time.

With these a table may be a list of final values, whose points are far apart, or hold scans of several lines below each other.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from motoremi.arrays import FloatArray, JsonDict
from motoremi.data.numbers import looks_numeric, parse_number
from motoremi.data.table import Table
from motoremi.data.text import clean_text
from motoremi.data.units import HERTZ
from motoremi.errors import BadInput
from motoremi.quantities import show

# Titles without their unit, in English and German.
_TITLES = {
    "line": re.compile(r"line|phase|conductor|leiter|leitung", re.IGNORECASE),
    "time": re.compile(r"(?:meas(?:\.|uring|urement)?|dwell)[\s_]*time|messzeit", re.IGNORECASE),
    "bandwidth": re.compile(r"(?:resolution[\s_]*)?bandwidth|rbw|bandbreite", re.IGNORECASE),
    "correction": re.compile(r"corr(?:\.|ection)?|korr(?:\.|ektur)?|transd(?:\.|ucer)?", re.IGNORECASE),
}
_UNIT = re.compile(r"\s*[(\[]\s*([^)\]]*?)\s*[)\]]\s*$")
# Names of the lines of a LISN.
LINES = re.compile(r"L[1-3]|N", re.IGNORECASE)
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
# With less time the weighted detectors have not settled, and the reading is no final value.
LEAST_FINAL_S = 1.0
# Neighbouring points of a scan are no further apart than this many bandwidths, those of a list of maxima nearly always: a disturbance between two
# such maxima is in neither reading.
SCAN_STEP = 4.0
# Steps of a coarse scan are equal within this share; of maxima so many are not by chance.
EQUAL, FEWEST_STEPS = 0.02, 4


@dataclass(frozen=True)
class Part:
    """Rows of a table that are one scan, or one final value.

    Parameters
    ----------
    rows : list of int
    bandwidth_hz : float, optional
        As the rows state it.
    metadata : dict
        `line`, `dwell_s` and `transducer`, where the rows state them; `maximum_hz` of a final value.
    """

    rows: list[int]
    bandwidth_hz: float | None
    metadata: JsonDict


def parts_of(table: Table, frequency_hz: FloatArray, bandwidth_hz: float) -> tuple[list[Part], set[int]]:
    """The scans and final values of a table, and the columns that were read for it; without such columns all rows are one scan.

    Parameters
    ----------
    frequency_hz : ndarray, shape (rows,)
    bandwidth_hz : float
        Of rows that state none.

    Raises
    ------
    BadInput
        For a cell that cannot be read, or final values that were measured for too short a time.
    """
    found = {name: (index, unit) for index, title in enumerate(table.columns) for name, unit in _meaning(title)}
    if "line" in found and any(looks_numeric(cells[found["line"][0]]) for cells in table.rows):
        del found["line"]
    if not {"line", "time"} & found.keys():
        return [Part(list(range(len(table.rows))), None, {})], set()
    lines = _cells(table, found, "line", lambda text, _: text.upper() if LINES.fullmatch(text) else clean_text(text, 40))
    times = _cells(table, found, "time", lambda text, where: _in_si(text, where, SECONDS.get(found["time"][1])))
    widths = _cells(table, found, "bandwidth", lambda text, where: _in_si(text, where, HERTZ.factor(found["bandwidth"][1])))
    corrections = _cells(table, found, "correction", parse_number)
    groups: dict[tuple[object, object, object], list[int]] = {}
    for row, key in enumerate(zip(lines, widths, times, strict=True)):
        groups.setdefault(key, []).append(row)
    parts = []
    for (line, width, seconds), rows in groups.items():
        stated = {"line": line, "dwell_s": seconds}
        own: JsonDict = {name: value for name, value in stated.items() if value}
        known = width if isinstance(width, float) and width > 0 else None
        if any(corrections[row] for row in rows):
            own["transducer"] = f"column {clean_text(table.columns[found['correction'][0]], 40)}"
        if _is_scan(frequency_hz[rows], bandwidth_hz if known is None else known):
            parts.append(Part(rows, known, own))
            continue
        if own.get("dwell_s", LEAST_FINAL_S) < LEAST_FINAL_S:
            raise BadInput(
                f"{table.where(rows[0])}: a final value was measured for {show(own['dwell_s'], 's')} where {show(LEAST_FINAL_S, 's')} are needed"
            )
        parts += [Part([row], known, {**own, "maximum_hz": float(frequency_hz[row])}) for row in rows]
    return parts, {index for index, _ in found.values()}


def _meaning(title: str) -> list[tuple[str, str]]:
    """What a title means, with its unit in lower case; empty for another one."""
    unit = _UNIT.search(title)
    name = title[: unit.start()] if unit else title
    return [(meaning, unit[1].lower() if unit else "") for meaning, pattern in _TITLES.items() if pattern.fullmatch(name.strip())]


def _cells(table: Table, found: dict[str, tuple[int, str]], name: str, read: Callable[[str, str], object]) -> Sequence[object]:
    """What each row states in a column; None without it."""
    if name not in found:
        return [None] * len(table.rows)
    index = found[name][0]
    return [read(cells[index].strip(), f"{table.where(row)}, column {table.columns[index]!r}") for row, cells in enumerate(table.rows)]


def _in_si(text: str, where: str, factor: float | None) -> float | None:
    """A number in SI units; None if its unit is not known."""
    return None if factor is None else parse_number(text, where) * factor


def _is_scan(frequency_hz: FloatArray, bandwidth_hz: float) -> bool:
    """Whether points are those of a scan: increasing, and next to each other or in equal steps, on a linear or logarithmic axis."""
    steps = np.diff(frequency_hz)
    if not steps.size or (steps <= 0).any():
        return False
    equal = any(np.ptp(one) < EQUAL * one.mean() for one in (steps, np.diff(np.log(frequency_hz))))
    return bool(np.median(steps) <= SCAN_STEP * bandwidth_hz or (equal and steps.size >= FEWEST_STEPS))
