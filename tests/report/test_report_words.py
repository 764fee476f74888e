"""Verdicts, findings and errors in words: the same on every surface, whatever version stored them, and text from outside escaped."""

from __future__ import annotations

import copy
import json
import re
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any, get_args
from xml.etree import ElementTree

import pytest
from laboratory_cases import pages_of
from report_cases import HOSTILE, diagnosed_session, parsed
from report_cases import together as several_in_one
from typer.testing import CliRunner

import motoremi as me
from motoremi.cli.app import app
from motoremi.data.measurement import Measurement
from motoremi.data.session import SessionWriter, load
from motoremi.diagnosis.belief import Verdict
from motoremi.fleet.page import fleet_html
from motoremi.fleet.statistics import fleet_figures
from motoremi.report.overlay import LOOKS
from motoremi.report.plots import SPECTRUM_LOOKS
from motoremi.report.steps import UNITS, planned_steps
from motoremi.report.words import described, findings_of, in_symbols, in_words, lag, mood_of, number, place_of, share_of_analyser, would_leave
from motoremi.schema.procedure_steps import Check, Compensate, Final, JudgeStep, Scan, Wait
from motoremi.schema.quantity_field import Quantity
from motoremi.workbench.views import diagnosis as shown_on_the_page
from motoremi.workflow import fit_session, ladder_of, opened, report_session

pytestmark = pytest.mark.slow

INTERFERENCE = {
    "id": "interference",
    "sweep": "open",
    "band_hz": [530e3, 1.6e6],
    "serious": True,
    "why": "24 of 401 points of the open sweep stand out",
    "remedy": "shield the motor",
}
TOO_LITTLE = {"id": "too-little", "sweep": None, "band_hz": None, "serious": False, "why": "few points", "remedy": "sweep 201 points"}


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory, measure: Any) -> Path:
    return diagnosed_session(tmp_path_factory.mktemp("words") / "session", measure)


@pytest.fixture
def stored(session: Path) -> dict[str, Any]:
    return copy.deepcopy(load(session).analysis("diagnosis") or {})


def with_diagnosis(session: Path, folder: Path, diagnosis: dict[str, Any]) -> Path:
    copied = Path(shutil.copytree(session, folder))
    with opened(copied) as store:
        store.save_analysis("diagnosis", diagnosis)
        report_session(store)
    return copied


def as_before(stored: dict[str, Any]) -> dict[str, Any]:
    """As the version before stored it."""
    new = ("findings", "unexplained_percent", "floor_percent", "noise_percent", "accuracy_percent", "sets")
    old = {key: value for key, value in stored.items() if key not in new} | {"schema": "motoremi.diagnosis/1"}
    for one in (old["base"], old["best"], *old["candidates"]):
        for key in ("corrected_error_percent", "analyser_sigma", "unexplained_percent"):
            one.pop(key, None)
    return old


@pytest.mark.parametrize("verdict", get_args(Verdict))
def test_every_verdict_has_words(verdict: str) -> None:
    named = {"verdict": verdict, "effects": ["skin-effect", "core-loss"]}
    nothing = {"verdict": verdict, "effects": []}
    assert in_words(named) != verdict
    assert ("skin-effect and core-loss" in in_words(named)) == (verdict not in ("data", "unexplained", "adequate"))
    assert "{" not in in_words(nothing)
    assert mood_of(verdict) == {"adequate": "good", "data": "bad", "unexplained": "bad"}.get(verdict, "plain")


@pytest.mark.parametrize(
    ("value", "told"),
    [(70760.0, "70.76 × 10³"), (7076.4, "7076"), (1.0049, "1.005"), (0.0, "0"), (1.32e8, "132 × 10⁶"), (2.79e-6, "2.79 × 10⁻⁶"), (None, "-")],
)
def test_numbers_are_written_as_engineers_write_them(value: float | None, told: str) -> None:
    assert number(value, 4) == told
    assert lag(1.32e8) == "> 1000"
    assert lag(12.34) == "12.3"


@pytest.mark.parametrize(
    ("written", "printed"),
    [
        ("La rises from 7.094 uH to 18.87 uH.", "La rises from 7.094 µH to 18.87 µH."),
        ("21.09 Ohm, 1.2 kOhm, 5Ohm", "21.09 Ω, 1.2 kΩ, 5Ω"),
        ("830 uOhm", "830 µΩ"),
        ("60.0 dBuV at 1 MHz", "60.0 dBµV at 1 MHz"),
        ("12 uHz of the menu, Ohm's law, motor_uH", "12 uHz of the menu, Ohm's law, motor_uH"),
    ],
)
def test_units_are_printed_in_symbols(written: str, printed: str) -> None:
    assert in_symbols(written) == printed


def test_pages_and_paper_print_symbols_and_machines_read_plain_units(session: Path) -> None:
    with opened(session) as store:
        files = {file.name: file.read_bytes() for file in report_session(store)}
    page, paper = files["report.html"].decode(), "".join(pages_of(files["report.pdf"]))
    for text in (page, paper):
        assert re.search(r"\d Ω", text)
        assert not re.search(r"\d (Ohm|kOhm|uH|dBuV)", text)
    assert "Ohm" in files["parameters.csv"].decode()


