"""Independent work on a second processor core, if there is one to spare, and none of the linear algebra's own threads.

The helper is a fork of this process, so it knows everything that this one knows at that moment; afterwards only plain data travel.
Forking is safe where no other thread may hold a lock: elsewhere (a notebook's kernel, the workbench) and in worker processes, which have
all cores busy already, the work is done here. Results do not depend on it.
"""

from __future__ import annotations

import functools
import gc
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Hashable, Mapping, Sequence
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from multiprocessing.sharedctypes import Synchronized
from types import TracebackType
from typing import Generic, ParamSpec, TypeVar

Name = TypeVar("Name", bound=Hashable)
Known = TypeVar("Known")
Given = TypeVar("Given")
Result = TypeVar("Result")
Arguments = ParamSpec("Arguments")


def spread(work: Callable[[Known], Result], jobs: Sequence[Known]) -> list[Result]:
    """The results of `work` for all jobs, in their order; only results need be plain data."""
    with Team({place: (work, job) for place, job in enumerate(jobs)}) as team:
        results = team.each(_applied, dict.fromkeys(range(len(jobs))))
    return [results[place] for place in range(len(jobs))]


def _applied(known: tuple[Callable[[Known], Result], Known], given: None) -> Result:
    work, job = known
    return work(job)


class Team(Generic[Name, Known]):
    """This process and a helper that knows the same things, for several rounds of work on them.

    A context manager: the helper lives from its beginning to its end.

    Parameters
    ----------
    known : mapping
        What there is to work on, of any kind, by name.
    """

    def __init__(self, known: Mapping[Name, Known]) -> None:
        self._known = known
        self._helper: BaseProcess | None = None

    def __enter__(self) -> Team[Name, Known]:
        if len(self._known) > 1 and core_to_spare():
            context = multiprocessing.get_context("fork")
            self._counter: Synchronized[int] = context.Value("i", 0)
            self._line, far_end = context.Pipe()
            self._helper = context.Process(target=self._help, args=(far_end,), daemon=True)
            self._helper.start()
            far_end.close()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._helper is not None:
            self._line.close()
            if error is not None:
                self._helper.terminate()
                self._helper.join()

    def each(
        self, work: Callable[[Known, Given], Result], given: Mapping[Name, Given], begun: Callable[[Name], None] | None = None
    ) -> dict[Name, Result]:
        """The results of a round of work on some of what the team knows, in the order given.

        Parameters
        ----------
        work : callable
            Of something known and something given; a function of a module or a `partial` of one. It must not depend on what else was done.
        given : mapping
            Plain data, as names and results are. Work begins in this order.
        begun : callable, optional
            Told the name of each job that this process begins.
        """

        def done(name: Name) -> Result:
            if begun is not None:
                begun(name)
            return work(self._known[name], given[name])

        names = list(given)
        if len(names) < 2 or not self._told((work, list(given.items()))):
            return {name: done(name) for name in names}
        results = {}
        while (place := _next(self._counter)) < len(names):
            results[names[place]] = done(names[place])
        try:
            results |= self._line.recv()
        except (EOFError, ConnectionError):  # what a helper that failed left undone is done here, and fails here if it must
            self._helper = None
        return {name: results[name] if name in results else done(name) for name in names}

    def _told(self, round_of_work: object) -> bool:
        """Whether the helper knows what is to be done."""
        if self._helper is None:
            return False
        self._counter.value = 0
        try:
            self._line.send(round_of_work)
        except ConnectionError:
            self._helper = None
        return self._helper is not None

    def _help(self, line: Connection) -> None:
        # Ctrl-C concerns the process that asked; with it gone, the line ends and so does the helper.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        self._line.close()
        gc.disable()  # it would touch, and so copy, everything that is known
        try:
            while True:
                work, jobs = line.recv()
                done = {}
                while (place := _next(self._counter)) < len(jobs):
                    name, own = jobs[place]
                    done[name] = work(self._known[name], own)
                line.send(done)
        except Exception:  # told by the line's end
            line.close()


def one_blas_thread(work: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """The same function, with one thread in the linear algebra: on matrices as small as here more threads cost more than they bring."""

    @functools.wraps(work)
    def limited(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
        from threadpoolctl import threadpool_limits

        with threadpool_limits(limits=1, user_api="blas"):
            return work(*args, **kwargs)

    return limited


def core_to_spare() -> bool:
    """Whether a helper would be safe and of use."""
    if sys.platform != "linux" or threading.active_count() > 1:
        return False
    return multiprocessing.parent_process() is None and len(os.sched_getaffinity(0)) > 1


def _next(counter: Synchronized[int]) -> int:
    with counter.get_lock():
        counter.value += 1
        return counter.value - 1
