"""Drivers of hand-held instruments that have a text shell on a serial port instead of SCPI: NanoVNA, tinySA."""

from __future__ import annotations

import re
from typing import ClassVar

import numpy as np

from motoremi.arrays import FloatArray
from motoremi.bench.driver import Driver, Identity, Setting
from motoremi.bench.transport import Transport
from motoremi.errors import InstrumentError

# The shell prints a space behind the prompt; it is read before the next echo.
PROMPT = b"ch>"


class ShellDriver(Driver):
    """A shell that echoes each command, answers in lines, and prompts with `ch> `.

    Commands end with CR alone. There is no error queue: a command that is refused is answered with its usage, with `name?` or with
    a sentence; settings are read back.

    Attributes
    ----------
    vendor : str
        The vendor in the identity; these instruments have many makers.
    refusals : str
        Regular expression that an answer matches when the command was refused.
    """

    vendor: ClassVar[str]
    error_query = ""
    units_on_wire = False
    refusals: ClassVar[str] = r"usage:|\S+\?\s*$|.*(range is invalid|exceeds range|count is invalid|Command timeout|disk mode active)"

    def __init__(self, transport: Transport) -> None:
        super().__init__(transport)
        transport.end_messages_with(b"\r", ">")

    def identify(self) -> Identity:
        """Read the identity from `version` and the first line of `info`."""
        self.synchronise()
        firmware = self.ask("version").splitlines()[:1]
        title = self.ask("info").splitlines()[:1]
        model = title[0].removeprefix("Board:").strip() if title else ""
        if not firmware or not re.fullmatch(self.model, model):
            raise InstrumentError(
                f"{self.transport.resource_name}: expected a {self.model}, but {model!r} answers; check the resource or choose another driver"
            )
        # These shells have no command for a serial number.
        return Identity(self.vendor, model, "", firmware[0].strip())

    def synchronise(self) -> None:
        """Get a prompt from a shell in an unknown state."""
        self.transport.clear()
        self.transport.write("")
        self._until_prompt()

    def reset(self) -> None:
        """Get a prompt and stop the background sweep; calibration and settings are kept."""
        self.synchronise()
        self.tell("pause")

    def safe(self) -> None:
        """Get a prompt and return the instrument to sweeping for its own screen."""
        self.synchronise()
        self.tell(*self.safe_commands)

    def tell(self, *commands: str) -> None:
        """Send commands; what they print is ignored unless it is a refusal."""
        for command in commands:
            self.ask(command)

    def ask(self, command: str) -> str:
        """Send a command and return the lines that it prints.

        Raises
        ------
        InstrumentError
            If the echo is not what was sent, or the command is refused.
        """
        self.transport.write(command)
        echo, _, answer = self._until_prompt().decode("latin-1").lstrip().partition("\n")
        if echo.strip() != command:
            raise InstrumentError(f"{self}: {command!r} was echoed as {echo.strip()!r}; the link loses characters")
        # A command without arguments is a query. Some answer it with their usage, and the present value in the next line.
        if re.match(self.refusals, answer) and not (answer.startswith("usage:") and " " not in command):
            raise InstrumentError(f"{self}: {command!r} was refused: {' '.join(answer.split())}")
        return answer.strip()

    def check_errors(self, command: str) -> None:
        """Nothing to do: refusals are seen in the answer."""

    def ask_rows(self, command: str, lines: int, columns: int) -> FloatArray:
        """Send a command and return the numbers that it prints.

        Returns
        -------
        ndarray, shape (lines, columns)

        Raises
        ------
        InstrumentError
            If anything else is printed.
        """
        answer = self.ask(command)
        try:
            rows = np.array([[float(value) for value in line.split()] for line in answer.splitlines()])
        except ValueError as error:
            raise InstrumentError(f"{self}: a line in answer to {command!r} is no list of {columns} numbers") from error
        if rows.shape != (lines, columns) or not np.all(np.isfinite(rows)):
            raise InstrumentError(f"{self}: {len(rows)} lines in answer to {command!r}, expected {lines} of {columns} numbers each")
        return rows

    def _until_prompt(self) -> bytes:
        message = self.transport.receive()
        while not message.endswith(PROMPT):
            message += self.transport.receive()
        return message.removesuffix(PROMPT)


def sweep_edges(low_hz: float, high_hz: float) -> tuple[Setting[float], Setting[float]]:
    """First and last frequency: whole hertz on the wire, and one line `start stop points` to read both from."""
    first, last = (
        Setting(
            f"sweep {word}",
            f"Control the {place} frequency of the sweep.",
            read=lambda text, index=index: float(text.split()[index]),  # type: ignore[misc]
            write=lambda value: str(round(value)),
            unit="Hz",
            span=(low_hz, high_hz),
            query="sweep",
        )
        for index, (word, place) in enumerate((("start", "first"), ("stop", "last")))
    )
    return first, last
