"""The sessions offered to pages: those named at the start, those made here, and those in the workbench's own folder."""

from __future__ import annotations

import hashlib
import re
import threading
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path

from motoremi.data.paths import SESSION
from motoremi.data.text_file import show_name
from motoremi.errors import BadInput
from motoremi.workbench.desk import Desk

# Characters to avoid in folder names, on any system.
_OTHER = re.compile(r"[^A-Za-z0-9._-]+")
LONGEST = 80


class Shelf:
    """The sessions by identifier: a page never names a path.

    Parameters
    ----------
    folder : Path
        Where new sessions are created; its sessions are offered.
    named : iterable of Path
        Sessions elsewhere, named when the workbench was started.
    """

    def __init__(self, folder: Path, named: Iterable[Path] = ()) -> None:
        self.folder = folder.resolve()
        self._turn = threading.Lock()
        self._paths: dict[str, Path] = {}
        self._desks: dict[str, Desk] = {}
        self.first = ""
        for path in named:
            self.first = self.place(path)

    def place(self, path: Path) -> str:
        """Offer a session and return its identifier."""
        resolved = path.resolve()
        identifier = hashlib.sha256(str(resolved).encode("utf-8", "surrogateescape")).hexdigest()[:12]
        with self._turn:
            self._paths[identifier] = resolved
        return identifier

    def offered(self) -> dict[str, Path]:
        """Every session that can be opened, newest first."""
        for path in self.folder.iterdir():
            # Only real folders are offered: a link could point anywhere.
            if path.is_dir() and not path.is_symlink() and (path / SESSION).is_file():
                self.place(path)
        with self._turn:
            there = {key: path for key, path in self._paths.items() if (path / SESSION).is_file()}
        return dict(sorted(there.items(), key=lambda entry: -(entry[1] / SESSION).stat().st_mtime))

    def desk(self, identifier: str) -> Desk:
        """An open session.

        Raises
        ------
        BadInput
            If no session is offered under this identifier.
        """
        with self._turn:
            path = self._paths.get(identifier)
            if path is None:
                raise BadInput("this session is not on the workbench's list")
            return self._desks.setdefault(identifier, Desk(path))

    def named(self, wish: str) -> Path:
        """The path of a new folder with the wished name, reduced to safe characters.

        Raises
        ------
        BadInput
            If a folder of that name exists.
        """
        name = _OTHER.sub("-", wish).strip("-._")[:LONGEST]
        if not name:
            return self.fresh("import")
        path = self.folder / name
        if path.exists() or path.is_symlink():
            raise BadInput(f"there is a {show_name(name)} in this folder already: choose another name for the session")
        return path

    def fresh(self, prefix: str) -> Path:
        """The path of a new folder, named by prefix and time."""
        return self.folder / f"motoremi-{prefix}-{datetime.now(UTC):%Y%m%dT%H%M%S%f}Z"
