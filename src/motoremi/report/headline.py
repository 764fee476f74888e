"""The results on the first page: errors before and after, where the model fails, the cause, the floor, and the verdicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from motoremi.arrays import JsonDict
from motoremi.emission.compliance import decades
from motoremi.fitting.result import Fit
from motoremi.inspection.compare import Comparison, compare
from motoremi.model.effects.names import as_sum
from motoremi.quantities import percent, show_band
from motoremi.report.contents import Box, Materials, is_result
from motoremi.report.words import (
    described,
    findings_of,
    in_words,
    is_confirmed,
    levels_of,
    mood_of,
    serious_of,
    share_of_analyser,
)

Line = tuple[str, str, str]

FLOOR, SHARE = "Noise and analyser would leave", "Analyser's share"
FOR_ENGINEERS = ("Where it fails", FLOOR, SHARE, "Measure next")
NO_RESULT = "no result: the fit did not converge"


def boxes(materials: Materials, short: bool = False) -> tuple[Box, ...]:
    """One box for the impedance and one for the emission, each with its overall verdict; `short` leaves out details for engineers."""
    found = []
    if materials.session.sweeps or materials.steps:
        box = _impedance(materials)
        found.append(replace(box, lines=tuple(line for line in box.lines if line[0] not in FOR_ENGINEERS)) if short else box)
    if materials.session.spectra or materials.stored("prediction") is not None:
        found.append(_emission(materials))
    return tuple(found) or (Box("No result", (("Measured", "nothing", "bad"),)),)


def _impedance(materials: Materials) -> Box:
    steps, diagnosis = materials.steps, materials.diagnosis
    lines: list[Line] = []
    if steps:
        lines += _before(steps[0])
    if diagnosis is not None:
        lines += _diagnosis_lines(diagnosis, materials.effects)
    if steps:
        lines += [_after(steps[-1], diagnosis), *_beside(steps[-1])]
    if diagnosis is not None:
        lines.append(("Measure next", str(diagnosis["next_measurement"]["why"]), "plain"))
    return Box("Common-mode impedance", tuple(lines), _judged(materials.comparison))


def _before(base: Fit) -> list[Line]:
    label = "Error of the paper's circuit"
    if not is_result(base):
        return [(label, NO_RESULT, "bad")]
    return [
        (label, f"{percent(base.rms_error_percent)} rms ({base.rms_error_db:.2g} dB)", "plain"),
        ("Where it fails", spans(compare(base).where), "plain"),
    ]


def spans(where: Sequence[JsonDict], most: int = 3) -> str:
    """The spans where a model fails, in words."""
    found = [f"{span['sweep']} {show_band(*span['band_hz'])} ({100 * span['share']:.0f} %)" for span in where[:most]]
    return f"{'; '.join(found)} of the squared error beyond the uncertainty" if found else "nowhere beyond the uncertainty"


def _diagnosis_lines(diagnosis: JsonDict, now: Sequence[str]) -> list[Line]:
    start = diagnosis["base"]["effects"]
    label = "Diagnosis" + (f" (of the model with {' + '.join(start)})" if start else "")
    lines: list[Line] = [
        (label, f"{in_words(diagnosis, now)}; confidence {100 * diagnosis['confidence']:.0f} %", mood_of(str(diagnosis["verdict"])))
    ]
    lines += [("Not distinguished", ", ".join(family), "plain") for family in diagnosis["families"]]
    return lines + [(f"Found in the data: {one['id']}", f"{one['why']}; {one['remedy']}", "bad") for one in serious_of(findings_of(diagnosis))]


def _after(last: Fit, diagnosis: JsonDict | None) -> Line:
    """The error after adding the effect: of the current model or, before it is added, as found by the diagnosis."""
    if not last.effects and diagnosis is not None and diagnosis["effects"]:
        model = f"with {as_sum(diagnosis['effects'])}, not added yet"
        error, left = float(diagnosis["best"]["rms_error_percent"]), diagnosis.get("unexplained_percent")
        reached = left is not None and left["value"] <= last.measurement.good_enough_percent
        # A proposed effect is not a result yet, so it is not shown in green.
        return f"Error after ({model})", f"{percent(error)} rms", "plain" if reached else "bad"
    model = f"with {as_sum(last.effects)}" if last.effects else "no effect added"
    if not is_result(last):
        return f"Error after ({model})", NO_RESULT, "bad"
    return f"Error after ({model})", f"{percent(last.rms_error_percent)} rms", "good" if last.explained else "bad"


def _beside(last: Fit) -> list[Line]:
    """What is always shown beside the error of the current model."""
    lines = [(FLOOR, f"{percent(last.floor_percent, 2)} rms, noise alone {percent(last.noise_percent, 2)}", "plain")]
    if is_result(last):
        lines += [(SHARE, text, "plain") for text in [share_of_analyser(last)] if text]
        lines.append(("This circuit", described(last.unexplained_percent), "plain"))
    return lines


def _judged(comparison: Comparison | None) -> Line:
    label = "Model against measurement"
    if comparison is None:
        return label, "not judged", "plain"
    if comparison.passed:
        return label, f"PASS: within {comparison.tolerance.in_words}, or within the measurement's uncertainty, at every point", "good"
    failed = [band for band in comparison.bands if band["verdict"] == "fail"]
    return (
        label,
        f"FAIL in {len(failed)} of {len(comparison.bands)} bands (beyond {comparison.tolerance.in_words} and beyond the measurement's uncertainty)",
        "bad",
    )


def _emission(materials: Materials) -> Box:
    """The spectra against the limit; a verdict on predicted levels has no colour, since nothing was measured."""
    prediction, diagnosis = materials.stored("prediction"), materials.stored("emission-diagnosis")
    if prediction is None:
        return Box("Conducted emission", (), ("Emission", "not judged", "plain"))
    measured = str(prediction["judged_what"]) != "predicted"
    mood = {"pass": "good", "fail": "bad"}.get(str(prediction["verdict"]), "plain") if measured else "plain"
    lines: list[Line] = [
        (_levels(one), _margin(one), "bad" if one["verdict"] == "fail" and measured else "plain")
        for one in prediction["judged"]
        if one["worst_margin_db"] is not None
    ]
    lines += [("Note", str(reason), "plain") for reason in prediction.get("reasons", ())[:1]]
    if diagnosis is not None:
        lines.append(("Diagnosis of the spectra", _emission_cause(diagnosis), "plain"))
    share = _measured_share(prediction)
    of_part = f", on {percent(100 * share, 2)} of the limit's span" if measured and share < 1 else ""
    verdict = f"{str(prediction['verdict']).upper()} ({prediction['judged_what']} levels{of_part})"
    doubt = "" if is_confirmed(prediction["limit"]) else " (values not confirmed)"
    return Box("Conducted emission", tuple(lines), (f"Emission against {prediction['limit']['title']}{doubt}", verdict, mood))


def _measured_share(prediction: JsonDict) -> float:
    """The share of the limit's span in which levels were measured, in decades, of that line and place in which least of it was."""
    gaps: dict[tuple[str, str, str], list[Sequence[float]]] = {}
    for gap in prediction.get("not_measured", ()):
        gaps.setdefault((gap["detector"], gap["conductor"], gap["operating"]), []).append(gap["band_hz"])
    if not gaps:
        return 1.0
    limited = {line["detector"]: decades(segment[:2] for segment in line["segments"]) for line in prediction["limit"]["lines"]}
    return min(1 - decades(spans) / limited[detector] for (detector, *_), spans in gaps.items())


def _levels(judged: JsonDict) -> str:
    name = levels_of(judged).replace("cispr", "CISPR")
    return f"{name[:1].upper()}{name[1:]} levels, {judged['line']} limit"


def _margin(judged: JsonDict) -> str:
    return f"{str(judged['verdict'] or 'no verdict').upper()}: smallest margin {judged['worst_margin_db']:+.1f} dB"


def _emission_cause(diagnosis: JsonDict) -> str:
    return f"{in_words(diagnosis)}; confidence {100 * diagnosis['confidence']:.0f} %"
