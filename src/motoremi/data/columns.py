"""Which column holds what: names and units as people and instruments write them."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from motoremi.data.table import Table
from motoremi.data.text import clean_text
from motoremi.errors import BadInput

_SEPARATORS = re.compile(r"[\s()\[\]/\-_.,:]+")
_SPELLINGS = (("µ", "u"), ("μ", "u"), ("ω", "ohm"), ("ohms", "ohm"), ("degrees", "deg"), ("degree", "deg"), ("°", "deg"))

_FREQUENCY = ("frequency", "freq", "f")
_RESISTANCE = ("resistance", "r", "z_re", "zre", "re_z", "z_real", "real_z", "re", "real")
_REACTANCE = ("reactance", "x", "xs", "z_im", "zim", "im_z", "z_imag", "imag_z", "im", "imag")
_MAGNITUDE = ("impedance", "z", "|z|", "z_abs", "abs_z", "z_mag", "mag_z", "zmag", "magnitude", "impedance_magnitude")
_PHASE = ("phase", "theta", "theta_z", "phase_z", "z_phase", "impedance_phase")
_LEVEL = ("level", "amplitude", "power")
# Columns named after a detector, as receivers' software writes them.
_DETECTOR_COLUMNS = {
    "peak": ("peak", "max_peak", "maxpeak", "pk"),
    "quasi-peak": ("quasi_peak", "quasipeak", "qp", "qpk"),
    "average": ("average", "avg", "av", "caverage", "cispr_average"),
    "rms-average": ("rms_average", "cispr_rms", "crms", "rms_avg"),
}


@dataclass(frozen=True)
class Column:
    """A column of a table, and the factor to its SI unit."""

    index: int
    factor: float


def _units(names: Sequence[str], factors: dict[str, float]) -> dict[str, float]:
    return {f"{name}_{unit}": factor for name in names for unit, factor in factors.items()}


# Milliohm and megohm differ by a capital letter that header rows do not keep, so neither is taken.
_OHM = {"ohm": 1.0, "kohm": 1e3}
_SIEMENS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
_HENRY = {"h": 1.0, "mh": 1e-3, "uh": 1e-6, "nh": 1e-9}
_FARAD = {"f": 1.0, "uf": 1e-6, "nf": 1e-9, "pf": 1e-12}
_KNOWN: dict[str, dict[str, float]] = {
    "frequency": _units(_FREQUENCY, {"hz": 1.0, "khz": 1e3, "mhz": 1e6, "ghz": 1e9}),
    "resistance": _units(_RESISTANCE, _OHM),
    "reactance": _units(_REACTANCE, _OHM),
    "magnitude": _units(_MAGNITUDE, _OHM),
    "phase": _units(_PHASE, {"deg": 1.0, "rad": 180 / math.pi}),
    "conductance": _units(("conductance", "g", "gp"), _SIEMENS),
    "susceptance": _units(("susceptance", "b", "bp"), _SIEMENS),
    "admittance": _units(("admittance", "y", "|y|", "y_abs", "abs_y"), _SIEMENS),
    "admittance_phase": _units(("theta_y", "phase_y", "y_phase"), {"deg": 1.0, "rad": 180 / math.pi}),
    "series_inductance": _units(("ls",), _HENRY),
    "parallel_inductance": _units(("lp",), _HENRY),
    "series_capacitance": _units(("cs",), _FARAD),
    "parallel_capacitance": _units(("cp",), _FARAD),
    "series_resistance": _units(("rs",), _OHM),
    "parallel_resistance": _units(("rp",), _OHM),
    "s11_real": dict.fromkeys(("s11_re", "s11_real", "re_s11", "real_s11"), 1.0),
    "s11_imag": dict.fromkeys(("s11_im", "s11_imag", "im_s11", "imag_s11"), 1.0),
    "level": _units(_LEVEL, {"dbuv": 1.0}),
    "level_dbm": {**_units(_LEVEL, {"dbm": 1.0}), "dbm": 1.0},
    **{f"level {detector}": _units(names, {"dbuv": 1.0}) for detector, names in _DETECTOR_COLUMNS.items()},
    "sigma_relative": {"sigma_relative": 1.0},
    "overload": {"overload": 1.0},
}
_DECIBEL = re.compile(r"(?:^|_)db(?:[a-z]*)(?:_|$)")


def normal_name(title: str) -> str:
    """One spelling for many: `Frequency (Hz)`, `freq[Hz]` and `freq_hz` differ in the first word only."""
    name = title.strip().lower()
    for spelling, normal in _SPELLINGS:
        name = name.replace(spelling, normal)
    # An E4990A marks its trace columns with `-data`.
    return _SEPARATORS.sub("_", name).strip("_").removesuffix("_data")


def find_columns(table: Table) -> dict[str, Column]:
    """The columns whose meaning and unit are known.

    Raises
    ------
    BadInput
        If two columns mean the same.
    """
    found: dict[str, Column] = {}
    for index, title in enumerate(table.columns):
        name = normal_name(title)
        for meaning, spellings in _KNOWN.items():
            if name not in spellings:
                continue
            if meaning in found:
                first = clean_text(table.columns[found[meaning].index], 40)
                raise BadInput(f"{table.name}: the columns {first!r} and {clean_text(title, 40)!r} both hold the {meaning}; keep one")
            found[meaning] = Column(index, spellings[name])
    return found


def has_decibels(table: Table) -> bool:
    """Whether any column name carries a unit in decibel."""
    return any(_DECIBEL.search(normal_name(title)) for title in table.columns)


def columns_found(table: Table) -> str:
    """The column names for a message."""
    return clean_text(", ".join(table.columns), 200)
