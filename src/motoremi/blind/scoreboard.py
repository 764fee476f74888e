"""The scoreboard: many blind cases, with the hit rate of the diagnosis and the calibration of its confidence."""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np

from motoremi.arrays import JsonDict, Progress
from motoremi.blind.cases import Case, draw_many
from motoremi.blind.confidence import by_kind_of_verdict, calibration_error, goal, goal_of, reliability, worst_kind
from motoremi.blind.rounds import play_each
from motoremi.blind.scoring import Answer, Outcome, hit, named_exactly, outcome
from motoremi.blind.search_check import hidden_ahead_nats
from motoremi.diagnosis.diagnosis import diagnose
from motoremi.fitting.fit import fit
from motoremi.model.motor import dc_motor

# Largest accepted difference of stated confidence and hit rate.
CALIBRATION_GOAL = 0.05


@dataclass(frozen=True)
class Played:
    """A case with its answer.

    Parameters
    ----------
    case : Case
    answer : Answer
    seen : tuple of str
        The hidden effects that show.
    hidden_ahead_nats : float, optional
        Of a wrong answer: log evidence of the model with the hidden effects above that of the best model found.
    """

    case: Case
    answer: Answer
    seen: tuple[str, ...]
    hidden_ahead_nats: float | None = None

    @property
    def detectable(self) -> bool:
        """Whether all hidden effects show."""
        return self.seen == self.case.hidden

    @property
    def outcome(self) -> Outcome:
        """Score of the answer."""
        return outcome(self.case.hidden, self.answer)

    @property
    def hit(self) -> bool:
        """Whether the answer is true in the sense of its stated confidence: as the score, but a family may have any size.

        A hidden effect that does not show beside the other one need not be named.
        """
        hidden = (self.case.hidden, self.seen) if self.seen else (self.case.hidden,)
        return any(hit(each, self.answer, self.detectable) for each in hidden)

    def to_dict(self) -> JsonDict:
        """As plain data."""
        return {
            **asdict(self.case),
            **asdict(self.answer),
            "seen": list(self.seen),
            "detectable": self.detectable,
            "outcome": self.outcome,
            "hit": self.hit,
            "hidden_ahead_nats": self.hidden_ahead_nats,
        }


def play(case: Case) -> Played:
    """Diagnose one case as a user would."""
    seen = case.seen()
    try:
        base = fit(dc_motor(), case.sweeps())
        started = time.perf_counter()
        found = diagnose(base)
        took = time.perf_counter() - started
    except Exception as error:  # a crash is scored as an answer and must not stop the other cases
        return Played(case, Answer("crashed", (), (), 0.0, trouble=f"{type(error).__name__}: {error}"), seen)
    floor = found.best.noise_percent
    answer = Answer(
        found.verdict, found.effects, found.families, found.confidence,
        found.base.corrected_error_percent / floor, found.best.corrected_error_percent / floor, took,
    )  # fmt: skip
    played = Played(case, answer, seen)
    return played if played.outcome in ("right", "family") else replace(played, hidden_ahead_nats=hidden_ahead_nats(found, case.hidden))


def play_all(seed: int, count: int, jobs: int, progress: Progress | None = None) -> list[Played]:
    """All cases of a seed, in order; the result does not depend on the number of jobs."""
    return play_each(play, draw_many(seed, count), jobs, progress)


def summary(played: Sequence[Played]) -> JsonDict:
    """The figures of a scoreboard.

    Returns
    -------
    dict
        `goals`: each with `value`, `wanted`, `cases` and `reached` (None without a case); `by_kind`: outcomes of each hidden effect;
        `confusion`: truth -> answer -> number; `reliability`: stated confidence against hit rate; `kinds_of_verdict`: the same for
        each kind; `calibration_error`; `troubles`.
    """
    sorts: dict[str, list[Played]] = defaultdict(list)
    for one in played:
        sorts[one.case.sort].append(one)
    known = [one for one in played if one.case.sort in ("one", "instrument") and one.detectable]
    pairs = [one for one in sorts["two"] if one.detectable]
    named = [one for one in played if one.answer.effects]
    good = ("right", "family")
    goals = {
        "false alarms, nothing hidden": goal([one.outcome == "false alarm" for one in sorts["none"]], 0.01, at_most=True),
        "one hidden: name, or family of at most three": goal([one.outcome in good for one in known], 0.95),
        "one hidden: exact name": goal([named_exactly(one.case.hidden, one.answer) for one in known], 0.85),
        "two hidden: both": goal([one.outcome in good for one in pairs], 0.85),
        "outside the catalogue: unexplained": goal([one.outcome == "right" for one in sorts["outside"] if one.detectable], 0.90),
        "error after at most 1.3 noise floors": goal([one.answer.error_after_floors <= 1.3 for one in named], 0.95),
        "expected calibration error": goal_of(calibration_error(played), CALIBRATION_GOAL, len(played), at_most=True),
        "calibration of the kind of verdict that is furthest off": worst_kind(played, CALIBRATION_GOAL),
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
        "kinds_of_verdict": by_kind_of_verdict(played),
        "calibration_error": goals["expected calibration error"]["value"],
        "seconds": {
            **seconds([one.answer for one in played]),
            "by_sort": {sort: seconds([one.answer for one in ones]) for sort, ones in sorted(sorts.items())},
        },
        "troubles": [
            {"index": one.case.index, "hidden": list(one.case.hidden), "trouble": one.answer.trouble} for one in played if one.answer.trouble
        ],
        "wrong": [one.to_dict() for one in played if one.outcome not in good and one.detectable],
    }


def seconds(answers: Sequence[Answer]) -> JsonDict:
    """Time of the diagnoses: median, 90 % quantile, largest."""
    finite = [answer.seconds for answer in answers if np.isfinite(answer.seconds)]
    if not finite:
        return {"cases": 0, "median": None, "most": None, "largest": None}
    return {"cases": len(finite), "median": float(np.median(finite)), "most": float(np.quantile(finite, 0.9)), "largest": max(finite)}
