"""One number of the paper beside what follows from its other numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from motoremi.arrays import JsonDict


@dataclass(frozen=True)
class Disagreement:
    """What is printed, what was computed, what it means.

    Parameters
    ----------
    name : str
        Identifier.
    printed, computed, meaning : str
        For a reader.
    numbers : mapping
        The computed numbers, each named with its unit.
    """

    name: str
    printed: str
    computed: str
    meaning: str
    numbers: Mapping[str, float]

    def to_dict(self) -> JsonDict:
        """Plain data."""
        return {
            "id": self.name,
            "printed": self.printed,
            "computed": self.computed,
            "meaning": self.meaning,
            "numbers": dict(self.numbers),
        }
