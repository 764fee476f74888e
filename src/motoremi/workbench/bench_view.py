"""The view Bench: identify instruments, start and stop a run, and answer its prompts."""

from __future__ import annotations

import secrets
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from motoremi.arrays import JsonDict
from motoremi.bench.connect import driver_class, driver_names
from motoremi.data.files import parse_impedance_csv, parse_spectrum_csv
from motoremi.data.paths import inside
from motoremi.data.session import Session, SessionWriter, load, reopen
from motoremi.data.text_file import decode, read_bytes
from motoremi.errors import BadInput, InstrumentError
from motoremi.run.answer import ANSWERS
from motoremi.run.calibration_check import refuse_unless_calibrated
from motoremi.run.on_bench import on_bench
from motoremi.run.runner import make_bench, resumable, start_document, was_begun_on
from motoremi.schema.bench_file import BenchFile
from motoremi.schema.procedure import Procedure, load_procedure, ready_procedures
from motoremi.simulate.hidden_effects import DEMO_EFFECTS
from motoremi.workbench.challenge_view import refuse_sealed
from motoremi.workbench.events import Events
from motoremi.workbench.investigations import InvestigationRun, plan_of
from motoremi.workbench.runs import ProcedureRun, Run
from motoremi.workbench.shelf import Shelf
from motoremi.workbench.views import effect_titles, rounded
from motoremi.workflow_on_bench import prepared

SIMULATED, REAL = "simulated", "real"
LONGEST_NAME = 200


@dataclass(frozen=True)
class Asked:
    """The page's request for a run.

    Parameters
    ----------
    procedure : str
        One of the built-in procedures.
    bench : {"simulated", "real"}
    motor, serial, operator : str
    seed : int
        Simulated bench: the number of the motor.
    hides : str
        Simulated bench: an effect, "nothing", or "something" for an effect chosen at random and not shown.
    ask : bool
        Whether to ask the operator before each connection; always done on a real bench.
    """

    procedure: str
    bench: str
    motor: str
    serial: str
    operator: str
    seed: int
    hides: str
    ask: bool

    @classmethod
    def of(cls, body: Mapping[str, Any]) -> Asked:
        """Check the request of a page."""
        texts = {key: body.get(key, "") for key in ("procedure", "bench", "motor", "serial", "operator", "hides")}
        for key, text in texts.items():
            if not isinstance(text, str) or len(text) > LONGEST_NAME:
                raise BadInput(f"{key} must be text of at most {LONGEST_NAME} characters")
        seed = body.get("seed", 1)
        if isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < 2**31:
            raise BadInput("the seed must be a whole number from 0 on")
        if texts["procedure"] not in ready_procedures():
            raise BadInput(f"there is no procedure of that name; choose one of {', '.join(ready_procedures())}")
        return cls(**texts, seed=seed, ask=bool(body.get("ask", False)))


