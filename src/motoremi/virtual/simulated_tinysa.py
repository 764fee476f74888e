"""The simulated tinySA: scans, filters and traces on top of its profile."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable

import numpy as np

from motoremi.arrays import FloatArray
from motoremi.virtual.simulated_band import about, as_wide_as
from motoremi.virtual.simulated_receiver import DBUV_OF_0_DBM, MOST_POINTS, read_off_the_band
from motoremi.virtual.simulated_shell import SimulatedShell, integer_axis, lines, whole

FREQUENCY, ACTUAL, STORED, TEMPORARY = 1, 2, 4, 8
# Filters of the receiver chip that the firmware offers, and levels in 10 kHz: the instrument's noise, and the limit of its mixer.
FILTERS_KHZ = (3.0, 10.0, 30.0, 100.0, 300.0, 600.0)
NOISE_DBM, MOST_DBM = -105.0, 10.0
# The chip reads levels in steps of half a dB.
STEP_DB = 0.5
SECONDS_PER_POINT = 2.5e-3
DUMMY = "0.000000000"
_AVERAGING = ("off", "minh", "maxh", "maxd", "aver4", "aver16", "aver", "quasi")


class SimulatedTinySa(SimulatedShell):
    """A tinySA whose low input is connected to a test stand."""

    profile = "tinysa.yaml"

    def power_on(self) -> None:
        """Sweeping in the background."""
        super().power_on()
        self._paused = False
        self._averaging = "off"
        self._axis = integer_axis(self.value("start"), self.value("stop"), self.value("points"))
        self._measured: FloatArray | None = None

    def shell_commands(self) -> dict[str, Callable[[list[str]], str | bytes]]:
        """The commands of the shell."""
        known: dict[str, Callable[[list[str]], str | bytes]] = {
            "version": lambda _: lines(self.texts["version"]),
            "info": lambda _: lines(self.texts["board"], "2019-2024 Copyright @Erik Kaashoek", "Licensed under GPL."),
            "sweep": self._sweep,
            "scan": self._scan,
            "scanraw": self._scan_raw,
            "data": self._print_data,
            "frequencies": lambda _: lines(*map(str, self._axis)),
            "rbw": self._bandwidth,
            "attenuate": self._attenuate,
            "sweeptime": self._sweep_time,
            "calc": self._calc,
            "zero": self._zero,
            "ext_gain": self._external_gain,
            "trace": self._trace,
            "pause": lambda _: self._pause(True),
            "resume": lambda _: self._pause(False),
            "status": lambda _: lines("Paused" if self._paused else "Resumed"),
            "trigger": lambda _: "",
            "spur": lambda _: "",
            "abort": lambda _: "",
        }
        return {**known, "help": lambda _: lines(f"commands: {' '.join(known)} help")}

    def _sweep(self, arguments: list[str]) -> str:
        if not arguments:
            return lines(f"{self.value('start')} {self.value('stop')} {self.value('points')}")
        if len(arguments) == 2 and arguments[0] in ("start", "stop"):
            return self._set_edges(**{arguments[0]: whole(arguments[1])})
        if len(arguments) == 2 and arguments[0] in ("center", "span", "cw"):
            return self._set_middle(arguments[0], whole(arguments[1]))
        if len(arguments) > 3 or not arguments[0][:1].isdigit():
            return lines("usage: sweep {start(Hz)} [stop(Hz)] [points]", "\tsweep {start|stop|center|span|cw} {freq(Hz)}")
        if len(arguments) == 3 and 2 <= whole(arguments[2]) <= self.limits("points")[1]:
            self.set_value("points", whole(arguments[2]))
        return self._set_edges(**{edge: whole(text) for edge, text in zip(("start", "stop"), arguments, strict=False)})

    def _set_edges(self, start: int | None = None, stop: int | None = None) -> str:
        highest = self.limits("stop")[1]
        if start is not None:
            self.set_value("start", min(start, highest))
        if stop is not None:
            self.set_value("stop", min(stop, highest))
        # If start lies above stop, the one that was set last moves the other.
        if self.value("start") > self.value("stop"):
            pushed, by = ("start", "stop") if stop is not None else ("stop", "start")
            self.set_value(pushed, self.value(by))
        self._take_edges()
        return ""

    def _set_middle(self, what: str, hertz: int) -> str:
        start, stop = int(self.value("start")), int(self.value("stop"))
        limits = self.limits("start")[0], self.limits("stop")[1]
        middle, half = (start + stop) / 2, (stop - start) / 2
        first, last = as_wide_as(middle, hertz / 2, *limits) if what == "span" else about(hertz, half if what == "center" else 0, *limits)
        return self._set_edges(int(first), int(last))

    def _take_edges(self) -> None:
        """Use these edges in the next background sweep."""
        self._axis = integer_axis(self.value("start"), self.value("stop"), self.value("points"))
        self._measured = None

    def _scan(self, arguments: list[str]) -> str:
        most = self.limits("points")[1]
        if not 2 <= len(arguments) <= 4:
            return lines("usage: scan {start(Hz)} {stop(Hz)} [points] [outmask]")
        start, stop = whole(arguments[0]), whole(arguments[1])
        points = whole(arguments[2]) if len(arguments) > 2 else int(self.value("points"))
        mask = whole(arguments[3]) if len(arguments) > 3 else 0
        if start > stop:
            return lines("frequency range is invalid")
        if not 0 < points <= most:
            return lines(f"sweep points exceeds range {most}")
        self._axis = integer_axis(start, stop, points)
        self._take_sweep_time(points)
        self._measured = None
        levels_dbm = self._levels_dbm()
        self._paused = True
        rows = []
        for hertz, level in zip(self._axis, levels_dbm, strict=True):
            row = [str(hertz)] if mask & FREQUENCY else []
            row += [f"{level:e} {DUMMY}" for bit in (ACTUAL, STORED, TEMPORARY) if mask & bit]
            rows.append(" ".join(row) + " ")
        return lines(*rows) if mask else ""

    def _scan_raw(self, arguments: list[str]) -> str | bytes:
        if not 2 <= len(arguments) <= 4:
            return lines("usage: scanraw {start(Hz)} {stop(Hz)} [points] [options]")
        start, stop = whole(arguments[0]), whole(arguments[1])
        points = whole(arguments[2]) if len(arguments) > 2 else int(self.value("points"))
        if start > stop or not 0 < points <= MOST_POINTS:
            return lines("frequency range is invalid")
        self._take_sweep_time(points)
        # For this command the step is the span divided by the number of points, not of intervals.
        levels_dbm = self._measure(start + (stop - start) / points * np.arange(points, dtype=np.float64))
        counts = np.round((levels_dbm + self.value("zero_level")) * 32).astype(int)
        return b"{" + b"".join(b"x" + struct.pack("<H", count) for count in counts) + b"}"

    def _print_data(self, arguments: list[str]) -> str:
        if arguments and whole(arguments[0]) > 2:
            return lines("usage: data [array]")
        return lines(*(f"{level:e}" for level in self._levels_dbm()))

    def _bandwidth(self, arguments: list[str]) -> str:
        if arguments == ["auto"]:
            arguments = ["0"]
        if len(arguments) == 1 and (wanted := _number(arguments[0])) is not None and (wanted == 0 or 2 <= wanted <= 600):
            nearest = min(FILTERS_KHZ, key=lambda khz: abs(np.log(khz / wanted))) if wanted else 0.0
            self.set_value("bandwidth_khz", nearest)
            return ""
        return lines("usage: rbw 2..600|auto", f"{self._filter_khz() * 1e3:.1f}Hz")

    def _filter_khz(self) -> float:
        """The filter in use; automatic is the one nearest to the step."""
        step_khz = max(1.0, (self.value("stop") - self.value("start")) / self.value("points") / 1e3)
        return float(self.value("bandwidth_khz")) or min(FILTERS_KHZ, key=lambda khz: abs(np.log(khz / step_khz)))

    def _attenuate(self, arguments: list[str]) -> str:
        if len(arguments) == 1 and arguments[0] != "?":
            self.set_within("attenuation", 0 if arguments[0] == "auto" else whole(arguments[0]))
            return ""
        return lines("usage: attenuate 0..31|auto", f"{self.value('attenuation'):4.2f}")

    def _sweep_time(self, arguments: list[str]) -> str:
        if len(arguments) == 1 and (seconds := _number(arguments[0])) is not None:
            self.set_within("sweep_time", 0.0 if math.isnan(seconds) else seconds)
            return ""
        return lines("usage: sweeptime 0.003..60", f"{self.value('sweep_time'):5.3f}s")

    def _calc(self, arguments: list[str]) -> str:
        if not arguments or arguments[-1] not in _AVERAGING:
            return lines(f"usage: calc [{{trace#}}] {'|'.join(_AVERAGING)}", self._averaging)
        self._averaging = arguments[-1]
        return ""

    def _zero(self, arguments: list[str]) -> str:
        if len(arguments) == 1 and arguments[0] != "?":
            self.set_within("zero_level", whole(arguments[0]))
            return ""
        return lines("usage: zero {level}", f"{self.value('zero_level')}dBm")

    def _external_gain(self, arguments: list[str]) -> str:
        if len(arguments) == 1 and (gain_db := _number(arguments[0])) is not None:
            self.set_within("external_gain", gain_db)
            return ""
        # The shell prints the range, but not the present value.
        return lines("usage: ext_gain -100.0..+100.0")

    def _trace(self, arguments: list[str]) -> str:
        if arguments == ["1", "value"]:
            return lines(*(f"trace 1 value {index} {level:.2f}" for index, level in enumerate(self._levels_dbm())))
        return "" if arguments else lines("1: dBm 0.000000000 10.000000000")

    def _pause(self, paused: bool) -> str:
        self._paused = paused
        if not paused:
            self._take_edges()
        return ""

    def _take_sweep_time(self, points: int) -> None:
        self.take_time(max(float(self.value("sweep_time")), points * SECONDS_PER_POINT))

    def _levels_dbm(self) -> FloatArray:
        """Levels of the last sweep, which may have run in the background."""
        if self._measured is None:
            self._measured = self._measure(np.array(self._axis, dtype=np.float64))
        return self._measured

    def _measure(self, frequency_hz: FloatArray) -> FloatArray:
        """Levels in dBm: the signal and the analyser's noise, limited by its mixer."""
        arriving = read_off_the_band(self.wiring, frequency_hz, "peak") - DBUV_OF_0_DBM
        attenuation = float(self.value("attenuation"))
        noise = NOISE_DBM + attenuation + 10 * np.log10(self._filter_khz() / 10.0)
        total = np.minimum(10 * np.log10(10 ** (arriving / 10) + 10 ** (noise / 10)), MOST_DBM + attenuation)
        return np.round(total / STEP_DB) * STEP_DB - float(self.value("external_gain"))


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None
