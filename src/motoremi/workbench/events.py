"""What happens, told to every open page as server-sent events."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from typing import Any

from motoremi.arrays import JsonDict
from motoremi.data.plain import plain
from motoremi.data.text import clean_value

# A page that hears nothing for twice as long asks whether the workbench is still there.
HEARTBEAT_S = 0.5


class Events:
    """Tells pages; may be told from any thread. A page that goes away changes nothing for anybody else."""

    def __init__(self) -> None:
        # None ends a stream.
        self._pages: set[asyncio.Queue[str | None]] = set()
        self._loop: asyncio.AbstractEventLoop | None = None

    @property
    def heard(self) -> bool:
        """Whether a page listens."""
        return bool(self._pages)

    def publish(self, kind: str, data: JsonDict) -> None:
        """Tell every page that is open now."""
        loop = self._loop
        if loop is None or loop.is_closed():
            return
        text = _event(kind, data)
        loop.call_soon_threadsafe(self._put, text)

    def close(self) -> None:
        """End every stream: the workbench ends."""
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._put, None)

    def _put(self, text: str | None) -> None:
        for page in self._pages:
            page.put_nowait(text)

    async def stream(self, state: Callable[[], JsonDict], begun: Callable[[], None]) -> AsyncIterator[str]:
        """One page's stream: first the state, so that a page opened in mid-run catches up, then everything that happens.

        Parameters
        ----------
        state : callable
            What there is to catch up with; asked after the page listens, so that nothing falls in between.
        begun : callable
            Told once the page listens.
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
    # JSON has no bare line ends, so one data line is enough.
    return f"event: {kind}\ndata: {json.dumps(clean_value(plain(data)), allow_nan=False)}\n\n"
