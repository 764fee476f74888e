"""A text table with a header row: delimiter, decimal sign, comments and `# key: value` lines."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from motoremi.arrays import JsonDict
from motoremi.data.layout import COMMENT, IMPEDANCE_EXAMPLE, Line, Names, cells_of, column_names, decimal_comma_hint, split_head
from motoremi.data.numbers import has_decimal_commas, looks_cut, looks_numeric, looks_unmeasured, parse_number
from motoremi.data.plain import from_json
from motoremi.data.text import clean_text, clean_value
from motoremi.data.text_file import split_lines
from motoremi.errors import BadInput

_QUOTED_KEY = re.compile(r'"(?:[^"\\]|\\.)*"')


@dataclass(frozen=True)
class Table:
    """Cells as text, with the line number of each row.

    Parameters
    ----------
    name : str
        Name of the file, for messages.
    header : dict
        The `# key: value` lines.
    columns : tuple of str
        As written in the file.
    rows : list of list of str
        Every row as long as `columns`.
    lines : list of int
        Line number of each row, the first line of the file being 1.
    left_out : tuple of str
        What was left out of the file, in words.
    """

    name: str
    header: JsonDict
    columns: tuple[str, ...]
    rows: list[list[str]]
    lines: list[int]
    left_out: tuple[str, ...] = ()

    def where(self, row: int) -> str:
        """File and line of a row."""
        return f"{self.name}, line {self.lines[row]}"

    def numbers(self, column: int) -> list[float]:
        """One column as numbers.

        Raises
        ------
        BadInput
            At the first cell that is not a number.
        """
        title = clean_text(self.columns[column], 40)
        return [
            parse_number(cells[column], f"{self.name}, line {line}, column {title!r}") for cells, line in zip(self.rows, self.lines, strict=True)
        ]

    def only(self, rows: Sequence[int]) -> Table:
        """The table with these of its rows."""
        return replace(self, rows=[self.rows[row] for row in rows], lines=[self.lines[row] for row in rows])


def parse_table(text: str, name: str, example: str = IMPEDANCE_EXAMPLE) -> Table:
    """Split a text table; `example` are column names to propose if there are none.

    The column names are the line above the first row of numbers, or the last comment above it. The columns are separated by a semicolon, a
    tab or a comma, the first of these, in this order, that the names contain, or by blanks. The decimal sign may be a comma, between commas only in
    numbers with quotes. Lines of words below the rows are left out.

    Raises
    ------
    BadInput
        If there are no column names, a row is shorter or longer than they, or the end of the file is missing.
    """
    all_lines = split_lines(text)
    head = split_head(all_lines)
    header: JsonDict = {}
    for comment in head.comments:
        read_key_value(comment.text, header)
    if not head.texts and not head.rows:
        raise BadInput(f"{name}: holds comments only; a row with column names and rows of numbers are needed")
    if not head.rows:
        raise BadInput(f"{name}: holds a row of column names but no numbers")
    names = column_names(head, f"{name}, line {head.rows[0].number}", example)
    rows: list[list[str]] = []
    lines: list[int] = []
    ending = _lines_at_end(head.rows, names.separator)
    for line in head.rows[: len(head.rows) - ending]:
        if line.text.startswith(COMMENT):
            read_key_value(line.text, header)
            continue
        if rows and cells_of(line.text, names.separator)[: len(names.titles)] == list(names.titles):
            several = "the column names occur again, so the file holds several tables: save each in a file of its own"
            raise BadInput(f"{name}, line {line.number}: {several}")
        rows.append(_row(line.text, names, f"{name}, line {line.number}"))
        lines.append(line.number)
    if not rows:
        raise BadInput(f"{name}: holds a row of column names but no numbers")
    _use_decimal_points(rows, lines, name)
    first = head.rows[-ending].text if ending else ""
    left_out = (f"the text below the rows is left out ({clean_text(first, 40)!r})",) if ending else ()
    table = Table(name, header, names.titles, rows, lines, left_out)
    _check_end(table, complete=bool(ending) or not all_lines[-1].strip())
    return table


def _lines_at_end(lines: Sequence[Line], separator: str) -> int:
    """How many lines below the last row hold words and no number, nor the mark of a point that was not measured; comments are not counted."""
    count = 0
    for line in reversed(lines):
        cells = cells_of(line.text, separator)
        if line.text.startswith(COMMENT) or not any(map(str.isalpha, line.text)) or any(_may_be_value(cell) for cell in cells):
            break
        count += 1
    return count if count < len(lines) else 0


def _may_be_value(cell: str) -> bool:
    # A number that was cut off, such as `1.5e`, begins like a number.
    return cell[:1] in tuple("+-.0123456789(") or looks_unmeasured(cell)


def read_key_value(line: str, header: JsonDict) -> None:
    """Enter a `# key: value` line into `header`; other comments are ignored.

    A value that is JSON keeps its type, anything else is text.
    """
    body = line.lstrip("#").strip()
    quoted = _QUOTED_KEY.match(body)
    end = quoted.end() if quoted else max(body.find(":"), 0)
    key, rest = body[:end].strip(), body[end:].lstrip()
    if key and rest.startswith(":"):
        name = str(_json_or_text(key)) if quoted else key
        header[clean_text(name)] = clean_value(_json_or_text(rest[1:].strip()))


def _json_or_text(text: str) -> object:
    if text[:1] not in tuple('{["-0123456789tfn'):
        return text
    try:
        return from_json(text)
    except ValueError:
        return text


def _row(line: str, names: Names, where: str) -> list[str]:
    cells, expected = cells_of(line, names.separator), len(names.titles)
    while len(cells) > expected and not cells[-1]:
        cells.pop()
    if len(cells) < expected:
        raise BadInput(f"{where}: {len(cells)} values for {expected} columns; the row or the file is cut off")
    if len(cells) > expected:
        columns = f"{expected} column{'s' if expected > 1 else ''}"
        raise BadInput(f"{where}: {len(cells)} values for {columns}{decimal_comma_hint(cells, names.separator, expected)}")
    return cells


def _use_decimal_points(rows: list[list[str]], lines: list[int], name: str) -> None:
    if has_decimal_commas(((cell, line) for cells, line in zip(rows, lines, strict=True) for cell in cells), name):
        for cells in rows:
            cells[:] = [cell.replace(",", ".", 1) if looks_numeric(cell) else cell for cell in cells]


def _check_end(table: Table, complete: bool) -> None:
    points = table.header.get("points")
    if type(points) is int and points != len(table.rows):
        raise BadInput(f"{table.name}: the header says {points} points but {len(table.rows)} rows follow; the file is cut off")
    if complete:
        return
    last = table.rows[-1][-1]
    if looks_cut(last, [cells[-1] for cells in table.rows[:-1]]):
        raise BadInput(
            f"{table.where(-1)}: the last number {clean_text(last, 40)!r} is shorter than all others and no line end follows; "
            "the file is cut off (if it is complete, end the last line)"
        )
