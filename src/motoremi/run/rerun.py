"""Runs a recorded session again from its own traffic, and holds what comes out against what was stored."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from motoremi.arrays import JsonDict
from motoremi.bench.replay import ReplayBench
from motoremi.bench.replay_difference import RecordedEnd, ReplayDifference
from motoremi.data.session import Session, SessionWriter, load, reopen
from motoremi.errors import BadInput, InstrumentError, MotoremiError
from motoremi.run.answer import ANSWERS, Answer, Prompt
from motoremi.run.execution import Analyse
from motoremi.run.rerun_requested import before_investigations, rerun_asked
from motoremi.run.resume import Done
from motoremi.run.runner import Outcome, done_by, run
from motoremi.run.writer import Writer
from motoremi.schema.procedure import parse_procedure

MEASURED = ("sweep", "spectrum", "final", "standard")
_KEPT = ("title", "procedure", "operator", "backend", "simulated", "simulated_sha256", "calibrated", "corrections")


@dataclass(frozen=True)
class Replayed:
    """What a replay came to.

    Parameters
    ----------
    path : Path
        The new session.
    compared : int
        How many stored sweeps, spectra and standards were held against the new ones.
    differing : tuple of str
        Files of the recorded session that did not come out byte for byte.
    differences : tuple of ReplayDifference
        What a lenient replay passed over.
    ended : str
        "done", or how the recorded run ended.
    outcome : Outcome, optional
        Of a run that came to its end.
    """

    path: Path
    compared: int
    differing: tuple[str, ...]
    differences: tuple[ReplayDifference, ...]
    ended: str
    outcome: Outcome | None

    @property
    def same(self) -> bool:
        """Whether everything was asked and measured as it was recorded."""
        return not self.differing and not self.differences

    def to_dict(self) -> JsonDict:
        """Plain data."""
        return {
            "session": str(self.path),
            "same": self.same,
            "compared": self.compared,
            "differing": list(self.differing),
            "differences": [difference.to_dict() for difference in self.differences],
            "ended": self.ended,
            **(self.outcome.to_dict() if self.outcome else {}),
        }


def rerun(
    session: Session, folder: Path, analyse: Callable[[], Analyse], lenient: bool = False, listen: Callable[[JsonDict], None] | None = None
) -> Replayed:
    """Run a session's procedure again with its recorded traffic answering, on a virtual clock.

    Parameters
    ----------
    session : Session
    folder : Path
        Of the new session.
    analyse : callable
        Makes what does the analysing steps.
    lenient : bool
        Go on at a difference.
    listen : callable, optional
        Told every document.

    Raises
    ------
    ReplayDifference
        If the code asks something else than the record holds, and `lenient` is off.
    InstrumentError
        If the run ends otherwise than the recorded one did.
    BadInput
        If the session was imported.
    """
    if "procedure" not in session.start:
        raise BadInput(f"{session.path.name} was imported, not measured: there is no traffic to replay")
    procedure = parse_procedure(session.start["procedure"], session.path.name)
    bench = ReplayBench(session.traffic(), lenient)
    start = {key: session.start[key] for key in _KEPT if key in session.start}
    writer = SessionWriter.create(folder, {**start, "replay_of": session.path.name})
    ended, outcome = "done", None
    for done, recorded_stop, from_outside, answers, until in _runs(session):
        bench.begin_run(until)
        if done is not None:
            writer = reopen(folder)
        if listen is not None:
            writer.subscribe(listen)
        ended, outcome = "done", None
        try:
            outcome = run(procedure, bench, _as_writer(writer), analyse=analyse(), prompt=_answering(answers), done=done)
        except RecordedEnd:
            ended = recorded_stop or "killed"
        except MotoremiError as error:
            # A failure that comes again is a faithful replay.
            if isinstance(error, ReplayDifference) or not recorded_stop.endswith(str(error)):
                raise
            ended = recorded_stop
        else:
            # A kill or Ctrl-C during a step that asks no instrument leaves no trace in the traffic: there is nothing to stop a replay by.
            if recorded_stop and not from_outside:
                raise InstrumentError(f"the recorded run ended with {recorded_stop!r}, its replay came to its end")
    if len(before_investigations(session.documents)) < len(session.documents):
        with reopen(folder) as writer:
            if listen is not None:
                writer.subscribe(listen)
            rerun_asked(session.documents, bench, writer, session.path.name)
    bench.finish()
    again = load(folder)
    return Replayed(folder, *_held_against(session, again), tuple(bench.differences), ended, outcome)


def _as_writer(writer: SessionWriter) -> Writer:
    return writer


def _answering(answers: list[Answer]) -> Prompt:
    """An operator who answers as it was recorded; None as on a bench where nobody is asked."""
    recorded = iter(answers)

    def prompt(text: str) -> Answer | None:
        answer = next(recorded, None)
        if answer == "stop":
            raise RecordedEnd("the operator stopped the recorded run here")
        return answer

    return prompt


def _runs(session: Session) -> Iterable[tuple[Done | None, str, bool, list[Answer], datetime | None]]:
    """Each run of the session: what was done before it, why it stopped (empty: it came to its end), whether by a kill or by Ctrl-C,
    what the operator answered, and when the next one began.
    """
    documents = before_investigations(session.documents)
    starts = [i for i, d in enumerate(documents) if d["kind"] == "resume"]
    edges = [0, *starts, len(documents)]
    for first, end in itertools.pairwise(edges):
        own = itertools.takewhile(lambda d: d["kind"] != "reopen", documents[first:end])
        # A run whose report failed has two: the measurement's and its own.
        stop = next(reversed([d for d in own if d["kind"] == "stop"]), None)
        reason = "killed" if stop is None else "" if stop["status"] == "done" else str(stop["reason"] or stop["status"])
        answers = [d["answer"] for d in documents[first:end] if d["kind"] == "prompt" and d["answer"] in ANSWERS]
        from_outside = stop is None or stop["status"] == "interrupted"
        until = datetime.fromisoformat(session.documents[end]["time"]) if end < len(session.documents) else None
        yield (done_by(session, session.documents[:first]) if first else None), reason, from_outside, answers, until


def _held_against(session: Session, again: Session) -> tuple[int, tuple[str, ...]]:
    """How many files were compared, and which of the recorded ones have no equal in the replay, in order."""
    recorded = [d for d in session.documents if d["kind"] in MEASURED]
    # A killed run may have read a sweep that it could not store any more; the replay stores it.
    came = [d["sha256"] for d in again.documents if d["kind"] in MEASURED]
    differing, position = [], 0
    for document in recorded:
        if document["sha256"] in came[position:]:
            position = came.index(document["sha256"], position) + 1
        else:
            differing.append(str(document["file"]))
    return len(recorded), tuple(differing)
