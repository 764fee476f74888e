"""Long computations: their progress, elapsed and remaining time, and cancellation."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from motoremi.arrays import JsonDict
from motoremi.errors import BadInput
from motoremi.interrupts import cancelled_by
from motoremi.workbench.events import Events

# Progress is published at most this often.
PUBLISH_EVERY_S = 0.1
# The remaining time is not estimated before this share is done and this time has passed.
LEAST_SHARE, LEAST_S = 0.03, 1.0


class Job:
    """One computation on a session.

    Parameters
    ----------
    session : str
        Identifier.
    title : str
        What is being done, as shown on the page.
    jobs : Jobs
        Notified of progress.
    """

    def __init__(self, session: str, title: str, jobs: Jobs) -> None:
        self.session = session
        self.title = title
        self.cancelled = threading.Event()
        self._jobs = jobs
        self._began_s = time.monotonic()
        self._doing = ""
        self._share = 0.0

    def report(self, doing: str, done: int, total: int) -> None:
        """Record progress. The share done never decreases, even where a part starts over."""
        self._doing = doing
        self._share = max(self._share, done / total if total else 0.0)
        self._jobs.publish()

    def to_dict(self) -> JsonDict:
        """For a page."""
        elapsed = time.monotonic() - self._began_s
        known = self._share >= LEAST_SHARE and elapsed >= LEAST_S
        return {
            "session": self.session,
            "title": self.title,
            "doing": self._doing,
            "share": self._share,
            "elapsed_s": elapsed,
            "remaining_s": elapsed * (1 - self._share) / self._share if known else None,
            "cancelled": self.cancelled.is_set(),
        }


class Jobs:
    """The running jobs: at most one for each session.

    Parameters
    ----------
    events : Events
    """

    def __init__(self, events: Events) -> None:
        self._events = events
        self._turn = threading.Lock()
        self._running: dict[str, Job] = {}
        self._published_s = 0.0

    @contextmanager
    def begin(self, session: str, title: str) -> Iterator[Job]:
        """Run a job on a session for the duration of the block; computations in it can be cancelled.

        Raises
        ------
        BadInput
            If another job is running on this session.
        """
        job = Job(session, title, self)
        with self._turn:
            other = self._running.setdefault(session, job)
        if other is not job:
            raise BadInput(f"{other.title} is going on in this session: wait for its end or cancel it first")
        self.publish(now=True)
        try:
            with cancelled_by(job.cancelled.is_set):
                yield job
        finally:
            with self._turn:
                del self._running[session]
            self.publish(now=True)

    def cancel(self, session: str) -> None:
        """Cancel the job of a session at its next checkpoint; a cancelled job stores nothing."""
        with self._turn:
            job = self._running.get(session)
        if job is not None:
            job.cancelled.set()
            self.publish(now=True)

    def cancel_all(self) -> None:
        """Cancel every job, at shutdown."""
        with self._turn:
            running = list(self._running)
        for session in running:
            self.cancel(session)

    def to_list(self) -> list[JsonDict]:
        """The running jobs, for a page."""
        with self._turn:
            return [job.to_dict() for job in self._running.values()]

    def publish(self, now: bool = False) -> None:
        """Send the running jobs to every page; with `now` even if they were sent a moment ago."""
        if now or time.monotonic() - self._published_s > PUBLISH_EVERY_S:
            self._published_s = time.monotonic()
            self._events.publish("jobs", {"jobs": self.to_list()})
