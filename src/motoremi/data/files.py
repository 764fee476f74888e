"""Read measurement files. The format is recognised from the content, never from the file name."""

from __future__ import annotations

import dataclasses
import os
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from motoremi.arrays import JsonDict
from motoremi.data.agilent_ascii import is_agilent_ascii, parse_agilent_ascii
from motoremi.data.analyser_csv import is_analyser_csv, plain_table
from motoremi.data.columns import (
    REFLECTION_SIZES,
    Column,
    columns_found,
    find_columns,
    has_decibels,
    meanings_of,
    not_understood,
    unit_trouble,
    with_units,
    without_description,
)
from motoremi.data.complex_columns import complex_trouble, with_parts
from motoremi.data.conditions import Condition, parse_condition
from motoremi.data.immittance import IMPEDANCE_COLUMNS, LOSSES, PAIRS, REFLECTIONS, column_values, find_pair, impedance_of, in_rising_order
from motoremi.data.keysight_trace import is_keysight_trace, parse_keysight_trace
from motoremi.data.other_programs import table_of_other_program
from motoremi.data.plausible import implausible, negative_resistance
from motoremi.data.quantity import REFLECTION
from motoremi.data.receiver_dat import is_receiver_dat, parse_receiver_dat
from motoremi.data.repeated import merge_duplicates
from motoremi.data.rounding import rounding_of
from motoremi.data.rows import Band, Rows, reflection_warnings, refuse_between_ports, refuse_other_reference, rising_frequency, used_rows
from motoremi.data.separators import grouping_warnings
from motoremi.data.spectrum import Spectrum
from motoremi.data.spectrum_header import kept_header, spectrum_header
from motoremi.data.spectrum_table import SPECTRUM_EXAMPLE, spectra_of_table
from motoremi.data.sweep import TERMINATIONS, ImpedanceSweep, checked_accuracy
from motoremi.data.table import Table, parse_table
from motoremi.data.text_file import WrongKind, decode, file_name, of_file, read_bytes, show_name
from motoremi.data.tinysa_csv import is_two_columns, parse_tinysa
from motoremi.data.touchstone import is_touchstone, option_trouble, parse_touchstone
from motoremi.errors import BadInput
from motoremi.given import refuse_other

# A title of a reactance without its sign.
_UNSIGNED = re.compile(r"\s*(\|\s*X\w*\s*\||abs\(\s*X\w*\s*\))", re.IGNORECASE)

# Columns of errors, which are not those of the impedance itself.
_ERRORS = ("sigma_relative", "rounding_relative")


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
    fixture : {"series-through", "shunt-through", "reflection"}, optional
        For Touchstone of two ports: whether the motor was connected in series between the ports, across the line, or at port 1 alone.
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
    sweeps = parse_impedances(text, name, termination, fixture, band, units)
    if len(sweeps) > 1:
        raise BadInput(f"{name}: its table holds {len(sweeps)} {termination} sweeps; motoremi import and read_impedances read them all")
    return sweeps[0]


def read_impedances(
    path: str | os.PathLike[str],
    termination: str,
    fixture: str | None = None,
    band: Band | None = None,
    units: Mapping[str, str] | None = None,
) -> list[ImpedanceSweep]:
    """Read the sweeps of one termination in a file: one, or those of a table of several with a column `termination`, as `motoremi export` writes.

    Parameters and exceptions are those of `read_impedance`.
    """
    name, text = _read_text(path)
    return parse_impedances(text, name, termination, fixture, band, units)


def parse_impedances(
    text: str, name: str, termination: str, fixture: str | None = None, band: Band | None = None, units: Mapping[str, str] | None = None
) -> list[ImpedanceSweep]:
    """The sweeps of one termination from the text of a file; see `read_impedances`."""
    readings = _readings(text, name, termination, fixture, band, units or {})
    return [_finished(rows, header, kind, name, termination) for rows, header, kind in readings]


def _finished(rows: Rows, header: JsonDict, kind: str, name: str, termination: str) -> ImpedanceSweep:
    merged = merge_duplicates(rows)
    if "accuracy_percent" in header:
        header["accuracy_percent"] = of_file(name, lambda: checked_accuracy(header["accuracy_percent"]))
    condition = _condition(header, name)
    return of_file(name, lambda: _sweep(termination, merged, _origin(kept_header(header), name, kind))).under(condition)


def _condition(header: JsonDict, name: str) -> Condition | None:
    """The condition in a line `condition: ...` of the header, which is removed from it."""
    keys = [key for key in header if key.lower() == "condition"]
    written = [str(header.pop(key)) for key in keys]
    return of_file(name, lambda: parse_condition(written[0])) if written else None


