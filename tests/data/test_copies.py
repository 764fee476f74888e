"""A sweep that is given twice is one measurement; what an addition cannot keep is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command_line import motoremi
from conftest import simulated_sweeps

from motoremi.data.csvfiles import write_impedance_csv
from motoremi.data.measurement import Measurement
from motoremi.data.session import load
from motoremi.data.sweep import ImpedanceSweep, group_repeats

FREQUENCY_HZ = np.geomspace(150e3, 30e6, 101)
RNG = np.random.default_rng(11)
NOISY = [(1 + 2j * np.pi * FREQUENCY_HZ * 1e-5) * np.exp(RNG.normal(0, 6e-5, (2, 101)).T @ [1, 1j]) for _ in range(3)]


def rounded(values: np.ndarray) -> np.ndarray:
    """As a file with six digits holds it."""
    return np.array([complex(float(f"{value.real:.5e}"), float(f"{value.imag:.5e}")) for value in values])


@pytest.mark.parametrize(("repeats", "copies"), [((0, 0), 1), ((0, 1), 0), ((0, 1, 0, 2, 1), 2)])
def test_a_copy_counts_once(repeats: tuple[int, ...], copies: int) -> None:
    (group,) = group_repeats(ImpedanceSweep("short", FREQUENCY_HZ, NOISY[number]) for number in repeats)
    assert group.copies == copies
    assert group.repeats == len(set(repeats))


def test_so_does_the_same_sweep_in_another_format() -> None:
    (group,) = group_repeats([ImpedanceSweep("short", FREQUENCY_HZ, NOISY[0]), ImpedanceSweep("short", FREQUENCY_HZ, rounded(NOISY[0]))])
    assert (group.repeats, group.copies) == (1, 1)


def test_the_noise_is_that_of_the_sweep_alone() -> None:
    sweep = ImpedanceSweep("short", FREQUENCY_HZ, NOISY[0])
    alone, twice = Measurement.of([sweep]), Measurement.of([sweep, sweep])
    np.testing.assert_array_equal(twice.noise[0].sigma, alone.noise[0].sigma)
    assert twice.noise[0].source == "scatter"
    assert [text for text in twice.caveats() if "readings of only 1" in text]
    assert not alone.copies()


@pytest.fixture
def session(tmp_path: Path) -> Path:
    for sweep in simulated_sweeps(3)[0]:
        write_impedance_csv(tmp_path / f"{sweep.termination}.csv", sweep)
    files = ["--short", tmp_path / "short.csv", "--open", tmp_path / "open.csv"]
    assert motoremi("import", tmp_path / "s", *files, "--analyser", "4294a").returncode == 0
    return tmp_path / "s"


def test_an_appended_copy_is_told(session: Path) -> None:
    done = motoremi("import", session, "--append", "--short", session.parent / "short.csv")
    assert done.returncode == 0
    assert "2 short sweeps hold the readings of only 1" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--analyser", "nanovna"), "need a session of their own"),
        (("--condition", ""), "unknown condition ''"),
        (("--condition", "open-sweep"), "asks for the open-circuit sweep"),
        (("--motor", "another"), "--motor is for a new session"),
        (("--serial", "7"), "--serial is for a new session"),
        (("--operator", "A. Engineer"), "--operator is for a new session"),
        (("--ambient", "23 degC"), "--ambient is for a new session"),
    ],
)
def test_what_an_addition_cannot_keep_is_refused(session: Path, arguments: tuple[str, ...], says: str) -> None:
    before = load(session).documents
    done = motoremi("import", session, "--append", "--short", session.parent / "short.csv", *arguments)
    assert done.returncode == 2
    assert says in done.stderr
    assert done.stderr.count("\n") == 1
    assert load(session).documents == before
