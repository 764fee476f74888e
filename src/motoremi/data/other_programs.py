"""Tables of programs that write them in a form of their own: RigExpert AntScope (.asd), LTspice (exported text), ZView (.z), and `.zma`.

The first three layouts are UNCONFIRMED: they are those of descriptions, no file of these programs was at hand.
"""

from __future__ import annotations

import re

from motoremi.data.numbers import looks_numeric, parse_number
from motoremi.data.plain import object_from_json
from motoremi.data.table import Table, parse_table
from motoremi.data.text import clean_text
from motoremi.data.text_file import split_lines
from motoremi.errors import BadInput

_RECTANGULAR = ("frequency [Hz]", "R [Ohm]", "X [Ohm]")
_POLAR = ("frequency [Hz]", "|Z| [Ohm]", "phase [deg]")
# A voltage over a current, in ohm.
_RATIO = re.compile(r"-?V\([^)]*\)\s*/\s*-?I[a-z]?\([^)]*\)", re.IGNORECASE)
_DECIBELS = re.compile(r"\((?P<db>[^,]+)dB,(?P<phase>[^,]+)°\)")
_END_OF_COMMENTS = re.compile(r"^\s*End Comments\s*$", re.IGNORECASE | re.MULTILINE)
# Above the numbers of a .zma file; none of its lines has to name the columns.
_ZMA_COMMENTS = ("*", '"', ";", "#")
# ZView writes no unit for impedances, which are in ohm.
_ZVIEW_NAMES = {"Z'(a)": "Z' [Ohm]", "Z''(b)": "Z'' [Ohm]"}


def table_of_other_program(text: str, name: str) -> tuple[Table, str] | None:
    """The table in the file of such a program, and the name of its format; None for another file.

    Raises
    ------
    BadInput
        If the file is damaged, it is not known which of its traces is an impedance, or it has to be exported first (Qucs).
    """
    begin = text[:2000].lstrip()
    if begin.startswith("<Qucs Dataset"):
        raise BadInput(f"{name}: a dataset of Qucs is not read; export the impedance from Qucs as CSV, or S11 as Touchstone")
    if begin.startswith("{") and '"Measurements"' in begin:
        return _rigexpert(text, name), "rigexpert-asd"
    if begin.startswith("Freq.\t"):
        return _ltspice(text, name), "ltspice-text"
    if _END_OF_COMMENTS.search(text) and any(title in text for title in _ZVIEW_NAMES):
        for title, plain in _ZVIEW_NAMES.items():
            text = text.replace(title, plain)
        return parse_table(_END_OF_COMMENTS.sub("", text), name), "zview"
    if name.lower().endswith(".zma"):
        return _zma(text, name), "zma"
    return None


def _zma(text: str, name: str) -> Table:
    """Comments, then frequency in hertz, |Z| in ohm and phase in degrees, as programs for loudspeakers write it (Speakerbench, file formats).

    They measure with a sound card up to some 20 kHz, which shows the inductance and the iron losses of a small motor.
    """
    lines = split_lines(text)
    rows = [(number, line.replace(",", " ").split()) for number, line in enumerate(lines, start=1)]
    points = [(number, cells) for number, cells in rows if cells and not cells[0].startswith(_ZMA_COMMENTS)]
    for number, cells in points:
        if len(cells) != len(_POLAR) or not all(map(looks_numeric, cells)):
            raise BadInput(f"{name}, line {number}: three numbers are needed, frequency in Hz, |Z| in ohm and phase in degrees (.zma)")
    return Table(name, {}, _POLAR, [cells for _, cells in points], [number for number, _ in points])


def _rigexpert(text: str, name: str) -> Table:
    """`{"Measurements": [{"fq": 1.8, "r": 31.2, "x": -104.5}, ...]}` with frequencies in megahertz; a point counts as a line."""
    try:
        points = object_from_json(text)["Measurements"]
        rows = [[point[key] for key in ("fq", "r", "x")] for point in points]
    except (ValueError, KeyError, TypeError) as error:
        raise BadInput(f"{name}: an .asd file in which points with fq, r and x are missing or cut off; save it again") from error
    cells = [[repr(value) if type(value) in (int, float) else str(value) for value in row] for row in rows]
    return Table(name, {}, ("frequency [MHz]", *_RECTANGULAR[1:]), cells, list(range(1, len(cells) + 1)))


def _ltspice(text: str, name: str) -> Table:
    """A line of names, then a frequency and a complex number for each trace: `1.5e5<tab>10.5,-2283` or `1.5e5<tab>(67.2dB,-89.7°)`."""
    lines = split_lines(text)
    first = next(number for number, line in enumerate(lines) if line.strip())
    titles = [title.strip() for title in lines[first].split("\t")]
    ratios = [place for place, title in enumerate(titles) if _RATIO.fullmatch(title)]
    if len(ratios) != 1:
        shown = clean_text(", ".join(titles[1:]), 80)
        raise BadInput(f"{name}: holds the traces {shown}; export one trace that is an impedance, such as V(x)/I(V1)")
    rows: list[list[str]] = []
    numbers: list[int] = []
    columns = _RECTANGULAR
    for number, line in enumerate(lines[first + 1 :], start=first + 2):
        if not line.strip():
            continue
        where = f"{name}, line {number}"
        cells = [cell.strip() for cell in line.split("\t")]
        if len(cells) != len(titles):
            raise BadInput(f"{where}: {len(cells)} values for {len(titles)} traces; export one step only (the file may be cut off)")
        value = cells[ratios[0]]
        if polar := _DECIBELS.fullmatch(value):
            parts = [repr(10 ** (parse_number(polar["db"], where) / 20)), polar["phase"].strip()]
        else:
            parts = [part.strip() for part in value.split(",")]
        if len(parts) != 2 or not all(map(looks_numeric, parts)):
            raise BadInput(f"{where}: {clean_text(value, 40)!r} is not a complex number")
        if rows and (columns == _POLAR) != bool(polar):
            raise BadInput(f"{where}: {clean_text(value, 40)!r} is written otherwise than the numbers above it")
        columns = _POLAR if polar else _RECTANGULAR
        rows.append([cells[0], *parts])
        numbers.append(number)
    return Table(name, {}, columns, rows, numbers)
