"""Check names of files inside a session: they come from documents or callers and must not point outside the folder."""

from __future__ import annotations

import re
from pathlib import Path

from motoremi.data.text import clean_text
from motoremi.errors import BadInput

SESSION = "session.jsonl"
TRAFFIC = "traffic.jsonl"
MANIFEST = "manifest.json"
# Folders and files of what was measured: only the session writer writes them.
RESERVED = {"sweeps", "spectra", "standards", "compensation", "analysis", SESSION, TRAFFIC, MANIFEST}
# Names with a leading point are reserved for unfinished files; other characters are forbidden on some systems.
_PART = re.compile(r"[A-Za-z0-9_@+=(),~ -][A-Za-z0-9_@+=(),~ .-]*")


def inside(folder: Path, relative: object) -> Path:
    """The path of a file in a session folder.

    Parameters
    ----------
    folder : Path
    relative : object
        Must be text such as `report/report.html`, with `/` between the parts.

    Raises
    ------
    BadInput
        If it is not a plain relative name, or a part of it is a symbolic link.
    """
    parts = relative.split("/") if isinstance(relative, str) else []
    if not parts or any(not _PART.fullmatch(part) or part.endswith((".", " ")) for part in parts):
        raise BadInput(f"{folder}: {clean_text(repr(relative), 80)} cannot name a file of this session")
    path = folder
    for part in parts:
        path = path / part
        if path.is_symlink():
            raise BadInput(f"{folder}: {relative} is a symbolic link; a session holds real files only")
    return path
