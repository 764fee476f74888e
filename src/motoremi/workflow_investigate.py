"""An investigation: measure what decides until one explanation stands; everything measured is in the session before the next question.

The loop knows neither instruments nor mathematics: `think` says what stands and what to ask for, `Hands` measure.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

from motoremi.arrays import JsonDict
from motoremi.data.conditions import REFERENCE, SingleValue, condition
from motoremi.data.session import load
from motoremi.data.sweep import TERMINATIONS
from motoremi.run.answer import NotDone
from motoremi.run.requested import MeasurementRequest
from motoremi.workflow import Store

SCHEMA = "motoremi.investigation/1"
# Beside what `motoremi next` says: no time is left; nothing is left that this operator can do.
BUDGET, EXHAUSTED = "budget", "nothing-left"
# A bench that gives the same answer again and again is not asked for ever.
MOST_STEPS = 60
# A share of the probability that is as good as none, for logarithms.
_LEAST = 1e-9


class Recorder(Store, Protocol):
    """An open session that an investigation writes into; `motoremi.data.session.SessionWriter` is one."""

    def emit(self, kind: str, **content: Any) -> JsonDict:
        """Append one document."""
        ...

    def add_value(self, value: SingleValue) -> JsonDict:
        """Store a single value."""
        ...


@dataclass(frozen=True)
class Thought:
    """What the data in hand say.

    Parameters
    ----------
    probabilities : dict
        Of each explanation, the likeliest first.
    error_percent : float
        Of the best model.
    ask : callable
        What cannot be done -> what to measure next, as `motoremi next --json`.
    conclude : callable
        The diagnosis, as `motoremi diagnose --json`.
    findings : tuple of dict
        What the data themselves show, and what is not as it was asked for.
    """

    probabilities: Mapping[str, float]
    error_percent: float
    ask: Callable[[Collection[str]], JsonDict]
    conclude: Callable[[], JsonDict]
    findings: tuple[JsonDict, ...] = ()


# Looks at everything that the session holds.
Think = Callable[[], Thought]


class Hands(Protocol):
    """Who measures: a bench with its operator, real or simulated."""

    def sweep(self, order: MeasurementRequest) -> None:
        """Have it set up and measured; raises `NotDone` if the operator says no."""
        ...

    def value(self, order: MeasurementRequest) -> SingleValue:
        """Have another meter read; raises `NotDone` if the operator says no."""
        ...

    def minutes(self, estimated: float) -> float:
        """How long the last measurement took, beside what was estimated."""
        ...


@dataclass(frozen=True)
class Step:
    """One measurement of an investigation.

    Parameters
    ----------
    id : str
    minutes : float
    probabilities : dict
        What stood after it.
    taught_bits : float
        How far it moved what is believed: the divergence from before to after.
    error_percent : float
        Of the best model after it.
    why : str
        What it was asked for.
    brought : str
        What came, as it is written: the condition with its value, or the value.
    """

    id: str
    minutes: float
    probabilities: Mapping[str, float]
    taught_bits: float
    error_percent: float
    why: str = ""
    brought: str = ""

    def to_dict(self) -> JsonDict:
        """Plain data."""
        return {
            "id": self.id,
            "minutes": self.minutes,
            "probabilities": dict(self.probabilities),
            "taught_bits": self.taught_bits,
            "error_percent": self.error_percent,
            "asked": self.id,
            "why": self.why,
            "brought": self.brought,
        }


@dataclass(frozen=True)
class Investigation:
    """What came of it.

    Parameters
    ----------
    steps : tuple of Step
        Those of earlier runs of the same investigation too.
    refused : tuple of str
        What the operator would not do.
    stop : str
        `one-stands`, `inseparable`, `nothing-missing`, `budget` or `nothing-left`.
    diagnosis : dict
    """

    steps: tuple[Step, ...]
    refused: tuple[str, ...]
    stop: str
    diagnosis: JsonDict

    @property
    def minutes(self) -> float:
        """Spent in all."""
        return math.fsum(step.minutes for step in self.steps)

    def to_dict(self) -> JsonDict:
        """The contract's JSON."""
        return {
            "schema": SCHEMA,
            "steps": [step.to_dict() for step in self.steps],
            "refused": list(self.refused),
            "minutes": self.minutes,
            "stop": self.stop,
            "diagnosis": self.diagnosis,
        }


@dataclass
class _Path:
    """How far an investigation has come, read from the documents of its session."""

    steps: list[Step] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)
    # A question without its answer, because the run was stopped, and how often each sweep or value for it has been stored.
    pending: JsonDict | None = None
    stored: Counter[str] = field(default_factory=Counter)

    @classmethod
    def of(cls, documents: Sequence[JsonDict]) -> _Path:
        path = cls()
        for document in documents:
            kind = document["kind"]
            if kind == "asked":
                path.pending, path.stored = document, Counter()
            elif kind == "sweep":
                path.stored[str(document["termination"])] += 1
            elif kind == "value":
                path.stored[str(document["name"])] += 1
            elif kind == "answered":
                path.steps.append(Step(**{name: document[name] for name in Step.__dataclass_fields__}))
                path.pending = None
            elif kind == "refused":
                path.refused.append(str(document["id"]))
                path.pending = None
        return path

    def turn(self, name: str) -> int:
        """How often this was measured before."""
        return sum(step.id == name for step in self.steps)

    def rest(self, order: MeasurementRequest) -> MeasurementRequest | None:
        """What is left of the question that was pending; None if all of it is stored."""
        if order.is_value:
            return None if self.stored[order.id] else order
        left = tuple(name for name in order.terminations if self.stored[name] < order.repeats)
        return replace(order, terminations=left) if left else None


