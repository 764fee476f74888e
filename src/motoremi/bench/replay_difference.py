"""Errors of a replay: an exchange that differs from the record, shown side by side, and a record that ends early."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from motoremi.arrays import JsonDict
from motoremi.data.text import clean_text
from motoremi.errors import InstrumentError

LONGEST = 100
CONTEXT = 4


class RecordedEnd(InstrumentError):
    """The record ends here, because the recorded run was stopped before its procedure was complete."""


class ReplayDifference(InstrumentError):
    """An exchange of the replay differs from the recorded one.

    Parameters
    ----------
    resource_name : str
    exchange : int
        Number of the recorded exchange, from 1.
    expected, came : str
        The recorded exchange and the one of the replay.
    before : sequence of str
        The exchanges just before.
    """

    def __init__(self, resource_name: str, exchange: int, expected: str, came: str, before: Sequence[str] = ()) -> None:
        super().__init__(f"{resource_name}: replay differs at exchange {exchange}: expected {expected}, got {came}")
        self.resource_name = resource_name
        self.exchange = exchange
        self.expected = expected
        self.came = came
        self.before = tuple(before)

    def lines(self) -> list[str]:
        """A few lines for a terminal: the exchanges before, then both sides with a mark under the first character that differs."""
        same = next((i for i, (a, b) in enumerate(zip(self.expected, self.came, strict=False)) if a != b), min(len(self.expected), len(self.came)))
        return [
            f"{self.resource_name}, exchange {self.exchange}:",
            *(f"    {line}" for line in self.before),
            f"  - {self.expected}   (recorded)",
            f"  + {self.came}   (asked now)",
            f"    {' ' * same}^",
        ]

    def to_dict(self) -> JsonDict:
        """Plain data."""
        return {
            "resource": self.resource_name,
            "exchange": self.exchange,
            "before": list(self.before),
            "expected": self.expected,
            "came": self.came,
        }


def shown(record: Mapping[str, Any]) -> str:
    """A record as short text; control characters that an instrument may have sent are made visible."""
    content = record.get("text", record.get("base64", record.get("error", "")))
    return clean_text(f"{record['direction']} {content!r}".removesuffix(" ''"), LONGEST)
