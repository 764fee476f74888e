"""The list of sessions: motor, date and state of each, read without opening the session."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

from motoremi.arrays import JsonDict
from motoremi.data.chain import read_chain
from motoremi.data.paths import SESSION, inside
from motoremi.data.session import run_status
from motoremi.data.storage import is_being_written
from motoremi.data.text_file import read_bytes
from motoremi.errors import BadInput
from motoremi.workbench.shelf import Shelf
from motoremi.workbench.stamps import Stamp, stamp_of

State: TypeAlias = Literal["measuring", "interrupted", "failed", "complete", "diagnosed", "unreadable"]


@dataclass(frozen=True)
class Entry:
    """One session of the list.

    Parameters
    ----------
    motor : str
        Empty if not named.
    began : str
        ISO 8601, UTC.
    state : str
        "measuring" while a thread or process is writing its measurement; otherwise how the measurement ended, or "diagnosed".
    """

    motor: str
    began: str
    state: State


class Listing:
    """The sessions of the shelf; each is read again only when its file has changed.

    Parameters
    ----------
    shelf : Shelf
    """

    def __init__(self, shelf: Shelf) -> None:
        self._shelf = shelf
        self._known: dict[Path, tuple[tuple[int, int], Entry]] = {}

    def entries(self) -> list[JsonDict]:
        """Every session that can be opened, newest first."""
        listed = []
        for identifier, path in self._shelf.offered().items():
            entry = self.entry(path)
            listed.append({"id": identifier, "name": path.name, "motor": entry.motor, "began": entry.began, "state": entry.state})
        return listed

    def stamps(self) -> dict[str, Stamp]:
        """The stamp of each session, by identifier."""
        return {identifier: stamp for identifier, path in self._shelf.offered().items() if (stamp := stamp_of(path))}

    def entry(self, path: Path) -> Entry:
        """The list's entry for one session."""
        stamp = _stamp(path)
        if stamp is None:
            return Entry("", "", "unreadable")
        known = self._known.get(path)
        if known is None or known[0] != stamp:
            known = self._known[path] = stamp, _read(path)
        entry = known[1]
        # A killed program leaves the file unchanged, so check each time whether the session is still being written.
        if entry.state == "interrupted" and is_being_written(path / SESSION):
            return Entry(entry.motor, entry.began, "measuring")
        return entry


def _read(path: Path) -> Entry:
    try:
        documents = read_chain(read_bytes(inside(path, SESSION))).documents
    except BadInput:
        documents = ()
    if not documents:
        return Entry("", "", "unreadable")
    start, status = documents[0], run_status(documents)
    diagnosed = any(document["kind"] == "analysis" and document.get("name") == "diagnosis" for document in documents)
    state: State = "interrupted" if status == "interrupted" else "failed" if status == "failed" else "diagnosed" if diagnosed else "complete"
    return Entry(str(start.get("motor", "")), str(start.get("time", "")), state)


def _stamp(path: Path) -> tuple[int, int] | None:
    try:
        found = (path / SESSION).stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size