def test_how_well_a_circuit_describes_a_motor() -> None:
    assert described({"value": 0.6123, "low": 0.41, "high": 0.9}) == "describes your motor to 0.61 % (95 %: 0.41 - 0.9 %)"
    assert "down to noise and analyser" in described({"value": 0.0, "low": 0.0, "high": 2e-4})
    # Not "to 91 %", which would be read as a success.
    assert described({"value": 90.9, "low": 80.0, "high": 99.0}) == "does not describe your motor: undescribed 91 % (95 %: 80 - 99 %)"


def test_an_effect_that_was_added_is_no_longer_missing(stored: dict[str, Any]) -> None:
    found = {**stored, "verdict": "missing-effect", "effects": ["skin-effect"]}
    assert in_words(found) == in_words(found, ["bearing-film"]) == "missing from the model: skin-effect"
    assert in_words(found, ["skin-effect", "bearing-film"]) == "missing from the model: skin-effect (now in the model)"


def test_a_fit_without_the_points_that_stand_out_is_no_other_diagnosis(session: Path, stored: dict[str, Any], tmp_path: Path) -> None:
    warning = "the diagnosis was made from another fit than those shown here"
    stored["base"]["rms_error_percent"] *= 0.9
    for findings, told in (([], True), ([TOO_LITTLE], True), ([INTERFERENCE], False)):
        folder = with_diagnosis(session, tmp_path / f"{len(findings)}{told}", {**stored, "findings": findings})
        assert (warning in (folder / "report" / "report.html").read_text("utf-8")) == told


def test_findings_say_where(stored: dict[str, Any]) -> None:
    found = findings_of({**stored, "findings": [TOO_LITTLE, INTERFERENCE]})
    assert [place_of(one) for one in found] == ["open sweep, 530 kHz - 1.6 MHz", "all sweeps"]
    assert findings_of(as_before(stored)) == []


def test_data_that_contradict_themselves_are_told_everywhere(session: Path, stored: dict[str, Any], tmp_path: Path) -> None:
    stored |= {"verdict": "data", "effects": [], "families": [], "findings": [TOO_LITTLE, INTERFERENCE]}
    stored["reasons"] = [INTERFERENCE["why"], *stored["reasons"]]
    folder = with_diagnosis(session, tmp_path / "bad", stored)
    page = parsed((folder / "report" / "report.html").read_text("utf-8"))
    text = "".join(page.text)
    assert "the data contradict themselves" in text
    assert "Found in the data: interference" in text
    assert "What the data themselves show" in text
    assert "shield the motor" in text
    assert "describes your motor" in text
    suites = ElementTree.parse(folder / "report" / "junit.xml").getroot()
    case = next(case for case in suites.iter("testcase") if case.get("name") == "diagnosis")
    failure = case.find("failure")
    assert failure is not None
    assert "24 of 401 points" in str(failure.get("message"))
    assert "sweep 201 points" in str(case.findtext("system-out"))
    assert json.loads((folder / "report" / "report.json").read_text("utf-8"))["diagnosis"]["findings"][1]["id"] == "interference"
    told = shown_on_the_page(stored)
    assert told["mood"] == "bad"
    assert [one["id"] for one in told["findings"]] == ["interference", "too-little"]
    assert INTERFERENCE["why"] not in told["reasons"]


@pytest.mark.parametrize("text", several_in_one([text for text in HOSTILE if "\x00" not in text]))
def test_findings_are_shown_not_obeyed(session: Path, stored: dict[str, Any], tmp_path: Path, text: str) -> None:
    stored["findings"] = [{**INTERFERENCE, "id": text, "sweep": text, "why": text, "remedy": text}]
    folder = with_diagnosis(session, tmp_path / "hostile", stored)
    html = (folder / "report" / "report.html").read_text("utf-8")
    page = parsed(html)
    assert not {"script", "img"} & set(page.tags)
    assert not any(name.startswith("on") for name, _ in page.attributes)
    assert not set("\x1b\u202e\u2028") & set(html)
    ElementTree.parse(folder / "report" / "junit.xml")
    assert (folder / "report" / "report.pdf").read_bytes().startswith(b"%PDF")


def test_a_diagnosis_of_the_version_before_is_shown(session: Path, stored: dict[str, Any], tmp_path: Path) -> None:
    folder = with_diagnosis(session, tmp_path / "old", as_before(stored))
    text = "".join(parsed((folder / "report" / "report.html").read_text("utf-8")).text)
    assert in_words(stored) in text
    assert "made by another version" not in text
    assert shown_on_the_page(as_before(stored))["findings"] == []
    done = CliRunner().invoke(app, ["next", str(folder)], catch_exceptions=False)
    assert done.exit_code == 0


