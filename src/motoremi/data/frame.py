"""The columns of a pandas table, read as strictly as those of a file: names and units as there, refused where a number is in doubt."""

from __future__ import annotations

from typing import TYPE_CHECKING

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.columns import columns_found, find_columns, unit_trouble
from motoremi.data.complex_columns import complex_trouble, with_parts
from motoremi.data.immittance import IMPEDANCE_COLUMNS, column_values, find_pair, impedance_of, in_rising_order
from motoremi.data.rounding import rounding_of
from motoremi.data.table import Table
from motoremi.errors import BadInput
from motoremi.given import refuse_other

if TYPE_CHECKING:
    import pandas as pd


def impedance_in(frame: pd.DataFrame) -> tuple[FloatArray, ComplexArray, FloatArray | None, FloatArray | None, tuple[str, ...]]:
    """Frequency in hertz, impedance in ohm, the relative noise where it is stated, the rounding if there is one, and what was changed in words.

    Raises
    ------
    BadInput
        If it is no table of pandas, a column is missing, has no or an unknown unit or stands there twice, or a cell is no finite number.
    """
    import pandas as pd

    refuse_other(frame, pd.DataFrame, "a sweep is read from a table of pandas (pandas.DataFrame)")
    given = _table(frame)
    table = with_parts(given)
    found = find_columns(table)
    pair = find_pair(found)
    if pair is None or "frequency" not in found:
        trouble = "".join(f"{one}; " for one in (unit_trouble(given), complex_trouble(given)) if one)
        raise BadInput(f"frame: {trouble}found {columns_found(given)}, but a sweep needs the columns {IMPEDANCE_COLUMNS}")
    table, changes = in_rising_order(table, found["frequency"])
    frequency = column_values(table, found["frequency"])
    sigma = column_values(table, found["sigma_relative"]) if "sigma_relative" in found else None
    impedance = impedance_of(table, found, pair, frequency)
    return frequency, impedance, sigma, rounding_of(table, found, pair, frequency, impedance), changes


def _table(frame: pd.DataFrame) -> Table:
    """The frame as text, in which every number survives exactly; its rows are counted from 1."""
    # One by one, since a frame may hold two columns of one name.
    columns = [frame.iloc[:, place].tolist() for place in range(frame.shape[1])]
    cells = [[repr(cell) if isinstance(cell, float) else str(cell) for cell in row] for row in zip(*columns, strict=True)]
    return Table("frame", {}, tuple(str(title) for title in frame.columns), cells, list(range(1, len(cells) + 1)))
