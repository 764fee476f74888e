"""Base class of the drivers of instruments that read a quantity of the motor's state."""

from __future__ import annotations

import abc
import re
from typing import ClassVar

from motoremi.bench.driver import Driver
from motoremi.errors import InstrumentError

# Role of an instrument -> the quantity that it reads.
QUANTITY_OF_ROLE: dict[str, str] = {
    "voltmeter": "voltage_volt",
    "ammeter": "current_ampere",
    "tachometer": "speed_rpm",
    "thermometer": "temperature_degc",
}
# SCPI instruments mark what they could not measure with 9.9E37, some with 9.91E37.
NOT_MEASURED = 9e36


class Meter(Driver):
    """An instrument that reads one or more quantities of the motor's state.

    Attributes
    ----------
    quantities : frozenset of str
        What it can read: keys of `motoremi.data.state.STATE_QUANTITIES`.
    number_format : str
        Regular expression of a complete number in an answer; a truncated number must not match.
    """

    quantities: ClassVar[frozenset[str]]
    number_format: ClassVar[str] = r"[+-]?\d+\.\d+E[+-]\d+"

    @abc.abstractmethod
    def read_quantity(self, quantity: str) -> float:
        """Measure once.

        Parameters
        ----------
        quantity : str
            One of `quantities`.

        Returns
        -------
        float
            In the unit that the name ends with.

        Raises
        ------
        InstrumentError
            If the answer is not a number, or marks an overload.
        """

    def ask_number(self, query: str) -> float:
        """Send a query and read one finite number."""
        answer = self.ask(query)
        if not re.fullmatch(self.number_format, answer):
            raise InstrumentError(f"{self}: {answer[:40]!r} in answer to {query!r} is no whole number")
        value = float(answer)
        if abs(value) > NOT_MEASURED:
            raise InstrumentError(f"{self}: overload, or nothing connected ({answer} in answer to {query!r})")
        return value
