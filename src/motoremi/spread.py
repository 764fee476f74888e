"""Independent work on a second processor core, if there is one to spare.

The helper is a fork of this process, so it knows everything that this one knows and only results travel. It lives for one call.
Forking is safe where no other thread may hold a lock: elsewhere (a notebook's kernel, the workbench) and in worker processes, which have
all cores busy already, the work is done here. Results do not depend on it.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection
from multiprocessing.sharedctypes import Synchronized
from typing import TypeVar

Job = TypeVar("Job")
Result = TypeVar("Result")


def spread(
    work: Callable[[Job], Result], jobs: Sequence[Job], begun: Callable[[int], None] | None = None, cost: Callable[[Job], float] | None = None
) -> list[Result]:
    """The results of `work` for all jobs, in their order.

    Parameters
    ----------
    work : callable
        Independent of what else was done; its results must be plain data.
    jobs : sequence
    begun : callable, optional
        Told the index of each job that this process begins.
    cost : callable, optional
        About how long a job takes compared with others: the longest begin first, so that neither process waits long for the other.
    """
    if len(jobs) < 2 or not core_to_spare():
        return [_told(work, jobs, index, begun) for index in range(len(jobs))]
    order = sorted(range(len(jobs)), key=lambda index: -cost(jobs[index])) if cost is not None else list(range(len(jobs)))
    context = multiprocessing.get_context("fork")
    counter = context.Value("i", 0)
    receiver, sender = context.Pipe(duplex=False)
    helper = context.Process(target=_help, args=(work, jobs, order, counter, receiver, sender), daemon=True)
    helper.start()
    sender.close()
    try:
        results = {}
        while (place := _next(counter)) < len(jobs):
            results[order[place]] = _told(work, jobs, order[place], begun)
        with contextlib.suppress(EOFError):  # what a helper that failed left undone is done here, and fails here if it must
            results |= receiver.recv()
    except BaseException:
        helper.terminate()
        raise
    finally:
        receiver.close()
        helper.join()
    return [results[index] if index in results else work(jobs[index]) for index in range(len(jobs))]


def core_to_spare() -> bool:
    """Whether a helper would be safe and of use."""
    if sys.platform != "linux" or threading.active_count() > 1:
        return False
    return multiprocessing.parent_process() is None and len(os.sched_getaffinity(0)) > 1


def _told(work: Callable[[Job], Result], jobs: Sequence[Job], index: int, begun: Callable[[int], None] | None) -> Result:
    if begun is not None:
        begun(index)
    return work(jobs[index])


def _next(counter: Synchronized[int]) -> int:
    with counter.get_lock():
        counter.value += 1
        return counter.value - 1


def _help(
    work: Callable[[Job], Result],
    jobs: Sequence[Job],
    order: Sequence[int],
    counter: Synchronized[int],
    receiver: Connection,
    sender: Connection,
) -> None:
    # Ctrl-C concerns the process that asked; with it gone, sending fails and the helper ends.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    receiver.close()
    done = {}
    try:
        while (place := _next(counter)) < len(jobs):
            done[order[place]] = work(jobs[order[place]])
        sender.send(done)
    except Exception:  # told by the pipe's end
        sender.close()
