"""A signal at random moments of a run, then resume. `make kills` does 200 of SIGKILL and of Ctrl-C, and 50 of a test
with final measurement, and prints a JSON document for each.

A program of its own: it forks, which a test process with threads must not. Each run is a fork of one that has everything loaded, so that
200 kills cost seconds; what is killed is a whole process in the middle of its system calls all the same.
"""

from __future__ import annotations

import copy
import gc
import json
import os
import random
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parent))

from fault_matrix import BENCH_FILE, SEED, small

from motoremi.data.session import SessionWriter, load, reopen, verify
from motoremi.run.rerun import MEASURED, rerun
from motoremi.run.runner import resumable, run, start_document
from motoremi.schema.procedure import Procedure, parse_procedure
from motoremi.virtual.simulated_bench import SimulatedBench
from motoremi.workflow_steps import analyse

STOPPED = 130
# A run takes a fraction of a second; one that hangs is ended by an alarm, and told as a problem.
DEADLINE_S = 60
# Runs for each one to be stopped, and range of the moments, in multiples of the time that a run takes: while other programs work, runs take longer,
# and from that time alone most moments would lie before the first sweep. A run that ends before its moment does not count.
ATTEMPTS, LONGER = 4, 1.5
# Runs that are not stopped, for their duration.
WHOLE = 3


def forked(work: Callable[[], None]) -> int:
    """Do something in a child; its process number."""
    # Nothing that is loaded is touched by the collector, so the child shares it.
    gc.freeze()
    child = os.fork()
    if child == 0:
        status = 1
        # Started in the background, this program inherits Ctrl-C as ignored.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.alarm(DEADLINE_S)
        try:
            work()
            status = 0
        except KeyboardInterrupt:
            status = STOPPED
        except Exception as error:
            sys.stderr.write(f"{type(error).__name__}: {error}\n")
        finally:
            os._exit(status)
    return child


def procedure_of(name: str) -> Procedure:
    """The ready procedure with few points and without its report; its scans are as fine as the maxima need."""
    data = copy.deepcopy(small(name).source)
    data["steps"] = [step for step in data["steps"] if step["do"] not in ("fit", "compare", "diagnose", "report")]
    if name == "conducted_emission":
        data["spectrum"] |= {"start": "1 MHz", "stop": "2 MHz", "step": "4.5 kHz"}
    return parse_procedure(data, name)


def begin(folder: Path, bench: SimulatedBench, told: int, procedure: Procedure) -> None:
    """A run that says over a pipe when the session exists and when each sweep or spectrum is stored."""
    with SessionWriter.create(folder, start_document(procedure, BENCH_FILE)) as writer:
        os.write(told, b"s")
        writer.subscribe(lambda document: os.write(told, b"m") and None if document["kind"] in MEASURED else None)
        run(procedure, bench, writer, analyse=analyse(), prompt=lambda text: None)


def go_on(folder: Path, bench: SimulatedBench) -> None:
    """`motoremi run --resume`."""
    procedure, done = resumable(load(folder), BENCH_FILE)
    run(procedure, bench, reopen(folder), analyse=analyse(), prompt=lambda text: None, done=done)


def stored(folder: Path) -> dict[str, str]:
    """File to hash of everything measured, in order."""
    return {str(d["file"]): str(d["sha256"]) for d in load(folder).documents if d["kind"] in MEASURED}


def one(folder: Path, bench: SimulatedBench, procedure: Procedure, number: signal.Signals, after_s: float | None) -> tuple[bool, int]:
    """Run, and send a signal after so long; whether that stopped it, and how many measurements it had told of.

    Raises
    ------
    RuntimeError
        If the run hung.
    """
    hears, tells = os.pipe()
    child = forked(lambda: begin(folder, bench, tells, procedure))
    os.close(tells)
    os.read(hears, 1)
    if after_s is not None:
        time.sleep(after_s)
        os.kill(child, number)
    _, status = os.waitpid(child, 0)
    told = b""
    while part := os.read(hears, 1000):
        told += part
    os.close(hears)
    if os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGALRM:
        raise RuntimeError(f"a run hung for {DEADLINE_S} s after {number.name}")
    return os.WIFSIGNALED(status) or os.waitstatus_to_exitcode(status) == STOPPED, told.count(b"m")


