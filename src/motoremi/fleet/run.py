"""Run a fleet: submit sessions to an executor, store each result at once, and continue where an earlier run stopped."""

from __future__ import annotations

import json
import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

from motoremi.arrays import JsonDict, Progress
from motoremi.data.paths import SESSION
from motoremi.data.plain import object_from_json
from motoremi.data.storage import AppendFile
from motoremi.errors import BadInput, InstrumentError
from motoremi.export.extras import needs
from motoremi.fleet.work import Job, work
from motoremi.workers import begin_worker, until_ended

RESULTS, FIGURES = "fleet.jsonl", "fleet.json"
# Number of jobs submitted for each worker: enough to keep it busy, few enough to limit the memory.
_IN_FLIGHT = 4
# Number of times that a session is tried whose worker ends while it works on this session alone.
_TRIES = 3


def sessions_in(folder: Path) -> list[str]:
    """Sessions below a folder by their relative path, sorted; a session's own folders are not searched.

    Raises
    ------
    BadInput
        If the folder does not exist or contains no session.
    """
    if not folder.is_dir():
        raise BadInput(f"{folder}: no such folder")
    found = []
    for here, folders, files in os.walk(folder):
        folders.sort()
        if SESSION in files:
            found.append(Path(here).relative_to(folder).as_posix())
            folders.clear()
    if not found:
        raise BadInput(f"{folder}: no sessions in this folder (a session holds {SESSION}); make them of files with motoremi import-folder")
    return sorted(found)


def run_fleet(jobs: Sequence[Job], out: Path, executor: ExecutorMaker, progress: Progress | None = None) -> int:
    """Work on all jobs that have no stored result yet; returns their number.

    Every result is written as one line of `fleet.jsonl` before the next is processed, so that a run that was stopped can be continued.
    """
    out.mkdir(parents=True, exist_ok=True)
    log = out / RESULTS
    file = AppendFile(log, new=not log.exists())
    try:
        # Before anything is read or cut off: another run may be writing.
        file.lock()
        waiting = _pending(jobs, log)
        total, done = len(jobs), len(jobs) - len(waiting)
        for result in _computed(waiting, executor):
            file.append(json.dumps(result, allow_nan=False, sort_keys=True), sync=True)
            done += 1
            if progress is not None:
                progress(str(result["session"]), done, total)
    finally:
        file.close()
    return len(waiting)


def stored_results(log: Path) -> Iterator[JsonDict]:
    """Results in the order in which they were stored, without an incomplete last line."""
    if not log.exists():
        return
    with open(log, "rb") as file:
        for line in file:
            if not line.endswith(b"\n"):
                return
            try:
                result = object_from_json(line)
            except ValueError as error:
                raise BadInput(f"{log}: a line is damaged ({error}); move the file away and run again") from error
            yield result


def _pending(jobs: Sequence[Job], log: Path) -> list[Job]:
    _drop_torn_line(log)
    known = {(result.get("session"), result.get("key")) for result in stored_results(log) if result.get("status") != "lost"}
    return [job for job in jobs if (job.session, job.key()) not in known]


def settled(jobs: Sequence[Job], log: Path) -> Iterator[JsonDict]:
    """The last stored result of each job, in the order of the jobs, read one by one to limit the memory."""
    wanted = {job.session: job.key() for job in jobs}
    places: dict[str, int] = {}
    offset = 0
    with open(log, "rb") as file:
        for line in file:
            result = object_from_json(line)
            if wanted.get(str(result.get("session"))) == result.get("key"):
                places[str(result["session"])] = offset
            offset += len(line)
        for session in wanted:
            if session in places:
                file.seek(places[session])
                yield object_from_json(file.readline())


def _drop_torn_line(log: Path) -> None:
    """Cut off an incomplete last line, in place: whoever has the file open and locked goes on writing to the same one."""
    data = log.read_bytes()
    if data and not data.endswith(b"\n"):
        os.truncate(log, data.rfind(b"\n") + 1)


