"""Rounding of the numbers in a file: an error of up to half a unit in their last digit, carried to the impedance.

It is known from the text of the file alone, and it is not seen in the scatter of points or of repeats that are all rounded to the same digits.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.columns import Column
from motoremi.data.immittance import Pair, column_values
from motoremi.data.noise_law import SMALLEST_SIGMA
from motoremi.data.numbers import digits_of, last_place
from motoremi.data.table import Table

# Fewer different numbers than these do not show to how many digits a column is rounded: one in ten ends with a zero by chance, and such zeros may
# not be written.
ENOUGH_NUMBERS = 8
# Standard deviation of an error that is uniform between plus and minus half a unit.
OF_ONE_UNIT = 1 / np.sqrt(12)


def rounding_of(table: Table, found: Mapping[str, Column], pair: Pair, frequency_hz: FloatArray, impedance_ohm: ComplexArray) -> FloatArray | None:
    """Standard deviation of the rounding error, of the real and of the imaginary part each, relative to Z.

    That of a column `rounding_relative` if there is one; else from the digits of the two columns of the impedance, whose errors are independent.

    Returns
    -------
    ndarray, shape (n,), or None
        None if it is nowhere larger than the smallest noise that is assumed.
    """
    if "rounding_relative" in found:
        return column_values(table, found["rounding_relative"])
    columns = (found[pair.first], found[pair.second])
    first, second = (column_values(table, column) for column in columns)
    units = [steps([cells[column.index] for cells in table.rows]) * abs(column.factor) for column in columns]
    return rounding_of_pair(pair, frequency_hz, (first, units[0]), (second, units[1]), impedance_ohm)


def rounding_of_pair(
    pair: Pair,
    frequency_hz: FloatArray,
    first: tuple[FloatArray, FloatArray],
    second: tuple[FloatArray, FloatArray],
    impedance_ohm: ComplexArray,
) -> FloatArray | None:
    """That of the impedance from two quantities, each with the unit to which it is rounded; see `rounding_of`."""
    w = 2 * np.pi * frequency_hz
    with np.errstate(all="ignore"):
        moved = (pair.impedance(w, first[0] + first[1], second[0]), pair.impedance(w, first[0], second[0] + second[1]))
        squares = np.sum([np.abs(one / impedance_ohm - 1) ** 2 for one in moved], axis=0)
        # The variances of the real and of the imaginary part are together that of the complex error.
        return _noticeable(OF_ONE_UNIT * np.sqrt(squares / 2))


def rounding_of_complex(
    style: str, values: ComplexArray, first: Sequence[str], second: Sequence[str], relative_slope: FloatArray
) -> FloatArray | None:
    """That of the impedance from complex numbers of which each is written as two; see `rounding_of`.

    Parameters
    ----------
    style : {"RI", "MA", "DB"}
        The two are the real and the imaginary part, magnitude and phase in degrees, or magnitude in dB and phase in degrees.
    values : ndarray, shape (n,)
    first, second : sequence of str
    relative_slope : ndarray, shape (n,)
        Relative change of Z for a change of the complex number by 1.
    """
    along, across = steps(first), steps(second)
    size = np.abs(values)
    if style != "RI":
        across = size * np.deg2rad(across)
    if style == "DB":
        along = size * np.log(10) / 20 * along
    with np.errstate(all="ignore"):
        return _noticeable(OF_ONE_UNIT * np.hypot(along, across) / np.sqrt(2) * relative_slope)


def _noticeable(sigma: FloatArray) -> FloatArray | None:
    """The errors, or None if none is larger than the smallest noise that is assumed."""
    # Where a unit more makes the impedance infinite, the number says nothing.
    limited = np.clip(np.nan_to_num(sigma, nan=1.0), 1e-12, 1.0)
    return limited if np.any(limited > SMALLEST_SIGMA) else None


def steps(cells: Sequence[str]) -> FloatArray:
    """The unit to which each number of a column is rounded; 0 if it is not known.

    Programs write a number of three digits as `1.20`, as `1.2` without the zero, or as `1.200000`. Therefore the unit is that of the column: the
    numbers have as many significant digits, or as many decimals, as the one that has most of them, whichever is the larger unit. Where the zeros
    are written, no unit is smaller than the last digit.
    """
    if len({float(cell) for cell in cells}) < ENOUGH_NUMBERS:
        return np.zeros(len(cells))
    shapes = [digits_of(cell) for cell in cells]
    most, smallest = max(digits for digits, _, _ in shapes), min(place for digits, _, place in shapes if digits)
    # The leading digit of zero is not known: it has only decimals.
    of_column = [max(leading - most + 1, smallest) if digits else smallest for digits, leading, _ in shapes]
    units: FloatArray = 10.0 ** np.array(of_column)
    mantissas = [cell.strip().lower().partition("e")[0] for cell in cells]
    # Programs that write floating-point numbers end whole ones with `.0`.
    zeros_written = any("." in text and text.endswith("0") and not text.endswith(".0") for text in mantissas)
    return np.maximum(units, [last_place(cell) for cell in cells]) if zeros_written else units
