"""Names of files inside a session: data from a file or a caller, so none may point outside the folder."""

from __future__ import annotations

import re
from pathlib import Path

from motoremi.data.text import clean_text
from motoremi.errors import BadInput

SESSION = "session.jsonl"
TRAFFIC = "traffic.jsonl"
MANIFEST = "manifest.json"
# A leading point is kept for files that are not finished; other systems forbid the rest.
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
        If it is not a plain relative name, or a symbolic link stands in its way.
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
