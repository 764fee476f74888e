"""A report that a lab can sign: everything that it has to say is said, in every form, and the same session says it in the same bytes."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from xml.etree import ElementTree

import pypdfium2
import pytest
from report_cases import parsed, whole_session

from motoremi.data.session import load
from motoremi.workflow import opened, report_session

pytestmark = pytest.mark.slow

START = {
    "serial": "SN-0815",
    "operator": "B. Engineer",
    "ambient": "23 degC, 45 %",
    "calibrated": {"analyser": "2026-03-01"},
    "calibration_age_days": {"analyser": 400},
}


@pytest.fixture(scope="module")
def reported(tmp_path_factory, measure) -> dict[str, bytes]:
    return report_of(whole_session(tmp_path_factory.mktemp("contents") / "session", measure, **START))


def report_of(path: Path) -> dict[str, bytes]:
    with opened(path) as store:
        return {file.name: file.read_bytes() for file in report_session(store)}


def squeezed(text: str) -> str:
    return "".join(text.replace("\u200b", "").replace("\ufffe", "").split())


@pytest.fixture(scope="module")
def texts(reported) -> dict[str, str]:
    """What a person reads: the page and the PDF."""
    pages = [page.get_textpage().get_text_range() for page in pypdfium2.PdfDocument(reported["report.pdf"])]
    return {"html": squeezed("".join(parsed(reported["report.html"].decode()).text)), "pdf": squeezed("".join(pages))}


@pytest.mark.parametrize("form", ["html", "pdf"])
@pytest.mark.parametrize(
    "what",
    [
        "SN-0815",
        "23 degC, 45 %",
        "B. Engineer",
        "JP1KG00123",
        "REV1.11",
        "2026-03-01",
        "400 days",
        "motoremi 0",
        "points 401",
        "SHA-256",
        "expanded uncertainty (k = 2)",
        "Training curve",
        "Error by band at each step",
        "rms error before",
        "Ranking: each single effect",
        "Cross-validation: left-out data",
        "gain in log likelihood (nats)",
        "Measure next",
        "Guard band 3.4 dB",
        "Emission against CISPR 32",
        "smallest margin",
        "Ranking of the effects of source and path",
        "Diagnosis of the spectra: missing from the model: arc-breakdown",
        "no bench procedure",
        "measured by: B. Engineer",
    ],
)
def test_report_contains(texts, form, what):
    assert squeezed(what).lower() in texts[form].lower()


def test_machines_read_the_emission(reported):
    data = json.loads(reported["report.json"])
    assert data["prediction"]["verdict"] in ("pass", "marginal", "fail")
    assert data["prediction"]["expanded_uncertainty_db"] == 3.4
    assert "predicted_dbuv" not in data["prediction"]
    assert data["emission_diagnosis"]["of"] == "emission"
    assert (data["serial"], data["ambient"], data["operator"]) == ("SN-0815", "23 degC, 45 %", "B. Engineer")
    assert data["diagnosis"]["cross_validation"]["bands"] is not None
    judged = data["prediction"]["judged"]
    root = ElementTree.fromstring(reported["junit.xml"])
    cases = root.findall("testsuite[@name='emission']/testcase")
    assert len(cases) == len(judged)
    for case, one in zip(cases, judged, strict=True):
        assert (case.find("failure") is not None) is (one["verdict"] == "fail")
        assert (case.find("skipped") is not None) is (one["verdict"] is None)
    rows = [row for row in csv.DictReader(io.StringIO(reported["parameters.csv"].decode())) if row["kind"] == "emission"]
    assert [float(row["value"]) for row in rows] == [one["worst_margin_db"] for one in judged]


def test_menu_of_measurements_is_shown(tmp_path, measure):
    path = whole_session(tmp_path / "s", measure)
    with opened(path) as store:
        diagnosis = load(path).analysis("diagnosis")
        menu = [{"id": "wide-sweep", "action": "sweep from 40 Hz", "separates": 0.5, "ratio": 7.25}]
        diagnosis["next_measurement"] = {"id": "wide-sweep", "why": "it decides", "menu": menu}
        store.save_analysis("diagnosis", diagnosis)
    html = report_of(path)["report.html"].decode()
    for text in ("What could be measured next", "sweep from 40 Hz", "50 %", "7.25"):
        assert text in html


def test_same_session_gives_the_same_bytes_in_every_form(tmp_path, measure, reported):
    path = whole_session(tmp_path / "s", measure, **START)
    first, second = report_of(path), report_of(path)
    assert set(first) == {"report.html", "report.json", "report.pdf", "junit.xml", "parameters.csv"}
    assert first == second


def test_sizes(reported):
    assert len(reported["report.html"]) < 3e6
    assert len(reported["report.pdf"]) < 3e6
