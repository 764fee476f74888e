"""What all tests share: no silent skip in CI, small simulated data sets."""

from __future__ import annotations

import gc
import os
import signal
import sys
import threading
from collections.abc import Callable, Generator, Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

# One BLAS thread: the matrices are small, and the tests run in parallel.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

# A test run in the background of a script has Ctrl-C ignored, and would hand that on to every program that a test starts and stops.
if threading.current_thread() is threading.main_thread():
    signal.signal(signal.SIGINT, signal.default_int_handler)

from few_effects import seeking
from made_once import begin, worked_out_once

from motoremi import workflow
from motoremi.data.sweep import ImpedanceSweep
from motoremi.diagnosis import diagnosis
from motoremi.emission import board
from motoremi.simulate import emission_in_time
from motoremi.simulate.analyser_errors import SimulatedAnalyser
from motoremi.simulate.hidden_effects import split_effects
from motoremi.simulate.simulated_motor import SimulatedMotor

if TYPE_CHECKING:
    from motoremi.virtual.simulated_bench import SimulatedBench

FREQUENCY_HZ = np.geomspace(150e3, 30e6, 401)


# Longer than any test takes on a slow machine with its fixtures.
LONGEST_TEST_S = 900


def pytest_configure(config: pytest.Config) -> None:
    """A folder for what all workers share, while the run lasts."""
    end = begin()
    if end is not None:
        config.add_cleanup(end)
    # Each scan of a simulated receiver takes a second or two to work out, and many tests scan the same few motors on the same few grids.
    emission_in_time.measure = worked_out_once(emission_in_time.measure)
    if hasattr(config, "workerinput"):
        # All cores have a worker already: a diagnosis or fit that starts processes of its own takes a fifth more of their time.
        diagnosis.own_processes = workflow.own_processes = lambda: nullcontext(map)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests of the workbench come first: one of three workers gets them all; the others have enough to do while it waits for the browser."""
    items.sort(key=lambda item: item.path.parent.name != "workbench")


def pytest_collection_finish() -> None:
    """Collected tests live until the end of the run. If the garbage collector leaves them out, the run takes a fiftieth less time.

    If it runs less often, it takes another thirtieth less.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(5_000)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """A test that waits for something that never comes fails, instead of holding up the whole run."""
    if not hasattr(signal, "SIGALRM") or threading.current_thread() is not threading.main_thread():
        return (yield)

    def end(number: int, frame: object) -> None:
        raise TimeoutError(f"{item.nodeid} did not end within {LONGEST_TEST_S} s")

    before = signal.signal(signal.SIGALRM, end)
    signal.alarm(LONGEST_TEST_S)
    try:
        return (yield)
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def simulated_sweeps(seed: int, effects: tuple[str, ...] = (), repeats: int = 3) -> tuple[list[ImpedanceSweep], SimulatedMotor]:
    """Sweeps of a simulated motor as the simulated 4294A would make them, and the motor."""
    in_motor, in_analyser = split_effects(effects)
    motor = SimulatedMotor.random(seed, in_motor)
    analyser = SimulatedAnalyser(seed + 1000, faults=in_analyser)
    sweeps = []
    for connection, termination in enumerate(("short", "open")):
        true = motor.impedance(termination, FREQUENCY_HZ)
        for _ in range(repeats):
            measured = analyser.measure(termination, FREQUENCY_HZ, true, connection=connection, bandwidth_factor=3)
            sweeps.append(ImpedanceSweep(termination, FREQUENCY_HZ, measured))
    return sweeps, motor


@pytest.fixture(scope="session")
def measure() -> Callable[..., tuple[list[ImpedanceSweep], SimulatedMotor]]:
    """The function that simulates a measurement."""
    return simulated_sweeps


@pytest.fixture
def bench() -> Iterator[SimulatedBench]:
    """A simulated bench, for tests that do not depend on which motor it has."""
    from motoremi.virtual.simulated_bench import SimulatedBench

    made = SimulatedBench(7)
    yield made
    made.close()


@pytest.fixture
def few_effects() -> Iterator[None]:
    """For tests of what is done with a diagnosis, which do not need a search of the whole catalogue."""
    with seeking():
        yield


@pytest.fixture(params=["few", pytest.param("whole", marks=pytest.mark.case)])
def catalogue(request: pytest.FixtureRequest) -> Iterator[None]:
    """For tests of verdicts that do not come from the search: a few effects in `make test`, the whole catalogue too in `make cases`."""
    with seeking() if request.param == "few" else nullcontext():
        yield


@pytest.fixture
def few_source_effects(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same for a diagnosis of spectra: two effects make as good a ranking as all six."""
    monkeypatch.setattr(board, "EFFECTS", tuple(one for one in board.EFFECTS if one.name in ("arc-breakdown", "lisn-deviation")))


def pytest_sessionfinish(session: pytest.Session) -> None:
    """In CI a skipped test is a failed one: everything that a test may need is installed there."""
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if os.environ.get("CI") and reporter is not None and reporter.stats.get("skipped"):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


@pytest.fixture
def fitted(tmp_path: Path) -> Path:
    """A session of one's own for the tests of the workbench, fitted and diagnosed."""
    from workbench_tools import make_fitted_session

    return make_fitted_session(tmp_path / "fitted")


@pytest.fixture(scope="module")
def browser():
    """One browser for the tests of a file; only those that need one import its program."""
    from workbench_browser import launched

    with launched() as opened:
        yield opened
