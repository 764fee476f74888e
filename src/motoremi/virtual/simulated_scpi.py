"""SCPI spelling and status, for the simulated instruments that speak it."""

from __future__ import annotations

import re
from collections.abc import Callable

from motoremi.virtual.simulated_device import SimulatedDevice

SCPI_VERSION = b"1999.0"
# Bits of the operation status register.
MEASURING = 16


class SimulatedScpi(SimulatedDevice):
    """An instrument that accepts long and short forms in any case, numeric suffixes, and headers without optional nodes."""

    LEARN_PREFIX = ":"
    # `INIT:IMM` is `INIT`, `TRAC:DATA?` is `TRAC?`, `DISP:WIND:TRAC` is `DISP:TRAC`.
    IMPLIED_NODES = frozenset({"IMM", "NEXT", "DATA", "RES", "EVEN", "LEV", "AMPL", "STAT", "WIND"})

    def commands(self) -> dict[str, Callable[[str], bytes | None]]:
        """Commands of every SCPI instrument (SCPI-99, volume 2, chapters 20 and 21)."""
        return {
            "SYST:VERS?": lambda _: SCPI_VERSION,
            "SYST:ERR:ALL?": lambda _: self._all_errors(),
            "SYST:ERR:COUN?": lambda _: str(len(self.errors.entries)).encode(),
            "STAT:PRES": lambda _: None,
            "STAT:OPER:COND?": lambda _: str(MEASURING if self.busy_until() > self.clock.now() else 0).encode(),
            "STAT:QUES:COND?": lambda _: b"0",
        }

    def _all_errors(self) -> bytes:
        """All entries of the error queue, which is then empty."""
        entries = [self.errors.pop()]
        while self.errors.entries:
            entries.append(self.errors.pop())
        return b",".join(entries)

    def fold(self, header: str) -> str:
        """Long forms to short forms, without implied nodes and suffix 1; `SENSe` may be left out."""
        query = "?" if header.endswith("?") else ""
        nodes = [_without_suffix_1(short_form(node)) for node in header.upper().strip(":").removesuffix("?").split(":")]
        if nodes[0] == "SENS" and len(nodes) > 1:
            nodes = nodes[1:]
        return ":".join(nodes[:1] + [node for node in nodes[1:] if node not in self.IMPLIED_NODES]) + query

    def fold_word(self, word: str) -> str:
        """Long forms to short forms."""
        return short_form(word.upper())

    def status_byte(self) -> int:
        """Bit 2: the error queue is not empty; bit 6: service is requested."""
        summary = super().status_byte() | (4 if self.errors.entries else 0)
        return summary | (64 if summary & int(self.value("service_mask")) else 0)


def short_form(node: str) -> str:
    """Four letters, three if the fourth is a vowel; digits behind them stay."""
    letters = node.rstrip("0123456789")
    if not letters.isalpha() or len(letters) <= 4:
        return node
    return letters[: 3 if letters[3] in "AEIOU" else 4] + node[len(letters) :]


def _without_suffix_1(node: str) -> str:
    return re.sub(r"(?<=[A-Z])1$", "", node)
