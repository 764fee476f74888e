"""Runs a procedure: measuring steps here, analysing steps by whoever calls; all that happens goes into the session."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any, Literal, Protocol

from motoremi.arrays import JsonDict
from motoremi.bench.analyser import ImpedanceAnalyser
from motoremi.bench.connect import INSTRUCTIONS, Bench, Connection, VisaBench
from motoremi.bench.driver import Driver
from motoremi.bench.procedure import BenchFile, Compensate, Identify, Procedure, Scan, Step, Sweep
from motoremi.bench.receiver import EmiReceiver
from motoremi.bench.simulated import SimulatedBench
from motoremi.data.spectrum import Spectrum
from motoremi.data.sweep import ImpedanceSweep
from motoremi.errors import BadInput, InstrumentError, MotoremiError


class Writer(Protocol):
    """What a run asks of a session; `motoremi.data.session.SessionWriter` is one."""

    def emit(self, kind: str, **content: Any) -> JsonDict:
        """Append one document and tell the listeners."""
        ...

    def add_sweep(self, sweep: ImpedanceSweep) -> Path:
        """Store a sweep."""
        ...

    def add_spectrum(self, spectrum: Spectrum) -> Path:
        """Store a spectrum."""
        ...

    def log_traffic(self, record: Mapping[str, Any]) -> None:
        """Store one exchange."""
        ...

    def close(self, status: Literal["done", "failed", "interrupted"], reason: str = "") -> None:
        """Write the stop document and the manifest."""
        ...


# Step kind, session, parameters of the step -> result, None if there is nothing to judge.
Analyse = Callable[[str, Any, JsonDict], JsonDict | None]


@dataclass(frozen=True)
class Outcome:
    """How a run ended.

    Parameters
    ----------
    steps : int
        How many were done.
    verdicts : tuple of dict
        What the judging steps said, in order.
    """

    steps: int
    verdicts: tuple[JsonDict, ...]

    @property
    def passed(self) -> bool:
        """Whether no judging step said "fail"."""
        return all(verdict.get("verdict") != "fail" for verdict in self.verdicts)

    def to_dict(self) -> JsonDict:
        """Plain data."""
        return {"steps": self.steps, "passed": self.passed, "verdicts": list(self.verdicts)}


def make_bench(bench_file: BenchFile) -> Bench:
    """The bench that a bench file describes."""
    if bench_file.backend == "sim":
        return SimulatedBench(bench_file.seed, bench_file.effects)
    return VisaBench({str(role): name for role, name in bench_file.resources.items()}, bench_file.backend, bench_file.allow)


def start_document(procedure: Procedure, bench_file: BenchFile) -> JsonDict:
    """What the session's first document says of a run: enough to run it again."""
    return {
        "title": procedure.title,
        "procedure": procedure.source,
        "operator": bench_file.operator,
        "backend": bench_file.backend or "visa",
        "calibrated": {role: day.isoformat() for role, day in bench_file.calibrated.items()},
        "calibration_age_days": {role: (date.today() - day).days for role, day in bench_file.calibrated.items()},
    }


def run(
    procedure: Procedure,
    bench: Bench,
    writer: Writer,
    *,
    analyse: Analyse,
    prompt: Callable[[str], None],
) -> Outcome:
    """Run a procedure to its end, or into a safe state.

    Parameters
    ----------
    procedure : Procedure
    bench : Bench
        Stays open; the caller closes it.
    writer : Writer
        An open session. It is closed here, with the reason, however the run ends.
    analyse : callable
        Does the steps fit, compare, diagnose and report.
    prompt : callable
        Tells the operator what to connect and returns when it is done.

    Returns
    -------
    Outcome

    Raises
    ------
    Exception
        Whatever stopped the run, after the instruments are safe and the stop document is written.
    """
    state = _Run(procedure, bench, writer, analyse, prompt)
    try:
        try:
            for number, step in enumerate(procedure.steps, start=1):
                state.step(number, step)
        finally:
            state.leave_safe()
    except KeyboardInterrupt:
        writer.close("interrupted", f"stopped by the operator in {state.where}")
        raise
    except BaseException as error:
        writer.close("failed", f"{state.where}: {str(error) or type(error).__name__}")
        raise
    writer.close("done")
    return Outcome(len(procedure.steps), tuple(state.verdicts))


