"""The effects of a model as text."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable


def as_sum(effects: Iterable[str]) -> str:
    """Effects joined by plus signs; one that occurs several times stands once, with the number: `lead-inductance + 14 winding-modes`."""
    return " + ".join(name if number == 1 else f"{number} {name}" for name, number in Counter(effects).items())
