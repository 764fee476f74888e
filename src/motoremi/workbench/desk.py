"""One opened session: its models kept in memory as long as nobody else changes the folder, and fits prepared before they are asked for."""

from __future__ import annotations

import hashlib
import json
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias, TypeVar

from motoremi.arrays import JsonDict, Progress
from motoremi.data.measurement import Measurement
from motoremi.data.paths import SESSION, inside
from motoremi.data.session import Session, load
from motoremi.diagnosis.compare import Comparison, Tolerance, compare
from motoremi.diagnosis.diagnosis import Diagnosis
from motoremi.diagnosis.element import Inspection, inspect
from motoremi.errors import BadInput
from motoremi.fitting.result import Fit, restore
from motoremi.model.effects import find_effect
from motoremi.workbench.draft import Draft
from motoremi.workflow import (
    Store,
    compare_session,
    diagnose_session,
    fit_session,
    measurement_of,
    opened,
    report_session,
    save_ladder,
)

LADDER = "analysis/ladder.json"
# Fits that are kept in case somebody clicks on them; each holds its problem's arrays.
MOST_PREPARED = 60
Stamp: TypeAlias = tuple[int, int] | None
# Objective and effects of the model below, and the effect on top.
Key: TypeAlias = tuple[float, tuple[str, ...], str]
Made = TypeVar("Made")


