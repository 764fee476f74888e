"""Writes the report in all output formats, with their file names in the session folder."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress

from motoremi.arrays import Progress
from motoremi.errors import BadInput, MotoremiError
from motoremi.interrupts import checkpoint
from motoremi.report.contents import Choice, Materials, Report
from motoremi.report.gaps import STORED
from motoremi.report.html import render_html
from motoremi.report.junit import render_junit
from motoremi.report.machine_readable import render_csv, render_json
from motoremi.report.model import WHOLE, build_report
from motoremi.report.pdf import can_render_pdf, render_pdf

# Share of the figures in the time that a report takes, in percent.
FIGURES = 60


@contextmanager
def reported_as_unreadable(what: str) -> Iterator[None]:
    """Turn errors from unexpected stored content into one line."""
    try:
        yield
    except MotoremiError:
        raise
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        detail = f"{type(error).__name__}: {error}"
        raise Unreadable(f"{what} holds results that this version cannot read ({detail}); fit, compare and diagnose again") from error


class Unreadable(BadInput):
    """A stored analysis does not have the format of this version."""


def render_session(materials: Materials, choice: Choice = WHOLE, progress: Progress | None = None) -> dict[str, bytes]:
    """The report of a session in all forms; stored analyses that this version cannot read are left out, and the report says so.

    Raises
    ------
    Unreadable
        If the report fails even without all of them: then the stored fit is unreadable.
    """
    present = [name for name in STORED if materials.stored(name) is not None]
    # The unreadable one is found by leaving out one after the other: formats of earlier versions are not documented.
    for names in ((), *((name,) for name in present)):
        with suppress(Unreadable), reported_as_unreadable(materials.session.path.name):
            return _rendered(materials.without(names), choice, progress)
    with reported_as_unreadable(materials.session.path.name):
        return _rendered(materials.without(present), choice, progress)


def _rendered(materials: Materials, choice: Choice, progress: Progress | None) -> dict[str, bytes]:
    if progress is not None:
        progress("drawing the figures", 0, 100)
    report = build_report(materials, choice)
    checkpoint()
    if progress is not None:
        progress("setting the pages", FIGURES, 100)
    return render_all(report, choice.form)


def render_all(report: Report, form: str = "long") -> dict[str, bytes]:
    """File name within the session -> content; PDF where typst is installed. The same session gives the same bytes.

    The short form has no machine-readable files; both forms can be written to the same folder.
    """
    name = "report" if form == "long" else form
    texts = {f"report/{name}.html": render_html(report)}
    if form == "long":
        texts |= {"report/report.json": render_json(report), "report/junit.xml": render_junit(report), "report/parameters.csv": render_csv(report)}
    made = {file: text.encode("utf-8") for file, text in texts.items()}
    return {**made, f"report/{name}.pdf": render_pdf(report)} if can_render_pdf() else made
