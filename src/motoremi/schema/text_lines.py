"""How a line of text from a tachometer or thermometer is read: by a field or a pattern, with a unit and a scale."""

from __future__ import annotations

import math
import re
from typing import Literal, Self

from pydantic import Field, model_validator

from motoremi.bench.meter import NOT_MEASURED
from motoremi.errors import BadInput
from motoremi.schema.strict import Strict

LONGEST_LINE = 120
# Limits the time of a match, since a pattern may come from an untrusted file: three repeats over 120 characters take no noticeable time.
MOST_REPEATS = 3
# A number as instruments write it, without signs of thousands.
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
# Digits that are no part of a name such as T1.
_DIGITS = re.compile(r"(?<![A-Za-z_\d])\d+", re.ASCII)
# Unit on the line -> quantity, factor and offset to the unit of that quantity.
UNITS: dict[str, tuple[str, float, float]] = {
    "rpm": ("speed_rpm", 1.0, 0.0),
    "Hz": ("speed_rpm", 60.0, 0.0),
    "degC": ("temperature_degc", 1.0, 0.0),
    "K": ("temperature_degc", 1.0, -273.15),
    "degF": ("temperature_degc", 5 / 9, -160 / 9),
    "V": ("voltage_volt", 1.0, 0.0),
    "mV": ("voltage_volt", 1e-3, 0.0),
    "A": ("current_ampere", 1.0, 0.0),
    "mA": ("current_ampere", 1e-3, 0.0),
}


class Lines(Strict):
    """How the lines of a line reader are read."""

    example: str = Field(
        min_length=1, max_length=LONGEST_LINE, description="a line as the instrument sends it; field or pattern must find a number in it"
    )
    field: int | None = Field(
        default=None,
        ge=1,
        le=50,
        description="which field of the line is the number, from 1; words in other fields must be those of the example; or give a pattern",
    )
    separator: str = Field(default="", max_length=5, description="what separates fields; empty: spaces")
    pattern: str | None = Field(default=None, max_length=200, description="regular expression of the whole line, with one group around the number")
    unit: Literal["rpm", "Hz", "degC", "K", "degF", "V", "mV", "A", "mA"] = Field(description="unit of the number; Hz means revolutions per second")
    scale: float = Field(default=1.0, description="factor from the number to that unit: 0.5 for two pulses per revolution")
    ask: str = Field(default="", max_length=40, description="what is sent before each reading; empty: the instrument sends lines by itself")
    baud: Literal[300, 600, 1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200, 230400, 460800, 921600] = Field(
        default=9600, description="bits per second"
    )
    data_bits: Literal[7, 8] = Field(default=8, description="data bits per character")
    parity: Literal["none", "even", "odd"] = Field(default="none", description="parity bit")
    line_end: Literal["LF", "CR"] = Field(default="LF", description="end of a line; LF also for CR LF")

    @model_validator(mode="after")
    def _reads_its_example(self) -> Self:
        if (self.field is None) == (self.pattern is None):
            raise BadInput("give either field or pattern")
        if self.scale == 0 or not math.isfinite(self.scale):
            raise BadInput("scale: must be a number other than 0")
        if not self.ask.isascii() or not self.ask.isprintable():
            raise BadInput("ask: only plain characters can be sent")
        if self.pattern is not None:
            _refuse_bad_pattern(self.pattern)
        if self.value(self.example) is None:
            raise BadInput(f"no number in the example {self.example!r}: correct {'field' if self.pattern is None else 'pattern'} or example")
        return self

    @property
    def quantity(self) -> str:
        """Quantity that is read: a key of `motoremi.data.state.STATE_QUANTITIES`."""
        return UNITS[self.unit][0]

    def value(self, line: str) -> float | None:
        """The reading of a line, in the unit of its quantity; None if the line is not of this kind, or marks that nothing was measured."""
        span = self.span(line)
        if span is None:
            return None
        text = line[slice(*span)].strip()
        if self._has_decimal_comma:
            # A point would separate thousands.
            text = text.replace(".", " ").replace(",", ".")
        if not _NUMBER.fullmatch(text) or abs(number := float(text)) > NOT_MEASURED:
            return None
        _, factor, offset = UNITS[self.unit]
        return number * self.scale * factor + offset

    def written(self, line: str, value: float) -> str:
        """The same line with another value, for the simulated instrument."""
        _, factor, offset = UNITS[self.unit]
        start, end = self.span(line) or (0, 0)
        before = line[start:end].strip()
        text = f"{(value - offset) / factor / self.scale:.{len(before.replace(',', '.').partition('.')[2])}f}"
        return f"{line[:start]}{text.replace('.', ',') if ',' in before else text}{line[end:]}"

    def span(self, line: str) -> tuple[int, int] | None:
        """First and last position of the number in a line of this kind; None if it is not of this kind."""
        if len(line) > LONGEST_LINE:
            return None
        if self.pattern is not None:
            found = re.fullmatch(self.pattern, line)
            return found.span(1) if found and found[1] is not None else None
        fields = _fields(line, self.separator)
        # A truncated line has fewer fields.
        expected = _fields(self.example, self.separator)
        if self.field is None or len(fields) != len(expected) or self.field > len(fields):
            return None
        for number, (own, other) in enumerate(zip(expected, fields, strict=True), start=1):
            # A field that is a number in the example is another reading, and free. Words, such as a unit, must be the same.
            if number != self.field and not _same_words(self.example[slice(*own)].strip(), line[slice(*other)].strip()):
                return None
        return fields[self.field - 1]

    @property
    def _has_decimal_comma(self) -> bool:
        span = self.span(self.example)
        return span is not None and "," in self.example[slice(*span)]


def _same_words(expected: str, text: str) -> bool:
    """Whether a field is like that of the example: anything where the example has a number, else the same but for digits, as in a time of day."""
    if _NUMBER.fullmatch(expected.replace(",", ".")):
        return True
    return _DIGITS.sub("0", expected) == _DIGITS.sub("0", text)


def _fields(line: str, separator: str) -> list[tuple[int, int]]:
    """Where each field begins and ends."""
    if not separator:
        return [found.span() for found in re.finditer(r"\S+", line)]
    edges, at = [], 0
    for part in line.split(separator):
        edges.append((at, at + len(part)))
        at += len(part) + len(separator)
    return edges


def _refuse_bad_pattern(pattern: str) -> None:
    try:
        groups = re.compile(pattern).groups
    except re.error as error:
        raise BadInput(f"pattern: is no regular expression ({error})") from error
    if groups != 1:
        raise BadInput(f"pattern: has {groups} groups; put one pair of parentheses, around the number")
    # Repeats are counted outside of escapes and character sets.
    bare = re.sub(r"\\.|\[(?:\\.|[^\]])*\]", "x", pattern)
    if re.search(r"\)[*+{]", bare) or len(re.findall(r"[*+]|\{\d*,\d*\}", bare)) > MOST_REPEATS:
        raise BadInput(f"pattern: repeat no group, and use at most {MOST_REPEATS} of * and +; a slow pattern would stop the run")
