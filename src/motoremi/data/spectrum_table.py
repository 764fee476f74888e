"""Emission spectra from a table: one for each column of levels."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from motoremi.data.columns import Column, columns_found, find_columns, has_decibels, holds_levels, level_unit, meanings_of, unit_trouble
from motoremi.data.complex_columns import complex_trouble
from motoremi.data.detectors import DBUV_OF_0_DBM, detector_name
from motoremi.data.final_list import parts_of
from motoremi.data.immittance import PAIRS, column_values
from motoremi.data.overload import may_mark_overload, overload_of
from motoremi.data.repeated import Levels, spectrum_of
from motoremi.data.rows import rising_frequency
from motoremi.data.separators import grouping_warnings
from motoremi.data.spectrum import DETECTORS, Spectrum
from motoremi.data.spectrum_header import bandwidth_hz
from motoremi.data.table import Table
from motoremi.data.text import clean_text
from motoremi.data.text_file import WrongKind, of_file
from motoremi.errors import BadInput

# What a table of a spectrum needs, for messages; the second names its detector too.
SPECTRUM_COLUMNS = "frequency_hz,level_dbuv"
SPECTRUM_EXAMPLE = "frequency_hz,peak_dbuv"
_IMPEDANCE_MEANINGS = {name for pair in PAIRS for name in (pair.first, pair.second)}
# Meaning of a column without its detector -> what is added to its numbers for dBuV.
_OFFSETS = {"level": 0.0, "level_dbm": DBUV_OF_0_DBM}


# The bandwidth of a table that states none: that of band B.
ASSUMED_HZ = 9e3
# In a table of several detectors a cell without a level: final values are measured with the detector whose limit is near.
NOT_MEASURED = ("", "-", "--", "---")


@dataclass(frozen=True)
class _LevelColumn:
    detector: str
    column: Column
    offset_db: float


def spectra_of_table(table: Table, changes: Sequence[str] = ()) -> list[Spectrum]:
    """The spectra of a table.

    Parameters
    ----------
    table : Table
    changes : sequence of str
        What was changed before, in words; the metadata `changes` record it with what is left out here.

    Raises
    ------
    BadInput
        If frequency, level or detector are not stated, or a number is in doubt.
    """
    found = find_columns(table)
    columns = _level_columns(table, found)
    overload, marks = overload_of(table)
    header = {key: value for key, value in table.header.items() if key not in ("points", "detector", "rbw_hz")}
    stated = "rbw_hz" in table.header
    of_table_hz = of_file(table.name, partial(bandwidth_hz, table.header["rbw_hz"])) if stated else ASSUMED_HZ
    parts, beside = parts_of(table, column_values(table, found["frequency"]), of_table_hz)
    notes = (*changes, *_left_out(table, {found["frequency"].index, *marks, *beside, *(one.column.index for one in columns)}))

    spectra = []
    for one in columns:
        for part in parts:
            rows = [row for row in part.rows if len(columns) == 1 or table.rows[row][one.column.index].strip() not in NOT_MEASURED]
            if not rows:
                continue
            of_part = table.only(rows)
            frequency = rising_frequency(of_part, found["frequency"])
            without = len(part.rows) - len(rows)
            gaps = (f"{without} of {len(part.rows)} rows have no {one.detector} level",) if without else ()
            level = column_values(of_part, one.column) + one.offset_db
            levels = Levels(frequency, level, None if overload is None else overload[rows], (*notes, *gaps))
            metadata = header | part.metadata | ({"read_as": "dBm in 50 Ohm"} if one.offset_db else {})
            width_hz = of_table_hz if part.bandwidth_hz is None else part.bandwidth_hz
            metadata |= {} if stated or part.bandwidth_hz is not None else {"rbw_assumed": True}
            if doubts := grouping_warnings(of_part, found, frequency):
                metadata["warnings"] = list(doubts)
            spectra.append(of_file(table.name, partial(spectrum_of, one.detector, levels, width_hz, metadata)))
    if not spectra:
        raise BadInput(f"{table.name}: no row has a level")
    return spectra


def _level_columns(table: Table, found: Mapping[str, Column]) -> list[_LevelColumn]:
    """The columns of levels that are read, each with its detector."""
    named = [one for detector in DETECTORS for one in _columns_of(found, detector, f" {detector}")]
    written = table.header.get("detector")
    if not (named or _OFFSETS.keys() & found.keys()) or "frequency" not in found:
        raise _wrong_columns(table, found)
    if _OFFSETS.keys() & found.keys():
        if named:
            raise BadInput(f"{table.name}: a column of levels without detector stands beside others; keep one kind ({columns_found(table)})")
        return list(_columns_of(found, _detector(written, table.name), ""))
    if len(named) == 1 and written is not None and _detector(written, table.name) != named[0].detector:
        said = clean_text(str(written), 40)
        raise BadInput(f"{table.name}: its header says {said!r}, but its column is named {named[0].detector}; keep one")
    return named


def _columns_of(found: Mapping[str, Column], detector: str, ending: str) -> Iterator[_LevelColumn]:
    """The column of a detector; that in dBuV if there is one in dBm too."""
    meaning = next((meaning for meaning in _OFFSETS if meaning + ending in found), None)
    if meaning is not None:
        yield _LevelColumn(detector, found[meaning + ending], _OFFSETS[meaning])


def _detector(written: object, name: str) -> str:
    if not isinstance(written, str):
        raise BadInput(f"{name}: the detector is not stated; add a line '# detector: peak' (or quasi-peak, average)")
    return detector_name(written)


def _left_out(table: Table, used: set[int]) -> list[str]:
    """A sentence if columns of levels or marks of overload are not read."""
    titles = [title for index, title in enumerate(table.columns) if index not in used and (holds_levels(title) or may_mark_overload(title))]
    return [f"not read: the column{'s' if len(titles) > 1 else ''} {_listed(titles)}"] if titles else []


def _listed(titles: Sequence[str]) -> str:
    return ", ".join(repr(clean_text(title, 40)) for title in titles)


def _wrong_columns(table: Table, found: Mapping[str, Column]) -> BadInput:
    have = f"found {columns_found(table)}"
    if _IMPEDANCE_MEANINGS & set(found):
        return WrongKind(f"{table.name}: is an impedance sweep ({have}), but an emission spectrum is needed here")
    troubles = [trouble for trouble in (unit_trouble(table), complex_trouble(table)) if trouble]
    has_levels = any(meaning.startswith("level") for meaning in found)
    if not troubles and not has_levels and (why := _levels_not_read(table)):
        return BadInput(f"{table.name}: {have}, {why}")
    if not any(meanings_of(title) for title in table.columns):
        troubles.insert(0, "there is no row of column names with units")
    return BadInput(f"{table.name}: {'; '.join([*troubles, have])}, but an emission spectrum needs the columns {SPECTRUM_COLUMNS}")


def _levels_not_read(table: Table) -> str:
    """Why no column in decibel is read as a level; empty if there is none."""
    units = {title: level_unit(title) for title in table.columns}
    if unnamed := [title for title, unit in units.items() if unit in ("dbuv", "dbm")]:
        known = f"{', '.join(DETECTORS[:-1])} or {DETECTORS[-1]}"
        return f"but no known detector name in {_listed(unnamed)}: write {known}, or level with a line '# detector: peak'"
    if any(unit.endswith(("a", "/m")) for unit in units.values()):
        return "which holds levels behind a transducer: import the receiver's readings in dBuV, and give the transducer with --corrections"
    return f"in another decibel unit; convert to dBuV: needed are {SPECTRUM_COLUMNS}" if has_decibels(table) else ""
