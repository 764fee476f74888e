"""Standard streams that are closed while a command runs, or before: a measurement goes on, and its exit status means what it says."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from motoremi.cli.bench import ask_operator
from motoremi.cli.streams import LastingOutput
from motoremi.data.session import load
from motoremi.errors import BadInput

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="closed descriptors as POSIX has them")

PROCEDURE = """
title = "Sweeps"
[instruments]
analyser = { driver = "e4990a", resource = "GPIB0::18::INSTR" }
[sweep]
start = "150 kHz"
stop = "30 MHz"
points = 11
[[steps]]
do = "identify"
[[steps]]
do = "sweep"
termination = "short"
repeat = 5
"""
MAIN = "from motoremi.cli import main; main()"


def command(folder: Path, *options: str, unbuffered: bool = False) -> list[str]:
    (folder / "p.toml").write_text(PROCEDURE, encoding="utf-8")
    words = ["run", str(folder / "p.toml"), "--bench", "sim", "--out", str(folder / "s"), *options]
    return [sys.executable, *(["-u"] if unbuffered else []), "-c", MAIN, *words]


@pytest.mark.slow
@pytest.mark.parametrize("unbuffered", [False, True])
def test_a_run_goes_on_when_nobody_reads_its_output(tmp_path: Path, unbuffered: bool) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(command(tmp_path, unbuffered=unbuffered), stdout=writing, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, "")
    assert (load(tmp_path / "s").status, len(load(tmp_path / "s").sweeps)) == ("done", 5)


@pytest.mark.slow
@pytest.mark.parametrize("closed", [(1,), (2,), (0, 1, 2)])
@pytest.mark.parametrize("options", [(), ("--json",)])
def test_a_run_needs_no_standard_streams(tmp_path: Path, closed: tuple[int, ...], options: tuple[str, ...]) -> None:
    def close() -> None:
        for descriptor in closed:
            os.close(descriptor)

    starts: Callable[[], None] = close
    done = subprocess.run(command(tmp_path, *options), stdin=subprocess.DEVNULL, capture_output=True, check=False, preexec_fn=starts)
    assert (done.returncode, done.stderr) == (0, b"")
    session = load(tmp_path / "s")
    assert (session.status, len(session.sweeps), session.interrupted) == ("done", 5, False)


def test_an_operator_who_cannot_be_asked_ends_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """An answer from a pipe must not count for an instruction that nobody has seen."""
    reading, writing = os.pipe()
    os.close(reading)
    monkeypatch.setattr("sys.stderr", io.TextIOWrapper(io.BufferedWriter(LastingOutput(writing, "w")), "utf-8"))
    monkeypatch.setattr("sys.stdin", io.StringIO("\n"))
    with pytest.raises(BadInput, match="the operator cannot be asked: standard error is closed"):
        ask_operator("Connect the motor")
