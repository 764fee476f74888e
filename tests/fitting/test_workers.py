"""Jobs in several processes, and one thread in the linear algebra: the same results, wherever they are made and whatever befalls a process."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import threadpoolctl
from few_effects import seeking

import motoremi as me
from motoremi import workers
from motoremi.blind.cases import Case
from motoremi.data.analyser import ADAPTERS, ANALYSERS, FIXTURES, find_analyser
from motoremi.data.measurement import Measurement
from motoremi.fitting.race import raced_alone
from motoremi.fitting.trail import trail_to
from motoremi.interrupts import Cancelled, checkpoint
from motoremi.threads import one_blas_thread
from motoremi.workers import own_processes, useful_processes

needs_fork = pytest.mark.skipif(sys.platform != "linux", reason="forks on Linux only")


@pytest.fixture(autouse=True)
def two_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever this machine has, and whatever threads other tests left in this process (Dask keeps its own for good)."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0, 1}, raising=False)
    left = set(threading.enumerate()) - {threading.main_thread()}
    monkeypatch.setattr(threading, "active_count", lambda: len(set(threading.enumerate()) - left))


def slow_square(value: int) -> tuple[int, int]:
    time.sleep(0.02)
    return value**2, os.getpid()


def gone(seconds: float = 5.0) -> bool:
    """Whether no other process is left; one whose work is done may take a moment to go."""
    until = time.monotonic() + seconds
    while multiprocessing.active_children() and time.monotonic() < until:
        time.sleep(0.01)
    return not multiprocessing.active_children()


@needs_fork
def test_results_come_in_order_from_two_processes() -> None:
    with own_processes() as each:
        for count in (12, 1, 0):
            results = list(each(slow_square, range(count)))
            assert [value for value, _ in results] == [value**2 for value in range(count)]
            assert os.getpid() not in {process for _, process in results}
            assert len({process for _, process in results}) == min(count, 2)
    assert gone()


def died_elsewhere(job: tuple[int, str, int]) -> int:
    """Minus the value; in another process than `here` it dies first."""
    value, way, here = job
    if os.getpid() != here:
        if way == "exit":
            os._exit(3)
        os.kill(os.getpid(), signal.SIGKILL)
    return -value


@needs_fork
@pytest.mark.parametrize("way", ["exit", "kill"])
def test_what_was_lost_with_a_process_is_done_here(way: str) -> None:
    with own_processes() as each:
        jobs = [(value, way, os.getpid()) for value in range(8)]
        for _ in range(2):  # the second time no process is left from the beginning
            assert list(each(died_elsewhere, jobs)) == [-value for value in range(8)]
    assert gone()


@needs_fork
def test_processes_killed_between_two_rounds_are_done_without() -> None:
    with own_processes() as each:
        list(each(slow_square, range(6)))
        for process in multiprocessing.active_children():
            process.kill()
            process.join()
        for _ in range(2):
            assert list(each(slow_square, range(6))) == [(value**2, os.getpid()) for value in range(6)]
    assert gone()


def called(job: Callable[[], int]) -> tuple[int, int]:
    return job(), os.getpid()


@needs_fork
def test_what_cannot_be_sent_is_done_here() -> None:
    """A circuit with a branch that no catalogue has is none that a worker could build."""
    with own_processes() as each:
        for _ in range(2):
            assert list(each(called, [lambda value=value: value for value in range(30)])) == [(value, os.getpid()) for value in range(30)]
        with pytest.raises(ZeroDivisionError, match="three"):
            list(each(three_fails, range(6)))
    assert gone()


def three_fails(value: int) -> int:
    if value == 3:
        raise ZeroDivisionError("three")
    return value


def test_an_error_of_the_work_is_raised() -> None:
    with pytest.raises(ZeroDivisionError, match="three"), own_processes() as each:
        list(each(three_fails, range(6)))
    assert gone()


def endless(value: int) -> None:
    while True:
        checkpoint()
        time.sleep(0.01)


def stopped_at_work(stop: type[BaseException]) -> None:
    with own_processes() as each:
        each(endless, range(4))
        time.sleep(0.1)
        raise stop


@needs_fork
@pytest.mark.parametrize("stop", [KeyboardInterrupt, Cancelled])
def test_a_stop_ends_the_work_of_the_others(stop: type[BaseException]) -> None:
    started = time.monotonic()
    with pytest.raises(stop):
        stopped_at_work(stop)
    assert time.monotonic() - started < 5
    assert gone()


@pytest.mark.slow
@needs_fork
def test_processes_end_with_the_one_that_asked(tmp_path: Path) -> None:
    """Also where that was killed and could not tell them."""
    script = f"""
import multiprocessing, os, sys, threading
sys.path[:0] = {[str(Path(__file__).parent), str(Path(__file__).parents[1])]!r}
os.sched_getaffinity = lambda pid: {{0, 1}}
from {Path(__file__).stem} import slow_square
from motoremi.workers import own_processes
with own_processes() as each:
    list(each(slow_square, range(6)))
    print(*(process.pid for process in multiprocessing.active_children()), flush=True)
    os.kill(os.getpid(), 9)
"""
    told = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    processes = [int(word) for word in told.stdout.split()]
    assert len(processes) == 2, told.stderr
    until = time.monotonic() + 5
    while any(running(process) for process in processes) and time.monotonic() < until:
        time.sleep(0.01)
    assert not any(running(process) for process in processes)


def running(process: int) -> bool:
    """Whether there is such a process that has not ended."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@needs_fork
