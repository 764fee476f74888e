"""Notifies pages of changes on disk, whether by another tab, a run or the command line."""

from __future__ import annotations

import asyncio
import threading

from starlette.concurrency import run_in_threadpool

from motoremi.arrays import JsonDict
from motoremi.workbench.events import Events
from motoremi.workbench.listing import Listing
from motoremi.workbench.stamps import Stamp

CHECK_EVERY_S = 0.5


class Watch:
    """Checks the sessions' files for changes while a page is open.

    Parameters
    ----------
    listing : Listing
    events : Events
    """

    def __init__(self, listing: Listing, events: Events) -> None:
        self._listing = listing
        self._events = events
        self._turn = threading.Lock()
        self._stamps: dict[str, Stamp] = {}
        self._entries: list[JsonDict] = []
        self._task: asyncio.Task[None] | None = None

    def begin(self) -> None:
        """Start checking, when a page connects; called from the event loop."""
        if self._task is None or self._task.done():
            self._task = asyncio.get_running_loop().create_task(self._go_on())

    def look(self) -> None:
        """Publish what has changed since the last check."""
        with self._turn:
            stamps, before = self._listing.stamps(), self._stamps
            self._stamps = stamps
            entries, entries_before = self._listing.entries(), self._entries
            self._entries = entries
        for identifier, stamp in stamps.items():
            if identifier in before and before[identifier] != stamp:
                self._events.publish("changed", {"session": identifier})
        if entries != entries_before:
            self._events.publish("sessions", {"sessions": entries})

    async def _go_on(self) -> None:
        while self._events.connected:
            await run_in_threadpool(self.look)
            await asyncio.sleep(CHECK_EVERY_S)
