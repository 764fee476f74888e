"""Which rows of a file are used: all but one at 0 Hz, and those of a band if one is named."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.columns import Column
from motoremi.data.immittance import column_values
from motoremi.data.quantity import REFERENCE_OHM, ports_written
from motoremi.data.sweep import check_order, inside_band
from motoremi.data.table import Table
from motoremi.errors import BadInput
from motoremi.quantities import parse, show

# Both ends of a band in hertz.
Band: TypeAlias = tuple[float, float]
# A reflection coefficient beyond the first number is more than three standard deviations of an ordinary calibration (`analyser`: nanovna) above 1.
# A sweep says so if more than the second share of its points has one.
REFLECTS_TOO_MUCH, _OF_POINTS = 1.02, 0.01
# A reference impedance in a header, and the share by which it may differ from the one that is used.
_REFERENCE_KEY = re.compile(r"(?:z_?0|(?:reference|ref|system|characteristic)[\s_]*impedance)(?:[\s_]*\(?ohms?\)?)?", re.IGNORECASE)
SAME_REFERENCE = 1e-3


@dataclass(frozen=True, eq=False)
class Rows:
    """The rows of a file, before a sweep is made of them.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
    impedance_ohm : ndarray, shape (n,)
    sigma_relative, rounding_relative : ndarray, shape (n,), or None
    where : callable
        Number of a row -> file and line, for messages.
    changes : tuple of str
        What was left out or averaged, in words.
    warnings : tuple of str
        What is doubtful about the values, in words.
    """

    frequency_hz: FloatArray
    impedance_ohm: ComplexArray
    sigma_relative: FloatArray | None
    where: Callable[[int], str]
    changes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    rounding_relative: FloatArray | None = None


def used_rows(frequency_hz: FloatArray, band: Band | None, name: str) -> tuple[NDArray[np.intp], tuple[str, ...]]:
    """Numbers of the rows that are used, and what is left out in words.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
        Of all rows.
    band : (float, float), optional
        Both ends in hertz.
    name : str
        Of the file, for messages.

    Raises
    ------
    BadInput
        If too few rows are within the band.
    """
    rows = np.arange(frequency_hz.size)
    changes = []
    if band is not None:
        try:
            inside, change = inside_band(frequency_hz, *band)
        except BadInput as error:
            raise BadInput(f"{name}: {error}") from error
        rows, changes = rows[inside], [change] if change else []
    if rows.size and frequency_hz[rows[0]] == 0:
        rows = rows[1:]
        changes.append("the row at 0 Hz is left out")
    return rows, tuple(changes)


def reflection_warnings(s11: ComplexArray) -> tuple[str, ...]:
    """A sentence if a reflection coefficient, shape (n,), is above 1 at more than a few points."""
    size = np.abs(s11)
    beyond = int(np.sum(size > REFLECTS_TOO_MUCH))
    if beyond <= _OF_POINTS * size.size:
        return ()
    return (
        f"|S11| reaches {size.max():.3g} at {beyond} of {size.size} points: a passive part never reflects more than it receives; calibrate again",
    )


def refuse_between_ports(header: Mapping[str, Any], name: str) -> None:
    """Raise `BadInput` if the header of a file of reflections says that the motor was between two ports."""
    written = next((ports_written(value) for key, value in header.items() if key.lower() == "fixture"), "")
    if written:
        raise BadInput(f"{name}: its header says fixture {written}, but it holds the reflection at one port; save S21 (.s2p), or remove that line")


def refuse_other_reference(header: Mapping[str, Any], name: str) -> None:
    """Raise `BadInput` if the header of a table of reflections states another reference impedance than the one they are read in.

    A Touchstone file states its own, which is used.
    """
    for key, value in header.items():
        if _REFERENCE_KEY.fullmatch(key) is None:
            continue
        try:
            ohm = parse(value, "Ohm") if isinstance(value, (str, int, float)) else REFERENCE_OHM
        except BadInput:
            continue
        if abs(ohm - REFERENCE_OHM) > SAME_REFERENCE * REFERENCE_OHM:
            raise BadInput(
                f"{name}: its header states a reference impedance of {show(ohm, 'Ohm')}, but S11 of a table is read in "
                f"{show(REFERENCE_OHM, 'Ohm')}: save a Touchstone file (.s1p), which states it, or R and X"
            )


def rising_frequency(table: Table, column: Column) -> FloatArray:
    """The frequencies of a table in hertz; the first row of a lower one than before it is refused with its line."""
    frequency = column_values(table, column)
    falls = np.flatnonzero(np.diff(frequency) < 0)
    if falls.size and np.all(frequency[falls + 1] == frequency[0]):
        raise BadInput(
            f"{table.where(int(falls[0]) + 1)}: frequencies must increase, but begin again at {frequency[0]:.12g} Hz: "
            f"{falls.size + 1} sweeps stand below each other; save each in a file of its own, and give all of them as repeats"
        )
    for row in falls[:1]:
        check_order(frequency[row + 1], frequency[row], table.where(int(row) + 1))
    return frequency
