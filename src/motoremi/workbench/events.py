"""Server-sent events: publishes changes to every open page."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from typing import Any

from motoremi.arrays import JsonDict
from motoremi.data.plain import plain
from motoremi.data.text import clean_value

# A page that receives nothing for twice this time checks whether the workbench still answers.
HEARTBEAT_S = 0.5


class Events:
    """Publishes events to all open pages; may be called from any thread. Pages may disconnect at any time."""

    def __init__(self) -> None:
        # One queue for each page; None ends its stream.
        self._pages: set[asyncio.Queue[str | None]] = set()
        self._loop: asyncio.AbstractEventLoop | None = None

    @property
    def connected(self) -> bool:
        """Whether any page is connected."""
        return bool(self._pages)

    def publish(self, kind: str, data: JsonDict) -> None:
        """Send an event to every page that is open now."""
        loop = self._loop
        if loop is None or loop.is_closed():
            return
        text = _event(kind, data)
        loop.call_soon_threadsafe(self._put, text)

    def close(self) -> None:
        """End every stream, at shutdown."""
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._put, None)

    def _put(self, text: str | None) -> None:
        for page in self._pages:
            page.put_nowait(text)

    async def stream(self, state: Callable[[], JsonDict], begun: Callable[[], None]) -> AsyncIterator[str]:
        """The stream of one page: first the current state, so that a page opened during a run shows it, then all events.

        Parameters
        ----------
        state : callable
            Returns the current state; called after the page is subscribed, so that no event is lost in between.
        begun : callable
            Called once the page is subscribed.
        """
        self._loop = asyncio.get_running_loop()
        page: asyncio.Queue[str | None] = asyncio.Queue()
        self._pages.add(page)
        try:
            begun()
            yield _event("state", state())
            while True:
                try:
                    text = await asyncio.wait_for(page.get(), HEARTBEAT_S)
                except TimeoutError:
                    text = _event("beat", {})
                if text is None:
                    return
                yield text
        finally:
            self._pages.discard(page)


def _event(kind: str, data: Any) -> str:
    # JSON text contains no line breaks, so one data line is enough.
    return f"event: {kind}\ndata: {json.dumps(clean_value(plain(data)), allow_nan=False)}\n\n"
