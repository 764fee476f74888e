"""Results in words, the same on every surface: verdicts, findings, and the circuit's error beside what noise and analyser would leave."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Literal, TypeAlias

from motoremi.arrays import JsonDict
from motoremi.fitting.result import Fit
from motoremi.quantities import show_band

Mood: TypeAlias = Literal["good", "bad", "plain"]

# What a verdict says, and how it looks.
_VERDICTS: Mapping[str, tuple[str, Mood]] = {
    "adequate": ("nothing is missing beyond the noise and the analyser's own uncertainty", "good"),
    "missing-effect": ("missing from the model: {named}", "plain"),
    "family": ("missing from the model: {named}, or another that these data cannot tell from it", "plain"),
    "instrument": ("the meter or its fixture explains the error, not the motor", "plain"),
    "data": ("the data contradict themselves too much to judge the motor", "bad"),
    "unexplained": ("something is missing and nothing in the catalogue explains it", "bad"),
}
# Stands on every page.
SIMULATED = "SIMULATED DATA: no real motor was measured"
# Plain numbers between these are written out.
LEAST_PLAIN, MOST_PLAIN = 1e-3, 1e4
FAR = 1000
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
# Nobody asks for more.
FINEST_PERCENT = 0.01
# Units behind a number, which other programs read without a letter of another alphabet.
_SYMBOLS = (
    (re.compile(r"([\d.] ?[a-zA-Z]?)Ohm\b"), r"\1Ω"),
    (re.compile(r"(\d ?)u([HFsAVmΩ])\b"), r"\1µ\2"),
    (re.compile(r"dBuV\b"), "dBµV"),
)


def number(value: float | None, digits: int = 3) -> str:
    """A plain number: no powers of ten but large and small ones, and those by three; a dash where there is none."""
    if value is None or not math.isfinite(value):
        return "-"
    if value == 0 or LEAST_PLAIN <= abs(value) < MOST_PLAIN:
        return f"{float(f'{value:.{digits}g}'):.10g}"
    power = 3 * math.floor(math.log10(abs(value)) / 3 + 1e-9)
    return f"{value / 10**power:.{digits}g} × 10{str(power).translate(_RAISED)}"


def lag(delta_bic: float | None) -> str:
    """How far behind a candidate lies; beyond a thousand nobody asks."""
    return f"> {FAR:g}" if delta_bic is not None and delta_bic > FAR else number(delta_bic)


def in_words(diagnosis: JsonDict) -> str:
    """The verdict as a sentence."""
    verdict, named = str(diagnosis["verdict"]), " and ".join(diagnosis["effects"])
    # One that this version does not know stands as it was stored.
    text = _VERDICTS.get(verdict, (f"{verdict}: {{named}}" if named else verdict, "plain"))[0]
    if verdict == "adequate" and diagnosis.get("accuracy_percent"):
        return f"{text}, or within the accuracy of {diagnosis['accuracy_percent']:g} % that was stated"
    if verdict == "instrument" and named:
        return f"{text}: {named}"
    return text.replace("{named}", named)


def probability_of(candidate: JsonDict, diagnosis: JsonDict) -> float:
    """How probable an effect, or a set of them, is; where no effect explains it, at most as probable as the verdict is wrong."""
    left = 1.0 - float(diagnosis["confidence"]) if diagnosis["verdict"] == "unexplained" else 1.0
    return left * float(candidate["probability"])


def in_symbols(text: str) -> str:
    """A text with its units as they are printed: 18.87 µH, 21.1 Ω, 60 dBµV."""
    for written, printed in _SYMBOLS:
        text = written.sub(printed, text)
    return text


def mood_of(verdict: str) -> Mood:
    """How a verdict looks."""
    return _VERDICTS.get(verdict, ("", "plain"))[1]


def findings_of(diagnosis: JsonDict) -> list[JsonDict]:
    """What the data themselves show, the serious first; a diagnosis of an earlier version has none."""
    return sorted(diagnosis.get("findings", ()), key=lambda finding: not finding["serious"])


def reasons_of(diagnosis: JsonDict) -> list[str]:
    """The reasons that are not findings."""
    found = {finding["why"] for finding in findings_of(diagnosis)}
    return [str(reason) for reason in diagnosis["reasons"] if reason not in found]


def place_of(finding: JsonDict) -> str:
    """Where a finding is: sweep and band, as far as it has them."""
    band = finding["band_hz"]
    parts = [*([f"{finding['sweep']} sweep"] if finding["sweep"] else []), *([show_band(*band)] if band and band[0] < band[1] else [])]
    return ", ".join(parts) or "all sweeps"


def serious_of(findings: Sequence[JsonDict]) -> list[JsonDict]:
    """Findings without which the verdict would or could be another."""
    return [finding for finding in findings if finding["serious"]]


def described(left: Mapping[str, float]) -> str:
    """How well the circuit describes the motor, from `unexplained_percent`."""
    if not left["value"]:
        return f"describes your motor down to noise and analyser (95 %: to {max(left['high'], FINEST_PERCENT):.2g} % or better)"
    return f"describes your motor to {left['value']:.2g} % (95 %: {left['low']:.2g} - {left['high']:.2g} %)"


def would_leave(floor_percent: float, noise_percent: float) -> str:
    """What a perfect model would leave."""
    return f"noise and analyser would leave {floor_percent:.2g} %, noise alone {noise_percent:.2g} %"


def share_of_analyser(fit: Fit) -> str:
    """What the error would be without the analyser's, and how far that had to go; empty for an ideal one."""
    analyser = fit.measurement.analyser
    if analyser.ideal:
        return ""
    named = "what an analyser may do that nobody named" if analyser.name == "unknown" else f"what a {analyser.name} is declared to do"
    return f"with the analyser's likely error taken off {fit.corrected_error_percent:.3g} % ({fit.analyser_sigma:.1f} sigma of {named})"


def beside_the_error(fit: Fit) -> tuple[str, ...]:
    """What has to stand beside the error of a model."""
    texts = (would_leave(fit.floor_percent, fit.noise_percent), share_of_analyser(fit), f"the circuit {described(fit.unexplained_percent)}")
    return tuple(text for text in texts if text)
