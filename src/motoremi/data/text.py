"""Make text from files, instruments and users safe to display."""

from __future__ import annotations

import unicodedata
from typing import Any


def clean_text(text: str, limit: int | None = None) -> str:
    r"""One line of text in which control characters are written out.

    Parameters
    ----------
    text : str
        Anything from a file, an instrument or a user.
    limit : int, optional
        Longest result; a longer text is cut and ends with `...`.

    Returns
    -------
    str
        For example `\x1b[31mred` as nine visible characters instead of red text. Cleaning twice changes nothing.
    """
    if limit is not None and len(text) > limit:
        text = text[: max(limit - 3, 0)] + "..."
    if text.isascii() and text.isprintable():
        return text
    return "".join(_visible(character) for character in text)


def _visible(character: str) -> str:
    # Control characters, bidirectional overrides, zero-width marks, line separators and lone surrogates are not printable: each
    # can make a terminal or a page show something other than the text. Wide and non-breaking blanks are harmless.
    if character.isprintable() or unicodedata.category(character) == "Zs":
        return character
    code = ord(character)
    if code <= 0xFF:
        return f"\\x{code:02x}"
    return f"\\u{code:04x}" if code <= 0xFFFF else f"\\U{code:08x}"


def clean_value(value: Any) -> Any:
    """`clean_text` on every text inside plain data."""
    if isinstance(value, str):
        return clean_text(value)
    if isinstance(value, dict):
        return {clean_text(str(key)): clean_value(item) for key, item in value.items()}
    if isinstance(value, list):
        return [clean_value(item) for item in value]
    return value


def without_accents(text: str) -> str:
    """A text with plain letters, for comparison."""
    return "".join(letter for letter in unicodedata.normalize("NFD", text) if not unicodedata.combining(letter))


def in_a_cell(text: str) -> str:
    """Text from outside, escaped so that no spreadsheet reads it as a formula."""
    shown = clean_text(text)
    return f"'{shown}" if shown.lstrip()[:1] in tuple("=+-@") else shown
