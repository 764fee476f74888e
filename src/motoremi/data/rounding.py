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
    w, columns = 2 * np.pi * frequency_hz, (found[pair.first], found[pair.second])
    first, second = (column_values(table, column) for column in columns)
    units = [steps([cells[column.index] for cells in table.rows]) * abs(column.factor) for column in columns]
    with np.errstate(all="ignore"):
        moved = (pair.impedance(w, first + units[0], second), pair.impedance(w, first, second + units[1]))
        squares = np.sum([np.abs(one / impedance_ohm - 1) ** 2 for one in moved], axis=0)
        # The variances of the real and of the imaginary part are together that of the complex error. Where a unit more makes the impedance
        # infinite, the number says nothing.
        sigma = np.clip(np.nan_to_num(OF_ONE_UNIT * np.sqrt(squares / 2), nan=1.0), 1e-12, 1.0)
    return sigma if np.any(sigma > SMALLEST_SIGMA) else None


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