class Desk:
    """An opened session.

    A page, a command line and a bench run may take turns on one session: everything kept here is dropped when its files have changed.

    Parameters
    ----------
    path : Path
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._turn = threading.RLock()
        self._stamp: Stamp = None
        self._ladder_stamp: Stamp = None
        self._session: Session | None = None
        self._measurement: Measurement | None = None
        self._steps: tuple[Fit, ...] = ()
        self._prepared: dict[Key, Fit] = {}
        self._making: dict[Key, threading.Lock] = {}
        self._keeping = threading.Lock()
        self._glancing = threading.Lock()
        self._looking: object = None

    @property
    def session(self) -> Session:
        """The session as it is on disk now."""
        with self._turn:
            self._refresh()
            assert self._session is not None
            return self._session

    @property
    def steps(self) -> tuple[Fit, ...]:
        """The ladder, base first; empty before the first fit."""
        with self._turn:
            self._refresh()
            return self._steps

    @property
    def top(self) -> Fit:
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
        told = json.dumps([[*step.effects, step.objective] for step in self.steps])
        return hashlib.sha256(told.encode()).hexdigest()[:12]

    def fit(self, shown: str | None = None, progress: Progress | None = None) -> None:
        """Fit the model that the ladder stands at, from the bottom; `shown` as in `change`."""
        self.work(lambda store: fit_session(store, progress=progress), shown)

    def diagnose(self, progress: Progress | None = None, shown: str | None = None) -> None:
        """Which effect is missing from the model that stands; `shown` as in `change`. Its fits are kept: adding one takes no time."""
        found = self.work(lambda store: diagnose_session(store, progress=progress), shown)
        self._keep_those_of(found)

    def judge(self, tolerance: Tolerance) -> None:
        """Hold the model that stands against the measurement, by this tolerance from now on."""
        self.change(lambda store: compare_session(store, tolerance))

    def report(self, progress: Progress | None = None) -> list[str]:
        """Write the report; returns the names of its files.

        Raises
        ------
        BadInput
            If an analysis in the folder is none of this software.
        """
        try:
            files = self.work(lambda store: report_session(store, progress=progress))
        except (KeyError, TypeError, AttributeError) as error:
            raise BadInput(f"a stored analysis cannot be read ({type(error).__name__}: {error}): diagnose or predict this session again") from error
        return [file.name for file in files]

    def report_files(self) -> list[str]:
        """Names of the report's files, as far as it was written."""
        try:
            return sorted(file.name for file in inside(self.path, "report").iterdir() if file.is_file())
        except OSError:
            return []

    def save(self, name: str, payload: JsonDict) -> None:
        """Store an analysis of the page's own."""
        self.change(lambda store: store.save_analysis(name, payload))

    def change(self, action: Callable[[Store], object], shown: str | None = None) -> None:
        """Do something with the session open for writing.

        Parameters
        ----------
        action : callable
        shown : str, optional
            The `standing` of the ladder that this was asked for.

        Raises
        ------
        BadInput
            If the ladder is another one by now.
        """
        with self._turn:
            if shown is not None:
                self._require(shown)
            with opened(self.path) as store:
                if shown is not None:
                    self._require_unmoved()
                action(store)
            self._stamp = None

    def work(self, action: Callable[[Store], Made], shown: str | None = None) -> Made:
        """The same as `change` for what takes its time: everybody can look at the session meanwhile, and it is opened for writing at the end.

        Parameters
        ----------
        action : callable
            Must not rely on what it has just stored.
        shown : str, optional
            As in `change`.

        Raises
        ------
        BadInput
            As `change`, and if somebody changed the ladder meanwhile.
        """
        with self._turn:
            self._require(shown)
            self._refresh()
            began = self._ladder_stamp
        draft = Draft(self.path)
        made = action(draft)
        with self._turn:
            with opened(self.path) as store:
                if self._file_stamp(LADDER) != began:
                    raise BadInput("somebody else changed the ladder of this session meanwhile: nothing was stored; look at it, then do this again")
                draft.store_in(store)
            self._stamp = None
        return made

    def prepared(self, effect: str) -> Fit:
        """The model that stands with one more effect, fitted; kept, so that adding it afterwards takes no time."""
        find_effect(effect)
        before = self.top
        key = (before.objective, before.effects, effect)
        with self._keeping:
            making = self._making.setdefault(key, threading.Lock())
        # A lock for each: whoever asks for the same waits for it, a click on another effect does not.
        with making:
            fit = self._prepared.get(key)
            if fit is None:
                fit = before.add(effect)
                self._keep(key, fit)
            return fit

    def _keep(self, key: Key, fit: Fit) -> None:
        with self._keeping:
            while len(self._prepared) >= MOST_PREPARED:
                oldest = next(iter(self._prepared))
                del self._prepared[oldest]
                self._making.pop(oldest, None)
            self._prepared[key] = fit

    def _keep_those_of(self, found: Diagnosis) -> None:
        """Keep what a diagnosis has fitted on top of the model that stands; under another analyser, or without some points, it is another one."""
        top = self.top
        if (found.base.objective, found.base.effects) != (top.objective, top.effects):
            return
        for one in found.candidates:
            self._keep((top.objective, top.effects, one.effect), one.fit)

    def glance(self, effect: str) -> tuple[Fit, Fit] | None:
        """The model that stands, and `prepared`, for a pointer that moves on: None if another effect was asked for in the meantime."""
        self._looking = asked = object()
        with self._glancing:
            return (self.top, self.prepared(effect)) if self._looking is asked else None

    def add(self, effect: str, shown: str | None = None) -> tuple[Fit, Fit]:
        """Put an effect on top of the ladder; returns the model before and after. `shown` as in `change`."""
        self._looking = None
        with self._turn:
            self._require(shown)
            before, stands = self.top, self.standing
        after = self.prepared(effect)
        with self._turn:
            self._require(stands)
            self._store_ladder([*self._steps, after], len(self._steps))
            return before, after

    def drop(self, shown: str | None = None) -> tuple[Fit, Fit]:
        """Step back on the ladder; returns the model before and after. `shown` as in `change`."""
        with self._turn:
            self._require(shown)
            steps = self.steps
            if len(steps) < 2:
                raise BadInput("the ladder stands at the paper's circuit: there is no effect to drop")
            self._store_ladder(list(steps[:-1]), len(steps) - 1)
            return steps[-1], steps[-2]

    def comparison(self, step: Fit) -> Comparison:
        """A model against the measurement, by the tolerance used last."""
        stored = self.session.analysis("comparison")
        return compare(step, None if stored is None else _tolerance(stored))

    def inspection(self, element: str) -> Inspection:
        """What an element would have to be."""
        return inspect(self.top, element)

    def _store_ladder(self, steps: list[Fit], kept: int) -> None:
        with opened(self.path) as store:
            self._require_unmoved()
            save_ladder(store, steps, kept)
        self._stamp = None

    def _require(self, shown: str | None) -> None:
        if shown is not None and shown != self.standing:
            stands = " + ".join(("the paper's circuit", *self.steps[-1].effects)) if self.steps else "no model"
            raise BadInput(
                f"the ladder was changed since this page showed it and stands at {stands} now: nothing was done; look at it, then choose again"
            )

    def _require_unmoved(self) -> None:
        # Under the lock of an open session: from here on nobody else writes.
        if self._file_stamp(LADDER) != self._ladder_stamp:
            raise BadInput("this session has just been changed by somebody else; look at it again before you change it")

    def _refresh(self) -> None:
        stamp = self._file_stamp(SESSION)
        if stamp == self._stamp and self._session is not None:
            return
        ladder_stamp = self._file_stamp(LADDER)
        session = load(self.path)
        if self._session is None or _measured(session) != _measured(self._session):
            self._measurement = measurement_of(session) if session.sweeps else None
            with self._keeping:
                self._prepared.clear()
                self._making.clear()
        measurement = self._measurement
        self._steps = () if measurement is None else tuple(restore(step["fit"], measurement) for step in _ladder(session))
        self._session, self._stamp, self._ladder_stamp = session, stamp, ladder_stamp

    def _file_stamp(self, name: str) -> Stamp:
        try:
            found = inside(self.path, name).stat()
        except OSError:
            return None
        return found.st_mtime_ns, found.st_size


def _ladder(session: Session) -> list[JsonDict]:
    """The stored steps.

    Raises
    ------
    BadInput
        If the file was written by something else than this software.
    """
    steps = session.ladder
    if not all(isinstance(step, dict) and isinstance(step.get("fit"), dict) for step in steps):
        raise BadInput("the stored ladder cannot be read: fit this session again")
    return steps


def _measured(session: Session) -> list[object]:
    """What the measured files are: analyses come and go without changing it."""
    return [document.get("sha256") for document in session.documents if document["kind"] == "sweep"]


def _tolerance(stored: JsonDict) -> Tolerance:
    try:
        return Tolerance(**stored["tolerance"])
    except (KeyError, TypeError) as error:
        raise BadInput("the stored comparison cannot be read: judge this session again") from error
