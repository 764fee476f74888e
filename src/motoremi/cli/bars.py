"""Progress bars with remaining time, shown only on a terminal."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress as RichProgress
    from rich.progress import TaskID

    from motoremi.arrays import Progress

REDRAWN_S = 0.1


class Bars:
    """Progress bars by label; a bar appears with its first step.

    Parameters
    ----------
    live : rich.progress.Progress or None
        None if no bars are shown.
    """

    def __init__(self, live: RichProgress | None) -> None:
        self._live = live
        self._tasks: dict[str, TaskID] = {}
        self._drawn = 0.0

    def bar(self, label: str) -> Progress | None:
        """The callback of a bar: (name of the step, steps done, steps in all); None if no bars are shown."""
        live = self._live
        if live is None:
            return None

        def advance(name: str, done: int, total: int) -> None:
            if label not in self._tasks:
                self._tasks[label] = live.add_task(label, total=None)
            live.update(self._tasks[label], description=f"{label}: {name}", completed=done, total=total)
            if time.monotonic() > self._drawn + REDRAWN_S or done == 0:
                live.refresh()
                self._drawn = time.monotonic()

        return advance

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Remove the bars from the terminal while a question is answered there."""
        if self._live is not None:
            self._live.stop()
        try:
            yield
        finally:
            if self._live is not None:
                self._live.start()


@contextmanager
def progress_bars(quiet: bool) -> Iterator[Bars]:
    """Bars on standard error if it is a terminal and `quiet` is false."""
    if quiet or not sys.stderr.isatty():
        yield Bars(None)
        return
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Live

    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    # Drawn by the working thread itself: with another thread running, a diagnosis would not use the second core.
    with Live(*columns, console=Console(stderr=True), transient=True, auto_refresh=False) as live:
        yield Bars(live)
