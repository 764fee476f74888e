"""How far a session's run has come, and what has to be done again before it can go on."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from motoremi.arrays import JsonDict
from motoremi.bench.procedure import Planned
from motoremi.bench.steps import Check, Compensate, Connect, Final, Identify, MeasuringStep, Scan, Sweep, Wait


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
    """

    steps: int = 0
    stored: int = 0
    connections: int = 0
    maxima: Mapping[int, tuple[JsonDict, ...]] = field(default_factory=dict)
    identities: Mapping[str, JsonDict] = field(default_factory=dict)
    verdicts: tuple[JsonDict, ...] = ()

    @classmethod
    def of(cls, documents: Iterable[Mapping[str, Any]]) -> Done:
        """Read it from the documents of a session."""
        steps = stored = connections = current = 0
        identities: dict[str, JsonDict] = {}
        verdicts: dict[int, JsonDict] = {}
        maxima: dict[int, tuple[JsonDict, ...]] = {}
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
            elif kind == "verdict":
                verdicts[int(document["step"])] = document["result"]
        return cls(steps, stored, connections, maxima, identities, tuple(verdicts[number] for number in sorted(verdicts) if number <= steps))


def needed_again(plan: tuple[Planned, ...], done: Done) -> set[int]:
    """Numbers of finished steps that the rest of the plan stands on: who is connected, compensation, the operator's connection and its wait."""
    before, after = plan[: done.steps], [planned.step for planned in plan[done.steps :]]
    again: set[int] = set()
    if any(isinstance(step, MeasuringStep) for step in after):
        again.update(planned.number for planned in before if isinstance(planned.step, Identify))
    if any(isinstance(step, Sweep | Check | Compensate) for step in after):
        last = {planned.step.standard: planned.number for planned in before if isinstance(planned.step, Compensate)}
        again.update(last.values())
    connected = [planned.number for planned in before if isinstance(planned.step, Connect)][-1:]
    until_next = after[: next((i for i, step in enumerate(after) if isinstance(step, Connect)), len(after))]
    if connected and any(isinstance(step, Sweep | Check | Scan | Final) for step in until_next):
        # What was waited for there, such as a warm motor, has passed too.
        again.update(connected, (planned.number for planned in before[connected[0] :] if isinstance(planned.step, Wait)))
    return again
