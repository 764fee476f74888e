"""The ladder of models behind a page: add an effect, drop it, put it back; fits of further effects are computed ahead."""

from __future__ import annotations

import hashlib
import json
import threading
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from typing import ClassVar, Generic, Protocol, TypeAlias, TypeVar

from motoremi.arrays import Progress
from motoremi.errors import BadInput
from motoremi.model.effects.names import as_sum

# Largest number of fits that are computed ahead of a click and kept; each holds the arrays of its problem.
MOST_PREPARED = 60
# Modification time and size of a file; None if there is none.
FileStamp: TypeAlias = tuple[int, int] | None


class Step(Protocol):
    """A fitted model."""

    @property
    def effects(self) -> tuple[str, ...]:
        """Its effects beyond the base, in the order in which they were added."""
        ...


F = TypeVar("F", bound=Step)


class Ladder(ABC, Generic[F]):
    """The models of one session, for its sweeps or its spectra.

    A request for a change names the ladder that the page showed (`shown`), so that it is refused if the ladder has changed since.
    """

    # The base model, in words.
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
        """Fit the current model anew, from the base up."""

    @abstractmethod
    def diagnose(self, progress: Progress | None = None, shown: str | None = None) -> None:
        """Find the effect missing from the current model."""

    @abstractmethod
    def _identity(self) -> list[object]:
        """Values that differ between any two ladders."""

    @abstractmethod
    def _with_effect(self, before: F, effect: str) -> F:
        """Fit a model with one more effect."""

    def _further(self, after: F, effect: str, progress: Progress | None) -> list[F]:
        """Further steps with the same effect, for effects that are added as many times as they lower the error."""
        return []

    @abstractmethod
    def _store(self, steps: Sequence[F]) -> None:
        """Replace the stored steps, unless they have just been changed elsewhere."""

    @property
    def top(self) -> F:
        """The current model: the last step.

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
        """Identifies the current ladder: a page sends it back with a change, which is refused if it no longer matches."""
        return hashlib.sha256(json.dumps(self._identity()).encode()).hexdigest()[:12]

    def prepared(self, effect: str) -> F:
        """The current model with one more effect, fitted; kept, so that adding the effect afterwards is immediate."""
        return self._prepared_on(*self._now(), effect)

    def _now(self) -> tuple[str, F]:
        """The current ladder's identifier and its last step, of the same moment."""
        with self._turn:
            return self.standing, self.top

    def _prepared_on(self, standing: str, before: F, effect: str) -> F:
        """As `prepared`, on the last step of a ladder that may have changed since."""
        key = (standing, effect)
        with self._keeping:
            making = self._making.setdefault(key, threading.Lock())
        # One lock for each fit: requests for the same effect wait, requests for others do not. `_turn` must not be taken inside it.
        with making:
            fit = self._prepared.get(key)
            if fit is None:
                fit = self._with_effect(before, effect)
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
        """Keep the fits of a diagnosis: the current model with one more effect each."""
        standing = self.standing
        for effect, fit in found:
            self._keep((standing, effect), fit)

    def glance(self, effect: str, shown: str | None = None) -> tuple[F, F] | None:
        """The current and the prepared model, for a preview; None if the ladder is not the shown one or another preview was requested meanwhile."""
        self.looking = asked = object()
        with self.glancing:
            standing, before = self._now()
            if self.looking is not asked or shown not in (None, standing):
                return None
            return before, self._prepared_on(standing, before, effect)

    def add(self, effect: str, shown: str | None = None, progress: Progress | None = None) -> tuple[F, F]:
        """Add an effect to the current model, as many times as the command would; return the models before and after."""
        self.looking = None
        with self._turn:
            self._require(shown)
            before, stands = self.top, self.standing
        # Not under the lock: the session stays readable meanwhile.
        first = self.prepared(effect)
        new = [first, *self._further(first, effect, progress)]
        with self._turn:
            self._require(stands)
            self._store((*self.steps, *new))
            return before, new[-1]

    def drop(self, shown: str | None = None, count: int = 1) -> tuple[F, F]:
        """Remove the last `count` steps; return the models before and after."""
        with self._turn:
            self._require(shown)
            steps = self.steps
            if not 0 < count < len(steps):
                raise BadInput(f"the current model is {self.BASE}: there is no effect to drop" if len(steps) < 2 else "the ladder has fewer steps")
            above = self.dropped
            self._store(steps[:-count])
            self._dropped, self._dropped_from = (*steps[-count:], *above), self.standing
            return steps[-1], steps[-count - 1]

    @property
    def dropped(self) -> tuple[F, ...]:
        """The steps that `redo` puts back, lowest first; empty if none was dropped from the current ladder."""
        with self._turn:
            return self._dropped if self._dropped and self._dropped_from == self.standing else ()

    def redo(self, shown: str | None = None, count: int = 1) -> tuple[F, F]:
        """Put back the first `count` of the steps dropped last; return the models before and after."""
        with self._turn:
            self._require(shown)
            before, dropped = self.top, self.dropped
            if not 0 < count <= len(dropped):
                raise BadInput("there is nothing to put back: nothing was dropped from this ladder" if not dropped else "fewer steps were dropped")
            self._store((*self.steps, *dropped[:count]))
            self._dropped, self._dropped_from = dropped[count:], self.standing
            return before, dropped[count - 1]

    def _require(self, shown: str | None) -> None:
        if shown is not None and shown != self.standing:
            stands = as_sum((self.BASE, *self.steps[-1].effects)) if self.steps else "no model"
            raise BadInput(
                f"the ladder was changed since this page showed it and the current model is now {stands}: nothing was done; look, then choose again"
            )
