"""How far a session's run has come, and what has to be done again before it can go on."""

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
    """What a session holds of its procedure.

    Parameters
    ----------
    steps : int
        How many steps were finished, from the first on.
    stored : int
        Sweeps or spectra stored by the step after those.
    connections : int
        Highest number given to a connection.
    maxima : mapping
        Number of a final measurement to the maxima that were chosen for it.
    identities : mapping
        Role to who answered.
    verdicts : tuple of dict
        What the judging steps said.
    left_on : bool
        Whether a supply was connected and never proved to be off: the run was killed.
    """

    steps: int = 0
    stored: int = 0
    connections: int = 0
    maxima: Mapping[int, tuple[JsonDict, ...]] = field(default_factory=dict)
    identities: Mapping[str, JsonDict] = field(default_factory=dict)
    verdicts: tuple[JsonDict, ...] = ()
    left_on: bool = False

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
        said = tuple(verdicts[number] for number in sorted(verdicts) if number <= steps)
        return cls(steps, stored, connections, maxima, identities, said, left_on)


def needed_again(plan: tuple[Planned, ...], done: Done) -> set[int]:
    """Numbers of finished steps that the rest of the plan stands on: who is connected, compensation, the operator's connection and its wait."""
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
        # What was waited for there, such as a warm motor, has passed too.
        again.update(connected, (planned.number for planned in before[connected[0] :] if isinstance(planned.step, Wait)))
    return again | _state_again(before, after)


def _state_again(before: tuple[Planned, ...], after: list[PlainStep]) -> set[int]:
    """The supply was switched off when the run ended: what set it last, if that was on, and what was waited for since then."""
    last = [planned.number for planned in before if isinstance(planned.step, SupplyStep)][-1:]
    until_next = after[: next((i for i, step in enumerate(after) if isinstance(step, SupplyStep)), len(after))]
    if not any(isinstance(step, MeasuringStep | WaitFor) for step in until_next):
        return set()
    since = before[last[0] :] if last else before
    again = set({planned.step.quantity: planned.number for planned in since if isinstance(planned.step, WaitFor)}.values())
    if last and before[last[0] - 1].step.parameters()["output"] == "on":
        again |= {*last, *(planned.number for planned in since if isinstance(planned.step, Wait))}
    return again
