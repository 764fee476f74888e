"""Read correction tables of laboratories: CSV over frequency, or Touchstone of a two-port."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.columns import columns_found, find_columns
from motoremi.data.sweep import checked_frequency
from motoremi.data.table import Table, parse_table
from motoremi.data.text import clean_text
from motoremi.data.text_file import decode, read_bytes, show_name
from motoremi.data.touchstone import is_touchstone, parse_two_port
from motoremi.errors import BadInput

# `db`, `loss_db`, `Loss (dB)`, `factor [dB/m]`, `dB(1/Ohm)`, `Zt (dBOhm)`, `Zt [dBΩ]`.
_DECIBEL = re.compile(r"(?:^|[\s_(\[])(db(?:/m|\s?\([^)]*\)|\s?(?:ohm|[Ω\u2126]))?)[)\]]?$", re.IGNORECASE)
# Of a current probe: its transfer impedance Zt, the voltage over the current, so that dBuA = dBuV - Zt.
DB_OHM = "dB(Ohm)"
CORRECTION_EXAMPLE = "frequency_hz,db"
# What a title says of the sign of its values, and the kinds of correction whose sign is the other one.
_GAIN = re.compile(r"gain|amplification", re.IGNORECASE)
_OTHER_SIGN = {
    "loss": _GAIN,
    "transducer": _GAIN,
    "gain": re.compile(r"loss|attenuation|factor", re.IGNORECASE),
}
# Spelling in a file, in lower case -> unit.
_UNITS = {"db": "dB", "db/m": "dB/m", "db(1/m)": "dB(1/m)", "db(1/ohm)": "dB(1/Ohm)", "db(s)": "dB(S)", "db(ohm)": DB_OHM, "dbohm": DB_OHM}
_TRANSFER_IMPEDANCE = re.compile(r"z_?t(?![a-z])|transfer[\s_-]*impedance", re.IGNORECASE)


def standard_unit(written: object) -> object:
    """The standard spelling of a unit in decibel, such as `dB(Ohm)` for `dBΩ`; anything else as written."""
    plain = re.sub(r"[Ω\u2126]", "Ohm", str(written)).replace(" ", "").lower()
    return _UNITS.get(plain, written)


def read_decibels(path: Path, kind: str) -> tuple[FloatArray, FloatArray, str]:
    """Values in dB over frequency.

    Parameters
    ----------
    path : Path
        CSV with `frequency_hz,db`; a line `# unit: dB/m` may say the unit of a transducer. Or Touchstone of two ports: the loss or gain
        is that of S21.
    kind : {"loss", "gain", "transducer"}

    Returns
    -------
    frequency_hz, db : ndarray, shape (n,)
    unit : str
        Empty if the file states no unit other than dB. A column that is called a transfer impedance (Zt) is in dB(Ohm).

    Raises
    ------
    BadInput
        For frequencies that do not increase, a value that is missing, a column that is not in dB, or one whose title says another kind.
    """
    shown = show_name(path)
    text = decode(read_bytes(path), shown)
    if is_touchstone(text):
        if kind == "transducer":
            raise BadInput(f"{shown}: a Touchstone file holds a loss or a gain, not a transducer factor")
        frequency_hz, s = read_two_port(path)
        level: FloatArray = 20 * np.log10(np.abs(s[:, 1, 0]))
        return frequency_hz, level if kind == "gain" else -level, ""
    table = parse_table(text, shown, CORRECTION_EXAMPLE)
    found = find_columns(table)
    if "frequency" not in found:
        raise BadInput(f"{shown}: found {columns_found(table)}, but a correction needs the columns frequency_hz,db")
    others = [(index, match[1]) for index, title in enumerate(table.columns) if (match := _DECIBEL.search(title.strip()))]
    if len(others) != 1:
        raise BadInput(f"{shown}: found {columns_found(table)}, but a correction needs one column in dB, named db; convert other units first")
    index, unit = others[0]
    if said := _OTHER_SIGN[kind].search(table.columns[index]):
        other = "gain" if kind != "gain" else "loss"
        title = clean_text(table.columns[index], 40)
        raise BadInput(
            f'{shown}: the column {title!r} holds a {said[0].lower()}, which kind = "{kind}" would apply with the wrong sign; '
            f'set kind = "{other}", or correct the title'
        )
    frequency = np.array(table.numbers(found["frequency"].index)) * found["frequency"].factor
    values = np.array(table.numbers(index))
    axis = checked_frequency(frequency, shown, 2)
    if not np.all(np.isfinite(values)):
        raise BadInput(f"{shown}: a value is not a finite number")
    for row in np.flatnonzero(np.abs(values) > 200)[:1]:
        raise BadInput(f"{table.where(int(row))}: {values[row]:g} dB is too large for a correction; is the column in dB?")
    return axis, values, _unit(table, unit)


def _unit(table: Table, of_column: str) -> str:
    """The unit of the values, from a line `# unit: ...` or the title of their column; empty for dB."""
    written = next((str(value) for key, value in table.header.items() if key.strip().lower() == "unit"), of_column).strip()
    unit = str(standard_unit(written))
    if unit not in _UNITS.values():
        raise BadInput(f"{table.name}: the unit {clean_text(written, 40)!r} is not in decibel; use dB, dB(Ohm), dB(1/Ohm) or dB/m")
    if any(_TRANSFER_IMPEDANCE.match(title.strip()) for title in table.columns):
        if unit not in ("dB", DB_OHM):
            raise BadInput(f"{table.name}: a transfer impedance ({columns_found(table)}) is in {DB_OHM}, not in {unit}; correct one of them")
        return DB_OHM
    return "" if unit == "dB" else unit


def read_two_port(path: Path) -> tuple[FloatArray, ComplexArray]:
    """S-parameters in 50 Ohm, shape (n, 2, 2), and their frequencies in hertz, shape (n,)."""
    shown = show_name(path)
    return parse_two_port(decode(read_bytes(path), shown), shown)
