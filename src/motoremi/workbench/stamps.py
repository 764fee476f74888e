"""What changes with the files of a session, whoever writes them: names, times and sizes."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TypeAlias

from motoremi.data.paths import SESSION

MEASURED = ("sweeps", "spectra")
ALL = (*MEASURED, "analysis")
Stamp: TypeAlias = tuple[tuple[str, int, int], ...]


def stamp_of(path: Path, folders: Sequence[str] = ALL) -> Stamp:
    """Of what is read of a session; empty where there is none.

    Parameters
    ----------
    path : Path
        The session's folder.
    folders : sequence of str
        Which of its folders; each analysis is followed by a line in the session's log.
    """
    try:
        log = (path / SESSION).stat()
    except OSError:
        return ()
    return ((SESSION, log.st_mtime_ns, log.st_size), *(one for folder in folders for one in _files(path / folder)))


def _files(folder: Path) -> list[tuple[str, int, int]]:
    told = []
    try:
        with os.scandir(folder) as entries:
            for entry in entries:
                found = entry.stat(follow_symlinks=False)
                told.append((f"{folder.name}/{entry.name}", found.st_mtime_ns, found.st_size))
    except OSError:
        # No such folder, or a file that has just gone: the next look tells.
        pass
    return sorted(told)
