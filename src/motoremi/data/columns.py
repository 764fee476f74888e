"""Recognise the columns of a table by name and unit, as people and instruments write them.

A title is the name of a quantity, then its unit, as in `R[mOhm]`, `Re{Z}/Ohm`, `|Z| in kOhm`, `Frequency (MHz)` or `resistance_ohm`.
The longest known name counts; blanks, brackets, `/`, `,`, `_`, `-` and the word `in` may stand between name and unit (`units`). A minus in front
of the name, as in `-Im(Z)`, changes the sign. Some names are German, French, Spanish or Italian; accents do not matter.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from motoremi.data.detectors import SPELLINGS, detector_in_title
from motoremi.data.table import Table
from motoremi.data.text import clean_text, without_accents
from motoremi.data.units import ANGLE, DBM, DBUV, FARAD, HENRY, HERTZ, NUMBER, OHM, SIEMENS, Units
from motoremi.errors import BadInput

_BETWEEN = r"\s()\[\]{}<>/\-_.,:;="
_SEPARATORS = re.compile(f"[{_BETWEEN}]+")
# An E4990A marks its data traces with `-data`, and the memory traces that it keeps for comparison with `-mem`.
_TRACE_MARK = re.compile(r"[\s_\-]*\bdata$|_data$", re.IGNORECASE)
_MEMORY = re.compile(r"-mem\s*$", re.IGNORECASE)
# WaveForms and Bode Analyzer Suite begin titles with `Trace` or `TR` and its number, Keysight analysers with its letter.
_TRACE_NUMBER = re.compile(r"^(?:Trace(?:\s*[0-9]+|\s+[A-D](?=[\s:]))?\s*(?::|\s)|TR[0-9]\s*:)\s*", re.IGNORECASE)
# The two parameters of an LCR meter, and a trace of a ZNB such as `re:Trc1_S11` or `re:Trc1_Z<-S11`.
_PLACE = re.compile(r"^(?:Primary|Secondary)\s+(?=\S)", re.IGNORECASE)
_ZNB_TRACE = re.compile(r"^(re|im|mag|db|ang)\s*:\s*Trc[0-9]+_([^<\s]+)(?:<-S11)?", re.IGNORECASE)
_MINUS = re.compile(r"^[-−–]\s*")
# The detector of the lowest levels; without its minus it would be that of the highest.
_NEGATIVE_PEAK = re.compile(r"\bpk-(?=$|[\s_(\[])", re.IGNORECASE)
# Words before the first name.
_DESCRIBED = re.compile(r"^.*(?::|\s[-–—])\s+")
_LONGEST_TITLE = 80
# With this begins what the metadata say of units that the user gives.
UNITS_GIVEN = "units as given: "
_NAME_SPELLINGS = str.maketrans({"θ": "theta", "ϑ": "theta", "φ": "phi", "ϕ": "phi", "∠": "phase ", "’": "'", "′": "'", "″": "''"})
_MICRO = str.maketrans("µμ", "uu")
_DECIBEL = re.compile(r"(?:^|_)db(?:[a-zµμωΩ]*)(?:_|$)")
# A unit of levels at the end of a title: dBm, dBuV, dB(uA), dBuV/m.
_LEVEL_UNIT = re.compile(r"(?:^|_)db(m|_?[nuµμmp]?[vaw](?:_m)?)$")


@dataclass(frozen=True)
class Column:
    """A column of a table, and the factor to its SI unit."""

    index: int
    factor: float


@dataclass(frozen=True)
class _Quantity:
    meaning: str
    units: Units
    names: tuple[str, ...]


def _part(symbols: str | Sequence[str], *words: str) -> tuple[str, ...]:
    """Names of a part of a quantity: `re_z`, `rez`, `z_re` and so on."""
    every = (symbols,) if isinstance(symbols, str) else symbols
    return tuple(
        name for symbol in every for word in words for name in (f"{word}_{symbol}", f"{word}{symbol}", f"{symbol}_{word}", f"{symbol}{word}")
    )


_REAL = ("re", "real", "real_part", "realteil", "reelle", "reale")
_IMAGINARY = ("im", "imag", "imaginary", "imaginary_part", "imaginarteil", "imaginaire", "imaginaria", "immaginaria")
_MAGNITUDE = ("abs", "absolute", "absolut", "mag", "magnitude", "modulus", "betrag", "module", "modulo")
_PHASE = ("phase", "theta", "arg", "angle", "phi", "fase", "phasenwinkel")
_IMPEDANCE = ("impedance", "impedanz", "scheinwiderstand", "impedancia", "impedenza")
_RESISTANCE = ("resistance", "resistanz", "wirkwiderstand", "resistencia", "resistenza")
_REACTANCE = ("reactance", "reaktanz", "blindwiderstand", "reactancia", "reattanza")
_FREQUENCY = ("frequency", "freq", "f", "frequenz", "frequence", "frecuencia", "frequenza")
_LEVEL = ("level", "amplitude", "power", "pegel")
_Z, _Y = ("z", *_IMPEDANCE), ("y", "admittance")
_S11 = ("s11", "reflection", "reflection_coefficient")
# Names of a phase that say that it is that of Z.
_PHASE_OF_Z = ("zphz", *_part(_Z, *_PHASE))
_S11_MAGNITUDE = ("|s11|", *_part(_S11, *_MAGNITUDE))
# Meanings beside which a phase without a further name is that of the reflection.
REFLECTION_SIZES = {"reflection_db", "return_loss", "reflection_magnitude"}
_QUANTITIES = (
    _Quantity("frequency", HERTZ, _FREQUENCY),
    _Quantity("resistance", OHM, (*_RESISTANCE, "r", *_REAL, "z'", *_part(_Z, *_REAL))),
    _Quantity("reactance", OHM, (*_REACTANCE, "x", "xs", *_IMAGINARY, "z''", *_part(_Z, "xs", *_IMAGINARY))),
    _Quantity("magnitude", OHM, (*_Z, "|z|", "zmod", *(name for name in _MAGNITUDE if not name.startswith("abs")), *_part(_Z, *_MAGNITUDE))),
    # Some LCR meters write the unit behind the symbol, `θr` and `θd`.
    _Quantity("phase", ANGLE, (*_PHASE, "ph", "th", "phase_angle", "thetar", "thetad", *_PHASE_OF_Z)),
    _Quantity("conductance", SIEMENS, ("conductance", "g", "gp", *_part(_Y, *_REAL))),
    _Quantity("susceptance", SIEMENS, ("susceptance", "b", "bp", *_part(_Y, *_IMAGINARY))),
    _Quantity("admittance", SIEMENS, (*_Y, "|y|", *_part(_Y, *_MAGNITUDE))),
    _Quantity("admittance_phase", ANGLE, _part(_Y, *_PHASE)),
    _Quantity("series_inductance", HENRY, ("ls", "series_inductance", *_part(_Z, "ls"))),
    _Quantity("parallel_inductance", HENRY, ("lp", "parallel_inductance", *_part(_Z, "lp"))),
    _Quantity("series_capacitance", FARAD, ("cs", "series_capacitance", *_part(_Z, "cs"))),
    _Quantity("parallel_capacitance", FARAD, ("cp", "parallel_capacitance", *_part(_Z, "cp"))),
    _Quantity("series_resistance", OHM, ("rs", "esr", "series_resistance", *_part(_Z, "rs"))),
    _Quantity("parallel_resistance", OHM, ("rp", "parallel_resistance", *_part(_Z, "rp"))),
    _Quantity("dissipation_factor", NUMBER, ("d", "dissipation_factor", "tan_delta")),
    _Quantity("quality_factor", NUMBER, ("q", "quality_factor")),
    _Quantity("s11", NUMBER, ("s11",)),
    _Quantity("s11_real", NUMBER, _part(_S11, *_REAL)),
    _Quantity("s11_imag", NUMBER, _part(_S11, *_IMAGINARY)),
    _Quantity("reflection_magnitude", NUMBER, _S11_MAGNITUDE),
    _Quantity("reflection_db", NUMBER, (*_part(_S11, "db"), *(f"{name}_db" for name in (*_S11_MAGNITUDE, "s11_log_mag")))),
    _Quantity("return_loss", NUMBER, ("return_loss", "return_loss_db", "rl_db")),
    _Quantity("reflection_phase", ANGLE, ("s11", "return_phase", *_part(_S11, *_PHASE, "ang"))),
    _Quantity("level", DBUV, _LEVEL),
    _Quantity("level_dbm", DBM, _LEVEL),
    _Quantity("level_dbm", NUMBER, ("dbm",)),
    # Columns named after a detector; `detector_in_title` knows the spellings.
    *(_Quantity(f"level {detector}", DBUV, (detector,)) for detector in SPELLINGS),
    *(_Quantity(f"level_dbm {detector}", DBM, (detector,)) for detector in SPELLINGS),
    _Quantity("sigma_relative", NUMBER, ("sigma_relative",)),
    _Quantity("rounding_relative", NUMBER, ("rounding_relative",)),
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
    return _SEPARATORS.sub("_", without_accents(text.lower().translate(_NAME_SPELLINGS))).strip("_")


def _title(title: str) -> _Title | None:
    """A title split into name and unit; None if it begins with no known name or is that of a memory trace or of the negative peak."""
    if len(title) > _LONGEST_TITLE or _MEMORY.search(title) or _NEGATIVE_PEAK.search(title):
        return None
    whole = _PLACE.sub("", _TRACE_NUMBER.sub("", _TRACE_MARK.sub("", title.strip())))
    whole = _ZNB_TRACE.sub(r"\1 \2", whole)
    text = _MINUS.sub("", whole)
    cuts = [len(text), *(mark.start() for mark in reversed(list(_SEPARATORS.finditer(text))))]
    for cut in cuts:
        name = _normal(text[:cut])
        if quantities := _BY_NAME.get(detector_in_title(name) or name):
            unit = re.sub(r"^in\s+", "", text[cut:].strip(" \t()[]{}<>/-_.,:;="))
            return _Title(name, quantities, unit, 1.0 if text == whole else -1.0)
    return None


def find_columns(table: Table) -> dict[str, Column]:
    """The columns whose meaning and unit are known.

    A phase without a further name belongs to the magnitude beside it: to S11 or return loss, else to |Z|, else to |Y|. `theta` is the usual name of
    the phase of Z, and belongs to S11 or |Y| only without |Z|.

    Of columns with the same meaning and cells that are two traces, or one trace twice as an analyser saves what it shows, the first is used.

    Raises
    ------
    BadInput
        If two columns mean the same.
    """
    found: dict[str, Column] = {}
    titles = [_title(title) for title in table.columns]
    interpretations = [known.interpreted() if known else None for known in titles]
    meanings = {one[0] for one in interpretations if one}
    reflects = bool(meanings & REFLECTION_SIZES) and "reflection_phase" not in meanings
    for index, (title, known, interpreted) in enumerate(zip(table.columns, titles, interpretations, strict=True)):
        if known is None or interpreted is None:
            continue
        meaning, factor = interpreted
        if meaning == "phase" and reflects and known.name in (*_PHASE, "ph") and known.name != "theta":
            meaning = "reflection_phase"
        if meaning in found:
            if _is_copy(table, found[meaning], Column(index, factor)):
                continue
            first = clean_text(table.columns[found[meaning].index], 40)
            raise BadInput(f"{table.name}: the columns {first!r} and {clean_text(title, 40)!r} both hold the {meaning}; keep one")
        found[meaning] = Column(index, factor)
    if "phase" in found and "magnitude" not in found:
        phase = found["phase"]
        named = titles[phase.index]
        of_z = named is not None and named.name in _PHASE_OF_Z
        if reflects and "reflection_phase" not in found and not of_z:
            found["reflection_phase"] = found.pop("phase")
        elif "admittance" in found and "admittance_phase" not in found:
            # The phase of Y is that of Z with the other sign.
            found["admittance_phase"] = Column(phase.index, -phase.factor if of_z else phase.factor)
            del found["phase"]
    return found


def _is_copy(table: Table, first: Column, second: Column) -> bool:
    titles = [table.columns[column.index].strip() for column in (first, second)]
    # The title of a trace is the analyser's; the same one of a table that somebody made twice may have been meant for another column.
    traces = titles[0] != titles[1] or _TRACE_NUMBER.match(titles[0]) is not None
    return traces and first.factor == second.factor and all(cells[first.index] == cells[second.index] for cells in table.rows)


def meanings_of(title: str) -> tuple[str, ...]:
    """What a column may hold by its name, whatever its unit; empty if the name is not known."""
    known = _title(title)
    return tuple(quantity.meaning for quantity in known.quantities) if known else ()


def complex_titles(title: str) -> tuple[str, str] | None:
    """Titles for the real and the imaginary part of a column of complex numbers, with its unit; None if its name is not known."""
    known = _title(title)
    if known is None or known.name not in _PARTS or (known.unit and known.quantities[0].units is NUMBER):
        return None
    minus = "-" if known.sign < 0 else ""
    real, imaginary = _PARTS[known.name]
    return f"{minus}{real} {known.unit}".strip(), f"{minus}{imaginary} {known.unit}".strip()


def without_description(table: Table) -> Table:
    """The table without words that stand before the first name and end with a colon or a dash, as in `# Coil of 5 uH - f, Re(Z), Im(Z)`."""
    first, *others = table.columns
    rest = _DESCRIBED.sub("", first)
    known = bool(meanings_of(rest)) and not meanings_of(first)
    return replace(table, columns=(rest, *others)) if known else table


def with_units(table: Table, units: Mapping[str, str]) -> tuple[Table, tuple[str, ...]]:
    """The table with the units that the user gives for columns by name, and what was given in words; other names are of other files."""
    given = {name.strip().lower(): unit for name, unit in units.items()}
    wanted = [given.get(title.strip().lower(), "") for title in table.columns]
    titles = tuple(f"{title} [{unit}]" if unit else title for title, unit in zip(table.columns, wanted, strict=True))
    stated = ", ".join(f"{clean_text(title, 40)} in {clean_text(unit, 40)}" for title, unit in zip(table.columns, wanted, strict=True) if unit)
    return replace(table, columns=titles), (f"{UNITS_GIVEN}{stated}",) if stated else ()


def unit_trouble(table: Table) -> str:
    """Why columns with a known name cannot be used, in words; empty if there is no such column.

    All are named: ambiguous units first, then unknown ones, then missing ones. Decibels are left to `has_decibels`.
    """
    without = [(title, known) for title, known in _without_unit(table) if not known.unit]
    unitless: dict[str, list[str]] = {}
    for title, known in without:
        unitless.setdefault(known.units_shown, []).append(repr(clean_text(title, 40)))
    missing = [
        f"the column{'s' if len(titles) > 1 else ''} {', '.join(titles)} {'have' if len(titles) > 1 else 'has'} no unit: add {units}"
        for units, titles in unitless.items()
    ]
    if missing:
        given = " ".join(f"--unit {shlex.quote(f'{clean_text(title, 40)}={known.quantities[0].units.base}')}" for title, known in without)
        missing.append(f"or tell the units to motoremi import, for example {given}")
    return "; ".join([*(text for _, text in sorted(_unusable_units(table))), *missing])


def _without_unit(table: Table) -> Iterator[tuple[str, _Title]]:
    """The titles with a known name and without a known unit."""
    for title in table.columns:
        known = _title(title)
        # Of several words behind the name, as in `R of the lead`, none is meant as its unit.
        if known is None or known.interpreted() or re.search(r"[\s_]", known.unit) or known.unit.lower().startswith("db"):
            continue
        # A quantity without unit, such as S11, has none that could be wrong: the word belongs to the name.
        if all(quantity.units is not NUMBER for quantity in known.quantities):
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


def level_unit(title: str) -> str:
    """The unit of levels at the end of a title, in lower case as in `dbuv` or `dbuv/m`; empty if there is none."""
    found = _LEVEL_UNIT.search(_normal(title))
    return "" if found is None else "db" + found[1].lstrip("_").replace("_", "/").translate(_MICRO)


def holds_levels(title: str) -> bool:
    """Whether a column has a unit of levels, or the name of one without any unit."""
    known = _title(title)
    named = known is not None and not known.unit and known.quantities[0].meaning.startswith("level")
    return named or bool(level_unit(title))


def columns_found(table: Table) -> str:
    """The column names for a message."""
    return clean_text(", ".join(table.columns), 200)


def not_understood(table: Table) -> str:
    """The column names that are not known, for a message; empty if there are none, or no other."""
    unknown = [repr(clean_text(title, 40)) for title in table.columns if title.strip() and not meanings_of(title)]
    return f"not understood: {', '.join(unknown)}" if 0 < len(unknown) < len(table.columns) else ""
