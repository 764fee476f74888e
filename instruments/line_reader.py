"""Tachometers, thermocouple readers and other instruments that send lines of text over a serial line."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from motoremi.bench.driver import Identity
from motoremi.bench.meter import Meter
from motoremi.bench.replay_difference import RecordedEnd, ReplayDifference
from motoremi.bench.transport import Transport
from motoremi.errors import BadInput, InstrumentError
from motoremi.schema.text_lines import LONGEST_LINE, Lines

CHARACTERS = {"LF": "\n", "CR": "\r"}


class LineReader(Meter):
    """An instrument that sends lines by itself or on request; `lines` in the procedure or bench file describe how they are read.

    It has no identity, no error queue and nothing to switch off. Readable lines are the only evidence that the right instrument is connected.
    """

    model = "line reader"
    error_query = ""
    safe_commands = ()
    quantities = frozenset({"voltage_volt", "current_ampere", "speed_rpm", "temperature_degc"})

    # Number of lines that are tried for a reading: the first may be incomplete, and others may be disturbed.
    TRIES: ClassVar[int] = 8
    # Most instruments of this kind send a line or more a second.
    LONGEST_WAIT_S: ClassVar[float] = 3.0

    def __init__(self, transport: Transport) -> None:
        super().__init__(transport)
        self._lines: dict[str, Lines] = {}

    def use(self, options: Mapping[str, Mapping[str, Any]]) -> None:
        """Take the descriptions of lines; several roles may read different numbers of the same lines."""
        for role, entry in options.items():
            if not entry.get("lines"):
                raise BadInput(f"{role}: a line reader needs 'lines' in the bench file: example, field or pattern, unit")
            lines = Lines.model_validate(entry["lines"])
            self._lines[lines.quantity] = lines
        if not self._lines:
            raise BadInput(f"{self.transport.resource_name}: a line reader needs 'lines' in the bench file: example, field or pattern, unit")
        first = next(iter(self._lines.values()))
        end = CHARACTERS[first.line_end]
        self.transport.end_messages_with(end.encode(), end)
        self.transport.talk_at(first.baud, first.data_bits, first.parity)

    def identify(self) -> Identity:
        """Check that readable lines arrive; there is nothing else to read."""
        for quantity in self._lines:
            self.read_quantity(quantity)
        return Identity("", self.model, "", "")

    def reset(self) -> None:
        """Nothing to reset."""

    def safe(self) -> None:
        """Nothing to switch off."""

    def check_errors(self, command: str) -> None:
        """There is no error queue."""

    def read_quantity(self, quantity: str) -> float:
        """Take the next whole line that can be read.

        Raises
        ------
        InstrumentError
            If no line comes, or none of `TRIES` lines can be read.
        """
        lines = self._lines[quantity]
        last = ""
        with self.transport.deadline(self.LONGEST_WAIT_S):
            # Lines that have arrived since the last reading are old.
            self.transport.clear()
            for number in range(self.TRIES):
                last = self._next(lines)
                value = lines.value(last)
                # The first line of an instrument that sends by itself may be incomplete, so it is not used even if it can be read.
                if value is not None and (lines.ask or number):
                    return value
        raise InstrumentError(
            f"{self.transport.resource_name}: none of {self.TRIES} lines can be read, the last was {last[:LONGEST_LINE]!r}, expected such as "
            f"{lines.example!r}; check baud rate ({lines.baud}) and 'lines' in the bench file"
        )

    def _next(self, lines: Lines) -> str:
        if lines.ask:
            self.transport.write(lines.ask)
        try:
            return self.transport.read()
        except (RecordedEnd, ReplayDifference):
            raise
        except InstrumentError as error:
            raise InstrumentError(
                f"{self.transport.resource_name}: no line came within {self.LONGEST_WAIT_S:g} s; check plug, power and baud rate ({lines.baud})"
            ) from error
