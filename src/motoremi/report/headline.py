"""The first lines of the first page: how wrong, where, why, how wrong after, and what is left to noise."""

from __future__ import annotations

from collections.abc import Sequence

from motoremi.arrays import JsonDict
from motoremi.diagnosis.compare import Comparison, compare
from motoremi.fitting.result import Fit
from motoremi.quantities import show_band
from motoremi.report.parts import Materials, is_result
from motoremi.report.words import described, findings_of, in_words, mood_of, serious_of, share_of_analyser

Line = tuple[str, str, str]

NO_RESULT = "no result: the fit did not converge"


def headline(materials: Materials) -> tuple[Line, ...]:
    """Label, text and mood ("good", "bad" or "plain") of each line."""
    steps, diagnosis = materials.steps, materials.diagnosis
    lines: list[Line] = []
    if steps:
        lines += _before(steps[0])
    if diagnosis is not None:
        lines += _diagnosis_lines(diagnosis)
    if steps:
        lines += [_after(steps[-1], diagnosis), *_beside(steps[-1])]
    lines.append(_judged(materials.comparison))
    prediction = materials.stored("prediction")
    if prediction is not None:
        lines.append(_emission(prediction))
    if diagnosis is not None:
        lines.append(("Measure next", str(diagnosis["next_measurement"]["why"]), "plain"))
    return tuple(lines)


def _before(base: Fit) -> list[Line]:
    label = "Error of the paper's circuit"
    if not is_result(base):
        return [(label, NO_RESULT, "bad")]
    return [
        (label, f"{base.rms_error_percent:.3g} % rms ({base.rms_error_db:.2g} dB)", "plain"),
        ("Where it fails", spans(compare(base).where), "plain"),
    ]


def spans(where: Sequence[JsonDict], most: int = 3) -> str:
    """Where a model fails, in words."""
    found = [f"{span['sweep']} {show_band(*span['band_hz'])} ({100 * span['share']:.0f} %)" for span in where[:most]]
    return f"{'; '.join(found)} of the squared error" if found else "nowhere beyond the uncertainty"


def _diagnosis_lines(diagnosis: JsonDict) -> list[Line]:
    start = diagnosis["base"]["effects"]
    label = "Diagnosis" + (f" (of the model with {' + '.join(start)})" if start else "")
    lines: list[Line] = [(label, f"{in_words(diagnosis)}; confidence {100 * diagnosis['confidence']:.0f} %", mood_of(str(diagnosis["verdict"])))]
    lines += [("Not told apart", ", ".join(family), "plain") for family in diagnosis["families"]]
    return lines + [(f"Found in the data: {one['id']}", f"{one['why']}; {one['remedy']}", "bad") for one in serious_of(findings_of(diagnosis))]


def _after(last: Fit, diagnosis: JsonDict | None) -> Line:
    """The error after the effect: of the model that stands, or, before it is added, what the diagnosis found it would be."""
    if not last.effects and diagnosis is not None and diagnosis["effects"]:
        model = f"with {' + '.join(diagnosis['effects'])}, not added yet"
        error, left = float(diagnosis["best"]["rms_error_percent"]), diagnosis.get("unexplained_percent")
        reached = left is not None and left["value"] <= last.measurement.good_enough_percent
    else:
        model = f"with {' + '.join(last.effects)}" if last.effects else "no effect added"
        error, reached = last.rms_error_percent, last.explained
        if not is_result(last):
            return f"Error after ({model})", NO_RESULT, "bad"
    return f"Error after ({model})", f"{error:.3g} % rms", "good" if reached else "bad"


def _beside(last: Fit) -> list[Line]:
    """What has to stand beside the error of the model that stands."""
    lines = [("Noise and analyser would leave", f"{last.floor_percent:.2g} % rms, noise alone {last.noise_percent:.2g} %", "plain")]
    if is_result(last):
        lines += [("Analyser's share", text, "plain") for text in [share_of_analyser(last)] if text]
        lines.append(("This circuit", described(last.unexplained_percent), "plain"))
    return lines


def _judged(comparison: Comparison | None) -> Line:
    label = "Model against measurement"
    if comparison is None:
        return label, "not judged", "plain"
    if comparison.passed:
        return label, f"PASS: within {tolerance(comparison)} at every point", "good"
    failed = [band for band in comparison.bands if band["verdict"] == "fail"]
    return label, f"FAIL in {len(failed)} of {len(comparison.bands)} bands (tolerance {tolerance(comparison)} at every point)", "bad"


def _emission(prediction: JsonDict) -> Line:
    """The spectra against the limit."""
    mood = {"pass": "good", "fail": "bad"}.get(str(prediction["verdict"]), "plain")
    return f"Emission against {prediction['limit']['title']}", f"{str(prediction['verdict']).upper()} ({prediction['judged_what']} levels)", mood


def tolerance(comparison: Comparison) -> str:
    """What the error may be, in words."""
    limits = comparison.tolerance
    pairs = ((limits.error_percent, "% error"), (limits.magnitude_db, "dB of magnitude"), (limits.phase_deg, "deg of phase"))
    return ", ".join(f"{value:g} {unit}" for value, unit in pairs if value is not None)
