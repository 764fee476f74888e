"""Independent jobs in several processes, by any `map`.

A job is plain data and the work on it is a function of a module, so that the built-in `map` can be used as well as the `map` of a process
pool, an executor or a cluster. Results do not depend on which one is used.
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
from pickle import PicklingError
from typing import Protocol, TypeVar

from motoremi.interrupts import cancelled_by

Job = TypeVar("Job")
Result = TypeVar("Result")
# What `pickle` raises. If the work itself raised it, computing it again in this process raises it again.
NOT_SENT = (PicklingError, AttributeError, TypeError)
# Further processes would be idle: the search ends with a few models.
MOST_PROCESSES = 16


class Map(Protocol):
    """A function like the built-in `map`: it returns the results of `work` for all jobs, in their order."""

    def __call__(self, work: Callable[[Job], Result], jobs: Iterable[Job], /) -> Iterable[Result]: ...


@contextmanager
def own_processes() -> Iterator[Map]:
    """A map over forked processes, one for each core, for the duration of the block; the built-in `map` if forking is unsafe or useless."""
    count = useful_processes()
    if count < 2:
        yield map
        return
    context = multiprocessing.get_context("fork")
    ended = context.Event()
    with ProcessPoolExecutor(count, context, begin_worker, (ended,)) as executor:
        try:
            yield _Shared(executor)
        except BaseException:
            # Running jobs check this at least once a second.
            ended.set()
            executor.shutdown(cancel_futures=True)
            raise


def useful_processes() -> int:
    """Number of processes that can work at the same time, one for each core.

    It is 1 (this process) if forking is not safe because another thread may hold a lock (the kernel of a notebook, the workbench), and in a
    process that was itself started as a worker.
    """
    if sys.platform != "linux" or threading.active_count() > 1 or multiprocessing.parent_process() is not None:
        return 1
    return min(len(os.sched_getaffinity(0)), MOST_PROCESSES)


class _Shared:
    """A map over an executor; jobs that a worker process cannot compute are computed in this process.

    They are lost if the worker ends (killed, out of memory), or cannot be sent to it: a motor with a branch of the user's own has no name by which
    a worker could build it.
    """

    def __init__(self, executor: ProcessPoolExecutor) -> None:
        self._executor, self._sendable = executor, True

    def __call__(self, work: Callable[[Job], Result], jobs: Iterable[Job], /) -> Iterator[Result]:
        # All jobs are submitted before the first result is waited for.
        submitted = [(job, self._submitted(work, job)) for job in jobs]
        return (self._result(work, job, future) for job, future in submitted)

    def _submitted(self, work: Callable[[Job], Result], job: Job) -> Future[Result] | None:
        if not self._sendable:
            return None
        try:
            return self._executor.submit(until_ended, work, job)
        except BrokenProcessPool:
            return None

    def _result(self, work: Callable[[Job], Result], job: Job, future: Future[Result] | None) -> Result:
        if future is not None:
            try:
                return future.result()
            except BrokenProcessPool:
                pass
            except NOT_SENT:
                self._sendable = False
        return work(job)


# In a worker process: set when its result is no longer needed.
_ended: Event


def begin_worker(ended: Event) -> None:
    """Initialise a worker process: it leaves signals to its parent and ends with it."""
    global _ended
    _ended = ended
    # Ctrl-C and a closed terminal are handled by the parent process.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_leave_with_parent, daemon=True).start()


def _leave_with_parent() -> None:
    """End this process when its parent has ended, for whatever reason."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


def until_ended(work: Callable[[Job], Result], job: Job) -> Result:
    """In a worker process: the result of `work`, which is cancelled when the event given to `begin_worker` is set."""
    with cancelled_by(_ended.is_set):
        return work(job)