def test_a_fleet_lists_serious_findings() -> None:
    best = {"converged": True, "parameters": {}, "rms_error_percent": 1.0}
    common = {"status": "done", "time": "", "serial": "", "best": best}
    results = [
        {**common, "session": "a", "diagnosis": {"verdict": "data", "effects": [], "findings": [INTERFERENCE, INTERFERENCE, TOO_LITTLE]}},
        {**common, "session": "b", "diagnosis": {"verdict": "adequate", "effects": []}},
    ]
    figures = fleet_figures(results)
    assert figures["findings"] == {"interference": ["a"]}
    assert figures["verdicts"] == {"data": 1, "adequate": 1}
    text = "".join(parsed(fleet_html(figures, "line")).text)
    assert "interference 1" in text
    assert "data 1, adequate 1" in text


@pytest.mark.usefixtures("few_effects")
def test_the_stated_accuracy_arrives_and_is_shown(session: Path, tmp_path: Path) -> None:
    sweeps = sorted((session / "sweeps").iterdir())
    words = [word for path in sweeps for word in ("--short" if path.name.startswith("short") else "--open", str(path))]
    out = tmp_path / "stated"
    done = CliRunner().invoke(app, ["import", str(out), *words, "--accuracy", "2"], catch_exceptions=False)
    assert "accuracy stated: 2 %" in done.stdout
    measurement = Measurement.of(load(out).sweeps)
    assert measurement.accuracy_percent == measurement.good_enough_percent == 2.0
    assert "accuracy stated for these data: 2 %" in CliRunner().invoke(app, ["diagnose", str(out)], catch_exceptions=False).stdout
    with opened(out) as store:
        report_session(store)
    assert "Accuracy stated for these data: 2 %" in (out / "report" / "report.html").read_text("utf-8")


def test_what_is_known_is_held_through_the_ladder(session: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(session, tmp_path / "held"))
    effect = ladder_of(load(folder))[-1].effects[-1]
    name = next(p for p in ladder_of(load(folder))[-1].parameters if p.startswith(effect))
    with opened(folder) as store:
        free = fit_session(store)
        fit_session(store, held={"La": 1.1 * free.parameters["La"], name: free.parameters[name]})
    base, top = ladder_of(load(folder))
    assert base.held == {"La": 1.1 * free.parameters["La"]}
    assert top.held == {"La": 1.1 * free.parameters["La"], name: free.parameters[name]}
    assert top.parameters["La"] == pytest.approx(1.1 * free.parameters["La"])
    assert ("La", "held") in [(row[0], row[2]) for row in top.rows()]


@pytest.mark.parametrize("held", [{"Rx": 1.0}, {"Ra": -1.0}, {"Ra": float("nan")}])
def test_what_cannot_be_held_is_refused(session: Path, held: dict[str, float]) -> None:
    with pytest.raises(me.BadInput):
        me.fit(me.dc_motor(), load(session).sweeps, held=held)


def test_steps_say_their_units(tmp_path: Path) -> None:
    settings = {"limit": "cispr32-b", "detectors": ["quasi-peak", "cispr-average"], "dwell": 1.0, "margin": 10.0, "maxima": 6, "apart": 50e3}
    planned = {"procedure": {"steps": [{"do": "final", **settings}, {"do": "wait", "time": "soon"}]}}
    with SessionWriter.create(tmp_path / "s", {"title": "x", **planned}) as writer:
        writer.close("done")
    (_, _, final, _), (_, _, wait, _) = planned_steps(load(tmp_path / "s"))
    assert final == "limit cispr32-b, detectors quasi-peak and cispr-average, dwell 1 s, margin 10 dB, maxima 6, apart 50 kHz"
    assert wait == "time soon"


def test_every_unit_of_a_step_is_one_that_the_bench_reads() -> None:
    told = {
        (name, quantity.unit)
        for step in (Compensate, Check, Scan, Final, Wait, JudgeStep)
        for name, field in step.model_fields.items()
        for quantity in [*field.metadata, *(one for part in get_args(field.annotation) for one in getattr(part, "__metadata__", ()))]
        if isinstance(quantity, Quantity)
    }
    assert told == set(UNITS.items())


def test_spectra_and_sessions_differ_without_colour() -> None:
    for looks in (SPECTRUM_LOOKS, LOOKS):
        assert len({str(style) for _, style in looks}) == len(looks) >= 8


@pytest.mark.parametrize(("floor_percent", "said"), [(33.0, "leave 33 %, noise alone"), (200.0, "leave 200 % (more than the impedance itself")])
def test_an_analyser_that_hardly_measures_the_impedance_is_told(floor_percent, said):
    assert said in would_leave(floor_percent, 0.14)


@pytest.mark.parametrize(("left_percent", "said"), [(5.73e-5, "subtracted less than 0.01 % (4.3 sigma"), (0.651, "subtracted 0.651 % (4.3 sigma")])
def test_an_error_that_nobody_measures_has_no_digits(left_percent, said):
    analyser = SimpleNamespace(ideal=False, named=False, name="unknown")
    fit = SimpleNamespace(measurement=SimpleNamespace(analyser=analyser), corrected_error_percent=left_percent, analyser_sigma=4.3)
    assert said in share_of_analyser(fit)
