"""Dry run: a procedure on simulated instruments with a virtual clock, to see what would be sent and how long it takes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from motoremi.arrays import JsonDict
from motoremi.bench.connect import driver_class
from motoremi.data.spectrum import Spectrum
from motoremi.data.sweep import ImpedanceSweep
from motoremi.errors import BadInput, InstrumentError
from motoremi.run.calibration_check import refuse_unless_calibrated
from motoremi.run.on_bench import on_bench
from motoremi.run.runner import run
from motoremi.schema.bench_file import BenchFile
from motoremi.schema.procedure import Procedure
from motoremi.schema.procedure_steps import Repeat
from motoremi.schema.state_steps import WaitFor
from motoremi.virtual.simulated_bench import SimulatedBench


@dataclass(frozen=True)
class Rehearsed:
    """One step of a rehearsed procedure.

    Parameters
    ----------
    number : int
    do : str
    parameters : mapping
    seconds : float
        On the clock of the simulated instruments.
    prompts : tuple of str
        First line of each instruction to the operator.
    sent : tuple of (str, str, int)
        Role, message and how often in a row; without readings of the error queue.
    messages : int
        Number of messages sent, with readings of the error queue.
    """

    number: int
    do: str
    parameters: Mapping[str, Any]
    seconds: float
    prompts: tuple[str, ...]
    sent: tuple[tuple[str, str, int], ...]
    messages: int

    def to_dict(self) -> JsonDict:
        """Plain data."""
        return {
            "step": self.number,
            "do": self.do,
            "parameters": dict(self.parameters),
            "seconds": self.seconds,
            "prompts": list(self.prompts),
            "sent": [{"instrument": role, "message": message, "times": times} for role, message, times in self.sent],
            "messages": self.messages,
        }


def rehearse(procedure: Procedure, bench_file: BenchFile) -> tuple[Rehearsed, ...]:
    """Run a procedure on the simulated bench without storing anything; no real instrument is touched.

    Raises
    ------
    BadInput
        If a resource is not on the bench's allow-list, a calibration is not what the procedure asks for, or a driver has no simulated
        instrument.
    """
    procedure = _never_stopping(on_bench(procedure, bench_file))
    bench_file.refuse_unless_allowed(procedure)
    bench_file.refuse_uncovered(procedure)
    refuse_unless_calibrated(procedure, bench_file)
    bench = SimulatedBench(bench_file.seed)
    notes = _Notes(procedure, bench)
    try:
        run(procedure, bench, notes, analyse=lambda *_: None, prompt=notes.prompt)
    except InstrumentError as error:
        raise BadInput(f"the dry run needs a simulated instrument for every driver: {error}") from error
    finally:
        bench.close()
    return tuple(notes.steps)


def _never_stopping(procedure: Procedure) -> Procedure:
    """The same procedure without stops at a state that is not reached, because the simulated motor may never reach it."""

    def asking(step: Any) -> Any:
        if isinstance(step, Repeat):
            return step.model_copy(update={"steps": tuple(asking(inner) for inner in step.steps)})
        return step.model_copy(update={"otherwise": "ask"}) if isinstance(step, WaitFor) else step

    return procedure.model_copy(update={"steps": tuple(asking(step) for step in procedure.steps)})


class _Notes:
    """Collects what a run does, in place of a session."""

    path = Path("rehearsal")

    def __init__(self, procedure: Procedure, bench: SimulatedBench) -> None:
        self.steps: list[Rehearsed] = []
        self._clock = bench.clock
        self._queues: dict[str, str] = {role: driver_class(spec.driver).error_query for role, spec in procedure.instruments.items()}
        self._begin({})

    def _begin(self, parameters: Mapping[str, Any]) -> None:
        self._parameters = parameters
        self._from_s = self._clock.now()
        self._prompts: list[str] = []
        self._sent: list[tuple[str, str, int]] = []
        self._messages = 0

    def prompt(self, text: str) -> None:
        """Note the instruction for the operator."""
        self._prompts.append(text.partition("\n")[0])

    def emit(self, kind: str, **content: Any) -> JsonDict:
        """Note where a step begins and ends."""
        if kind == "step-start":
            self._begin(content["parameters"])
        elif kind == "step-stop":
            seconds = self._clock.now() - self._from_s
            step = Rehearsed(content["step"], content["do"], self._parameters, seconds, tuple(self._prompts), tuple(self._sent), self._messages)
            self.steps.append(step)
        return content

    def log_traffic(self, record: Mapping[str, Any]) -> None:
        """Note what is sent."""
        if record["direction"] != "write":
            return
        self._messages += 1
        role, message = str(record["instrument"]), str(record.get("text", "")).strip()
        if message == self._queues[role]:
            return
        if self._sent and self._sent[-1][:2] == (role, message):
            self._sent[-1] = (role, message, self._sent[-1][2] + 1)
        else:
            self._sent.append((role, message, 1))

    def add_sweep(self, sweep: ImpedanceSweep) -> Path:
        """Nothing is stored."""
        return self.path

    def add_spectrum(self, spectrum: Spectrum) -> Path:
        """Nothing is stored."""
        return self.path

    def add_final(self, spectrum: Spectrum) -> Path:
        """Nothing is stored."""
        return self.path

    def add_standard(self, standard: str, sweep: ImpedanceSweep) -> Path:
        """Nothing is stored."""
        return self.path

    def add_compensation(self, standard: str, sweep: ImpedanceSweep) -> Path:
        """Nothing is stored."""
        return self.path

    def end(self) -> None:
        """Nothing is stored."""

    def close(self, status: Literal["done", "failed", "interrupted"], reason: str = "") -> None:
        """Nothing is stored."""
