"""Read the files that users have. The format is found from the content, never from the name."""

from __future__ import annotations

import os
import re
from typing import Any

import numpy as np

from motoremi.arrays import BoolArray, ComplexArray, FloatArray
from motoremi.data.agilent_ascii import is_agilent_ascii, parse_agilent_ascii
from motoremi.data.columns import Column, columns_found, find_columns, has_decibels
from motoremi.data.source import decode, file_name, read_bytes, show_name, split_lines
from motoremi.data.spectrum import Spectrum
from motoremi.data.sweep import TERMINATIONS, ImpedanceSweep
from motoremi.data.table import Table, parse_table
from motoremi.data.text import clean_text
from motoremi.errors import BadInput
from motoremi.quantities import parse

IMPEDANCE_COLUMNS = "frequency_hz with resistance_ohm,reactance_ohm or with impedance_ohm,phase_deg"
SPECTRUM_COLUMNS = "frequency_hz,level_dbuv"
_DETECTOR_SPELLINGS = {
    "max-peak": "peak", "pk": "peak", "quasipeak": "quasi-peak", "qp": "quasi-peak", "av": "average", "avg": "average",
    "cispr-average": "average",
}  # fmt: skip
_TOUCHSTONE = re.compile(r"#\s*[KMG]?HZ\s+[SYZGH]\s+(?:RI|MA|DB)\b", re.IGNORECASE)


def read_impedance(path: str | os.PathLike[str], termination: str) -> ImpedanceSweep:
    """Read one impedance sweep.

    Parameters
    ----------
    path : path-like
        CSV with the columns `frequency_hz` and `resistance_ohm,reactance_ohm` or `impedance_ohm,phase_deg`, or the
        ASCII file of a 4294A.
    termination : {"short", "open"}
        How the motor was connected.

    Returns
    -------
    ImpedanceSweep
        With `source`, `format` and the header of the file in its metadata.

    Raises
    ------
    BadInput
        One line with file, line number and what to do, whenever a number is not beyond doubt.
    """
    name, text = _read_text(path)
    if is_agilent_ascii(text):
        frequency, impedance, header = parse_agilent_ascii(text, name)
        sweep = _sweep(name, termination, frequency, impedance, None, header)
        return _with_origin(sweep, path, "4294a-ascii")
    _refuse_other_formats(text, name)
    return _with_origin(parse_impedance_csv(text, name, termination), path, "csv")


def read_spectrum(path: str | os.PathLike[str]) -> Spectrum:
    """Read one emission spectrum.

    Parameters
    ----------
    path : path-like
        CSV with the columns `frequency_hz,level_dbuv` and the lines `# detector: peak` and `# rbw_hz: 9000`. Without
        the latter the bandwidth is taken to be 9 kHz, and the metadata say so.

    Raises
    ------
    BadInput
        One line with file, line number and what to do, whenever a number is not beyond doubt.
    """
    name, text = _read_text(path)
    if is_agilent_ascii(text):
        raise BadInput(f"{name}: is an impedance sweep of a 4294A, but an emission spectrum is needed here")
    _refuse_other_formats(text, name)
    spectrum = parse_spectrum_csv(text, name)
    return Spectrum(
        spectrum.detector,
        spectrum.frequency_hz,
        spectrum.level_dbuv,
        spectrum.resolution_bandwidth_hz,
        spectrum.overload,
        _origin(spectrum.metadata, path, "csv"),
    )


def parse_impedance_csv(text: str, name: str, termination: str) -> ImpedanceSweep:
    """An impedance sweep from the text of a CSV file; metadata are those of its header alone.

    Raises
    ------
    BadInput
        As `read_impedance`.
    """
    table = parse_table(text, name)
    found = find_columns(table)
    if not {"resistance", "reactance"} <= set(found) and not {"magnitude", "phase"} <= set(found):
        raise _wrong_columns(table, found, IMPEDANCE_COLUMNS, "an impedance sweep")
    frequency = _frequency(table, found, IMPEDANCE_COLUMNS, "an impedance sweep")
    header = dict(table.header)
    header.pop("points", None)
    written = header.get("termination")
    if written in TERMINATIONS:
        if written != termination:
            raise BadInput(f"{name}: its header says it is the {written} sweep, but it was given as the {termination} sweep")
        del header["termination"]
    sigma = _column(table, found["sigma_relative"]) if "sigma_relative" in found else None
    return _sweep(name, termination, frequency, _impedance(table, found), sigma, header)


def parse_spectrum_csv(text: str, name: str) -> Spectrum:
    """A spectrum from the text of a CSV file; metadata are those of its header alone.

    Raises
    ------
    BadInput
        As `read_spectrum`.
    """
    table = parse_table(text, name)
    found = find_columns(table)
    if "level" not in found:
        raise _wrong_columns(table, found, SPECTRUM_COLUMNS, "an emission spectrum")
    frequency = _frequency(table, found, SPECTRUM_COLUMNS, "an emission spectrum")
    header = dict(table.header)
    header.pop("points", None)
    detector = _detector(header.pop("detector", None), name)
    if "rbw_hz" in header:
        bandwidth = _bandwidth(header.pop("rbw_hz"), name)
    else:
        bandwidth = 9e3
        header["rbw_assumed"] = True
    overload = _overload(table, found["overload"]) if "overload" in found else None
    try:
        return Spectrum(detector, frequency, _column(table, found["level"]), bandwidth, overload, header)
    except BadInput as error:
        raise BadInput(f"{name}: {error}") from error


