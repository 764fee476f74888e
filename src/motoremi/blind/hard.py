"""The hard scoreboard: diagnosis of motors that are measured outside the protocol."""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property

import numpy as np

from motoremi.arrays import JsonDict, Progress
from motoremi.blind.cases import shown, visible
from motoremi.blind.confidence import by_kind_of_verdict, calibration_error, goal, goal_of, reliability, worst_kind
from motoremi.blind.departures import DEPARTURES, HardCase, draw_hard_many
from motoremi.blind.hard_scoring import GOOD, Element, attached, of_the_motor, statement_is_true, strict, sure_and_wrong
from motoremi.blind.rounds import play_each
from motoremi.blind.scoreboard import seconds
from motoremi.blind.scoring import Answer, Outcome
from motoremi.blind.search_check import hidden_ahead_nats
from motoremi.diagnosis.diagnosis import Diagnosis, diagnose
from motoremi.fitting.fit import fit
from motoremi.fitting.result import Fit
from motoremi.model.motor import dc_motor
from motoremi.simulate.hidden import ELEMENTS

STRICT_GOAL, SURE_AND_WRONG_GOAL, CALIBRATION_GOAL, COVERAGE_GOAL = 0.93, 0.02, 0.10, 0.88
# Fewest motors for a figure of coverage, because the intervals of one motor are not independent.
LEAST_MOTORS = 5


@dataclass(frozen=True)
class PlayedHard:
    """A hard case with its answer.

    Parameters
    ----------
    case : HardCase
    answer : Answer
    findings : tuple of str
        Ids of the serious findings.
    seen : tuple of str
        The hidden effects that are visible in the data.
    elements : tuple of Element
        Fitted elements that can be compared with the simulated motor; empty unless the best model has exactly the hidden effects.
    hidden_ahead_nats : float, optional
        Of a wrong answer: log evidence of the model with the hidden effects above that of the best model found.
    """

    case: HardCase
    answer: Answer
    findings: tuple[str, ...] = ()
    seen: tuple[str, ...] = ()
    elements: tuple[Element, ...] = ()
    hidden_ahead_nats: float | None = None

    @cached_property
    def outcome(self) -> Outcome:
        """Score of the answer."""
        return strict(self.case, self.answer, self.findings, self.seen)

    @cached_property
    def hit(self) -> bool:
        """Whether the answer is true in the sense of its stated confidence: as the score, but a family may have any size."""
        return statement_is_true(self.case, self.answer, self.findings, self.seen)

    @property
    def misleads(self) -> bool:
        """Whether the answer is wrong with high confidence."""
        return sure_and_wrong(self.case, self.answer, self.outcome)

    def to_dict(self) -> JsonDict:
        """As plain data."""
        return {
            **asdict(self.case), **asdict(self.answer), "findings": list(self.findings), "seen": list(self.seen),
            "outcome": self.outcome, "hit": self.hit, "sure_and_wrong": self.misleads, "hidden_ahead_nats": self.hidden_ahead_nats,
        }  # fmt: skip


def play_hard(case: HardCase) -> PlayedHard:
    """Diagnose one case as a user would."""
    try:
        base = fit(dc_motor(), case.sweeps())
        started = time.perf_counter()
        found = diagnose(base)
        took = time.perf_counter() - started
        document = found.to_dict()
    except Exception as error:  # a crash is scored as an answer and must not stop the other cases
        return PlayedHard(case, Answer("crashed", (), (), 0.0, trouble=f"{type(error).__name__}: {error}"))
    families = tuple(tuple(family) for family in document["families"])
    answer = Answer(document["verdict"], tuple(document["effects"]), families, document["confidence"], seconds=took)
    findings = tuple(dict.fromkeys(str(one["id"]) for one in document.get("findings", []) if one.get("serious")))
    played = PlayedHard(case, answer, findings, _seen(case, base), _elements(case, found))
    return played if played.outcome in GOOD else replace(played, hidden_ahead_nats=hidden_ahead_nats(found, case.hidden))


def _seen(case: HardCase, base: Fit) -> tuple[str, ...]:
    """The hidden effect that the seven elements do not describe within noise and specification.

    Of several, those that are visible beside a model with all the others.
    """
    return shown(base, case.hidden) if len(case.hidden) > 1 else case.hidden if visible(base) else ()


