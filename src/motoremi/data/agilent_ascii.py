"""The ASCII file that a 4294A saves: quoted header lines, then trace A and trace B below each other."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.data.analyser import specification
from motoremi.data.immittance import PAIRS, Pair
from motoremi.data.numbers import parse_number
from motoremi.data.rounding import rounding_of_pair, steps
from motoremi.data.text import clean_text
from motoremi.data.text_file import split_lines
from motoremi.errors import BadInput

# The words after MEASURE PARAMETER when the traces are R and X.
_R_AND_X = (
    {"R", "X"},
    {"IMPEDANCE", "R", "X"},
    {"RESISTANCE", "REACTANCE"},
    {"IMPEDANCE", "RESISTANCE", "REACTANCE"},
    {"IMPEDANCE", "REAL", "IMAG"},
)
# Quantities of other pairs, by their names in the analyser's menu MEASURE (Operation Manual); the spelling in files is unconfirmed.
_QUANTITIES = {
    "G": "conductance",
    "B": "susceptance",
    "Q": "quality_factor",
    "D": "dissipation_factor",
    "LS": "series_inductance",
    "CS": "series_capacitance",
    "RS": "series_resistance",
    "LP": "parallel_inductance",
    "CP": "parallel_capacitance",
    "RP": "parallel_resistance",
}
_VALUE_TITLE = "Data Trace Real"
# Names of adapters in the header, from the table on page 54 of the Programming Manual; the spelling in files is unconfirmed.
_ADAPTERS = {"1M": "1m", "2M": "2m", "42942": "42942a", "42941": "42941a"}
_SECOND_TITLE = "Data Trace Imag"


@dataclass
class _Trace:
    titles: list[str]
    rows: list[list[str]] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)


def is_agilent_ascii(text: str) -> bool:
    """Whether the first line is that of a 4294A file."""
    return text.lstrip().lstrip('"').startswith("4294A")


def parse_agilent_ascii(text: str, name: str) -> tuple[FloatArray, ComplexArray, FloatArray | None, JsonDict]:
    """Frequencies in hertz, impedance in ohm, the rounding of its numbers (`rounding_of`) and the header of a 4294A file.

    Raises
    ------
    BadInput
        If a trace is missing or cut off, or the traces hold anything but impedance against frequency.
    """
    header, traces = _sections(text, name)
    for letter in "AB":
        if letter not in traces:
            raise BadInput(f"{name}: trace {letter} is missing; save both traces (the file may be cut off)")
    points = header.get("NUMBER of POINTS", "")
    (frequency, first, unit), (frequency_b, second, unit_b) = (_values(traces[letter], letter, name) for letter in "AB")
    for letter, values in (("A", first), ("B", second)):
        if points.isdecimal() and int(points) != values.size:
            raise BadInput(f"{name}: the header says {points} points but trace {letter} has {values.size}; the file is cut off")
    if not np.array_equal(frequency, frequency_b):
        raise BadInput(f"{name}: traces A and B are not on the same frequencies; save both from one sweep")
    pair, factor = _pair(header.get("MEASURE PARAMETER", ""), name)
    if pair.first in ("magnitude", "admittance") and np.any(first < 0):
        raise BadInput(f"{name}: a magnitude is below 0")
    second, unit_b = second * factor, unit_b * factor
    with np.errstate(all="ignore"):
        impedance = pair.impedance(2 * np.pi * frequency, first, second)
    rounding = rounding_of_pair(pair, frequency, (first, unit), (second, unit_b), impedance)
    adapter = next((word for name_, word in _ADAPTERS.items() if name_ in header.get("ADAPTER", "").upper()), "")
    return frequency, impedance, rounding, {**header, "analyser": specification("4294a", adapter, ""), "read_as": pair.title}


def _sections(text: str, name: str) -> tuple[dict[str, str], dict[str, _Trace]]:
    header: dict[str, str] = {}
    traces: dict[str, _Trace] = {}
    letter = ""
    for number, raw in enumerate(split_lines(text), start=1):
        line = raw.strip()
        key, value = _header_entry(line)
        if key == "TRACE":
            letter = value
            if letter in traces:
                raise BadInput(f"{name}, line {number}: trace {letter} occurs twice; keep one")
        elif key and not letter:
            header[key] = value
        elif line.startswith('"Frequency"') and letter:
            traces[letter] = _Trace([cell.strip().strip('"') for cell in line.split("\t")])
        elif letter in traces and line and not key:
            cells = line.split("\t")
            expected = len(traces[letter].titles)
            if len(cells) != expected:
                raise BadInput(f"{name}, line {number}: {len(cells)} values for {expected} columns; the row or the file is cut off")
            traces[letter].rows.append(cells)
            traces[letter].lines.append(number)
    return header, traces


def _header_entry(line: str) -> tuple[str, str]:
    if len(line) < 2 or line[0] != '"' or line[-1] != '"':
        return "", ""
    key, colon, value = line[1:-1].partition(":")
    return (clean_text(key.strip(), 80), clean_text(value.strip(), 200)) if colon else ("", "")


def _values(trace: _Trace, letter: str, name: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Frequencies in hertz, values, and the unit of the last digit of each value."""
    if not {_VALUE_TITLE, _SECOND_TITLE} <= set(trace.titles):
        raise BadInput(f"{name}: trace {letter} has no column {_VALUE_TITLE!r} and {_SECOND_TITLE!r}; save the data trace")
    wanted = (0, trace.titles.index(_VALUE_TITLE), trace.titles.index(_SECOND_TITLE))
    numbers = np.array(
        [[parse_number(cells[column], f"{name}, line {line}") for column in wanted] for cells, line in zip(trace.rows, trace.lines, strict=True)]
    ).reshape(-1, 3)
    if np.any(numbers[:, 2]):
        raise BadInput(f"{name}: trace {letter} is complex; set the traces to |Z| and phase, or to R and X")
    return numbers[:, 0], numbers[:, 1], steps([cells[wanted[1]] for cells in trace.rows]) if trace.rows else numbers[:, 1]


def _pair(parameter: str, name: str) -> tuple[Pair, float]:
    """The quantities of traces A and B, and the factor of trace B: from radians to degrees, else 1."""
    words = set(re.findall(r"[A-Z]+", parameter.upper()))
    own = words - {"IMPEDANCE", "ADMITTANCE"}
    factor = 1.0
    if words in _R_AND_X:
        meanings = {"resistance", "reactance"}
    elif own in ({"MAG", "PHASE", "DEG"}, {"MAG", "PHASE", "RAD"}):
        meanings = {"admittance", "admittance_phase"} if "ADMITTANCE" in words else {"magnitude", "phase"}
        factor = float(np.rad2deg(1.0)) if "RAD" in own else 1.0
    else:
        meanings = {_QUANTITIES.get(word, word) for word in own}
    for pair in PAIRS:
        # Trace A holds the quantity that the menu, and a pair, names first.
        if {pair.first, pair.second} == meanings:
            return pair, factor
    raise BadInput(
        f"{name}: the traces hold {clean_text(parameter, 60)!r}; set them to impedance magnitude and phase, or to R and X, and save again"
    )
