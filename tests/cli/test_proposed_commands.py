"""Commands that are proposed run as they are printed, also for a session whose name has a blank."""

from __future__ import annotations

import shlex
from pathlib import Path
from types import SimpleNamespace

import pytest
from command_line import motoremi
from conftest import simulated_sweeps

from motoremi.cli.investigate import show_end
from motoremi.data.session import SessionWriter, reopen


@pytest.fixture
def session(tmp_path: Path) -> Path:
    with SessionWriter.create(tmp_path / "s p", {"title": "blank"}) as writer:
        for sweep in simulated_sweeps(3, repeats=1)[0]:
            writer.add_sweep(sweep)
        writer.close("done")
    return tmp_path / "s p"


@pytest.mark.parametrize(
    ("asks", "condition_id", "last"),
    [
        ({"kind": "value", "condition": "dc-resistance", "unit": "Ohm"}, None, "dc-resistance=VALUEOhm"),
        ({"kind": "sweep", "condition": None, "termination": "short"}, None, "--short FILE..."),
        ({"kind": "sweep", "condition": "temperature", "termination": "open", "unit": "degC"}, "second-temperature", "--open FILE..."),
    ],
)
def test_next(monkeypatch: pytest.MonkeyPatch, session: Path, asks: dict, condition_id: str | None, last: str) -> None:
    question = {"id": "x", "why": "y", "alternatives": [], "asks": asks, "condition_id": condition_id}
    monkeypatch.setattr("motoremi.workflow_ask.question_of", lambda *_: question)
    (proposed,) = (line.removeprefix("then: ") for line in motoremi("next", session).stdout.splitlines() if line.startswith("then: "))
    assert proposed.endswith(last)
    assert shlex.split(proposed)[:4] == ["motoremi", "import", str(session), "--append"]


def test_ladder(session: Path) -> None:
    told = motoremi("ladder", session).stdout.strip()
    assert shlex.split(told.removeprefix("the ladder is empty: ")) == ["motoremi", "fit", str(session)]
    fit = {"effects": [], "rms_error_percent": 1.0, "chi2_reduced": 1.0}
    with reopen(session) as writer:
        writer.save_analysis("ladder", {"schema": "motoremi.ladder/1", "steps": [{"fit": fit, "bands": [], "notes": []}]})
    told = motoremi("ladder", session).stdout.splitlines()[-1].strip()
    assert shlex.split(told.removeprefix("fitted by an earlier version: ")) == ["motoremi", "fit", str(session)]


def test_investigate(session: Path, capsys: pytest.CaptureFixture[str]) -> None:
    reason = "they can be described without a cause: motoremi add SESSION winding-modes"
    diagnosis = {"effects": [], "verdict": "unexplained", "confidence": 0.5, "reasons": [reason]}
    show_end(SimpleNamespace(diagnosis=diagnosis, minutes=1.0, steps=[], stop="nothing-missing", refused=[]), session)
    proposed = next(line for line in capsys.readouterr().out.splitlines() if "winding-modes" in line).partition(": ")[2]
    assert shlex.split(proposed) == ["motoremi", "add", str(session), "winding-modes"]
