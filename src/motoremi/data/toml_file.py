"""The one reader of TOML files: what the user's editor may add to a text, such as a byte order mark, is accepted for all of them."""

from __future__ import annotations

import os
import tomllib

from motoremi.arrays import JsonDict
from motoremi.data.text import clean_text
from motoremi.data.text_file import decode, read_bytes, show_name
from motoremi.errors import BadInput


def read_toml(path: str | os.PathLike[str]) -> JsonDict:
    """The content of a TOML file.

    Raises
    ------
    BadInput
        If it cannot be read, or is not TOML.
    """
    return parse_toml(read_bytes(path), show_name(path))


def parse_toml(data: bytes, name: str) -> JsonDict:
    """The content of a TOML file whose bytes were read; `name` names it in errors.

    Raises
    ------
    BadInput
        If it is not TOML.
    """
    try:
        return tomllib.loads(decode(data, name))
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise BadInput(f"{name}: is not TOML: {clean_text(str(error), 200)}") from error
