"""Commands that run a bench: run, replay, procedures."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motoremi.cli.options import AsJson, Out, SessionPath, ask_once, command
from motoremi.errors import BadInput

if TYPE_CHECKING:
    from motoremi.arrays import JsonDict
    from motoremi.bench.connect import Bench
    from motoremi.cli.bars import Bars
    from motoremi.data.session import SessionWriter
    from motoremi.run.answer import Answer
    from motoremi.run.rehearsal import Rehearsed
    from motoremi.run.resume import Done
    from motoremi.run.runner import Outcome
    from motoremi.schema.bench_file import BenchFile
    from motoremi.schema.procedure import Procedure

# Largest number of messages that a dry run shows for one step.
SHOWN_MESSAGES = 40


def run_(
    procedure: Annotated[
        str | None, typer.Argument(metavar="PROCEDURE", help="A TOML file, or a ready one: motoremi procedures lists them.", show_default=False)
    ] = None,
    bench: Annotated[str | None, typer.Option(help="Bench file with resources and calibration dates; 'sim' is the embedded bench.")] = None,
    out: Out = None,
    resume: Annotated[
        Path | None, typer.Option("--resume", metavar="SESSION", help="Continue an interrupted session instead.", show_default=False)
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="List what would be sent and how long it takes; touches no instrument.")] = False,
    as_json: AsJson = False,
) -> None:
    """Run a bench procedure; a session folder is the result. FAIL if a check, compare or judge step fails. Ctrl-C stops safely and keeps data."""
    from motoremi.data.session import SessionWriter, load, reopen
    from motoremi.run.on_bench import on_bench
    from motoremi.run.runner import resumable, start_document
    from motoremi.schema.bench_file import BenchFile, load_bench_file
    from motoremi.schema.procedure import load_procedure

    bench_file = load_bench_file(bench, ask_once()) if bench is not None else BenchFile()
    if (procedure is None) == (resume is None):
        raise BadInput("give a procedure, or a session with --resume SESSION; not both")
    if resume is not None:
        if dry_run or out is not None:
            raise BadInput("--resume continues in the session itself: leave out --out and --dry-run")
        steps, done = resumable(load(resume), bench_file)
        with continuable(resume, bench):
            _run(steps, bench_file, resume, lambda: reopen(resume), as_json, done)
        return
    steps = on_bench(load_procedure(str(procedure)), bench_file)
    if dry_run:
        _rehearse(steps, bench_file, as_json)
        return
    folder = out if out is not None else fresh_folder("run")
    refuse_begun(folder, bench)
    with continuable(folder, bench):
        _run(steps, bench_file, folder, lambda: SessionWriter.create(folder, start_document(steps, bench_file)), as_json, None)


def _run(procedure: Procedure, bench_file: BenchFile, folder: Path, begin: Callable[[], SessionWriter], as_json: bool, done: Done | None) -> None:
    from motoremi.cli.bars import progress_bars
    from motoremi.cli.output import emit_json, say
    from motoremi.data.state import marks_of, states_of
    from motoremi.interrupts import stopped_by_signals
    from motoremi.run.calibration_check import refuse_unless_calibrated, tell_doubts
    from motoremi.run.runner import make_bench

    bench_file.refuse_unless_allowed(procedure)
    refuse_unless_calibrated(procedure, bench_file)
    made = make_bench(bench_file)
    try:
        with stopped_by_signals(), keeping(folder), progress_bars(as_json) as bars, begin() as writer:
            measured: list[JsonDict] = []
            writer.subscribe(measured.append)
            writer.subscribe(warn if as_json else tell)
            tell_doubts(procedure, bench_file, writer)
            if not as_json:
                for remark in procedure.remarks():
                    say(f"note: {remark}")
            outcome = _watched(procedure, bench_file, made, writer, bars, done)
    finally:
        made.close()
    marked = [{"file": file, "marks": marks_of(state)} for file, state in states_of(measured) if marks_of(state)]
    if as_json:
        emit_json({"schema": "motoremi.run/1", "session": str(folder), "verdict": outcome.verdict, **outcome.to_dict(), "marked": marked})
    else:
        for entry in marked:
            say(f"MARKED: {entry['file']}: {'; '.join(entry['marks'])}")
        say(f"{outcome.verdict.upper()}: session {folder}")
    raise typer.Exit(0 if outcome.passed else 1)


def _watched(procedure: Procedure, bench_file: BenchFile, made: Bench, writer: SessionWriter, bars: Bars, done: Done | None) -> Outcome:
    """Run with a progress bar in seconds, if a dry run of the procedure is possible."""
    from motoremi.run.rehearsal import rehearse
    from motoremi.run.run_progress import RunProgress
    from motoremi.run.runner import run
    from motoremi.workflow_steps import analyse

    def nothing() -> None: ...

    tick = nothing
    if (show := bars.bar("measuring")) is not None:
        try:
            progress = RunProgress(rehearse(procedure, bench_file), made.clock, show)
        except BadInput:
            # A driver from another package may have no simulated instrument: then there is no progress bar.
            pass
        else:
            writer.subscribe(progress.document)
            tick = progress.tick

    def ask(text: str) -> Answer | None:
        if bench_file.backend == "sim":
            return None
        with bars.paused():
            return ask_operator(text)

    return run(procedure, made, writer, analyse=analyse(bars.bar("diagnosing")), prompt=ask, tick=tick, done=done)


def _rehearse(procedure: Procedure, bench_file: BenchFile, as_json: bool) -> None:
    from motoremi.cli.output import emit_json, say
    from motoremi.run.rehearsal import rehearse

    steps = rehearse(procedure, bench_file)
    total = sum(step.seconds for step in steps)
    if as_json:
        emit_json(
            {
                "schema": "motoremi.dry-run/1",
                "title": procedure.title,
                "seconds": total,
                "messages": sum(step.messages for step in steps),
                "remarks": list(procedure.remarks()),
                "steps": [step.to_dict() for step in steps],
            }
        )
        return
    say(f"{procedure.title}: rehearsed on simulated instruments; nothing is sent to real ones.")
    say("Times are those of the simulators, without fitting, diagnosis and the operator.")
    say("Readings of the error queue, one after each message where an instrument has a queue, are not listed.")
    for remark in procedure.remarks():
        say(f"note: {remark}")
    for step in steps:
        _show(step, len(steps))
    say(f"in all about {_duration(total)} of measuring, {sum(step.messages for step in steps)} messages")


def _show(step: Rehearsed, of: int) -> None:
    import textwrap

    from motoremi.cli.output import say

    detail = " ".join(f"{key} {value}" for key, value in step.parameters.items())
    say(f"[{step.number}/{of}] {step.do} {detail}".rstrip() + (f": {_duration(step.seconds)}" if step.seconds else ""))
    for prompt in step.prompts:
        say(f"    operator: {prompt}")
    for role in dict.fromkeys(entry[0] for entry in step.sent):
        messages = [message + (f" (x {times})" if times > 1 else "") for sender, message, times in step.sent if sender == role]
        more = f" | and {len(messages) - SHOWN_MESSAGES} more (--json lists all)" if len(messages) > SHOWN_MESSAGES else ""
        text = " | ".join(messages[:SHOWN_MESSAGES]) + more
        say("\n".join(textwrap.wrap(f"{role}: {text}", 140, initial_indent="    ", subsequent_indent="      ")))


def _duration(seconds: float) -> str:
    if seconds < 60:
        return f"{seconds:.1f} s"
    if seconds >= 3600:
        return f"{seconds / 3600:.2f} h"
    return f"{seconds // 60:.0f} min {seconds % 60:.0f} s"


def ask_operator(text: str) -> Answer:
    """Show the operator an instruction and wait for one of the three answers."""
    from motoremi.cli.output import ask_in_writing
    from motoremi.data.text import clean_text
    from motoremi.run.answer import TYPED

    lines = "\n".join(clean_text(line) for line in text.split("\n"))
    ask_in_writing(f"\n{lines}\n")
    while True:
        ask_in_writing("\n[Enter] done, n not done, s stop: ")
        if not (typed := sys.stdin.readline()):
            raise BadInput("the prompt was not answered: standard input has ended; run from a terminal")
        answer = TYPED.get(" ".join(typed.casefold().split()))
        if answer is not None:
            return answer


def replay_(
    path: SessionPath,
    out: Out = None,
    lenient: Annotated[bool, typer.Option("--lenient", help="Continue after a difference, as far as the record has answers.")] = False,
    as_json: AsJson = False,
) -> None:
    """Run a session's procedure again from its recorded traffic; a difference is an error that shows the recorded and the new exchange."""
    from motoremi.bench.replay_difference import ReplayDifference
    from motoremi.cli.output import emit_json, say
    from motoremi.data.session import load
    from motoremi.errors import InstrumentError
    from motoremi.run.rerun import rerun
    from motoremi.workflow_steps import analyse

    folder = out if out is not None else fresh_folder("replay")
    try:
        result = rerun(load(path), folder, analyse, lenient, None if as_json else tell)
    except ReplayDifference as difference:
        if as_json:
            emit_json({"schema": "motoremi.replay/1", "session": str(folder), "same": False, "differences": [difference.to_dict()]})
        else:
            say("\n".join(difference.lines()))
        raise
    if as_json:
        emit_json({"schema": "motoremi.replay/1", **result.to_dict()})
    else:
        for passed_over in result.differences:
            say("\n".join(passed_over.lines()))
        if result.ended != "done":
            say(f"the recorded run was not completed: {result.ended}")
        exactness = f", {len(result.rounded)} of them but for the rounding of another processor" if result.rounded else " bit for bit"
        what = f"replayed without a difference, {result.compared} sweeps and spectra{exactness}"
        say(f"{what if result.same else 'replayed with differences'}: session {folder}")
    if result.differing:
        raise InstrumentError(f"{len(result.differing)} of {result.compared} measured files differ: {', '.join(result.differing)}")


