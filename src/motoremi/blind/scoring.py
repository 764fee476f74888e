"""Scoring of answers: right, family, wrong, missed, false alarm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

Outcome: TypeAlias = Literal["right", "family", "wrong", "missed", "false alarm", "unexplained", "crashed"]

# Largest family that counts as an answer.
LARGEST_FAMILY_SCORED = 3


@dataclass(frozen=True)
class Answer:
    """The answer of a diagnosis, and its time.

    Parameters
    ----------
    verdict : str
    effects : tuple of str
    families : tuple of tuple of str
    confidence : float
    error_before_floors, error_after_floors : float
        Errors of base and best model, with the analyser's most likely errors removed, in multiples of the random noise.
    seconds : float
        Wall time of the diagnosis.
    trouble : str
        The error message of a diagnosis that crashed.
    """

    verdict: str
    effects: tuple[str, ...]
    families: tuple[tuple[str, ...], ...]
    confidence: float
    error_before_floors: float = float("nan")
    error_after_floors: float = float("nan")
    seconds: float = float("nan")
    trouble: str = ""


def outcome(hidden: Sequence[str], answer: Answer) -> Outcome:
    """Score of an answer.

    Parameters
    ----------
    hidden : sequence of str
        Names that start with `outside-` are not in the catalogue: the right answer is `unexplained`.
    """
    if answer.trouble:
        return "crashed"
    if any(name.startswith("outside-") for name in hidden):
        return "right" if answer.verdict == "unexplained" else "missed" if answer.verdict == "adequate" else "wrong"
    if not hidden:
        return "right" if answer.verdict == "adequate" else "false alarm"
    if answer.verdict == "adequate":
        return "missed"
    if answer.verdict == "unexplained":
        return "unexplained"
    if set(hidden) == set(answer.effects) and not answer.families:
        return "right"
    small = [family for family in answer.families if len(family) <= LARGEST_FAMILY_SCORED]
    return "family" if _held(hidden, answer.effects, small) else "wrong"


def hit(hidden: Sequence[str], answer: Answer, detectable: bool) -> bool:
    """Whether the answer is true in the sense of its stated confidence: the hidden effects are named, or in a family of any size."""
    if answer.trouble:
        return False
    if any(name.startswith("outside-") for name in hidden):
        return answer.verdict == "unexplained"
    if answer.verdict == "adequate":
        return not hidden or not detectable
    return bool(hidden) and answer.verdict != "unexplained" and _held(hidden, answer.effects, answer.families)


def named_exactly(hidden: Sequence[str], answer: Answer) -> bool:
    """Whether the named effects are exactly the hidden ones, regardless of families."""
    return not answer.trouble and set(hidden) == set(answer.effects)


def _held(hidden: Sequence[str], effects: Sequence[str], families: Sequence[Sequence[str]]) -> bool:
    """Whether each hidden effect can be assigned to a different named effect or its family."""
    if len(hidden) != len(effects):
        return False
    places = [{effect, *(name for family in families if effect in family for name in family)} for effect in effects]
    return _placed(list(hidden), places)


def _placed(hidden: list[str], places: list[set[str]]) -> bool:
    if not hidden:
        return True
    rest = hidden[1:]
    return any(hidden[0] in place and _placed(rest, places[:at] + places[at + 1 :]) for at, place in enumerate(places))
