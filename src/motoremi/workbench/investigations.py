"""An investigation on the bench, begun from a page: measurements are made until one explanation is left, or only the next one."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from motoremi.data.conditions import VALUES, SingleValue
from motoremi.data.session import reopen
from motoremi.errors import BadInput
from motoremi.quantities import parse_minutes
from motoremi.run.answer import Answer, NotDone
from motoremi.run.requested import MeasurementRequest, read_value
from motoremi.schema.bench_file import BenchFile
from motoremi.schema.procedure import Procedure
from motoremi.workbench.events import Events
from motoremi.workbench.runs import Run, Stopped
from motoremi.workflow_ask import refuse_unknown
from motoremi.workflow_investigate import ENDS, MOST_STEPS, Assessment, Step
from motoremi.workflow_on_bench import Plan, investigate_on_bench

BUDGET = "2h"
LONGEST = 40


def plan_of(body: Mapping[str, Any]) -> Plan:
    """The plan of an investigation that a page requests.

    Parameters
    ----------
    body : mapping
        `budget`, a time such as `30min`; `without`, identifiers of measurements; `one`, whether only the next measurement is made.

    Raises
    ------
    BadInput
        If one of them cannot be read.
    """
    budget, without = body.get("budget") or BUDGET, body.get("without", [])
    if not isinstance(budget, str) or len(budget) > LONGEST:
        raise BadInput("the budget must be a time, for example 30min")
    if not isinstance(without, list) or not all(isinstance(name, str) for name in without):
        raise BadInput("without must be a list of measurements")
    refuse_unknown(without)
    return Plan(parse_minutes(budget), without=tuple(without), most=1 if body.get("one") else MOST_STEPS)


class InvestigationRun(Run):
    """One run of an investigation; the operator of a real bench is asked on the page.

    Parameters
    ----------
    session, folder, events
        As for `Run`.
    procedure, bench_file
        From `workflow_on_bench.prepared`.
    plan : Plan
    """

    shown_by = "next"

    def __init__(self, session: str, procedure: Procedure, bench_file: BenchFile, plan: Plan, folder: Path, events: Events) -> None:
        super().__init__(session, procedure.title, 0, folder, events)
        self._procedure = procedure
        self._bench_file = bench_file
        self._plan = plan
        self._request: MeasurementRequest | None = None
        self._value: SingleValue | None = None

    def prompt(self, text: str) -> Answer | None:
        """Show the operator an instruction and wait for the answer."""
        return self._ask_operator(text)

    def value(self, request: MeasurementRequest) -> SingleValue:
        """Ask the operator for a value and wait for it."""
        self._request, self._value = request, None
        answer = self._ask_operator(request.instruction, VALUES[request.id].setting.example)
        if answer == "stop":
            raise Stopped
        if self._value is None:
            raise NotDone(f"the operator has no value for {request.id}")
        return self._value

    def give(self, text: str) -> None:
        """Pass on the value that the operator was asked for."""
        if self._request is None or not self._example:
            raise BadInput("no value is asked for")
        self._value = read_value(self._request, text)
        self.answer("done")

    def _measure(self) -> None:
        with reopen(self.folder) as writer:
            writer.subscribe(self._document)
            self._begun.set()
            found = investigate_on_bench(self._procedure, self._bench_file, writer, self._plan, self, self._assessed, self._diagnosing, self._tick)
        self.complete = ENDS[found.stop]

    def _assessed(self, assessment: Assessment, step: Step | None) -> None:
        self._report("measuring", 0.0, None)

    def _diagnosing(self, name: str, done: int, total: int) -> None:
        self._tick()
        self._report(f"diagnosing: {name}", done / total if total else 0.0, None)
