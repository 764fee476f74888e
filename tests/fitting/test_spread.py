"""Work on a second core: the same results, wherever it is done and whatever befalls the helper."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import time
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest
import threadpoolctl

import motoremi as me
from motoremi import spread as module
from motoremi.blind.cases import Case
from motoremi.spread import Team, core_to_spare, one_blas_thread, spread

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


def slow_power(known: int, given: int) -> tuple[int, int]:
    time.sleep(0.02)
    return known**given, os.getpid()


def gone(seconds: float = 5.0) -> bool:
    """Whether no helper is left; one whose work is done may take a moment to go."""
    until = time.monotonic() + seconds
    while multiprocessing.active_children() and time.monotonic() < until:
        time.sleep(0.01)
    return not multiprocessing.active_children()


@needs_fork
def test_results_come_in_order_from_two_processes() -> None:
    results = spread(slow_square, range(12))
    assert [value for value, _ in results] == [value**2 for value in range(12)]
    assert len({process for _, process in results}) == 2
    assert gone()


@needs_fork
def test_one_helper_stays_for_several_rounds_on_some_of_what_is_known() -> None:
    begun: list[int] = []
    with Team({place: place for place in range(12)}) as team:
        first = team.each(slow_power, dict.fromkeys((7, 3, 11, 2, 5, 9), 2), begun.append)
        helpers = {process for _, process in first.values()} - {os.getpid()}
        second = team.each(slow_power, {3: 3, 4: 1, 5: 0, 6: 2})
        assert {process for _, process in second.values()} == {os.getpid(), *helpers}
        alone = team.each(slow_power, {8: 2})
    assert len(helpers) == 1
    assert {place: value for place, (value, _) in first.items()} == {place: place**2 for place in (7, 3, 11, 2, 5, 9)}
    assert {place: value for place, (value, _) in second.items()} == {3: 27, 4: 4, 5: 1, 6: 36}
    assert alone == {8: (64, os.getpid())}
    # Told of what it begins itself, in the order given.
    own = [place for place, (_, process) in first.items() if process == os.getpid()]
    assert begun == sorted(own, key=(7, 3, 11, 2, 5, 9).index)
    assert gone()


@needs_fork
def test_a_helper_killed_between_rounds_is_missed_by_nobody() -> None:
    with Team({place: place for place in range(6)}) as team:
        team.each(slow_power, dict.fromkeys(range(6), 1))
        (helper,) = multiprocessing.active_children()
        helper.kill()
        helper.join()
        for _ in range(2):
            assert {place: value for place, (value, _) in team.each(slow_power, dict.fromkeys(range(6), 2)).items()} == {p: p**2 for p in range(6)}
    assert gone()


@needs_fork
def test_a_helper_killed_before_it_heard_is_missed_by_nobody() -> None:
    with Team({place: place for place in range(6)}) as team:
        (helper,) = multiprocessing.active_children()
        os.kill(helper.pid or 0, signal.SIGSTOP)
        # What it has not read lies in its end of the line when that closes.
        results = team.each(slow_power, dict.fromkeys(range(6), 2), lambda place: helper.kill() if place == 5 else None)
    assert results == {place: (place**2, os.getpid()) for place in range(6)}
    assert gone()


@needs_fork
@pytest.mark.parametrize("way", ["error", "exit", "kill"])
def test_a_helper_that_fails_loses_nothing(way: str) -> None:
    here = os.getpid()

    def work(value: int) -> int:
        time.sleep(0.01)
        if os.getpid() != here:
            if way == "error":
                raise ValueError("in the helper")
            if way == "exit":
                os._exit(3)
            os.kill(os.getpid(), 9)
        return -value

    assert spread(work, range(8)) == [-value for value in range(8)]
    assert gone()


def test_an_error_of_the_work_is_raised() -> None:
    def work(value: int) -> int:
        if value == 3:
            raise ZeroDivisionError("three")
        return value

    with pytest.raises(ZeroDivisionError, match="three"):
        spread(work, range(6))
    assert gone()


@needs_fork
def test_an_interrupt_ends_the_helper_too() -> None:
    here = os.getpid()

    def work(value: int) -> int:
        if os.getpid() == here:
            raise KeyboardInterrupt
        time.sleep(30)
        return value

    started = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        spread(work, range(4))
    assert time.monotonic() - started < 10
    assert gone()


@needs_fork
def test_no_helper_beside_other_threads_nor_in_a_worker() -> None:
    assert core_to_spare()
    done = threading.Event()
    thread = threading.Thread(target=done.wait)
    thread.start()
    try:
        assert not core_to_spare()
        assert len({process for _, process in spread(slow_square, range(3))}) == 1
    finally:
        done.set()
        thread.join()
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        assert not pool.submit(core_to_spare).result()


def test_one_core_does_it_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0}, raising=False)
    assert {process for _, process in spread(slow_square, range(3))} == {os.getpid()}


@pytest.mark.slow
@needs_fork
def test_a_diagnosis_does_not_depend_on_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """To the last bit, on a motor with two hidden effects."""
    case = Case(777, 8, "two", ("terminal-capacitance", "bearing-film"), 1233665122)
    base = me.fit(me.dc_motor(), case.sweeps())
    both = me.diagnose(base)
    monkeypatch.setattr(module, "core_to_spare", lambda: False)
    alone = me.diagnose(base)
    assert both.to_dict() == alone.to_dict()
    np.testing.assert_array_equal(both.best.unknowns, alone.best.unknowns)


def test_the_linear_algebra_gets_one_thread_and_its_own_number_back() -> None:
    def threads() -> set[int]:
        return {pool["num_threads"] for pool in threadpoolctl.threadpool_info() if pool["user_api"] == "blas"}

    with threadpoolctl.threadpool_limits(limits=2, user_api="blas"):
        before = threads()
        assert one_blas_thread(threads)() == {1}
        assert threads() == before