def _elements(case: HardCase, found: Diagnosis) -> tuple[Element, ...]:
    best = found.best
    if set(of_the_motor(case, best.effects)) != set(case.hidden):
        return ()
    spans, skipped = case.ranges(), attached(case.hidden)
    compared = [name for name in ELEMENTS if name in best.parameters and name not in skipped and name not in best.held and best.determined(name)]
    return tuple(Element(name, float(best.parameters[name]), float(best.sigma[name]), *spans[name]) for name in compared)


def play_all(seed: int, count: int, jobs: int, progress: Progress | None = None, departure: str | None = None) -> list[PlayedHard]:
    """The first cases of a seed, or the first with one departure, in order; the result does not depend on the number of jobs."""
    return play_each(play_hard, draw_hard_many(seed, count, departure), jobs, progress)


def summary(played: Sequence[PlayedHard]) -> JsonDict:
    """The figures of the hard scoreboard.

    Returns
    -------
    dict
        `goals`, as on the usual scoreboard; `by_departure`: outcomes, share of good ones and median time; `kinds_of_verdict` and
        `reliability`: stated confidence against hit rate; `coverage`: share of 95 % intervals that contain the truth; `confusion`: hidden effect
        -> answer -> number; `findings`: departure -> serious finding -> number; `sure_and_wrong`, `wrong`, `troubles`: cases to examine.
    """
    by_departure: dict[str, list[PlayedHard]] = {name: [] for name in DEPARTURES}
    for one in played:
        by_departure[one.case.departure].append(one)
    by_departure = {name: ones for name, ones in by_departure.items() if ones}
    coverage = {name: _coverage(ones) for name, ones in by_departure.items()}
    goals = {
        "right, or family of at most three": goal([one.outcome in GOOD for one in played], STRICT_GOAL),
        "sure and wrong": goal([one.misleads for one in played], SURE_AND_WRONG_GOAL, at_most=True),
        "calibration of the kind of verdict that is furthest off": worst_kind(played, CALIBRATION_GOAL),
        "expected calibration error": goal_of(calibration_error(played), CALIBRATION_GOAL, len(played), at_most=True),
        "95 % intervals that hold the truth, worst departure": _worst_coverage(coverage),
    }
    return {
        "schema": "motoremi.scoreboard-hard/1",
        "cases": len(played),
        "goals": goals,
        "by_departure": {name: _departure(ones) for name, ones in by_departure.items()},
        "reliability": reliability(played),
        "kinds_of_verdict": by_kind_of_verdict(played),
        "coverage": coverage,
        "confusion": _counted(played, lambda one: " + ".join(sorted(one.case.hidden)) or "none", _said),
        "findings": _counted(played, lambda one: one.case.departure, lambda one: one.findings or ("no serious finding",)),
        "seconds": seconds([one.answer for one in played]),
        "sure_and_wrong": [one.to_dict() for one in played if one.misleads],
        "wrong": [one.to_dict() for one in played if one.outcome not in GOOD],
        "troubles": [{"index": one.case.index, "trouble": one.answer.trouble} for one in played if one.answer.trouble],
    }


def _said(one: PlayedHard) -> tuple[str, ...]:
    return (" + ".join(one.answer.effects) or one.answer.verdict,)


def _counted(
    played: Sequence[PlayedHard], key: Callable[[PlayedHard], str], values: Callable[[PlayedHard], tuple[str, ...]]
) -> dict[str, dict[str, int]]:
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    for one in played:
        counts[key(one)].update(values(one))
    return {name: dict(counter) for name, counter in sorted(counts.items())}


def _departure(ones: Sequence[PlayedHard]) -> JsonDict:
    return {
        "cases": len(ones),
        "outcomes": dict(Counter(one.outcome for one in ones)),
        "good": float(np.mean([one.outcome in GOOD for one in ones])),
        "seconds": seconds([one.answer for one in ones])["median"],
    }


def _coverage(ones: Sequence[PlayedHard]) -> JsonDict:
    inside = [element.inside for one in ones for element in one.elements]
    misses = Counter(element.name for one in ones for element in one.elements if not element.inside)
    return {
        "cases": sum(bool(one.elements) for one in ones),
        "intervals": len(inside),
        "inside": float(np.mean(inside)) if inside else None,
        "missed": dict(misses),
    }


def _worst_coverage(coverage: dict[str, JsonDict]) -> JsonDict:
    rows = [row for row in coverage.values() if row["cases"] >= LEAST_MOTORS]
    worst = min((row["inside"] for row in rows), default=None)
    return goal_of(worst, COVERAGE_GOAL, sum(row["cases"] for row in rows))
