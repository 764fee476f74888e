"""The scoreboard of investigations: sealed motors are investigated to the end by each policy, and cost and result are scored."""

from __future__ import annotations

import time
import zlib
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from typing import TypeAlias

import numpy as np

from motoremi.arrays import JsonDict, Progress
from motoremi.blind.confidence import by_kind_of_verdict, calibration_error, goal, goal_of, reliability
from motoremi.blind.policies import OWN_POLICY, POLICIES, Assessment, Look, Offer
from motoremi.blind.rounds import play_each
from motoremi.blind.scoring import Answer, Outcome, hit, outcome
from motoremi.blind.sealed import STARTS, Evidence, Sealed, draw_sealed_many
from motoremi.data.measurement import Measurement
from motoremi.data.mislabelled import measured_twice
from motoremi.diagnosis.diagnosis import Diagnosis
from motoremi.investigation.question import next_question
from motoremi.investigation.rivals import OUTSIDE, Lessons
from motoremi.workflow_assess import searched, with_lessons

ODDS, BUDGET_MINUTES = 20.0, 240.0
# Largest number of measurements of a run.
MOST_STEPS = 24
# Searches that are kept for evidence with the same reference sweeps: each takes up to 100 MB, and the policies of one motor need up to 125.
SEARCHES_KEPT = 8
NAMED_GOAL, WRONG_GOAL, CALIBRATION_GOAL, MISTAKES_GOAL = 0.95, 0.02, 0.05, 0.90
MINUTES_GOALS: Mapping[str, float] = {"fixed order": 0.5, "random": 0.5, "cheapest first": 0.7, "clairvoyant": 1.3}
SECONDS_GOAL, SURE = 5.0, 0.8

Judge: TypeAlias = Callable[[Evidence], Assessment]
# Name and number of each measurement so far, in order: what the earlier ones taught is computed already, and it is what a session would hold.
_Done: TypeAlias = tuple[tuple[str, int], ...]


class ThisSoftware:
    """The assessment of evidence by this software; the last searches, on the reference sweeps alone, are cached."""

    def __init__(self) -> None:
        self._searched: dict[bytes, tuple[Diagnosis, Lessons]] = {}

    def __call__(self, evidence: Evidence) -> Assessment:
        """The probabilities of the explanations, and the next measurement."""
        measurement = Measurement.of(evidence.sweeps, values=evidence.values)
        reference = [sweep for sweep in evidence.sweeps if sweep.condition is None]
        key = b"".join(sweep.impedance_ohm.tobytes() for sweep in reference)
        started = time.perf_counter()
        kept = self._searched.pop(key) if key in self._searched else with_lessons(searched(Measurement.of(reference)))
        # The one used last comes last in the dictionary.
        self._searched[key] = found, lessons = kept
        if len(self._searched) > SEARCHES_KEPT:
            del self._searched[next(iter(self._searched))]
        ready = time.perf_counter()
        rivals = lessons.after(measurement)
        # Several policies may end with this evidence.
        conclude = cache(lambda: _answer(found.informed_by(measurement)))
        mistaken = tuple(taught.id.partition("=")[0] for taught in rivals.taught if taught.mistakes) + _mislabelled(measurement)

        def asked(without: tuple[str, ...]) -> Assessment:
            question = next_question(rivals, measurement, without, ODDS).to_dict()
            listed = ([question] if question["id"] else []) + list(question["alternatives"])
            offers = tuple(Offer.of(one) for one in listed if one.get("asks"))
            return Assessment(rivals.by_label, offers, conclude, str(question["stop"] or ""), mistaken, without=asked)

        first = asked(())
        return replace(first, seconds=time.perf_counter() - ready, search_seconds=ready - started)


def _mislabelled(measurement: Measurement) -> tuple[str, ...]:
    """Requests whose sweep is the other termination's again."""
    twice = measured_twice(measurement.sweeps, measurement.floors)
    return tuple(f"{termination}-sweep" for termination in (*measurement.mislabelled, *(() if twice is None else (twice.wrong,))))


def _answer(found: Diagnosis) -> Answer:
    return Answer(found.verdict, found.effects, found.families, found.confidence)


@dataclass(frozen=True)
class Run:
    """One investigation by one policy.

    Parameters
    ----------
    policy : str
    steps : tuple of str
        The measurements, in order.
    minutes : float
        Time at the bench.
    stop : str
    answer : Answer
        The final answer.
    outside : float
        Probability, at the end, of an effect outside the catalogue.
    made, found, alarms : tuple of str
        Measurements with a mistake of the operator, those of them that were noticed, and correct ones that were taken for mistakes.
    seconds, search_seconds : tuple of float
        Time of each decision, and of the search before it (0 without a search).
    """

    policy: str
    steps: tuple[str, ...]
    minutes: float
    stop: str
    answer: Answer
    outside: float = 0.0
    made: tuple[str, ...] = ()
    found: tuple[str, ...] = ()
    alarms: tuple[str, ...] = ()
    seconds: tuple[float, ...] = ()
    search_seconds: tuple[float, ...] = ()


