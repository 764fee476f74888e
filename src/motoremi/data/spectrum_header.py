"""The `# key: value` lines of a file that holds spectra: upper and lower case, and blanks, hyphens and underscores, make no difference."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from motoremi.arrays import JsonDict
from motoremi.data.numbers import looks_numeric
from motoremi.data.spectrum import known_condition
from motoremi.data.text import clean_text
from motoremi.data.units import HERTZ
from motoremi.errors import BadInput
from motoremi.quantities import parse

_KEYS = ("detector", "condition", "transducer", "line", "operating")
_BANDWIDTH = re.compile(r"(?:rbw|resolution_bandwidth)(?:_([kmg]?hz))?")
_WITH_UNIT = re.compile(r"(.*?)[\s;]*([kmg]?hz)", re.IGNORECASE)
_WRITE = "write '# rbw_hz: 9000' or '# rbw: 9 kHz'"
# What the readers write themselves: entries of a file with these names are kept under another key.
_OWN_KEYS = ("source", "format", "changes", "warnings")
_OWN_KEYS_OF_SPECTRA = ("level_unit", "corrected")


def kept_header(header: Mapping[str, Any]) -> JsonDict:
    """The header with the keys that the readers write themselves renamed to `header_...`."""
    return {f"header_{key}" if key in _OWN_KEYS else key: value for key, value in header.items()}


def spectrum_header(header: Mapping[str, Any]) -> JsonDict:
    """The header of a file of spectra with the keys and values that motoremi uses in one spelling; others as written.

    Raises
    ------
    BadInput
        For a condition or a bandwidth that cannot be read, or one key with two values.
    """
    found: JsonDict = {}
    for written, value in kept_header(header).items():
        key, plain = _entry(written, value)
        if key in found and found[key] != plain:
            raise BadInput(f"its header states {key} twice, {_shown(found[key])} and {_shown(plain)}; keep one line")
        found[key] = plain
    return found


def _entry(written: str, value: object) -> tuple[str, Any]:
    key = re.sub(r"[\s_()\[\]-]+", "_", written.strip().lower()).strip("_")
    if bandwidth := _BANDWIDTH.fullmatch(key):
        return "rbw_hz", bandwidth_hz(value, bandwidth[1] or "")
    if key == "condition":
        return key, known_condition(value)
    if key in _OWN_KEYS_OF_SPECTRA:
        return f"header_{key}", value
    return (key if key in _KEYS else written), value


def bandwidth_hz(written: object, unit: str = "hz") -> float:
    """A resolution bandwidth in hertz from `9 kHz`, or from `9000` if its key states the unit.

    Raises
    ------
    BadInput
        If it is not a frequency, or has no unit.
    """
    text = str(written).strip(" ;")
    shown = f"the resolution bandwidth {clean_text(text, 40)!r}"
    if looks_numeric(text) and not unit:
        raise BadInput(f"{shown} has no unit; {_WRITE}")
    with_unit = _WITH_UNIT.fullmatch(text if not looks_numeric(text) else f"{text} {unit}")
    try:
        return parse(text, "Hz") if with_unit is None else parse(with_unit[1], "Hz") * (HERTZ.factor(with_unit[2]) or 1.0)
    except BadInput as error:
        raise BadInput(f"{shown} is not a frequency; {_WRITE}") from error


def _shown(value: object) -> str:
    return repr(clean_text(str(value), 40))
