"""The schema of a bench procedure."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from motoremi.arrays import JsonDict
from motoremi.bench.connect import driver_class
from motoremi.bench.impedance_analyser import ImpedanceAnalyser, refuse_without
from motoremi.bench.receiver import EmiReceiver
from motoremi.data.text import clean_text
from motoremi.data.toml_file import parse_toml, read_toml
from motoremi.emission.band import band_at, misread
from motoremi.emission.limit import find_limit
from motoremi.errors import BadInput
from motoremi.quantities import show, show_band
from motoremi.schema.procedure_steps import Check, Compensate, Final, Identify, JudgeStep, MeasuringStep, PlainStep, Repeat, Scan, Step, Sweep
from motoremi.schema.procedure_tables import DRIVER_SETTINGS, InstrumentSpec, SpectrumSpec, SweepSpec
from motoremi.schema.quantity_field import Quantity
from motoremi.schema.roles import Role
from motoremi.schema.state_steps import SupplyStep, WaitFor
from motoremi.schema.strict import Strict
from motoremi.schema.toml_file import checked

# More steps than a bench can do in a week; a larger number would only fill memory.
MOST_STEPS = 10_000


# Detectors with a meter time constant of 160 ms (two equal poles), which is within 0.12 dB of the final value after one second. CISPR 16-2-1
# requires one second as well (unconfirmed: not read in the standard).
METERED, METER_DWELL_S = ("quasi-peak", "cispr-average", "rms-average"), 1.0


_NEEDS: tuple[tuple[Any, Role, str], ...] = ((Compensate | Sweep | Check, "analyser", "sweep"), (Scan | Final, "receiver", "spectrum"))


@dataclass(frozen=True)
class Planned:
    """One step of the plan: all steps in the order in which they are done, those of a repeat listed once for each pass.

    Parameters
    ----------
    number : int
        From 1.
    step : step model
    round, rounds : int
        Which pass of a repeat; 1 of 1 outside of it.
    """

    number: int
    step: PlainStep
    round: int = 1
    rounds: int = 1

    def __str__(self) -> str:
        passed = f", round {self.round} of {self.rounds}" if self.rounds > 1 else ""
        return f"step {self.number} ({self.step.do}){passed}"


class Procedure(Strict):
    """A bench procedure: instruments by role, what to measure, and the steps in order."""

    title: str = Field(min_length=1, max_length=200, description="what it is, for the report")
    instruments: dict[Role, InstrumentSpec] = Field(description="by role: analyser, receiver, supply, voltmeter, ammeter, tachometer, thermometer")
    calibration_within: Annotated[float, Quantity("d", 1, 3650)] | None = Field(
        default=None, description="refuse to run with an instrument whose calibration is older, in the future or not stated"
    )
    sweep: SweepSpec | None = None
    spectrum: SpectrumSpec | None = None
    steps: tuple[Step, ...] = Field(min_length=1, description="what is done, in order")
    _source: JsonDict = PrivateAttr(default_factory=dict)

    @property
    def source(self) -> JsonDict:
        """The procedure as written, for the record; `parse_procedure` reads it again."""
        return self._source

    @property
    def plan(self) -> tuple[Planned, ...]:
        """All steps in the order in which they are done."""
        return tuple(Planned(number, *entry) for number, entry in enumerate(self._unrolled(), start=1))

    def _unrolled(self) -> Iterator[tuple[PlainStep, int, int]]:
        for step in self.steps:
            if isinstance(step, Repeat):
                yield from ((inner, turn, step.times) for turn in range(1, step.times + 1) for inner in step.steps)
            else:
                yield step, 1, 1

    @model_validator(mode="after")
    def _complete(self) -> Self:
        count = sum(step.times * len(step.steps) if isinstance(step, Repeat) else 1 for step in self.steps)
        if count > MOST_STEPS:
            raise BadInput(f"steps: {count} steps with all repeats; at most {MOST_STEPS}")
        once = [inner for step in self.steps for inner in (step.steps if isinstance(step, Repeat) else (step,))]
        measuring = [step for step in once if isinstance(step, MeasuringStep)]
        if (measuring or any(isinstance(step, SupplyStep | WaitFor) for step in once)) and not isinstance(self.steps[0], Identify):
            raise BadInput("the first step must be 'identify', which connects and sets up the instruments")
        for name, spec in self.instruments.items():
            spec.refuse_in(name)
        for kinds, role, table in _NEEDS:
            if any(isinstance(step, kinds) for step in measuring):
                if role not in self.instruments:
                    raise BadInput(f"the steps need instruments.{role}")
                if getattr(self, table) is None:
                    raise BadInput(f"the steps need the table [{table}]")
                self._refuse_beyond_driver(role, table)
        self._refuse_impossible_emission(once)
        self._refuse_lacking(measuring)
        return self

    def _refuse_impossible_emission(self, steps: Sequence[PlainStep]) -> None:
        """Refuse an unknown limit, a detector that the receiver lacks, and a final measurement without a scan before it."""
        scanned = False
        for step in steps:
            if isinstance(step, Final | JudgeStep):
                find_limit(step.limit)
            if isinstance(step, Final) and not scanned:
                raise BadInput("the step 'final' needs a step 'spectrum' of the running motor before it, which finds the maxima")
            scanned = scanned or (isinstance(step, Scan) and step.condition == "motor running")
            wanted = [step.detector] if isinstance(step, Scan) else step.detectors if isinstance(step, Final) else []
            for detector in wanted:
                self._refuse_detector(detector)

    def _refuse_detector(self, detector: str) -> None:
        name = self.instruments["receiver"].driver
        driver = driver_class(name)
        if issubclass(driver, EmiReceiver) and detector not in driver.detectors():
            raise BadInput(f"the {name} has no {detector} detector of CISPR 16-1-1; it has {', '.join(driver.detectors())}")

    def remarks(self) -> tuple[str, ...]:
        """Warnings: settings that the receiver accepts, but with which levels are wrong or lines are missed."""
        if self.spectrum is None:
            return ()
        found = []
        spec = self.spectrum
        if spec.step > spec.bandwidth / 2 * (1 + 1e-9):
            found.append(
                f"[spectrum]: the step of {show(spec.step, 'Hz')} is coarser than half the bandwidth of {show(spec.bandwidth, 'Hz')}: "
                "a line between two points is measured too low"
            )
        for low, reads in ((True, "too low: compliance cannot be shown"), (False, "too high")):
            wrong_hz = np.array([spec.start, math.sqrt(spec.start * spec.stop), spec.stop])
            wrong_hz = wrong_hz[misread(wrong_hz, spec.bandwidth, low)]
            if wrong_hz.size:
                band = band_at(float(wrong_hz[-1]))
                found.append(
                    f"[spectrum]: a bandwidth of {show(spec.bandwidth, 'Hz')} reads {reads}; band {band.name} ({show_band(*band.span_hz)}) has "
                    f"{show(band.bandwidth_hz, 'Hz')}"
                )
        for planned in self.plan:
            if isinstance(planned.step, Scan) and planned.step.detector in METERED:
                dwell = planned.step.dwell or spec.dwell
                if dwell < METER_DWELL_S:
                    found.append(
                        f"step {planned.number}: {planned.step.detector} with a dwell of {show(dwell, 's')} measures too low: "
                        f"its meter needs {METER_DWELL_S:g} s at each point"
                    )
        return tuple(found)

    def _refuse_lacking(self, measuring: Sequence[object]) -> None:
        """Refuse options and standards that the analyser does not have."""
        kind = driver_class(self.instruments["analyser"].driver) if "analyser" in self.instruments else None
        if self.sweep is None or kind is None or not issubclass(kind, ImpedanceAnalyser):
            return
        name = self.instruments["analyser"].driver
        refuse_without(kind, self.sweep.options(), f"sweep: the {name}")
        wanted = {step.standard for step in measuring if isinstance(step, Compensate)}
        if lacking := wanted - kind.COMPENSATES:
            raise BadInput(f"the {name} compensates no {', '.join(sorted(lacking))}; leave that step out")
        if missing := kind.REQUIRED - wanted:
            needed = ", ".join(sorted(kind.REQUIRED))
            raise BadInput(f"the {name} measures only after steps that compensate with {needed}: {', '.join(sorted(missing))} missing")

    def _refuse_beyond_driver(self, role: Role, table: str) -> None:
        driver = self.instruments[role].driver
        settings = driver_class(driver).table()
        for key, name in DRIVER_SETTINGS[table].items():
            setting, value = settings.get(name), getattr(getattr(self, table), key)
            if setting is not None and setting.span is not None and not setting.span[0] <= value <= setting.span[1]:
                low, high = (show(limit, setting.unit) for limit in setting.span)
                raise BadInput(f"{table}.{key}: {show(value, setting.unit)} is outside the range {low} to {high} of the {driver}")


def ready_procedures() -> list[str]:
    """Names of the procedures that come with motoremi."""
    return sorted(entry.name.removesuffix(".toml") for entry in resources.files("motoremi.procedures").iterdir() if entry.name.endswith(".toml"))


def load_procedure(path: str | Path) -> Procedure:
    """Read a procedure from a file, or one that comes with motoremi by its name, such as `full_motor_test`.

    Raises
    ------
    BadInput
        In one line, with file, step and key of each error.
    """
    ready = ready_procedures()
    # A session folder may have the name of the procedure.
    if not Path(path).is_file() and str(path) in ready:
        shipped = resources.files("motoremi.procedures") / f"{path}.toml"
        return parse_procedure(parse_toml(shipped.read_bytes(), f"{path}.toml"), f"{path}.toml")
    if not Path(path).exists() and not Path(path).suffix:
        raise BadInput(f"there is no procedure {clean_text(str(path), 60)!r}: use {', '.join(ready)}, or the path of your own .toml file")
    return parse_procedure(read_toml(path), str(path))


def parse_procedure(data: Mapping[str, Any], where: str) -> Procedure:
    """Check a procedure that has been read; `where` names it in errors."""
    procedure = checked(Procedure, data, where)
    procedure._source = dict(data)
    return procedure
