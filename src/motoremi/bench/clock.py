"""Time as the bench sees it: the wall clock for real instruments, a virtual one for simulated and replayed ones."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """What a driver waits by."""

    def now(self) -> float:
        """Seconds since some fixed moment; never runs backwards."""
        ...

    def sleep(self, seconds: float) -> None:
        """Let that many seconds pass."""
        ...


class WallClock:
    """Real time."""

    def now(self) -> float:
        """Seconds of the machine's monotonic clock."""
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        """Wait that many real seconds; a moment that has passed is not waited for."""
        time.sleep(max(0.0, seconds))


class FastClock:
    """Real time that passes faster, for simulated instruments that other programs wait for.

    Parameters
    ----------
    speed : float
        Seconds of this clock for each real one, above 0.
    """

    def __init__(self, speed: float) -> None:
        self.speed = speed

    def now(self) -> float:
        """Seconds on this clock."""
        return time.monotonic() * self.speed

    def sleep(self, seconds: float) -> None:
        """Wait that many seconds of this clock."""
        time.sleep(max(0.0, seconds) / self.speed)


class VirtualClock:
    """Time that passes only when somebody waits, so that a simulated sweep of a minute takes no time at all."""

    def __init__(self) -> None:
        self._now_s = 0.0

    def now(self) -> float:
        """Virtual seconds since the clock was made."""
        return self._now_s

    def sleep(self, seconds: float) -> None:
        """Move the clock on by that many virtual seconds."""
        self._now_s += max(0.0, seconds)
