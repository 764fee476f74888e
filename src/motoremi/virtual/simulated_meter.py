"""The simulated 34461A: a multimeter for voltage or current of the motor, or the temperature of its frame."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from motoremi.virtual.simulated_scpi import SimulatedScpi

# A reading at 10 power line cycles.
READING_S = 0.2
FUNCTIONS = {"VOLT:DC": "VOLT", "VOLT": "VOLT", "CURR:DC": "CURR", "CURR": "CURR", "TEMP": "TEMP"}


class Simulated34461A(SimulatedScpi):
    """A multimeter that is connected correctly for every function that is selected."""

    profile = "keysight_34461a.yaml"

    def power_on(self) -> None:
        """It measures direct voltage."""
        super().power_on()
        self._function = "VOLT"

    def commands(self) -> dict[str, Callable[[str], bytes | None]]:
        """What the multimeter computes."""
        made: dict[str, Callable[[str], bytes | None]] = {
            "READ?": lambda _: self._read(),
            "FETC?": lambda _: self._read(),
            "INIT": lambda _: None,
            "ABOR": lambda _: None,
            "FUNC?": lambda _: f'"{self._function}"'.encode(),
            "FUNC": self._set_function,
        }
        for header, function in FUNCTIONS.items():
            made[f"CONF:{header}"] = partial(self._configure, function)
            made[f"MEAS:{header}?"] = partial(self._measure, function)
        return made

    def busy_until(self) -> float:
        """It is never busy: a query is answered after the measurement."""
        return self.clock.now()

    def _reset(self, argument: str) -> None:
        super()._reset(argument)
        self._function = "VOLT"

    def _configure(self, function: str, _: str) -> None:
        self._function = function

    def _measure(self, function: str, _: str) -> bytes:
        self._function = function
        return self._read()

    def _set_function(self, argument: str) -> None:
        word = FUNCTIONS.get(self.fold(argument.strip('"')))
        if word is None:
            self.note_error("execution_error")
            return
        self._function = word

    def _read(self) -> bytes:
        self.clock.sleep(READING_S)
        stand = self.wiring.stand
        value = {"VOLT": stand.voltage_volt, "CURR": stand.current_ampere, "TEMP": stand.temperature_degc}[self._function]
        return f"{value:+.8E}".encode()