def investigate(
    store: Recorder,
    think: Think,
    hands: Hands,
    budget_minutes: float,
    tell: Callable[[Thought, Step | None], None] = lambda thought, step: None,
    without: Collection[str] = (),
) -> Investigation:
    """Ask, measure and think until one explanation stands, nothing can tell what stands apart, or the time is spent.

    Parameters
    ----------
    store : Recorder
        An open session; it stays open. What an earlier run of the investigation asked and got is read from it.
    think : callable
    hands : Hands
    budget_minutes : float
        Of all runs together.
    tell : callable, optional
        Told what stands at the beginning (without a step) and after each step.
    without : collection of str
        What this bench cannot do.

    Returns
    -------
    Investigation
        Also stored as the analysis `investigation`.
    """
    return _Run(store, think, hands, budget_minutes, tell, tuple(without), _Path.of(load(store.path).documents)).to_the_end()


@dataclass(frozen=True)
class _Run:
    store: Recorder
    think: Think
    hands: Hands
    budget_minutes: float
    tell: Callable[[Thought, Step | None], None]
    without: tuple[str, ...]
    path: _Path

    def to_the_end(self) -> Investigation:
        thought = self.think()
        self.tell(thought, None)
        if (pending := self.path.pending) is not None:
            # What was stored before an earlier run was stopped is kept; the rest is asked for once more.
            rest = self.path.rest(MeasurementRequest.restored(pending["order"]))
            asked = pending if rest is None else self._ask(rest, float(pending["minutes"]), str(pending["why"]))
            thought = self._answered(asked, rest, thought)
        while True:
            stop, question = self._question(thought)
            if stop:
                found = Investigation(tuple(self.path.steps), tuple(self.path.refused), stop, thought.conclude())
                self.store.save_analysis(
                    "investigation", {**found.to_dict(), "steps": [*self._by_files(), *(step.to_dict() for step in found.steps)]}
                )
                return found
            order = order_of(question, self.path.turn(str(question["id"])))
            thought = self._answered(self._ask(order, float(question["minutes"]), str(question.get("why", ""))), order, thought)

    def _by_files(self) -> list[JsonDict]:
        """What was asked for and brought by files before."""
        stored = load(self.store.path).analysis("investigation") or {}
        return [step for step in stored.get("steps", []) if "minutes" not in step]

    def _ask(self, order: MeasurementRequest, minutes: float, why: str) -> JsonDict:
        return self.store.emit("asked", id=order.id, minutes=minutes, why=why, order=order.to_dict())

    def _answered(self, asked: JsonDict, order: MeasurementRequest | None, before: Thought) -> Thought:
        """What stands after the answer to a question; None for an order that was carried out before."""
        brought = str(asked["order"]["condition"] or asked["id"])
        try:
            if order is not None and order.is_value:
                value = self.hands.value(order)
                self.store.add_value(value)
                brought = value.text
            elif order is not None:
                self.hands.sweep(order)
                self._forget_the_ladder(order)
        except NotDone:
            self.store.emit("refused", id=asked["id"])
            self.path.refused.append(str(asked["id"]))
            return before
        after = self.think()
        step = Step(
            str(asked["id"]),
            self.hands.minutes(float(asked["minutes"])),
            after.probabilities,
            taught_bits(before.probabilities, after.probabilities),
            after.error_percent,
            str(asked["why"]),
            brought,
        )
        self.store.emit("answered", **step.to_dict())
        self.path.steps.append(step)
        self.tell(after, step)
        return after

    def _forget_the_ladder(self, order: MeasurementRequest) -> None:
        """Its models were fitted to fewer sweeps."""
        if order.condition is None and load(self.store.path).ladder:
            self.store.save_analysis("ladder", {"schema": "motoremi.ladder/1", "steps": []})

    def _question(self, thought: Thought) -> tuple[str, JsonDict]:
        """Why to stop, empty to go on, and what to ask; what takes longer than the time that is left is not asked."""
        left_minutes = self.budget_minutes - math.fsum(step.minutes for step in self.path.steps)
        too_long: list[str] = []
        while True:
            following = thought.ask([*self.without, *self.path.refused, *too_long])
            stop = str(following.get("stop") or "")
            if stop or not following.get("asks"):
                # What is inseparable without the long measurements may not be so with them.
                return (BUDGET if too_long else stop or EXHAUSTED), {}
            if len(self.path.steps) >= MOST_STEPS:
                return EXHAUSTED, {}
            if float(following["minutes"]) <= left_minutes:
                return "", following
            too_long.append(str(following["id"]))


def order_of(question: JsonDict, turn: int = 0) -> MeasurementRequest:
    """The order that a question of `motoremi next --json` is.

    Parameters
    ----------
    question : dict
        With `id` and `asks`.
    turn : int
        How often the same was asked before.
    """
    name, asks = str(question["id"]), question["asks"]
    if asks["kind"] == "value":
        return MeasurementRequest(name, str(asks["instruction"]), terminations=(), turn=turn)
    given = asks.get("termination")
    terminations = tuple(termination for termination in TERMINATIONS if given in (None, "both", termination))
    # A laboratory's own measurement is known by the one of the menu that it answers in another way.
    known = question.get("condition_id", None if name in REFERENCE else name)
    under = None if known is None else condition(str(known), asks.get("value"))
    return MeasurementRequest(name, str(asks["instruction"]), under, terminations, int(asks.get("repeats", 1)), turn)


def taught_bits(before: Mapping[str, float], after: Mapping[str, float]) -> float:
    """Divergence of what is believed now from what was believed before, in bits; explanations that were not on the list had next to nothing."""
    total = math.fsum(after.values()) or 1.0
    terms = [(share / total) * math.log2((share / total) / max(before.get(name, 0.0), _LEAST)) for name, share in after.items() if share > 0]
    return max(0.0, math.fsum(terms))
