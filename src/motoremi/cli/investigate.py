"""`motoremi investigate`: choose measurements and make them until one explanation is left."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import typer

from motoremi.cli.options import AsJson, SessionPath, command
from motoremi.errors import BadInput

if TYPE_CHECKING:
    from pathlib import Path

    from motoremi.bench.connect import Bench
    from motoremi.data.conditions import SingleValue
    from motoremi.data.session import Session
    from motoremi.run.answer import Answer
    from motoremi.run.requested import MeasurementRequest, RequestedMeasurements
    from motoremi.schema.bench_file import BenchFile
    from motoremi.workflow_investigate import Assessment, Investigation, Step

_MINUTES = {"s": 1 / 60, "sec": 1 / 60, "min": 1.0, "h": 60.0}
_WIDTH, _SHOWN = 24, 6


def investigate_(
    path: SessionPath,
    bench: Annotated[
        str, typer.Option(metavar="BENCH", help="Bench file; 'sim' is the simulated bench that the session was made on.", show_default=False)
    ],
    budget: Annotated[str, typer.Option(metavar="TIME", help="Time to spend at the bench in all, for example 30min.")] = "2h",
    odds: Annotated[float, typer.Option(metavar="N", help="Stop when one explanation is N times as likely as all others together.")] = 20.0,
    without: Annotated[
        list[str] | None, typer.Option("--without", metavar="ID", help="A measurement that this bench cannot do; may be repeated.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Measure, diagnose and choose the next measurement until one explanation is left. After Ctrl-C the same command continues."""
    from motoremi.cli.output import emit_json
    from motoremi.schema.bench_file import load_bench_file

    minutes = minutes_of(budget)
    if odds <= 1:
        raise BadInput(f"odds of {odds:g} cannot decide: give a number above 1, for example 20")
    found = investigated(path, load_bench_file(bench), minutes, odds, tuple(without or ()), quiet=as_json)
    if as_json:
        emit_json(found.to_dict())
        return
    show_end(found)


def investigated(path: Path, bench_file: BenchFile, minutes: float, odds: float, without: tuple[str, ...], *, quiet: bool) -> Investigation:
    """Investigate a session on a bench; the progress is printed unless `quiet`."""
    from motoremi.cli.bars import progress_bars
    from motoremi.cli.bench import keeping, tell, warn
    from motoremi.data.session import load, reopen
    from motoremi.interrupts import stopped_by_signals
    from motoremi.run.calibration_check import refuse_unless_calibrated
    from motoremi.run.on_bench import on_bench
    from motoremi.run.requested import RequestedMeasurements, procedure_for
    from motoremi.run.resume import Done
    from motoremi.run.runner import make_bench
    from motoremi.workflow_assess import Assessor
    from motoremi.workflow_investigate import investigate

    session = load(path)
    bench_file = _bench_of(session, bench_file)
    without = (*without, *_uncorrected(session))
    procedure = on_bench(procedure_for(session), bench_file)
    bench_file.refuse_unless_allowed(procedure)
    refuse_unless_calibrated(procedure, bench_file)
    made = make_bench(bench_file)
    try:
        with stopped_by_signals(), keeping(path), progress_bars(quiet) as bars, reopen(path) as writer:
            writer.subscribe(warn if quiet else tell)
            connections = Done.of(session.documents).connections
            writer.emit(
                "investigate", procedure=procedure.source, connections=connections, budget_minutes=minutes, odds=odds, without=list(without)
            )
            operator = _Operator(made, quiet, bars.paused)
            requests = RequestedMeasurements(procedure, made, writer, operator.prompt, operator.set_up, connections=connections)
            operator.requests = requests
            shown: Callable[[Assessment, Step | None], None] = (lambda assessment, step: None) if quiet else show_step
            try:
                return investigate(writer, Assessor(writer, odds, bars.bar("diagnosing")), operator, minutes, shown, without)
            finally:
                requests.leave_safe()
    finally:
        made.close()


def minutes_of(text: str) -> float:
    """A time such as `30min`, `2h` or `90 s`, in minutes.

    Raises
    ------
    BadInput
        If it cannot be read.
    """
    found = re.fullmatch(r"\s*([0-9]*\.?[0-9]+)\s*([a-z]+)\s*", text.lower())
    if found is None or found[2] not in _MINUTES:
        raise BadInput(f"cannot read {text!r} as a time: write for example 30min or 2h")
    return float(found[1]) * _MINUTES[found[2]]


def _bench_of(session: Session, bench_file: BenchFile) -> BenchFile:
    """The bench file, or for `sim` the simulated bench that the session was made on."""
    from motoremi.run.hidden_bench import kept_bench
    from motoremi.run.runner import was_begun_on

    name = session.path.name
    if session.status != "done":
        raise BadInput(f"{name}: its measurement was interrupted; finish it first: motoremi run --resume {session.path}")
    if not session.sweeps:
        raise BadInput(f"{name} holds no impedance sweep: measure or import one first")
    if bench_file.backend != "sim":
        return bench_file
    kept = kept_bench(session)
    if kept is not None:
        return kept
    if not was_begun_on(session, bench_file):
        raise BadInput(f"{name} was not measured on this simulated bench; give the bench file that it was measured with")
    return bench_file


