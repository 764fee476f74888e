"""One opened session: its models kept in memory as long as nobody else changes the folder, and fits prepared before they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeAlias

from motoremi.arrays import JsonDict, Progress
from motoremi.data.measurement import Measurement
from motoremi.data.paths import SESSION, inside
from motoremi.data.session import Session, load
from motoremi.diagnosis.compare import Comparison, Tolerance, compare
from motoremi.diagnosis.element import Inspection, inspect
from motoremi.errors import BadInput
from motoremi.fitting.result import Fit, restore
from motoremi.model.effects import find_effect
from motoremi.workbench.ladder import Ladder
from motoremi.workbench.source import SourceDesk
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
Stamp: TypeAlias = tuple[int, int] | None


class Desk(Ladder[Fit]):
    """An opened session, and the ladder of its sweeps.

    A page, a command line and a bench run may take turns on one session: everything kept here is dropped when its files have changed.

    Parameters
    ----------
    path : Path
    """

    BASE = "the paper's circuit"

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path
        self.source = SourceDesk(self)
        self._stamp: Stamp = None
        self._ladder_stamp: Stamp = None
        self._session: Session | None = None
        self._measurement: Measurement | None = None
        self._steps: tuple[Fit, ...] = ()

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

    def fit(self, shown: str | None = None) -> None:
        """Fit the model that the ladder stands at, from the bottom; `shown` as in `change`."""
        self.change(fit_session, shown)

    def diagnose(self, progress: Progress | None = None, shown: str | None = None) -> None:
        """Which effect is missing from the model that stands; `shown` as in `change`."""
        self.change(lambda store: diagnose_session(store, progress=progress), shown)

    def judge(self, tolerance: Tolerance) -> None:
        """Hold the model that stands against the measurement, by this tolerance from now on."""
        self.change(lambda store: compare_session(store, tolerance))

    def report(self) -> list[str]:
        """Write the report; returns the names of its files.

        Raises
        ------
        BadInput
            If an analysis in the folder is none of this software.
        """
        files: list[Path] = []
        try:
            self.change(lambda store: files.extend(report_session(store)))
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

    def comparison(self, step: Fit) -> Comparison:
        """A model against the measurement, by the tolerance used last."""
        stored = self.session.analysis("comparison")
        return compare(step, None if stored is None else _tolerance(stored))

    def inspection(self, element: str) -> Inspection:
        """What an element would have to be."""
        return inspect(self.top, element)

    def _signed(self) -> list[object]:
        return [[*step.effects, step.objective] for step in self.steps]

    def _grown(self, before: Fit, effect: str) -> Fit:
        find_effect(effect)
        return before.add(effect)

    def _store(self, steps: Sequence[Fit]) -> None:
        with opened(self.path) as store:
            self._require_unmoved()
            save_ladder(store, steps)
        self._stamp = None

    def _require_unmoved(self) -> None:
        # Under the lock of an open session: from here on nobody else writes.
        if self.file_stamp(LADDER) != self._ladder_stamp:
            raise BadInput("this session has just been changed by somebody else; look at it again before you change it")

    def _refresh(self) -> None:
        stamp = self.file_stamp(SESSION)
        if stamp == self._stamp and self._session is not None:
            return
        ladder_stamp = self.file_stamp(LADDER)
        session = load(self.path)
        if self._session is None or _measured(session) != _measured(self._session):
            self._measurement = measurement_of(session) if session.sweeps else None
        measurement = self._measurement
        self._steps = () if measurement is None else tuple(restore(step["fit"], measurement) for step in _ladder(session))
        self._session, self._stamp, self._ladder_stamp = session, stamp, ladder_stamp

    def file_stamp(self, name: str) -> Stamp:
        """Changes with a file of the session; None where there is none."""
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
