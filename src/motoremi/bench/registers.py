"""Drivers of hand-held instruments that have numbered registers behind a serial port instead of SCPI: NanoVNA V2, LiteVNA."""

from __future__ import annotations

import re

from motoremi.bench.driver import Driver, Identity, Setting
from motoremi.bench.transport import Transport
from motoremi.errors import InstrumentError

# First byte of a command, by the number of bytes that are read or written.
READ = {1: 0x10, 2: 0x11, 4: 0x12}
WRITE = {1: 0x20, 2: 0x21, 4: 0x22, 8: 0x23}
READ_FIFO = 0x18
# The zeros complete a command that was sent only in part; then the protocol's fixed answer is requested.
INDICATE, READY = bytes(8) + b"\x0d", b"2"
# An instrument that was interrupted may still be sending data: attempts to reach it, and the pause between them in seconds.
MOST_ATTEMPTS, REST_S = 5, 0.5
VARIANT, SERIAL, IN_FIRMWARE_UPDATE = 0xF0, 0xD0, 0xFF
# Contents of the first two registers from VARIANT on: device variant and version of the protocol. No other values are known.
THIS_PROTOCOL = (2, 1)


class RegisterDriver(Driver):
    """Registers of 1, 2, 4 or 8 bytes and a queue of measured values; source: `command_parser.hpp` and `main2.cpp` of the NanoVNA V2's firmware.

    Commands are written here as text that messages can show: `write8 0x00 150000`, `read2 0x20`, `fifo 0x30 101`. There is no error
    queue, and no command is refused; registers are read back.
    """

    error_query = ""
    units_on_wire = False

    def __init__(self, transport: Transport) -> None:
        super().__init__(transport)
        transport.end_messages_with(b"", "")

    def identify(self) -> Identity:
        """Read the identity from the registers 0xf0 to 0xf4 and 0xd0 to 0xdb.

        A LiteVNA is recognised by the major version 2 of its firmware (as NanoVNA-Saver does; unconfirmed by its maker).
        """
        self.synchronise()
        variant, protocol, board, major, minor = (int(self.ask(f"read1 0x{VARIANT + offset:02x}")) for offset in range(5))
        name = self.transport.resource_name
        if major == IN_FIRMWARE_UPDATE:
            raise InstrumentError(f"{name}: waits for a firmware update; switch it off and on")
        model = f"{'LiteVNA' if major == 2 else 'NanoVNA V2'}, board {board}"
        if (variant, protocol) != THIS_PROTOCOL or not re.fullmatch(self.model, model):
            raise InstrumentError(
                f"{name}: expected a {self.model}, but variant {variant} with protocol {protocol} answers; "
                "check the resource or choose another driver"
            )
        words = [int(self.ask(f"read4 0x{SERIAL + offset:02x}")) for offset in (0, 4, 8)]
        return Identity("NanoVNA", model, "".join(f"{word:08x}" for word in words) if any(words) else "", f"{major}.{minor}")

    def synchronise(self) -> None:
        """Get an answer from an instrument in an unknown state.

        Raises
        ------
        InstrumentError
            If the instrument does not answer in this protocol.
        """
        for _ in range(MOST_ATTEMPTS):
            self.transport.clear()
            self.transport.write_bytes(INDICATE, "indicate")
            if self.transport.receive_bytes(1) == READY:
                self.transport.clear()
                return
            self.transport.clock.sleep(REST_S)
        raise InstrumentError(f"{self.transport.resource_name}: does not answer 'indicate' with {READY.decode()!r}; choose another driver")

    def reset(self) -> None:
        """Get an answer; registers keep their values until a sweep is set up."""
        self.synchronise()
        self.sent_settings.clear()

    def safe(self) -> None:
        """Return the instrument to sweeping for its own screen."""
        self.synchronise()
        self.tell(*self.safe_commands)

    def tell(self, *commands: str) -> None:
        """Send commands that have no answer."""
        for command in commands:
            self.transport.write_bytes(encoded(command), command)

    def ask(self, command: str) -> str:
        """Read a register as a whole number."""
        return str(int.from_bytes(self.ask_bytes(command, int(command[len("read") : command.index(" ")])), "little"))

    def ask_bytes(self, command: str, count: int) -> bytes:
        """Send a command and read its answer of `count` bytes."""
        self.tell(command)
        answer = self.transport.receive_bytes(count)
        if len(answer) != count:
            raise InstrumentError(f"{self}: {len(answer)} bytes in answer to {command!r}, expected {count}")
        return answer

    def check_errors(self, command: str) -> None:
        """Nothing to do: there is no error queue."""


def encoded(command: str) -> bytes:
    """The bytes of a command that is written as text."""
    verb, address, *value = command.split()
    place = int(address, 16)
    if verb == "fifo":
        return bytes([READ_FIFO, place, int(value[0])])
    size = int(verb[-1])
    if verb.startswith("read"):
        return bytes([READ[size], place])
    return bytes([WRITE[size], place]) + int(value[0]).to_bytes(size, "little")


def register(address: int, size: int, span: tuple[float, float], doc: str, unit: str = "") -> Setting[int]:
    """A setting in a register of `size` bytes; of eight bytes only the lower four can be read, which the spans here allow for."""
    return Setting(f"write{size} 0x{address:02x}", doc, int, str, unit=unit, span=span, query=f"read{min(size, 4)} 0x{address:02x}")
