"""Numbers as measurement files write them, and the marks they use for a point that was not measured."""

from __future__ import annotations

import re
from collections.abc import Iterable

from motoremi.data.text import clean_text
from motoremi.errors import BadInput

_DIGITS = r"(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_NUMBER = re.compile(rf"[+-]?{_DIGITS}")
# As Python and Matlab write them: `(1.5-2j)`, `1.5 - 2i`, `1.5-2*i`, and `2j` for a real part of 0; and as engineers do: `1.5-j2`.
_REAL = rf"(?:([+-]?{_DIGITS})\s*(?=[+-]))?([+-]?)\s*"
_COMPLEX = re.compile(rf"{_REAL}(?:({_DIGITS})\s*\*?\s*[ij]|[ij]\s*\*?\s*({_DIGITS}))")
_NOT_A_NUMBER = re.compile(r"[+-]?(?:nan|inf|infinity|1\.#\w+)(?:\(\w*\))?", re.IGNORECASE)
# SCPI writes 9.91E37 for "not a number" and 9.9E37 for infinity.
_SCPI_MARK = 9e37


# A number of four to six digits in groups of three, with the decimal sign between them.
_GROUPED = re.compile(r"[1-9][0-9]{0,2}\.[0-9]{3}")
_UP_TO_999 = re.compile(r"[1-9][0-9]{0,2}|0")
# So many numbers that all have three decimals, none of which is nought, are no coincidence beside whole ones.
LEAST_GROUPED = 3


def look_grouped(cells: list[str]) -> bool:
    """Whether every number of a column, below 1000 if read as it is, could be one in groups of three digits instead: `150.000`."""
    return bool(cells) and all(_GROUPED.fullmatch(cell.strip()) for cell in cells)


def look_partly_grouped(cells: list[str]) -> bool:
    """Whether numbers could be in groups of three digits where they reach 1000: like `15.915`, or whole numbers of up to three digits like `531`.

    Numbers with decimals would end in a nought, and so be shorter, one time in ten.
    """
    numbers = [cell.strip().lstrip("+-") for cell in cells]
    grouped = sum(_GROUPED.fullmatch(number) is not None for number in numbers)
    whole = sum(_UP_TO_999.fullmatch(number) is not None for number in numbers)
    return grouped >= LEAST_GROUPED and whole > 0 and grouped + whole == len(numbers)


def looks_numeric(cell: str) -> bool:
    """Whether a cell looks like a number, with a decimal point or a decimal comma."""
    return _NUMBER.fullmatch(cell.strip().replace(",", ".", 1)) is not None


def has_decimal_commas(cells: Iterable[tuple[str, int]], name: str) -> bool:
    """Whether the numbers of a file have a decimal comma.

    Parameters
    ----------
    cells : iterable of (str, int)
        Each with the line it is in.
    name : str
        The file, for the message.

    Raises
    ------
    BadInput
        If some have a decimal comma and others a decimal point.
    """
    comma = point = 0
    for cell, line in cells:
        if looks_numeric(cell):
            comma = comma or ("," in cell and line)
            point = point or ("." in cell and line)
    if comma and point:
        raise BadInput(f"{name}, line {comma}: a decimal comma, but line {point} has a decimal point; use one of them")
    return bool(comma)


def looks_unmeasured(cell: str) -> bool:
    """Whether a cell is the mark of a number that is none, such as `nan`."""
    return _NOT_A_NUMBER.fullmatch(cell.strip()) is not None


def parse_number(cell: str, where: str) -> float:
    """Read one number; the decimal sign is a point.

    Parameters
    ----------
    cell : str
    where : str
        File, line and column, for the message.

    Raises
    ------
    BadInput
        If it is empty, text, not finite, or the mark of an instrument for a point that it did not measure.
    """
    text = cell.strip()
    if _NUMBER.fullmatch(text):
        value = float(text)
        if abs(value) < _SCPI_MARK:
            return value
        raise BadInput(f"{where}: {clean_text(text, 40)} marks a point that was not measured; remove the row")
    if not text:
        raise BadInput(f"{where}: a value is missing; remove the row or fill it in")
    if _NOT_A_NUMBER.fullmatch(text):
        raise BadInput(f"{where}: {clean_text(text, 40)} is not a finite number; remove the row")
    raise BadInput(f"{where}: {clean_text(text, 40)!r} is not a number; write plain numbers such as 1.5e5")


def last_place(cell: str) -> float:
    """One unit in the last digit of a number as text: 0.01 of `-2.51`, 100 of `1.2e3`."""
    mantissa, _, exponent = cell.strip().lower().partition("e")
    return float(10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2])))


def digits_of(cell: str) -> tuple[int, int, int]:
    """Number of significant digits without zeros at the end, and the powers of ten of the first and of the last of them: (2, 1, 0) of `12.0`.

    Zero has no significant digit.
    """
    mantissa, _, exponent = cell.strip().lstrip("+-").lower().partition("e")
    whole, _, decimals = mantissa.partition(".")
    digits, power = whole + decimals, int(exponent or 0)
    kept = digits.strip("0")
    if not kept:
        return 0, power, power
    leading = power + len(whole) - 1 - (len(digits) - len(digits.lstrip("0")))
    return len(kept), leading, leading - len(kept) + 1


def complex_parts(cell: str) -> tuple[str, str] | None:
    """Real and imaginary part of a complex number, as text; None for another cell."""
    text = cell.strip()
    if text.startswith("(") and text.endswith(")"):
        text = text[1:-1].strip()
    match = _COMPLEX.fullmatch(text)
    return (match[1] or "0", match[2] + (match[3] or match[4])) if match else None


def looks_cut(cell: str, others: list[str]) -> bool:
    """Whether the very last number of a file without a final line end was cut off.

    That is assumed if its mantissa or its exponent has fewer digits than those of all other numbers in the column.
    """
    digits, exponent = _shape(cell)
    shapes = [_shape(other) for other in others]
    return bool(shapes) and (digits < min(s[0] for s in shapes) or exponent < min(s[1] for s in shapes))


def _shape(cell: str) -> tuple[int, int]:
    mantissa, _, exponent = cell.lower().partition("e")
    return sum(c.isdigit() for c in mantissa), sum(c.isdigit() for c in exponent)