def procedures_(
    name: Annotated[str | None, typer.Argument(metavar="PROCEDURE", help="A ready one, or a TOML file.", show_default=False)] = None,
    keys: Annotated[bool, typer.Option("--keys", help="Every key of a procedure and of a bench file: units, limits, defaults.")] = False,
    as_json: AsJson = False,
) -> None:
    """The ready procedures; the steps of one; every key that a procedure may have."""
    from motoremi.cli.output import emit_json, say
    from motoremi.schema.keys import reference
    from motoremi.schema.procedure import load_procedure, ready_procedures

    if keys:
        tables = reference()
        if as_json:
            emit_json({"schema": "motoremi.procedure-keys/1", "tables": [table.to_dict() for table in tables]})
            return
        for table in tables:
            say(f"{table.title}\n  {table.help}")
            for key in table.keys:
                say(f"    {key.name:18s} {key.takes}; {f'default {key.default}' if key.default else 'must be given'}")
                say(f"    {'':18s} {key.help}")
        return
    if name is None:
        titles = {ready: load_procedure(ready).title for ready in ready_procedures()}
        if as_json:
            emit_json({"schema": "motoremi.procedures/1", "procedures": titles})
            return
        for ready, title in titles.items():
            say(f"{ready:20s} {title}")
        return
    procedure = load_procedure(name)
    if as_json:
        emit_json({"schema": "motoremi.procedure/1", **procedure.source})
        return
    say(procedure.title)
    for role, spec in procedure.instruments.items():
        say(f"  {role}: {spec.driver} at {spec.resource}")
    for planned in procedure.plan:
        detail = " ".join(f"{key} {value}" for key, value in planned.step.parameters().items())
        say(f"  {planned}: {detail}".rstrip(" :"))


