"""Sessions side by side: changes and their error bars against numbers worked out apart."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest
from report_cases import HOSTILE, parsed, together
from typer.testing import CliRunner

import motoremi as me
from motoremi.cli.app import app
from motoremi.data.session import SessionWriter, load
from motoremi.report.several_sessions import change_in_percent, level_change
from motoremi.workflow import compare_session, fit_session, ladder_of, opened, report_together

pytestmark = pytest.mark.slow


def session(path: Path, sweeps: list[me.ImpedanceSweep], **start: str) -> Path:
    with SessionWriter.create(path, {"title": "side", **start}) as writer:
        for sweep in sweeps:
            writer.add_sweep(sweep)
        writer.close("done")
    with opened(path) as store:
        fit_session(store)
        compare_session(store, me.Tolerance(error_percent=1.0))
    return path


def scaled(sweeps: list[me.ImpedanceSweep], factor: float) -> list[me.ImpedanceSweep]:
    return [me.ImpedanceSweep(s.termination, s.frequency_hz, factor * s.impedance_ohm) for s in sweeps]


@pytest.fixture(scope="module")
def pair(tmp_path_factory, measure) -> tuple[Path, Path]:
    """A motor, and the same with every impedance 2 % higher: inductances and resistances rise by 2 %, capacitances fall."""
    folder = tmp_path_factory.mktemp("pair")
    sweeps, _ = measure(2)
    return session(folder / "before", sweeps, motor="A"), session(folder / "after", scaled(sweeps, 1.02), motor="B")


@pytest.fixture(scope="module")
def compared(pair, tmp_path_factory) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in report_together(list(pair), tmp_path_factory.mktemp("out") / "new")}


def test_changes_are_those_of_the_motor(compared, pair):
    data = json.loads(compared["comparison.json"])
    fits = [ladder_of(load(path))[-1] for path in pair]
    for parameter in data["parameters"]:
        name, (first, second) = parameter["name"], parameter["sessions"]
        assert (first["value"], second["value"]) == tuple(fit.parameters[name] for fit in fits)
        assert first["change_percent"] is None
        if second["determined"] and first["determined"]:
            expected = 2.0 if name[0] in "RL" else 100 * (1 / 1.02 - 1)
            # The analyser's gain is part of what the fit does not know, so each fit may lay a part of the 2 % there.
            assert second["change_percent"] == pytest.approx(expected, abs=0.1)
            bar = np.hypot(fits[0].sigma[name], fits[1].sigma[name])
            assert second["change_in_error_bars"] == pytest.approx((fits[1].parameters[name] - fits[0].parameters[name]) / bar)
    for band in data["bands"]:
        assert band["mean_db"] == pytest.approx(20 * np.log10(1.02), abs=1e-6)
    assert {band["session"] for band in data["bands"]} == {"after"}


def test_table_and_page_say_the_same(compared):
    data = json.loads(compared["comparison.json"])
    rows = list(csv.DictReader(io.StringIO(compared["comparison.csv"].decode())))
    assert len(rows) == 2 * len(data["parameters"])
    la = next(row for row in rows if row["session"] == "after" and row["parameter"] == "La")
    assert float(la["change_percent"]) == next(p for p in data["parameters"] if p["name"] == "La")["sessions"][1]["change_percent"]
    text = "".join(parsed(compared["comparison.html"].decode()).text)
    for told in ("before", "after", "Verdicts", "PASS", "change (in error bars)", "+0.17 dB", data["sessions"][1]["session_sha256"]):
        assert told in text
    assert [change_in_percent(value) for value in (2.04, -18.6, 166.0, -12345.0)] == ["+2", "-19", "+166", "-12345"]
    assert [level_change(value) for value in (-0.001, 0.172)] == ["+0.00 dB", "+0.17 dB"]


def test_same_sessions_same_bytes(compared, pair, tmp_path):
    assert set(compared) == {"comparison.html", "comparison.json", "comparison.csv", "comparison.pdf"}
    assert {file.name: file.read_bytes() for file in report_together(list(pair), tmp_path)} == compared
    assert not (pair[0] / "report").exists()


def test_points_need_not_be_the_same(tmp_path, pair, measure):
    sweeps, _ = measure(2)
    other = [me.ImpedanceSweep(s.termination, s.frequency_hz[100::2], s.impedance_ohm[100::2]) for s in sweeps]
    with SessionWriter.create(tmp_path / "narrow", {"title": "no fit"}) as writer:
        for sweep in other:
            writer.add_sweep(sweep)
        writer.close("done")
    files = report_together([pair[0], tmp_path / "narrow"], tmp_path / "out")
    data = json.loads(next(file for file in files if file.suffix == ".json").read_text())
    assert data["sessions"][1]["comparison"] is None
    assert all(one["sessions"][1]["value"] is None for one in data["parameters"])
    # The same motor: no band differs, whether the other session was judged by bands or not.
    assert data["bands"]
    assert all(abs(band["largest_db"]) < 0.05 for band in data["bands"])


@pytest.mark.parametrize("text", together([text for text in HOSTILE if "/" not in text and "\x00" not in text]))
def test_hostile_names_are_shown_not_obeyed(tmp_path, pair, measure, text):
    path = tmp_path / text
    with SessionWriter.create(path, {"title": text, "motor": text, "serial": text}) as writer:
        writer.add_sweep(measure(2)[0][0])
        writer.close("done")
    files = {file.name: file.read_bytes() for file in report_together([pair[0], path], tmp_path / "out")}
    page = parsed(files["comparison.html"].decode())
    assert not {"script", "img"} & set(page.tags)
    assert not any(name.startswith("on") for name, _ in page.attributes)
    assert not set("\x1b\u202e\u2028") & set(files["comparison.html"].decode())


def test_wrong_use_is_one_line(pair, tmp_path):
    many = [str(path) for path in pair]
    for words, told in (
        (many, "--out DIR"),
        ([many[0], "--out", str(tmp_path / "x")], "several sessions"),
        ([many[0], many[0], "--out", str(tmp_path / "x")], "same name"),
    ):
        with pytest.raises(me.BadInput, match=told):
            CliRunner().invoke(app, ["report", *words], catch_exceptions=False)


def test_only_the_sessions_that_are_simulated_are_marked(pair, tmp_path):
    """One of them on a simulated bench: the other one measured a motor."""
    simulated = tmp_path / "virtual"
    with SessionWriter.create(simulated, {"title": "side", "simulated": True}) as writer:
        writer.add_sweep(load(pair[0]).sweeps[0])
        writer.close("done")
    made = {file.name: file.read_text("utf-8") for file in report_together([pair[0], simulated], tmp_path / "new") if file.suffix == ".html"}
    text = "".join(parsed(made["comparison.html"]).text)
    assert "SIMULATED DATA in virtual: no real motor was measured there" in text
    assert "SIMULATED DATA: no real motor was measured" not in text
