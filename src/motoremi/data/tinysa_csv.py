"""The CSV that tinySA programs save: frequency and level in dBm, without a row of names (layout unconfirmed: no maker's file was at hand)."""

from __future__ import annotations

import re

import numpy as np

from motoremi.data.detectors import DBUV_OF_0_DBM
from motoremi.data.numbers import looks_cut, looks_numeric, parse_number
from motoremi.data.repeated import Levels, spectrum_of
from motoremi.data.spectrum import Spectrum
from motoremi.data.text_file import of_file, split_lines
from motoremi.errors import BadInput

_DELIMITER = re.compile(r"\s*[,;\t]\s*|\s+")
# If the typical level is above this, the levels could also be in dBuV.
_HIGHEST_TYPICAL_DBM = -25.0
# Emission is measured from 9 kHz (CISPR 16-1-1), so numbers that begin below are hardly hertz.
LOWEST_HZ = 9e3


def is_two_columns(text: str) -> bool:
    """Whether the first line is a pair of numbers."""
    first = next((line for line in split_lines(text[:20_000]) if line.strip()), "")
    cells = _cells(first)
    return len(cells) == 2 and all(looks_numeric(cell) for cell in cells)


def parse_tinysa(text: str, name: str) -> Spectrum:
    """A spectrum; frequencies in Hz, or in MHz where all are below 10 000.

    The instrument has no CISPR detectors and the file does not state its bandwidth: peak and 9 kHz are assumed, and the metadata record it.

    Raises
    ------
    BadInput
        If a row is not a pair of numbers, the file is cut off, or the levels could also be in dBuV.
    """
    rows: list[tuple[float, float]] = []
    written: list[str] = []
    lines = split_lines(text)
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        cells = _cells(line)
        if len(cells) != 2:
            raise BadInput(f"{name}, line {number}: {len(cells)} values where frequency and level are needed; the row or the file is cut off")
        rows.append((parse_number(cells[0], f"{name}, line {number}"), parse_number(cells[1], f"{name}, line {number}")))
        written.append(cells[1])
    if lines[-1].strip() and looks_cut(written[-1], written[:-1]):
        raise BadInput(f"{name}: the last number {written[-1]!r} is shorter than all others and no line end follows; the file is cut off")
    frequency, level = np.array(rows).T
    if not (np.median(level) <= _HIGHEST_TYPICAL_DBM and level.max() <= 30):
        raise BadInput(f"{name}: its levels could be in dBm or in dBuV; put a line 'frequency_hz,level_dbuv' (or level_dbm) above them")
    factor = 1e6 if frequency.max() < 1e4 else 1.0
    if factor == 1.0 and (frequency.max() < 1e5 or frequency.min() < LOWEST_HZ):
        raise BadInput(f"{name}: the unit of its frequencies is not stated; put a line 'frequency_hz,level_dbm' above them")
    metadata = {"detector_assumed": True, "rbw_assumed": True, "read_as": f"dBm in 50 Ohm, frequency in {'MHz' if factor > 1 else 'Hz'}"}
    levels = Levels(frequency * factor, level + DBUV_OF_0_DBM)
    return of_file(name, lambda: spectrum_of("peak", levels, 9e3, metadata))


def _cells(line: str) -> list[str]:
    return [cell for cell in _DELIMITER.split(line.strip()) if cell]
