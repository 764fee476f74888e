"""Sessions whose analyses another version stored: a report that says what it could not read, or one clear line, never a traceback."""

from __future__ import annotations

import copy
import dataclasses
import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from report_cases import whole_session
from scipy.signal import find_peaks

from motoremi.cli import main
from motoremi.data.session import Session, load
from motoremi.errors import BadInput, MotoremiError
from motoremi.report import all_sections, cause, emission_section, plots, renderings
from motoremi.report.contents import Materials, Picture
from motoremi.report.gaps import STORED
from motoremi.report.peaks import clear_maxima
from motoremi.report.renderings import render_session
from motoremi.workflow import fit_session, ladder_of, materials_of, opened
from motoremi.workflow_plots import figure_of

pytestmark = pytest.mark.slow

UNTOUCHED = ("sweeps_figure", "ladder_figure", "comparison_figure")
# Figures of a stored analysis, and where reports find them.
FIGURES = {"training_figure": ("ladder", plots), "ranking_figure": ("diagnosis", plots), "prediction_figure": ("prediction", emission_section)}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory, measure: Any) -> Path:
    return whole_session(tmp_path_factory.mktemp("stored") / "session", measure)


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures of stored things are made but not drawn, those of fits and files not even made: a test makes a hundred reports."""
    monkeypatch.setattr(renderings, "can_render_pdf", lambda: False)
    for module in (all_sections, emission_section, cause):
        monkeypatch.setattr(module, "picture", lambda name, figure, caption: Picture("<svg></svg>", caption))
    for name in UNTOUCHED:
        monkeypatch.setattr(plots, name, lambda *_: None)
    monkeypatch.setattr(emission_section, "spectrum_figure", lambda *_: None)


def lacking(document: Any, depth: int = 2) -> Iterator[tuple[str, Any]]:
    """The document without each of its entries in turn; of a list of alike things the first one's entries."""
    if isinstance(document, dict) and depth:
        for key in document:
            yield key, {name: value for name, value in document.items() if name != key}
            for path, changed in lacking(document[key], depth - 1):
                yield f"{key}.{path}", {**document, key: changed}
    elif isinstance(document, list) and document and isinstance(document[0], dict):
        for path, changed in lacking(document[0], depth):
            yield f"0.{path}", [changed, *document[1:]]


def thinned(document: Any) -> Any:
    """The same with every 200th of thousands of levels."""
    if isinstance(document, dict):
        return {key: thinned(value) for key, value in document.items()}
    return document[::200] if isinstance(document, list) and len(document) > 1000 else document


@pytest.fixture(scope="module")
def session(whole: Path) -> Session:
    """With one step in its ladder: another step is no other test."""
    full = load(whole)
    for name in full.analyses:
        document = thinned(full.analysis(name))
        if name == "ladder":
            document["steps"] = document["steps"][:1]
        full = with_analysis(full, name, document)
    return full


def with_analysis(session: Session, name: str, document: Any) -> Session:
    return dataclasses.replace(session, analysis_files={**session.analysis_files, name: json.dumps(document).encode()})