def tell(document: JsonDict) -> None:
    """Print the progress of a run: a line for each document that matters to the user."""
    from motoremi.cli.output import say
    from motoremi.data.state import marks_of, state_line
    from motoremi.quantities import show, show_band

    kind = document["kind"]
    if kind == "instrument":
        identity = document["identity"]
        say(f"  {document['role']}: {identity['vendor']} {identity['model']} serial {identity['serial']} at {document['resource']}")
    elif kind in ("sweep", "spectrum", "standard"):
        what = " ".join(_text(document[key]) for key in ("termination", "detector", "standard", "condition") if key in document)
        say(f"  {what} {kind}: {document['points']} points, {show_band(*document['span_hz'])} -> {document['file']}")
        if "state" in document:
            say(
                "\n".join(
                    f"    {text}" for text in (f"at {state_line(document['state'])}", *(f"MARKED: {mark}" for mark in marks_of(document["state"])))
                )
            )
    elif kind == "maxima":
        chosen = ", ".join(show(one["frequency_hz"], "Hz") for one in document["maxima"])
        say(f"  {len(document['maxima'])} maxima to read again: {chosen}" if chosen else "  no maximum is near the limit: nothing to read again")
        if document["more"]:
            say(f"  {document['more']} more are within the margin; with a larger 'maxima' in the procedure they are read as well")
    elif kind == "final":
        where = " ".join(str(document[key]) for key in ("line", "operating") if key in document)
        say(f"  {document['detector']} at {show(document['maximum_hz'], 'Hz')} {where}: reading {document['highest_dbuv']:.1f} dBuV")
    elif kind == "supply":
        say(f"  supply {document['output']}" + (f"; {document['trouble']}" if document["trouble"] else ""))
    elif kind == "state":
        reached = document["reached"] or "not reached, the operator continues"
        say(f"  {reached} after {_duration(document['seconds'])}: {state_line(document['state'])}")
    elif kind == "asked":
        say(f"asked: {document['order']['instruction']} ({document['minutes']:.3g} min)")
    elif kind == "refused":
        say(f"  {document['id']} is not done; the next best measurement instead")
    elif kind == "prompt":
        say(f"  the operator: {document['answer']}")
    elif kind == "step-start":
        detail = " ".join(str(value) for value in document["parameters"].values())
        again = " (again, for the steps that follow)" if document.get("again") else ""
        say(f"[{document['step']}/{document['of']}] {document['do']} {detail}".rstrip() + again)
    elif kind == "resume":
        say(f"continuing at step {document['step']}" + (f", of which {document['stored']} are stored" if document["stored"] else ""))
        if "procedure" in document:
            say("  with the instruments of the bench file, which are not those of the run so far")
    elif kind == "verdict":
        _tell_verdict(document)
    elif kind == "doubt":
        warn(document)
    elif kind == "safe" and not document["safe"]:
        say(f"  {document['role']} could NOT be brought into its safe state: {document['problem']}")


