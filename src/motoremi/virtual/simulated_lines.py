"""A simulated tachometer or thermometer that sends lines of text, by itself or when it is asked."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from motoremi.schema.text_lines import Lines
from motoremi.virtual.simulated_device import MESSAGE_S, SimulatedDevice

# Lines that it sends unless a procedure gives other examples.
PLAIN = (
    Lines(example="n=3000.0 T=23.0", pattern=r"n=([\d.]+) T=[\d.]+", unit="rpm"),
    Lines(example="n=3000.0 T=23.0", pattern=r"n=[\d.]+ T=([\d.]+)", unit="degC"),
)
EVERY_S = 0.25


class SimulatedLineReader(SimulatedDevice):
    """It sends the motor's state in lines like the examples of the procedure."""

    profile = "line_reader.yaml"
    # Set by `use`; power-on does not change them.
    _lines: tuple[Lines, ...] = PLAIN
    _talks = False
    _sent = 0

    def use(self, options: Mapping[str, Mapping[str, Any]]) -> None:
        """Send lines like these examples."""
        self._lines = tuple(Lines.model_validate(entry["lines"]) for entry in options.values() if entry.get("lines")) or PLAIN
        self._talks = not self._lines[0].ask

    def commands(self) -> dict[str, Callable[[str], bytes | None]]:
        """None: any line is a request for a reading."""
        return {}

    def busy_until(self) -> float:
        """It is never busy."""
        return self.clock.now()

    def take_answers(self) -> bytes:
        """All that waits to be read; an instrument that sends by itself always has a next line."""
        waiting = super().take_answers()
        if self._talks and not waiting:
            self.clock.sleep(EVERY_S)
            waiting = self._line() + self.line_end()
        return waiting

    def line_end(self) -> bytes:
        """What ends a line."""
        return b"\r" if self._lines[0].line_end == "CR" else b"\r\n"

    def answer(self, message: bytes) -> bytes | None:
        """One line, whatever was asked."""
        self.clock.sleep(MESSAGE_S)
        return self._line()

    def _line(self) -> bytes:
        examples = list(dict.fromkeys(lines.example for lines in self._lines))
        line = example = examples[self._sent % len(examples)]
        self._sent += 1
        for lines in self._lines:
            if lines.example == example:
                line = lines.written(line, getattr(self.wiring.stand, lines.quantity))
        return line.encode("ascii", "replace")
