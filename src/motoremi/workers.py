"""Independent jobs in several processes, by any `map`.

A job is plain data and its work a function of a module, so the built-in `map` will do, as will that of a pool, an executor or a cluster.
Results do not depend on which.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.synchronize import Event
from typing import Protocol, TypeVar

from motoremi.interrupts import cancelled_by

Job = TypeVar("Job")
Result = TypeVar("Result")
# More have nothing to do: a race ends with a few models.
MOST_PROCESSES = 16


class Map(Protocol):
    """As the built-in `map`: the results of `work` for all jobs, in their order."""

    def __call__(self, work: Callable[[Job], Result], jobs: Iterable[Job], /) -> Iterable[Result]: ...


@contextmanager
def own_processes() -> Iterator[Map]:
    """A map over forks of this process, one for each core, while the block runs; the built-in one where that is not safe or of no use."""
    count = useful_processes()
    if count < 2:
        yield map
        return
    context = multiprocessing.get_context("fork")
    ended = context.Event()
    with ProcessPoolExecutor(count, context, _begin, (ended,)) as executor:
        try:
            yield _Shared(executor)
        except BaseException:
            # Jobs that run notice it within a second.
            ended.set()
            executor.shutdown(cancel_futures=True)
            raise


def useful_processes() -> int:
    """How many processes there is a core for.

    One, which is this one, where forking is not safe, because another thread may hold a lock (a notebook's kernel, the workbench), and in
    processes that were started for a share of the work themselves.
    """
    if sys.platform != "linux" or threading.active_count() > 1 or multiprocessing.parent_process() is not None:
        return 1
    return min(len(os.sched_getaffinity(0)), MOST_PROCESSES)


class _Shared:
    """Jobs in an executor; those that were lost with a process (killed, out of memory) are done here."""

    def __init__(self, executor: ProcessPoolExecutor) -> None:
        self._executor = executor

    def __call__(self, work: Callable[[Job], Result], jobs: Iterable[Job], /) -> Iterator[Result]:
        # All are handed out before the first result is asked for.
        handed_out = [(job, self._submitted(work, job)) for job in jobs]
        return (self._result(work, job, future) for job, future in handed_out)

    def _submitted(self, work: Callable[[Job], Result], job: Job) -> Future[Result] | None:
        try:
            return self._executor.submit(_done, work, job)
        except BrokenProcessPool:
            return None

    def _result(self, work: Callable[[Job], Result], job: Job, future: Future[Result] | None) -> Result:
        if future is not None:
            try:
                return future.result()
            except BrokenProcessPool:
                pass
        return work(job)


# In a process of the pool: whether its work is no longer wanted.
_ended: Event


def _begin(ended: Event) -> None:
    """What a process of the pool does first."""
    global _ended
    _ended = ended
    # Ctrl-C and a closed terminal concern the process that asked.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_leave_with_parent, daemon=True).start()


def _leave_with_parent() -> None:
    """End this process when the one that asked is gone, however it went."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


def _done(work: Callable[[Job], Result], job: Job) -> Result:
    with cancelled_by(_ended.is_set):
        return work(job)
