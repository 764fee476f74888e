"""What a report is made of, and what it consists of: plain, immutable values.

Text from outside is cleaned when a value is made, so that no rendering can forget it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from motoremi.arrays import JsonDict
from motoremi.data.session import Session
from motoremi.data.text import clean_text
from motoremi.diagnosis.compare import Comparison
from motoremi.fitting.result import Fit

# Longer texts are not meant seriously; the machine-readable data holds them whole.
LONGEST_TEXT = 1000


@dataclass(frozen=True)
class Materials:
    """What a report is made of.

    Parameters
    ----------
    session : Session
    steps : tuple of Fit
        The ladder, base first; empty before the first fit.
    comparison : Comparison, optional
        Of the model that stands.
    diagnosis : dict, optional
        As `Diagnosis.to_dict` gives it.
    unreadable : frozenset of str
        Stored analyses that are left out, because this version cannot read them.
    """

    session: Session
    steps: tuple[Fit, ...]
    comparison: Comparison | None
    diagnosis: JsonDict | None
    unreadable: frozenset[str] = frozenset()

    def stored(self, name: str) -> JsonDict | None:
        """What `analysis/<name>.json` holds; None if there is none, or it is left out."""
        # A prediction holds thousands of levels: it is parsed once a report.
        if name not in self._parsed:
            self._parsed[name] = None if name in self.unreadable else self.session.analysis(name)
        return self._parsed[name]

    def without(self, names: Collection[str]) -> Materials:
        """The same with these stored analyses left out."""
        return dataclasses.replace(self, diagnosis=None if "diagnosis" in names else self.diagnosis, unreadable=frozenset(names))

    @cached_property
    def _parsed(self) -> dict[str, JsonDict | None]:
        return {}


def is_result(fit: Fit) -> bool:
    """Whether a fit may be quoted: it converged, or it is the paper's method as printed, whose warnings say how it ended."""
    return fit.converged or fit.method == "paper"


def model_name(fit: Fit) -> str:
    """The model in words."""
    return " + ".join(("paper's circuit", *fit.effects))


@dataclass(frozen=True)
class _Shown:
    """A value whose texts are fit to be shown."""

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
    """A table of texts; `marked` are the rows that a reader must not miss."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    marked: frozenset[int] = frozenset()


@dataclass(frozen=True)
class Picture(_Shown):
    """A plot with its caption; `svg` is our own markup."""

    svg: str = field(metadata={"markup": True})
    caption: str


@dataclass(frozen=True)
class Section(_Shown):
    """A heading with what stands under it."""

    title: str
    texts: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()


@dataclass(frozen=True)
class Report(_Shown):
    """Everything that a report says.

    Parameters
    ----------
    title, subtitle : str
    headline : tuple of (label, text, mood)
        The first page in a few lines; mood is "good", "bad" or "plain".
    warnings : tuple of str
        What was not done or not well, in plain sight.
    sections : tuple of Section
    data : dict
        The same for machines, texts as they came.
    begun : str
        When the measurement began, ISO 8601.
    footer : str
        At the foot of every page: which session this is.
    signatures : tuple of str
        Who signs, a line each.
    """

    title: str
    subtitle: str
    headline: tuple[tuple[str, str, str], ...]
    warnings: tuple[str, ...]
    sections: tuple[Section, ...]
    data: JsonDict
    begun: str = ""
    footer: str = ""
    signatures: tuple[str, ...] = ()
