"""Runs a procedure: measuring steps on a bench, steps of analysis by a function of the caller, and the safe state at the end."""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import date

from motoremi.arrays import JsonDict
from motoremi.bench.connect import Bench, VisaBench
from motoremi.data.session import Session, StorageError
from motoremi.data.text import clean_text
from motoremi.errors import BadInput, InstrumentError
from motoremi.run.answer import NotDone, Prompt
from motoremi.run.execution import Analyse, Execution
from motoremi.run.on_bench import on_bench
from motoremi.run.resume import Done, needed_again
from motoremi.run.writer import Writer
from motoremi.schema.bench_file import BenchFile
from motoremi.schema.procedure import Procedure, parse_procedure
from motoremi.schema.procedure_steps import ReportStep
from motoremi.virtual.simulated_bench import SimulatedBench


@dataclass(frozen=True)
class Outcome:
    """How a run ended.

    Parameters
    ----------
    steps : int
        How many were done.
    verdicts : tuple of dict
        Results of the judging steps, in order.
    """

    steps: int
    verdicts: tuple[JsonDict, ...]

    @property
    def verdict(self) -> str:
        """ "fail" if a judging step failed, "pass" if none failed and at least one passed, "done" if nothing was judged."""
        results = {verdict.get("verdict") for verdict in self.verdicts}
        return next((word for word in ("fail", "pass") if word in results), "done")

    @property
    def passed(self) -> bool:
        """Whether no judging step failed."""
        return self.verdict != "fail"

    def to_dict(self) -> JsonDict:
        """Plain data."""
        return {"steps": self.steps, "passed": self.passed, "verdicts": list(self.verdicts)}


def make_bench(bench_file: BenchFile) -> Bench:
    """The bench that a bench file describes."""
    if bench_file.backend == "sim":
        return SimulatedBench(bench_file.seed, bench_file.effects)
    return VisaBench({str(role): name for role, name in bench_file.resources.items()}, bench_file.backend, bench_file.allow)


def start_document(procedure: Procedure, bench_file: BenchFile) -> JsonDict:
    """Content of the session's first document: enough to run the procedure again.

    Raises
    ------
    BadInput
        If a correction is not known over the span that the procedure measures.
    """
    bench_file.refuse_uncovered(procedure)
    return {
        "title": procedure.title,
        "procedure": procedure.source,
        **_stated(bench_file),
        "backend": bench_file.backend or "visa",
        **_fingerprint(bench_file),
        **({"simulated": True, "simulated_seed": bench_file.seed} if bench_file.backend == "sim" else {}),
        "remarks": list(procedure.remarks()),
        "corrections": bench_file.corrections.to_list(),
        "calibration_age_days": {role: (date.today() - day).days for role, day in bench_file.calibrated.items()},
    }


def _fingerprint(bench_file: BenchFile) -> JsonDict:
    """Identifies a simulated bench without revealing its hidden effects."""
    if bench_file.backend != "sim":
        return {}
    return {"simulated_sha256": hashlib.sha256(repr((bench_file.seed, bench_file.effects)).encode()).hexdigest()}


def was_begun_on(session: Session, bench_file: BenchFile) -> bool:
    """Whether this is the bench on which a session was begun, as far as backend and simulated bench show it."""
    now = {"backend": bench_file.backend or "visa", **_fingerprint(bench_file)}
    return all(session.start.get(key) == value for key, value in now.items())


def resumable(session: Session, bench_file: BenchFile) -> tuple[Procedure, Done]:
    """A session's procedure with the instruments and limits of the bench file, and what is done of it already.

    Raises
    ------
    BadInput
        If the session has no procedure, is complete, or belongs to another bench or motor; or if the bench does not allow the procedure.
    """
    name = session.path.name
    if "procedure" not in session.start:
        raise BadInput(f"{name} was imported, not measured: there is nothing to resume")
    # A session that is done but was not closed lacks only its manifest.
    if session.status == "done" and not session.interrupted:
        raise BadInput(f"{name} is complete: there is nothing to resume")
    if not was_begun_on(session, bench_file):
        raise BadInput(f"{name} was begun on another bench (backend {session.start.get('backend')!r}); resume it with the same --bench")
    if session.start.get("corrections", []) != bench_file.corrections.to_list():
        raise BadInput(f"{name} was begun with other corrections; resume it with the same bench file, or begin a new session")
    _refuse_other_motor(session, bench_file)
    done = done_by(session, session.documents)
    before = parse_procedure(source_at(session.documents), name)
    procedure = on_bench(before, bench_file)
    resumed: JsonDict = {key: value for key, value in _stated(bench_file).items() if value}
    if procedure.source != before.source:
        resumed["procedure"] = procedure.source
    return procedure, replace(done, resumed=resumed)


