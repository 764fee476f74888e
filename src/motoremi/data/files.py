"""Read measurement files. The format is recognised from the content, never from the file name."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, TypeVar

import numpy as np

from motoremi.arrays import BoolArray, FloatArray, JsonDict
from motoremi.data.agilent_ascii import is_agilent_ascii, parse_agilent_ascii
from motoremi.data.analyser_csv import is_analyser_csv, plain_table
from motoremi.data.columns import Column, columns_found, find_columns, has_decibels, meanings_of, unit_trouble, with_units
from motoremi.data.complex_columns import complex_trouble, with_parts
from motoremi.data.conditions import Condition, parse_condition
from motoremi.data.detectors import DBUV_OF_0_DBM, detector_name
from motoremi.data.immittance import IMPEDANCE_COLUMNS, PAIRS, REFLECTION, column_values, find_pair, impedance_of, reflection_of
from motoremi.data.numbers import look_grouped
from motoremi.data.plausible import implausible
from motoremi.data.receiver_dat import is_receiver_dat, parse_receiver_dat
from motoremi.data.repeated import merge_duplicates
from motoremi.data.rows import Band, Rows, reflection_warnings, refuse_between_ports, used_rows
from motoremi.data.spectrum import DETECTORS, Spectrum
from motoremi.data.sweep import TERMINATIONS, ImpedanceSweep, check_order, checked_accuracy
from motoremi.data.table import Table, parse_table
from motoremi.data.text import clean_text
from motoremi.data.text_file import decode, file_name, read_bytes, show_name
from motoremi.data.tinysa_csv import is_two_columns, parse_tinysa
from motoremi.data.touchstone import is_touchstone, parse_touchstone
from motoremi.errors import BadInput
from motoremi.quantities import parse, show_band

SPECTRUM_COLUMNS = "frequency_hz,level_dbuv"
Made = TypeVar("Made")


class WrongKind(BadInput):
    """A file that holds a spectrum where a sweep was expected, or the other way round."""


_IMPEDANCE_MEANINGS = {name for pair in PAIRS for name in (pair.first, pair.second)}


def read_impedance(
    path: str | os.PathLike[str],
    termination: str,
    fixture: str | None = None,
    band: Band | None = None,
    units: Mapping[str, str] | None = None,
) -> ImpedanceSweep:
    """Read one impedance sweep.

    Parameters
    ----------
    path : path-like
        CSV with the columns `frequency_hz` and `resistance_ohm,reactance_ohm` or `impedance_ohm,phase_deg` (or another pair of
        quantities with its units), the ASCII file of a 4294A, the CSV of an E4990A, or Touchstone of one port (.s1p, .z1p) or of two
        (.s2p) with the motor between them.
    termination : {"short", "open"}
        Connection of the motor.
    fixture : {"series-through", "shunt-through"}, optional
        For Touchstone of two ports: whether the motor was connected in series between the ports, or across the line.
    band : (float, float), optional
        Both ends in hertz, included; rows outside are left out before the values of the others are checked.
    units : mapping, optional
        Units of columns of a table that does not name them, by the column's name: `{"FREQ": "Hz", "Z": "Ohm", "PHASE": "deg"}`.

    Returns
    -------
    ImpedanceSweep
        With `source`, `format`, `read_as` and the header of the file in its metadata. A first row at 0 Hz is left out, and two rows of one
        frequency that agree within 3 % are averaged; the metadata `changes` record it. If a reflection is above 1 at more than 1 % of the
        points, the metadata `warnings` say so.

    Raises
    ------
    BadInput
        One line with file, line number and what to do, if any number is in doubt.
    """
    name, text = _read_text(path)
    return parse_impedance(text, name, termination, fixture, band, units)


def parse_impedance(
    text: str, name: str, termination: str, fixture: str | None = None, band: Band | None = None, units: Mapping[str, str] | None = None
) -> ImpedanceSweep:
    """One impedance sweep from the text of a file; see `read_impedance`."""
    rows, header, kind = _impedance_rows(text, name, termination, fixture, band, units or {})
    merged = merge_duplicates(rows)
    if "accuracy_percent" in header:
        header["accuracy_percent"] = _of_file(name, lambda: checked_accuracy(header["accuracy_percent"]))
    condition = _condition(header, name)
    return _of_file(name, lambda: _sweep(termination, merged, _origin(header, name, kind))).under(condition)


def _condition(header: JsonDict, name: str) -> Condition | None:
    """The condition in a line `condition: ...` of the header, which is removed from it."""
    keys = [key for key in header if key.lower() == "condition"]
    written = [str(header.pop(key)) for key in keys]
    return _of_file(name, lambda: parse_condition(written[0])) if written else None


def _impedance_rows(
    text: str, name: str, termination: str, fixture: str | None, band: Band | None, units: Mapping[str, str]
) -> tuple[Rows, JsonDict, str]:
    """The rows of a file, its header with `read_as`, and the name of its format."""
    if is_agilent_ascii(text):
        frequency, impedance, header = parse_agilent_ascii(text, name)
        used, changes = used_rows(frequency, band, name)
        return Rows(frequency[used], impedance[used], None, lambda row: name, changes), header, "4294a-ascii"
    if is_touchstone(text):
        return *parse_touchstone(text, name, fixture, band), "touchstone"
    if is_analyser_csv(text):
        plain, known = plain_table(text, name)
        rows, header, title = _rows_of_table(parse_table(plain, name), termination, band)
        return rows, {**header, **known, "read_as": title}, "e4990a-csv" if "analyser" in known else "analyser-csv"
    if is_receiver_dat(text):
        raise WrongKind(f"{name}: is the spectrum of a receiver, but an impedance sweep is needed here")
    table, given = with_units(parse_table(text, name), units)
    rows, header, title = _rows_of_table(table, termination, band)
    return dataclasses.replace(rows, changes=(*rows.changes, *given)), {**header, "read_as": title}, "csv"


def read_spectra(path: str | os.PathLike[str], units: Mapping[str, str] | None = None) -> list[Spectrum]:
    """Read the emission spectra of one file: one for each trace or column.

    Parameters
    ----------
    path : path-like
        CSV with the columns `frequency_hz,level_dbuv` and the lines `# detector: peak` and `# rbw_hz: 9000`, or with columns named
        after detectors (`Frequency (MHz),QuasiPeak (dBuV),CAverage (dBuV)`); a receiver's DAT export; a tinySA's CSV. Without a
        bandwidth 9 kHz is assumed, and the metadata record it.
    units : mapping, optional
        As for `read_impedance`.

    Raises
    ------
    BadInput
        One line with file, line number and what to do, if any number is in doubt.
    """
    name, text = _read_text(path)
    return parse_spectra(text, name, units)


def parse_spectra(text: str, name: str, units: Mapping[str, str] | None = None) -> list[Spectrum]:
    """The emission spectra from the text of a file; see `read_spectra`."""
    for is_other, what in (
        (is_agilent_ascii, "is an impedance sweep of a 4294A"),
        (is_touchstone, "is a Touchstone file"),
        (is_analyser_csv, "is an impedance sweep of an analyser"),
    ):
        if is_other(text):
            raise WrongKind(f"{name}: {what}, but an emission spectrum is needed here")
    if is_receiver_dat(text):
        spectra, kind = parse_receiver_dat(text, name), "receiver-dat"
    elif is_two_columns(text):
        spectra, kind = [parse_tinysa(text, name)], "tinysa-csv"
    else:
        table, given = with_units(parse_table(text, name), units or {})
        changed = {"changes": list(given)} if given else {}
        spectra = [dataclasses.replace(one, metadata={**one.metadata, **changed}) for one in _spectra_of_table(table)]
        kind = "csv"
    return [dataclasses.replace(spectrum, metadata=_origin(spectrum.metadata, name, kind)) for spectrum in spectra]


def read_spectrum(path: str | os.PathLike[str]) -> Spectrum:
    """Read a file that holds one emission spectrum; see `read_spectra`.

    Raises
    ------
    BadInput
        As `read_spectra`, and if the file holds several.
    """
    spectra = read_spectra(path)
    if len(spectra) > 1:
        raise BadInput(f"{show_name(path)}: holds {len(spectra)} spectra; read them with read_spectra")
    return spectra[0]


def parse_impedance_csv(text: str, name: str, termination: str) -> ImpedanceSweep:
    """An impedance sweep from the text of a CSV file; metadata are those of its header, and rows of one frequency are not merged.

    Raises
    ------
    BadInput
        As `read_impedance`, and if a frequency occurs twice.
    """
    rows, header, _ = _rows_of_table(parse_table(text, name), termination)
    return _of_file(name, lambda: _sweep(termination, rows, header))


def _rows_of_table(given: Table, termination: str, band: Band | None = None) -> tuple[Rows, JsonDict, str]:
    """The rows, the header, and the pair of quantities in the columns."""
    name = given.name
    table = with_parts(given)
    found = find_columns(table)
    pair = find_pair(found)
    if pair is None or "frequency" not in found:
        raise _wrong_columns(given, found, IMPEDANCE_COLUMNS, "an impedance sweep")
    frequency = _frequency(table, found["frequency"])
    used, changes = used_rows(frequency, band, name)
    frequency, table = frequency[used], table.only(used.tolist())
    warnings = _grouping_warnings(table, found["frequency"], frequency)
    header = dict(table.header)
    header.pop("points", None)
    written = header.get("termination")
    if written in TERMINATIONS:
        if written != termination:
            raise BadInput(f"{name}: its header says it is the {written} sweep, but it was given as the {termination} sweep")
        del header["termination"]
    sigma = column_values(table, found["sigma_relative"]) if "sigma_relative" in found else None
    impedance = impedance_of(table, found, pair, frequency)
    if pair.title == REFLECTION.title:
        refuse_between_ports(header, name)
        warnings += reflection_warnings(reflection_of(table, found))
    return Rows(frequency, impedance, sigma, table.where, changes, warnings), header, pair.title


def parse_spectrum_csv(text: str, name: str) -> Spectrum:
    """A spectrum from the text of a CSV file that holds one; metadata are those of its header.

    Raises
    ------
    BadInput
        As `read_spectrum`.
    """
    spectra = _spectra_of_table(parse_table(text, name))
    if len(spectra) > 1:
        raise BadInput(f"{name}: holds {len(spectra)} spectra where one is needed")
    return spectra[0]


def _spectra_of_table(table: Table) -> list[Spectrum]:
    name = table.name
    found = find_columns(table)
    named = [detector for detector in DETECTORS if f"level {detector}" in found]
    general: str | None = next((meaning for meaning in ("level", "level_dbm") if meaning in found), None)
    if general is None and not named:
        raise _wrong_columns(table, found, SPECTRUM_COLUMNS, "an emission spectrum")
    if general is not None and named:
        raise BadInput(f"{name}: a column of levels without detector stands beside others; keep one kind ({columns_found(table)})")
    if "frequency" not in found:
        raise _wrong_columns(table, found, SPECTRUM_COLUMNS, "an emission spectrum")
    frequency = _frequency(table, found["frequency"])
    for row in np.flatnonzero(np.diff(frequency) == 0)[:1]:
        raise BadInput(f"{table.where(int(row) + 1)}: the frequency {frequency[row]:g} Hz occurs twice; keep one row for each frequency")
    header = dict(table.header)
    header.pop("points", None)
    written = header.pop("detector", None)
    if "rbw_hz" in header:
        bandwidth = _bandwidth(header.pop("rbw_hz"), name)
    else:
        bandwidth = 9e3
        header["rbw_assumed"] = True
    overload = _overload(table, found["overload"]) if "overload" in found else None
    columns: dict[str, str]
    if general is not None:
        columns = {_detector(written, name): general}
    else:
        if len(named) == 1 and written is not None and _detector(written, name) != named[0]:
            raise BadInput(f"{name}: its header says {clean_text(str(written), 40)!r}, but its column is named {named[0]}; keep one")
        columns = {detector: f"level {detector}" for detector in named}
    if general == "level_dbm":
        header["read_as"] = "dBm in 50 Ohm"
    spectra = []
    for detector, meaning in columns.items():
        level = column_values(table, found[meaning]) + (DBUV_OF_0_DBM if meaning == "level_dbm" else 0.0)
        spectra.append(_of_file(name, partial(Spectrum, detector, frequency, level, bandwidth, overload, header)))
    return spectra


def _read_text(path: str | os.PathLike[str]) -> tuple[str, str]:
    name = show_name(path)
    return name, decode(read_bytes(path), name)


def _origin(metadata: Mapping[str, Any], name: str, file_format: str) -> dict[str, Any]:
    # Entries of the file's own header with these names are kept under another key.
    kept = {f"header_{key}" if key in ("source", "format", "changes", "warnings") else key: value for key, value in metadata.items()}
    return {**kept, "source": file_name(name), "format": file_format}


def _sweep(termination: str, rows: Rows, metadata: JsonDict) -> ImpedanceSweep:
    warnings = (*rows.warnings, *implausible(rows.frequency_hz, rows.impedance_ohm))
    noted = {key: list(texts) for key, texts in (("changes", rows.changes), ("warnings", warnings)) if texts}
    return ImpedanceSweep(termination, rows.frequency_hz, rows.impedance_ohm, rows.sigma_relative, {**metadata, **noted})


def _of_file(name: str, make: Callable[[], Made]) -> Made:
    """Call `make`, and add the file's name to its `BadInput`."""
    try:
        return make()
    except BadInput as error:
        raise BadInput(f"{name}: {error}") from error


