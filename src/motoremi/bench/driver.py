"""Base class of all drivers: settings declared as a table, identity, and an error queue that is read after every command."""

from __future__ import annotations

import abc
import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from typing import Any, ClassVar, Generic, Self, TypeVar, overload

from motoremi.arrays import JsonDict
from motoremi.bench.transport import Transport
from motoremi.errors import BadInput, InstrumentError
from motoremi.quantities import show

T = TypeVar("T")


class RefusedCommand(InstrumentError):
    """The instrument reported an error after a command."""


@dataclass(frozen=True)
class Identity:
    """The fields of the answer to `*IDN?`."""

    vendor: str
    model: str
    serial: str
    firmware: str

    def to_dict(self) -> dict[str, str]:
        """Plain data."""
        return asdict(self)


class Setting(Generic[T]):
    """One setting of an instrument: `COMMAND value UNIT` sets it, `COMMAND?` reads it.

    Parameters
    ----------
    command : str
        Mnemonic, SCPI header, or command of a shell.
    doc : str
        One sentence that starts with "Control".
    unit : str
        SI unit, empty for a plain number or word; sent in capitals after the value unless the driver's `units_on_wire` is False.
    span : (float, float), optional
        Smallest and largest value, in `unit`.
    words : mapping of str to str, optional
        Allowed values, and the instrument's word for each.
    read, write : callable
        Between the instrument's text and a Python value.
    query : str, optional
        Query that reads it, if that is not the command with a question mark.
    """

    def __init__(
        self,
        command: str,
        doc: str,
        read: Callable[[str], T],
        write: Callable[[T], str],
        unit: str = "",
        span: tuple[float, float] | None = None,
        words: dict[str, str] | None = None,
        query: str = "",
    ) -> None:
        self.command = command
        self.query = query or f"{command}?"
        self.unit = unit
        self.span = span
        self.words = words or {}
        self.__doc__ = doc
        self._read = read
        self._write = write

    def __set_name__(self, owner: type[Driver], name: str) -> None:
        self.name = name

    @overload
    def __get__(self, instance: None, owner: type[Driver]) -> Self: ...
    @overload
    def __get__(self, instance: Driver, owner: type[Driver]) -> T: ...
    def __get__(self, instance: Driver | None, owner: type[Driver]) -> Self | T:
        if instance is None:
            return self
        answer = instance.ask(self.query)
        try:
            return self._read(answer)
        except (ValueError, KeyError, IndexError) as error:
            raise InstrumentError(f"{instance}: cannot read {answer!r} as {self.name} in answer to {self.query!r}") from error

    def __set__(self, instance: Driver, value: T) -> None:
        unit = self.unit.upper() if instance.units_on_wire else ""
        instance.tell(f"{self.command} {self._write(self.checked(instance, value))} {unit}".rstrip())
        instance.sent_settings[self.name] = value

    def checked(self, instance: Driver, value: T) -> T:
        """The value; `BadInput` if the instrument cannot take it."""
        if self.words and value not in self.words:
            raise BadInput(f"{instance}: {self.name} = {value!r} is unknown; use one of {', '.join(self.words)}")
        if self.span is not None and isinstance(value, int | float) and not self.span[0] <= value <= self.span[1]:
            low, high = (show(limit, self.unit) for limit in self.span)
            raise BadInput(f"{instance}: {self.name} = {show(value, self.unit)} is outside the range {low} to {high}")
        return value


def number(command: str, unit: str, span: tuple[float, float], doc: str) -> Setting[float]:
    """A setting with a unit."""
    return Setting(command, doc, float, lambda value: f"{value:.12g}", unit=unit, span=span)


def count(command: str, span: tuple[int, int], doc: str) -> Setting[int]:
    """A whole-number setting."""
    # Both "201" and "+2.01E+02" are legal answers.
    return Setting(command, doc, lambda text: int(float(text)), str, span=span)


def choice(command: str, words: dict[str, str], doc: str) -> Setting[str]:
    """A setting with a fixed set of words; `words` maps each to the instrument's word."""
    back = {theirs: ours for ours, theirs in words.items()}
    return Setting(command, doc, lambda text: back[text.upper()], lambda ours: words[ours], words=words)


def switch(command: str, doc: str) -> Setting[bool]:
    """A setting that is on or off."""
    back = {"1": True, "+1": True, "ON": True, "0": False, "+0": False, "OFF": False}
    return Setting(command, doc, lambda text: back[text.upper()], lambda value: "ON" if value else "OFF")


