"""One open session: its models are cached until the folder changes, and fits of further effects are computed ahead."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from motoremi.arrays import JsonDict, Progress
from motoremi.data.measurement import Measurement
from motoremi.data.paths import inside
from motoremi.data.session import Session, load
from motoremi.diagnosis.ladder_step import further
from motoremi.errors import BadInput
from motoremi.fitting.result import Fit, restore
from motoremi.fitting.vanishing import no_worse
from motoremi.inspection.compare import Comparison, Tolerance, compare
from motoremi.inspection.element import Inspection, inspect
from motoremi.model.effects import find_effect
from motoremi.workbench.draft import Draft
from motoremi.workbench.ladder import FileStamp, Ladder
from motoremi.workbench.source_ladder import SourceDesk
from motoremi.workbench.stamps import Stamp, stamp_of
from motoremi.workflow import (
    Store,
    compare_session,
    diagnose_session,
    fit_session,
    measurement_of,
    opened,
    report_session,
    save_ladder,
    stored_tolerance,
)
from motoremi.workflow_withdraw import Withdrawal, restore_withdrawn, withdraw

if TYPE_CHECKING:
    from motoremi.report.contents import Choice

LADDER = "analysis/ladder.json"
Made = TypeVar("Made")


class Desk(Ladder[Fit]):
    """An open session and the ladder of its sweeps.

    Several pages, the command line and a run may change the same session: the cache is discarded when its files change.

    Parameters
    ----------
    path : Path
    """

    BASE = "the paper's circuit"

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path
        self.source = SourceDesk(self)
        self._stamp: Stamp | None = None
        self._ladder_stamp: FileStamp = None
        self._session: Session | None = None
        self._measurement: Measurement | None = None
        # Fits by the text that is stored of them.
        self._known: dict[str, Fit] = {}
        self._inspecting = threading.Lock()
        self._inspected: tuple[tuple[str, str], Inspection] | None = None
        self._steps: tuple[Fit, ...] = ()

    @property
    def session(self) -> Session:
        """The session, as it is on disk now."""
        with self._turn:
            self._refresh()
            assert self._session is not None
            return self._session

    @property
    def steps(self) -> tuple[Fit, ...]:
        """The models, base first; empty before the first fit."""
        with self._turn:
            self._refresh()
            return self._steps

    def fit(self, shown: str | None = None, progress: Progress | None = None) -> None:
        """Fit the current model anew, from the base up; `shown` as in `change`."""
        self.work(lambda store: fit_session(store, progress=progress), shown)

    def diagnose(self, progress: Progress | None = None, shown: str | None = None) -> None:
        """Find the effect missing from the current model; `shown` as in `change`. Its fits are kept, so that adding one of them is immediate."""
        found = self.work(lambda store: diagnose_session(store, progress=progress), shown)
        # With another analyser or without some points, the diagnosis fitted a different model: its fits do not belong here.
        if (found.base.objective, found.base.effects) == (self.top.objective, self.top.effects):
            self._keep_all((one.effect, no_worse(self.top, one.fit, one.effect)) for one in found.candidates)

    def judge(self, tolerance: Tolerance) -> None:
        """Compare the current model with the measurement; this tolerance is used from now on."""
        self.change(lambda store: compare_session(store, tolerance))

    def withdraw(self, names: Sequence[str], why: str, restore: bool) -> Withdrawal:
        """Withdraw measurements for a reason, or with `restore` use them again."""
        with self._turn:
            done = restore_withdrawn(self.path, names) if restore else withdraw(self.path, names, why)
            self._stamp = None
        return done

    def report(self, progress: Progress | None = None, profile: Path | None = None, choice: Choice | None = None) -> list[str]:
        """Write the report and return the names of its files.

        Parameters
        ----------
        progress : callable, optional
        profile : Path, optional
            The laboratory profile, in place of the one stored with the session.
        choice : Choice, optional
            The form and sections.

        Raises
        ------
        BadInput
            If an analysis in the folder was not written by this software.
        """
        try:
            files = self.work(lambda store: report_session(store, profile, choice, progress))
        except (KeyError, TypeError, AttributeError) as error:
            raise BadInput(f"a stored analysis cannot be read ({type(error).__name__}: {error}): diagnose or predict this session again") from error
        return [file.name for file in files]

    def report_files(self) -> list[str]:
        """Names of the report files written so far."""
        try:
            return sorted(file.name for file in inside(self.path, "report").iterdir() if file.is_file())
        except OSError:
            return []

    def save(self, name: str, payload: JsonDict) -> None:
        """Store an analysis."""
        self.change(lambda store: store.save_analysis(name, payload))

    def change(self, action: Callable[[Store], object], shown: str | None = None) -> None:
        """Run an action with the session open for writing.

        Parameters
        ----------
        action : callable
        shown : str, optional
            The `standing` of the ladder that the page showed when the user asked for the change.

        Raises
        ------
        BadInput
            If the ladder has changed since.
        """
        with self._turn:
            if shown is not None:
                self._require(shown)
            with opened(self.path) as store:
                if shown is not None:
                    self._require_unmoved()
                action(store)
            self._stamp = None

    def work(self, action: Callable[[Store], Made], shown: str | None = None, rests_on: Sequence[str] = (LADDER,)) -> Made:
        """As `change`, for long computations: the session stays readable meanwhile and is opened for writing only at the end.

        Parameters
        ----------
        action : callable
            Must not read back what it has stored.
        shown : str, optional
            As in `change`.
        rests_on : sequence of str
            Files that must not change meanwhile.

        Raises
        ------
        BadInput
            As `change`, and if one of these files changed.
        """
        with self._turn:
            self._require(shown)
            began = [self.file_stamp(name) for name in rests_on]
        draft = Draft(self.path)
        made = action(draft)
        with self._turn:
            with opened(self.path) as store:
                if [self.file_stamp(name) for name in rests_on] != began:
                    raise BadInput("the model of this session was changed elsewhere meanwhile: nothing was stored; look at it, then do this again")
                draft.store_in(store)
            self._stamp = None
        return made

    def comparison(self, step: Fit) -> Comparison:
        """A model compared with the measurement, with the tolerance used last."""
        return compare(step, stored_tolerance(self.session))

    def inspection(self, element: str) -> Inspection:
        """What an element would have to be; the last inspection is cached, for zooming."""
        with self._inspecting:
            key = self.standing, element
            if self._inspected is None or self._inspected[0] != key:
                self._inspected = key, inspect(self.top, element)
            return self._inspected[1]

    def _identity(self) -> list[object]:
        return [[*step.effects, step.objective] for step in self.steps]

    def _with_effect(self, before: Fit, effect: str) -> Fit:
        find_effect(effect)
        return before.add(effect)

    def _further(self, after: Fit, effect: str, progress: Progress | None) -> list[Fit]:
        return [fit for portion in further(after, effect, progress) for fit in portion]

    def _store(self, steps: Sequence[Fit]) -> None:
        kept = sum(one is other for one, other in zip(steps, self._steps, strict=False))
        with opened(self.path) as store:
            self._require_unmoved()
            save_ladder(store, steps, kept)
            # Restoring a fit evaluates it at all points, so keep the fits that were just stored.
            self._known |= {_text_of(stored): fit for stored, fit in zip(_ladder(load(self.path)), steps, strict=True)}
        self._stamp = None

    def _require_unmoved(self) -> None:
        # The session is open and locked: no other writer can interfere from here on.
        if self.file_stamp(LADDER) != self._ladder_stamp:
            raise BadInput("this session has just been changed elsewhere; look at it again before you change it")

    def _refresh(self) -> None:
        stamp = stamp_of(self.path)
        if stamp == self._stamp and self._session is not None:
            return
        ladder_stamp = self.file_stamp(LADDER)
        session = load(self.path)
        if self._session is None or _measured(session) != _measured(self._session):
            self._measurement = measurement_of(session) if session.sweeps else None
            self._known = {}
        measurement = self._measurement
        if measurement is not None:
            stored = {_text_of(step): step for step in _ladder(session)}
            self._known = {text: self._known.get(text) or restore(step["fit"], measurement) for text, step in stored.items()}
        self._steps = tuple(self._known.values())
        self._session, self._stamp, self._ladder_stamp = session, stamp, ladder_stamp

    def file_stamp(self, name: str) -> FileStamp:
        """Modification time and size of a file of the session; None if it does not exist."""
        try:
            found = inside(self.path, name).stat()
        except OSError:
            return None
        return found.st_mtime_ns, found.st_size


def _text_of(step: JsonDict) -> str:
    return json.dumps(step["fit"], sort_keys=True)


def _ladder(session: Session) -> list[JsonDict]:
    """The stored steps.

    Raises
    ------
    BadInput
        If the file was not written by this software.
    """
    steps = session.ladder
    if not all(isinstance(step, dict) and isinstance(step.get("fit"), dict) for step in steps):
        raise BadInput("the stored ladder cannot be read: fit this session again")
    return steps


def _measured(session: Session) -> list[object]:
    """Identifies the measured data; analyses do not change it."""
    return [document.get("sha256", document.get("seq")) for document in session.used_documents if document["kind"] in ("sweep", "value")]