@pytest.mark.parametrize("name", ["diagnosis", "prediction", "emission-diagnosis", "emission", "ladder", "comparison"])
def test_an_analysis_that_lacks_anything_gives_a_report_or_one_line(
    session: Session, undrawn: None, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    stored = session.analysis(name)
    assert stored is not None
    # What another analysis holds is the same in all these reports: it is restored once, and its figures are not made.
    others = None if name in ("ladder", "comparison") else materials_of(session)
    for figure, (of, module) in FIGURES.items():
        if of != name:
            monkeypatch.setattr(module, figure, lambda *_: None)

    def materials(changed: Session) -> Materials:
        return materials_of(changed) if others is None else dataclasses.replace(others, session=changed, diagnosis=changed.analysis("diagnosis"))

    ends = {"as before": 0, "left out": 0, "told": 0}
    for path, document in lacking(stored):
        told, page = "", ""
        try:
            page = render_session(materials(with_analysis(session, name, document)))["report/report.html"].decode()
        except MotoremiError as error:
            told = str(error)
        assert "\n" not in told, path
        assert page or "again" in told or "motoremi" in told, path
        said = f"the stored {name} was made by another version and cannot be read" in page
        ends["told" if told else "left out" if said else "as before"] += 1
    assert sum(ends.values()) > 3
    # The state of the emission analysis is shown only if it has several steps; this one has one.
    assert name == "emission" or ends["told" if name in ("ladder", "comparison") else "left out"] > 0, ends
    if name in STORED:
        assert ends["told"] == 0, ends


@pytest.mark.parametrize("name", STORED)
@pytest.mark.parametrize("content", [{}, {"schema": "motoremi.other/9"}, {"verdict": None, "candidates": 7, "judged": "x", "steps": 3}])
def test_something_else_altogether_is_left_out(session: Session, undrawn: None, name: str, content: Any) -> None:
    made = render_session(materials_of(with_analysis(session, name, content)))
    if name != "emission" or "steps" in content:
        assert f"the stored {name} was made by another version and cannot be read: {STORED[name]}" in made["report/report.html"].decode()
        assert any(f"the stored {name}" in warning for warning in json.loads(made["report/report.json"])["warnings"])


def test_all_of_them_at_once(session: Session, undrawn: None) -> None:
    for name in STORED:
        session = with_analysis(session, name, {"steps": 3})
    page = render_session(materials_of(session))["report/report.html"].decode()
    assert page.count("was made by another version and cannot be read") == len(STORED)


def test_the_command_ends_well(whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    folder = shutil.copytree(whole, tmp_path / "old")
    document = load(folder).analysis("diagnosis")
    assert document is not None
    del document["next_measurement"], document["candidates"][0]["probability"]
    with opened(folder) as store:
        store.save_analysis("diagnosis", document)
    monkeypatch.setattr("sys.argv", ["motoremi", "report", str(folder)])
    with pytest.raises(SystemExit) as caught:
        main()
    assert caught.value.code == 0
    assert "cannot be read: motoremi diagnose" in (folder / "report" / "report.html").read_text(encoding="utf-8")
    capsys.readouterr()
    for command in (
        ["report", str(folder), str(whole), "--out", str(tmp_path / "both")],
        ["plot", str(folder), "ranking", "--out", str(tmp_path / "ranking.svg")],
    ):
        monkeypatch.setattr("sys.argv", ["motoremi", *command])
        with pytest.raises(SystemExit) as caught:
            main()
        told = capsys.readouterr()
        assert caught.value.code in (0, 2)
        assert "internal error" not in told.err
        assert told.err.count("\n") == (caught.value.code == 2)


def test_a_plot_of_what_cannot_be_read_is_one_line(whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    broken = with_analysis(load(whole), "diagnosis", {"verdict": "adequate"})
    monkeypatch.setattr("motoremi.workflow_plots.load", lambda path: broken)
    with pytest.raises(
        BadInput, match=r"session holds results that this version cannot read \(KeyError: 'candidates'\); fit, compare and diagnose again"
    ):
        figure_of(whole, "ranking")


def test_a_ladder_that_cannot_be_read_is_fitted_anew(whole: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(whole, tmp_path / "old")
    with opened(folder) as store:
        store.save_analysis("ladder", {"steps": [{"model": "paper"}]})
    with pytest.raises(BadInput, match="the stored fit is incomplete: fit the session again"):
        ladder_of(load(folder))
    with opened(folder) as store:
        fit_session(store)
    assert [step.effects for step in ladder_of(load(folder))] == [()]


@pytest.mark.parametrize("seed", range(40))
def test_clear_maxima_are_those_of_scipy(seed: int) -> None:
    """Curves with noise, with plateaus (rounded), constant, rising, and so short that they have no inside."""
    random = np.random.default_rng(seed)
    walk = np.cumsum(random.normal(size=random.integers(1, 300)))
    for level in (walk, np.round(walk), np.round(walk, 1), np.sort(walk), np.zeros_like(walk), copy.copy(-walk)):
        for prominence in (0.0, 0.5, 3.0):
            at, found = find_peaks(level, prominence=prominence)
            assert clear_maxima(level, prominence) == list(zip(at.tolist(), found["prominences"].tolist(), strict=True))
