"""The simulated LibreVNA-GUI with its instrument: sweeps, the trace S11 and the calibration on top of its profile."""

from __future__ import annotations

import math
import re
from collections.abc import Callable

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.simulate.vna import RAW, SimulatedVna
from motoremi.virtual.simulated_device import SimulatedDevice
from motoremi.virtual.simulated_nanovna import behind_clips

# Nodes as the Programming Guide writes them: the capitals are the short form, and a node in capitals only has none. The short form of `ACTIVE`
# of a trace's de-embedding is left out, because it is also that of `ACTivate`.
_NODES = (
    "DEVice CONNect DISConnect MODE INFo FWREVision HWREVision LIMits MINFrequency MAXFrequency MINIFBW MAXIFBW MAXPoints STAtus UNLOcked "
    "ADCOVERload UNLEVel VNA SWEEP FREQuency START STOP SWEEPTYPE ACQuisition RUN IFBW POINTS AVG AVGLEVel FINished SINGLE STIMulus LVL TRACe LIST "
    "DATA PARAMeter TYPE PAUSED DEEMBedding CALibration ACTivate ACTIVE RESET NUMber"
)
_SPELLED = {spelling: node for node in _NODES.split() for spelling in (node.upper(), re.sub("[a-z]", "", node))}
TRUE, FALSE = ("TRUE", "ON", "1"), ("FALSE", "OFF", "0")
POWER_ON_CALIBRATION = "SOLT_12"
TRACES = ("S11", "S12", "S21", "S22")
SETTLING_S = 2e-4


