"""A number of the paper compared with a value that follows from its other numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from motoremi.arrays import JsonDict


@dataclass(frozen=True)
class Disagreement:
    """A printed number, the computed value, and the conclusion.

    Parameters
    ----------
    name : str
        Identifier.
    printed, computed, meaning : str
        Texts for the table.
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