def _readings(
    text: str, name: str, termination: str, fixture: str | None, band: Band | None, units: Mapping[str, str]
) -> list[tuple[Rows, JsonDict, str]]:
    """Of each sweep in a file the rows, the header with `read_as`, and the name of its format."""
    if is_agilent_ascii(text):
        frequency, impedance, rounding, header = parse_agilent_ascii(text, name)
        used, changes = used_rows(frequency, band, name)
        rounding = None if rounding is None else rounding[used]
        rows = Rows(frequency[used], impedance[used], None, lambda row: name, changes, rounding_relative=rounding)
        return [(rows, header, "4294a-ascii")]
    if is_touchstone(text):
        return [(*parse_touchstone(text, name, fixture, band), "touchstone")]
    if trouble := option_trouble(text, name):
        raise BadInput(f"{name}: {trouble}")
    if is_analyser_csv(text):
        plain, known = plain_table(text, name)
        rows, header, title = _rows_of_table(parse_table(plain, name), termination, band)
        return [(rows, {**header, **known, "read_as": title}, "e4990a-csv" if "analyser" in known else "analyser-csv")]
    if is_receiver_dat(text) or is_keysight_trace(text):
        raise WrongKind(f"{name}: is the spectrum of a receiver, but an impedance sweep is needed here")
    table, kind = table_of_other_program(text, name) or (parse_table(text, name), "csv")
    table, given = with_units(without_description(table), units)
    readings = []
    for part in _sweeps_in(table, termination):
        rows, header, title = _rows_of_table(part, termination, band)
        readings.append((dataclasses.replace(rows, changes=(*rows.changes, *given)), {**header, "read_as": title}, kind))
    return readings


def _sweeps_in(table: Table, termination: str) -> list[Table]:
    """The rows of each sweep of this termination, in a table with a column `termination`; another table is one sweep.

    Repeats and conditions are told apart by the columns `repeat`, `condition`, `condition_value` and `condition_unit`.

    Raises
    ------
    BadInput
        If no row is of this termination.
    """
    places = {title.strip().lower(): index for index, title in enumerate(table.columns)}
    column = places.get("termination")
    if column is None or not all(cells[column] in TERMINATIONS for cells in table.rows):
        return [table]
    tells = [places[title] for title in ("repeat", "condition", "condition_value", "condition_unit") if title in places]
    rows: dict[tuple[str, ...], list[int]] = {}
    for row, cells in enumerate(table.rows):
        if cells[column] == termination:
            rows.setdefault(tuple(cells[index] for index in tells), []).append(row)
    if not rows:
        raise BadInput(f"{table.name}: none of its rows is of the {termination} sweep, according to its column termination")
    parts = []
    for numbers in rows.values():
        first = table.rows[numbers[0]]
        identifier, value, unit = (first[places[title]] if title in places else "" for title in ("condition", "condition_value", "condition_unit"))
        header = {**table.header, **({"condition": f"{identifier}={value}{unit}" if value else identifier} if identifier else {})}
        parts.append(dataclasses.replace(table.only(numbers), header=header))
    return parts


def read_spectra(path: str | os.PathLike[str], units: Mapping[str, str] | None = None) -> list[Spectrum]:
    """Read the emission spectra of one file: one for each trace or column.

    Parameters
    ----------
    path : path-like
        CSV with the columns `frequency_hz,level_dbuv` and the lines `# detector: peak` and `# rbw_hz: 9000`, or with columns named
        after detectors (`Frequency (MHz),QuasiPeak (dBuV),CAverage (dBuV)`), in dBuV or dBm; a receiver's DAT export; the CSV of one
        trace of a Keysight receiver; a tinySA's CSV. Without a bandwidth 9 kHz is assumed, and the metadata record it. A line
        `# condition: motor off` makes it a background.
    units : mapping, optional
        As for `read_impedance`.

    Returns
    -------
    list of Spectrum
        The metadata `changes` record what was left out: columns that are not read, and the lower of two readings at one frequency;
        `final_values_left_out` says which final values of a receiver's file are not among the spectra (`read_emission` reads them).

    Raises
    ------
    BadInput
        One line with file, line number and what to do, if any number is in doubt.
    """
    name, text = _read_text(path)
    return parse_spectra(text, name, units)


def parse_spectra(text: str, name: str, units: Mapping[str, str] | None = None) -> list[Spectrum]:
    """The emission spectra from the text of a file; see `read_spectra`."""
    return _emission(text, name, units, with_finals=False)[0]


