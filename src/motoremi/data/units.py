"""Units of the quantities in measurement files, as people and instruments write them.

Case matters for one letter only: before ohm, `m` is milli and `M` is mega; a unit in capitals throughout (`MOHM`) could be either and is
refused. Before hertz both are mega, before all other units both are milli.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from motoremi.data.text import without_accents

_BRACKETS = re.compile(r"[\s()\[\]{}<>]+")
_SPELLINGS = str.maketrans({"µ": "u", "μ": "u", "Ω": "ohm", "\u2126": "ohm", "ω": "ohm", "°": "deg", "º": "deg"})

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
class Units:
    """The units of one kind of quantity: as shown in messages, the one that all are converted to, and the factor of each."""

    shown: str
    base: str
    factors: dict[str, float]

    def factor(self, text: str) -> float | None:
        """The factor of a unit as written, None if it is not known or ambiguous."""
        plain = without_accents(_BRACKETS.sub("", text).strip(".").translate(_SPELLINGS))
        if self.is_ambiguous(plain):
            return None
        lower = plain.lower()
        return self.factors.get(plain[:1] + lower[1:], self.factors.get(lower))

    def is_ambiguous(self, text: str) -> bool:
        """Whether it is written in capitals throughout, so that M may be milli or mega."""
        rest = text[1:].lower()
        return text.isupper() and text.startswith("M") and "m" + rest in self.factors and "M" + rest in self.factors


def _prefixed(shown: str, base: str, lowest: float, highest: float, *words: str) -> Units:
    spellings = {spelling: size for size, names in _PREFIXES.items() if lowest <= size <= highest for spelling in names}
    if "m" not in spellings and "M" in spellings:
        spellings["m"] = spellings.pop("M")
    return Units(shown, base, {spelling + word: size for spelling, size in spellings.items() for word in words})


HERTZ = _prefixed("Hz, kHz, MHz or GHz", "Hz", 1.0, 1e9, "hz", "hertz")
OHM = _prefixed("uOhm, mOhm, Ohm, kOhm or MOhm", "Ohm", 1e-9, 1e9, "ohm", "ohms")
SIEMENS = _prefixed("nS, uS, mS or S", "S", 1e-12, 1.0, "s", "siemens", "mho")
HENRY = _prefixed("nH, uH, mH or H", "H", 1e-12, 1.0, "h", "henry")
FARAD = _prefixed("pF, nF, uF or F", "F", 1e-12, 1.0, "f", "farad")
# Degrees in German, French, Spanish and Italian. In English a grad is a hundredth of a right angle, which no known analyser writes.
_DEGREE = ("grad", "degre", "degres", "grados", "gradi")
ANGLE = Units(
    "deg or rad",
    "deg",
    {
        **dict.fromkeys(("deg", "degree", "degrees", *_DEGREE), 1.0),
        **dict.fromkeys(("rad", "radian", "radians"), 180 / math.pi),
        "mrad": 0.18 / math.pi,
    },
)
DBUV = Units("dBuV", "dBuV", {"dbuv": 1.0})
DBM = Units("dBm", "dBm", {"dbm": 1.0})
# Units of columns that are not read, in a row of units: numbers of points, times, voltages, currents, temperatures.
_OTHER_UNITS = ("#", "s", "ms", "V", "mV", "A", "mA", "%", "°C", "degC", "dB", "m", "cm")
NUMBER = Units("no unit", "", {"": 1.0})


def are_units(texts: Sequence[str]) -> bool:
    """Whether all of these are units or empty, and one is that of a frequency: the row of units below one of names."""
    every = (HERTZ, OHM, SIEMENS, HENRY, FARAD, ANGLE, DBUV, DBM)
    known = all(not text or text.strip("()[] ") in _OTHER_UNITS or any(kind.factor(text) is not None for kind in every) for text in texts)
    return known and any(HERTZ.factor(text) is not None for text in texts)
