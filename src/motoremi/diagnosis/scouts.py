"""Several looks at once: begun, advanced, followed and improved stage by stage, on two cores where there are two."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Hashable, Iterable, Mapping
from functools import partial
from types import TracebackType
from typing import Generic, TypeVar

import numpy as np

from motoremi.arrays import Progress
from motoremi.fitting.looks import Begun, Ends, Scouted, Trail, advance, begin, follow
from motoremi.fitting.polish import Polished
from motoremi.spread import Team

# One that after some more steps still leaves so many times what the best began with is not followed to the end.
HOPELESS_START = 30.0
# So many more than are followed to the end go some steps further than they were begun.
AHEAD = 6

Name = TypeVar("Name", bound=Hashable)


def nearest(looks: Mapping[Name, Begun] | Mapping[Name, Scouted]) -> list[Name]:
    """Those that describe the data best first."""
    return sorted(looks, key=lambda name: looks[name].objective)


class Scouts(Generic[Name]):
    """Looks at trails, by name. A context manager, which keeps a helper from one stage to the next.

    Parameters
    ----------
    trails : mapping
    """

    def __init__(self, trails: Mapping[Name, Trail]) -> None:
        self._trails = trails
        self._team = Team(trails)

    def __enter__(self) -> Scouts[Name]:
        self._team.__enter__()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._team.__exit__(kind, error, trace)

    def begun(self, names: Iterable[Name] | None = None, progress: Progress | None = None) -> dict[Name, Begun]:
        """The first steps of some trails, of all by default."""
        chosen = list(self._trails if names is None else names)
        told = itertools.count()

        def tell(name: Name) -> None:
            if progress is not None:
                progress(" + ".join(self._trails[name].task.motor.effects), next(told), len(chosen))

        # The longest first, so that neither process waits long for the other.
        order = sorted(chosen, key=lambda name: -len(self._trails[name].starts))
        ends = self._team.each(_begin, dict.fromkeys(order), tell)
        return {name: Begun(self._trails[name], ends[name]) for name in chosen}

    def followed(self, these: Mapping[Name, Begun], most: int | None = None) -> dict[Name, Scouted]:
        """What was begun, followed: of the nearest, those `most` that are nearest after some more steps; not to the end what falls far behind."""
        hopeless = HOPELESS_START * min((one.objective for one in these.values()), default=np.inf)
        ahead = nearest(these)[: None if most is None else most + AHEAD]
        steps = self._team.each(_advance, {name: these[name].ends for name in ahead})
        further = {name: Begun(self._trails[name], ends) for name, ends in steps.items()}
        found = self._team.each(partial(_follow, hopeless=hopeless), {name: further[name].ends for name in nearest(further)[:most]})
        return {name: Scouted(self._trails[name], ends) for name, ends in found.items()}

    def improve(self, looks: dict[Name, Scouted], names: Iterable[Name], how: Callable[[Scouted], Ends]) -> None:
        """Take some looks further that are not right yet: `pursue` them or `search_through`."""
        left = {name: looks[name].ends for name in names if not looks[name].right}
        looks |= {name: Scouted(self._trails[name], ends) for name, ends in self._team.each(partial(_improve, how=how), left).items()}


def improved(looks: dict[Name, Scouted], names: Iterable[Name], how: Callable[[Scouted], Ends]) -> None:
    """Take some looks further whose scouts are gone."""
    names = list(names)
    with Scouts({name: looks[name].trail for name in names}) as scouts:
        scouts.improve(looks, names, how)


def _begin(trail: Trail, given: None) -> Polished:
    return begin(trail)


def _advance(trail: Trail, ends: Polished) -> Polished:
    return advance(Begun(trail, ends))


def _follow(trail: Trail, ends: Polished, hopeless: float) -> Ends:
    return follow(Begun(trail, ends), hopeless)


def _improve(trail: Trail, ends: Ends, how: Callable[[Scouted], Ends]) -> Ends:
    return how(Scouted(trail, ends))
