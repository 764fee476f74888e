"""The report as PDF, by typst (extra `pdf`).

All text goes to typst as strings in a JSON file, never as source, so that none of it is executed. Fonts come with typst and
matplotlib, not from the system: the same report gives the same bytes on any machine with the same versions of both.
"""

from __future__ import annotations

import base64
import dataclasses
import importlib.util
import json
import re
from collections.abc import Callable
from datetime import datetime
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from motoremi.arrays import JsonDict
from motoremi.data.text import clean_text
from motoremi.errors import BadInput
from motoremi.report.contents import Report
from motoremi.report.words import in_symbols

# Words longer than a column are broken at the joints of a name, such as . / _ and brackets; longer runs without a joint are cut.
_LONG_WORD = re.compile(r"\S{20,}")
_JOINT = re.compile(r"(?<=[./@:;,=+&|?~#)\]}])(?=\w)")
_LONG_PIECE = re.compile(r"\w{25,}")
_NO_NAME = re.compile(r"\w{33,}")
_PIECE = 16
BREAK = "\u200b"
NOT_INSTALLED = "no PDF: typst is not installed (pip install 'motoremi[pdf]')"


def can_render_pdf() -> bool:
    """Whether typst is installed."""
    return importlib.util.find_spec("typst") is not None


def render_pdf(report: Report) -> bytes:
    """The whole report; the date in the file is that of the session's start.

    Raises
    ------
    BadInput
        If typst is not installed.
    """
    if not can_render_pdf():
        raise BadInput(NOT_INSTALLED)
    import typst

    # typst's type annotations only allow a single file.
    compile_files: Callable[..., bytes] = typst.compile
    source: dict[str, bytes] = {"main.typ": files("motoremi.report").joinpath("template.typ").read_bytes()}
    page = _page(report)
    for number, picture in enumerate(picture for section in report.sections for picture in section.pictures):
        source[_picture_name(number)] = picture.svg.encode()
    logo = _logo(report)
    if logo is not None:
        page["letterhead"]["logo"] = list(logo)
    source["report.json"] = json.dumps(page).encode()
    try:
        return compile_files(source, format="pdf", font_paths=[str(_fonts())], ignore_system_fonts=True)
    except RuntimeError as error:
        if logo is None:
            raise
        raise BadInput(f"the laboratory's logo cannot be drawn in a PDF ({clean_text(str(error), 120)}); save it as PNG") from error


def _logo(report: Report) -> bytes | None:
    """The laboratory's logo; passed as numbers, since typst reads files in memory as text."""
    head = report.letterhead
    if head is None or not (head.logo_png or head.logo_svg):
        return None
    return base64.b64decode(head.logo_png) if head.logo_png else head.logo_svg.encode()


def _page(report: Report) -> JsonDict:
    """The data for the template."""
    number = 0
    sections = []
    for section in report.sections:
        pictures = []
        for picture in section.pictures:
            pictures.append({"file": _picture_name(number), "caption": picture.caption, "number": number + 1})
            number += 1
        tables = [{**dataclasses.asdict(table), "marked": sorted(table.marked)} for table in section.tables]
        sections.append({"title": section.title, "texts": section.texts, "pictures": pictures, "tables": tables})
    shown: JsonDict = breakable(
        {
            "title": report.title,
            "subtitle": report.subtitle,
            "footer": report.footer,
            "boxes": [dataclasses.asdict(box) for box in report.boxes],
            "letterhead": None
            if report.letterhead is None
            else {"name": report.letterhead.name, "address": report.letterhead.address, "logo": None},
            "number": report.number,
            "facts": report.facts,
            "statements": report.statements,
            "mark": report.mark,
            "pages": report.pages,
            "end": report.end,
            "warnings": report.warnings,
            "signatures": report.signatures,
            "sections": sections,
        }
    )
    return {**shown, "begun": _date(report.begun)}


def _picture_name(number: int) -> str:
    return f"picture-{number}.svg"


def breakable(value: Any) -> Any:
    """Plain data, with every text in characters that the fonts have."""
    if isinstance(value, str):
        return _LONG_WORD.sub(_broken, "".join(map(in_font, in_symbols(value))))
    if isinstance(value, dict):
        return {key: breakable(item) for key, item in value.items()}
    return [breakable(item) for item in value] if isinstance(value, list | tuple) else value


def _broken(word: re.Match[str]) -> str:
    joined = _LONG_PIECE.sub(lambda piece: piece.group().replace("_", f"_{BREAK}"), _JOINT.sub(BREAK, word.group()))
    return _NO_NAME.sub(_in_pieces, joined)


def _in_pieces(run: re.Match[str]) -> str:
    text = run.group()
    return BREAK.join(text[start : start + _PIECE] for start in range(0, len(text), _PIECE))


def in_font(character: str) -> str:
    """A character, or its code if the fonts lack it: an empty box would hide it."""
    code = ord(character)
    return character if code in _known_characters() else f"\\u{code:04x}" if code <= 0xFFFF else f"\\U{code:08x}"


def _fonts() -> Path:
    """The folder of matplotlib's fonts, which the plots use: typst includes no sans-serif font."""
    import matplotlib

    return Path(matplotlib.get_data_path()) / "fonts" / "ttf"


@lru_cache(maxsize=1)
def _known_characters() -> frozenset[int]:
    from matplotlib.ft2font import FT2Font

    return frozenset(FT2Font(str(_fonts() / "DejaVuSans.ttf")).get_charmap())


def _date(text: str) -> JsonDict | None:
    """The session's time for the file's metadata; None if it cannot be read."""
    try:
        time = datetime.fromisoformat(text)
    except ValueError:
        return None
    return {name: getattr(time, name) for name in ("year", "month", "day", "hour", "minute", "second")}
