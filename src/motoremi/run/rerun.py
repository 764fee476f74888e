"""Runs a recorded session again from its own traffic, and compares the results with what was stored."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from motoremi.arrays import JsonDict
from motoremi.bench.replay import ReplayBench
from motoremi.bench.replay_difference import RecordedEnd, ReplayDifference
from motoremi.data.session import Session, SessionWriter, load, reopen
from motoremi.data.text_file import decode, read_bytes
from motoremi.errors import BadInput, InstrumentError, MotoremiError
from motoremi.run.answer import ANSWERS, Answer, Prompt
from motoremi.run.execution import Analyse
from motoremi.run.rerun_requested import before_investigations, rerun_requested
from motoremi.run.resume import Done
from motoremi.run.runner import Outcome, done_by, run, source_at
from motoremi.run.writer import Writer
from motoremi.schema.procedure import parse_procedure

MEASURED = ("sweep", "spectrum", "final", "standard")
# A driver that calibrates computes the impedance from what the instrument sent, with libraries that choose their instructions by processor: the
# last digits may differ from those recorded on another (by 4e-14 of the value where it was seen). No instrument has nine digits.
ROUNDING = 1e-9
# What a resumption states besides its steps.
RESUMED = ("motor", "serial", "operator", "ambient", "calibrated", "procedure")
_KEPT = ("title", "procedure", "operator", "backend", "simulated", "simulated_sha256", "calibrated", "corrections")


@dataclass(frozen=True)
class Replayed:
    """Result of a replay.

    Parameters
    ----------
    path : Path
        The new session.
    compared : int
        How many stored sweeps, spectra and standards were compared with the new ones.
    differing : tuple of str
        Files of the recorded session that were not reproduced.
    rounded : tuple of str
        Files that were reproduced except for the rounding of another processor (less than `ROUNDING`), not byte for byte.
    differences : tuple of ReplayDifference
        Differences that a lenient replay ignored.
    ended : str
        "done", or how the recorded run ended.
    outcome : Outcome, optional
        Outcome of a run that was completed.
    """

    path: Path
    compared: int
    differing: tuple[str, ...]
    rounded: tuple[str, ...]
    differences: tuple[ReplayDifference, ...]
    ended: str
    outcome: Outcome | None

    @property
    def same(self) -> bool:
        """Whether all exchanges and all data are as recorded."""
        return not self.differing and not self.differences

    def to_dict(self) -> JsonDict:
        """Plain data."""
        return {
            "session": str(self.path),
            "same": self.same,
            "compared": self.compared,
            "differing": list(self.differing),
            "rounded": list(self.rounded),
            "differences": [difference.to_dict() for difference in self.differences],
            "ended": self.ended,
            **(self.outcome.to_dict() if self.outcome else {}),
        }


def rerun(
    session: Session, folder: Path, analyse: Callable[[], Analyse], lenient: bool = False, listen: Callable[[JsonDict], None] | None = None
) -> Replayed:
    """Run a session's procedure again with its recorded traffic in place of the instruments, on a virtual clock.

    Parameters
    ----------
    session : Session
    folder : Path
        Folder of the new session.
    analyse : callable
        Makes the function that does the steps of analysis.
    lenient : bool
        Continue after a difference.
    listen : callable, optional
        Called with every document.

    Raises
    ------
    ReplayDifference
        If an exchange differs from the record, and `lenient` is off.
    InstrumentError
        If the run ends in another way than the recorded one.
    BadInput
        If the session was imported.
    """
    if "procedure" not in session.start:
        raise BadInput(f"{session.path.name} was imported, not measured: there is no traffic to replay")
    bench = ReplayBench(session.traffic(), lenient)
    start = {key: session.start[key] for key in _KEPT if key in session.start}
    writer = SessionWriter.create(folder, {**start, "replay_of": session.path.name})
    ended, outcome = "done", None
    for source, done, recorded_stop, from_outside, answers, until in _runs(session):
        procedure = parse_procedure(source, session.path.name)
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
            # A failure that occurred in the recorded run as well is a correct replay.
            if isinstance(error, ReplayDifference) or not recorded_stop.endswith(str(error)):
                raise
            ended = recorded_stop
        else:
            # A kill or Ctrl-C during a step without an exchange leaves no trace in the traffic, so the replay cannot stop there.
            if recorded_stop and not from_outside:
                raise InstrumentError(f"the recorded run ended with {recorded_stop!r}, its replay came to its end")
    if len(before_investigations(session.documents)) < len(session.documents):
        with reopen(folder) as writer:
            if listen is not None:
                writer.subscribe(listen)
            rerun_requested(session.documents, bench, writer, session.path.name)
    bench.finish()
    again = load(folder)
    return Replayed(folder, *_compared(session, again), tuple(bench.differences), ended, outcome)


def _as_writer(writer: SessionWriter) -> Writer:
    return writer


def _answering(answers: list[Answer]) -> Prompt:
    """A prompt that gives the recorded answers; None when there are no more, as on a bench without an operator."""
    recorded = iter(answers)

    def prompt(text: str) -> Answer | None:
        answer = next(recorded, None)
        if answer == "stop":
            raise RecordedEnd("the operator stopped the recorded run here")
        return answer

    return prompt


def _runs(session: Session) -> Iterable[tuple[JsonDict, Done | None, str, bool, list[Answer], datetime | None]]:
    """Each run of the session: its procedure, what was done before it, why it stopped (empty if it was completed), whether that was a kill
    or Ctrl-C, the operator's answers, and when the next run began.
    """
    documents = before_investigations(session.documents)
    starts = [i for i, d in enumerate(documents) if d["kind"] == "resume"]
    edges = [0, *starts, len(documents)]
    for first, end in itertools.pairwise(edges):
        own = itertools.takewhile(lambda d: d["kind"] != "reopen", documents[first:end])
        # A run whose report failed has two stop documents: of the measurement and of the run.
        stop = next(reversed([d for d in own if d["kind"] == "stop"]), None)
        reason = "killed" if stop is None else "" if stop["status"] == "done" else str(stop["reason"] or stop["status"])
        answers = [d["answer"] for d in documents[first:end] if d["kind"] == "prompt" and d["answer"] in ANSWERS]
        from_outside = stop is None or stop["status"] == "interrupted"
        until = datetime.fromisoformat(session.documents[end]["time"]) if end < len(session.documents) else None
        done: Done | None = None
        if first:
            resumed = {key: value for key, value in documents[first].items() if key in RESUMED}
            done = replace(done_by(session, session.documents[:first]), resumed=resumed)
        yield source_at(documents[: first + 1]), done, reason, from_outside, answers, until


def _compared(session: Session, again: Session) -> tuple[int, tuple[str, ...], tuple[str, ...]]:
    """How many files were compared, which recorded files have no equal in the replay, and which only by rounding; in order."""
    recorded = [d for d in session.documents if d["kind"] in MEASURED]
    # A killed run may have read a sweep without storing it; the replay stores it.
    reproduced = [d for d in again.documents if d["kind"] in MEASURED]
    differing: list[str] = []
    rounded: list[str] = []
    position = 0
    for document in recorded:
        ahead = range(position, len(reproduced))
        at = next((at for at in ahead if reproduced[at]["sha256"] == document["sha256"]), None)
        if at is None:
            rows = _rows(session, document)
            at = next((at for at in ahead if _differ_by_rounding(rows, _rows(again, reproduced[at]))), None)
            if at is None:
                differing.append(str(document["file"]))
                continue
            rounded.append(str(document["file"]))
        position = at + 1
    return len(recorded), tuple(differing), tuple(rounded)


def _rows(session: Session, document: JsonDict) -> list[str]:
    name = str(document["file"])
    return decode(read_bytes(session.path / name), name).splitlines()


def _differ_by_rounding(rows: list[str], others: list[str]) -> bool:
    """Whether two files are the same except for the last digits of what was computed; frequencies and headers have to be equal."""
    return len(rows) == len(others) and all(a == b or _rows_close(a, b) for a, b in zip(rows, others, strict=True))


def _rows_close(row: str, other: str) -> bool:
    """Whether two rows of numbers have the same first number and are closer than rounding in the others."""
    (first, *values), (other_first, *other_values) = row.split(","), other.split(",")
    try:
        numbers, other_numbers = [float(value) for value in values], [float(value) for value in other_values]
    except ValueError:
        return False
    if first != other_first or len(numbers) != len(other_numbers):
        return False
    # Of the whole row: a resistance computed beside a large reactance is rounded as that is.
    allowed = ROUNDING * max(map(abs, numbers), default=0.0)
    return all(abs(a - b) <= allowed for a, b in zip(numbers, other_numbers, strict=True))
