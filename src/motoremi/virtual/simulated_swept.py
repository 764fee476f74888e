"""The simulated spectrum analysers: sweeps of a limited number of points, filters, options and each maker's way of sending a trace."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import numpy as np

from motoremi.arrays import FloatArray
from motoremi.virtual.simulated_receiver import SimulatedReceiver, read_off_the_band

# Words of these instruments for the 6 dB EMI filter, and for the detectors that need it.
EMI_WORDS = frozenset({"ON", "1", "EMI", "CISP"})
WEIGHTING_WORDS = frozenset({"QPE", "QUAS", "EAV", "RAV"})
EMI_FILTERS_HZ = (200.0, 9e3, 120e3, 1e6)
GAUSS_FILTERS_HZ = tuple(base * 10.0**decade for decade in range(7) for base in (1.0, 3.0))
# Detectors by the words of the other receivers.
SAME_DETECTOR = {"VAV": "AVER", "QUAS": "QPE"}
INPUT_OVERLOAD = 16


class SimulatedSwept(SimulatedReceiver):
    """A spectrum analyser whose input is connected to a test stand."""

    IMPLIED_NODES = SimulatedReceiver.IMPLIED_NODES | {"RF", "FUNC", "SCAL"}
    # Of one sweep, where they cannot be set.
    points: ClassVar[int] = 0
    trace_name: ClassVar[str] = "TRACE1"

    def commands(self) -> dict[str, Callable[[str], bytes | None]]:
        """What the analyser computes."""
        return {
            **super().commands(),
            "INIT": lambda _: self._sweep(),
            "ABOR": lambda _: self.stop(),
            "CONF:SAN": lambda _: self.stop(),
            "TRAC?": self._trace,
        }

    def fold(self, header: str) -> str:
        """`BAND` is `BWID`, `FORM:TRAC` is `FORM`."""
        folded = super().fold(header)
        if folded.startswith("BAND"):
            return "BWID" + folded[4:]
        return "FORM" + folded[9:] if folded.startswith("FORM:TRAC") else folded

    def arriving(self, frequency_hz: FloatArray, detector: str) -> FloatArray:
        """Level at the input, interpolated from one scan of the band."""
        return read_off_the_band(self.wiring, frequency_hz, detector)

    def correction_db(self) -> float:
        """Amplitude corrections and the offset of the reference level."""
        return super().correction_db() + float(self.value("level_offset"))

    def trace(self, levels: FloatArray) -> str:
        """Levels as this instrument writes them."""
        return ",".join(f"{level:.6e}" for level in levels)

    def _has_emi_filter(self) -> bool:
        return self.value("filter") in EMI_WORDS

    def assign(self, name: str, argument: str) -> None:
        """Set a value, as a message says it."""
        word = self.fold_word(argument)
        lacks_option = name == "filter" and word in EMI_WORDS and self.value("emi_option") != "ON"
        if lacks_option or (name == "detector" and word in WEIGHTING_WORDS and not self._has_emi_filter()):
            self.note_error("execution_error")
            return
        super().assign(name, argument)
        if name in ("filter", "bandwidth"):
            filters_hz = EMI_FILTERS_HZ if self._has_emi_filter() else GAUSS_FILTERS_HZ
            asked_hz = float(self.value("bandwidth"))
            self.set_value("bandwidth", min(filters_hz, key=lambda hz: abs(hz - asked_hz)))

    def _sweep(self) -> None:
        if self.has("mode") and self.value("mode") != "SA":
            self.note_error("execution_error")
            return
        points = int(self.value("points")) if self.has("points") else self.points
        frequency_hz = np.linspace(float(self.value("start")), float(self.value("stop")), points)
        word = str(self.value("detector"))
        preamplifier = self.value("preamplifier") == "ON"
        attenuation_db, duration_s = float(self.value("attenuation")), float(self.value("sweep_time"))
        span_hz = max(float(frequency_hz[-1] - frequency_hz[0]), 1.0)
        within_s = duration_s * min(1.0, float(self.value("bandwidth")) / span_hz)
        self.measure(frequency_hz, SAME_DETECTOR.get(word, word), attenuation_db, preamplifier, duration_s, within_s)

    def _trace(self, argument: str) -> bytes | None:
        if argument.upper() != self.trace_name or self.value("format") != "ASC":
            self.note_error("execution_error")
            return None
        return self.trace(self.levels(self.value("unit"))).encode()


class SimulatedDSA800(SimulatedSwept):
    """A DSA815: 601 points, text in a block."""

    profile = "rigol_dsa800.yaml"
    points = 601

    def trace(self, levels: FloatArray) -> str:
        """A block of nine digits, commas and spaces between the levels."""
        text = ", ".join(f"{level:.6e}" for level in levels)
        return f"#9{len(text) + 1:09d} {text}"


class SimulatedRSA(SimulatedSwept):
    """An RSA5065N, which sweeps only after it has been switched from real-time to swept mode."""

    profile = "rigol_rsa.yaml"


class SimulatedSSA3000X(SimulatedSwept):
    """An SSA3021X: 751 points, a comma behind the last one."""

    profile = "siglent_ssa3000x.yaml"
    points = 751
    trace_name = "1"

    def trace(self, levels: FloatArray) -> str:
        """Levels, each with a comma behind it."""
        return "".join(f"{level:.6e}," for level in levels)


class SimulatedXSeries(SimulatedSwept):
    """An N9010A with its integrity register and the gain of an external preamplifier."""

    profile = "keysight_xseries.yaml"

    def commands(self) -> dict[str, Callable[[str], bytes | None]]:
        """What the analyser computes."""
        registers: dict[str, Callable[[str], bytes | None]] = {
            "STAT:QUES:INT?": lambda _: str(INPUT_OVERLOAD if self.read_overload() != b"0" else 0).encode(),
            "STAT:QUES:INT:COND?": lambda _: b"0",
        }
        return super().commands() | registers

    def correction_db(self) -> float:
        """Correction without the gain of an external preamplifier."""
        return super().correction_db() - float(self.value("external_gain"))
