"""All renderings with their names in the session folder."""

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

# What the figures take of a report's time, in percent.
FIGURES = 60


@contextmanager
def told_as_unreadable(what: str) -> Iterator[None]:
    """Tell in one line that something stored lacks an entry, or has another kind of thing in its place."""
    try:
        yield
    except MotoremiError:
        raise
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        detail = f"{type(error).__name__}: {error}"
        raise Unreadable(f"{what} holds results that this version cannot read ({detail}); fit, compare and diagnose again") from error


class Unreadable(BadInput):
    """A stored analysis is not as this version writes it."""


def render_session(materials: Materials, choice: Choice = WHOLE, progress: Progress | None = None) -> dict[str, bytes]:
    """The report of a session in all forms; stored analyses that this version cannot read are left out, and the report says so.

    Raises
    ------
    Unreadable
        If it cannot be made without all of them either: then the stored fit is to blame.
    """
    present = [name for name in STORED if materials.stored(name) is not None]
    # The culprit is found by leaving one out after the other: what an earlier version wrote is nowhere written down.
    for names in ((), *((name,) for name in present)):
        with suppress(Unreadable), told_as_unreadable(materials.session.path.name):
            return _rendered(materials.without(names), choice, progress)
    with told_as_unreadable(materials.session.path.name):
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

    The short form is for people alone; both forms can stand side by side.
    """
    name = "report" if form == "long" else form
    texts = {f"report/{name}.html": render_html(report)}
    if form == "long":
        texts |= {"report/report.json": render_json(report), "report/junit.xml": render_junit(report), "report/parameters.csv": render_csv(report)}
    made = {file: text.encode("utf-8") for file, text in texts.items()}
    return {**made, f"report/{name}.pdf": render_pdf(report)} if can_render_pdf() else made
