"""Columns that mark the points at which the receiver was overloaded."""

from __future__ import annotations

import re

import numpy as np

from motoremi.arrays import BoolArray
from motoremi.data.numbers import looks_numeric
from motoremi.data.table import Table
from motoremi.data.text import clean_text
from motoremi.errors import BadInput

# Titles of columns that hold marks, and words in titles of columns that perhaps do.
_OVERLOAD = re.compile(r"(?:(?:rf|if)[\s_-]*)?(?:overload(?:ed)?|ovld?|over[\s_-]*range)", re.IGNORECASE)
_MAYBE = re.compile(r"status|overload|\bovld?\b|over[\s_-]*range", re.IGNORECASE)
# What receivers write of a point: True for an overload. A column `Status` may hold other words, so these decide whether it holds marks.
_WORDS = {
    **dict.fromkeys(("ovld", "ovl", "overload", "overloaded", "overrange"), True),
    **dict.fromkeys(("", "-", "ok", "valid", "normal"), False),
}
# What users write into a column of marks besides; in a column `Status`, "yes" would be no answer to a known question.
_ANSWERS = {"yes": True, "true": True, "no": False, "false": False}


def overload_of(table: Table) -> tuple[BoolArray | None, tuple[int, ...]]:
    """The marks of a table, shape (n,), and the columns that hold them; None without such a column.

    A column `Status` counts if all its words are known.

    Raises
    ------
    BadInput
        If a cell of such a column is not a mark.
    """
    used = tuple(index for index, title in enumerate(table.columns) if _OVERLOAD.fullmatch(title.strip()) or _is_status(table, index))
    if not used:
        return None, ()
    marks = [[_mark(table, row, index) for index in used] for row in range(len(table.rows))]
    return np.any(np.array(marks, dtype=np.bool_).reshape(-1, len(used)), axis=1), used


def may_mark_overload(title: str) -> bool:
    """Whether a title may be that of a column of marks."""
    return _MAYBE.search(title) is not None


def _is_status(table: Table, index: int) -> bool:
    return table.columns[index].strip().lower() == "status" and all(cells[index].lower() in _WORDS for cells in table.rows)


def _mark(table: Table, row: int, index: int) -> bool:
    cell = table.rows[row][index]
    known = {**_WORDS, **_ANSWERS}.get(cell.lower())
    if known is not None:
        return known
    if looks_numeric(cell) and float(cell) in (0.0, 1.0):
        return bool(float(cell))
    raise BadInput(f"{table.where(row)}: overload is {clean_text(cell, 40)!r}; write 0 or 1, or OVLD for a point with overload")
