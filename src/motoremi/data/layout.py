"""The layout of a text table: comments, text above the numbers, the row of column names, and what separates the columns."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass

from motoremi.data.numbers import complex_parts, looks_numeric
from motoremi.data.text import clean_text
from motoremi.data.units import are_units
from motoremi.errors import BadInput

BLANK = " "
IMPEDANCE_EXAMPLE = "frequency_hz,resistance_ohm,reactance_ohm"
_SEPARATORS = (";", "\t", ",")
# Marks of comments: the first anywhere, the others above the numbers only, where no row can begin with them.
COMMENT, _COMMENTS_ABOVE = "#", "#%*!"


@dataclass(frozen=True)
class Line:
    """A line of a file, without blanks around it.

    Parameters
    ----------
    number : int
        The first line of the file being 1.
    text : str
    """

    number: int
    text: str


@dataclass(frozen=True)
class Head:
    """What stands above the rows of numbers.

    Parameters
    ----------
    comments : tuple of Line
        Without their marks.
    texts : tuple of Line
        The lines that are neither comments nor rows of numbers; the last one holds the column names or their units, if these are not a comment.
    rows : tuple of Line
        All lines below, comments among them.
    """

    comments: tuple[Line, ...]
    texts: tuple[Line, ...]
    rows: tuple[Line, ...]


@dataclass(frozen=True)
class Names:
    """The column names.

    Parameters
    ----------
    titles : tuple of str
    separator : str
        What separates the columns of the rows; a blank stands for any number of blanks and tabs.
    """

    titles: tuple[str, ...]
    separator: str


def split_head(lines: Sequence[str]) -> Head:
    """The lines of a file, split where its numbers begin; lines without content are left out."""
    content = [Line(number, text) for number, raw in enumerate(lines, start=1) if (text := raw.strip(" \f")).strip("\t;,")]
    comments: list[Line] = []
    texts: list[int] = []
    for index, line in enumerate(content):
        comment = _comment(line.text)
        # Below the names a row with a mark in front is not left out without a word: it is refused as a row.
        marked = bool(texts) and comment is not None and not line.text.startswith(COMMENT) and _is_row(comment)
        if comment is not None and not marked:
            comments.append(Line(line.number, comment))
        elif marked or _is_row(line.text):
            return Head(tuple(comments), tuple(content[at] for at in texts), tuple(content[index:]))
        else:
            texts.append(index)
    if not texts:
        return Head(tuple(comments), (), ())
    # No line looks like a row: the first is taken for the names, and the others are refused as rows.
    return Head(tuple(comments), (content[texts[0]],), tuple(content[texts[0] + 1 :]))


def column_names(head: Head, where: str, example: str = IMPEDANCE_EXAMPLE) -> Names:
    """The column names, from the line above the first row or from the last comment.

    Parameters
    ----------
    head : Head
        With at least one row.
    where : str
        File and line of the first row, for messages.
    example : str
        Names to propose if there are none, with commas.

    Raises
    ------
    BadInput
        If there are none, or they are fewer than the values in the first row.
    """
    row = head.rows[0].text
    advice = _advice(example, row)
    *above, named = [None, *(comment for comment in head.comments if comment.text), *head.texts]
    if named is None:
        raise BadInput(f"{where}: numbers where the column names are needed; {advice}")
    if head.texts and (dotted := _between_dots(named.text, row)) is not None:
        return dotted
    separator = _separator(named.text if head.texts else row)
    of_row = separator if separator in row else BLANK
    count = len(cells_of(row, of_row))
    own = separator if separator in named.text and separator != BLANK else _separator(named.text)
    titles = _titles(named.text, own, count)
    if are_units(titles) and above[-1] is not None:
        with_names = _titles(above[-1].text, own, count)
        titles += [""] * (len(with_names) - len(titles))  # the last columns may have none, such as the line of the LISN
        if len(with_names) == len(titles):
            titles = [f"{name} [{unit}]" if unit else name for name, unit in zip(with_names, titles, strict=True)]
    if len(titles) < 2 and not head.texts:
        raise BadInput(f"{where}: numbers where the column names are needed; {advice}")
    unlike = count < len(titles) and not head.texts
    if unlike or count - len(titles) > _empty_at_end(row, of_row):
        raise BadInput(f"{where}: {_wrong_number(row, of_row, count, titles, named, advice)}")
    return Names(tuple(titles), of_row)


def _between_dots(names: str, row: str) -> Names | None:
    """Names with dots between them above rows with another separator, as Solartron SMaRT exports them; None if there is not one for each value."""
    separator = _separator(row)
    if separator == BLANK or separator in names:
        return None
    titles = [title.strip() for title in re.split("[.,]", names)]
    cells = cells_of(row, separator)
    return Names(tuple(titles), separator) if len(titles) == len(cells) - _empty_at_end(row, separator) > 2 else None


def _advice(example: str, row: str) -> str:
    """The line of names to write above a row; commas would not fit one with semicolons, or with tabs and decimal commas."""
    separator = _separator(row)
    fitting = BLANK if separator == "\t" and "," in row else ";" if separator == ";" else ","
    return f"put a line such as '{example.replace(',', fitting)}' above the numbers"


def _titles(line: str, separator: str, count: int) -> list[str]:
    """The cells of a row of names or units, without empty ones at its end."""
    titles = _blank_separated(line, count) if separator == BLANK else cells_of(line, separator)
    while titles and not titles[-1]:
        titles.pop()
    return titles


def cells_of(line: str, separator: str) -> list[str]:
    """The cells of a line; a cell in quotes may contain the separator."""
    if separator == BLANK:
        line = " ".join(line.split())
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True))]
    except csv.Error:
        # This happens only for a quoted cell beyond 128 kB, which is refused as a number later.
        return [line]


def decimal_comma_hint(cells: Sequence[str], separator: str, expected: int) -> str:
    """What to do if the cells of a row seem to be more than the names because of decimal commas; empty if they do not."""
    whole = all(looks_numeric(cell) and "." not in cell for cell in cells)
    commas = separator == "," and expected < len(cells) <= 2 * expected and whole
    return "; decimal commas need ';' between the columns" if commas else ""


def _comment(text: str) -> str | None:
    """A comment above the numbers without its marks; None for another line."""
    if text[0] in _COMMENTS_ABOVE or (text[0] == ";" and ";" not in text.lstrip(";")):
        return text.lstrip(text[0] + " ").rstrip()
    return None


def _separator(text: str) -> str:
    return next((mark for mark in _SEPARATORS if mark in text), BLANK)


def _is_row(text: str) -> bool:
    """Whether a line holds numbers: in its first cell or in more than half of its cells that are not empty; in both if blanks separate them."""
    if not text:
        return False
    separator = _separator(text)
    cells = cells_of(text, separator)
    numeric = [looks_numeric(cell) or complex_parts(cell) is not None for cell in cells]
    most = 2 * sum(numeric) > sum(map(bool, cells))
    return (numeric[0] and most) if separator == BLANK else (numeric[0] or most)


def _blank_separated(text: str, count: int) -> list[str]:
    """Names that are separated by blanks: such that a unit in brackets belongs to the name before it, or with two blanks between names."""
    joined = re.split(r" (?![(\[])", " ".join(text.split()))
    apart = re.split(r"\s{2,}|\t", text)
    return next((titles for titles in (joined, apart) if len(titles) == count), joined)


def _empty_at_end(row: str, separator: str) -> int:
    """Number of empty cells at the end of a row, which need no name."""
    cells = cells_of(row, separator)
    return next((place for place, cell in enumerate(reversed(cells)) if cell), len(cells))


def _wrong_number(row: str, separator: str, count: int, titles: Sequence[str], named: Line, advice: str) -> str:
    if hint := decimal_comma_hint(cells_of(row, separator), separator, len(titles)):
        return f"{count} values for {len(titles)} columns{hint}"
    shown = clean_text(", ".join(titles), 80)
    return (
        f"no row of column names with units found: line {named.number} ({shown}) has {len(titles)} of them for {count} values; "
        f"{advice}, with a name for each"
    )