class Workplace:
    """The bench of one workbench: at most one run at a time.

    Parameters
    ----------
    shelf : Shelf
    events : Events
    bench_file : BenchFile, optional
        The real bench, named when the workbench was started; a page cannot name one.
    """

    def __init__(self, shelf: Shelf, events: Events, bench_file: BenchFile | None = None) -> None:
        self._shelf = shelf
        self._events = events
        self._bench_file = bench_file
        self._turn = threading.Lock()
        self.run: Run | None = None

    def overview(self) -> JsonDict:
        """Procedures, benches and drivers."""
        titles = effect_titles()
        return {
            "procedures": [_procedure(name) for name in ready_procedures()],
            "drivers": {name: (driver_class(name).__doc__ or "").strip().splitlines()[0] for name in driver_names()},
            "real": None if self._bench_file is None else {str(role): name for role, name in self._bench_file.resources.items()},
            "operator": "" if self._bench_file is None else self._bench_file.operator,
            "hideable": {name: titles[name] for name in DEMO_EFFECTS},
        }

    def state(self) -> JsonDict:
        """The current or last run, for a page that has just opened."""
        return {"run": None if self.run is None else self.run.state()}

    def look(self, asked: Asked) -> JsonDict:
        """Identify each instrument of a procedure."""
        self._refuse_while_running()
        bench_file = self.bench_file_of(asked)
        procedure = on_bench(load_procedure(asked.procedure), bench_file)
        bench = make_bench(bench_file)
        found = []
        try:
            for role, spec in procedure.instruments.items():
                resource = bench_file.resources.get(role, spec.resource)
                entry: JsonDict = {"role": role, "driver": spec.driver, "resource": resource}
                try:
                    driver = bench.open(role, spec.driver, resource, lambda record: None, {role: spec.options})
                    try:
                        entry["identity"] = driver.identify().to_dict()
                    finally:
                        driver.close()
                except InstrumentError as error:
                    entry["trouble"] = str(error)
                found.append(entry)
        finally:
            bench.close()
        return {"found": found}

    def begin(self, asked: Asked) -> JsonDict:
        """Start a run and return the identifier of its session."""
        bench_file = self.bench_file_of(asked)
        procedure = on_bench(load_procedure(asked.procedure), bench_file)
        folder = self._shelf.fresh("run")
        start = start_document(procedure, bench_file)
        return self._start(procedure, bench_file, folder, lambda: SessionWriter.create(folder, start), asked.ask, None)

    def resume(self, identifier: str, asked: Asked) -> JsonDict:
        """Resume the run of an interrupted session."""
        folder = self._shelf.desk(identifier).path
        session = load(folder)
        bench_file = self._bench_of(session, self.bench_file_of(asked), asked.seed)
        procedure, done = resumable(session, bench_file)
        return self._start(procedure, bench_file, folder, lambda: reopen(folder), asked.ask, done)

    def investigate(self, identifier: str, body: Mapping[str, Any]) -> JsonDict:
        """Investigate a session on the bench; with `one`, make only the next measurement."""
        folder = self._shelf.desk(identifier).path
        session, plan = load(folder), plan_of(body)
        refuse_sealed(session)
        bench_file = BenchFile(backend="sim") if body.get("bench") == SIMULATED else self._real()
        procedure, bench_file = prepared(session, self._bench_of(session, bench_file))
        return self._place(folder, lambda name: InvestigationRun(name, procedure, bench_file, plan, folder, self._events))

    def benches(self, session: Session) -> list[str]:
        """The benches on which a session can be investigated."""
        own = [SIMULATED] if session.start.get("backend") == "sim" else []
        return [*own, *([REAL] if self._bench_file is not None else [])]

    def trace(self, seq: int) -> JsonDict:
        """The curve measured by one document of the run."""
        if self.run is None:
            raise BadInput("there is no run")
        document = self.run.document(seq)
        kind, file = document["kind"], document.get("file")
        text = decode(read_bytes(inside(self.run.folder, file)), str(file))
        if kind == "spectrum":
            spectrum = parse_spectrum_csv(text, str(file))
            return {"kind": kind, "frequency_hz": rounded(spectrum.frequency_hz), "level_dbuv": rounded(spectrum.level_dbuv)}
        if kind not in ("sweep", "standard"):
            raise BadInput(f"document {seq} is no measurement")
        sweep = parse_impedance_csv(text, str(file), str(document.get("termination", "open")))
        curve = {"frequency_hz": rounded(sweep.frequency_hz), "real": rounded(sweep.impedance_ohm.real), "imag": rounded(sweep.impedance_ohm.imag)}
        return {"kind": kind, **curve}

    def answer(self, answer: object = "done", value: object = None) -> None:
        """Pass on the operator's answer to the prompt: done, not done or stop; or the value that was asked for."""
        if value is not None:
            if not isinstance(value, str) or len(value) > LONGEST_NAME:
                raise BadInput(f"the value must be text of at most {LONGEST_NAME} characters")
            if self.run is not None:
                self.run.give(value)
            return
        known = next((one for one in ANSWERS if one == answer), None)
        if known is None:
            raise BadInput(f"the answer must be one of {', '.join(ANSWERS)}")
        if self.run is not None:
            self.run.answer(known)

    def stop(self) -> None:
        """Stop the run at its next exchange."""
        if self.run is not None:
            self.run.stop()

    def leave(self) -> None:
        """Stop the run and wait until its instruments are in their safe state, at shutdown."""
        if self.run is not None and self.run.active:
            self.run.stop()
            self.run.wait()

    def _start(self, procedure: Procedure, bench_file: BenchFile, folder: Path, begin: Any, ask: bool, done: Any) -> JsonDict:
        refuse_unless_calibrated(procedure, bench_file)
        ask = ask or bench_file.backend != "sim"
        return self._place(folder, lambda name: ProcedureRun(name, procedure, bench_file, begin, folder, self._events, ask, done))

    def _place(self, folder: Path, make: Callable[[str], Run]) -> JsonDict:
        """Start the only run."""
        with self._turn:
            self._refuse_while_running()
            identifier = self._shelf.place(folder)
            self.run = make(identifier)
            self._events.publish("state", self.state())
            self.run.start()
        return {"session": identifier}

    def _refuse_while_running(self) -> None:
        if self.run is not None and self.run.active:
            raise BadInput("a run is going on: wait for its end or stop it first")

    def _bench_of(self, session: Session, bench_file: BenchFile, seed: int = 1) -> BenchFile:
        """The bench on which a session was begun. A simulated one's effect may have been drawn; the session only holds its hash."""
        if bench_file.backend != "sim":
            return bench_file
        seed = session.start.get("simulated_seed", seed)
        benches = [bench_file.model_copy(update={"seed": seed, "effects": effects}) for effects in ((), *((name,) for name in DEMO_EFFECTS))]
        return next((bench for bench in benches if was_begun_on(session, bench)), bench_file)

    def _real(self) -> BenchFile:
        if self._bench_file is None:
            raise BadInput("no bench file was named at the start: motoremi workbench --bench bench.toml")
        return self._bench_file

    def bench_file_of(self, asked: Asked) -> BenchFile:
        """The bench file of a run: the real one with what was typed, or one of a simulated motor.

        Raises
        ------
        BadInput
            If there is no such bench, or no such effect to hide.
        """
        if asked.bench == REAL:
            real = self._real()
            return real.model_copy(update={"operator": asked.operator or real.operator, **_motor_of(asked, real)})
        if asked.bench != SIMULATED:
            raise BadInput("choose the simulated or the real bench")
        hidden = {"nothing": (), "something": (secrets.choice(DEMO_EFFECTS),)}.get(asked.hides)
        if hidden is None:
            if asked.hides not in DEMO_EFFECTS:
                raise BadInput(f"the simulated motor can hide one of {', '.join(DEMO_EFFECTS)}")
            hidden = (asked.hides,)
        return BenchFile(backend="sim", motor=asked.motor, serial=asked.serial, operator=asked.operator, seed=asked.seed, effects=hidden)


def _motor_of(asked: Asked, bench_file: BenchFile) -> dict[str, str]:
    """Motor and serial number of a run: as typed, else those of the bench file, whose serial number belongs to its own motor only."""
    is_another = bool(asked.motor) and asked.motor != bench_file.motor
    return {"motor": asked.motor or bench_file.motor, "serial": asked.serial or ("" if is_another else bench_file.serial)}


def _procedure(name: str) -> JsonDict:
    procedure = load_procedure(name)
    steps = [{"do": planned.step.do, "parameters": planned.step.parameters()} for planned in procedure.plan]
    instruments = {str(role): spec.driver for role, spec in procedure.instruments.items()}
    return {"name": name, "title": procedure.title, "steps": steps, "instruments": instruments}
