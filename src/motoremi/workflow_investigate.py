"""An investigation: choose, request and make measurements until one explanation is left; each result is stored before the next request.

The loop uses neither instruments nor mathematics itself: `Assess` gives the explanations and the next measurement, a `MeasuringBench` measures.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

from motoremi.arrays import JsonDict
from motoremi.data.conditions import REFERENCE, Condition, SingleValue, condition
from motoremi.data.session import load
from motoremi.data.sweep import TERMINATIONS
from motoremi.run.answer import NotDone
from motoremi.run.requested import MeasurementRequest
from motoremi.workflow import Store

SCHEMA = "motoremi.investigation/1"
# Reasons to stop in addition to those of `motoremi next`: no time is left; no measurement is left that this operator can make; this run has
# made as many as it was allowed.
BUDGET, EXHAUSTED, PAUSED = "budget", "nothing-left", "paused"
# Each reason in words.
ENDS = {
    "one-stands": "one explanation is left",
    "inseparable": "no measurement of the menu can distinguish the explanations that are left",
    "nothing-missing": "nothing is missing that these data could show",
    BUDGET: "the measurements that are left take longer than the time that is left",
    EXHAUSTED: "no measurement is left that this bench can make",
    PAUSED: "the measurements asked for have been made",
}
# Limits the loop if a bench always gives the same answer.
MOST_STEPS = 60
# Replaces a probability of zero in logarithms.
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
class Assessment:
    """The state of knowledge from all data so far.

    Parameters
    ----------
    probabilities : dict
        Explanation -> probability, the most probable first.
    error_percent : float
        Error of the best model.
    ask : callable
        Measurements that cannot be made -> next measurement, as `motoremi next --json`.
    conclude : callable
        Returns the diagnosis, as `motoremi diagnose --json`.
    findings : tuple of dict
        Findings about the data, and about sweeps that are not as requested.
    """

    probabilities: Mapping[str, float]
    error_percent: float
    ask: Callable[[Collection[str]], JsonDict]
    conclude: Callable[[], JsonDict]
    findings: tuple[JsonDict, ...] = ()


# Assesses everything in the session.
Assess = Callable[[], Assessment]


class MeasuringBench(Protocol):
    """A bench with its operator, real or simulated."""

    def sweep(self, request: MeasurementRequest) -> None:
        """Have the condition set up and sweeps measured; raises `NotDone` if the operator answers "not done"."""
        ...

    def value(self, request: MeasurementRequest) -> SingleValue:
        """Have another meter read; raises `NotDone` if the operator answers "not done"."""
        ...

    def minutes(self, estimated: float) -> float:
        """Duration of the last measurement; a simulated bench returns the estimate."""
        ...


@dataclass(frozen=True)
class Step:
    """One measurement of an investigation.

    Parameters
    ----------
    id : str
    minutes : float
    probabilities : dict
        Explanation -> probability after it.
    taught_bits : float
        Information gained: the divergence of the probabilities after from those before.
    error_percent : float
        Error of the best model after it.
    why : str
        Reason for the measurement.
    brought : str
        Its result as text: the condition under which sweeps were measured, or the value that was read.
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
            # As in the steps whose results were imported from files, which have no `id`; the report reads this key of both.
            "asked": self.id,
            "why": self.why,
            "brought": self.brought,
        }