def read_emission(path: str | os.PathLike[str], units: Mapping[str, str] | None = None) -> tuple[list[Spectrum], list[Spectrum]]:
    """Read the emission spectra of one file, and the final values that a receiver's DAT export holds beside them.

    Parameters
    ----------
    path, units
        As for `read_spectra`.

    Returns
    -------
    spectra : list of Spectrum
        The metadata `final_values_left_out` say which final values cannot be used, and why.
    finals : list of Spectrum
        Final values, each of a single point, in dBuV, with `maximum_hz` (its frequency), and where they are stated `dwell_s` (its measuring time
        in seconds) and `phase` (the line of the LISN) in the metadata.

    Raises
    ------
    BadInput
        As `read_spectra`.
    """
    name, text = _read_text(path)
    return parse_emission(text, name, units)


def parse_emission(text: str, name: str, units: Mapping[str, str] | None = None) -> tuple[list[Spectrum], list[Spectrum]]:
    """The emission spectra and the final values from the text of a file; see `read_emission`."""
    return _emission(text, name, units, with_finals=True)


def _emission(text: str, name: str, units: Mapping[str, str] | None, with_finals: bool) -> tuple[list[Spectrum], list[Spectrum]]:
    for is_other, what in (
        (is_agilent_ascii, "is an impedance sweep of a 4294A"),
        (is_touchstone, "is a Touchstone file"),
        (is_analyser_csv, "is an impedance sweep of an analyser"),
    ):
        if is_other(text):
            raise WrongKind(f"{name}: {what}, but an emission spectrum is needed here")
    finals: list[Spectrum] = []
    if is_keysight_trace(text):
        spectra, kind = [parse_keysight_trace(text, name)], "keysight-trace"
    elif is_receiver_dat(text):
        (spectra, finals), kind = parse_receiver_dat(text, name, with_finals), "receiver-dat"
    elif is_two_columns(text):
        spectra, kind = [parse_tinysa(text, name)], "tinysa-csv"
    else:
        table, given = with_units(parse_table(text, name, SPECTRUM_EXAMPLE), units or {})
        header = of_file(name, lambda: spectrum_header(table.header))
        every, kind = spectra_of_table(dataclasses.replace(table, header=header), (*table.left_out, *given)), "csv"
        # A file of a session may be that of a final value.
        spectra = [one for one in every if not (with_finals and "maximum_hz" in one.metadata)]
        finals = [one for one in every if one not in spectra]
        if any(len(one) < 2 for one in spectra):
            raise BadInput(f"{name}: is a final value of a single point, and no spectrum; read_emission reads it")
    return _with_origin(spectra, name, kind), _with_origin(finals, name, kind)


