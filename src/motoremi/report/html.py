"""The report as one HTML file, without scripts and without references to outside addresses."""

from __future__ import annotations

from functools import lru_cache

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from markupsafe import Markup

from motoremi.report.contents import Report
from motoremi.report.words import in_symbols


@lru_cache(maxsize=1)
def _template() -> Template:
    environment = Environment(
        loader=PackageLoader("motoremi.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_printed,
    )
    # Only plots drawn here are markup; everything else is escaped.
    environment.filters["drawing"] = Markup
    return environment.get_template("template.html.j2")


def _printed(value: object) -> object:
    return in_symbols(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def render_html(report: Report) -> str:
    """The whole page."""
    return _template().render(report=report)