@dataclass(frozen=True)
class PlayedRun:
    """A run with the truth, for the tables of calibration.

    Parameters
    ----------
    case : Sealed
    run : Run
    detectable : bool
        Whether all hidden effects are visible in the motor's two sweeps; other cases are in no goal.
    """

    case: Sealed
    run: Run
    detectable: bool = True

    @property
    def answer(self) -> Answer:
        """The final answer."""
        return self.run.answer

    @property
    def outcome(self) -> Outcome:
        """Score of the final answer."""
        return outcome(self.case.hidden, self.run.answer)

    @property
    def hit(self) -> bool:
        """Whether the answer is true in the sense of its stated confidence: a family may have any size."""
        return hit(self.case.hidden, self.run.answer, self.detectable)

    @property
    def settled(self) -> bool:
        """Named, or proven inseparable: a family counts only if no measurement of the menu could distinguish its members.

        For an effect outside the catalogue this also holds if the answer lists "outside the catalogue" among the explanations that cannot be
        distinguished.
        """
        unknown = any(name.startswith("outside-") for name in self.case.hidden) and self.run.outside > 1 / (1 + ODDS)
        return self.outcome == "right" or (self.run.stop == "inseparable" and (unknown or self.outcome == "family"))

    @property
    def wrong(self) -> bool:
        """Whether the final answer is wrong."""
        return self.outcome in ("wrong", "false alarm", "crashed") and not self.settled

    def to_dict(self) -> JsonDict:
        """Plain data."""
        scores = {"outcome": self.outcome, "settled": self.settled, "detectable": self.detectable}
        return {**asdict(self.case), **asdict(self.run), **asdict(self.run.answer), **scores}


def play(case: Sealed, judge: Judge | None = None, policies: Sequence[str] = tuple(POLICIES)) -> list[PlayedRun]:
    """Investigate one sealed motor by each policy; evidence that several of them collect is assessed once."""
    known: dict[_Done, Assessment] = {}
    assess = judge or ThisSoftware()

    def assessed(done: _Done, asked: Mapping[str, Offer]) -> Assessment:
        if done not in known:
            evidence = case.begin()
            for name, turn in done:
                evidence = evidence.plus(case.give(asked[name].asked, turn).evidence)
            known[done] = assess(evidence)
        return known[done]

    detectable = case.detectable()
    return [PlayedRun(case, _guarded(case, name, assessed), detectable) for name in policies]


def _guarded(case: Sealed, policy: str, assessed: Callable[[_Done, Mapping[str, Offer]], Assessment]) -> Run:
    try:
        return _run(case, policy, assessed)
    except Exception as error:  # a crash is scored as an answer and must not stop the other cases
        trouble = f"{type(error).__name__}: {error}"
        return Run(policy, (), 0.0, "", Answer("crashed", (), (), 0.0, trouble=trouble))


def _run(case: Sealed, policy: str, assessed: Callable[[_Done, Mapping[str, Offer]], Assessment]) -> Run:
    rng = np.random.default_rng([case.seed, case.index, zlib.crc32(policy.encode())])
    done: _Done = ()
    asked: dict[str, Offer] = {}
    made: list[str] = []
    seconds: list[float] = []
    searches: list[float] = []
    noticed: set[str] = set()
    minutes = 0.0

    def with_it(offer: Offer) -> _Done:
        return (*done, (offer.id, sum(name == offer.id for name, _ in done)))

    def look(offer: Offer) -> Assessment:
        return assessed(with_it(offer), {**asked, offer.id: offer})

    now = assessed((), {})
    while True:
        seconds.append(now.seconds)
        searches.append(now.search_seconds)
        left_minutes = BUDGET_MINUTES - minutes
        now = now.within(left_minutes)
        noticed.update(now.mistaken)
        # Repeats are always possible. No policy makes the same twice, unless this software requests it again.
        again = {name for name, _ in done} - {offer.id for offer in now.offers[:1]}
        offers = [offer for offer in now.offers if offer.id not in again]
        left = [offer for offer in offers if offer.minutes <= left_minutes]
        if now.stop or not left or len(done) >= MOST_STEPS:
            stop = now.stop or ("budget" if offers else "nothing-left")
            break
        offer = _chosen(policy, now, left, look, case, rng)
        done = with_it(offer)
        if case.give(offer.asked, done[-1][1]).mistake is not None:
            made.append(offer.id)
        asked[offer.id] = offer
        minutes += offer.minutes
        now = assessed(done, asked)
    found = tuple(name for name in made if name in noticed)
    alarms = tuple(sorted(noticed - set(made)))
    outside = now.probabilities.get(OUTSIDE, 0.0)
    return Run(
        policy, tuple(name for name, _ in done), minutes, stop, now.conclude(), outside, tuple(made), found, alarms, tuple(seconds), tuple(searches)
    )


