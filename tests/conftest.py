"""What all tests share: no silent skip in CI, small simulated data sets."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

# As the command line does: small matrices want one thread, and the tests run in parallel.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from motoremi.data.sweep import ImpedanceSweep
from motoremi.simulate.analyser import SimulatedAnalyser
from motoremi.simulate.effects import split_effects
from motoremi.simulate.motor import SimulatedMotor

FREQUENCY_HZ = np.geomspace(150e3, 30e6, 401)


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


def pytest_sessionfinish(session: pytest.Session) -> None:
    """In CI a skipped test is a failed one: everything that a test may need is installed there."""
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if os.environ.get("CI") and reporter is not None and reporter.stats.get("skipped"):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
