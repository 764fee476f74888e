"""Scans and final measurements at the LISN: lines, operating states, and more attenuation after an overload."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, Protocol

import numpy as np

from motoremi.arrays import JsonDict
from motoremi.bench.connect import Bench
from motoremi.bench.motor_connections import AT_THE_LISN, Condition, ConnectionName
from motoremi.bench.receiver import EmiReceiver
from motoremi.data.spectrum import Detector, Spectrum
from motoremi.errors import BadInput
from motoremi.run.motor_state import MotorState
from motoremi.run.resume import Done
from motoremi.run.writer import Writer
from motoremi.schema.procedure import Planned, Procedure
from motoremi.schema.procedure_steps import Final, Scan
from motoremi.schema.procedure_tables import SpectrumSpec

# By how much the attenuation is raised after an overload; attenuators of receivers have steps of 5 or 10 dB.
MORE_DB = 10.0
# Points of a final measurement, from half a bandwidth below the maximum to half a bandwidth above. A line between two of them is measured at
# most 0.4 dB too low with a Gaussian filter.
FINAL_POINTS = 5
# Scans once with these settings and this detector.
ReadOnce = Callable[[SpectrumSpec, Detector], Spectrum]


class Running(Protocol):
    """What these steps need of the run that they belong to."""

    procedure: Procedure
    bench: Bench
    writer: Writer
    done: Done
    state: MotorState

    @property
    def analyse(self) -> Callable[[str, Any, JsonDict], JsonDict | None]:
        """Does a step of analysis."""

    def connect(self, what: ConnectionName) -> int:
        """Ask for a connection; its number."""

    def receiver(self) -> EmiReceiver:
        """The bench's receiver."""

    def ask(self, text: str) -> bool:
        """Show the operator an instruction."""


class EmissionSteps:
    """Does the steps of a run that need the receiver.

    Parameters
    ----------
    run : Running
        The run, whose connections, prompts and session are used.
    read_once : callable
        Scans once with settings and a detector, and checks the result.
    """

    def __init__(self, run: Running, read_once: ReadOnce) -> None:
        self._run = run
        self._read_once = read_once
        self._line, self._operating = "", ""

    def scan(self, step: Scan, stored: int) -> None:
        """Scan as often as the step requires; `stored` scans are stored already."""
        spec = self._spec()
        if step.dwell is not None:
            spec = spec.model_copy(update={"dwell": step.dwell})
        metadata = self._set_up(step.condition, step.line or "", step.operating)
        for _ in range(stored, step.repeat):
            spectrum = self._run.state.around(partial(self._without_overload, spec, step.detector))
            self._run.writer.add_spectrum(spectrum.with_metadata(**metadata))
            self._run.state.refuse_trouble()

    def final(self, planned: Planned, step: Final, stored: int) -> None:
        """Measure each maximum with each detector, on every line and in every operating state that was scanned; each is stored at once."""
        maxima = self._maxima(planned, step)
        spec = self._spec()
        readings = [
            (where, maximum, detector)
            for where in dict.fromkeys(_where_scanned(self._run.procedure, planned))
            for maximum in maxima
            for detector in step.detectors
        ]
        for (line, operating), frequency_hz, detector in readings[stored:]:
            metadata = self._set_up("motor running", line, operating)
            half, dwell = spec.bandwidth / 2, {"dwell": step.dwell, "step": spec.bandwidth / (FINAL_POINTS - 1)}
            # Near an edge of the span the points are moved inside, because a limit may begin there.
            near = min(max(frequency_hz, spec.start + half), spec.stop - half)
            around = spec.model_copy(update={"start": near - half, "stop": near + half, **dwell})
            spectrum = self._run.state.around(partial(self._without_overload, around, detector))
            self._run.writer.add_final(spectrum.with_metadata(maximum_hz=frequency_hz, dwell_s=step.dwell, **metadata))
            self._run.state.refuse_trouble()

    def _maxima(self, planned: Planned, step: Final) -> list[float]:
        """Frequencies in hertz: those chosen before the run was interrupted, else those that the analysis chooses now."""
        known = self._run.done.maxima.get(planned.number)
        if known is None:
            chosen = self._run.analyse("maxima", self._run.writer, step.parameters())
            if chosen is None:
                # A dry run has no scans to choose from: assume the largest number of maxima, to estimate the time.
                spec = self._spec()
                return [float(f) for f in np.geomspace(spec.start, spec.stop, step.maxima + 2)[1:-1]]
            self._run.writer.emit("maxima", step=planned.number, **chosen)
            known = tuple(chosen["maxima"])
        return list(dict.fromkeys(float(one["frequency_hz"]) for one in known))

    def _spec(self) -> SpectrumSpec:
        spec = self._run.procedure.spectrum
        if spec is None:
            raise BadInput("the step needs the table [spectrum]")
        return spec

    def _set_up(self, condition: Condition, line: str, operating: str) -> JsonDict:
        """Connect, switch the line, ask for the operating state; returns them as metadata of the spectrum."""
        connection = self._run.connect(AT_THE_LISN[condition])
        if line and line != self._line:
            if self._spec().line_switch == "receiver":
                self._run.receiver().switch_line(line)
            else:
                self._run.ask(f"Switch the LISN to line {line}")
            self._run.bench.at_line(line)
            self._line = line
        if operating != self._operating:
            self._run.ask(f"Bring the motor into the operating state: {operating or 'as before'}")
            self._operating = operating
        return {"condition": condition, "connection": connection} | {k: v for k, v in (("line", line), ("operating", operating)) if v}

    def _without_overload(self, spec: SpectrumSpec, detector: Detector) -> Spectrum:
        """One scan; the part that was overloaded is measured again with more attenuation, up to the receiver's largest."""
        spectrum = self._read_once(spec, detector)
        most_db = _most_attenuation(self._run.receiver())
        raised: list[JsonDict] = []
        while spec.overload == "attenuate" and spectrum.overload.any() and spec.attenuation + MORE_DB <= most_db:
            first, last = (int(np.flatnonzero(spectrum.overload)[end]) for end in (0, -1))
            # A scan has two points at least.
            first, last = max(0, min(first, last - 1)), max(last, 1)
            low_hz, high_hz = float(spectrum.frequency_hz[first]), float(spectrum.frequency_hz[last])
            spec = spec.model_copy(update={"attenuation": spec.attenuation + MORE_DB, "start": low_hz, "stop": high_hz})
            again = self._read_once(spec, detector)
            if len(again) != last - first + 1:
                break
            raised.append({"band_hz": [low_hz, high_hz], "attenuation_db": spec.attenuation})
            level, overload = spectrum.level_dbuv.copy(), spectrum.overload.copy()
            level[first : last + 1], overload[first : last + 1] = again.level_dbuv, again.overload
            spectrum = replace(spectrum, level_dbuv=level, overload=overload)
        return spectrum.with_metadata(attenuation_raised=raised) if raised else spectrum


def _most_attenuation(receiver: EmiReceiver) -> float:
    setting = receiver.table().get("attenuation_db")
    return setting.span[1] if setting is not None and setting.span is not None else 0.0


def _where_scanned(procedure: Procedure, until: Planned) -> list[tuple[str, str]]:
    """Line and state of every scan of the running motor before a step."""
    before = [planned.step for planned in procedure.plan[: until.number - 1]]
    return [(step.line or "", step.operating) for step in before if isinstance(step, Scan) and step.condition == "motor running"]