def source_at(documents: Sequence[JsonDict]) -> JsonDict:
    """Source of the procedure after these documents of a session: as it was begun, or as the last resumption with another bench changed it."""
    changed = [document["procedure"] for document in documents if document["kind"] == "resume" and "procedure" in document]
    return [documents[0]["procedure"], *changed][-1]


def _stated(bench_file: BenchFile) -> JsonDict:
    """What a bench file says of the day: motor, people, surroundings and calibrations."""
    return {
        "motor": bench_file.motor,
        "serial": bench_file.serial,
        "operator": bench_file.operator,
        "ambient": bench_file.ambient,
        "calibrated": {role: day.isoformat() for role, day in bench_file.calibrated.items()},
    }


def _refuse_other_motor(session: Session, bench_file: BenchFile) -> None:
    """Raise `BadInput` if motor or serial number is stated, and is not the one that the session states."""
    for key, what in (("motor", "motor"), ("serial", "the motor with serial number")):
        stated = [str(document[key]) for document in session.documents if document["kind"] in ("start", "resume") and document.get(key)]
        now = getattr(bench_file, key)
        if now and stated and now != stated[0]:
            raise BadInput(
                f"{session.path.name} was begun with {what} {clean_text(stated[0])!r}, but {clean_text(now)!r} is stated now; "
                "connect and state that motor, or begin a new session"
            )


def done_by(session: Session, documents: Sequence[JsonDict]) -> Done:
    """What has been done according to these documents of a session.

    Raises
    ------
    BadInput
        If they are not those of a run.
    """
    try:
        return Done.of(documents)
    except (KeyError, TypeError, ValueError) as error:
        raise BadInput(f"{session.path.name}: its documents are not those of a run ({type(error).__name__}: {error})") from error


def run(
    procedure: Procedure,
    bench: Bench,
    writer: Writer,
    *,
    analyse: Analyse,
    prompt: Prompt,
    tick: Callable[[], None] = lambda: None,
    done: Done | None = None,
) -> Outcome:
    """Run a procedure to its end, or into a safe state.

    Parameters
    ----------
    procedure : Procedure
    bench : Bench
        The caller closes it.
    writer : Writer
        An open session. It is closed at the end of the run, also of one that failed, with the reason.
    analyse : callable
        Does the steps fit, compare, diagnose, next and report.
    prompt : callable
        Tells the operator what to do and returns the answer: see `motoremi.run.answer`.
    tick : callable, optional
        Called at every exchange, to show progress.
    done : Done, optional
        What an earlier run of this session has finished; that is not repeated, except for steps that the rest depends on.

    Returns
    -------
    Outcome

    Raises
    ------
    Exception
        Whatever stopped the run, after the instruments are safe and the stop document is written.
    """
    state = Execution(procedure, bench, writer, analyse, prompt, tick, done or Done())
    plan = procedure.plan
    # Report steps at the end are done after the instruments are safe and the end of the measurement is stored, so that the report can state it.
    reports = tuple(itertools.takewhile(lambda planned: isinstance(planned.step, ReportStep), reversed(plan)))
    try:
        again: set[int] = set()
        if done is not None:
            again = needed_again(plan, done)
            writer.emit("resume", step=done.steps + 1, stored=done.stored, again=sorted(again), **done.resumed)
        left = [planned for planned in plan if planned.number > state.done.steps or planned.number in again]
        try:
            for planned in left:
                if planned not in reports:
                    state.step(planned)
        finally:
            unsafe = state.leave_safe()
        if unsafe:
            raise InstrumentError("; ".join(f"{role} could not be brought into its safe state ({problem})" for role, problem in unsafe.items()))
        writer.end()
        for planned in left:
            if planned in reports:
                state.step(planned)
    except KeyboardInterrupt:
        writer.close("interrupted", f"stopped by the operator in {state.where}")
        raise
    except NotDone as error:
        writer.close("interrupted", f"{state.where}: {error}")
        raise
    except BaseException as error:
        try:
            writer.close("failed", f"{state.where}: {str(error) or type(error).__name__}")
        except StorageError as second:
            # The first error is raised: it is the one that the user has to act on.
            error.add_note(f"the session could not be closed either: {second}")
        raise
    writer.close("done")
    return Outcome(len(plan), tuple(state.verdicts))
