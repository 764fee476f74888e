"""An investigation on a bench, real or simulated: what `motoremi investigate` and the workbench have in common."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from motoremi.arrays import JsonDict, Progress
from motoremi.bench.connect import Bench
from motoremi.data.conditions import SingleValue
from motoremi.data.session import Session, SessionWriter, load, refuse_unfinished
from motoremi.errors import BadInput
from motoremi.run.answer import Answer
from motoremi.run.calibration_check import refuse_unless_calibrated
from motoremi.run.hidden_bench import kept_bench
from motoremi.run.on_bench import on_bench
from motoremi.run.requested import WIDE, MeasurementRequest, RequestedMeasurements, procedure_for
from motoremi.run.resume import Done
from motoremi.run.runner import make_bench, was_begun_on
from motoremi.schema.bench_file import BenchFile
from motoremi.schema.procedure import Procedure, load_procedure
from motoremi.virtual.simulated_bench import SimulatedBench
from motoremi.workflow_assess import Assessor
from motoremi.workflow_investigate import MOST_STEPS, Assessment, Investigation, Step, investigate


@dataclass(frozen=True)
class Plan:
    """What an investigation may do.

    Parameters
    ----------
    budget_minutes : float
        Time at the bench, of all runs together.
    odds : float
        Stop when one explanation is this many times as likely as all others together.
    without : tuple of str
        Measurements that this bench cannot make.
    own : tuple of dict
        A laboratory's own measurements (`workflow_ask.own_measurements`).
    most : int
        Measurements of this run.
    """

    budget_minutes: float
    odds: float = 20.0
    without: tuple[str, ...] = ()
    own: tuple[JsonDict, ...] = ()
    most: int = MOST_STEPS

    def __post_init__(self) -> None:
        if not self.odds > 1:
            raise BadInput(f"odds of {self.odds:g} do not favour any explanation: give a number above 1, for example 20")
        if not self.budget_minutes > 0:
            raise BadInput(f"a budget of {self.budget_minutes:g} minutes is not possible: give a number above 0")


class BenchOperator(Protocol):
    """The operator of a real bench; a simulated one has no prompts."""

    def prompt(self, text: str) -> Answer | None:
        """Show an instruction and return the answer."""
        ...

    def value(self, request: MeasurementRequest) -> SingleValue:
        """Ask for the reading of another meter."""
        ...


def bench_for(session: Session, bench_file: BenchFile) -> BenchFile:
    """The bench on which a session is investigated: the bench file; for a simulated one, the bench that the session was made on.

    Raises
    ------
    BadInput
        If the session holds no finished impedance measurement, or was made on another simulated bench.
    """
    name = session.path.name
    refuse_unfinished(session)
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


def prepared(session: Session, bench_file: BenchFile) -> tuple[Procedure, BenchFile]:
    """Procedure and bench for the measurements of an investigation, checked before an instrument is touched.

    Raises
    ------
    BadInput
        As `bench_for`; or if the bench does not allow the procedure, or its calibration has expired.
    """
    bench_file = bench_for(session, bench_file)
    procedure = on_bench(procedure_for(session), bench_file)
    bench_file.refuse_unless_allowed(procedure)
    refuse_unless_calibrated(procedure, bench_file)
    return procedure, bench_file


def investigate_on_bench(
    procedure: Procedure,
    bench_file: BenchFile,
    writer: SessionWriter,
    plan: Plan,
    operator: BenchOperator,
    tell: Callable[[Assessment, Step | None], None],
    progress: Progress | None = None,
    tick: Callable[[], None] = lambda: None,
) -> Investigation:
    """Make measurements that distinguish the explanations until one is left; the instruments end in their safe state.

    Parameters
    ----------
    procedure, bench_file
        From `prepared`.
    writer : SessionWriter
        The session, open; it stays open.
    plan : Plan
    operator : BenchOperator
    tell : callable
        As in `investigate`.
    progress : callable, optional
        Of each diagnosis.
    tick : callable, optional
        Called at every exchange with an instrument; may raise KeyboardInterrupt to stop.
    """
    session = load(writer.path)
    without = (*plan.without, *_uncorrected(session))
    connections = Done.of(session.documents).connections
    made = make_bench(bench_file)
    try:
        writer.emit(
            "investigate", procedure=procedure.source, connections=connections,
            budget_minutes=plan.budget_minutes, odds=plan.odds, without=list(without),
        )  # fmt: skip
        bench = OperatedBench(made, operator)
        requests = RequestedMeasurements(procedure, made, writer, bench.prompt, bench.set_up, tick, connections)
        bench.requests = requests
        try:
            return investigate(writer, Assessor(writer, plan.odds, progress, plan.own), bench, plan.budget_minutes, tell, without, plan.most)
        finally:
            requests.leave_safe()
    finally:
        made.close()


def _uncorrected(session: Session) -> tuple[str, ...]:
    """The wide sweep, if the corrections between motor and analyser are not known over its span."""
    widest = load_procedure("wide_sweep").sweep
    assert widest is not None
    try:
        session.corrections.refuse_outside("analyser", widest.start, widest.stop)
    except BadInput:
        return (WIDE,)
    return ()


@dataclass
class OperatedBench:
    """The bench of an investigation: instruments and operator."""

    made: Bench
    operator: BenchOperator
    requests: RequestedMeasurements | None = None
    # None until something is measured in this run.
    started_s: float | None = None

    def sweep(self, request: MeasurementRequest) -> None:
        """Have the condition set up, and measure."""
        assert self.requests is not None
        self.started_s = time.monotonic()
        self.requests.measure(request)

    def value(self, request: MeasurementRequest) -> SingleValue:
        """The reading of another meter."""
        self.started_s = time.monotonic()
        return self.made.single_value(request.id, request.turn) if isinstance(self.made, SimulatedBench) else self.operator.value(request)

    def minutes(self, estimated: float) -> float:
        """Elapsed minutes; the estimate on a simulated bench, where nothing takes real time, and for what an earlier run measured."""
        if self.started_s is None or isinstance(self.made, SimulatedBench):
            return estimated
        return (time.monotonic() - self.started_s) / 60

    def prompt(self, text: str) -> Answer | None:
        """Show the operator an instruction and return the answer."""
        return None if isinstance(self.made, SimulatedBench) else self.operator.prompt(text)

    def set_up(self, request: MeasurementRequest | None) -> None:
        """On a simulated bench, do what the operator is asked to do; None: undo it."""
        if isinstance(self.made, SimulatedBench):
            self.made.arrange(*((None, ()) if request is None else (request.condition, request.terminations, request.turn)))
