"""`motoremi investigate`: choose measurements and make them until one explanation is left."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motoremi.cli.options import AsJson, Menu, SessionPath, Without, command
from motoremi.errors import BadInput

if TYPE_CHECKING:
    from motoremi.data.conditions import SingleValue
    from motoremi.run.answer import Answer
    from motoremi.run.requested import MeasurementRequest
    from motoremi.schema.bench_file import BenchFile
    from motoremi.workflow_investigate import Assessment, Investigation, Step
    from motoremi.workflow_on_bench import Plan

_WIDTH, _SHOWN = 24, 6


def investigate_(
    path: SessionPath,
    bench: Annotated[
        str, typer.Option(metavar="BENCH", help="Bench file; 'sim' is the simulated bench that the session was made on.", show_default=False)
    ],
    budget: Annotated[str, typer.Option(metavar="TIME", help="Time to spend at the bench in all, for example 30min.")] = "2h",
    odds: Annotated[float, typer.Option(metavar="N", help="Stop when one explanation is N times as likely as all others together.")] = 20.0,
    without: Without = None,
    menu: Menu = None,
    as_json: AsJson = False,
) -> None:
    """Measure, diagnose and choose the next measurement until one explanation is left. After Ctrl-C the same command continues."""
    from motoremi.cli.output import emit_json
    from motoremi.quantities import parse_minutes
    from motoremi.schema.bench_file import load_bench_file
    from motoremi.workflow_ask import own_measurements, refuse_unknown
    from motoremi.workflow_on_bench import Plan

    own = () if menu is None else tuple(own_measurements(menu))
    refuse_unknown(without or (), own)
    plan = Plan(parse_minutes(budget), odds, tuple(without or ()), own)
    found = investigated(path, load_bench_file(bench), plan, quiet=as_json)
    if as_json:
        emit_json(found.to_dict())
        return
    show_end(found, path)


def investigated(path: Path, bench_file: BenchFile, plan: Plan, *, quiet: bool) -> Investigation:
    """Investigate a session on a bench; the progress is printed unless `quiet`."""
    from motoremi.cli.bars import progress_bars
    from motoremi.cli.bench import keeping, tell, warn
    from motoremi.data.session import load, reopen
    from motoremi.interrupts import stopped_by_signals
    from motoremi.workflow_on_bench import investigate_on_bench, prepared

    procedure, bench_file = prepared(load(path), bench_file)
    with stopped_by_signals(), keeping(path), progress_bars(quiet) as bars, reopen(path) as writer:
        writer.subscribe(warn if quiet else tell)
        shown: Callable[[Assessment, Step | None], None] = (lambda assessment, step: None) if quiet else show_step
        return investigate_on_bench(procedure, bench_file, writer, plan, _Terminal(bars.paused), shown, bars.bar("diagnosing"))


@dataclass(frozen=True)
class _Terminal:
    """The operator at the terminal; progress bars pause for each question."""

    paused: Callable[[], AbstractContextManager[None]]

    def prompt(self, text: str) -> Answer | None:
        """Show an instruction and return the answer."""
        from motoremi.cli.bench import ask_operator

        with self.paused():
            return ask_operator(text)

    def value(self, request: MeasurementRequest) -> SingleValue:
        """Ask for the reading of another meter."""
        with self.paused():
            return typed_value(request)


def typed_value(request: MeasurementRequest) -> SingleValue:
    """Ask for a value until it can be read; `n` means that there is none."""
    from motoremi.cli.output import ask_in_writing
    from motoremi.data.conditions import VALUES
    from motoremi.data.text import clean_text
    from motoremi.run.answer import TYPED, NotDone
    from motoremi.run.requested import read_value

    setting = VALUES[request.id].setting
    ask_in_writing(f"\n{clean_text(request.instruction)}\n")
    while True:
        ask_in_writing(f"{request.id}, for example {setting.example}; n not done, s stop: ")
        if not (typed := sys.stdin.readline()):
            raise BadInput("the question was not answered: standard input has ended; run from a terminal")
        text = typed.strip()
        answer = TYPED.get(text.casefold()) if text else None
        if answer == "stop":
            raise KeyboardInterrupt
        if answer == "not done":
            raise NotDone(f"the operator has no value for {request.id}")
        try:
            return read_value(request, text)
        except BadInput as error:
            sys.stderr.write(f"{error}\n")


def show_step(assessment: Assessment, step: Step | None) -> None:
    """Print the probabilities of the explanations as bars, and the information of the step."""
    from motoremi.cli.output import say
    from motoremi.quantities import percent

    if step is not None:
        say(f"{step.id}: {step.minutes:.3g} min, information {step.taught_bits:.2g} bits; error so far {percent(step.error_percent)}")
    else:
        say(f"error so far {percent(assessment.error_percent)}; possible explanations:")
    for name, share in list(assessment.probabilities.items())[:_SHOWN]:
        say(f"  {name:44s} {'#' * round(_WIDTH * share):{_WIDTH}s} {share:.3f}")
    for finding in assessment.findings:
        say(f"  found in the data: {finding['id']}: {finding['why']}")


def show_end(found: Investigation, path: Path) -> None:
    """Print the result, with the session in the commands that it proposes."""
    from motoremi.cli.output import quoted, say
    from motoremi.workflow_investigate import ENDS

    diagnosis = found.diagnosis
    named = " + ".join(diagnosis["effects"]) or diagnosis["verdict"]
    spent = f"{found.minutes:.3g} min at the bench, {len(found.steps)} measurements"
    say(f"{ENDS[found.stop]}: {named}, confidence {diagnosis['confidence']:.2f}; {spent}")
    for reason in diagnosis["reasons"]:
        say(f"  {reason.replace('SESSION', quoted(path))}")
    if found.refused:
        say(f"  not done: {', '.join(found.refused)}")


def register(app: typer.Typer) -> None:
    """Add this command."""
    command(app, "investigate", investigate_, "motoremi investigate session --bench sim --budget 30min")
