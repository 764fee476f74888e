"""Resuming a run: how far it has come, and which steps have to be repeated before it can continue."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from motoremi.arrays import JsonDict
from motoremi.schema.procedure import Planned
from motoremi.schema.procedure_steps import Check, Compensate, Connect, Final, Identify, MeasuringStep, PlainStep, Scan, Sweep, Wait
from motoremi.schema.state_steps import SupplyStep, WaitFor


@dataclass(frozen=True)
class Done:
    """How far a session's procedure has been done.

    Parameters
    ----------
    steps : int
        Number of finished steps, from the first.
    stored : int
        Sweeps or spectra that the next, unfinished step has stored.
    connections : int
        Highest number given to a connection.
    maxima : mapping
        Number of a final measurement to the maxima that were chosen for it.
    identities : mapping
        Identity of the instrument in each role.
    verdicts : tuple of dict
        Results of the judging steps.
    left_on : bool
        Whether a supply was connected and not confirmed to be off, because the run was killed.
    resumed : mapping
        What the document of the resumption states besides the steps: who resumes, and the procedure if the bench has changed.
    """

    steps: int = 0
    stored: int = 0
    connections: int = 0
    maxima: Mapping[int, tuple[JsonDict, ...]] = field(default_factory=dict)
    identities: Mapping[str, JsonDict] = field(default_factory=dict)
    verdicts: tuple[JsonDict, ...] = ()
    left_on: bool = False
    resumed: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, documents: Iterable[Mapping[str, Any]]) -> Done:
        """Read it from the documents of a session."""
        steps = stored = connections = current = 0
        identities: dict[str, JsonDict] = {}
        verdicts: dict[int, JsonDict] = {}
        maxima: dict[int, tuple[JsonDict, ...]] = {}
        left_on = False
        for document in documents:
            kind = document["kind"]
            if kind == "step-start":
                current = int(document["step"])
            elif kind == "step-stop" and current == steps + 1:
                steps, stored = current, 0
            elif kind == "maxima":
                maxima[int(document["step"])] = tuple(document["maxima"])
            elif kind in ("sweep", "spectrum", "final") and current == steps + 1:
                stored += 1
            elif kind == "connection":
                connections = max(connections, int(document["number"]))
            elif kind == "instrument":
                identities[str(document["role"])] = document["identity"]
                left_on |= document["role"] == "supply"
            elif kind == "safe" and document["role"] == "supply":
                left_on = not document["safe"]
            elif kind == "verdict":
                verdicts[int(document["step"])] = document["result"]
        kept = tuple(verdicts[number] for number in sorted(verdicts) if number <= steps)
        return cls(steps, stored, connections, maxima, identities, kept, left_on)


def needed_again(plan: tuple[Planned, ...], done: Done) -> set[int]:
    """Numbers of finished steps that the rest of the plan depends on: identify, compensation, the operator's connection and its wait."""
    before, after = plan[: done.steps], [planned.step for planned in plan[done.steps :]]
    again: set[int] = set()
    if done.left_on or any(isinstance(step, MeasuringStep | SupplyStep | WaitFor) for step in after):
        again.update(planned.number for planned in before if isinstance(planned.step, Identify))
    if any(isinstance(step, Sweep | Check | Compensate) for step in after):
        last = {planned.step.standard: planned.number for planned in before if isinstance(planned.step, Compensate)}
        again.update(last.values())
    connected = [planned.number for planned in before if isinstance(planned.step, Connect)][-1:]
    until_next = after[: next((i for i, step in enumerate(after) if isinstance(step, Connect)), len(after))]
    if connected and any(isinstance(step, Sweep | Check | Scan | Final) for step in until_next):
        # The state that was waited for there, such as a warm motor, is lost as well.
        again.update(connected, (planned.number for planned in before[connected[0] :] if isinstance(planned.step, Wait)))
    return again | _state_again(before, after)


def _state_again(before: tuple[Planned, ...], after: list[PlainStep]) -> set[int]:
    """Steps to repeat because the supply was switched off at the end of the run: the last one that set it, and later waits."""
    last = [planned.number for planned in before if isinstance(planned.step, SupplyStep)][-1:]
    until_next = after[: next((i for i, step in enumerate(after) if isinstance(step, SupplyStep)), len(after))]
    if not any(isinstance(step, MeasuringStep | WaitFor) for step in until_next):
        return set()
    since = before[last[0] :] if last else before
    again = set({planned.step.quantity: planned.number for planned in since if isinstance(planned.step, WaitFor)}.values())
    if last and before[last[0] - 1].step.parameters()["output"] == "on":
        again |= {*last, *(planned.number for planned in since if isinstance(planned.step, Wait))}
    return again
