"""Read a user's file as text, or raise an error in one clear line."""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from motoremi.data.text import clean_text
from motoremi.errors import BadInput

MAXIMUM_BYTES = 200_000_000
_LINE_END = re.compile(r"\r\n|\n|\r")
# Printable Latin-1 has no code between 0x80 and 0x9f: a text with such codes is in another encoding.
_C1_CONTROL = re.compile("[\x80-\x9f]")
# First bytes of files that are often given instead of the measurement.
_OTHER_FILES = (
    (b"PK\x03\x04", "is a ZIP archive or an Excel workbook; unpack it, or save the sheet as CSV"),
    (b"\x89PNG", "is a picture; export the measurement as text or CSV"),
    (b"\xff\xd8\xff", "is a photo; export the measurement as text or CSV"),
    (b"%PDF", "is a PDF; export the measurement as text or CSV"),
)
_ASCII_CONTROL = bytes(code for code in range(32) if code not in b"\t\n\r\f")
Made = TypeVar("Made")


class WrongKind(BadInput):
    """A file that holds a spectrum where a sweep was expected, or the other way round."""


def read_bytes(path: str | os.PathLike[str]) -> bytes:
    """Read a whole ordinary file of sensible size.

    Raises
    ------
    BadInput
        If it is missing, a folder, a device, unreadable, empty or too large.
    """
    name = clean_text(str(path))
    try:
        status = os.stat(path)
        if stat.S_ISDIR(status.st_mode):
            raise BadInput(f"{name}: is a folder; name a file in it")
        # Only ordinary files are opened: reading a named pipe could block for ever.
        if not stat.S_ISREG(status.st_mode):
            raise BadInput(f"{name}: not an ordinary file; save the data to a file first")
        if status.st_size > MAXIMUM_BYTES:
            raise BadInput(f"{name}: {status.st_size / 1e6:.0f} MB is too large for a measurement; the limit is 200 MB")
        with open(path, "rb") as file:
            data = file.read(MAXIMUM_BYTES + 1)
    except BadInput:
        raise
    except FileNotFoundError as error:
        raise BadInput(f"{name}: no such file") from error
    except OSError as error:
        raise BadInput(f"{name}: cannot be read: {error.strerror or error}") from error
    except ValueError as error:
        raise BadInput(f"{name}: not a file name") from error
    if len(data) > MAXIMUM_BYTES:
        raise BadInput(f"{name}: grew beyond 200 MB while it was read")
    refuse_empty(data, name)
    return data


def refuse_empty(data: bytes, name: str) -> None:
    """Raise `BadInput` for a file that holds nothing but blanks."""
    if not data.strip(b"\xef\xbb\xbf \t\r\n"):
        raise BadInput(f"{name}: the file is empty")


def decode(data: bytes, name: str) -> str:
    """Text from UTF-8 (with or without byte order mark), UTF-16 with one, as programs on Windows save "Unicode" text, or Latin-1 bytes.

    Raises
    ------
    BadInput
        If the bytes are not text, or in another encoding.
    """
    for begin, what in _OTHER_FILES:
        if data.startswith(begin):
            raise BadInput(f"{name}: {what}")
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        data = _utf_8(data, name)
    head = data[:65536]
    controls = len(head) - len(head.translate(None, _ASCII_CONTROL))
    if b"\0" in data or controls > len(head) // 10:
        raise BadInput(f"{name}: is a binary file, not text; export the measurement as text or CSV")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    if _C1_CONTROL.search(text):
        raise BadInput(f"{name}: is neither UTF-8 nor Latin-1 text; save it again as UTF-8")
    return text


def _utf_8(data: bytes, name: str) -> bytes:
    try:
        return data.decode("utf-16").encode("utf-8")
    except UnicodeDecodeError as error:
        raise BadInput(f"{name}: is damaged UTF-16 text; save it again as UTF-8") from error


def split_lines(text: str) -> list[str]:
    """Lines as an editor counts them: only CR LF, LF and CR end a line."""
    return _LINE_END.split(text)


def show_name(path: str | os.PathLike[str]) -> str:
    """The path as the user gave it, with control characters made visible."""
    return clean_text(str(path))


def file_name(path: str | os.PathLike[str]) -> str:
    """The last part of a path: the names of folders may be private and do not belong in a report."""
    return clean_text(Path(path).name)


def of_file(name: str, make: Callable[[], Made]) -> Made:
    """Call `make`, and add the file's name to its `BadInput`."""
    try:
        return make()
    except BadInput as error:
        raise BadInput(f"{name}: {error}") from error
