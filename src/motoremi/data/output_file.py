"""Write files that the user named: never over the data of a session; links, pipes and permissions stay what they are."""

from __future__ import annotations

import os
from pathlib import Path

from motoremi.data.paths import RESERVED, SESSION
from motoremi.data.storage import as_storage_error, write_whole
from motoremi.data.text_file import show_name
from motoremi.errors import BadInput


def write_output(target: Path, data: bytes) -> None:
    """Write a regular file completely or not at all; a link stays a link to the file that is written, and a pipe or device receives the data.

    Parameters
    ----------
    target : Path
        The name that the user gave.
    data : bytes

    Raises
    ------
    BadInput
        If it is the name of a file that belongs to the data of a session.
    StorageError
        If it cannot be written.
    """
    path = Path(os.path.realpath(target))
    check_output(target)
    if path.exists() and not path.is_file() and not path.is_dir():
        with as_storage_error(target):
            path.write_bytes(data)
        return
    write_whole(path, data)


def check_output(target: Path) -> None:
    """Refuse the name of a file that belongs to the data of a session.

    Raises
    ------
    BadInput
        If it is one.
    """
    path = Path(os.path.realpath(target))
    for folder in path.parents:
        if path.relative_to(folder).parts[0].casefold() in RESERVED and os.path.lexists(folder / SESSION):
            raise BadInput(f"{show_name(target)} belongs to the session {show_name(folder)}, whose files are never replaced: choose another name")
