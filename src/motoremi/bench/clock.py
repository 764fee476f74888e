"""Clocks: real time for real instruments, virtual time for simulated and replayed ones."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """The clock that drivers and runs use for all waiting."""

    def now(self) -> float:
        """Seconds since some fixed moment; never decreases."""
        ...

    def sleep(self, seconds: float) -> None:
        """Wait that many seconds."""
        ...


class WallClock:
    """Real time."""

    def now(self) -> float:
        """Seconds of the machine's monotonic clock."""
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        """Wait that many real seconds; not at all if the number is negative."""
        time.sleep(max(0.0, seconds))


class FastClock:
    """Accelerated real time, for simulated instruments that other programs wait for.

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
    """Time that advances only by `sleep`, so that a simulated sweep of a minute takes no real time."""

    def __init__(self) -> None:
        self._now_s = 0.0

    def now(self) -> float:
        """Virtual seconds since the clock was made."""
        return self._now_s

    def sleep(self, seconds: float) -> None:
        """Move the clock on by that many virtual seconds."""
        self._now_s += max(0.0, seconds)
