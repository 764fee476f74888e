"""The simulated NanoVNA: scans, S11 and S21, calibration state, on top of its profile."""

from __future__ import annotations

import struct
from collections.abc import Callable

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.simulate.vna import SimulatedVna
from motoremi.virtual.simulated_device import Wiring
from motoremi.virtual.simulated_shell import SimulatedShell, integer_axis, lines, whole

# Bits of the mask of `scan`.
FREQUENCY, S11, S21, BINARY = 1, 2, 4, 128
MOST_BANDWIDTH_HZ = 4000
# Time for one point: one bandwidth period of samples for each port, and settling.
PORTS, SETTLING_S = 2, 1e-3
# A short adapter with clips at the connector at which the instrument was calibrated.
CLIP_OHM, CLIP_HENRY, CLIP_FARAD = 0.02, 8e-9, 2e-12
_EDGES = ("start", "stop", "center", "span", "cw")


class SimulatedNanoVna(SimulatedShell):
    """A NanoVNA whose port 1 is connected to a test stand; nothing is connected to port 2."""

    profile = "nanovna.yaml"

    def power_on(self) -> None:
        """Calibrated, with one sweep measured."""
        super().power_on()
        self._vna = SimulatedVna(self.wiring.seed)
        self._calibrated = True
        self._axis = integer_axis(self.value("start"), self.value("stop"), self.value("points"))
        self._reflection = self._measure()

    def shell_commands(self) -> dict[str, Callable[[list[str]], str | bytes]]:
        """The commands of the shell."""
        quiet: Callable[[list[str]], str] = lambda _: ""  # noqa: E731
        known: dict[str, Callable[[list[str]], str | bytes]] = {
            "version": lambda _: lines(self.texts["version"]),
            "info": lambda _: lines(self.texts["board"], self.texts["build"], "Architecture: ARMv7E-M Core Variant: Cortex-M4F"),
            "sweep": self._sweep,
            "scan": self._scan,
            "scan_bin": lambda arguments: self._scan(arguments, BINARY),
            "data": self._print_data,
            "frequencies": lambda _: lines(*map(str, self._axis)),
            "bandwidth": self._bandwidth,
            "power": self._power,
            "cal": self._cal,
            "pause": quiet,
            "resume": self._resume,
            "save": quiet,
            "recall": quiet,
        }
        return {**known, "help": lambda _: lines(f"Commands: {' '.join(known)} help")}

    def _sweep(self, arguments: list[str]) -> str:
        if not arguments:
            return lines(f"{self.value('start')} {self.value('stop')} {self.value('points')}")
        usage = lines("usage: sweep {start(Hz)} [stop(Hz)] [points]", f"\tsweep {{{'|'.join(_EDGES)}}} {{freq(Hz)}}")
        if len(arguments) > 3:
            return usage
        if len(arguments) == 2 and whole(arguments[0]) == 0:
            return self._set_edge(*arguments) if arguments[0] in _EDGES else usage
        for edge, text in zip(("start", "stop"), arguments, strict=False):
            if whole(text):
                self._set_edge(edge, text)
        # The firmware ignores a number of points that it cannot measure.
        if len(arguments) == 3 and 2 <= whole(arguments[2]) <= self._most_points():
            self.assign("points", str(whole(arguments[2])))
        return ""

    def _set_edge(self, edge: str, text: str) -> str:
        lowest, highest = self.limits("start")
        hertz = min(max(whole(text), lowest), highest)
        start, stop = int(self.value("start")), int(self.value("stop"))
        half = hertz // 2 if edge == "span" else (stop - start) // 2
        middle = hertz if edge == "center" else (start + stop) // 2
        edges = {
            "start": (hertz, max(stop, hertz)),
            "stop": (min(start, hertz), hertz),
            "cw": (hertz, hertz),
        }.get(edge, (max(middle - half, lowest), middle + half))
        self.set_within("start", edges[0])
        self.set_within("stop", edges[1])
        return ""

    def _most_points(self) -> int:
        return self.limits("points")[1]

    def _scan(self, arguments: list[str], extra_mask: int = 0) -> str | bytes:
        if not 2 <= len(arguments) <= 4:
            return lines("usage: scan {start(Hz)} {stop(Hz)} [points] [outmask]")
        start, stop, points, mask = (*map(whole, arguments), *(0,) * (4 - len(arguments)))
        if start == 0 or stop == 0 or start > stop:
            return lines("frequency range is invalid")
        points = points if len(arguments) > 2 else int(self.value("points"))
        if not 0 < points <= self._most_points():
            return lines(f"sweep points exceeds range {self._most_points()}")
        mask |= extra_mask
        self._axis = integer_axis(start, stop, points)
        self.set_within("points", points)
        if mask == 0 or mask & (S11 | S21):
            self.take_time(points * (PORTS * (int(self.value("bandwidth")) + 2) / MOST_BANDWIDTH_HZ + SETTLING_S))
            self._reflection = self._measure()
        return self._packed(mask) if mask & BINARY else self._printed(mask)

    def _printed(self, mask: int) -> str:
        if not mask & (FREQUENCY | S11 | S21):
            return ""
        rows = []
        for hertz, gamma in zip(self._axis, self._reflection, strict=False):
            row = [str(hertz)] if mask & FREQUENCY else []
            row += [f"{gamma.real:.9f} {gamma.imag:.9f}"] if mask & S11 else []
            row += ["0.000000000 0.000000000"] if mask & S21 else []
            rows.append(" ".join(row) + " ")
        return lines(*rows)

    def _packed(self, mask: int) -> bytes:
        packed = struct.pack("<HH", mask, len(self._axis))
        for hertz, gamma in zip(self._axis, self._reflection, strict=False):
            packed += struct.pack("<I", hertz) if mask & FREQUENCY else b""
            packed += struct.pack("<ff", gamma.real, gamma.imag) if mask & S11 else b""
            packed += struct.pack("<ff", 0.0, 0.0) if mask & S21 else b""
        return packed

    def _measure(self) -> ComplexArray:
        """S11 with the clips, in the 32-bit numbers of the firmware."""
        frequency_hz = np.array(self._axis, dtype=np.float64)
        bandwidth_hz = MOST_BANDWIDTH_HZ / (int(self.value("bandwidth")) + 1)
        seen = behind_clips(self.wiring, frequency_hz)
        return self._vna.reflection(frequency_hz, seen, bandwidth_hz).astype(np.complex64).astype(np.complex128)

    def _print_data(self, arguments: list[str]) -> str:
        array = whole(arguments[0]) if arguments else 0
        if array > 6:
            return lines("usage: data [array]")
        values = self._reflection if array == 0 else np.zeros(len(self._axis), dtype=np.complex128)
        return lines(*(f"{value.real:.9f} {value.imag:.9f}" for value in values))

    def _resume(self, _: list[str]) -> str:
        self._axis = integer_axis(int(self.value("start")), int(self.value("stop")), int(self.value("points")))
        self._reflection = self._measure()
        return ""

    def _bandwidth(self, arguments: list[str]) -> str:
        if len(arguments) == 1:
            self.set_within("bandwidth", whole(arguments[0]))
        index = int(self.value("bandwidth"))
        return lines(f"bandwidth {index} ({MOST_BANDWIDTH_HZ // (index + 1)}Hz)")

    def _power(self, arguments: list[str]) -> str:
        if not arguments:
            return lines(f"power: {self.value('power')}")
        self.set_within("power", whole(arguments[0]))
        return ""

    def _cal(self, arguments: list[str]) -> str:
        """State of the calibration, and switching it on or off; the calibration itself is done on the screen."""
        if not arguments:
            return lines("load open short thru Es Er Et cal'ed" if self._calibrated else "")
        match arguments[0]:
            case "on":
                self._calibrated = True
            case "off" | "reset":
                self._calibrated = False
            case _:
                return lines("usage: cal [load|open|short|thru|isoln|done|on|off|reset]")
        return ""


def behind_clips(wiring: Wiring, frequency_hz: FloatArray) -> ComplexArray:
    """Impedance in ohm at the connector, with clips between it and what is connected."""
    s = 2j * np.pi * frequency_hz
    device = wiring.connected_ohm(frequency_hz)
    return CLIP_OHM + s * CLIP_HENRY + device / (1 + device * s * CLIP_FARAD)
