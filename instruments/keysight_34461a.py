"""Keysight 34460A, 34461A, 34465A, 34470A bench multimeters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from motoremi.bench.driver import Setting
from motoremi.bench.meter import Meter
from motoremi.bench.transport import Transport


class Keysight34461A(Meter):
    """A Truevolt multimeter as voltmeter, ammeter or thermometer.

    Sources: command quick reference of the Truevolt guide (`MEASure` with `VOLTage:DC`, `CURRent:DC`, `TEMPerature` and its sensors); 9.9E37
    for an overload by the guide of the 34410A, which has the same commands. Temperatures come in degC, which is the default of `UNIT:TEMP`.
    Unconfirmed: the number of digits of a reading (an exponent is expected), and which sensors need a 34465A or 34470A (thermocouples do by
    the quick reference).
    """

    model = r"344(60|61|65|70)A"
    error_query = "SYST:ERR?"
    safe_commands = ("ABOR",)
    quantities = frozenset({"voltage_volt", "current_ampere", "temperature_degc"})

    function: Setting[str] = Setting("FUNC", "Control what is measured.", lambda text: text.strip('"'), lambda word: f'"{word}"')

    def __init__(self, transport: Transport) -> None:
        super().__init__(transport)
        self._probe = "FRTD"

    def use(self, options: Mapping[str, Mapping[str, Any]]) -> None:
        """Take the type of the temperature sensor."""
        self._probe = str(options.get("thermometer", {}).get("probe") or self._probe)

    def read_quantity(self, quantity: str) -> float:
        """Measure once with automatic range; each query names the quantity, so that a restarted multimeter cannot measure another one."""
        query = {"voltage_volt": "MEAS:VOLT:DC?", "current_ampere": "MEAS:CURR:DC?", "temperature_degc": f"MEAS:TEMP? {self._probe}"}
        return self.ask_number(query[quantity])
