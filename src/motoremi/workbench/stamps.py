"""Names, modification times and sizes of a session's log, manifest and measured files, to notice any change."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TypeAlias

from motoremi.data.paths import MANIFEST, SESSION

# Without analyses: each is replaced just before the log records it, so for a moment the two differ without being damaged.
FOLDERS = ("sweeps", "spectra")
Stamp: TypeAlias = tuple[tuple[str, int, int], ...]


def stamp_of(path: Path) -> Stamp:
    """The stamp of a session; empty if there is none.

    Parameters
    ----------
    path : Path
        The session's folder.
    """
    log = _file(path, SESSION)
    if not log:
        return ()
    # The manifest is written last, after the log: it turns an interrupted session into a complete one.
    return (*log, *_file(path, MANIFEST), *(one for folder in FOLDERS for one in _files(path / folder)))


def _file(folder: Path, name: str) -> list[tuple[str, int, int]]:
    try:
        found = (folder / name).stat()
    except OSError:
        return []
    return [(name, found.st_mtime_ns, found.st_size)]


def _files(folder: Path) -> list[tuple[str, int, int]]:
    stamps = []
    try:
        with os.scandir(folder) as entries:
            for entry in entries:
                found = entry.stat(follow_symlinks=False)
                stamps.append((f"{folder.name}/{entry.name}", found.st_mtime_ns, found.st_size))
    except OSError:
        # The folder does not exist, or a file was deleted during the scan: the next scan notices.
        pass
    return sorted(stamps)
