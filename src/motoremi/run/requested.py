"""Single measurements on request, as an investigation needs them; instruments stay connected and compensated between two requests."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from motoremi.arrays import JsonDict
from motoremi.bench.connect import Bench, driver_class
from motoremi.data.conditions import Condition, SingleValue, parse_condition, parse_value
from motoremi.data.session import Session
from motoremi.data.sweep import TERMINATIONS, Termination
from motoremi.errors import BadInput, InstrumentError
from motoremi.quantities import parse
from motoremi.run.answer import Prompt
from motoremi.run.execution import Execution
from motoremi.run.resume import Done
from motoremi.run.writer import Writer
from motoremi.schema.procedure import Planned, Procedure, load_procedure, parse_procedure
from motoremi.schema.procedure_steps import Compensate, Identify, PlainStep, Sweep
from motoremi.schema.procedure_tables import DRIVER_SETTINGS

WIDE, COMPENSATION = "wide-sweep", "repeat-compensation"
# Procedure for a session of imported files; the sweeps of the session give first and last frequency.
_USUAL = "impedance_only"


@dataclass(frozen=True)
class MeasurementRequest:
    """One requested measurement.

    Parameters
    ----------
    id : str
        Its identifier, such as `second-temperature`.
    instruction : str
        What the operator has to do, in plain words.
    condition : Condition, optional
        What is set up for the sweeps; None for further sweeps of the motor as it is.
    terminations : tuple of str
        Which sweeps; empty for a single value.
    repeats : int
        Sweeps of each.
    turn : int
        How often the same measurement was requested before.
    hands : bool
        Whether the operator has to do something first; not so where a laboratory's bench sets the condition up by itself.
    """

    id: str
    instruction: str
    condition: Condition | None = None
    terminations: tuple[Termination, ...] = TERMINATIONS
    repeats: int = 1
    turn: int = 0
    hands: bool = True

    @property
    def is_value(self) -> bool:
        """Whether it is a number from another meter."""
        return not self.terminations

    def to_dict(self) -> JsonDict:
        """Plain data, for the session."""
        return {
            "id": self.id,
            "instruction": self.instruction,
            "condition": None if self.condition is None else self.condition.text,
            "terminations": list(self.terminations),
            "repeats": self.repeats,
            "turn": self.turn,
            **({} if self.hands else {"hands": False}),
        }

    @classmethod
    def restored(cls, written: JsonDict) -> MeasurementRequest:
        """From what `to_dict` wrote.

        Raises
        ------
        BadInput
            If it is not such a dictionary.
        """
        try:
            text = written["condition"]
            terminations = tuple(TERMINATIONS[TERMINATIONS.index(name)] for name in written["terminations"])
            condition = None if text is None else parse_condition(text)
            repeats, turn, hands = int(written["repeats"]), int(written["turn"]), bool(written.get("hands", True))
            return cls(str(written["id"]), str(written["instruction"]), condition, terminations, repeats, turn, hands)
        except (KeyError, TypeError, ValueError) as error:
            raise BadInput(f"a recorded question cannot be read ({type(error).__name__}: {error})") from error


def procedure_for(session: Session) -> Procedure:
    """Procedure for further sweeps of a session: its instruments, sweep and compensation, without its steps of analysis.

    For a session of imported files: `impedance_only` over the span of its sweeps.
    """
    name = session.path.name
    source: JsonDict = dict(session.start["procedure"] if "procedure" in session.start else load_procedure(_USUAL).source)
    own = parse_procedure(source, name)
    if "analyser" not in own.instruments or own.sweep is None:
        raise BadInput(f"{name}: its procedure measures no impedance; an investigation needs an analyser and [sweep]")
    table = dict(source["sweep"])
    if "procedure" not in session.start and session.sweeps:
        first = session.sweeps[0]
        table |= {"start": f"{first.span_hz[0]!r} Hz", "stop": f"{first.span_hz[1]!r} Hz", "points": min(len(first), 1601)}
    steps: list[JsonDict] = [{"do": "identify"}]
    steps += [dict(step) for step in source["steps"] if step["do"] == "compensate"]
    steps += [{"do": "sweep", "termination": "open"}]
    made = {"title": f"Investigation of {name}", "instruments": {"analyser": source["instruments"]["analyser"]}, "sweep": table, "steps": steps}
    return parse_procedure(made, name)


class RequestedMeasurements:
    """A bench that carries out requested measurements.

    Parameters
    ----------
    procedure : Procedure
        From `procedure_for`, on this bench.
    bench : Bench
        The caller closes it.
    writer : Writer
        An open session; the caller closes it.
    prompt : callable
        Tells the operator what to do and returns the answer.
    set_up : callable
        Called with the request before its sweeps and with None after them; a simulated bench then does what the operator is asked to do, and
        undoes it.
    tick : callable, optional
        Called at every exchange, to show progress.
    connections : int
        Highest number of a connection in the session.
    """

    def __init__(
        self,
        procedure: Procedure,
        bench: Bench,
        writer: Writer,
        prompt: Prompt,
        set_up: Callable[[MeasurementRequest | None], None] = lambda request: None,
        tick: Callable[[], None] = lambda: None,
        connections: int = 0,
    ) -> None:
        self._base = procedure
        self._bench = bench
        self._writer = writer
        self._prompt = prompt
        self._set_up = set_up
        self._tick = tick
        self._connections = connections
        self._execution: Execution | None = None

    def measure(self, request: MeasurementRequest) -> None:
        """Have the operator set it up, and sweep; every sweep is stored at once.

        Raises
        ------
        NotDone
            If the operator answers "not done"; nothing was measured.
        """
        wanted = self._procedure(request)
        execution = self._execution
        fresh = execution is None or execution.procedure.sweep != wanted.sweep
        if fresh or execution is None:
            execution = Execution(wanted, self._bench, self._writer, _no_analysis, self._prompt, self._tick, Done(connections=self._connections))
        if request.hands:
            execution.ask(request.instruction)
        compensation: list[PlainStep] = [step for step in wanted.steps if isinstance(step, Compensate)]
        if fresh:
            self.leave_safe()
            self._execution = execution
            self._do(execution, [Identify(do="identify"), *compensation])
        elif request.id == COMPENSATION:
            self._do(execution, compensation)
        condition = None if request.condition is None else request.condition.text
        self._set_up(request)
        try:
            self._do(execution, [Sweep(do="sweep", termination=name, repeat=request.repeats, condition=condition) for name in request.terminations])
        finally:
            self._set_up(None)

    def leave_safe(self) -> None:
        """Bring the instruments into their safe state and close their links.

        Raises
        ------
        InstrumentError
            If an instrument could not be brought into its safe state.
        """
        execution, self._execution = self._execution, None
        unsafe = {} if execution is None else execution.leave_safe()
        if unsafe:
            raise InstrumentError("; ".join(f"{role} could not be brought into its safe state ({problem})" for role, problem in unsafe.items()))

    def _procedure(self, request: MeasurementRequest) -> Procedure:
        """The procedure of the session, or with the widest sweep; `repeat-compensation` adds open and short where it had no compensation."""
        source = self._base.source
        steps = list(source["steps"])
        if request.id == COMPENSATION and not any(step["do"] == "compensate" for step in steps):
            steps[1:1] = [{"do": "compensate", "standard": standard} for standard in ("open", "short")]
        table = self._widest() if request.id == WIDE else source["sweep"]
        return parse_procedure({**source, "steps": steps, "sweep": table}, request.id)

    def _widest(self) -> JsonDict:
        """The sweep of the procedure `wide_sweep`, within the range of this analyser."""
        table: JsonDict = dict(load_procedure("wide_sweep").source["sweep"])
        settings = driver_class(self._base.instruments["analyser"].driver).table()
        for key, farthest in (("start", max), ("stop", min)):
            setting = settings.get(DRIVER_SETTINGS["sweep"][key])
            if setting is not None and setting.span is not None:
                table[key] = f"{farthest(parse(table[key], 'Hz'), setting.span[0 if key == 'start' else 1])!r} Hz"
        return table

    @staticmethod
    def _do(execution: Execution, steps: list[PlainStep]) -> None:
        for step in steps:
            execution.where = f"a requested measurement ({step.do})"
            execution.measure(Planned(1, step))


def read_value(request: MeasurementRequest, text: str) -> SingleValue:
    """The requested value as the operator types it, with or without its name.

    Raises
    ------
    BadInput
        If it cannot be read, or is another one.
    """
    return requested_value(request, parse_value(text if "=" in text else f"{request.id}={text}"))


def requested_value(request: MeasurementRequest, value: SingleValue) -> SingleValue:
    """The value, if it is the one that was requested.

    Raises
    ------
    BadInput
        If it is another one.
    """
    if value.name != request.id:
        raise BadInput(f"{value.name} was not asked for: give {request.id}, or n if it cannot be had")
    return value


def _no_analysis(kind: str, store: Any, parameters: JsonDict) -> None:
    """A requested measurement has no steps of analysis."""
