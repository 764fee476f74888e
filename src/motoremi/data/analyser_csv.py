"""The CSV file that an E4990A (or a related analyser of Agilent and Keysight) saves: `!` comments, BEGIN, names with units, rows, END.

Between BEGIN and the names there may be a title (`Title label, TEXT`) and the bias as monitored (`DCV(V), 0.1, DCI(A), 0.001`).
"""

from __future__ import annotations

import re

from motoremi.arrays import JsonDict
from motoremi.data.numbers import looks_numeric, parse_number
from motoremi.data.text import clean_text
from motoremi.data.text_file import split_lines
from motoremi.errors import BadInput

_MAKER = re.compile(r"!\s*(?:CSV\b|Agilent|Keysight|\"?Agilent|\"?Keysight)", re.IGNORECASE)
_BEGIN = re.compile(r"BEGIN\b", re.IGNORECASE)
_BIAS = re.compile(r"DC[VI]\([AV]\)", re.IGNORECASE)


def is_analyser_csv(text: str) -> bool:
    """Whether the first line is that of such a file."""
    return _MAKER.match(text.lstrip()) is not None


def plain_table(text: str, name: str) -> tuple[str, JsonDict]:
    """The same lines as a plain CSV table, and what the lines above the names contain: the analyser, a title, the bias.

    Raises
    ------
    BadInput
        If the line END is missing, or the file holds several channels.
    """
    lines: list[str] = []
    known: JsonDict = {}
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
        elif block := _block_line(line, f"{name}, line {number}"):
            known.update(block)
            lines.append("# ")
        else:
            lines.append(raw)
    if not ended:
        raise BadInput(f"{name}: the line END is missing; the file is cut off")
    if any("E4990A" in comment.upper() for comment in comments):
        known["analyser"] = "e4990a"
    return "\n".join(lines) + "\n", known


def _block_line(line: str, where: str) -> JsonDict:
    """The entries of a line between BEGIN and the names; empty for the names themselves and for rows."""
    first, _, rest = line.partition(",")
    if first.strip().strip('"').lower() == "title label":
        return {"Title label": clean_text(rest.strip().strip('"'), 200)}
    cells = [cell.strip() for cell in line.split(",")]
    names, values = cells[::2], cells[1::2]
    if not all(_BIAS.fullmatch(title) for title in names) or len(names) != len(values) or not all(map(looks_numeric, values)):
        return {}
    return {clean_text(title): parse_number(value, where) for title, value in zip(names, values, strict=True)}
