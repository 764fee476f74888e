"""Which sessions the page may see: those named at the start, those made here, and those in the workbench's own folder."""

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

# What a folder is not named with, on any system.
_OTHER = re.compile(r"[^A-Za-z0-9._-]+")
LONGEST = 80


class Shelf:
    """Sessions by identifier; a page never names a path.

    Parameters
    ----------
    folder : Path
        Where new sessions are made, and whose sessions are offered.
    named : iterable of Path
        Sessions from elsewhere, named by who started the workbench.
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
        """Offer a session; returns its identifier."""
        resolved = path.resolve()
        identifier = hashlib.sha256(str(resolved).encode("utf-8", "surrogateescape")).hexdigest()[:12]
        with self._turn:
            self._paths[identifier] = resolved
        return identifier

    def offered(self) -> dict[str, Path]:
        """Every session that can be opened, newest first."""
        for path in self.folder.iterdir():
            # A link could lead anywhere: only real folders are offered.
            if path.is_dir() and not path.is_symlink() and (path / SESSION).is_file():
                self.place(path)
        with self._turn:
            there = {key: path for key, path in self._paths.items() if (path / SESSION).is_file()}
        return dict(sorted(there.items(), key=lambda entry: -(entry[1] / SESSION).stat().st_mtime))

    def desk(self, identifier: str) -> Desk:
        """An opened session.

        Raises
        ------
        BadInput
            If nothing was offered under this identifier.
        """
        with self._turn:
            path = self._paths.get(identifier)
            if path is None:
                raise BadInput("this session is not on the workbench's list")
            return self._desks.setdefault(identifier, Desk(path))

    def named(self, wish: str) -> Path:
        """A new folder with the name that somebody wishes, as far as a folder can have it.

        Raises
        ------
        BadInput
            If there is one of that name.
        """
        name = _OTHER.sub("-", wish).strip("-._")[:LONGEST]
        if not name:
            return self.fresh("import")
        path = self.folder / name
        if path.exists() or path.is_symlink():
            raise BadInput(f"there is a {show_name(name)} in this folder already: choose another name for the session")
        return path

    def fresh(self, prefix: str) -> Path:
        """A new folder's name."""
        return self.folder / f"motoremi-{prefix}-{datetime.now(UTC):%Y%m%dT%H%M%S%f}Z"
