"""The report as PDF: the same bytes, all that the page says, nothing obeyed."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pypdfium2
import pytest
from report_cases import HOSTILE, diagnosed_session
from typer.testing import CliRunner

import motoremi as me
from motoremi.cli.app import app
from motoremi.data.session import load
from motoremi.report.contents import Box, Letterhead, Section, Table
from motoremi.report.model import Materials, Report, build_report
from motoremi.report.pdf import NOT_INSTALLED, render_pdf
from motoremi.report.words import in_symbols
from motoremi.workflow import ladder_of

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def report(tmp_path_factory, measure) -> Report:
    session = load(diagnosed_session(tmp_path_factory.mktemp("pdf") / "session", measure))
    steps = tuple(ladder_of(session))
    return build_report(Materials(session, steps, me.compare(steps[-1]), session.analysis("diagnosis")))


def said(data: bytes) -> str:
    """The text of all pages without blanks: where a line breaks is not of interest."""
    pages = [page.get_textpage().get_text_range() for page in pypdfium2.PdfDocument(data)]
    return "".join("".join(pages).replace("\u200b", "").replace("\ufffe", "").split())


def squeezed(text: str) -> str:
    return "".join(text.split())


def test_same_report_gives_the_same_bytes(report):
    assert render_pdf(report) == render_pdf(report)


def test_pdf_says_what_the_page_says(report):
    data = render_pdf(report)
    text = said(data)
    assert all(squeezed(part) in text for line in report.headline for part in line[:2])
    assert all(squeezed(warning) in text for warning in report.warnings)
    for section in report.sections:
        assert squeezed(section.title) in text
        for table in section.tables:
            assert all(squeezed(in_symbols(cell)) in text for row in table.rows for cell in row)
    assert "expandeduncertainty" in text  # the plots keep their text
    assert squeezed(report.signatures[0]) in text


def test_date_of_the_file_is_that_of_the_measurement(report):
    dated = dataclasses.replace(report, begun="2026-03-04T05:06:07.5+00:00")
    assert pypdfium2.PdfDocument(render_pdf(dated)).get_metadata_dict()["CreationDate"].startswith("D:20260304050607")
    assert "T" not in pypdfium2.PdfDocument(render_pdf(dataclasses.replace(report, begun="soon"))).get_metadata_dict()["CreationDate"]


def test_no_page_is_blank_and_nothing_runs_off_it(report):
    for page in pypdfium2.PdfDocument(render_pdf(report)):
        image = page.render(scale=0.5).to_pil().convert("L")
        left, top, right, bottom = image.point(lambda grey: 255 if grey < 200 else 0).getbbox()
        assert top < image.height / 2
        assert left >= 0.06 * image.width
        assert right <= 0.94 * image.width
        assert bottom <= 0.98 * image.height


@pytest.mark.parametrize("text", HOSTILE)
def test_text_is_shown_not_obeyed(text):
    table = Table(text, (text, text), ((text, text * 20),), frozenset({0}))
    boxes = (Box(text, ((text, text, "bad"),), (text, text, "good")),)
    letterhead = Letterhead(text, (text,))
    own = {"letterhead": letterhead, "number": text, "facts": ((text, text),), "statements": (text,), "mark": text}
    report = Report(text, text, boxes, (text,), (Section(text, (text,), (table,)),), {}, text, text, (text,), **own)
    text_of_pdf = said(render_pdf(report))
    shown = squeezed(report.title).replace("\u7535\u673a", "\\u7535\\u673a")
    assert text_of_pdf.count(shown) >= 40


def test_without_typst_the_rest_is_written_and_one_line_says_so(tmp_path, measure, monkeypatch):
    path = diagnosed_session(tmp_path / "session", measure)
    monkeypatch.setattr("motoremi.report.pdf.can_render_pdf", lambda: False)
    monkeypatch.setattr("motoremi.report.renderings.can_render_pdf", lambda: False)
    result = CliRunner().invoke(app, ["report", str(path)])
    assert result.exit_code == 0
    assert NOT_INSTALLED in result.output
    assert not (Path(path) / "report" / "report.pdf").exists()
    assert (Path(path) / "report" / "report.html").exists()
