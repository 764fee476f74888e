"""The inputs of a report and its parts, as plain immutable values.

Text from outside is cleaned when a value is created, so that every output format shows clean text.
"""

from __future__ import annotations

import base64
import dataclasses
import re
from collections.abc import Collection
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from motoremi.arrays import JsonDict
from motoremi.data.laboratory import Laboratory
from motoremi.data.session import Session
from motoremi.data.text import clean_text
from motoremi.errors import BadInput
from motoremi.fitting.result import Fit
from motoremi.inspection.compare import Comparison
from motoremi.model.effects.names import as_sum
from motoremi.report.kinds import FORMS, SECTIONS

# Longer texts are cut for display; the machine-readable data hold them complete.
LONGEST_TEXT = 1000


@dataclass(frozen=True)
class Materials:
    """The inputs of a report.

    Parameters
    ----------
    session : Session
    steps : tuple of Fit
        The ladder, base first; empty before the first fit.
    comparison : Comparison, optional
        Of the current model.
    diagnosis : dict, optional
        As `Diagnosis.to_dict` gives it.
    unreadable : frozenset of str
        Stored analyses that are left out because this version cannot read them.
    laboratory : Laboratory, optional
        The laboratory that issues the report.
    issue : dict, optional
        The report's number and date of issue, and what it replaces: see `motoremi.workflow_issue`.
    """

    session: Session
    steps: tuple[Fit, ...]
    comparison: Comparison | None
    diagnosis: JsonDict | None
    unreadable: frozenset[str] = frozenset()
    laboratory: Laboratory | None = None
    issue: JsonDict | None = None

    @property
    def effects(self) -> tuple[str, ...]:
        """Those of the current model; none before the first fit."""
        return self.steps[-1].effects if self.steps else ()

    def stored(self, name: str) -> JsonDict | None:
        """The content of `analysis/<name>.json`; None if it does not exist or is left out."""
        # Cached: a prediction holds thousands of levels.
        if name not in self._parsed:
            self._parsed[name] = None if name in self.unreadable else self.session.analysis(name)
        return self._parsed[name]

    def without(self, names: Collection[str]) -> Materials:
        """A copy that leaves out these stored analyses."""
        return dataclasses.replace(self, diagnosis=None if "diagnosis" in names else self.diagnosis, unreadable=frozenset(names))

    @cached_property
    def _parsed(self) -> dict[str, JsonDict | None]:
        return {}


@dataclass(frozen=True)
class Choice:
    """The form of a report and its sections.

    Parameters
    ----------
    form : {"long", "short"}
        The complete report for engineers, or two pages for customers.
    sections : frozenset of str, optional
        Names of `motoremi.report.kinds.SECTIONS`; all sections of the long form if empty.

    Raises
    ------
    BadInput
        For an unknown form or section, or sections of the short form.
    """

    form: str = "long"
    sections: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        if self.form not in FORMS:
            raise BadInput(f"there is no form {clean_text(self.form, 40)!r} of a report; there are {', '.join(FORMS)}")
        for name in sorted(self.sections - set(SECTIONS)):
            raise BadInput(f"a report has no section {clean_text(name, 40)!r}; there are {', '.join(SECTIONS)}")
        if self.sections and self.form == "short":
            raise BadInput("the short form has its own sections; choose sections of the long one")

    def holds(self, name: str) -> bool:
        """Whether the long form shows a section."""
        return not self.sections or name in self.sections


def is_result(fit: Fit) -> bool:
    """Whether a fit may be quoted: it converged, or it is the paper's method as printed, whose warnings say how it ended."""
    return fit.converged or fit.method == "paper"


def model_name(fit: Fit) -> str:
    """The base model and its effects, for display."""
    return as_sum(("paper's circuit", *fit.effects))


@dataclass(frozen=True)
class _Shown:
    """A value whose texts are cleaned for display."""

    def __post_init__(self) -> None:
        for entry in dataclasses.fields(self):
            if not entry.metadata.get("markup"):
                object.__setattr__(self, entry.name, _cleaned(getattr(self, entry.name)))