def _uncorrected(session: Session) -> tuple[str, ...]:
    """The wide sweep, if the corrections between motor and analyser are not known over its span."""
    from motoremi.run.requested import WIDE
    from motoremi.schema.procedure import load_procedure

    widest = load_procedure("wide_sweep").sweep
    assert widest is not None
    try:
        session.corrections.refuse_outside("analyser", widest.start, widest.stop)
    except BadInput:
        return (WIDE,)
    return ()


@dataclass
class _Operator:
    """The operator of a bench: a person at the terminal, or the simulation."""

    made: Bench
    quiet: bool
    paused: Callable[[], AbstractContextManager[None]]
    requests: RequestedMeasurements | None = None
    started_s: float = 0.0

    @property
    def simulated(self) -> bool:
        from motoremi.virtual.simulated_bench import SimulatedBench

        return isinstance(self.made, SimulatedBench)

    def sweep(self, order: MeasurementRequest) -> None:
        """Have the condition set up, and measure."""
        assert self.requests is not None
        self.started_s = time.monotonic()
        self.requests.measure(order)

    def value(self, order: MeasurementRequest) -> SingleValue:
        """The reading of another meter."""
        from motoremi.virtual.simulated_bench import SimulatedBench

        self.started_s = time.monotonic()
        if isinstance(self.made, SimulatedBench):
            return self.made.single_value(order.id, order.turn)
        with self.paused():
            return typed_value(order)

    def minutes(self, estimated: float) -> float:
        """Elapsed minutes; on a simulated bench the estimate, because nothing takes real time there."""
        return estimated if self.simulated else (time.monotonic() - self.started_s) / 60

    def prompt(self, text: str) -> Answer | None:
        """Show the operator an instruction and return the answer."""
        from motoremi.cli.bench import ask_operator

        if self.simulated:
            return None
        with self.paused():
            return ask_operator(text)

    def set_up(self, order: MeasurementRequest | None) -> None:
        """On a simulated bench, do what the operator is asked to do; None: undo it."""
        from motoremi.virtual.simulated_bench import SimulatedBench

        if isinstance(self.made, SimulatedBench):
            self.made.arrange(*((None, ()) if order is None else (order.condition, order.terminations, order.turn)))


def typed_value(order: MeasurementRequest) -> SingleValue:
    """Ask for a value until it can be read; `n` means that there is none."""
    from motoremi.data.conditions import VALUES, parse_value
    from motoremi.data.text import clean_text
    from motoremi.run.answer import TYPED, NotDone
    from motoremi.run.requested import requested_value

    setting = VALUES[order.id].setting
    sys.stderr.write(f"\n{clean_text(order.instruction)}\n")
    while True:
        sys.stderr.write(f"{order.id}, for example {setting.example}; n not done, s stop: ")
        sys.stderr.flush()
        if not (typed := sys.stdin.readline()):
            raise BadInput("the question was not answered: standard input has ended; run from a terminal")
        text = typed.strip()
        answer = TYPED.get(text.casefold()) if text else None
        if answer == "stop":
            raise KeyboardInterrupt
        if answer == "not done":
            raise NotDone(f"the operator has no value for {order.id}")
        try:
            return requested_value(order, parse_value(text if "=" in text else f"{order.id}={text}"))
        except BadInput as error:
            sys.stderr.write(f"{error}\n")


def show_step(assessment: Assessment, step: Step | None) -> None:
    """Print the probabilities of the explanations as bars, and the information of the step."""
    from motoremi.cli.output import say

    if step is not None:
        say(f"{step.id}: {step.minutes:.3g} min, information {step.taught_bits:.2g} bits; error so far {step.error_percent:.3g} %")
    else:
        say(f"error so far {assessment.error_percent:.3g} %; possible explanations:")
    for name, share in list(assessment.probabilities.items())[:_SHOWN]:
        say(f"  {name:44s} {'#' * round(_WIDTH * share):{_WIDTH}s} {share:.3f}")
    for finding in assessment.findings:
        say(f"  found in the data: {finding['id']}: {finding['why']}")


_ENDS = {
    "one-stands": "one explanation is left",
    "inseparable": "no measurement of the menu can distinguish the explanations that are left",
    "nothing-missing": "nothing is missing that these data could show",
    "budget": "the measurements that are left take longer than the time that is left",
    "nothing-left": "no measurement is left that this bench can make",
}


def show_end(found: Investigation) -> None:
    """Print the result."""
    from motoremi.cli.output import say

    diagnosis = found.diagnosis
    named = " + ".join(diagnosis["effects"]) or diagnosis["verdict"]
    spent = f"{found.minutes:.3g} min at the bench, {len(found.steps)} measurements"
    say(f"{_ENDS[found.stop]}: {named}, confidence {diagnosis['confidence']:.2f}; {spent}")
    for reason in diagnosis["reasons"]:
        say(f"  {reason}")
    if found.refused:
        say(f"  not done: {', '.join(found.refused)}")


def register(app: typer.Typer) -> None:
    """Add this command."""
    command(app, "investigate", investigate_, "motoremi investigate session --bench sim --budget 30min")
