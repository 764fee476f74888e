"""Results in words, the same for command, page and report: verdicts, findings, errors with the floor, numbers and units."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Literal, TypeAlias

from motoremi.arrays import JsonDict
from motoremi.diagnosis.belief import after_verdict
from motoremi.emission.judge import levels_in_words
from motoremi.fitting.result import MUCH_PERCENT, Fit
from motoremi.quantities import percent, percent_span, show_band

Mood: TypeAlias = Literal["good", "bad", "plain"]

# The sentence of each verdict, and its mood.
_VERDICTS: Mapping[str, tuple[str, Mood]] = {
    "adequate": ("nothing is missing beyond the noise and the analyser's own uncertainty", "good"),
    "missing-effect": ("missing from the model: {named}", "plain"),
    "family": ("missing from the model: {named}, or another that these data cannot distinguish from it", "plain"),
    "instrument": ("the meter or its fixture explains the error, not the motor", "plain"),
    "data": ("the data contradict themselves too much to judge the motor", "bad"),
    "unexplained": ("something is missing and nothing in the catalogue explains it", "bad"),
}
# Shown on every page.
SIMULATED = "SIMULATED DATA: no real motor was measured"
# Numbers in this range are written without a power of ten.
LEAST_PLAIN, MOST_PLAIN = 1e-3, 1e4
FAR = 1000
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
# Smaller values are shown as this one.
FINEST_PERCENT = 0.01
# An error that the analyser may make of the impedance itself: above it a circuit cannot be judged by its error.
LARGEST_PERCENT = 100.0
# ASCII units after a number, as in files, and the symbols shown for them.
_SYMBOLS = (
    (re.compile(r"([\d.] ?[a-zA-Z]?)Ohm\b"), r"\1Ω"),
    (re.compile(r"(\d ?)u([HFsAVmΩ])\b"), r"\1µ\2"),
    (re.compile(r"dBuV\b"), "dBµV"),
)


def number(value: float | None, digits: int = 3) -> str:
    """A number without a unit; very large and small ones with a power of ten that is a multiple of three, None as a dash."""
    if value is None or not math.isfinite(value):
        return "-"
    if value == 0 or LEAST_PLAIN <= abs(value) < MOST_PLAIN:
        return f"{float(f'{value:.{digits}g}'):.10g}"
    power = 3 * math.floor(math.log10(abs(value)) / 3 + 1e-9)
    return f"{value / 10**power:.{digits}g} × 10{str(power).translate(_RAISED)}"


def lag(delta_bic: float | None) -> str:
    """A ΔBIC; values above a thousand are not shown exactly."""
    return f"> {FAR:g}" if delta_bic is not None and delta_bic > FAR else number(delta_bic)


def in_words(diagnosis: JsonDict, now: Sequence[str] = ()) -> str:
    """The verdict as a sentence; `now` are the effects of the model as it is, to which those that were named may have been added."""
    verdict, named = str(diagnosis["verdict"]), " and ".join(diagnosis["effects"])
    if named and verdict in ("missing-effect", "family") and set(diagnosis["effects"]) <= set(now):
        named += " (now in the model)"
    # An unknown verdict, of another version, is shown as stored.
    text = _VERDICTS.get(verdict, (f"{verdict}: {{named}}" if named else verdict, "plain"))[0]
    if verdict == "adequate" and diagnosis.get("accuracy_percent"):
        return f"{text}, or within the accuracy of {diagnosis['accuracy_percent']:g} % that was stated"
    if verdict == "instrument" and named:
        return f"{text}: {named}"
    return text.replace("{named}", named)


def probability_of(candidate: JsonDict, diagnosis: JsonDict) -> float:
    """The probability of an effect or a set of effects that a stored diagnosis holds."""
    return after_verdict(float(candidate["probability"]), str(diagnosis["verdict"]), float(diagnosis["confidence"]))


def in_symbols(text: str) -> str:
    """A text with symbols in place of ASCII units: 18.87 µH, 21.1 Ω, 60 dBµV."""
    for written, printed in _SYMBOLS:
        text = written.sub(printed, text)
    return text


def mood_of(verdict: str) -> Mood:
    """The mood of a verdict."""
    return _VERDICTS.get(verdict, ("", "plain"))[1]


def findings_of(diagnosis: JsonDict) -> list[JsonDict]:
    """The findings of a diagnosis, serious ones first; diagnoses of earlier versions have none."""
    return sorted(diagnosis.get("findings", ()), key=lambda finding: not finding["serious"])


def reasons_of(diagnosis: JsonDict) -> list[str]:
    """The reasons of a diagnosis that are not findings."""
    found = {finding["why"] for finding in findings_of(diagnosis)}
    return [str(reason) for reason in diagnosis["reasons"] if reason not in found]


def levels_of(judged: JsonDict) -> str:
    """Detector, line of the LISN and operating state of judged levels; earlier versions stored the detector only."""
    return levels_in_words(str(judged["detector"]), judged.get("conductor", ""), judged.get("operating", ""))


def is_confirmed(limit: JsonDict) -> bool:
    """Whether all values of a stored limit were checked; earlier versions stored its name only."""
    return all(line["confirmed"] for line in limit.get("lines", ()))


def place_of(finding: JsonDict) -> str:
    """The sweep and band of a finding, as far as stated."""
    band = finding["band_hz"]
    parts = [*([f"{finding['sweep']} sweep"] if finding["sweep"] else []), *([show_band(*band)] if band and band[0] < band[1] else [])]
    return ", ".join(parts) or "all sweeps"


def serious_of(findings: Sequence[JsonDict]) -> list[JsonDict]:
    """The serious findings: without them the verdict might be another."""
    return [finding for finding in findings if finding["serious"]]


def described(left: Mapping[str, float]) -> str:
    """How well the circuit describes the motor, from `unexplained_percent`."""
    if not left["value"]:
        return f"describes your motor down to noise and analyser (95 %: to {percent(max(left['high'], FINEST_PERCENT), 2)} or better)"
    span = f"{percent(left['value'], 2)} (95 %: {percent_span(left['low'], left['high'], 2)})"
    # "Describes it to 90 %" would be read as a success.
    return f"describes your motor to {span}" if left["value"] < MUCH_PERCENT else f"does not describe your motor: undescribed {span}"


def would_leave(floor_percent: float, noise_percent: float) -> str:
    """The error that a perfect model would leave."""
    beyond = " (more than the impedance itself: this analyser hardly measures it)" if floor_percent > LARGEST_PERCENT else ""
    return f"noise and analyser would leave {percent(floor_percent, 2)}{beyond}, noise alone {percent(noise_percent, 2)}"


def share_of_analyser(fit: Fit) -> str:
    """The error after subtracting the analyser's most likely error, and that error's size; empty for an ideal analyser."""
    analyser = fit.measurement.analyser
    if analyser.ideal:
        return ""
    declared = f"the declared errors of the {analyser.name}" if analyser.named else "the errors expected of an unknown analyser"
    left = fit.corrected_error_percent
    corrected = percent(left) if left >= FINEST_PERCENT else f"less than {percent(FINEST_PERCENT)}"
    return f"with the analyser's most likely error subtracted {corrected} ({fit.analyser_sigma:.1f} sigma of {declared})"


def beside_the_error(fit: Fit) -> tuple[str, ...]:
    """What is always shown beside the error of a model."""
    texts = (would_leave(fit.floor_percent, fit.noise_percent), share_of_analyser(fit), f"the circuit {described(fit.unexplained_percent)}")
    return tuple(text for text in texts if text)
