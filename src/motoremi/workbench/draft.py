"""Collects what an analysis stores until the analysis is complete: a cancelled one leaves the session unchanged."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from motoremi.workflow import Store


class Draft:
    """A stand-in for a `Store` that does not open the session.

    Parameters
    ----------
    path : Path
        The session's folder.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._recorded: list[Callable[[Store], object]] = []

    def save_analysis(self, name: str, payload: Mapping[str, Any]) -> Path:
        """Record an analysis, to be stored later as `analysis/<name>.json`."""
        self._recorded.append(lambda store: store.save_analysis(name, payload))
        return self.path / "analysis" / f"{name}.json"

    def save_file(self, relative_path: str, data: bytes) -> Path:
        """Record a file, to be stored later."""
        self._recorded.append(lambda store: store.save_file(relative_path, data))
        return self.path / relative_path

    def store_in(self, store: Store) -> None:
        """Store everything recorded, in the same order."""
        for save in self._recorded:
            save(store)