def _wrong_columns(table: Table, found: dict[str, Column], needed: str, what: str) -> BadInput:
    have = f"found {columns_found(table)}"
    if any(meaning.startswith("level") for meaning in found) and needed != SPECTRUM_COLUMNS:
        return WrongKind(f"{table.name}: is an emission spectrum ({have}), but {what} is needed here")
    if needed == SPECTRUM_COLUMNS and _IMPEDANCE_MEANINGS & set(found):
        return WrongKind(f"{table.name}: is an impedance sweep ({have}), but {what} is needed here")
    troubles = [trouble for trouble in (unit_trouble(table), complex_trouble(table)) if trouble]
    if not troubles and has_decibels(table):
        wanted = "dBuV (in 50 Ohm: dBm + 107)" if needed == SPECTRUM_COLUMNS else "ohm"
        return BadInput(f"{table.name}: {have}, in another decibel unit; convert to {wanted}: needed are {needed}")
    possible = _possible_meanings(table)
    lacking = needed != SPECTRUM_COLUMNS and troubles and find_pair(possible) is None
    if needed != SPECTRUM_COLUMNS and troubles and not lacking and "frequency" in possible:
        return BadInput(f"{table.name}: {'; '.join(troubles)} ({have})")
    # What is missing apart from units is told at once.
    why = f"no two of them give an impedance: needed are the columns {needed}" if lacking else f"{what} needs the columns {needed}"
    if not any(meanings_of(title) for title in table.columns):
        troubles.insert(0, "there is no row of column names with units")
    return BadInput(f"{table.name}: {'; '.join([*troubles, have])}, but {why}")