class ExecutorMaker:
    """Creates executors; `open` may be called again after the workers of an executor have ended."""

    workers = 1

    @property
    def task(self) -> Callable[[Job], JsonDict]:
        """What a worker does with a job."""
        return work

    def open(self) -> Executor:
        """A new executor."""
        raise NotImplementedError

    def stop(self) -> None:
        """End the work in progress soon, if that is possible."""


class LocalProcesses(ExecutorMaker):
    """Processes of this machine."""

    def __init__(self, workers: int) -> None:
        self.workers = workers
        self._ended = multiprocessing.Event()

    def open(self) -> Executor:
        return ProcessPoolExecutor(self.workers, initializer=begin_worker, initargs=(self._ended,))

    def stop(self) -> None:
        self._ended.set()

    @property
    def task(self) -> Callable[[Job], JsonDict]:
        return partial(until_ended, work)


class DaskCluster(ExecutorMaker):
    """Workers of an existing Dask cluster; motoremi must be installed there and the sessions be accessible under the same path.

    Raises
    ------
    InstrumentError
        If no scheduler answers.
    BadInput
        If Dask is not installed or the address is not valid.
    """

    def __init__(self, address: str) -> None:
        if not address.startswith(("tcp://", "tls://")):
            raise BadInput(f"{address!r} is not the address of a scheduler: write for example tcp://127.0.0.1:8786")
        needs("distributed", "a Dask cluster", "fleet")
        import distributed

        connect: Any = distributed.Client
        try:
            self._client: Any = connect(address, timeout=5, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            raise InstrumentError(f"no Dask scheduler answers at {address}: {error}") from error
        self.workers = max(1, len(self._client.scheduler_info(n_workers=-1)["workers"]))

    def open(self) -> Executor:
        # pure=False: results are not cached by Dask, because a session may have changed since another client submitted the same job.
        return self._client.get_executor(pure=False)

    def close(self) -> None:
        """Disconnect from the cluster."""
        self._client.close()


def _computed(jobs: Sequence[Job], maker: ExecutorMaker) -> Iterator[JsonDict]:
    """Results in the order of completion. If a worker ends unexpectedly, the sessions in progress are tried again one by one."""
    tries: dict[Job, int] = {}
    queue = iter(jobs)
    suspects: list[Job] = []
    with ExitStack() as stack, _stopping(maker):
        pool = stack.enter_context(maker.open())
        flying: dict[Future[JsonDict], Job] = {}
        while True:
            if suspects and not flying:
                # After a worker has ended, the jobs in progress are run one at a time to find the one that caused it.
                job = suspects.pop()
                flying[pool.submit(maker.task, job)] = job
            elif not suspects and not any(job in tries for job in flying.values()):
                for job in islice(queue, _IN_FLIGHT * maker.workers - len(flying)):
                    flying[pool.submit(maker.task, job)] = job
            if not flying:
                return
            finished, _ = wait(flying, return_when=FIRST_COMPLETED)
            broken: list[Job] = []
            for future in finished:
                job = flying.pop(future)
                try:
                    result = future.result()
                except BrokenProcessPool:
                    broken.append(job)
                except CancelledError as error:
                    raise InstrumentError("lost the connection to the cluster; results are kept, run the same command to continue") from error
                except Exception as error:  # the cluster has given up on this job because its workers ended too often
                    yield _lost(job, f"{type(error).__name__}: {error}")
                else:
                    yield result
            if broken:
                broken += flying.values()
                flying.clear()
                pool = stack.enter_context(maker.open())
                for job in broken:
                    tries[job] = tries.get(job, 0) + (len(broken) == 1)
                    if tries[job] >= _TRIES:
                        yield _lost(job, "its worker died")
                    else:
                        suspects.append(job)


@contextmanager
def _stopping(maker: ExecutorMaker) -> Iterator[None]:
    """If the block is left by an exception, the workers do not finish what they are doing."""
    try:
        yield
    except BaseException:
        maker.stop()
        raise


def _lost(job: Job, why: str) -> JsonDict:
    return {"session": job.session, "key": job.key(), "status": "lost", "trouble": why[:500]}
