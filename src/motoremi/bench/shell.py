"""Drivers of hand-held instruments that have a text shell on a serial port instead of SCPI: NanoVNA, tinySA."""

from __future__ import annotations

import re
from typing import ClassVar

from motoremi.bench.driver import Driver, Identity
from motoremi.bench.transport import Transport
from motoremi.errors import InstrumentError

# The shell prints the prompt with a space behind it, which arrives in front of the next echo.
PROMPT = b"ch>"


class ShellDriver(Driver):
    """A shell that echoes each command, answers in lines, and prompts with `ch> `.

    Commands end with CR alone. There is no error queue: a command that is refused is answered with its usage, with `name?` or with
    a sentence, and what a setting became is read back.

    Attributes
    ----------
    vendor : str
        What stands for the maker's name; there are many.
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
        """Read who is there from `version` and the first line of `info`."""
        self.synchronise()
        firmware = self.ask("version").splitlines()[:1]
        title = self.ask("info").splitlines()[:1]
        model = title[0].removeprefix("Board:").strip() if title else ""
        if not firmware or not re.fullmatch(self.model, model):
            raise InstrumentError(
                f"{self.transport.resource_name}: expected a {self.model}, but {model!r} answers; check the resource or choose another driver"
            )
        # These shells tell no serial number.
        return Identity(self.vendor, model, "", firmware[0].strip())

    def synchronise(self) -> None:
        """Get a prompt from a shell that may be in the middle of anything."""
        self.transport.clear()
        self.transport.write("")
        self._until_prompt()

    def reset(self) -> None:
        """Get a prompt and stop the sweep that runs in the background; calibration and settings stay."""
        self.synchronise()
        self.tell("pause")

    def safe(self) -> None:
        """Get a prompt and let the instrument sweep for its own screen again."""
        self.synchronise()
        self.tell(*self.safe_commands)

    def tell(self, *commands: str) -> None:
        """Send commands; what a command prints matters only if it is a refusal."""
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
        if re.match(self.refusals, answer):
            raise InstrumentError(f"{self}: {command!r} was refused: {' '.join(answer.split())}")
        return answer.strip()

    def check_errors(self, command: str) -> None:
        """Nothing to do: refusals are seen in the answer."""

    def _until_prompt(self) -> bytes:
        message = self.transport.receive()
        while not message.endswith(PROMPT):
            message += self.transport.receive()
        return message.removesuffix(PROMPT)