def _text(value: object) -> str:
    """A value of a document as text; a condition is stored as a table."""
    from motoremi.data.conditions import Condition

    return Condition.restored(value).text if isinstance(value, dict) else str(value)


def warn(document: JsonDict) -> None:
    """Print warnings to standard error, also with --json: a doubt, or an instrument that is not safe."""
    from motoremi.data.text import clean_text

    text = ""
    if document["kind"] == "doubt":
        text = str(document["says"])
    elif document["kind"] == "safe" and not document["safe"]:
        text = f"{document['role']} could NOT be brought into its safe state: {document['problem']}"
    if text:
        sys.stderr.write(f"motoremi: {clean_text(text)}\n")
        sys.stderr.flush()


def _tell_verdict(document: JsonDict) -> None:
    from motoremi.cli.output import say

    result = document["result"]
    if following := result.get("next_measurement"):
        say(f"  next: {following['id']}: {following['why']}")
        return
    effects = ", ".join(result.get("effects", []))
    detail = f" ({effects})" if effects else f": {result['says']}" if "says" in result else ""
    say(f"  {document['do']}: {result.get('verdict')}{detail}")
    for finding in result.get("serious_findings", []):
        say(f"  found in the data: {finding}")


@contextmanager
def keeping(folder: Path) -> Iterator[None]:
    """If a run is stopped, name the folder with the measured data, once there is a session."""
    from motoremi.data.paths import SESSION
    from motoremi.errors import Stopped

    try:
        yield
    except KeyboardInterrupt as stop:
        if not (folder / SESSION).is_file():
            raise
        raise Stopped(f"stopped; what was measured is kept in {folder}") from stop


@contextmanager
def continuable(folder: Path, bench: str | None) -> Iterator[None]:
    """If an instrument stops a run, say how to continue it, once there is a session."""
    from motoremi.data.paths import SESSION
    from motoremi.errors import InstrumentError
    from motoremi.run.answer import NotDone

    try:
        yield
    except NotDone:
        # It says so itself.
        raise
    except InstrumentError as error:
        if not (folder / SESSION).is_file():
            raise
        raise InstrumentError(f"{error}; then continue with {_continuing(folder, bench)}") from error


def refuse_begun(folder: Path, bench: str | None) -> None:
    """Refuse a folder with a run that did not come to its end.

    Raises
    ------
    BadInput
        With the command that continues it.
    """
    from motoremi.data.session import load

    try:
        session = load(folder)
    except BadInput:
        # There is none, or a damaged one: making a new session there says what is in the way.
        return
    if "procedure" in session.start and session.status != "done":
        raise BadInput(f"{folder}: holds a run that is not finished; continue it with {_continuing(folder, bench)}, or name a new folder")


def _continuing(folder: Path, bench: str | None) -> str:
    from motoremi.cli.output import quoted

    return f"motoremi run --resume {quoted(folder)}" + ("" if bench is None else f" --bench {quoted(Path(bench))}")


def fresh_folder(prefix: str) -> Path:
    """A new folder name in the current directory."""
    return Path(f"motoremi-{prefix}-{datetime.now(UTC):%Y%m%dT%H%M%S%f}Z")


def register(app: typer.Typer) -> None:
    """Add these commands."""
    command(app, "run", run_, "motoremi run full_motor_test --bench sim --out session")
    command(app, "replay", replay_, "motoremi replay session --out again")
    command(app, "procedures", procedures_, "motoremi procedures full_motor_test")