class _Run:
    """The state of one run: who is connected, and what has been said."""

    def __init__(self, procedure: Procedure, bench: Bench, writer: Writer, analyse: Analyse, prompt: Callable[[str], None]) -> None:
        self.procedure = procedure
        self.bench = bench
        self.writer = writer
        self.analyse = analyse
        self.prompt = prompt
        self.drivers: dict[str, Driver] = {}
        self.verdicts: list[JsonDict] = []
        self.where = "the start"
        self._connected: tuple[Connection, int] | None = None
        self._leaving = False

    def step(self, number: int, step: Step) -> None:
        """Do one step, between its two documents."""
        parameters = step.model_dump(exclude={"do"}, exclude_none=True)
        self.where = f"step {number} ({step.do})"
        self.writer.emit("step-start", step=number, of=len(self.procedure.steps), do=step.do, parameters=parameters)
        if isinstance(step, Identify):
            self._identify()
        elif isinstance(step, Compensate):
            self._connect("open-standard" if step.standard == "open" else "short-standard")
            self._analyser().compensate(step.standard)
        elif isinstance(step, Sweep):
            connection = self._connect(step.termination)
            for _ in range(step.repeat):
                # Stored one by one: an instrument that fails in the third sweep leaves two.
                self.writer.add_sweep(self._analyser().sweep(step.termination).with_metadata(connection=connection))
        elif isinstance(step, Scan):
            self._connect("lisn")
            for _ in range(step.repeat):
                self.writer.add_spectrum(self._receiver().scan(step.detector))
        else:
            result = self.analyse(step.do, self.writer, parameters)
            if result is not None:
                self.verdicts.append(result)
                self.writer.emit("verdict", step=number, do=step.do, result=result)
        self.writer.emit("step-stop", step=number, of=len(self.procedure.steps), do=step.do)

    def leave_safe(self) -> None:
        """Bring every connected instrument into its safe state and let it go; says so, and never hides the first error."""
        self._leaving = True
        problems = dict.fromkeys(self.drivers, "")
        for role, driver in self.drivers.items():
            try:
                driver.safe()
            except InstrumentError as error:
                problems[role] = str(error)
            finally:
                driver.close()
        # Written last: what cannot be stored must not keep the next instrument from its safe state.
        for role, problem in problems.items():
            self.writer.emit("safe", role=role, safe=not problem, problem=problem)

    def _log(self, record: Mapping[str, Any]) -> None:
        try:
            self.writer.log_traffic(record)
        except MotoremiError:
            # A full disk ends the run, but does not stand between an instrument and its safe state.
            if not self._leaving:
                raise

    def _identify(self) -> None:
        for role, spec in self.procedure.instruments.items():
            driver = self.bench.open(role, spec.driver, spec.resource, self._log)
            try:
                identity = driver.identify()
            except BaseException:
                # What answers may be anything; commands that make ours safe could harm it.
                driver.close()
                raise
            self.drivers[role] = driver
            driver.reset()
            self.writer.emit(
                "instrument",
                role=role,
                driver=spec.driver,
                resource=driver.transport.resource_name,
                identity=identity.to_dict(),
                settings=self._configure(driver),
            )

    def _configure(self, driver: Driver) -> JsonDict:
        sweep, spectrum = self.procedure.sweep, self.procedure.spectrum
        if isinstance(driver, ImpedanceAnalyser) and sweep is not None:
            return driver.configure(sweep.start, sweep.stop, sweep.points, sweep.spacing, sweep.bandwidth, sweep.oscillator)
        if isinstance(driver, EmiReceiver) and spectrum is not None:
            return driver.configure(spectrum.start, spectrum.stop, spectrum.step, spectrum.bandwidth, spectrum.dwell, spectrum.attenuation)
        return driver.settings()

    def _connect(self, what: Connection) -> int:
        # A second detector is read on the same connection. A second sweep step is a new connection on purpose.
        if what == "lisn" and self._connected is not None and self._connected[0] == what:
            return self._connected[1]
        self.prompt(INSTRUCTIONS[what])
        self._connected = (what, self.bench.connect(what))
        return self._connected[1]

    def _analyser(self) -> ImpedanceAnalyser:
        driver = self.drivers["analyser"]
        if not isinstance(driver, ImpedanceAnalyser):
            raise BadInput(f"instruments.analyser: the driver {type(driver).__name__} is no impedance analyser")
        return driver

    def _receiver(self) -> EmiReceiver:
        driver = self.drivers["receiver"]
        if not isinstance(driver, EmiReceiver):
            raise BadInput(f"instruments.receiver: the driver {type(driver).__name__} is no EMI receiver")
        return driver
