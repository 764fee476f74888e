"""Tells pages what changed on disk, whoever changed it: another tab, a run, the command line."""

from __future__ import annotations

import asyncio
import threading

from starlette.concurrency import run_in_threadpool

from motoremi.arrays import JsonDict
from motoremi.workbench.events import Events
from motoremi.workbench.listing import Listing
from motoremi.workbench.stamps import Stamp

LOOK_EVERY_S = 0.5


class Watch:
    """Looks at the sessions' files as long as a page is open.

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
        """A page has come; called from the event loop."""
        if self._task is None or self._task.done():
            self._task = asyncio.get_running_loop().create_task(self._go_on())

    def look(self) -> None:
        """Tell what has changed since the last look."""
        with self._turn:
            stamps, before = self._listing.stamps(), self._stamps
            self._stamps = stamps
            entries, told = self._listing.entries(), self._entries
            self._entries = entries
        for identifier, stamp in stamps.items():
            if identifier in before and before[identifier] != stamp:
                self._events.publish("changed", {"session": identifier})
        if entries != told:
            self._events.publish("sessions", {"sessions": entries})

    async def _go_on(self) -> None:
        while self._events.heard:
            await run_in_threadpool(self.look)
            await asyncio.sleep(LOOK_EVERY_S)
