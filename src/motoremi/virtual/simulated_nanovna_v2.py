"""The simulated NanoVNA V2: registers, and a queue of raw waves that continuous sweeps fill."""

from __future__ import annotations

import struct
from collections.abc import Callable

import numpy as np

from motoremi.simulate.vna import RAW, SimulatedVna
from motoremi.virtual.simulated_device import SimulatedDevice
from motoremi.virtual.simulated_nanovna import behind_clips

# Name in the profile -> address and size.
REGISTERS = {
    "start": (0x00, 8),
    "step": (0x10, 8),
    "points": (0x20, 2),
    "values_per_frequency": (0x22, 2),
    "data_mode": (0x26, 1),
    "average": (0x40, 1),
    "power": (0x42, 1),
    "serial_1": (0xD0, 4),
    "serial_2": (0xD4, 4),
    "serial_3": (0xD8, 4),
    "variant": (0xF0, 1),
    "protocol": (0xF1, 1),
    "board": (0xF2, 1),
    "firmware_major": (0xF3, 1),
    "firmware_minor": (0xF4, 1),
}
NOTHING, INDICATE, READ_FIFO, WRITE_FIFO, QUEUE = 0x00, 0x0D, 0x18, 0x28, 0x30
READ = {0x10: 1, 0x11: 2, 0x12: 4, 0x13: 8}
WRITE = {0x20: 1, 0x21: 2, 0x22: 4, 0x23: 8}
# Amplitude of the forward wave; the firmware sends the other waves relative to it.
FULL_SCALE = 1 << 30
SECONDS_PER_POINT = 0.0125
# Bandwidth with which the noise of a single value is 3e-4 of S11, an estimate.
NOISE_BANDWIDTH_HZ = 9e3
# The firmware measures its internal reference in the first two sweeps after a change. The error of S11 until then is an estimate.
EARLY_SWEEPS, EARLY_ERROR = 2, 0.02


class SimulatedNanoVnaV2(SimulatedDevice):
    """A NanoVNA V2 whose port 1 is connected to a test stand by clips; nothing is connected to port 2."""

    profile = "nanovna_v2.yaml"

    def power_on(self) -> None:
        """Registers as in the profile, nothing measured."""
        super().power_on()
        self._vna = SimulatedVna(self.wiring.seed, RAW)
        self._command = bytearray()
        self.registers = bytearray(256)
        for name, (address, size) in REGISTERS.items():
            self.registers[address : address + size] = int(self.value(name)).to_bytes(size, "little")
        # Number of values measured since the sweep was changed.
        self._measured = 0
        self._busy_until_s = 0.0

    def commands(self) -> dict[str, Callable[[str], bytes | None]]:
        """None: the protocol is binary."""
        return {}

    def busy_until(self) -> float:
        """When the requested values are measured."""
        return self._busy_until_s

    def status_byte(self) -> int:
        """A serial line has none."""
        return 0

    def write(self, data: bytes) -> None:
        """Receive bytes one by one; the first byte of a command gives its length."""
        for byte in data:
            self._command.append(byte)
            if len(self._command) < self._length():
                continue
            command = bytes(self._command)
            self._command.clear()
            if command[0] != NOTHING:
                answer = self.respond(command)
                if answer is not None:
                    self.answers.append(bytearray(answer))

    def _length(self) -> int:
        first = self._command[0]
        if first in (NOTHING, INDICATE):
            return 1
        if first in READ:
            return 2
        if first == WRITE_FIFO and len(self._command) > 2:
            return 3 + self._command[2]
        # The firmware treats an unknown command as one of three bytes.
        return 2 + WRITE.get(first, 1)

    def answer(self, message: bytes) -> bytes | None:
        """Carry out one command."""
        first, address = message[0], message[1] if len(message) > 1 else 0
        if first == INDICATE:
            return b"2"
        if first in READ:
            return bytes(self.registers[address : address + READ[first]])
        if first in WRITE:
            for offset, byte in enumerate(message[2:]):
                self.registers[(address + offset) % len(self.registers)] = byte
            self._written(address)
        if first == READ_FIFO and address == QUEUE:
            return self.fifo_values(message[2] or self.register("points"))
        return None

    def register(self, name: str) -> int:
        """What a register holds."""
        address, size = REGISTERS[name]
        return int.from_bytes(self.registers[address : address + size], "little")

    def _written(self, address: int) -> None:
        if address in (REGISTERS["start"][0], REGISTERS["step"][0], REGISTERS["points"][0], REGISTERS["values_per_frequency"][0]):
            self._measured = 0
        elif address == QUEUE:
            # The sweep continues while the queue is emptied.
            self._measured += 7

    def fifo_values(self, count: int) -> bytes:
        """So many values of the sweep, 32 bytes each."""
        self._busy_until_s = self.clock.now() + count * SECONDS_PER_POINT
        self.clock.sleep(count * SECONDS_PER_POINT)
        points, each = max(1, self.register("points")), max(1, self.register("values_per_frequency"))
        sweep, index = np.divmod((self._measured + np.arange(count)) // each, points)
        self._measured += count
        frequency_hz = np.maximum(1.0, self.register("start") + float(self.register("step")) * index)
        raw = self._vna.reflection(frequency_hz, behind_clips(self.wiring, frequency_hz), NOISE_BANDWIDTH_HZ)
        raw += np.where(sweep < EARLY_SWEEPS, EARLY_ERROR, 0.0)
        return b"".join(_record(gamma, int(point)) for gamma, point in zip(raw, index, strict=True))


def _record(gamma: complex, point: int) -> bytes:
    """Forward wave, S11 and S21 relative to it, number of the point, and the firmware's checksum."""
    limit = 2**31 - 1
    parts = [min(max(int(part * FULL_SCALE), -limit), limit) for part in (gamma.real, gamma.imag)]
    record = struct.pack("<6iH5x", FULL_SCALE, 0, *parts, 0, 0, point)
    checksum = 0x46
    for byte in record:
        checksum = (checksum ^ (checksum << 1 | 1) ^ byte) & 0xFF
    return record + bytes([checksum])