def _read_text(path: str | os.PathLike[str]) -> tuple[str, str]:
    name = show_name(path)
    return name, decode(read_bytes(path), name)


def _refuse_other_formats(text: str, name: str) -> None:
    lines = [line.strip() for line in split_lines(text[:20_000])]
    head = next((line for line in lines if line), "").lower()
    # In Touchstone files and analysers' own CSV, `!` opens a comment.
    first_content = next((line for line in lines if line and not line.startswith("!")), "")
    if _TOUCHSTONE.match(first_content):
        what = "a Touchstone file"
    elif head.startswith("!"):
        what = "an analyser's own export"
    elif head.startswith("type;"):
        what = "a receiver's own export"
    else:
        return
    raise BadInput(f"{name}: is {what}, which is not read here; save it as CSV with a row of column names and units")


def _origin(metadata: Any, path: str | os.PathLike[str], file_format: str) -> dict[str, Any]:
    # What the file itself calls its source or format is kept under another key, not overwritten.
    kept = {f"header_{key}" if key in ("source", "format") else key: value for key, value in metadata.items()}
    return {**kept, "source": file_name(path), "format": file_format}


def _with_origin(sweep: ImpedanceSweep, path: str | os.PathLike[str], file_format: str) -> ImpedanceSweep:
    return ImpedanceSweep(
        sweep.termination,
        sweep.frequency_hz,
        sweep.impedance_ohm,
        sweep.sigma_relative,
        _origin(sweep.metadata, path, file_format),
    )


def _sweep(
    name: str,
    termination: str,
    frequency: FloatArray,
    impedance: ComplexArray,
    sigma: FloatArray | None,
    metadata: dict[str, Any],
) -> ImpedanceSweep:
    try:
        return ImpedanceSweep(termination, frequency, impedance, sigma, metadata)
    except BadInput as error:
        raise BadInput(f"{name}: {error}") from error


def _wrong_columns(table: Table, found: dict[str, Column], needed: str, what: str) -> BadInput:
    have = f"found {columns_found(table)}"
    if "level" in found and needed != SPECTRUM_COLUMNS:
        return BadInput(f"{table.name}: is an emission spectrum ({have}), but {what} is needed here")
    if needed == SPECTRUM_COLUMNS and {"resistance", "reactance", "magnitude", "phase"} & set(found):
        return BadInput(f"{table.name}: is an impedance sweep ({have}), but {what} is needed here")
    if has_decibels(table):
        cure = "dBuV (in 50 Ohm: dBm + 107)" if needed == SPECTRUM_COLUMNS else "ohm"
        return BadInput(f"{table.name}: {have}, in another decibel unit; convert to {cure}: needed are {needed}")
    return BadInput(f"{table.name}: {have}, but {what} needs the columns {needed}")


def _frequency(table: Table, found: dict[str, Column], needed: str, what: str) -> FloatArray:
    if "frequency" not in found:
        raise _wrong_columns(table, found, needed, what)
    frequency = _column(table, found["frequency"])
    steps = np.diff(frequency)
    for row in np.flatnonzero(steps <= 0)[:1]:
        place = table.where(int(row) + 1)
        if steps[row] == 0:
            raise BadInput(f"{place}: the frequency {frequency[row]:g} Hz occurs twice; keep one row for each frequency")
        raise BadInput(f"{place}: frequencies must increase, but {frequency[row + 1]:g} Hz follows {frequency[row]:g} Hz; sort the rows")
    return frequency


def _column(table: Table, column: Column) -> FloatArray:
    return np.array(table.numbers(column.index), dtype=np.float64) * column.factor


def _impedance(table: Table, found: dict[str, Column]) -> ComplexArray:
    if {"resistance", "reactance"} <= set(found):
        impedance = np.empty(len(table.rows), dtype=np.complex128)
        impedance.real = _column(table, found["resistance"])
        impedance.imag = _column(table, found["reactance"])
        return impedance
    magnitude = _column(table, found["magnitude"])
    phase = _column(table, found["phase"])
    for row in np.flatnonzero(magnitude < 0)[:1]:
        raise BadInput(f"{table.where(int(row))}: the magnitude {magnitude[row]:g} Ohm is below 0; is it a reactance?")
    for row in np.flatnonzero(np.abs(phase) > 360)[:1]:
        raise BadInput(f"{table.where(int(row))}: a phase of {phase[row]:g} degrees is beyond a full turn")
    return np.asarray(magnitude * np.exp(1j * np.deg2rad(phase)), dtype=np.complex128)


def _overload(table: Table, column: Column) -> BoolArray:
    marks = _column(table, column)
    for row in np.flatnonzero((marks != 0) & (marks != 1))[:1]:
        raise BadInput(f"{table.where(int(row))}: overload is {marks[row]:g}; write 0 or 1")
    return marks.astype(np.bool_)


def _detector(written: object, name: str) -> str:
    if not isinstance(written, str):
        raise BadInput(f"{name}: does not say which detector; add a line '# detector: peak' (or quasi-peak, average)")
    spelling = clean_text(re.sub(r"[\s_-]+", "-", written.strip().lower()), 40)
    return _DETECTOR_SPELLINGS.get(spelling, spelling)


def _bandwidth(written: object, name: str) -> float:
    if isinstance(written, (str, int, float)):
        try:
            return parse(written, "Hz")
        except BadInput:
            pass
    raise BadInput(f"{name}: the resolution bandwidth {clean_text(str(written), 40)!r} is none; write '# rbw_hz: 9000'")
