"""A DC motor that is fed by a supply: current, speed and temperature over time, by first-order models."""

from __future__ import annotations

import math
from collections.abc import Callable

AMBIENT_DEGC = 23.0
# A small brushed motor: 12 V, some 3200 rpm and 0.43 A under its load, 23 K above ambient when it is warm.
RESISTANCE_OHM = 0.8
CONSTANT_VOLT_S = 0.035
LOAD_NEWTON_M = 0.015
INERTIA_KG_M2 = 1.5e-4
# Share of the electrical power that heats the motor, and its thermal resistance and time constant.
HEAT_SHARE = 0.3
THERMAL_KELVIN_PER_WATT = 15.0
THERMAL_TIME_S = 300.0
# The speed settles in seconds: it is integrated in this many short steps, and the rest of a wait is one step.
STEP_S, STEPS = 0.02, 500
RPM_PER_RADIAN_S = 60 / (2 * math.pi)


class MotorStand:
    """A motor on a test stand, fed by a voltage source with a current limit.

    Parameters
    ----------
    now : callable
        Returns the time of the stand's clock in seconds.
    """

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._at_s = now()
        self._source: tuple[float, float] | None = None
        self.rotation = 0.0
        self._temperature_degc = AMBIENT_DEGC

    def drive(self, voltage_volt: float, limit_ampere: float) -> None:
        """Feed the motor from now on."""
        self.advance()
        self._source = (voltage_volt, limit_ampere)

    def release(self) -> None:
        """Switch the supply off: the motor coasts down and cools."""
        self.advance()
        self._source = None

    @property
    def driven(self) -> bool:
        """Whether a supply is on."""
        return self._source is not None

    @property
    def limited(self) -> bool:
        """Whether the supply limits the current now."""
        self.advance()
        return self._source is not None and _exceeds(self._wanted_ampere(self._source[0]), self._source[1])

    @property
    def current_ampere(self) -> float:
        """Current now."""
        self.advance()
        return 0.0 if self._source is None else min(self._wanted_ampere(self._source[0]), self._source[1])

    @property
    def voltage_volt(self) -> float:
        """Voltage between the terminals now."""
        self.advance()
        if self._source is not None and not self.limited:
            return self._source[0]
        return CONSTANT_VOLT_S * self.rotation + RESISTANCE_OHM * self.current_ampere

    @property
    def speed_rpm(self) -> float:
        """Speed of the shaft now."""
        self.advance()
        return self.rotation * RPM_PER_RADIAN_S

    @property
    def temperature_degc(self) -> float:
        """Temperature of the motor now."""
        self.advance()
        return self._temperature_degc

    def _wanted_ampere(self, voltage_volt: float) -> float:
        return max(0.0, (voltage_volt - CONSTANT_VOLT_S * self.rotation) / RESISTANCE_OHM)

    def advance(self) -> None:
        """Let the motor turn and warm until now."""
        left_s, self._at_s = self._now() - self._at_s, self._now()
        for number in range(STEPS):
            if left_s <= 0:
                return
            step_s = min(left_s, STEP_S) if number < STEPS - 1 else left_s
            self._move(step_s)
            left_s -= step_s

    def _move(self, step_s: float) -> None:
        volt, limit = self._source or (0.0, 0.0)
        wanted = self._wanted_ampere(volt)
        current = min(wanted, limit)
        power_watt = current * (CONSTANT_VOLT_S * self.rotation + RESISTANCE_OHM * current)
        if _exceeds(wanted, limit) or self._source is None:
            # With limited current the torque is constant: the shaft accelerates until the supply leaves the current limit, or decelerates.
            gain = (CONSTANT_VOLT_S * current - LOAD_NEWTON_M) / INERTIA_KG_M2 * step_s
            free = max(0.0, (volt - RESISTANCE_OHM * limit) / CONSTANT_VOLT_S)
            self.rotation = max(0.0, self.rotation + gain if gain < 0 else min(self.rotation + gain, max(free, self.rotation)))
        else:
            final = max(0.0, (volt - RESISTANCE_OHM * LOAD_NEWTON_M / CONSTANT_VOLT_S) / CONSTANT_VOLT_S)
            time_s = INERTIA_KG_M2 * RESISTANCE_OHM / CONSTANT_VOLT_S**2
            self.rotation = final + (self.rotation - final) * math.exp(-step_s / time_s)
        final_degc = AMBIENT_DEGC + HEAT_SHARE * power_watt * THERMAL_KELVIN_PER_WATT
        self._temperature_degc = final_degc + (self._temperature_degc - final_degc) * math.exp(-step_s / THERMAL_TIME_S)


def _exceeds(wanted_ampere: float, limit_ampere: float) -> bool:
    """Whether a supply limits the current; with a tolerance, since rounding would keep a motor at its final speed in the limit."""
    return wanted_ampere > limit_ampere * (1 + 1e-9)
