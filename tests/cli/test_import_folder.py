"""`motoremi import-folder`: files of many motors become sessions, and one bad file does not stop the others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command_line import document, motoremi

from motoremi.data.csvfiles import write_impedance_csv
from motoremi.data.grouping import files_by_motor
from motoremi.data.session import load
from motoremi.data.sweep import ImpedanceSweep
from motoremi.errors import BadInput

FREQUENCY_HZ = np.geomspace(150e3, 30e6, 41)


def written(path: Path, termination: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    frame = 1 / (2j * np.pi * FREQUENCY_HZ * 500e-12) if termination == "open" else 0.0
    write_impedance_csv(path, ImpedanceSweep(termination, FREQUENCY_HZ, 3 + 2j * np.pi * FREQUENCY_HZ * 27e-6 + frame))


@pytest.fixture
def measured(tmp_path: Path) -> Path:
    """Motor 1 with two repeats, motor 2 with a file that is cut off, motor 3 without the open sweep, and a file that is none."""
    folder = tmp_path / "measured"
    for name in ("A-1_short_1", "A-1_short_2", "A-2_short_1", "lot 2/A-3_short_1"):
        written(folder / f"{name}.csv", "short")
    for name in ("A-1_open_1", "A-2_open_1"):
        written(folder / f"{name}.csv", "open")
    cut = folder / "A-2_open_1.csv"
    cut.write_text(cut.read_text()[:-40])
    (folder / "list.txt").write_text("three motors")
    return folder


PATTERNS = ("--short", "*_short_?.csv", "--open", "*_open_?.csv")


def test_each_motor_is_a_session_and_a_bad_file_stops_nothing(measured: Path, tmp_path: Path) -> None:
    done = motoremi("import-folder", measured, tmp_path / "line", *PATTERNS, "--analyser", "4294a", "--operator", "Kim")
    assert done.returncode == 1
    assert "2 motors imported, 1 refused" in done.stdout
    assert "A-2: refused: " in done.stdout
    assert "cut off" in done.stdout
    assert "lot 2/A-3: no open-circuit sweep" in done.stdout
    assert "1 other files match no pattern, such as list.txt" in done.stdout
    assert not (tmp_path / "line" / "A-2").exists()
    session = load(tmp_path / "line" / "A-1")
    assert [sweep.termination for sweep in session.sweeps] == ["short", "short", "open"]
    assert (session.start["serial"], session.start["operator"], session.start["analyser"]) == ("A-1", "Kim", "4294a")
    assert load(tmp_path / "line" / "lot 2" / "A-3").start["serial"] == "lot 2/A-3"
    # Again, with the file as it should be: what exists stays as it is.
    written(measured / "A-2_open_1.csv", "open")
    before = (tmp_path / "line" / "A-1" / "session.jsonl").read_bytes()
    again = document(motoremi("import-folder", measured, tmp_path / "line", *PATTERNS, "--json"))
    assert (list(again["imported"]), again["refused"], again["existing"]) == (["A-2"], {}, ["A-1", "lot 2/A-3"])
    assert (again["without"], again["other_files"]) == ({"lot 2/A-3": "open"}, ["list.txt"])
    assert (tmp_path / "line" / "A-1" / "session.jsonl").read_bytes() == before


@pytest.mark.parametrize(
    ("patterns", "told"),
    [
        ((), "give patterns"),
        (("--short", "A-1_short_1.csv"), "has no *"),
        (("--short", "*.csv", "--open", "*_1.csv"), "matches both patterns"),
        (("--short", "*.s1p"), "no file matches '*.s1p' (found: A-1_open_1.csv, A-1_short_1.csv, A-1_short_2.csv)"),
        (("--short", "*_short_1.csv", "--band", "5MHz:1MHz"), "is empty"),
    ],
)
def test_patterns_that_find_nothing_are_told(measured: Path, tmp_path: Path, patterns: tuple[str, ...], told: str) -> None:
    done = motoremi("import-folder", measured, tmp_path / "line", *patterns)
    assert (done.returncode, done.stdout) == (2, "")
    assert told in done.stderr
    assert not (tmp_path / "line").exists()


def test_the_first_star_is_the_name_of_the_motor(tmp_path: Path) -> None:
    for name in ("7 b/short.csv", "8/short.csv", "8/open.csv", "9.csv"):
        written(tmp_path / name, "short")
    found, others = files_by_motor(tmp_path, "*/short.csv", "*/open.csv")
    assert {name: (len(files.short), len(files.open_)) for name, files in found.items()} == {"7 b": (1, 0), "8": (1, 1)}
    assert [path.name for path in others] == ["9.csv"]
    with pytest.raises(BadInput, match="no such folder"):
        files_by_motor(tmp_path / "none", "*", None)


def test_notes_of_most_motors_are_told_once(tmp_path: Path) -> None:
    for number in range(4):
        written(tmp_path / "measured" / f"{number}_short.csv", "short")
    done = motoremi("import-folder", tmp_path / "measured", tmp_path / "line", "--short", "*_short.csv")
    assert done.returncode == 0
    assert done.stdout.count("only one short sweep") == 1
    assert "  most motors: only one short sweep" in done.stdout
