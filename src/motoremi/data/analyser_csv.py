"""The CSV file that an E4990A (or a kin analyser of Agilent and Keysight) saves: `!` comments, BEGIN, names with units, rows, END."""

from __future__ import annotations

import re

from motoremi.data.source import split_lines
from motoremi.errors import BadInput

_MAKER = re.compile(r"!\s*(?:CSV\b|Agilent|Keysight|\"?Agilent|\"?Keysight)", re.IGNORECASE)
_BEGIN = re.compile(r"BEGIN\b", re.IGNORECASE)


def is_analyser_csv(text: str) -> bool:
    """Whether the first line is that of such a file."""
    return _MAKER.match(text.lstrip()) is not None


def plain_table(text: str, name: str) -> tuple[str, dict[str, str]]:
    """The same lines as a plain CSV table, and what the comments say of the analyser.

    Raises
    ------
    BadInput
        If the line END is missing, or the file holds several channels.
    """
    lines: list[str] = []
    channels = 0
    ended = False
    comments = []
    for number, raw in enumerate(split_lines(text), start=1):
        line = raw.strip()
        if line.startswith("!"):
            comments.append(line)
            lines.append("#" + line.lstrip("!"))
        elif _BEGIN.match(line):
            channels += 1
            if channels > 1:
                raise BadInput(f"{name}, line {number}: holds several channels; save one")
            lines.append("# ")
        elif line.upper() == "END":
            ended = True
            lines.append("# ")
        elif ended and line:
            raise BadInput(f"{name}, line {number}: more follows after END; save one channel and its data trace alone")
        else:
            lines.append(raw)
    if not ended:
        raise BadInput(f"{name}: the line END is missing; the file is cut off")
    known = {"analyser": "e4990a"} if any("E4990A" in comment.upper() for comment in comments) else {}
    return "\n".join(lines) + "\n", known
