"""The simulated supplies: one output feeds the motor, nothing is connected to the others."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import ClassVar

from motoremi.virtual.simulated_scpi import SimulatedScpi

OFF, CONSTANT_CURRENT, CONSTANT_VOLTAGE = 0, 1, 2


class SimulatedSupply(SimulatedScpi):
    """A supply; the output that is switched on last, or set last while on, feeds the motor."""

    ratings: ClassVar[Sequence[tuple[float, float]]]
    # Format of a voltage or a current in an answer.
    number: ClassVar[str]

    def power_on(self) -> None:
        """All outputs are off, so nothing feeds the motor."""
        super().power_on()
        self._all_off()

    def busy_until(self) -> float:
        """It is never busy."""
        return self.clock.now()

    def fold(self, header: str) -> str:
        """`SOURce` may be left out."""
        folded = super().fold(header)
        return folded.removeprefix("SOUR:") if folded.startswith(("SOUR:VOLT", "SOUR:CURR")) else folded

    def commands(self) -> dict[str, Callable[[str], bytes | None]]:
        """What the supply computes."""
        made: dict[str, Callable[[str], bytes | None]] = {
            "VOLT": lambda text: self._set(self._volt, text, 0),
            "VOLT?": lambda text: self._shown_setting(self._volt, text),
            "CURR": lambda text: self._set(self._ampere, text, 1),
            "CURR?": lambda text: self._shown_setting(self._ampere, text),
            "MEAS:VOLT?": lambda text: self._measured("voltage_volt", text),
            "MEAS:VOLT:DC?": lambda text: self._measured("voltage_volt", text),
            "MEAS:CURR?": lambda text: self._measured("current_ampere", text),
            "MEAS:CURR:DC?": lambda text: self._measured("current_ampere", text),
        }
        for output in range(1, len(self.ratings) + 1):
            made[f"STAT:QUES:INST:ISUM{output}:COND?"] = lambda _, output=output: str(self._condition(output)).encode()  # type: ignore[misc]
        return made

    def is_on(self, output: int) -> bool:
        """Whether an output is on."""
        raise NotImplementedError

    def addressed(self, text: str) -> tuple[int, str]:
        """Number of the output that an argument is for, and the rest of the argument; 0 if there is no such output."""
        raise NotImplementedError

    def feed(self, output: int) -> None:
        """Connect the motor to this output if it is on; disconnect it if the output has been switched off."""
        if self.is_on(output):
            self._feeding = output
            self.wiring.stand.drive(self._volt[output - 1], self._ampere[output - 1])
        elif self._feeding == output:
            self._feeding = 0
            self.wiring.stand.release()

    def output(self, text: str) -> tuple[int, str] | None:
        """As `addressed`; an output that does not exist is an error."""
        number, rest = self.addressed(text)
        if not 1 <= number <= len(self.ratings):
            self.note_error("execution_error")
            return None
        return number, rest

    def _switched_off(self) -> None:
        self._feeding = 0

    def _reset(self, argument: str) -> None:
        super()._reset(argument)
        self._all_off()

    def _all_off(self) -> None:
        self._volt = [0.0 for _ in self.ratings]
        self._ampere = [most for _, most in self.ratings]
        self._selected = 1
        self._switched_off()
        self.wiring.stand.release()

    def _set(self, values: list[float], text: str, which: int) -> None:
        found = self.output(text)
        if found is None:
            return
        number, rest = found
        most = self.ratings[number - 1][which]
        words = {"MIN": 0.0, "MAX": most}
        try:
            value = words[rest.upper()] if rest.upper() in words else float(rest)
        except ValueError:
            value = -1.0
        if not 0 <= value <= most:
            self.note_error("execution_error")
            return
        values[number - 1] = value
        self.feed(number)

    def _shown_setting(self, values: list[float], text: str) -> bytes | None:
        found = self.output(text)
        return None if found is None else self.number.format(values[found[0] - 1]).encode()

    def _measured(self, quantity: str, text: str) -> bytes | None:
        found = self.output(text)
        if found is None:
            return None
        number = found[0]
        if number == self._feeding:
            return self.number.format(getattr(self.wiring.stand, quantity)).encode()
        open_volt = self._volt[number - 1] if self.is_on(number) and quantity == "voltage_volt" else 0.0
        return self.number.format(open_volt).encode()

    def _condition(self, output: int) -> int:
        if not self.is_on(output):
            return OFF
        return CONSTANT_CURRENT if output == self._feeding and self.wiring.stand.limited else CONSTANT_VOLTAGE


class SimulatedE36313A(SimulatedSupply):
    """An E36313A: each command names its output in a channel list."""

    profile = "keysight_e36300.yaml"
    ratings = ((6.0, 10.0), (25.0, 2.0), (25.0, 2.0))
    number = "{:+.8E}"

    def commands(self) -> dict[str, Callable[[str], bytes | None]]:
        """Commands that address an output in this family."""
        return {
            **super().commands(),
            "OUTP": self._switch,
            "OUTP?": self._is_on,
            "INST:NSEL": self._select,
            "INST:NSEL?": lambda _: str(self._selected).encode(),
        }

    def is_on(self, output: int) -> bool:
        """Whether an output is on."""
        return self._on[output - 1]

    def addressed(self, text: str) -> tuple[int, str]:
        """`5,(@2)`, `(@2)`, or what is selected."""
        found = re.fullmatch(r"(.*?)\s*,?\s*\(@(\d)\)", text)
        return (int(found[2]), found[1]) if found else (self._selected, text)

    def _switched_off(self) -> None:
        super()._switched_off()
        self._on = [False for _ in self.ratings]

    def _switch(self, text: str) -> None:
        found = self.output(text)
        if found is None:
            return
        number, word = found
        if word.upper() not in ("ON", "OFF", "1", "0"):
            self.note_error("execution_error")
            return
        self._on[number - 1] = word.upper() in ("ON", "1")
        self.feed(number)

    def _is_on(self, text: str) -> bytes | None:
        found = self.output(text)
        return None if found is None else str(int(self.is_on(found[0]))).encode()

    def _select(self, text: str) -> None:
        if text.isdigit() and 1 <= int(text) <= len(self.ratings):
            self._selected = int(text)
        else:
            self.note_error("execution_error")


class SimulatedHmp4040(SimulatedSupply):
    """An HMP4040: an output is selected, activated, and on while the general switch is."""

    profile = "rohde_schwarz_hmp4000.yaml"
    ratings = ((32.0, 10.0),) * 4
    number = "{:.3f}"

    def commands(self) -> dict[str, Callable[[str], bytes | None]]:
        """Commands that address an output in this family."""
        return {
            **super().commands(),
            "INST:NSEL": self._select,
            "INST:NSEL?": lambda _: str(self._selected).encode(),
            "INST": lambda text: self._select(text.upper().removeprefix("OUTP").removeprefix("OUT").removeprefix("UT")),
            "OUTP:SEL": lambda text: self._switch(text, self._selected),
            "OUTP:SEL?": lambda _: str(int(self._active[self._selected - 1])).encode(),
            "OUTP:GEN": lambda text: self._switch(text, 0),
            "OUTP:GEN?": lambda _: str(int(self._general)).encode(),
        }

    def is_on(self, output: int) -> bool:
        """Whether an output is on."""
        return self._general and self._active[output - 1]

    def addressed(self, text: str) -> tuple[int, str]:
        """What is selected."""
        return self._selected, text

    def _switched_off(self) -> None:
        super()._switched_off()
        self._active = [False for _ in self.ratings]
        self._general = False

    def _select(self, text: str) -> None:
        if text.isdigit() and 1 <= int(text) <= len(self.ratings):
            self._selected = int(text)
        else:
            self.note_error("execution_error")

    def _switch(self, text: str, output: int) -> None:
        if text.upper() not in ("ON", "OFF", "1", "0"):
            self.note_error("execution_error")
            return
        on = text.upper() in ("ON", "1")
        if output:
            self._active[output - 1] = on
        else:
            self._general = on
        for number in range(1, len(self.ratings) + 1):
            if number == output or self._active[number - 1]:
                self.feed(number)
