"""A simulated instrument with a text shell on a serial port: echo, lines, prompt."""

from __future__ import annotations

from collections.abc import Callable

from motoremi.bench.clock import Clock
from motoremi.virtual.simulated_device import MESSAGE_S, SimulatedDevice, Wiring

PROMPT = b"ch> "
NEWLINE = "\r\n"
_BACKSPACES = (0x08, 0x7F)
_CR, _FIRST_PRINTABLE = 0x0D, 0x20
# Length of the firmware's command line; further characters are neither stored nor echoed.
LINE_LENGTH = 47


class SimulatedShell(SimulatedDevice):
    """An instrument that echoes every character, runs a line at each CR, and prompts.

    Subclasses list their commands in `shell_commands()`: name to a function of the arguments that returns the printed text.
    """

    def __init__(self, wiring: Wiring, clock: Clock) -> None:
        super().__init__(wiring, clock)
        self.by_name = self.shell_commands()

    def power_on(self) -> None:
        """An empty command line."""
        super().power_on()
        self._line = bytearray()
        self._busy_until_s = 0.0

    def shell_commands(self) -> dict[str, Callable[[list[str]], str | bytes]]:
        """The commands of the shell, by name."""
        raise NotImplementedError

    def commands(self) -> dict[str, Callable[[str], bytes | None]]:
        """None of IEEE 488.2."""
        return {}

    def busy_until(self) -> float:
        """When the running sweep ends."""
        return self._busy_until_s

    def write(self, data: bytes) -> None:
        """Receive characters one by one."""
        for byte in data:
            if byte == _CR:
                self._say(NEWLINE.encode())
                line, self._line = bytes(self._line), bytearray()
                answer = self.respond(line)
                if answer is not None:
                    self._say(answer + PROMPT)
            elif byte in _BACKSPACES:
                del self._line[-1:]
            elif byte >= _FIRST_PRINTABLE and len(self._line) < LINE_LENGTH:
                self._line.append(byte)
                self._say(bytes([byte]))

    def device_clear(self) -> None:
        """The port was closed and opened again."""
        super().device_clear()
        self._line = bytearray()

    def status_byte(self) -> int:
        """A serial line has none."""
        return 0

    def take_time(self, seconds: float) -> None:
        """Let that much time pass before the answer, because the shell measures in the foreground."""
        self._busy_until_s = self.clock.now() + seconds
        self.clock.sleep(seconds)

    def set_within(self, name: str, value: float) -> None:
        """Set a setting of the profile to the nearest value within its limits, as the firmware does."""
        low, high = self.limits(name)
        kept = min(max(value, low), high)
        self.set_value(name, int(kept) if self._data["properties"][name]["specs"]["type"] == "int" else kept)

    def answer(self, message: bytes) -> bytes | None:
        """Run one line and return what it prints."""
        self.clock.sleep(MESSAGE_S)
        name, *arguments = message.decode("latin-1").split() or [""]
        if not name:
            return b""
        if name not in self.by_name:
            return f"{name}?{NEWLINE}".encode()
        printed = self.by_name[name](arguments)
        return printed if isinstance(printed, bytes) else printed.encode()

    def _say(self, data: bytes) -> None:
        self.answers.append(bytearray(data))


def lines(*texts: str) -> str:
    """Lines as the shell prints them."""
    return "".join(text + NEWLINE for text in texts)


def whole(text: str) -> int:
    """A whole number as the firmware reads it: with prefix 0x, 0o or 0b; characters after the digits are ignored."""
    bases = {"0x": 16, "0o": 8, "0b": 2}
    base = bases.get(text[:2].lower(), 10)
    digits = text[2:] if base != 10 else text.removeprefix("+")
    value = 0
    for digit in digits:
        if not (digit.isascii() and digit.isalnum()) or int(digit, 36) >= base:
            break
        value = value * base + int(digit, 36)
    return value


def integer_axis(start_hz: int, stop_hz: int, points: int) -> list[int]:
    """Frequencies in whole hertz, the remainder of the step spread over the sweep."""
    intervals = max(1, points - 1)
    step, rest = divmod(stop_hz - start_hz, intervals)
    return [start_hz + step * index + (intervals // 2 + rest * index) // intervals for index in range(points)]
