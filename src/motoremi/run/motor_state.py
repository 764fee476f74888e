"""The motor's state in a run: the instruments that read it, the limits that it has to keep, and the supply."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, TypeVar

from motoremi.arrays import JsonDict
from motoremi.bench.driver import Driver, Identity
from motoremi.bench.meter import QUANTITY_OF_ROLE, Meter
from motoremi.bench.replay_difference import RecordedEnd, ReplayDifference
from motoremi.bench.supply import Supply
from motoremi.data.spectrum import Spectrum
from motoremi.data.state import STATE_QUANTITIES, show_state
from motoremi.data.sweep import ImpedanceSweep
from motoremi.errors import BadInput, InstrumentError
from motoremi.schema.procedure import Procedure
from motoremi.schema.state_steps import Demand, SupplyStep, WaitFor

# Approximate duration of one step of a ramp.
RAMP_STEP_S = 0.5
# A wait ends with an error after this many failed readings in a row.
MOST_FAILURES = 3

Measured = TypeVar("Measured", ImpedanceSweep, Spectrum)


class MotorState:
    """The motor's state during one run.

    Parameters
    ----------
    emit : callable
        Writes a document: kind and content.
    wait : callable
        Waits that many seconds.
    ask : callable
        Asks the operator; returns if the answer is "done", else raises.
    """

    def __init__(self, emit: Callable[..., object], wait: Callable[[float], None], ask: Callable[[str], object]) -> None:
        self._emit = emit
        self._wait = wait
        self._ask = ask
        self.supply: Supply | None = None
        self._meters: dict[str, Meter] = {}
        self._read_by: dict[str, str] = {}
        self._demands: dict[str, Demand] = {}
        self._trouble: InstrumentError | None = None

    def adopt(self, role: str, driver: Driver, identity: Identity, procedure: Procedure) -> None:
        """Register an instrument of a role; refuse what it cannot do before anything is measured."""
        if role == "supply":
            if not isinstance(driver, Supply):
                raise BadInput(f"instruments.supply: the driver {type(driver).__name__} is no supply")
            for planned in procedure.plan:
                if isinstance(step := planned.step, SupplyStep) and step.voltage is not None and step.current_limit is not None:
                    driver.refuse_beyond_rating(step.voltage, step.current_limit)
            self.supply = driver
            quantities = [key for key in driver.quantities if key not in self._meters]
        elif role in QUANTITY_OF_ROLE:
            if not isinstance(driver, Meter):
                raise BadInput(f"instruments.{role}: the driver {type(driver).__name__} reads no {STATE_QUANTITIES[QUANTITY_OF_ROLE[role]][0]}")
            quantities = [QUANTITY_OF_ROLE[role]]
        else:
            return
        who = " ".join(text for text in (identity.vendor, identity.model, identity.serial) if text)
        for key in quantities:
            self._meters[key] = driver
            self._read_by[key] = f"{role}: {who} at {driver.transport.resource_name}"

    @property
    def warning(self) -> str:
        """Warning for an operator who is about to touch the motor's terminals; empty if the supply is off."""
        sent = self.supply.sent_settings if self.supply is not None else {}
        return f"CAUTION: the supply is ON ({show_state('voltage_volt', sent['voltage_volt'])}). " if sent.get("output") else ""

    def set_supply(self, step: SupplyStep) -> None:
        """Do a `supply` step."""
        supply = self.supply
        if supply is None:
            raise BadInput("the step needs instruments.supply")
        # Earlier waits were for the state with the former supply settings.
        self._demands.clear()
        on = bool(supply.sent_settings.get("output"))
        start = float(supply.sent_settings.get("voltage_volt", 0.0)) if on else 0.0
        final, limit = step.voltage or 0.0, step.current_limit or float(supply.sent_settings.get("limit_ampere", 0.0))
        # A fixed number of steps, independent of the clock, so that a replay makes as many.
        steps = math.ceil(step.ramp / RAMP_STEP_S) if step.ramp and (on or step.output == "on") else 0
        if step.output == "on":
            supply.set_limits(start if steps else final, limit)
            if not on:
                supply.switch_on()
        for number in range(1, steps + 1):
            self._wait(step.ramp / steps)
            supply.set_limits(start + (final - start) * number / steps, limit)
        if step.output == "off":
            supply.switch_off()
        trouble = supply.regulation() if step.output == "on" else ""
        self._emit("supply", output=step.output, voltage_volt=step.voltage, limit_ampere=step.current_limit, trouble=trouble)

    def wait_for(self, step: WaitFor) -> None:
        """Do a `wait-for` step.

        Raises
        ------
        InstrumentError
            If the quantity cannot be read, or the condition is not met after the longest wait and the operator does not go on.
        """
        if step.key not in self._meters:
            raise BadInput(f"nothing on this bench reads the {step.quantity}")
        values: list[float] = []
        failures = 0
        for number in range(step.most_readings):
            if number:
                self._wait(step.every)
            reading, missing = self._readings([step.key])
            if step.key in missing:
                values.clear()
                failures += 1
                if failures == MOST_FAILURES:
                    raise InstrumentError(f"the {step.quantity} that is waited for cannot be read: {missing[step.key]}")
                continue
            failures = 0
            values.append(float(reading[step.key]))
            if (demand := step.met(values)) is not None:
                self._demands[step.key] = demand
                self._emit("state", reached=step.text, seconds=number * step.every, state=self._state())
                return
        last = f"last {show_state(step.key, values[-1])}" if values else "it could not be read"
        trouble = f"the {step.quantity} was not {step.text.removeprefix(step.quantity).strip()} within {step.longest:g} s ({last})"
        if step.otherwise == "stop":
            raise InstrumentError(f"{trouble}; remove the cause or wait longer, and continue with --resume")
        self._ask(f"{trouble[0].upper()}{trouble[1:]}. Continue nevertheless? Data measured then are marked")
        self._demands[step.key] = step.unmet()
        self._emit("state", reached="", seconds=(step.most_readings - 1) * step.every, state=self._state())

    def around(self, measure: Callable[[], Measured]) -> Measured:
        """Measure between two readings of the state, which go into the metadata as `state`.

        An error of the supply after the measurement is kept and raised by `refuse_trouble`, when the data are stored.
        """
        if not self._meters:
            return measure()
        state: JsonDict = self._state()
        end: JsonDict = {}
        measured = measure()
        try:
            end = self._state()
        except (RecordedEnd, ReplayDifference):
            raise
        except InstrumentError as error:
            self._trouble = error
            end = {"outside": [f"the supply failed while this was measured: {error}"]}
        missing = {**end.pop("missing", {}), **state.pop("missing", {})}
        outside = list(dict.fromkeys([*state.pop("outside", []), *end.pop("outside", [])]))
        read_by = state.pop("read_by")
        end.pop("read_by", None)
        state |= {"at_end": end, "read_by": read_by}
        if missing:
            state["missing"] = missing
        if outside:
            state["outside"] = outside
        return measured.with_metadata(state=state)

    def refuse_trouble(self) -> None:
        """Raise the error of the supply that occurred during the last measurement."""
        if self._trouble is not None:
            raise self._trouble

    def _state(self) -> JsonDict:
        """All quantities now, the instruments that read them, and which are outside their limits."""
        outside = []
        if self.supply is not None and self.supply.sent_settings.get("output"):
            self.supply.refuse_changed()
            if trouble := self.supply.regulation():
                outside.append(trouble)
        values, missing = self._readings(self._meters)
        for key, demand in self._demands.items():
            if key in values and demand.outside(values[key]):
                outside.append(f"{STATE_QUANTITIES[key][0]} {show_state(key, values[key])}: {demand.text}")
        state: JsonDict = {**values, "read_by": {key: self._read_by[key] for key in STATE_QUANTITIES if key in self._read_by}}
        if missing:
            state["missing"] = missing
        if outside:
            state["outside"] = outside
        return state

    def _readings(self, keys: Mapping[str, Any] | list[str]) -> tuple[JsonDict, dict[str, str]]:
        """Values by key with the `time` of the last one, and why others could not be read."""
        values: JsonDict = {}
        missing: dict[str, str] = {}
        time = ""
        for key in (key for key in STATE_QUANTITIES if key in keys):
            meter = self._meters[key]
            try:
                values[key] = meter.read_quantity(key)
                time = meter.transport.answered_at
            except (RecordedEnd, ReplayDifference):
                raise
            except InstrumentError as error:
                # An error of the supply is raised, because it feeds the motor.
                if meter is self.supply:
                    raise
                missing[key] = str(error)
                with suppress(InstrumentError):
                    meter.transport.clear()
        return ({**values, "time": time} if values else values), missing


def refuse_missing(procedure: Procedure) -> None:
    """Raise `BadInput` for a step whose instrument neither the procedure nor the bench file names."""
    roles = set(procedure.instruments)
    for planned in procedure.plan:
        needed: list[str] = []
        if isinstance(planned.step, SupplyStep):
            needed = ["supply"]
        elif isinstance(planned.step, WaitFor):
            needed = [role for role, key in QUANTITY_OF_ROLE.items() if key == planned.step.key]
            needed += ["supply"] if planned.step.key in Supply.quantities else []
        if needed and not roles.intersection(needed):
            raise BadInput(f"{planned}: needs instruments.{' or instruments.'.join(needed)}, in the procedure or in the bench file")