def _cleaned(value: Any) -> Any:
    if isinstance(value, str):
        return clean_text(value, LONGEST_TEXT)
    return tuple(_cleaned(item) for item in value) if isinstance(value, tuple) else value


@dataclass(frozen=True)
class Table(_Shown):
    """A table of texts; `marked` rows are highlighted."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    marked: frozenset[int] = frozenset()


@dataclass(frozen=True)
class Picture(_Shown):
    """A plot with its caption; `svg` is markup made by this software."""

    svg: str = field(metadata={"markup": True})
    caption: str


@dataclass(frozen=True)
class Section(_Shown):
    """A heading with its texts, tables and pictures."""

    title: str
    texts: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()

    @property
    def anchor(self) -> str:
        """The section's identifier in links; titles never contain text from outside."""
        return "-".join(re.findall("[a-z0-9]+", self.title.lower()))


@dataclass(frozen=True)
class Box(_Shown):
    """The results of one kind of measurement in a few lines.

    Parameters
    ----------
    title : str
    lines : tuple of (label, text, mood)
        Mood is "good", "bad" or "plain".
    verdict : (label, text, mood), optional
        The overall verdict on its requirement.
    """

    title: str
    lines: tuple[tuple[str, str, str], ...]
    verdict: tuple[str, str, str] | None = None


@dataclass(frozen=True)
class Letterhead(_Shown):
    """The laboratory that issues the report; the logo has been checked and is a PNG as base64 text, or SVG markup."""

    name: str
    address: tuple[str, ...]
    logo_png: str = field(default="", metadata={"markup": True})
    logo_svg: str = field(default="", metadata={"markup": True})

    @property
    def logo_url(self) -> str:
        """The logo as the address of an image: scripts in it do not run and nothing is loaded."""
        if self.logo_png:
            return f"data:image/png;base64,{self.logo_png}"
        return f"data:image/svg+xml;base64,{base64.b64encode(self.logo_svg.encode()).decode()}" if self.logo_svg else ""


@dataclass(frozen=True)
class Report(_Shown):
    """The content of a report.

    Parameters
    ----------
    title, subtitle : str
    boxes : tuple of Box
        The results on the first page, a box for each kind of measurement.
    warnings : tuple of str
        What was not done, or not done well; shown on the first page.
    sections : tuple of Section
    data : dict
        The machine-readable content, with texts as they came.
    begun : str
        When the measurement began, ISO 8601.
    footer : str
        Identifies the session at the foot of every page.
    signatures : tuple of str
        One line for each signature.
    letterhead : Letterhead, optional
    number : str
        The report's own number, at the head of every page and at its end.
    facts : tuple of (label, text)
        Item tested, date, operator, customer.
    statements : tuple of str
        Statements on the whole report: what the results relate to, and the decision rule.
    mark : str
        A note for every page, such as that the data are simulated.
    pages : int
        Pictures are reduced, within legible limits, so that the report has at most this many pages; 0 for no limit.
    """

    title: str
    subtitle: str
    boxes: tuple[Box, ...]
    warnings: tuple[str, ...]
    sections: tuple[Section, ...]
    data: JsonDict
    begun: str = ""
    footer: str = ""
    signatures: tuple[str, ...] = ()
    letterhead: Letterhead | None = None
    number: str = ""
    facts: tuple[tuple[str, str], ...] = ()
    statements: tuple[str, ...] = ()
    mark: str = ""
    pages: int = 0

    @property
    def headline(self) -> tuple[tuple[str, str, str], ...]:
        """The lines of all boxes, each box with its verdict first."""
        return tuple(line for box in self.boxes for line in (*([box.verdict] if box.verdict else []), *box.lines))

    @property
    def end(self) -> str:
        """The end mark of the report."""
        return f"End of report {self.number}".strip()
