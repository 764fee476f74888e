"""The report: same bytes, everything escaped, figures as the fit has them, gaps in plain sight."""

from __future__ import annotations

import csv
import dataclasses
import hashlib
import io
import json
import math
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
from report_cases import HOSTILE, diagnosed_session, parsed, rendered, together

import motoremi as me
from motoremi.data.session import SessionWriter, load
from motoremi.data.text import clean_text
from motoremi.report import plots
from motoremi.report.junit import render_junit
from motoremi.report.machine_readable import render_csv
from motoremi.report.model import Materials, build_report
from motoremi.report.renderings import render_all
from motoremi.workflow import fit_session, ladder_of, opened, report_session

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def session(tmp_path_factory, measure) -> Path:
    return diagnosed_session(tmp_path_factory.mktemp("report") / "session", measure)


@pytest.fixture(scope="module")
def files(session) -> dict[str, bytes]:
    return rendered(session)


def test_same_session_gives_the_same_bytes(session, files):
    assert rendered(session) == files


def test_page_stands_alone_and_shows_the_story(session, files):
    html = files["report/report.html"].decode()
    page = parsed(html)
    assert len(html) < 3e6
    assert page.tags.count("svg") == 6  # sweeps, training, ladder, comparison, ranking, spectrum
    assert not {"script", "iframe", "object", "link", "img"} & set(page.tags)
    assert "http" not in re.sub(r'\bxmlns(:\w+)?="http://www\.w3\.org/[^"]*"', "", html.replace("http-equiv", ""))
    assert any(name == "content" and "default-src 'none'" in str(value) for name, value in page.attributes)
    assert html.count('<svg role="img" aria-label="') == 6
    assert not any(name.startswith("on") for name, _ in page.attributes)
    head = html[: html.index("<h2>")] + html[html.index("<h2>") : html.index("Sweeps and model")]
    fit = ladder_of(load(session))
    for text in (
        "insulation-leakage@Cf",
        f"{fit[0].rms_error_percent:.3g} % rms",
        f"{fit[-1].rms_error_percent:.3g} % rms",
        f"{fit[-1].floor_percent:.2g} %",
        "overloaded",
    ):
        assert text in head
    identifiers = re.findall(r'\bid="([^"]+)"', html)
    assert len(identifiers) == len(set(identifiers))


def test_machines_read_the_figures_of_the_fit(session, files):
    data = json.loads(files["report/report.json"])
    last = ladder_of(load(session))[-1]
    assert data["ladder"][-1]["parameters"]["La"]["value"] == last.parameters["La"]
    assert data["ladder"][-1]["rms_error_percent"] == last.rms_error_percent
    rows = list(csv.DictReader(io.StringIO(files["report/parameters.csv"].decode())))
    la = [row for row in rows if row["name"] == "La" and row["where"] == "step 1"]
    assert float(la[0]["value"]) == last.parameters["La"]


def test_junit_fails_where_a_band_fails(session):
    current = load(session)
    base = ladder_of(current)[0]
    for tolerance, expected in ((0.05, True), (50.0, False)):
        report = build_report(Materials(current, (base,), me.compare(base, me.Tolerance(error_percent=tolerance)), None))
        root = ElementTree.fromstring(render_all(report)["report/junit.xml"])
        suites = root.findall("testsuite")
        assert [suite.get("name") for suite in suites] == ["short sweep", "open sweep", "session"]
        assert (len(root.findall(".//failure")) > 0) is expected
        assert sum(int(suite.get("failures", "0")) for suite in suites) == len(root.findall(".//failure"))
        assert root.find(".//testcase[@name='diagnosis']/skipped") is not None