def test_no_other_processes_beside_other_threads_nor_in_a_worker() -> None:
    assert useful_processes() == 2
    done = threading.Event()
    thread = threading.Thread(target=done.wait)
    thread.start()
    try:
        assert useful_processes() == 1
        with own_processes() as each:
            assert {process for _, process in each(slow_square, range(3))} == {os.getpid()}
    finally:
        done.set()
        thread.join()
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        assert pool.submit(useful_processes).result() == 1


def test_one_core_does_it_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0}, raising=False)
    with own_processes() as each:
        assert {process for _, process in each(slow_square, range(3))} == {os.getpid()}


# The two that are hidden and a few beside: a search for all effects has more jobs, but none of another kind than these and `raced_alone`.
FEW_EFFECTS = frozenset(
    {
        *("terminal-capacitance", "bearing-film", "core-loss", "skin-effect", "distributed-winding"),
        *("insulation-leakage@Cf", "lead-inductance"),
    }
)


@pytest.mark.slow
@needs_fork
@seeking(FEW_EFFECTS)
def test_a_diagnosis_does_not_depend_on_who_works(monkeypatch: pytest.MonkeyPatch) -> None:
    """To the last bit, on a motor with two hidden effects: two processes, one, and somebody else's `map` that sends all there is."""
    case = Case(777, 8, "two", ("terminal-capacitance", "bearing-film"), 1233665122)
    base = me.fit(me.dc_motor(), case.sweeps(points=101))
    # Which the tests' own workers do without.
    monkeypatch.setattr("motoremi.diagnosis.diagnosis.own_processes", own_processes)
    both = me.diagnose(base)
    sent: list[str] = []

    def sending(work: Any, jobs: Iterable[object], /) -> Iterator[object]:
        for job in jobs:
            sent.append(work.__name__)
            work_there, job_there = pickle.loads(pickle.dumps((work, job)))
            yield pickle.loads(pickle.dumps(work_there(job_there)))

    elsewhere = me.diagnose(base, map=sending)
    assert len(sent) > 50
    # Start values, one round of a race, its arrival and its end, the fit on all points, the two looks at pairs, the evidence along a parameter, and
    # what the next measurements would tell.
    assert len(set(sent)) == 9
    monkeypatch.setattr(workers, "useful_processes", lambda: 1)
    alone = me.diagnose(base)
    assert set(both.effects) == set(case.hidden)
    assert both.to_dict() == alone.to_dict() == elsewhere.to_dict()
    np.testing.assert_array_equal(both.best.unknowns, alone.best.unknowns)


@pytest.mark.slow
@needs_fork
def test_a_search_from_more_starts_does_not_depend_on_who_works() -> None:
    """How a diagnosis searches lines that fall behind in its races."""
    base = me.fit(me.dc_motor(), Case(777, 8, "two", ("terminal-capacitance", "bearing-film"), 1233665122).sweeps(points=101))
    trails = [trail_to(base, name) for name in ("distributed-winding", "core-loss")]
    with own_processes() as each:
        both = list(each(raced_alone, trails))
    assert [one.values for one in both] == [raced_alone(trail).values for trail in trails]


@pytest.mark.slow
def test_a_measurement_arrives_once_and_comes_back_as_itself() -> None:
    measurement = Measurement.of(Case(777, 8, "two", ("terminal-capacitance", "bearing-film"), 1233665122).sweeps())
    sent = pickle.dumps(measurement)
    assert pickle.loads(sent) is measurement
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        first, again = pool.submit(arrived_twice, sent).result()
    assert first == again
    assert pickle.loads(sent) is measurement


def arrived_twice(sent: bytes) -> tuple[int, int]:
    """Which objects a measurement is when it comes twice."""
    first, again = pickle.loads(sent), pickle.loads(sent)
    return id(first), id(again)


def test_every_analyser_can_be_sent_with_its_adapters_and_fixtures() -> None:
    frequency_hz = np.geomspace(1e3, 30e6, 7)
    attached = [one.connected_to(find_analyser("4294a")) for one in (*ADAPTERS.values(), *FIXTURES.values())]
    for analyser in (*ANALYSERS, *attached):
        sent = pickle.loads(pickle.dumps(analyser))
        np.testing.assert_array_equal(sent.gain_sigma(frequency_hz), analyser.gain_sigma(frequency_hz))
        np.testing.assert_array_equal(sent.conductance_sigma_s(frequency_hz), analyser.conductance_sigma_s(frequency_hz))


def test_a_circuit_of_nobodys_catalogue_is_not_sent_as_another() -> None:
    from motoremi.model.circuit import Leaf
    from motoremi.model.laws import resistor
    from motoremi.model.parameter import Parameter

    leaf = Leaf("R?", resistor, (Parameter("R?", "Ohm", 1.0, 2.0, "a test"),))
    motor = me.dc_motor().with_branch(leaf)
    with pytest.raises(TypeError, match="catalogue"):
        pickle.dumps(motor)


def test_the_linear_algebra_gets_one_thread_and_its_own_number_back() -> None:
    def threads() -> set[int]:
        return {pool["num_threads"] for pool in threadpoolctl.threadpool_info() if pool["user_api"] == "blas"}

    with threadpoolctl.threadpool_limits(limits=2, user_api="blas"):
        before = threads()
        assert one_blas_thread(threads)() == {1}
        assert threads() == before
        # One within another, and one that fails.
        assert one_blas_thread(lambda: (one_blas_thread(threads)(), threads()))() == ({1}, {1})
        with pytest.raises(ZeroDivisionError):
            one_blas_thread(lambda: 1 / 0)()
        assert threads() == before
