"""A ladder that pages climb: the model that stands, models fitted before they are asked for, steps up, back and up again."""

from __future__ import annotations

import hashlib
import json
import threading
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from typing import ClassVar, Generic, Protocol, TypeVar

from motoremi.arrays import Progress
from motoremi.errors import BadInput

# Fits that are kept in case somebody clicks on them; each holds its problem's arrays.
MOST_PREPARED = 60


class Step(Protocol):
    """A fitted model."""

    @property
    def effects(self) -> tuple[str, ...]:
        """What it has beyond the base, in the order in which it was added."""
        ...


F = TypeVar("F", bound=Step)


class Ladder(ABC, Generic[F]):
    """The models of one session for the sweeps or for the spectra. Whoever asks for a change says which ladder he saw (`shown`)."""

    # What the ladder stands on, in words.
    BASE: ClassVar[str]

    def __init__(self) -> None:
        self._turn = threading.RLock()
        self._prepared: dict[tuple[str, str], F] = {}
        self._making: dict[tuple[str, str], threading.Lock] = {}
        self._keeping = threading.Lock()
        self.glancing = threading.Lock()
        self.looking: object = None
        self._dropped: tuple[F, ...] = ()
        self._dropped_from = ""

    @property
    @abstractmethod
    def steps(self) -> tuple[F, ...]:
        """The models, base first; empty before the first fit."""

    @abstractmethod
    def fit(self, shown: str | None = None, progress: Progress | None = None) -> None:
        """Fit the model that the ladder stands at, from the bottom."""

    @abstractmethod
    def diagnose(self, progress: Progress | None = None, shown: str | None = None) -> None:
        """Which effect is missing from the model that stands."""

    @abstractmethod
    def _signed(self) -> list[object]:
        """What tells this ladder from any other."""

    @abstractmethod
    def _grown(self, before: F, effect: str) -> F:
        """A model with one more effect, fitted."""

    def _further(self, after: F, effect: str, progress: Progress | None) -> list[F]:
        """More of the same effect, each a step above `after`, where adding one means adding as many as lower the error."""
        return []

    @abstractmethod
    def _store(self, steps: Sequence[F]) -> None:
        """Put other steps in the place of those that stand, unless somebody else has just done so."""

    @property
    def top(self) -> F:
        """The model that stands.

        Raises
        ------
        BadInput
            Before the first fit.
        """
        steps = self.steps
        if not steps:
            raise BadInput("there is no model yet: fit this session first")
        return steps[-1]

    @property
    def standing(self) -> str:
        """Changes with the ladder: what a page sends back, so that nobody changes a ladder that the page does not show."""
        return hashlib.sha256(json.dumps(self._signed()).encode()).hexdigest()[:12]

    def prepared(self, effect: str) -> F:
        """The model that stands with one more effect; kept, so that adding it afterwards takes no time."""
        with self._turn:
            key, before = (self.standing, effect), self.top
        with self._keeping:
            making = self._making.setdefault(key, threading.Lock())
        # A lock for each: whoever asks for the same waits for it, a click on another effect does not. `_turn` is not asked for in here.
        with making:
            fit = self._prepared.get(key)
            if fit is None:
                fit = self._grown(before, effect)
                self._keep(key, fit)
            return fit

    def _keep(self, key: tuple[str, str], fit: F) -> None:
        with self._keeping:
            while len(self._prepared) >= MOST_PREPARED:
                oldest = next(iter(self._prepared))
                del self._prepared[oldest]
                self._making.pop(oldest, None)
            self._prepared[key] = fit

    def _keep_all(self, found: Iterable[tuple[str, F]]) -> None:
        """Keep what a diagnosis has fitted on top of the model that stands, each with one more effect."""
        standing = self.standing
        for effect, fit in found:
            self._keep((standing, effect), fit)

    def glance(self, effect: str) -> tuple[F, F] | None:
        """The model that stands, and `prepared`, for a pointer that moves on: None if another effect was asked for in the meantime."""
        self.looking = asked = object()
        with self.glancing:
            return (self.top, self.prepared(effect)) if self.looking is asked else None

    def add(self, effect: str, shown: str | None = None, progress: Progress | None = None) -> tuple[F, F]:
        """Put an effect on top of the ladder, as often as the command would; returns the model before and after."""
        self.looking = None
        with self._turn:
            self._require(shown)
            before, stands = self.top, self.standing
        # Others may look at the session meanwhile.
        first = self.prepared(effect)
        new = [first, *self._further(first, effect, progress)]
        with self._turn:
            self._require(stands)
            self._store((*self.steps, *new))
            return before, new[-1]

    def drop(self, shown: str | None = None, count: int = 1) -> tuple[F, F]:
        """Step back on the ladder; returns the model before and after."""
        with self._turn:
            self._require(shown)
            steps = self.steps
            if not 0 < count < len(steps):
                raise BadInput(f"the ladder stands at {self.BASE}: there is no effect to drop" if len(steps) < 2 else "there are not so many steps")
            above = self.dropped
            self._store(steps[:-count])
            self._dropped, self._dropped_from = (*steps[-count:], *above), self.standing
            return steps[-1], steps[-count - 1]

    @property
    def dropped(self) -> tuple[F, ...]:
        """The steps that `redo` puts back, lowest first; empty if none was dropped from the ladder as it stands."""
        with self._turn:
            return self._dropped if self._dropped and self._dropped_from == self.standing else ()

    def redo(self, shown: str | None = None, count: int = 1) -> tuple[F, F]:
        """Put back what was dropped last, as it was; returns the model before and after."""
        with self._turn:
            self._require(shown)
            before, dropped = self.top, self.dropped
            if not 0 < count <= len(dropped):
                raise BadInput("there is nothing to put back: nothing was dropped from this ladder" if not dropped else "so many were not dropped")
            self._store((*self.steps, *dropped[:count]))
            self._dropped, self._dropped_from = dropped[count:], self.standing
            return before, dropped[count - 1]

    def _require(self, shown: str | None) -> None:
        if shown is not None and shown != self.standing:
            stands = " + ".join((self.BASE, *self.steps[-1].effects)) if self.steps else "no model"
            raise BadInput(
                f"the ladder was changed since this page showed it and stands at {stands} now: nothing was done; look at it, then choose again"
            )
