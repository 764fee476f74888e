"""The scoreboard: many blind cases, and how often the diagnosis is right and as sure as it should be."""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from itertools import pairwise

import numpy as np

from motoremi.arrays import JsonDict
from motoremi.blind.cases import Case, draw_many
from motoremi.blind.scoring import Answer, Outcome, hit, named_exactly, outcome
from motoremi.diagnosis.diagnosis import diagnose
from motoremi.fitting.fit import fit
from motoremi.model.motor import dc_motor

BINS = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 1.0)


@dataclass(frozen=True)
class Played:
    """A case with its answer."""

    case: Case
    answer: Answer
    detectable: bool

    @property
    def outcome(self) -> Outcome:
        """What the answer is worth."""
        return outcome(self.case.hidden, self.answer)

    @property
    def hit(self) -> bool:
        """Whether what the confidence speaks of is true."""
        return hit(self.case.hidden, self.answer, self.detectable)

    def to_dict(self) -> JsonDict:
        """As plain data."""
        return {**asdict(self.case), **asdict(self.answer), "detectable": self.detectable, "outcome": self.outcome, "hit": self.hit}


def play(case: Case) -> Played:
    """Diagnose one case as a user would."""
    detectable = case.detectable()
    try:
        base = fit(dc_motor(), case.sweeps())
        started = time.perf_counter()
        found = diagnose(base)
        seconds = time.perf_counter() - started
    except Exception as error:  # a crash is an answer too, and the worst; the others go on
        return Played(case, Answer("crashed", (), (), 0.0, trouble=f"{type(error).__name__}: {error}"), detectable)
    floor = found.best.floor_percent
    answer = Answer(
        found.verdict, found.effects, found.families, found.confidence,
        found.base.rms_error_percent / floor, found.best.rms_error_percent / floor, seconds,
    )  # fmt: skip
    return Played(case, answer, detectable)


def play_all(seed: int, count: int, jobs: int, progress: Callable[[str, int, int], None] | None = None) -> list[Played]:
    """All cases of a seed, in order; the same whatever the number of jobs."""
    cases = draw_many(seed, count)
    if jobs <= 1:
        return [play(case) for case in _told(cases, count, progress)]
    with ProcessPoolExecutor(jobs) as pool:
        futures = [pool.submit(play, case) for case in cases]
        for done, _ in enumerate(as_completed(futures), start=1):
            if progress is not None:
                progress(f"case {done} of {count}", done, count)
        return [future.result() for future in futures]


def _told(cases: Iterable[Case], count: int, progress: Callable[[str, int, int], None] | None) -> Iterable[Case]:
    for done, case in enumerate(cases):
        if progress is not None:
            progress(f"case {done + 1} of {count}", done, count)
        yield case


def summary(played: Sequence[Played]) -> JsonDict:
    """The figures of a scoreboard.

    Returns
    -------
    dict
        `goals`: each with `value`, `wanted`, `cases` and `reached` (None without a case); `by_kind`: outcomes of each hidden effect;
        `confusion`: truth -> answer -> number; `reliability`: stated confidence against hit rate; `calibration_error`; `troubles`.
    """
    sorts: dict[str, list[Played]] = defaultdict(list)
    for one in played:
        sorts[one.case.sort].append(one)
    known = [one for one in played if one.case.sort in ("one", "instrument") and one.detectable]
    pairs = [one for one in sorts["two"] if one.detectable]
    named = [one for one in played if one.answer.effects]
    good = ("right", "family")
    goals = {
        "false alarms, nothing hidden": _goal([one.outcome == "false alarm" for one in sorts["none"]], 0.01, at_most=True),
        "one hidden: name, or family of at most three": _goal([one.outcome in good for one in known], 0.95),
        "one hidden: exact name": _goal([named_exactly(one.case.hidden, one.answer) for one in known], 0.85),
        "two hidden: both": _goal([one.outcome in good for one in pairs], 0.85),
        "outside the catalogue: unexplained": _goal([one.outcome == "right" for one in sorts["outside"] if one.detectable], 0.90),
        "error after at most 1.3 noise floors": _goal([one.answer.error_after_floors <= 1.3 for one in named], 0.95),
        "expected calibration error": _calibration_goal(played),
    }
    by_kind: dict[str, Counter[str]] = defaultdict(Counter)
    confusion: dict[str, Counter[str]] = defaultdict(Counter)
    for one in played:
        truth = " + ".join(sorted(one.case.hidden)) or "none"
        by_kind["two effects" if one.case.sort == "two" else truth][one.outcome if one.detectable else "too weak to see"] += 1
        if one.case.sort != "two" and one.detectable:
            confusion[truth][" + ".join(one.answer.effects) or one.answer.verdict] += 1
    return {
        "schema": "motoremi.scoreboard/1",
        "cases": len(played),
        "goals": goals,
        "by_kind": {kind: dict(counts) for kind, counts in sorted(by_kind.items())},
        "confusion": {kind: dict(counts) for kind, counts in sorted(confusion.items())},
        "reliability": reliability(played),
        "calibration_error": goals["expected calibration error"]["value"],
        "seconds": {**_seconds(played), "by_sort": {sort: _seconds(ones) for sort, ones in sorted(sorts.items())}},
        "troubles": [
            {"index": one.case.index, "hidden": list(one.case.hidden), "trouble": one.answer.trouble} for one in played if one.answer.trouble
        ],
        "wrong": [one.to_dict() for one in played if one.outcome not in good and one.detectable],
    }


def _goal(results: Sequence[bool], wanted: float, at_most: bool = False) -> JsonDict:
    value = float(np.mean(results)) if results else None
    reached = None if value is None else value <= wanted if at_most else value >= wanted
    return {"value": value, "wanted": wanted, "at_most": at_most, "cases": len(results), "reached": reached}


def reliability(played: Sequence[Played]) -> list[JsonDict]:
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


def _calibration_goal(played: Sequence[Played]) -> JsonDict:
    rows = reliability(played)
    error = sum(row["cases"] * abs(row["stated"] - row["hit_rate"]) for row in rows) / max(1, len(played))
    return {"value": error, "wanted": 0.05, "at_most": True, "cases": len(played), "reached": error <= 0.05}


def _seconds(played: Sequence[Played]) -> JsonDict:
    finite = [one.answer.seconds for one in played if np.isfinite(one.answer.seconds)]
    if not finite:
        return {"cases": 0, "median": None, "most": None, "largest": None}
    return {"cases": len(finite), "median": float(np.median(finite)), "most": float(np.quantile(finite, 0.9)), "largest": max(finite)}
