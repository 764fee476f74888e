"""What a report says of data that were added to a session after its import or its diagnosis, and of sessions without common frequencies."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command_line import motoremi

import motoremi as me
from motoremi.data.csvfiles import write_impedance_csv
from motoremi.data.session import SessionWriter, is_up_to_date, load, reopen
from motoremi.report.contents import Materials
from motoremi.report.gaps import gaps
from motoremi.report.identity import imported_files
from motoremi.report.model import build_report
from motoremi.report.several_sessions import build_together

FREQUENCY_HZ = np.geomspace(150e3, 30e6, 31)
NOTICE = "sweeps or values were added after the diagnosis, which is shown as it was: diagnose again"


def sweep(termination: str, seed: int = 0, frequency_hz: np.ndarray = FREQUENCY_HZ) -> me.ImpedanceSweep:
    noise = 1e-3 * np.random.default_rng(seed).normal(size=frequency_hz.size)
    return me.ImpedanceSweep(termination, frequency_hz, (10 + 2j * np.pi * frequency_hz * 12e-6) * (1 + noise))


@pytest.fixture
def session(tmp_path: Path) -> Path:
    """Imported from two files and diagnosed; the other files are beside it."""
    for number in range(3):
        for termination in ("short", "open"):
            write_impedance_csv(tmp_path / f"{termination}{number}.csv", sweep(termination, number))
    assert motoremi("import", tmp_path / "s", "--short", tmp_path / "short0.csv", "--open", tmp_path / "open0.csv").returncode == 0
    with reopen(tmp_path / "s") as writer:
        writer.save_analysis("diagnosis", {"verdict": "adequate"})
    return tmp_path / "s"


def found_in(path: Path) -> tuple[str, ...]:
    session = load(path)
    return gaps(Materials(session, (), None, session.analysis("diagnosis")))


@pytest.mark.parametrize(
    "words",
    [
        ("--value", "dc-resistance=10ohm"),
        ("--condition", "second-temperature=53degC", "--short", "short1.csv"),
        ("--short", "short1.csv"),
    ],
)
def test_data_that_the_diagnosis_does_not_include(session: Path, words: tuple[str, ...]) -> None:
    assert NOTICE not in found_in(session)
    assert motoremi("import", session, "--append", *words, cwd=session.parent).returncode == 0
    assert NOTICE in found_in(session)
    # A fleet diagnoses anew, without storing it.
    assert NOTICE not in gaps(Materials(load(session), (), None, {"verdict": "unexplained"}))
    with reopen(session) as writer:
        writer.save_analysis("diagnosis", {"verdict": "adequate"})
    assert is_up_to_date(load(session))
    assert NOTICE not in found_in(session)


def test_files_that_were_added_count(session: Path) -> None:
    for words in (("--short", "short1.csv", "--open", "open1.csv"), ("--condition", "second-temperature=53degC", "--short", "short2.csv")):
        assert motoremi("import", session, "--append", *words, cwd=session.parent).returncode == 0
    assert imported_files(load(session)) == ("short0.csv", "open0.csv", "short1.csv", "open1.csv", "short2.csv")
    report = build_report(Materials(load(session), (), None, None))
    assert " from 5 files" in dict(report.facts)["Data"]
    assert any("the data were read from 5 files" in gap for gap in report.warnings)
    assert "the files do not say when the data were measured" in report.warnings
    # A file of the same name is one more, a sweep that a bench measured is none.
    assert motoremi("import", session, "--append", "--short", "short1.csv", cwd=session.parent).returncode == 0
    with reopen(session) as writer:
        writer.add_sweep(sweep("open", 5))
    assert len(imported_files(load(session))) == 6


def test_a_comparison_without_common_frequencies_says_so(tmp_path: Path) -> None:
    materials = {}
    for name, low, high in (("before", 150e3, 1e6), ("after", 2e6, 30e6), ("later", 500e3, 30e6)):
        with SessionWriter.create(tmp_path / name, {"title": name}) as writer:
            writer.add_sweep(sweep("short", 0, np.geomspace(low, high, 31)))
            writer.close("done")
        materials[name] = Materials(load(tmp_path / name), (), None, None)
    (texts,) = (section.texts for section in build_together(materials).sections if section.title == "Sweeps")
    told = "after: no common frequencies of its short sweep (2 MHz - 30 MHz) and that of before (150 kHz - 1 MHz): the change of |Z| is not known."
    assert texts[1:] == (told,)