@dataclass(frozen=True)
class Investigation:
    """Result of an investigation.

    Parameters
    ----------
    steps : tuple of Step
        Including those of earlier runs of the same investigation.
    refused : tuple of str
        Measurements that the operator answered with "not done".
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
        """Total time of all steps."""
        return math.fsum(step.minutes for step in self.steps)

    def to_dict(self) -> JsonDict:
        """Plain data of `motoremi investigate --json`."""
        return {
            "schema": SCHEMA,
            "steps": [step.to_dict() for step in self.steps],
            "refused": list(self.refused),
            "minutes": self.minutes,
            "stop": self.stop,
            "diagnosis": self.diagnosis,
        }


@dataclass
class _History:
    """Progress of an investigation, read from the documents of its session."""

    steps: list[Step] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)
    # A request without its answer because the run was stopped, and how often each sweep or value for it has been stored.
    pending: JsonDict | None = None
    stored: Counter[str] = field(default_factory=Counter)

    @classmethod
    def of(cls, documents: Sequence[JsonDict]) -> _History:
        history = cls()
        for document in documents:
            kind = document["kind"]
            if kind == "asked":
                history.pending, history.stored = document, Counter()
            elif kind == "sweep" and history.pending is not None and _condition_of(document) == history.pending["order"]["condition"]:
                # Sweeps under another condition were imported between two runs.
                history.stored[str(document["termination"])] += 1
            elif kind == "value":
                history.stored[str(document["name"])] += 1
            elif kind == "answered":
                history.steps.append(Step(**{name: document[name] for name in Step.__dataclass_fields__}))
                history.pending = None
            elif kind == "refused":
                history.refused.append(str(document["id"]))
                history.pending = None
        return history

    def turn(self, name: str) -> int:
        """How often this measurement was made before."""
        return sum(step.id == name for step in self.steps)

    def rest(self, request: MeasurementRequest) -> MeasurementRequest | None:
        """The part of the pending request that is not stored yet; None if all of it is stored."""
        if request.is_value:
            return None if self.stored[request.id] else request
        left = tuple(name for name in request.terminations if self.stored[name] < request.repeats)
        return replace(request, terminations=left) if left else None


def _condition_of(document: JsonDict) -> str | None:
    """The condition of a stored sweep as a request has it."""
    condition = document.get("condition")
    return None if condition is None else Condition.restored(condition).text


def investigate(
    store: Recorder,
    assess: Assess,
    bench: MeasuringBench,
    budget_minutes: float,
    tell: Callable[[Assessment, Step | None], None] = lambda assessment, step: None,
    without: Collection[str] = (),
    most: int = MOST_STEPS,
) -> Investigation:
    """Request, measure and assess until one explanation is left, no measurement can distinguish the remaining ones, or the time is used up.

    Parameters
    ----------
    store : Recorder
        An open session; it stays open. Requests and answers of earlier runs of the investigation are read from it.
    assess : callable
    bench : MeasuringBench
    budget_minutes : float
        Time of all runs together.
    tell : callable, optional
        Receives the assessment at the beginning (without a step) and after each step.
    without : collection of str
        Measurements that this bench cannot make.
    most : int
        Measurements of this run; then it stops as `paused`, unless one explanation is left.

    Returns
    -------
    Investigation
        Also stored as the analysis `investigation`.
    """
    history = _History.of(load(store.path).used_documents)
    return _Run(store, assess, bench, budget_minutes, tell, tuple(without), history, len(history.steps) + most).to_the_end()


@dataclass(frozen=True)
class _Run:
    store: Recorder
    assess: Assess
    bench: MeasuringBench
    budget_minutes: float
    tell: Callable[[Assessment, Step | None], None]
    without: tuple[str, ...]
    history: _History
    # How many steps there may be in all when this run ends.
    most_steps: int

    def to_the_end(self) -> Investigation:
        assessment = self.assess()
        self.tell(assessment, None)
        if (pending := self.history.pending) is not None:
            # Data that an earlier run stored before it was stopped are kept; the rest is requested again.
            rest = self.history.rest(MeasurementRequest.restored(pending["order"]))
            before = pending.get("probabilities", assessment.probabilities)
            asked = pending if rest is None else self._ask(rest, float(pending["minutes"]), str(pending["why"]), before)
            assessment = self._answered(asked, rest, assessment)
        while True:
            stop, question = self._question(assessment)
            if stop:
                found = Investigation(tuple(self.history.steps), tuple(self.history.refused), stop, assessment.conclude())
                self.store.save_analysis(
                    "investigation", {**found.to_dict(), "steps": [*self._by_files(), *(step.to_dict() for step in found.steps)]}
                )
                return found
            request = request_of(question, self.history.turn(name_of(question)))
            asked = self._ask(request, float(question["minutes"]), str(question.get("why", "")), assessment.probabilities)
            assessment = self._answered(asked, request, assessment)

    def _by_files(self) -> list[JsonDict]:
        """Earlier steps, whose results were imported from files."""
        stored = load(self.store.path).analysis("investigation") or {}
        return [step for step in stored.get("steps", []) if "minutes" not in step]

    def _ask(self, request: MeasurementRequest, minutes: float, why: str, probabilities: Mapping[str, float]) -> JsonDict:
        # With the probabilities before it: a run that continues finds data of this request in the session already.
        return self.store.emit("asked", id=request.id, minutes=minutes, why=why, order=request.to_dict(), probabilities=dict(probabilities))

    def _answered(self, asked: JsonDict, request: MeasurementRequest | None, before: Assessment) -> Assessment:
        """The assessment after the answer to a request; `request` is None if it was carried out before."""
        brought = str(asked["order"]["condition"] or asked["id"])
        try:
            if request is not None and request.is_value:
                value = self.bench.value(request)
                self.store.add_value(value)
                brought = value.text
            elif request is not None:
                self.bench.sweep(request)
                self._clear_ladder(request)
        except NotDone:
            self.store.emit("refused", id=asked["id"])
            self.history.refused.append(str(asked["id"]))
            return before
        after = self.assess()
        step = Step(
            str(asked["id"]),
            self.bench.minutes(float(asked["minutes"])),
            after.probabilities,
            taught_bits(asked.get("probabilities", before.probabilities), after.probabilities),
            after.error_percent,
            str(asked["why"]),
            brought,
        )
        self.store.emit("answered", **step.to_dict())
        self.history.steps.append(step)
        self.tell(after, step)
        return after

    def _clear_ladder(self, request: MeasurementRequest) -> None:
        """Empty the ladder after further reference sweeps, because its models were fitted to fewer of them."""
        session = load(self.store.path)
        if request.condition is None and session.ladder:
            self.store.save_analysis("ladder", session.emptied_ladder())

    def _question(self, assessment: Assessment) -> tuple[str, JsonDict]:
        """Reason to stop (empty: continue) and next measurement; a measurement longer than the remaining time is not requested."""
        left_minutes = self.budget_minutes - math.fsum(step.minutes for step in self.history.steps)
        too_long: list[str] = []
        while True:
            question = assessment.ask([*self.without, *self.history.refused, *too_long])
            stop = str(question.get("stop") or "")
            if stop or not question.get("asks"):
                # Explanations that are inseparable without the long measurements might be separable with them.
                return (BUDGET if too_long else stop or EXHAUSTED), {}
            if len(self.history.steps) >= MOST_STEPS:
                return EXHAUSTED, {}
            if len(self.history.steps) >= self.most_steps:
                return PAUSED, {}
            if float(question["minutes"]) <= left_minutes:
                return "", question
            too_long.append(str(question["id"]))


def request_of(question: JsonDict, turn: int = 0) -> MeasurementRequest:
    """The request for a measurement of `motoremi next --json`.

    Parameters
    ----------
    question : dict
        With `id` and `asks`.
    turn : int
        How often the same was requested before.
    """
    name, asks = name_of(question), question["asks"]
    if asks["kind"] == "value":
        return MeasurementRequest(name, str(asks["instruction"]), terminations=(), turn=turn)
    given = asks.get("termination")
    terminations = tuple(termination for termination in TERMINATIONS if given in (None, "both", termination))
    known = question.get("condition_id", None if name in REFERENCE else name)
    under = None if known is None else condition(str(known), asks.get("value"))
    instruction, hands = str(asks["instruction"]), bool(question.get("hands", True))
    if hands and under is not None and under.value is not None:
        # The operator has to know the value that is stored with the sweeps.
        instruction = f"{instruction} (stored as {under.text})"
    return MeasurementRequest(name, instruction, under, terminations, int(asks.get("repeats", 1)), turn, hands)


def name_of(question: JsonDict) -> str:
    """The measurement of the menu that is requested, also if a laboratory's own measurement replaces it."""
    return str(question.get("like", question["id"]))


def taught_bits(before: Mapping[str, float], after: Mapping[str, float]) -> float:
    """Divergence of the probabilities after from those before, in bits; explanations that were not listed had almost no probability."""
    total = math.fsum(after.values()) or 1.0
    terms = [(share / total) * math.log2((share / total) / max(before.get(name, 0.0), _LEAST)) for name, share in after.items() if share > 0]
    return max(0.0, math.fsum(terms))
