"""Play many blind cases, in one or several processes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from typing import TypeVar

from motoremi.arrays import Progress

Case = TypeVar("Case")
Played = TypeVar("Played")


def play_each(play: Callable[[Case], Played], cases: Sequence[Case], jobs: int, progress: Progress | None = None) -> list[Played]:
    """The results of all cases, in order; they do not depend on the number of jobs.

    Parameters
    ----------
    play : callable
        Plays one case; a module-level function, which can be sent to other processes.
    cases : sequence
    jobs : int
        Number of processes; with one, the cases are played in this process.
    progress : callable, optional
    """
    count = len(cases)
    if jobs <= 1:
        played = []
        for done, case in enumerate(cases):
            if progress is not None:
                progress(f"case {done + 1} of {count}", done, count)
            played.append(play(case))
        return played
    with ProcessPoolExecutor(jobs) as pool:
        futures = [pool.submit(play, case) for case in cases]
        for done, _ in enumerate(as_completed(futures), start=1):
            if progress is not None:
                progress(f"case {done} of {count}", done, count)
        return [future.result() for future in futures]
