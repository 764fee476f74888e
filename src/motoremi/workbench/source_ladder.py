"""The models of an open session's spectra (source and path), cached as `Desk` caches those of the sweeps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, TypeVar

from motoremi.arrays import Progress
from motoremi.data.session import Session
from motoremi.emission.background import split
from motoremi.emission.diagnose import add_effect
from motoremi.emission.source_effects import find_source_effect
from motoremi.emission.spectrum_fit import EmissionFit
from motoremi.errors import BadInput
from motoremi.fitting.result import Fit
from motoremi.workbench.ladder import FileStamp, Ladder
from motoremi.workflow import Store
from motoremi.workflow_emission import (
    STATE,
    diagnose_emission_session,
    emission_ladder,
    fit_source,
    has_motor,
    save_emission_ladder,
    stored_emission_steps,
)

STORED = f"analysis/{STATE}.json"
LADDER = "analysis/ladder.json"
Made = TypeVar("Made")


class OpenedSession(Protocol):
    """The part of `Desk` that the models of the spectra use."""

    @property
    def session(self) -> Session:
        """The session as it is on disk now."""

    @property
    def top(self) -> Fit:
        """The current model of the motor."""

    @property
    def standing(self) -> str:
        """Identifies the current ladder of the sweeps."""

    def file_stamp(self, name: str) -> FileStamp:
        """Modification time and size of a file of the session; None if it does not exist."""

    def change(self, action: Callable[[Store], object]) -> None:
        """Run an action with the session open for writing."""

    def work(self, action: Callable[[Store], Made], *, rests_on: Sequence[str]) -> Made:
        """Run a long action; refuse to store its result if one of these files has changed meanwhile."""


class SourceDesk(Ladder[EmissionFit]):
    """The ladder of the spectra.

    Parameters
    ----------
    desk : OpenedSession
        The open session.
    """

    BASE = "source and motor alone"

    def __init__(self, desk: OpenedSession) -> None:
        super().__init__()
        self._desk = desk
        self._session: Session | None = None
        self._stamp: FileStamp = None
        self._steps: tuple[EmissionFit, ...] = ()

    @property
    def possible(self) -> bool:
        """Whether the session holds all that a model of the spectra needs."""
        session = self._desk.session
        return has_motor(session) and bool(split(session.corrected_spectra)[0])

    @property
    def steps(self) -> tuple[EmissionFit, ...]:
        """The models, base first; empty before the first fit."""
        with self._turn:
            self._refresh()
            return self._steps

    def _refresh(self) -> Session:
        stamp = self._desk.file_stamp(STORED)
        session = self._desk.session
        if session is not self._session:
            self._steps = self._read(session)
            self._session, self._stamp = session, stamp
        return session

    def _read(self, session: Session) -> tuple[EmissionFit, ...]:
        try:
            return tuple(emission_ladder(session, self._desk.top)) if stored_emission_steps(session) else ()
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise BadInput("the stored model of the spectra cannot be read: predict this session again with its set-up") from error

    def fit(self, shown: str | None = None, progress: Progress | None = None) -> None:
        """Fit source and path anew, without effects."""
        self._work(lambda store: fit_source(store, progress), shown)

    def diagnose(self, progress: Progress | None = None, shown: str | None = None) -> None:
        """Find the effect of source or path missing from the current model. Its fits are kept."""
        found = self._work(lambda store: diagnose_emission_session(store, progress=progress), shown)
        if found.base.figures() == self.top.figures():
            self._keep_all((one.effect.name, one.fit) for one in found.candidates)

    def _identity(self) -> list[object]:
        return [self._desk.standing, *([*step.effects, step.log_evidence] for step in self.steps)]

    def _with_effect(self, before: EmissionFit, effect: str) -> EmissionFit:
        find_source_effect(effect)
        if effect in before.effects:
            raise BadInput(f"{effect} is in the model already; drop it first or add another effect")
        return add_effect(before.problem, before, effect)

    def _store(self, steps: Sequence[EmissionFit]) -> None:
        session = self._refresh()
        self._change(lambda store: save_emission_ladder(store, session, steps))

    def _work(self, action: Callable[[Store], Made], shown: str | None) -> Made:
        with self._turn:
            self._require(shown)
        return self._desk.work(action, rests_on=(LADDER, STORED))

    def _change(self, action: Callable[[Store], object]) -> None:
        with self._turn:
            self._refresh()
            known = self._stamp

            def unless_changed(store: Store) -> None:
                # The session is open and locked: no other writer can interfere from here on.
                if self._desk.file_stamp(STORED) != known:
                    raise BadInput("this session has just been changed elsewhere; look at it again before you change it")
                action(store)

            self._desk.change(unless_changed)