@pytest.mark.parametrize("text", together(HOSTILE))
def test_hostile_text_is_shown_not_obeyed(tmp_path, measure, text):
    sweeps, _ = measure(2)
    with SessionWriter.create(tmp_path / "s", {"title": text, "motor": text, "operator": text, "imported": [text]}) as writer:
        identity = {"vendor": text, "model": text, "serial": text, "firmware": text}
        writer.emit("step-start", step=1, of=1, do=text, parameters={"x": text})
        writer.emit("instrument", role=text, driver="4294a", resource=text, identity=identity, settings={})
        writer.emit("step-stop", step=1, of=1, do=text)
        writer.add_sweep(sweeps[0].with_metadata(source=text))
        writer.close("failed", text)
    files = render_all(build_report(Materials(load(tmp_path / "s"), (), None, None)))
    html = files["report/report.html"].decode()
    page = parsed(html)
    assert not {"script", "img"} & set(page.tags)
    assert not any(name.startswith("on") for name, _ in page.attributes)
    for character in "\x1b\x00\u202e\u2028":
        assert character not in html
        assert character not in files["report/junit.xml"].decode()
    # Motor, title, operator, reason, resource, serial, firmware, file: each shown as it is, controls written out.
    assert "".join(page.text).count(clean_text(text)) >= 8
    ElementTree.fromstring(files["report/junit.xml"])
    assert json.loads(files["report/report.json"])["motor"] == text or "\x00" in text


@pytest.mark.parametrize("text", together(HOSTILE))
def test_hostile_diagnosis_is_shown_not_obeyed(session, text):
    current = load(session)
    diagnosis = current.analysis("diagnosis")
    assert diagnosis is not None
    text += r" $\frac$"  # a formula that matplotlib would refuse
    diagnosis = {**diagnosis, "effects": [text], "families": [[text, "x"]], "reasons": [text], "next_measurement": {"id": text, "why": text}}
    diagnosis["candidates"] = [{**diagnosis["candidates"][0], "effect": text, "family": text}, *diagnosis["candidates"][1:]]
    files = render_all(build_report(Materials(current, (), None, diagnosis)))
    html = files["report/report.html"].decode()
    page = parsed(html)
    assert not {"script", "img"} & set(page.tags)
    assert not set("\x1b\x00\u202e\u2028") & set(html)
    assert "".join(page.text).count(clean_text(text)) >= 8
    root = ElementTree.fromstring(files["report/junit.xml"])
    found = root.find(".//property[@name='effects']")
    assert found is not None
    assert found.get("value") == clean_text(text)
    assert json.loads(files["report/report.json"])["diagnosis"]["effects"] == [text]


def test_error_after_is_told_before_the_effect_is_added(session):
    current = load(session)
    base = ladder_of(current)[0]
    diagnosis = current.analysis("diagnosis")
    assert diagnosis is not None
    told = {label: text for label, text, _ in build_report(Materials(current, (base,), None, diagnosis)).headline}
    after = told["Error after (with insulation-leakage@Cf, not added yet)"]
    assert after == f"{diagnosis['best']['rms_error_percent']:.3g} % rms"
    worst = me.compare(base).where[0]
    assert f"{100 * worst['share']:.0f} %" in told["Where it fails"]
    assert told["Model against measurement"] == "not judged"


def test_report_names_its_data_and_a_simulated_bench(tmp_path, measure):
    sweeps, _ = measure(2)
    procedure = {"steps": [{"do": "sweep", "termination": "short"}, {"do": "spectrum", "detector": "peak"}]}
    with SessionWriter.create(tmp_path / "s", {"title": "t", "backend": "sim", "procedure": procedure}) as writer:
        writer.emit("step-start", step=1, of=2, do="sweep", parameters={"termination": "short"})
        writer.add_sweep(sweeps[0].with_metadata(compensated=["open"]))
        writer.emit("step-stop", step=1, of=2, do="sweep")
        writer.emit("safe", role="receiver", safe=False, problem="does not answer")
        writer.close("interrupted", "stopped by the operator")
    current = load(tmp_path / "s")
    report = build_report(Materials(current, (), None, None))
    told = "\n".join(report.warnings)
    for gap in (
        "simulated bench",
        "stopped by the operator",
        "1 of 2 steps were not begun: 2 (spectrum)",
        "receiver could not be brought into its safe state: does not answer",
        "the fixture was not compensated",
        "no emission spectrum",
        "nothing is judged",
    ):
        assert gap in told
    measured = next(d for d in current.documents if d["kind"] == "sweep")
    digest = hashlib.sha256(measured["sha256"].encode()).hexdigest()
    assert report.data["session_sha256"] == digest
    html = render_all(report)["report/report.html"].decode()
    assert digest in html
    assert measured["sha256"] in html


