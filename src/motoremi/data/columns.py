"""Recognise the columns of a table by name and unit, as people and instruments write them.

A title is the name of a quantity, then its unit, as in `R[mOhm]`, `Re{Z}/Ohm`, `|Z| in kOhm`, `Frequency (MHz)` or `resistance_ohm`.
The longest known name counts; blanks, brackets, `/`, `,`, `_`, `-` and the word `in` may stand between name and unit. Case matters for one
letter only: before ohm, `m` is milli and `M` is mega; a unit in capitals throughout (`MOHM`) could be either and is refused.
Before hertz both are mega, before all other units both are milli. A minus in front of the name, as in `-Im(Z)`, changes the sign.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass

from motoremi.data.table import Table
from motoremi.data.text import clean_text
from motoremi.errors import BadInput

_BETWEEN = r"\s()\[\]{}<>/\-_.,:;="
_SEPARATORS = re.compile(f"[{_BETWEEN}]+")
_BRACKETS = re.compile(r"[\s()\[\]{}<>]+")
# An E4990A marks its data traces with `-data`, and the memory traces that it keeps for comparison with `-mem`.
_TRACE_MARK = re.compile(r"[\s_\-]*\bdata$|_data$", re.IGNORECASE)
_MEMORY = re.compile(r"-mem\s*$", re.IGNORECASE)
# WaveForms and Bode Analyzer Suite begin titles with `Trace` and its number.
_TRACE_NUMBER = re.compile(r"^Trace(?:\s*[0-9]+)?\s*(?::|\s)\s*", re.IGNORECASE)
_MINUS = re.compile(r"^[-−–]\s*")
_LONGEST_TITLE = 80
_NAME_SPELLINGS = str.maketrans({"θ": "theta", "ϑ": "theta", "φ": "phi", "ϕ": "phi", "∠": "phase ", "’": "'", "′": "'", "″": "''"})
_UNIT_SPELLINGS = str.maketrans({"µ": "u", "μ": "u", "Ω": "ohm", "\u2126": "ohm", "ω": "ohm", "°": "deg", "º": "deg"})
_DECIBEL = re.compile(r"(?:^|_)db(?:[a-zµμ]*)(?:_|$)")

_PREFIXES = {
    1e-12: ("p", "pico"),
    1e-9: ("n", "nano"),
    1e-6: ("u", "micro"),
    1e-3: ("m", "milli"),
    1.0: ("",),
    1e3: ("k", "kilo", "kil"),
    1e6: ("M", "mega", "meg"),
    1e9: ("g", "giga", "gig"),
}


@dataclass(frozen=True)
class Column:
    """A column of a table, and the factor to its SI unit."""

    index: int
    factor: float


@dataclass(frozen=True)
class _Units:
    """The units of one kind of quantity: as shown in messages, and the factor of each."""

    shown: str
    factors: dict[str, float]

    def factor(self, text: str) -> float | None:
        """The factor of a unit as written, None if it is not known or ambiguous."""
        plain = _BRACKETS.sub("", text).strip(".").translate(_UNIT_SPELLINGS)
        if self.is_ambiguous(plain):
            return None
        lower = plain.lower()
        return self.factors.get(plain[:1] + lower[1:], self.factors.get(lower))

    def is_ambiguous(self, text: str) -> bool:
        """Whether it is written in capitals throughout, so that M may be milli or mega."""
        rest = text[1:].lower()
        return text.isupper() and text.startswith("M") and "m" + rest in self.factors and "M" + rest in self.factors


def _prefixed(shown: str, lowest: float, highest: float, *words: str) -> _Units:
    spellings = {spelling: size for size, names in _PREFIXES.items() if lowest <= size <= highest for spelling in names}
    if "m" not in spellings and "M" in spellings:
        spellings["m"] = spellings.pop("M")
    return _Units(shown, {spelling + word: size for spelling, size in spellings.items() for word in words})


_HERTZ = _prefixed("Hz, kHz, MHz or GHz", 1.0, 1e9, "hz", "hertz")
_OHM = _prefixed("uOhm, mOhm, Ohm, kOhm or MOhm", 1e-9, 1e9, "ohm", "ohms")
_SIEMENS = _prefixed("nS, uS, mS or S", 1e-12, 1.0, "s", "siemens", "mho")
_HENRY = _prefixed("nH, uH, mH or H", 1e-12, 1.0, "h", "henry")
_FARAD = _prefixed("pF, nF, uF or F", 1e-12, 1.0, "f", "farad")
_ANGLE = _Units(
    "deg or rad",
    {**dict.fromkeys(("deg", "degree", "degrees"), 1.0), **dict.fromkeys(("rad", "radian", "radians"), 180 / math.pi), "mrad": 0.18 / math.pi},
)
_DBUV = _Units("dBuV", {"dbuv": 1.0})
_DBM = _Units("dBm", {"dbm": 1.0})
_NUMBER = _Units("no unit", {"": 1.0})


@dataclass(frozen=True)
class _Quantity:
    meaning: str
    units: _Units
    names: tuple[str, ...]


def _part(symbol: str, *words: str) -> tuple[str, ...]:
    """Names of a part of a quantity: `re_z`, `z_re` and so on."""
    return tuple(name for word in words for name in (f"{word}_{symbol}", f"{symbol}_{word}", f"{symbol}{word}"))


_REAL = ("re", "real")
_IMAGINARY = ("im", "imag", "imaginary")
_MAGNITUDE = ("abs", "mag", "magnitude", "modulus")
_PHASE = ("phase", "theta", "arg", "angle", "phi")
_LEVEL = ("level", "amplitude", "power")
_QUANTITIES = (
    _Quantity("frequency", _HERTZ, ("frequency", "freq", "f", "frequenz")),
    _Quantity("resistance", _OHM, ("resistance", "r", *_REAL, "z'", *_part("z", *_REAL))),
    _Quantity("reactance", _OHM, ("reactance", "x", "xs", *_IMAGINARY, "z''", *_part("z", *_IMAGINARY))),
    _Quantity("magnitude", _OHM, ("impedance", "z", "|z|", "magnitude", "impedance_magnitude", "impedanz_betrag", *_part("z", *_MAGNITUDE))),
    _Quantity("phase", _ANGLE, (*_PHASE, "phase_angle", "impedance_phase", "impedanz_phase", *_part("z", *_PHASE))),
    _Quantity("conductance", _SIEMENS, ("conductance", "g", "gp", *_part("y", *_REAL))),
    _Quantity("susceptance", _SIEMENS, ("susceptance", "b", "bp", *_part("y", *_IMAGINARY))),
    _Quantity("admittance", _SIEMENS, ("admittance", "y", "|y|", "admittance_magnitude", *_part("y", *_MAGNITUDE))),
    _Quantity("admittance_phase", _ANGLE, ("admittance_phase", *_part("y", *_PHASE))),
    _Quantity("series_inductance", _HENRY, ("ls", "series_inductance")),
    _Quantity("parallel_inductance", _HENRY, ("lp", "parallel_inductance")),
    _Quantity("series_capacitance", _FARAD, ("cs", "series_capacitance")),
    _Quantity("parallel_capacitance", _FARAD, ("cp", "parallel_capacitance")),
    _Quantity("series_resistance", _OHM, ("rs", "esr", "series_resistance")),
    _Quantity("parallel_resistance", _OHM, ("rp", "parallel_resistance")),
    _Quantity("dissipation_factor", _NUMBER, ("d", "dissipation_factor", "tan_delta")),
    _Quantity("quality_factor", _NUMBER, ("q", "quality_factor")),
    _Quantity("s11", _NUMBER, ("s11",)),
    _Quantity("s11_real", _NUMBER, _part("s11", *_REAL)),
    _Quantity("s11_imag", _NUMBER, _part("s11", *_IMAGINARY)),
    _Quantity("level", _DBUV, _LEVEL),
    _Quantity("level_dbm", _DBM, _LEVEL),
    _Quantity("level_dbm", _NUMBER, ("dbm",)),
    # Columns named after a detector, as written by receiver software.
    _Quantity("level peak", _DBUV, ("peak", "max_peak", "maxpeak", "pk")),
    _Quantity("level quasi-peak", _DBUV, ("quasi_peak", "quasipeak", "qp", "qpk")),
    _Quantity("level average", _DBUV, ("average", "avg", "av")),
    _Quantity("level cispr-average", _DBUV, ("cispr_average", "caverage", "cav", "cispr_av")),
    _Quantity("level rms-average", _DBUV, ("rms_average", "cispr_rms", "crms", "rms_avg")),
    _Quantity("sigma_relative", _NUMBER, ("sigma_relative",)),
    _Quantity("overload", _NUMBER, ("overload",)),
)
# Names of quantities that a column of complex numbers may hold, and the titles of their parts.
_PARTS = {
    **dict.fromkeys(("z", "impedance"), ("Re(Z)", "Im(Z)")),
    **dict.fromkeys(("y", "admittance"), ("Re(Y)", "Im(Y)")),
    "s11": ("S11_real", "S11_imag"),
}
_BY_NAME = {name: [one for one in _QUANTITIES if name in one.names] for quantity in _QUANTITIES for name in quantity.names}


@dataclass(frozen=True)
class _Title:
    """A title with a known name, the quantities it may stand for, its unit as written, and the sign (1 or -1)."""

    name: str
    quantities: list[_Quantity]
    unit: str
    sign: float

    def interpreted(self) -> tuple[str, float] | None:
        """Meaning and factor; None if the unit is not known."""
        for quantity in self.quantities:
            factor = quantity.units.factor(self.unit)
            if factor is not None:
                return quantity.meaning, self.sign * factor
        return None

    @property
    def units_shown(self) -> str:
        return " or ".join(quantity.units.shown for quantity in self.quantities)


def _normal(text: str) -> str:
    """One spelling for many: `Re(Z)`, `re{z}` and `Re_Z` are the same name."""
    return _SEPARATORS.sub("_", text.lower().translate(_NAME_SPELLINGS)).strip("_")


def _title(title: str) -> _Title | None:
    """A title split into name and unit; None if it begins with no known name or is that of a memory trace."""
    if len(title) > _LONGEST_TITLE or _MEMORY.search(title):
        return None
    whole = _TRACE_NUMBER.sub("", _TRACE_MARK.sub("", title.strip()))
    text = _MINUS.sub("", whole)
    cuts = [len(text), *(mark.start() for mark in reversed(list(_SEPARATORS.finditer(text))))]
    for cut in cuts:
        name = _normal(text[:cut])
        if quantities := _BY_NAME.get(name):
            unit = re.sub(r"^in\s+", "", text[cut:].strip(" \t()[]{}<>/-_.,:;="))
            return _Title(name, quantities, unit, 1.0 if text == whole else -1.0)
    return None


def find_columns(table: Table) -> dict[str, Column]:
    """The columns whose meaning and unit are known.

    Raises
    ------
    BadInput
        If two columns mean the same.
    """
    found: dict[str, Column] = {}
    for index, title in enumerate(table.columns):
        known = _title(title)
        interpreted = known.interpreted() if known else None
        if interpreted is None:
            continue
        meaning, factor = interpreted
        if meaning in found:
            first = clean_text(table.columns[found[meaning].index], 40)
            raise BadInput(f"{table.name}: the columns {first!r} and {clean_text(title, 40)!r} both hold the {meaning}; keep one")
        found[meaning] = Column(index, factor)
    return found


def meanings_of(title: str) -> tuple[str, ...]:
    """What a column may hold by its name, whatever its unit; empty if the name is not known."""
    known = _title(title)
    return tuple(quantity.meaning for quantity in known.quantities) if known else ()


def complex_titles(title: str) -> tuple[str, str] | None:
    """Titles for the real and the imaginary part of a column of complex numbers, with its unit; None if its name is not known."""
    known = _title(title)
    if known is None or known.name not in _PARTS or (known.unit and known.quantities[0].units is _NUMBER):
        return None
    minus = "-" if known.sign < 0 else ""
    real, imaginary = _PARTS[known.name]
    return f"{minus}{real} {known.unit}".strip(), f"{minus}{imaginary} {known.unit}".strip()


def unit_trouble(table: Table) -> str:
    """Why columns with a known name cannot be used, in words; empty if there is no such column.

    All are named: ambiguous units first, then unknown ones, then missing ones. Decibels are left to `has_decibels`.
    """
    unitless: dict[str, list[str]] = {}
    for title, known in _without_unit(table):
        if not known.unit:
            unitless.setdefault(known.units_shown, []).append(repr(clean_text(title, 40)))
    missing = [
        f"the column{'s' if len(titles) > 1 else ''} {', '.join(titles)} {'have' if len(titles) > 1 else 'has'} no unit: add {units}"
        for units, titles in unitless.items()
    ]
    return "; ".join([*(text for _, text in sorted(_unusable_units(table))), *missing])


def _without_unit(table: Table) -> Iterator[tuple[str, _Title]]:
    """The titles with a known name and without a known unit."""
    for title in table.columns:
        known = _title(title)
        # Of several words behind the name, as in `R of the lead`, none is meant as its unit.
        if known is None or known.interpreted() or re.search(r"[\s_]", known.unit) or known.unit.lower().startswith("db"):
            continue
        # A quantity without unit, such as S11, has none that could be wrong: the word belongs to the name.
        if any(quantity.units is not _NUMBER for quantity in known.quantities):
            yield title, known


def _unusable_units(table: Table) -> Iterator[tuple[int, str]]:
    for title, known in _without_unit(table):
        shown, unit = clean_text(title, 40), clean_text(known.unit, 40)
        if any(quantity.units.is_ambiguous(known.unit) for quantity in known.quantities):
            yield 0, f"the unit {unit!r} of column {shown!r} may be milli or mega: write mOhm or MOhm"
        elif unit:
            yield 1, f"the unit {unit!r} of column {shown!r} is not known: use {known.units_shown}"


def has_decibels(table: Table) -> bool:
    """Whether any column name carries a unit in decibel."""
    return any(_DECIBEL.search(_normal(title)) for title in table.columns)


def columns_found(table: Table) -> str:
    """The column names for a message."""
    return clean_text(", ".join(table.columns), 200)
