"""What commands print: text for people, one JSON document for machines, progress on terminals only."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from motoremi.data.plain import plain
from motoremi.data.text import clean_text
from motoremi.diagnosis.diagnosis import Progress


def emit_json(document: Any) -> None:
    """One JSON document on standard output."""
    sys.stdout.write(json.dumps(plain(document), ensure_ascii=False, allow_nan=False, indent=1) + "\n")


def say(text: str = "") -> None:
    """A line for a person; control characters from outside are shown, not obeyed."""
    sys.stdout.write("\n".join(clean_text(line) for line in text.splitlines()) + "\n")


@contextmanager
def progress_bar(label: str, quiet: bool) -> Iterator[Progress | None]:
    """A bar with remaining time on a terminal; nothing elsewhere."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(label, total=None)

        def advance(name: str, done: int, total: int) -> None:
            bar.update(task, description=f"{label}: {name}", completed=done, total=total)

        yield advance
