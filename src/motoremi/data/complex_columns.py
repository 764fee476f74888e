"""Columns of complex numbers, `(a+bj)` or `a+bi`: each becomes two, of real and imaginary parts."""

from __future__ import annotations

from dataclasses import replace

from motoremi.data.columns import complex_titles
from motoremi.data.numbers import complex_parts
from motoremi.data.table import Table
from motoremi.data.text import clean_text
from motoremi.errors import BadInput


def with_parts(table: Table) -> Table:
    """The table with two more columns for each column of complex numbers whose name is known.

    Raises
    ------
    BadInput
        If a cell of such a column is no complex number.
    """
    for index in _complex_columns(table):
        if titles := complex_titles(table.columns[index]):
            rows = [[*cells, *_parts(table, row, index)] for row, cells in enumerate(table.rows)]
            table = replace(table, columns=(*table.columns, *titles), rows=rows)
    return table


def complex_trouble(table: Table) -> str:
    """Why columns of complex numbers cannot be used, in words; empty if none lacks a known name."""
    unnamed = [clean_text(repr(table.columns[index]), 40) for index in _complex_columns(table) if not complex_titles(table.columns[index])]
    if not unnamed:
        return ""
    which = f"the column {unnamed[0]} holds" if len(unnamed) == 1 else f"the columns {', '.join(unnamed)} hold"
    return f"{which} complex numbers of no known name: write 'Z (Ohm)', 'Y (S)' or 'S11' above those to be read"


def _complex_columns(table: Table) -> list[int]:
    """The columns whose first cell is a complex number."""
    return [index for index, cell in enumerate(table.rows[0]) if complex_parts(cell)] if table.rows else []


def _parts(table: Table, row: int, index: int) -> tuple[str, str]:
    cell = table.rows[row][index]
    parts = complex_parts(cell)
    if parts is None:
        title = clean_text(table.columns[index], 40)
        raise BadInput(f"{table.where(row)}, column {title!r}: {clean_text(cell, 40)!r} is not a complex number; write for example 1.5-20j")
    return parts