def test_sweep_that_was_not_measured_is_skipped_in_junit(session, measure):
    sweeps, _ = measure(2)
    fit = me.fit(me.dc_motor(), [sweep for sweep in sweeps if sweep.termination == "short"])
    report = build_report(Materials(load(session), (fit,), me.compare(fit), None))
    suites = {suite.get("name"): suite for suite in ElementTree.fromstring(render_junit(report)).findall("testsuite")}
    assert "no open sweep" in "\n".join(report.warnings)
    assert suites["open sweep"].get("skipped") == "1"
    assert suites["short sweep"].get("skipped") == "0"
    assert len(suites["short sweep"].findall("testcase")) == len(me.compare(fit).bands)


def test_table_holds_numbers_where_numbers_belong(session):
    current = load(session)
    last = ladder_of(current)[-1]
    vague = dataclasses.replace(last, local_sigma={**last.local_sigma, "La": float("inf")})
    comparison = me.compare(vague, me.Tolerance(error_percent=1e-3))
    rows = list(csv.DictReader(io.StringIO(render_csv(build_report(Materials(current, (vague,), comparison, None))))))
    for row in rows:
        assert math.isfinite(float(row["value"]))
        assert not row["sigma"] or math.isfinite(float(row["sigma"]))
    assert [(row["sigma"], row["note"]) for row in rows if row["name"] == "La"] == [("", "not determined")]
    assert [row["note"] for row in rows if row["name"] == "rms_error_percent" and row["kind"] == "band"] == [
        band["verdict"] for band in comparison.bands
    ]


def test_plots_hold_what_they_promise(session):
    current = load(session)
    base, last = ladder_of(current)
    comparison = me.compare(base, me.Tolerance(error_percent=0.05))
    for figure, promised in (
        (plots.fit_figure(base), ("measured, mean of 3", "paper", "expanded uncertainty", "MHz")),
        (plots.sweeps_figure(base, last), ("with insulation-leakage@Cf", "150 k", "30 M", "phase (deg)")),
        (plots.comparison_figure(comparison), ("FAIL", "fails", "tolerance 0.05 %")),
        (plots.training_figure(base), ("best so far", "noise and analyser would leave")),
        (
            plots.ladder_figure((base, last)),
            (f"{base.rms_error_percent:.3g} %", f"{last.rms_error_percent:.3g} %", "noise and analyser would leave"),
        ),
        (plots.spectrum_figure(current.spectra), ("peak, 9 kHz", "overloaded")),
    ):
        drawn = plots.to_svg(figure, "x")
        ElementTree.fromstring(drawn)
        for text in promised:
            assert text in drawn


def test_gaps_are_in_plain_sight(tmp_path, measure):
    sweeps, _ = measure(2)
    writer = SessionWriter.create(tmp_path / "s", {"title": "cut off"})
    writer.emit("step-start", step=1, of=4, do="sweep", parameters={})
    writer.add_sweep(sweeps[0])
    writer.close("failed", "the analyser did not answer")
    with opened(tmp_path / "s") as store:
        report_session(store)
    text = (tmp_path / "s" / "report" / "report.html").read_text()
    for gap in (
        "did not end normally",
        "the analyser did not answer",
        "1 (sweep)",
        "3 of 4 steps were not begun",
        "no fit was made",
        "no diagnosis",
    ):
        assert gap in text
    with opened(tmp_path / "s") as store:
        fit_session(store)
        report_session(store)
    text = (tmp_path / "s" / "report" / "report.html").read_text()
    assert "no open sweep" in text
    assert "only one short sweep" in text


def test_fit_that_did_not_converge_is_not_shown_as_a_result(session):
    current = load(session)
    bad = dataclasses.replace(ladder_of(current)[0], converged=False)
    html = render_all(build_report(Materials(current, (bad,), None, None)))["report/report.html"].decode()
    assert "did not converge; its values are not shown" in html
    assert "standard uncertainty" not in html


def test_importing_motoremi_does_not_load_matplotlib():
    code = "import sys, motoremi, motoremi.report.renderings, motoremi.report.model; motoremi.fit; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
