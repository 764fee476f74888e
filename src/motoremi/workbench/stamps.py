"""What changes with a session's log and its measured files, whoever writes them: names, times and sizes."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TypeAlias

from motoremi.data.paths import SESSION

# Analyses are replaced before the log says so: for a moment they do not belong together, and that is no damage.
FOLDERS = ("sweeps", "spectra")
Stamp: TypeAlias = tuple[tuple[str, int, int], ...]


def stamp_of(path: Path) -> Stamp:
    """Empty where there is no session.

    Parameters
    ----------
    path : Path
        The session's folder.
    """
    try:
        log = (path / SESSION).stat()
    except OSError:
        return ()
    return ((SESSION, log.st_mtime_ns, log.st_size), *(one for folder in FOLDERS for one in _files(path / folder)))


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