def _chosen(policy: str, now: Assessment, left: list[Offer], look: Look, case: Sealed, rng: np.random.Generator) -> Offer:
    return POLICIES[policy](replace(now, offers=tuple(left)), look, case.hidden, rng)


def play_all(seed: int, count: int, jobs: int, progress: Progress | None = None) -> list[PlayedRun]:
    """The runs of all policies on the first motors of a seed; the result does not depend on the number of jobs."""
    return [one for runs in play_each(play, draw_sealed_many(seed, count), jobs, progress) for one in runs]


def summary(played: Sequence[PlayedRun]) -> JsonDict:
    """The figures of the scoreboard.

    Returns
    -------
    dict
        `goals`, as on the other scoreboards, of this software's policy; `by_policy`: share settled, wrong, median minutes, stops; `by_start`: the
        same for each start of this policy; `reliability` and `kinds_of_verdict`: stated confidence against hit rate; `mistakes`: made and
        noticed; `seconds` a decision and `search_seconds` a search; `unsettled` and `troubles`: runs to look at.
    """
    by_policy = {name: [one for one in played if one.run.policy == name and one.detectable] for name in POLICIES}
    by_policy = {name: ones for name, ones in by_policy.items() if ones}
    own = by_policy.get(OWN_POLICY, [])
    made = [(one, name) for one in own for name in one.run.made]
    seconds = [second for one in own for second in one.run.seconds]
    searches = [second for one in own for second in one.run.search_seconds if second]
    goals = {
        "named, or proven inseparable": goal([one.settled for one in own], NAMED_GOAL),
        "wrong": goal([one.wrong for one in own], WRONG_GOAL, at_most=True),
        **{f"median minutes, of those of {name}": _minutes_goal(by_policy, name, wanted) for name, wanted in MINUTES_GOALS.items()},
        "expected calibration error": goal_of(calibration_error(own) if own else None, CALIBRATION_GOAL, len(own), at_most=True),
        "operator's mistakes found": goal([name in one.run.found for one, name in made], MISTAKES_GOAL),
        "mistakes behind a wrong name stated above 0.8": goal(
            [one.wrong and one.answer.confidence > SURE for one in own if one.run.made], 0.0, at_most=True
        ),
        "decisions that take longer than 5 s": goal([second > SECONDS_GOAL for second in seconds], 0.0, at_most=True),
    }
    return {
        "schema": "motoremi.scoreboard-investigation/1",
        "cases": sum(one.run.policy == OWN_POLICY for one in played),
        "too_weak_to_see": sum(one.run.policy == OWN_POLICY and not one.detectable for one in played),
        "goals": goals,
        "by_policy": {name: _figures(ones) for name, ones in by_policy.items()},
        "by_start": {start: _figures(ones) for start in STARTS if (ones := [one for one in own if one.case.start == start])},
        "reliability": reliability(own),
        "kinds_of_verdict": by_kind_of_verdict(own),
        "mistakes": {
            "made": len(made),
            "found": sum(name in one.run.found for one, name in made),
            "false_alarms": sum(len(one.run.alarms) for one in own),
        },
        "seconds": _seconds(seconds),
        "search_seconds": _seconds(searches),
        "unsettled": [one.to_dict() for one in own if not one.settled],
        "troubles": [{"index": one.case.index, "policy": one.run.policy, "trouble": one.answer.trouble} for one in played if one.answer.trouble],
    }


def _seconds(measured: Sequence[float]) -> JsonDict:
    return {"count": len(measured), "median": float(np.median(measured)) if measured else None, "largest": max(measured, default=None)}


def _minutes_goal(by_policy: Mapping[str, Sequence[PlayedRun]], name: str, wanted: float) -> JsonDict:
    """Median minutes of this software's policy divided by those of another policy, on the same motors."""
    own, other = by_policy.get(OWN_POLICY, ()), by_policy.get(name, ())
    if not own or not other or not (median := _median(other)):
        return goal_of(None, wanted, 0, at_most=True)
    return goal_of(_median(own) / median, wanted, len(own), at_most=True)


def _median(ones: Sequence[PlayedRun]) -> float:
    return float(np.median([one.run.minutes for one in ones]))


def _figures(ones: Sequence[PlayedRun]) -> JsonDict:
    return {
        "motors": len(ones),
        "settled": float(np.mean([one.settled for one in ones])),
        "wrong": float(np.mean([one.wrong for one in ones])),
        "median_minutes": _median(ones),
        "median_steps": float(np.median([len(one.run.steps) for one in ones])),
        "outcomes": dict(Counter(one.outcome for one in ones)),
        "stops": dict(Counter(one.run.stop for one in ones)),
    }
