"""Calibration of the stated confidence: compared with the hit rate in bins, and for each kind of verdict."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Protocol

import numpy as np

from motoremi.arrays import JsonDict
from motoremi.blind.scoring import Answer

BINS = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 1.0)
KINDS = ("adequate", "one name", "two names", "family", "instrument", "data", "unexplained", "crashed")
# Fewest cases of a kind for the comparison: with fewer, differences of some per cent are not significant.
LEAST_CASES = 10


class Judged(Protocol):
    """A case with its answer, and whether the statement of the answer is true."""

    @property
    def answer(self) -> Answer:
        """The answer."""

    @property
    def hit(self) -> bool:
        """Whether its statement is true."""


def goal(results: Sequence[bool], wanted: float, at_most: bool = False) -> JsonDict:
    """A share of true results compared with its goal."""
    return goal_of(float(np.mean(results)) if results else None, wanted, len(results), at_most)


def goal_of(value: float | None, wanted: float, cases: int, at_most: bool = False) -> JsonDict:
    """A figure compared with its goal; `reached` is None without a figure."""
    reached = None if value is None else value <= wanted if at_most else value >= wanted
    return {"value": value, "wanted": wanted, "at_most": at_most, "cases": cases, "reached": reached}


def reliability(played: Sequence[Judged]) -> list[JsonDict]:
    """Stated confidence against hit rate, in bins."""
    stated = np.array([one.answer.confidence for one in played])
    hits = np.array([one.hit for one in played])
    rows = []
    for low, high in pairwise(BINS):
        inside = (stated >= low) & ((stated < high) | (high == BINS[-1]))
        if inside.any():
            row = {
                "low": low,
                "high": high,
                "cases": int(inside.sum()),
                "stated": float(stated[inside].mean()),
                "hit_rate": float(hits[inside].mean()),
            }
            rows.append(row)
    return rows


def calibration_error(played: Sequence[Judged]) -> float:
    """Expected calibration error: the mean difference of stated confidence and hit rate, bin by bin."""
    return float(sum(row["cases"] * abs(row["stated"] - row["hit_rate"]) for row in reliability(played)) / max(1, len(played)))


def kind_of(answer: Answer) -> str:
    """The kind of an answer, one of `KINDS`; more than two names count as two."""
    if answer.trouble:
        return "crashed"
    if answer.verdict in ("adequate", "instrument", "data", "unexplained"):
        return answer.verdict
    return "family" if answer.families else "one name" if len(answer.effects) <= 1 else "two names"


def by_kind_of_verdict(played: Sequence[Judged]) -> list[JsonDict]:
    """For each kind of answer: number, mean stated confidence, hit rate, and their difference."""
    rows = []
    for kind in KINDS:
        of_kind = [one for one in played if kind_of(one.answer) == kind]
        if of_kind:
            stated = float(np.mean([one.answer.confidence for one in of_kind]))
            rate = float(np.mean([one.hit for one in of_kind]))
            rows.append({"kind": kind, "cases": len(of_kind), "stated": stated, "hit_rate": rate, "difference": stated - rate})
    return rows


def worst_kind(played: Sequence[Judged], wanted: float) -> JsonDict:
    """The goal for the largest difference of any kind with enough cases, without crashes, which state no confidence."""
    rows = [row for row in by_kind_of_verdict(played) if row["cases"] >= LEAST_CASES and row["kind"] != "crashed"]
    worst = max((abs(row["difference"]) for row in rows), default=None)
    return goal_of(worst, wanted, sum(row["cases"] for row in rows), at_most=True)
