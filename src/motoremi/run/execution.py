"""Carries out the steps of a procedure one by one and writes everything into the session."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from typing import Any

from motoremi.arrays import JsonDict
from motoremi.bench.connect import Bench
from motoremi.bench.driver import Driver, Identity
from motoremi.bench.impedance_analyser import ImpedanceAnalyser
from motoremi.bench.motor_connections import AT_THE_LISN, IN_THE_MOTORS_PLACE, INSTRUCTIONS, STANDARDS, ConnectionName, Instruction
from motoremi.bench.receiver import EmiReceiver
from motoremi.bench.replay_difference import RecordedEnd
from motoremi.data.conditions import parse_condition
from motoremi.data.spectrum import Detector, Spectrum
from motoremi.data.sweep import ImpedanceSweep, Termination
from motoremi.errors import BadInput, InstrumentError, MotoremiError
from motoremi.interrupts import unbroken
from motoremi.quantities import show_band
from motoremi.run.answer import NotDone, Prompt
from motoremi.run.emission_steps import EmissionSteps
from motoremi.run.motor_state import MotorState, refuse_missing
from motoremi.run.on_bench import shared_roles
from motoremi.run.resume import Done
from motoremi.run.standards import judge_standard, wrong_standard
from motoremi.run.writer import Writer
from motoremi.schema.procedure import Planned, Procedure
from motoremi.schema.procedure_steps import AnalysisStep, Check, Compensate, Connect, Final, Identify, Scan, Sweep, Wait
from motoremi.schema.procedure_tables import DRIVER_SETTINGS, SpectrumSpec
from motoremi.schema.state_steps import SupplyStep, WaitFor

# Step kind, session, parameters of the step -> result, None if there is nothing to judge.
Analyse = Callable[[str, Any, JsonDict], JsonDict | None]
# Largest relative difference between a setting and what the instrument reports; instruments round to a much finer resolution.
ROUNDING = 1e-3
# A wait is divided into slices to show progress: seconds of a slice, and the largest number of slices.
SLICE_S, MOST_SLICES = 1.0, 200
# Settings that steps change.
_CHANGING = {"detector"}


class Execution:
    """The state of one run: connected instruments, connections, verdicts.

    Parameters
    ----------
    procedure, bench, writer
        As in `motoremi.run.runner.run`.
    analyse : callable
        Does the steps of analysis, which need no instrument.
    prompt : callable
        Tells the operator what to do and returns the answer.
    tick : callable
        Called at every exchange with an instrument, to show progress.
    done : Done
        What an earlier run of this session has finished.
    """

    def __init__(
        self,
        procedure: Procedure,
        bench: Bench,
        writer: Writer,
        analyse: Analyse,
        prompt: Prompt,
        tick: Callable[[], None],
        done: Done,
    ) -> None:
        self.procedure = procedure
        self.bench = bench
        self.writer = writer
        self.analyse = analyse
        self.prompt = prompt
        self.tick = tick
        self.done = done
        self.drivers: dict[str, Driver] = {}
        self.verdicts: list[JsonDict] = list(done.verdicts)
        self.where = "the start"
        self._of = len(procedure.plan)
        self._settings: dict[str, JsonDict] = {}
        # What is connected, the number of the connection, and whether a step "connect" made it.
        self._connected: tuple[ConnectionName | None, int, bool] = (None, 0, False)
        self._scan_set_up: SpectrumSpec | None = None
        self._emission = EmissionSteps(self, self._scanned)
        self._leaving = False
        self.state = MotorState(writer.emit, self._wait, self.ask)

    def step(self, planned: Planned) -> None:
        """Do one step, and write a document at its start and end."""
        step = planned.step
        parameters = step.parameters()
        self.where = str(planned)
        again: JsonDict = {"again": True} if planned.number <= self.done.steps else {}
        self.writer.emit("step-start", step=planned.number, of=self._of, do=step.do, parameters=parameters, **again)
        if isinstance(step, AnalysisStep):
            result = self.analyse(step.do, self.writer, parameters)
            if result is not None:
                self._add_verdict(planned, result)
        else:
            self.measure(planned)
        self.writer.emit("step-stop", step=planned.number, of=self._of, do=step.do)

    def measure(self, planned: Planned) -> None:
        """Do a step that needs the bench, without the documents of its start and end."""
        with _unreadable_answer_as_instrument_error():
            self._measure(planned)

    def _measure(self, planned: Planned) -> None:
        step = planned.step
        stored = self.done.stored if planned.number == self.done.steps + 1 else 0
        if isinstance(step, Identify):
            self._identify()
        elif isinstance(step, Connect):
            self.connect(step.what, explicit=True, note=step.note)
        elif isinstance(step, Wait):
            self._wait(step.time)
        elif isinstance(step, SupplyStep):
            self.state.set_supply(step)
        elif isinstance(step, WaitFor):
            self.state.wait_for(step)
        elif isinstance(step, Compensate):
            self.connect(STANDARDS[step.standard])
            self._compensate(step)
        elif isinstance(step, Sweep):
            self._sweep(step, stored)
        elif isinstance(step, Check):
            self._check(planned, step)
        elif isinstance(step, Scan):
            self._emission.scan(step, stored)
        elif isinstance(step, Final):
            self._emission.final(planned, step, stored)

    def _sweep(self, step: Sweep, stored: int) -> None:
        under = None if step.condition is None else parse_condition(step.condition)
        standard = None if under is None else IN_THE_MOTORS_PLACE.get(under.id)
        connection = self.connect(standard or step.termination)
        for _ in range(stored, step.repeat):
            # Each sweep is stored at once, so a failure loses only the sweep that was being measured.
            swept = self.state.around(lambda: self._swept(step.termination, of_a_standard=standard is not None))
            self.writer.add_sweep(swept.with_metadata(connection=connection).under(under))
            self.state.refuse_trouble()

    def _compensate(self, step: Compensate) -> None:
        analyser = self._analyser()
        if step.nominal is not None:
            analyser.define_load(step.nominal, step.inductance)
        kept, wrong = self._standard_measured(analyser, step)
        if wrong:
            if not self.ask(f"{wrong}. Connect the {step.standard} standard. It is then measured again."):
                raise NotDone(f"{wrong}; this compensation was not used: connect the {step.standard} standard and continue with --resume")
            kept, wrong = self._standard_measured(analyser, step)
        if kept is not None:
            self.writer.add_compensation(step.standard, kept)
        if wrong:
            self.writer.emit("doubt", about="standard", says=wrong)

    def _standard_measured(self, analyser: ImpedanceAnalyser, step: Compensate) -> tuple[ImpedanceSweep | None, str]:
        """What the analyser measured with a standard, and why it cannot be that standard."""
        analyser.compensate(step.standard)
        with _bad_data_as_instrument_error(analyser):
            kept = analyser.read_compensation(step.standard)
        return kept, "" if kept is None else wrong_standard(step.standard, kept, step.nominal)

    def _check(self, planned: Planned, step: Check) -> None:
        connection = self.connect(STANDARDS[step.standard])
        # The analyser measures a standard like the motor, with the termination "short" or "open". It is stored apart from the motor's sweeps.
        sweep = self._swept("short" if step.standard == "short" else "open", of_a_standard=True)
        self.writer.add_standard(step.standard, sweep.with_metadata(connection=connection))
        self._add_verdict(planned, judge_standard(step, sweep))

    def _swept(self, termination: Termination, *, of_a_standard: bool = False) -> ImpedanceSweep:
        analyser = self._analyser()
        with _bad_data_as_instrument_error(analyser):
            sweep = analyser.sweep(termination, of_a_standard=of_a_standard)
        self._refuse_changed("analyser", sweep.metadata.get("settings"))
        if (asked := self.procedure.sweep) is not None:
            _refuse_other_span(analyser, sweep.span_hz, (asked.start, asked.stop), 0.0)
        return sweep

    def _scanned(self, spec: SpectrumSpec, detector: Detector) -> Spectrum:
        receiver = self.receiver()
        if spec != self._scan_set_up:
            self._settings["receiver"] = self._configure_receiver(receiver, spec)
        with _bad_data_as_instrument_error(receiver):
            spectrum = receiver.scan(detector)
        self._refuse_changed("receiver", spectrum.metadata.get("settings"))
        # The settings in the metadata were read before the scan, because the frequencies follow from them; these show a change during the scan.
        self._refuse_changed("receiver", receiver.settings())
        span = float(spectrum.frequency_hz[0]), float(spectrum.frequency_hz[-1])
        _refuse_other_span(receiver, span, (spec.start, spec.stop), spec.step)
        return spectrum

    def _add_verdict(self, planned: Planned, result: JsonDict) -> None:
        self.verdicts.append(result)
        self.writer.emit("verdict", step=planned.number, do=planned.step.do, result=result)

    def ask(self, text: str) -> bool:
        """Show the operator an instruction and record the answer; the run continues only after "done". False if there is no operator."""
        asked = datetime.now(UTC).isoformat()
        answer = self.prompt(text)
        if answer is None:
            return False
        # Without the drawing, which repeats the text.
        self.writer.emit("prompt", text=text.partition("\n")[0], asked=asked, answer=answer)
        if answer == "stop":
            raise KeyboardInterrupt
        if answer == "not done":
            raise NotDone(
                f"the operator answered 'not done' to: {text.partition(chr(10))[0]}; nothing was measured for this step, continue with --resume"
            )
        return True

    def _wait(self, seconds: float) -> None:
        clock = self.bench.clock
        until = clock.now() + seconds
        while (left := until - clock.now()) > 0:
            clock.sleep(min(left, max(SLICE_S, seconds / MOST_SLICES)))
            self.tick()

    def leave_safe(self) -> dict[str, str]:
        """Bring every connected instrument into its safe state and close its link; returns what went wrong, by role.

        Ctrl-C takes effect afterwards. Each exchange has a deadline, so this always ends.
        """
        with unbroken():
            return self._leave_safe()

    def _leave_safe(self) -> dict[str, str]:
        self._leaving = True
        # The supply first, so that trouble with another instrument cannot keep the motor running.
        problems = dict.fromkeys(sorted(self.drivers, key="supply".__ne__), "")
        ended: RecordedEnd | None = None
        for role, driver in ((role, self.drivers[role]) for role in problems):
            try:
                # Marks the end of the procedure's exchanges, for a replay.
                self._log({"time": datetime.now(UTC).isoformat(), "instrument": role, "direction": "leave"})
                driver.safe()
            except (InstrumentError, ValueError) as error:
                problems[role] = str(error)
                ended = error if isinstance(error, RecordedEnd) else ended
            finally:
                driver.close()
        # Written after all instruments are safe, because writing may fail.
        for role, problem in problems.items():
            self.writer.emit("safe", role=role, safe=not problem, problem=problem)
        if ended is not None:
            # A replay of a run that was killed here; a replay has no instruments to leave unsafe.
            raise ended
        return {role: problem for role, problem in problems.items() if problem}

    def _log(self, record: Mapping[str, Any]) -> None:
        try:
            self.writer.log_traffic(record)
        except MotoremiError:
            # A full disk ends the run, but must not prevent the safe state.
            if not self._leaving:
                raise
        if not self._leaving:
            self.tick()

    def _identify(self) -> None:
        refuse_missing(self.procedure)
        for role, *others in shared_roles(self.procedure):
            spec = self.procedure.instruments[role]
            options: dict[str, JsonDict] = {name: entry for name in (role, *others) if (entry := self.procedure.instruments[name].options)}
            driver = self.bench.open(role, spec.driver, spec.resource, self._log, options)
            try:
                identity = driver.identify()
                self._refuse_other(role, identity)
            except BaseException:
                # Another instrument may be connected, which the safe commands could harm.
                driver.close()
                raise
            self.drivers[role] = driver
            driver.transport.while_waiting = self.tick
            driver.reset()
            self._settings[role] = self._configure(driver)
            for name in (role, *others):
                self.state.adopt(name, driver, identity, self.procedure)
            self.writer.emit(
                "instrument",
                role=role,
                driver=spec.driver,
                resource=driver.transport.resource_name,
                identity=identity.to_dict(),
                settings=self._settings[role],
                **({"also": others} if others else {}),
            )

    def _refuse_other(self, role: str, identity: Identity) -> None:
        before = self.done.identities.get(role)
        if before is not None and before != identity.to_dict():
            raise InstrumentError(
                f"{role}: {identity.model} serial {identity.serial} answers, but the session was begun with "
                f"{before.get('model')} serial {before.get('serial')}; connect that one, or begin a new session"
            )

    def _configure(self, driver: Driver) -> JsonDict:
        sweep, spectrum = self.procedure.sweep, self.procedure.spectrum
        if isinstance(driver, ImpedanceAnalyser) and sweep is not None:
            spacing = "linear" if sweep.spacing == "list" else sweep.spacing
            settings = driver.configure(sweep.start, sweep.stop, sweep.points, spacing, sweep.bandwidth, sweep.oscillator)
            settings = driver.prepare(sweep.options()) or settings
            _refuse_other_than_asked(driver, settings, sweep.model_dump(), "sweep")
            return settings
        if isinstance(driver, EmiReceiver) and spectrum is not None:
            return self._configure_receiver(driver, spectrum)
        return driver.settings()

    def _configure_receiver(self, driver: EmiReceiver, spec: SpectrumSpec) -> JsonDict:
        self._scan_set_up = spec
        settings = driver.configure(spec.start, spec.stop, spec.step, spec.bandwidth, spec.dwell, spec.attenuation)
        _refuse_other_than_asked(driver, settings, spec.model_dump(), "spectrum")
        return settings

    def _refuse_changed(self, role: str, settings: object) -> None:
        """Refuse data whose settings have changed during the run, because the instrument restarted or was operated by hand."""
        if not isinstance(settings, Mapping):
            return
        before = self._settings[role]
        changed = [
            f"{name} is {settings[name]!r}, was {value!r}"
            for name, value in before.items()
            if name in settings and name not in _CHANGING and settings[name] != value
        ]
        if changed:
            raise InstrumentError(f"{self.drivers[role]}: its settings changed during the run ({'; '.join(changed)}); did it restart?")

    def connect(self, what: ConnectionName, *, explicit: bool = False, note: str = "") -> int:
        """Ask the operator to connect something, unless it is connected already; returns the number of the connection."""
        before, number, made_by_step = self._connected
        # A second scan uses the same connection. A second step "sweep" is a new connection, unless a step "connect" made the present one.
        if what == before and not explicit and (made_by_step or what in AT_THE_LISN.values()):
            return number
        instruction = INSTRUCTIONS[what]
        text = f"{self.state.warning}{instruction.text}"
        self.ask(str(Instruction(f"{text}. {note}" if note else text, instruction.drawing)))
        number = self.done.connections + self.bench.connect(what)
        self._connected = (what, number, explicit)
        self.writer.emit("connection", what=what, number=number)
        return number

    def _analyser(self) -> ImpedanceAnalyser:
        driver = self.drivers["analyser"]
        if not isinstance(driver, ImpedanceAnalyser):
            raise BadInput(f"instruments.analyser: the driver {type(driver).__name__} is no impedance analyser")
        return driver

    def receiver(self) -> EmiReceiver:
        """The connected receiver."""
        driver = self.drivers["receiver"]
        if not isinstance(driver, EmiReceiver):
            raise BadInput(f"instruments.receiver: the driver {type(driver).__name__} is no EMI receiver")
        return driver


@contextmanager
def _unreadable_answer_as_instrument_error() -> Iterator[None]:
    """Turn exceptions from an answer that the driver does not expect into `InstrumentError`."""
    try:
        yield
    except MotoremiError:
        raise
    except (ValueError, OverflowError, IndexError, KeyError, TypeError) as error:
        raise InstrumentError(f"an answer of the instrument cannot be read ({type(error).__name__}: {error})") from error


@contextmanager
def _bad_data_as_instrument_error(driver: Driver) -> Iterator[None]:
    """Turn `BadInput` from data that cannot be a sweep into `InstrumentError`: they come from the instrument, not from the user."""
    try:
        yield
    except BadInput as error:
        raise InstrumentError(f"{driver}: {error}") from error


def _refuse_other_span(driver: Driver, span_hz: tuple[float, float], asked_hz: tuple[float, float], step_hz: float) -> None:
    """Refuse data over another span than requested; a scan may end up to one step before its stop."""
    if any(abs(came - asked) > step_hz + ROUNDING * asked for came, asked in zip(span_hz, asked_hz, strict=True)):
        raise InstrumentError(f"{driver}: measured {show_band(*span_hz)}, but {show_band(*asked_hz)} was asked for")


def _refuse_other_than_asked(driver: Driver, settings: JsonDict, asked: JsonDict, table: str) -> None:
    """Refuse settings that differ from those that were sent."""
    wanted = {name: asked[key] for key, name in DRIVER_SETTINGS[table].items()}
    # A driver sets more than the procedure has: which quantity the traces show, the unit of the levels.
    for name, value in (driver.sent_settings | wanted).items():
        if name in settings and not _is_about(settings[name], value):
            raise InstrumentError(f"{driver}: {name} was set to {value!r}, but the instrument reports {settings[name]!r}")


def _is_about(reported: object, sent: object) -> bool:
    if isinstance(sent, int | float) and isinstance(reported, int | float):
        return abs(reported - sent) <= ROUNDING * abs(sent)
    return reported == sent