def _possible_meanings(table: Table) -> set[str]:
    """What the columns may hold by their names, whatever their units."""
    return {meaning for title in with_parts(table).columns for meaning in meanings_of(title)}


def _grouping_warnings(table: Table, column: Column, frequency_hz: FloatArray) -> tuple[str, ...]:
    """A sentence if frequencies in hertz look like thousands with a separator."""
    cells = [row[column.index] for row in table.rows]
    if column.factor != 1 or not look_grouped(cells):
        return ()
    read = show_band(float(frequency_hz[0]), float(frequency_hz[-1]))
    return (f"frequencies such as {cells[0]} are read as {read}: if a separator of thousands is meant, write the numbers without it",)


def _frequency(table: Table, column: Column) -> FloatArray:
    frequency = column_values(table, column)
    for row in np.flatnonzero(np.diff(frequency) < 0)[:1]:
        check_order(frequency[row + 1], frequency[row], table.where(int(row) + 1))
    return frequency


def _overload(table: Table, column: Column) -> BoolArray:
    marks = column_values(table, column)
    for row in np.flatnonzero((marks != 0) & (marks != 1))[:1]:
        raise BadInput(f"{table.where(int(row))}: overload is {marks[row]:g}; write 0 or 1")
    return marks.astype(np.bool_)


def _detector(written: object, name: str) -> str:
    if not isinstance(written, str):
        raise BadInput(f"{name}: the detector is not stated; add a line '# detector: peak' (or quasi-peak, average)")
    return detector_name(written)


def _bandwidth(written: object, name: str) -> float:
    if isinstance(written, (str, int, float)):
        try:
            return parse(written, "Hz")
        except BadInput:
            pass
    raise BadInput(f"{name}: the resolution bandwidth {clean_text(str(written), 40)!r} is not a frequency; write '# rbw_hz: 9000'")
