"""The pages of both forms: none with a quarter empty at its end, no heading without what it heads, two pages for the customer."""

from __future__ import annotations

import io
import random
from dataclasses import replace
from pathlib import Path

import pypdfium2
import pytest
from laboratory_cases import PROFILE, pages_of, profile
from report_cases import diagnosed_session, whole_session

from motoremi.data.session import load
from motoremi.report.contents import Choice, Report, Section, Table
from motoremi.report.model import build_report
from motoremi.report.pdf import render_pdf
from motoremi.workflow import materials_of
from motoremi.workflow_issue import issue_for

pytestmark = pytest.mark.slow

# A4 in points; between header and footer.
HEIGHT, TOP, FOOT = 842.0, 60.0, 51.0


@pytest.fixture(scope="module")
def pdfs(tmp_path_factory, measure) -> dict[str, bytes]:
    """Both forms of an impedance session and one with both kinds of measurement, with a laboratory and without."""
    folder = tmp_path_factory.mktemp("pages")
    lab = profile(folder / "lab", 'logo = "logo.svg"\n' + PROFILE)
    made = {}
    for name, make in (("impedance", diagnosed_session), ("whole", whole_session)):
        path: Path = make(folder / name, measure)
        for signed, own in (("", None), ("signed ", lab)):
            # What all forms show is restored once, and only the pages are made of it.
            laboratory, issue = issue_for(load(path), own)
            materials = replace(materials_of(load(path)), laboratory=laboratory, issue=issue)
            for form in ("long", "short"):
                made[f"{signed}{name} {form}"] = render_pdf(build_report(materials, Choice(form)))
    return made


def lowest(page: pypdfium2.PdfPage) -> float:
    """How far above the footer the last mark of a page stands, as a share of the text's height."""
    image = page.render(scale=0.5).to_pil().convert("L")
    text = image.crop((0, 0, image.width, int((HEIGHT - FOOT - 8) / 2)))
    box = text.point(lambda grey: 255 if grey < 215 else 0).getbbox()
    return (HEIGHT - FOOT - 2 * box[3]) / (HEIGHT - FOOT - TOP)


def test_no_page_but_the_last_ends_a_quarter_empty(pdfs):
    for name, data in pdfs.items():
        pages = list(pypdfium2.PdfDocument(io.BytesIO(data)))
        empty = {number: round(share, 2) for number, page in enumerate(pages[:-1], start=1) if (share := lowest(page)) > 0.25}
        assert empty == {}, name


def test_no_heading_stands_at_the_end_of_a_page(pdfs):
    titles = {
        "Sweeps and model",
        "Fit",
        "Ladder",
        "Model against measurement",
        "Diagnosis",
        "Emission",
        "Impedance",
        "Equipment",
        "Identity",
        "Procedure",
    }
    for name, data in pdfs.items():
        for text in pages_of(data):
            lines = [line.strip() for line in text.splitlines() if line.strip()]
            body = [line for line in lines if not line.startswith("page ") and "· data " not in line]
            assert body[-1] not in titles, name


def made_up(seed: int) -> Report:
    """A report of eight sections with tables of random length; some rows go over several lines."""
    chance = random.Random(seed)
    words = "a sentence that goes over several lines of the narrow column in which it stands "

    def table(title: str) -> Table:
        rows = tuple((f"row {number}", words * chance.choice([0, 0, 1, 3, 6]) or "short", "value") for number in range(chance.randint(1, 16)))
        return Table(title, ("what", "words", "value"), rows)

    sections = tuple(
        Section(
            f"Section {number}",
            texts=() if chance.random() < 0.5 else (words * chance.randint(1, 4),),
            tables=tuple(table(f"Table {number}.{part}") for part in range(chance.randint(1, 4))),
        )
        for number in range(8)
    )
    return Report("Test report", "", (), (), sections, {}, "2026-11-23T10:00:00Z", "data of a test", ())


def test_wherever_a_page_ends_a_heading_goes_with_what_it_heads():
    for seed in range(40):
        for text in pages_of(render_pdf(made_up(seed)))[:-1]:
            lines = [line.strip() for line in text.splitlines() if line.strip()]
            body = [line for line in lines if not line.startswith(("page ", "data of a test"))]
            assert not body[-1].startswith(("Section", "Table", "what")), seed


def test_a_customer_reads_two_pages(pdfs):
    assert {name: len(pypdfium2.PdfDocument(data)) for name, data in pdfs.items() if "short" in name} == dict.fromkeys(
        ("impedance short", "signed impedance short", "whole short", "signed whole short"), 2
    )


def test_pages_are_counted_and_the_last_line_is_the_end(pdfs):
    for data in pdfs.values():
        pages = pages_of(data)
        assert all(f"page {number} of {len(pages)}" in text for number, text in enumerate(pages, start=1))
        assert "End of report" in pages[-1]
        assert not any("End of report" in text for text in pages[:-1])


def test_names_stand_in_one_line(pdfs):
    for name in ("insulation-leakage@Cf", "expanded uncertainty (k = 2)"):
        assert any(name in line for text in pages_of(pdfs["impedance long"]) for line in text.splitlines())
    for text in pages_of(pdfs["impedance long"]):
        assert not any(line.rstrip().endswith(("insulation-leak", "resis", "resist", "resistance_")) for line in text.splitlines())