class SimulatedLibreVna(SimulatedDevice):
    """A LibreVNA whose port 1 is calibrated and connected to a test stand by clips; nothing is connected to port 2."""

    profile = "librevna.yaml"

    def power_on(self) -> None:
        """Calibrated and sweeping."""
        super().power_on()
        self._calibration = POWER_ON_CALIBRATION
        self._begun_s: float | None = None
        self._single = False
        self._s11: ComplexArray | None = None
        self._calibrated, self._raw = SimulatedVna(self.wiring.seed), SimulatedVna(self.wiring.seed, RAW)
        self._run("")

    def commands(self) -> dict[str, Callable[[str], bytes | None]]:
        """What the LibreVNA-GUI computes."""
        return {
            "DEVice:CONNect": lambda _: None,
            "VNA:ACQuisition:RUN": self._run,
            "VNA:ACQuisition:RUN?": lambda _: _word(self._begun_s is not None and not (self._single and self._complete())),
            "VNA:ACQuisition:STOP": self._stop,
            "VNA:ACQuisition:SINGLE": self._set_single,
            "VNA:ACQuisition:SINGLE?": lambda _: _word(self._single),
            "VNA:ACQuisition:FINished?": lambda _: _word(self._complete()),
            "VNA:ACQuisition:AVGLEVel?": lambda _: str(self.value("averages") if self._complete() else 0).encode(),
            "VNA:TRACe:LIST?": lambda _: ",".join(TRACES).encode(),
            "VNA:TRACe:DATA?": self._trace_data,
            "VNA:TRACe:PARAMeter?": lambda name: self._of_trace(name, name.upper()),
            "VNA:TRACe:TYPE?": lambda name: self._of_trace(name, "OVERWRITE"),
            "VNA:TRACe:PAUSED?": lambda name: self._of_trace(name, "FALSE"),
            "VNA:TRACe:DEEMBedding:ACTIVE?": lambda name: self._of_trace(name, "FALSE"),
            "VNA:CALibration:ACTIVE?": lambda _: self._calibration.encode(),
            "VNA:CALibration:ACTivate?": lambda _: b"SOLT_12,OSL_1,ThroughNormalization_12",
            "VNA:CALibration:ACTivate": self._activate,
            "VNA:CALibration:NUMber?": lambda _: b"0" if self._calibration == "None" else b"7",
            "VNA:CALibration:RESET": lambda _: self._activate("None"),
        }

    def fold(self, header: str) -> str:
        """Nodes as the guide writes them; unknown nodes in capitals."""
        nodes = header.removeprefix(":").removesuffix("?").split(":")
        return ":".join(_SPELLED.get(node.upper(), node.upper()) for node in nodes) + ("?" if header.endswith("?") else "")

    def busy_until(self) -> float:
        """When the running sweep ends."""
        return self.clock.now() if self._begun_s is None else max(self.clock.now(), self._begun_s + self._duration_s())

    def _duration_s(self) -> float:
        return float(self.value("averages") * self.value("points")) * (2.5 / float(self.value("bandwidth")) + SETTLING_S)

    def _complete(self) -> bool:
        return self._s11 is not None or (self._begun_s is not None and self.clock.now() >= self._begun_s + self._duration_s())

    def _run(self, _: str) -> None:
        self._begun_s, self._s11 = self.clock.now(), None

    def _stop(self, _: str) -> None:
        if self._complete():
            self._measured()
        self._begun_s = None

    def _set_single(self, argument: str) -> None:
        if argument.upper() not in TRUE + FALSE:
            self.note_error("command_error")
            return
        before, self._single = self._single, argument.upper() in TRUE
        # If a single sweep is running, the command does not start another one.
        if self._single and (not before or self._begun_s is None):
            self._run("")

    def assign(self, name: str, argument: str) -> None:
        """Set a setting; a value beyond its limits is changed to the limit without an error. A running sweep starts again."""
        specs = self._data["properties"][name]["specs"]
        if specs["type"] != "str":
            try:
                value = float(argument.split(" ")[0])
            except ValueError:
                value = math.nan
            if math.isnan(value):
                self.note_error("command_error")
                return
            value = min(max(value, float(specs["min"])), float(specs["max"]))
            argument = str(int(value)) if specs["type"] == "int" else repr(value)
        elif argument.upper() not in specs["valid"]:
            self.note_error("command_error")
            return
        super().assign(name, argument)
        if name in ("start", "stop") and self.value("start") > self.value("stop"):
            super().assign("stop" if name == "start" else "start", argument)
        if self._begun_s is not None:
            self._run("")

    def _axis(self) -> FloatArray:
        spaced = np.geomspace if self.value("spacing") == "LOG" else np.linspace
        return np.floor(spaced(self.value("start"), self.value("stop"), self.value("points")) + 1e-3)

    def _measured(self) -> ComplexArray:
        """S11 of the last complete sweep; if the program sweeps continuously, of a sweep with the present settings."""
        if self._s11 is None or (not self._single and self._begun_s is not None):
            corrects = self._calibration.startswith(("OSL", "SOLT", "TRL"))
            axis, vna = self._axis(), self._calibrated if corrects else self._raw
            self._s11 = vna.reflection(axis, behind_clips(self.wiring, axis), self.value("bandwidth") / self.value("averages"))
        return self._s11

    def _trace_data(self, name: str) -> bytes | None:
        if self._of_trace(name, "") is None:
            return None
        if not self._complete():
            return b"EMPTY"
        values = self._measured() if name.upper() in ("S11", "0") else np.zeros(self.value("points"), dtype=np.complex128)
        rows = zip(self._axis(), values, strict=True)
        return ",".join(f"[{hertz:.0f},{value.real:.6g},{value.imag:.6g}]" for hertz, value in rows).encode()

    def _of_trace(self, name: str, answer: str) -> bytes | None:
        if name.upper() not in (*TRACES, *map(str, range(len(TRACES)))):
            self.note_error("command_error")
            return None
        return answer.encode()

    def _activate(self, argument: str) -> None:
        known = {kind.upper(): kind for kind in ("SOLT_12", "OSL_1", "ThroughNormalization_12", "None")}
        if argument.upper() not in known:
            self.note_error("command_error")
            return
        self._calibration = known[argument.upper()]

    def _reset(self, argument: str) -> None:
        """A reset also deletes the calibration."""
        super()._reset(argument)
        self._calibration = "None"
        self._single = False
        self._run("")


def _word(value: bool) -> bytes:
    return b"TRUE" if value else b"FALSE"