class Driver(abc.ABC):
    """An instrument behind a transport.

    Attributes
    ----------
    model : str
        Regular expression that the second field of `*IDN?` must match.
    error_query : str
        Query that reads and removes the oldest entry of the error queue; empty for an instrument without one.
    units_on_wire : bool
        Whether a number is sent with its unit.
    safe_commands : tuple of str
        Commands that stop the measurement and remove the stimulus.
    """

    model: ClassVar[str]
    error_query: ClassVar[str]
    safe_commands: ClassVar[tuple[str, ...]]
    units_on_wire: ClassVar[bool] = True
    # Error queues hold ten to thirty entries. A queue that never empties is a fault of the instrument, so stop reading after this many.
    _QUEUE_LIMIT: ClassVar[int] = 50
    # Bit of the IEEE 488.2 standard event register, and the commands that make the instrument request service when it is set.
    OPERATION_COMPLETE: ClassVar[int] = 1
    REQUEST_AT_COMPLETION: ClassVar[tuple[str, ...]] = ("*ESE 1", "*SRE 32")
    # A receiver's preset takes many seconds, during which it does not answer.
    RESET_S: ClassVar[float] = 60.0

    def __init__(self, transport: Transport) -> None:
        self.transport = transport
        self.poll_s = 0.1
        # Settings as they were sent since the last reset, for comparison with what the instrument reports.
        self.sent_settings: JsonDict = {}

    def __str__(self) -> str:
        return f"{type(self).__name__} at {self.transport.resource_name}"

    def use(self, options: Mapping[str, Mapping[str, Any]]) -> None:  # noqa: B027
        """Take the options that the procedure or the bench file gives for each role of this instrument."""

    def identify(self) -> Identity:
        """Read the identity.

        Raises
        ------
        InstrumentError
            If it is not an instrument that this driver is for.
        """
        answer = self.transport.query("*IDN?")
        fields = [field.strip() for field in answer.split(",")]
        if len(fields) < 4 or not re.fullmatch(self.model, fields[1]):
            raise InstrumentError(
                f"{self.transport.resource_name}: expected a {self.model}, but {answer!r} answers; check the resource or choose another driver"
            )
        return Identity(fields[0], fields[1], fields[2], fields[3])

    def reset(self) -> None:
        """Bring the instrument into a known, idle state."""
        self.transport.write("*CLS")
        with self.transport.deadline(self.RESET_S):
            self.tell("*RST")
        self.sent_settings.clear()

    def safe(self) -> None:
        """Stop measuring and remove the stimulus; called at the end of every run, also of one that failed."""
        # A run may end between a query and its answer. If the link cannot be cleared, the commands below are still sent.
        with suppress(InstrumentError):
            self.transport.clear()
        self.transport.write("*CLS")
        if self.transport.service_requests:
            # A sweep started later from the front panel must not request service from other programs on the bus.
            self.transport.write("*SRE 0")
        refused = []
        for command in self.safe_commands:
            # Each is sent, whatever became of the one before it.
            try:
                self.tell(command)
            except RefusedCommand as error:
                refused.append(error)
        if refused:
            raise refused[0]

    def settings(self) -> JsonDict:
        """Every setting of the table, as the instrument itself reports it, in SI units."""
        return {name: getattr(self, name) for name in self.table()}

    @classmethod
    def table(cls) -> dict[str, Setting[Any]]:
        """The settings of this driver, by name."""
        rows: dict[str, Setting[Any]] = {}
        for owner in reversed(cls.__mro__):
            rows |= {name: value for name, value in vars(owner).items() if isinstance(value, Setting)}
        return rows

    def tell(self, *commands: str) -> None:
        """Send commands, and read the error queue after each."""
        for command in commands:
            self.transport.write(command)
            self.check_errors(command)

    def ask(self, command: str) -> str:
        """Send a query, and read the error queue after its answer."""
        answer = self.transport.query(command)
        self.check_errors(command)
        return answer

    def check_errors(self, command: str) -> None:
        """Empty the error queue.

        Raises
        ------
        RefusedCommand
            With number and text of each error, and the command that it followed.
        InstrumentError
            If the answer is not an entry of an error queue.
        """
        errors = []
        for _ in range(self._QUEUE_LIMIT):
            entry = self.transport.query(self.error_query)
            code, _, text = entry.partition(",")
            try:
                number_ = int(code)
            except ValueError as error:
                raise InstrumentError(f"{self}: {entry!r} is no entry of an error queue ({self.error_query})") from error
            if number_ == 0:
                break
            errors.append(f"{number_} {text.strip()}")
        else:
            raise RefusedCommand(
                f"{self}: error {'; '.join(dict.fromkeys(errors))} after {command!r}, and its error queue does not empty: switch it off and on"
            )
        if errors:
            raise RefusedCommand(f"{self}: error {'; '.join(errors)} after {command!r}")

    def request_service(self) -> None:
        """Make the instrument request service at completion, if the link carries service requests; after `*CLS` and before the command."""
        if self.transport.service_requests:
            self.tell(*self.REQUEST_AT_COMPLETION)

    def is_operation_complete(self) -> bool:
        """Whether everything before `*OPC` is complete; reading clears the register."""
        return bool(int(float(self.transport.query("*ESR?"))) & self.OPERATION_COMPLETE)

    def wait_until(self, is_complete: Callable[[], bool], command: str, longest_s: float) -> None:
        """Wait until what a command started is complete: by a service request where the link carries them, else by polling every `poll_s`.

        Only the instrument's register proves completion, because a request may be left over from an earlier command, or get lost. The
        register is read after each request and at the deadline; a link that lost a request is polled from then on.

        Raises
        ------
        InstrumentError
            If it is not complete after `longest_s`, or ended with an error.
        """
        link = self.transport
        deadline = link.clock.now() + longest_s
        was_requested = self._pause(longest_s) if link.service_requests else True
        while not is_complete():
            if link.clock.now() > deadline:
                raise InstrumentError(f"{self}: {command!r} is not complete after {longest_s:.0f} s; check trigger source and front panel")
            was_requested = self._pause(deadline - link.clock.now())
        if not was_requested:
            link.write("*SRE 0")
            link.service_requests = False
        self.check_errors(command)

    def _pause(self, longest_s: float) -> bool:
        """Wait for a service request, or one polling interval; False if a request was expected and did not come."""
        if self.transport.service_requests:
            return self.transport.await_request(longest_s)
        # What takes hours is polled once a second: more often would fill the recorded traffic with polls.
        self.transport.clock.sleep(max(self.poll_s, min(1.0, longest_s / 1000)))
        return True

    def close(self) -> None:
        """Close the link."""
        self.transport.close()
