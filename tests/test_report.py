"""The report: same bytes, everything escaped, figures as the fit has them, gaps in plain sight."""

from __future__ import annotations

import csv
import io
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import pytest

import motoremi as me
from motoremi.data.session import SessionWriter, load
from motoremi.report.files import render_all
from motoremi.report.model import Materials, build_report
from motoremi.workflow import add_to_session, compare_session, diagnose_session, fit_session, ladder_of, opened, report_session

HOSTILE = [
    "<script>alert(1)</script>",
    '"><img src=x onerror=alert(1)>',
    "]]></testsuite><!--",
    "\x1b[31mred\x1b[0m",
    "nul\x00byte",
    "{{7*7}}{% raw %}",
    "\u202egnp.exe",
    "&amp;&lt;\u2028x",
    "=HYPERLINK(1)",
]


class Page(HTMLParser):
    """Collects tags and checks that they close."""

    VOID = frozenset({"meta", "br", "img", "hr", "link"})

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.open: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += attrs
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += attrs

    def handle_endtag(self, tag: str) -> None:
        assert self.open, tag
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)


def parsed(html: str) -> Page:
    page = Page()
    page.feed(html)
    assert page.open == []
    return page


@pytest.fixture(scope="module")
def session(tmp_path_factory, measure) -> Path:
    path = tmp_path_factory.mktemp("report") / "session"
    sweeps, _ = measure(2, ("insulation-leakage@Cf",))
    with SessionWriter.create(path, {"title": "A test", "motor": "XQ-7A2", "operator": "B. Engineer"}) as writer:
        for sweep in sweeps:
            writer.add_sweep(sweep)
        writer.add_spectrum(me.Spectrum("peak", [150e3, 154.5e3, 159e3], [40.0, 41.0, 39.0], overload=[False, True, False]))
        writer.close("done")
    with opened(path) as store:
        fit_session(store)
        compare_session(store, me.Tolerance(error_percent=1.0))
        found = diagnose_session(store)
        add_to_session(store, found.effects[0])
    return path


def rendered(path: Path) -> dict[str, bytes]:
    session = load(path)
    steps = tuple(ladder_of(session))
    comparison = me.compare(steps[-1], me.Tolerance(error_percent=1.0)) if steps else None
    return render_all(build_report(Materials(session, steps, comparison, session.analysis("diagnosis"))))


def test_same_session_gives_the_same_bytes(session):
    assert rendered(session) == rendered(session)


def test_page_stands_alone_and_shows_the_story(session):
    html = rendered(session)["report/report.html"].decode()
    page = parsed(html)
    assert len(html) < 3e6
    assert page.tags.count("svg") == 6  # sweeps, training, ladder, comparison, ranking, spectrum
    assert not {"script", "iframe", "object", "link", "img"} & set(page.tags)
    urls = re.findall(r"https?://[^\s\"'<)]+", html)
    assert all(url.startswith(("http://www.w3.org/", "https://www.w3.org/")) for url in urls)
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


def test_machines_read_the_figures_of_the_fit(session):
    files = rendered(session)
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


@pytest.mark.parametrize("text", HOSTILE)
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
    assert "49" not in html.replace("149", "") or "{{7*7}}" not in text
    visible = "".join(page.text)
    assert text[:3].strip("\x1b\u202e") in visible
    ElementTree.fromstring(files["report/junit.xml"])
    assert json.loads(files["report/report.json"])["motor"] == text or "\x00" in text


def test_gaps_are_in_plain_sight(tmp_path, measure):
    sweeps, _ = measure(2)
    writer = SessionWriter.create(tmp_path / "s", {"title": "cut off"})
    writer.emit("step-start", step=1, of=4, do="sweep", parameters={})
    writer.add_sweep(sweeps[0])
    writer.close("failed", "the analyser did not answer")
    with opened(tmp_path / "s") as store:
        report_session(store)
    text = (tmp_path / "s" / "report" / "report.html").read_text()
    for gap in ("did not end well", "the analyser did not answer", "1 (sweep)", "3 of 4 steps were not begun", "no fit was made", "no diagnosis"):
        assert gap in text
    with opened(tmp_path / "s") as store:
        fit_session(store)
        report_session(store)
    text = (tmp_path / "s" / "report" / "report.html").read_text()
    assert "no open sweep" in text
    assert "only one short sweep" in text


def test_fit_that_did_not_converge_is_not_shown_as_a_result(session):
    import dataclasses

    current = load(session)
    bad = dataclasses.replace(ladder_of(current)[0], converged=False)
    html = render_all(build_report(Materials(current, (bad,), None, None)))["report/report.html"].decode()
    assert "did not converge; its values are not shown" in html
    assert "standard uncertainty" not in html


def test_importing_motoremi_does_not_load_matplotlib():
    import subprocess
    import sys

    code = "import sys, motoremi; motoremi.fit; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