def _with_origin(spectra: Sequence[Spectrum], name: str, kind: str) -> list[Spectrum]:
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

    The file is one that motoremi wrote, with all digits that it had: only its column `rounding_relative` says to which digits numbers were rounded.

    Raises
    ------
    BadInput
        As `read_impedance`, and if a frequency occurs twice.
    """
    rows, header, _ = _rows_of_table(parse_table(text, name), termination, by_digits=False)
    return of_file(name, lambda: _sweep(termination, rows, header))


def _rows_of_table(given: Table, termination: str, band: Band | None = None, by_digits: bool = True) -> tuple[Rows, JsonDict, str]:
    """The rows, the header, and the pair of quantities in the columns; with `by_digits`, their digits say how they are rounded."""
    name = given.name
    table = with_parts(given)
    found = find_columns(table)
    pair = find_pair(found)
    if pair is None or "frequency" not in found:
        raise _wrong_columns(given, found)
    used_columns = {column.index for column in found.values()}
    unused = {meaning for index, title in enumerate(table.columns) if index not in used_columns for meaning in meanings_of(title)}
    possible = find_pair({*found, *unused}) or pair
    if pair in REFLECTIONS[1:] and PAIRS.index(possible) < PAIRS.index(pair):
        # A rounded reflection near 1 says little of R, which other columns hold but for their units.
        raise _wrong_columns(given, found)
    table, turned = in_rising_order(table, found["frequency"])
    frequency = rising_frequency(table, found["frequency"])
    used, changes = used_rows(frequency, band, name)
    changes = (*table.left_out, *turned, *changes)
    frequency, table = frequency[used], table.only(used.tolist())
    warnings = grouping_warnings(table, found, frequency)
    header = dict(table.header)
    header.pop("points", None)
    written = header.get("termination")
    if written in TERMINATIONS:
        if written != termination:
            raise BadInput(f"{name}: its header says it is the {written} sweep, but it was given as the {termination} sweep")
        del header["termination"]
    # In a table of several sweeps an error may be stated for some of them: its cells are empty for the others.
    found = {meaning: column for meaning, column in found.items() if meaning not in _ERRORS or any(cells[column.index] for cells in table.rows)}
    sigma = column_values(table, found["sigma_relative"]) if "sigma_relative" in found else None
    impedance = impedance_of(table, found, pair, frequency)
    if pair.second in LOSSES and impedance.size and np.all(impedance.real >= 0):
        below = int(np.sum(column_values(table, found[pair.second]) < 0))
        changes += (f"{pair.title}: the second is below 0 at {below} points, with the sign of the reactance; used without it",) if below else ()
    if pair in REFLECTIONS:
        refuse_between_ports(header, name)
        refuse_other_reference(header, name)
        warnings += reflection_warnings(REFLECTION.coefficient_of(impedance))
    known = by_digits or "rounding_relative" in found
    rounding = rounding_of(table, found, pair, frequency, impedance) if known else None
    return Rows(frequency, impedance, sigma, table.where, changes, warnings, rounding), header, pair.title


def parse_spectrum_csv(text: str, name: str) -> Spectrum:
    """A spectrum from the text of a CSV file that holds one; metadata are those of its header.

    Raises
    ------
    BadInput
        As `read_spectrum`.
    """
    spectra = spectra_of_table(parse_table(text, name, SPECTRUM_EXAMPLE))
    if len(spectra) > 1:
        raise BadInput(f"{name}: holds {len(spectra)} spectra where one is needed")
    return spectra[0]


def _read_text(path: str | os.PathLike[str]) -> tuple[str, str]:
    refuse_other(path, (str, os.PathLike), "a file is read from its path")
    name = show_name(path)
    return name, decode(read_bytes(path), name)


def _origin(metadata: Mapping[str, Any], name: str, file_format: str) -> JsonDict:
    return {**metadata, "source": file_name(name), "format": file_format}


def _sweep(termination: str, rows: Rows, metadata: JsonDict) -> ImpedanceSweep:
    # A sweep of a session has those of its import in its header.
    warnings = [*metadata.get("warnings", []), *rows.warnings, *implausible(rows.frequency_hz, rows.impedance_ohm)]
    if not any(one.startswith("|S11|") for one in warnings):  # which says the same
        warnings += negative_resistance(rows.impedance_ohm, from_waves=metadata.get("format") == "touchstone")
    warnings = list(dict.fromkeys(warnings))
    noted = {key: list(texts) for key, texts in (("changes", rows.changes), ("warnings", warnings)) if texts}
    stated = {**metadata, **noted}
    return ImpedanceSweep(termination, rows.frequency_hz, rows.impedance_ohm, rows.sigma_relative, stated, rounding_relative=rows.rounding_relative)


def _wrong_columns(table: Table, found: dict[str, Column]) -> BadInput:
    unknown = not_understood(table)
    have = f"found {columns_found(table)}{f'; {unknown}' if unknown else ''}"
    if any(meaning.startswith("level") for meaning in found):
        return WrongKind(f"{table.name}: is an emission spectrum ({have}), but an impedance sweep is needed here")
    if "phase" in found and found.keys() & REFLECTION_SIZES and "magnitude" not in found:
        return BadInput(f"{table.name}: {have}: the phase is that of Z and the magnitude that of S11; save both of one quantity")
    troubles = [trouble for trouble in (unit_trouble(table), complex_trouble(table)) if trouble]
    if any(_UNSIGNED.match(title) for title in table.columns):
        troubles.append("|X| has lost the sign of the reactance: save X with its sign, or |Z| and its phase")
    elif "magnitude" in found and not troubles:
        troubles.append("|Z| alone is not enough: save its phase too, or R and X")
    if not troubles and has_decibels(table):
        return BadInput(f"{table.name}: {have}, in another decibel unit; convert to ohm: needed are {IMPEDANCE_COLUMNS}")
    possible = _possible_meanings(table)
    lacking = troubles and find_pair(possible) is None
    if troubles and not lacking and "frequency" in possible:
        return BadInput(f"{table.name}: {'; '.join(troubles)} ({have})")
    # What is missing apart from units is reported in one message.
    why = "no two of them give an impedance: needed are" if lacking else "an impedance sweep needs"
    if not any(meanings_of(title) for title in table.columns):
        troubles.insert(0, "there is no row of column names with units")
    return BadInput(f"{table.name}: {'; '.join([*troubles, have])}, but {why} the columns {IMPEDANCE_COLUMNS}")


def _possible_meanings(table: Table) -> set[str]:
    """What the columns may hold by their names, whatever their units."""
    return {meaning for title in with_parts(table).columns for meaning in meanings_of(title)}