def main(number: signal.Signals, count: int, name: str, root: Path) -> dict[str, object]:
    """Stop `count` runs; what was lost, and whether each could go on."""
    bench, procedure = SimulatedBench(SEED), procedure_of(name)
    # What the stand's emission is takes seconds to work out: once, here, and not in every run.
    begin(root / "first", SimulatedBench(SEED), os.open(os.devnull, os.O_WRONLY), procedure)
    durations_s = []
    for turn in range(WHOLE):
        begun = time.perf_counter()
        one(root / f"whole-{turn}", bench, procedure, number, None)
        durations_s.append(time.perf_counter() - begun)
    # Of a run that was slowed down by others, most moments would come after the end of the runs to stop.
    duration_s = min(durations_s)
    reference = stored(root / "whole-0")
    randomly = random.Random(1)
    kills, lost, kept, problems = 0, 0, Counter[int](), []
    for _ in range(ATTEMPTS * count):
        if kills == count:
            break
        folder = root / "run"
        killed, told = one(folder, bench, procedure, number, randomly.uniform(0, LONGER * duration_s))
        if killed:
            kills += 1
            # Ctrl-C closes the session; after a kill it may be open.
            left = verify(folder) if number == signal.SIGINT else []
            problem, has = after(folder, bench, told, reference)
            problem = problem or "".join(left[:1])
            kept[has] += 1
            lost += max(0, told - has)
            problems += [f"kill {kills}: {problem}"] if problem else []
        shutil.rmtree(folder)
    return {
        "signal": number.name,
        "procedure": name,
        "kills": kills,
        "lost": lost,
        "kept": {str(n): kept[n] for n in sorted(kept)},
        "problems": problems,
    }


def after(folder: Path, bench: SimulatedBench, told: int, reference: dict[str, str]) -> tuple[str, int]:
    """What is wrong with a killed session and with going on from it; and how many measurements it held."""
    held = stored(folder)
    first = dict(list(reference.items())[: len(held)])
    if held != first or len(held) < told:
        return f"{len(held)} stored, {told} told, or not what was measured", len(held)
    if odd := [text for text in verify(folder) if "interrupted" not in text and "not finished" not in text]:
        return odd[0], len(held)
    if load(folder).status == "done" and not verify(folder):
        return "" if len(held) == len(reference) else "closed without all data", len(held)
    _, status = os.waitpid(forked(lambda: go_on(folder, bench)), 0)
    now = stored(folder)
    if status or verify(folder) or load(folder).status != "done":
        return f"could not be resumed: {verify(folder)}", len(held)
    if len(now) != len(reference) or dict(list(now.items())[: len(held)]) != held:
        return "after going on, not all is there", len(held)
    if any(document["kind"] == "final" for document in load(folder).documents):
        _, status = os.waitpid(forked(lambda: replayed(folder)), 0)
        return "its replay is not the same" if status else "", len(held)
    return "", len(held)


def replayed(folder: Path) -> None:
    """`motoremi replay`; an error if anything came out otherwise."""
    try:
        result = rerun(load(folder), folder.with_name("replay"), analyse)
    finally:
        shutil.rmtree(folder.with_name("replay"), ignore_errors=True)
    if not result.same:
        raise RuntimeError(f"replayed with differences: {result.differing}, {result.differences}")


if __name__ == "__main__":
    # Memory is as good as a disk here: a killed process takes neither away, and only a power cut would need the disk's own promise.
    with tempfile.TemporaryDirectory(prefix="motoremi-kill-", dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as place:
        told = main(signal.Signals[sys.argv[2]], int(sys.argv[1]), sys.argv[3], Path(place))
    sys.stdout.write(json.dumps(told) + "\n")
    sys.exit(1 if told["problems"] or told["lost"] else 0)
