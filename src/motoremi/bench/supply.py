"""Base class of the drivers of programmable supplies; the output is switched off at the end of every run, also of one that failed."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Any, ClassVar

from motoremi.arrays import JsonDict
from motoremi.bench.driver import Identity
from motoremi.bench.meter import Meter
from motoremi.bench.transport import Transport
from motoremi.errors import BadInput, InstrumentError
from motoremi.quantities import show

# A supply rounds its settings to its own resolution, a millivolt or a milliampere at most.
RESOLUTION = 2e-3
# The two low bits of the output's condition register: constant current, constant voltage.
CONSTANT_CURRENT, CONSTANT_VOLTAGE = 1, 2


class Supply(Meter):
    """A supply with one or more outputs, one of which feeds the motor; the others are not changed.

    Commands are SCPI. Families differ in how a command names its output and how an output is switched; both are class attributes.

    Attributes
    ----------
    select : str
        Command that selects the output before each other command; empty where each command names it in a channel list.
    on_commands, off_commands : tuple of str
        Commands that switch the output.
    on_query : str
        Query whether it is on.
    ratings : mapping of str to tuple of (float, float)
        Model to voltage in volt and current in ampere of each output.
    """

    quantities = frozenset({"voltage_volt", "current_ampere"})
    error_query = "SYST:ERR?"
    select: ClassVar[str] = ""
    on_commands: ClassVar[tuple[str, ...]]
    off_commands: ClassVar[tuple[str, ...]]
    on_query: ClassVar[str]
    ratings: ClassVar[Mapping[str, tuple[tuple[float, float], ...]]]

    def __init__(self, transport: Transport) -> None:
        super().__init__(transport)
        self.channel = 1
        self._identity: Identity | None = None

    def use(self, options: Mapping[str, Mapping[str, Any]]) -> None:
        """Take the number of the output that feeds the motor."""
        first = options.get("supply") or next(iter(options.values()), {})
        self.channel = int(first.get("channel") or 1)

    def identify(self) -> Identity:
        """Read the identity, and refuse an output that this model does not have."""
        self._identity = super().identify()
        self.rating()
        return self._identity

    def rating(self) -> tuple[float, float]:
        """Highest voltage and current of the output."""
        outputs = self.ratings[self._identity.model.upper()] if self._identity else next(iter(self.ratings.values()))
        if not 1 <= self.channel <= len(outputs):
            raise BadInput(f"{self}: has outputs 1 to {len(outputs)}, but output {self.channel} was asked for")
        return outputs[self.channel - 1]

    def refuse_beyond_rating(self, voltage_volt: float, limit_ampere: float) -> None:
        """Raise `BadInput` for what this output cannot deliver."""
        most_volt, most_ampere = self.rating()
        if voltage_volt > most_volt or limit_ampere > most_ampere:
            asked, can = (f"{show(volt, 'V')} at {show(ampere, 'A')}" for volt, ampere in ((voltage_volt, limit_ampere), self.rating()))
            raise BadInput(f"{self}: output {self.channel} delivers up to {can}, but {asked} was asked for")

    def reset(self) -> None:
        """Switch the output off; nothing else is reset, because other outputs may feed something else."""
        self.transport.write("*CLS")
        self._command(*self.off_commands)
        self.sent_settings.clear()

    def settings(self) -> JsonDict:
        """Output, voltage, current limit and whether it is on, as the supply reports them."""
        return {
            "channel": self.channel,
            "voltage_volt": self._number("VOLT?"),
            "limit_ampere": self._number("CURR?"),
            "output": self.is_on(),
        }

    def set_limits(self, voltage_volt: float, limit_ampere: float) -> None:
        """Set voltage and current limit, and read them back.

        Raises
        ------
        BadInput
            If the output cannot deliver them.
        InstrumentError
            If the supply reports something else afterwards.
        """
        self.refuse_beyond_rating(voltage_volt, limit_ampere)
        # The limit first: the new voltage must never be applied with a higher current limit than requested.
        self._command(f"CURR {limit_ampere:.6g}", f"VOLT {voltage_volt:.6g}")
        self.sent_settings |= {"voltage_volt": voltage_volt, "limit_ampere": limit_ampere}
        self.refuse_changed()

    def switch_on(self) -> None:
        """Switch the output on."""
        self._command(*self.on_commands)
        self.sent_settings["output"] = True

    def switch_off(self) -> None:
        """Switch the output off, and read back that it is."""
        for command in self._addressed(self.off_commands):
            # All commands are written before an answer is waited for, because a supply that no longer answers may still receive.
            self.transport.write(command)
        self.check_errors(self.off_commands[0])
        self.sent_settings["output"] = False
        if self.is_on():
            raise InstrumentError(f"{self}: output {self.channel} is still ON after it was switched off")

    def is_on(self) -> bool:
        """Whether the output is on."""
        answer = self._ask(self.on_query)
        if answer not in ("0", "1", "OFF", "ON"):
            raise InstrumentError(f"{self}: {answer[:40]!r} in answer to {self.on_query!r} says neither on nor off")
        return answer in ("1", "ON")

    def regulation(self) -> str:
        """Why an output that is on does not hold its voltage; empty if it does (constant voltage).

        Raises
        ------
        InstrumentError
            If the supply reports a failure of its own.
        """
        condition = int(self._ask(f"STAT:QUES:INST:ISUM{self.channel}:COND?", addressed=False)) & (CONSTANT_CURRENT | CONSTANT_VOLTAGE)
        if condition == CONSTANT_CURRENT | CONSTANT_VOLTAGE:
            raise InstrumentError(f"{self}: output {self.channel} reports a failure of the supply; have it repaired")
        if condition == CONSTANT_VOLTAGE:
            return ""
        found = f"{self.read_quantity('voltage_volt'):.4g} V at {self.read_quantity('current_ampere'):.4g} A"
        what = "is in current limit (constant current)" if condition == CONSTANT_CURRENT else "regulates neither voltage nor current"
        return f"the supply {what}: {found} instead of {show(float(self.sent_settings.get('voltage_volt', 0.0)), 'V')}"

    def refuse_changed(self) -> None:
        """Raise `InstrumentError` if the supply's settings are not those that were sent: it restarted, or somebody changed them by hand."""
        reported = self.settings()
        for name, value in self.sent_settings.items():
            same = reported[name] == value if isinstance(value, bool) else abs(float(reported[name]) - value) <= RESOLUTION
            if not same:
                raise InstrumentError(f"{self}: {name} was set to {value!r}, but the supply reports {reported[name]!r}; did it restart?")

    def read_quantity(self, quantity: str) -> float:
        """Measure voltage or current of the output."""
        return self._number({"voltage_volt": "MEAS:VOLT?", "current_ampere": "MEAS:CURR?"}[quantity])

    def safe(self) -> None:
        """Switch the output off; called at the end of every run, also of one that failed, and tried twice."""
        try:
            self._leave()
        except InstrumentError:
            try:
                self._leave()
            except InstrumentError as error:
                raise InstrumentError(f"{error}; the motor may still run, switch the supply off by hand") from error

    def _leave(self) -> None:
        with suppress(InstrumentError):
            self.transport.clear()
        self.transport.write("*CLS")
        if self.transport.service_requests:
            self.transport.write("*SRE 0")
        self.switch_off()

    def _command(self, *commands: str) -> None:
        self.tell(*self._addressed(commands))

    def _number(self, query: str) -> float:
        answer = self._ask(query)
        if not re.fullmatch(self.number_format, answer) or abs(float(answer)) > 1e6:
            raise InstrumentError(f"{self}: {answer[:40]!r} in answer to {query!r} is no voltage or current")
        return float(answer)

    def _ask(self, query: str, *, addressed: bool = True) -> str:
        *before, last = self._addressed([query]) if addressed else [query]
        self.tell(*before)
        return self.ask(last)

    def _addressed(self, commands: Iterable[str]) -> list[str]:
        """The commands for this output."""
        if self.select:
            # Before each command, because somebody may have selected another output on the front panel.
            return [self.select.format(channel=self.channel), *commands]
        return [f"{command}{' ' if command.endswith('?') else ','}(@{self.channel})" for command in commands]
