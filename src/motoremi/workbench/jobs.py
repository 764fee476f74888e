"""What takes its time: how far it is, how long it has taken and will take, and how to stop it."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from motoremi.arrays import JsonDict
from motoremi.errors import BadInput
from motoremi.interrupts import cancelled_by
from motoremi.workbench.events import Events

# Pages are told of progress no more often than this.
TELL_EVERY_S = 0.1
# Before so much is done, nobody can say how long the rest will take.
LEAST_SHARE, LEAST_S = 0.03, 1.0


class Job:
    """One piece of work on a session.

    Parameters
    ----------
    session : str
        Identifier.
    title : str
        What is done, as a person says it.
    jobs : Jobs
        Who is told.
    """

    def __init__(self, session: str, title: str, jobs: Jobs) -> None:
        self.session = session
        self.title = title
        self.cancelled = threading.Event()
        self._jobs = jobs
        self._began_s = time.monotonic()
        self._doing = ""
        self._share = 0.0

    def tell(self, doing: str, done: int, total: int) -> None:
        """How far it is; a part that begins anew does not take the counter back."""
        self._doing = doing
        self._share = max(self._share, done / total if total else 0.0)
        self._jobs.tell()

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
    """At most one for each session.

    Parameters
    ----------
    events : Events
    """

    def __init__(self, events: Events) -> None:
        self._events = events
        self._turn = threading.Lock()
        self._running: dict[str, Job] = {}
        self._told_s = 0.0

    @contextmanager
    def begin(self, session: str, title: str) -> Iterator[Job]:
        """Work on a session while the block runs; what computes in it may be cancelled.

        Raises
        ------
        BadInput
            If something else is being done with this session.
        """
        job = Job(session, title, self)
        with self._turn:
            other = self._running.setdefault(session, job)
        if other is not job:
            raise BadInput(f"{other.title} is going on in this session: wait for its end or cancel it first")
        self.tell(now=True)
        try:
            with cancelled_by(job.cancelled.is_set):
                yield job
        finally:
            with self._turn:
                del self._running[session]
            self.tell(now=True)

    def cancel(self, session: str) -> None:
        """Stop what is being done with a session, as soon as it can be stopped; it stores nothing then."""
        with self._turn:
            job = self._running.get(session)
        if job is not None:
            job.cancelled.set()
            self.tell(now=True)

    def cancel_all(self) -> None:
        """The workbench ends."""
        with self._turn:
            running = list(self._running)
        for session in running:
            self.cancel(session)

    def to_list(self) -> list[JsonDict]:
        """What is going on, for a page."""
        with self._turn:
            return [job.to_dict() for job in self._running.values()]

    def tell(self, now: bool = False) -> None:
        """Tell every page, soon or at once."""
        if now or time.monotonic() - self._told_s > TELL_EVERY_S:
            self._told_s = time.monotonic()
            self._events.publish("jobs", {"jobs": self.to_list()})
