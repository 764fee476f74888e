"""All renderings with their names in the session folder."""

from __future__ import annotations

from motoremi.report.data import render_csv, render_json
from motoremi.report.html import render_html
from motoremi.report.junit import render_junit
from motoremi.report.parts import Report
from motoremi.report.pdf import can_render_pdf, render_pdf


def render_all(report: Report) -> dict[str, bytes]:
    """File name within the session -> content; PDF where typst is installed. The same session gives the same bytes."""
    texts = {
        "report/report.html": render_html(report),
        "report/report.json": render_json(report),
        "report/junit.xml": render_junit(report),
        "report/parameters.csv": render_csv(report),
    }
    made = {name: text.encode("utf-8") for name, text in texts.items()}
    return {**made, "report/report.pdf": render_pdf(report)} if can_render_pdf() else made
