"""What an analysis wants to store, kept back until it is complete: one that is cancelled leaves the session as it was."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from motoremi.workflow import Store


class Draft:
    """Takes what a `Store` takes; the session is not opened for it.

    Parameters
    ----------
    path : Path
        The session's folder.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._wanted: list[Callable[[Store], object]] = []

    def save_analysis(self, name: str, payload: Mapping[str, Any]) -> Path:
        """Store `analysis/<name>.json`, later."""
        self._wanted.append(lambda store: store.save_analysis(name, payload))
        return self.path / "analysis" / f"{name}.json"

    def save_file(self, relative_path: str, data: bytes) -> Path:
        """Store a file, later."""
        self._wanted.append(lambda store: store.save_file(relative_path, data))
        return self.path / relative_path

    def store_in(self, store: Store) -> None:
        """Store everything in the order in which it came."""
        for wanted in self._wanted:
            wanted(store)
