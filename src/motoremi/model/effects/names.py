"""The effects of a model as text."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence


def as_sum(effects: Iterable[str]) -> str:
    """Effects joined by plus signs; one that occurs several times stands once, with the number: `lead-inductance + 14 winding-modes`."""
    return " + ".join(name if number == 1 else f"{number} {name}" for name, number in Counter(effects).items())


def what_is_more(effects: Iterable[str], fewer: Sequence[str]) -> str:
    """The effects that a larger set has and a smaller one lacks, in words: `bearing-film and 2 more winding-modes`."""
    lacking = Counter(effects) - Counter(fewer)
    return " and ".join(f"{number} more {name}" if name in fewer else name for name, number in lacking.items())
