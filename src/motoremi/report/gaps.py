"""What was not done or not done well, for the first page: a report that hides its gaps is worse than none."""

from __future__ import annotations

import math
from collections.abc import Iterator

from motoremi.arrays import JsonDict
from motoremi.data.calibration import calibration_doubt
from motoremi.data.session import Session
from motoremi.data.state import marks_of, states_of
from motoremi.fitting.result import Fit
from motoremi.quantities import show_band
from motoremi.report.parts import Materials, is_result, model_name
from motoremi.report.words import findings_of

# A stored diagnosis rounds nothing: a larger difference means that it was made from another fit.
SAME_FIT = 1e-3
# With these findings the diagnosis fitted the same model again: as data of another analyser, or without the points that stand out.
REFITTED = ("not-as-declared", "interference")
# Stored analyses that a report can do without, and how to make them anew; what needs another one comes before it.
STORED = {
    "diagnosis": "motoremi diagnose",
    "emission-diagnosis": "motoremi diagnose --emission",
    "emission": "motoremi diagnose --emission",
    "prediction": "motoremi predict",
}


def gaps(materials: Materials) -> tuple[str, ...]:
    """Everything a reader has to know before believing the rest, each once."""
    session = materials.session
    found = [*_of_the_run(session), *_of_the_set_up(session), *_of_the_analysis(materials)]
    for spectrum in session.spectra:
        count = int(spectrum.overload.sum())
        if count:
            found.append(f"the receiver was overloaded at {count} of {len(spectrum)} points ({spectrum.detector}): they are not judged")
        for part in spectrum.metadata.get("attenuation_raised") or ():
            band = show_band(*part["band_hz"])
            found.append(
                f"the receiver was overloaded ({spectrum.detector}): {band} was measured again with {part['attenuation_db']:g} dB attenuation"
            )
    return tuple(dict.fromkeys(found))


def being_written(session: Session) -> bool:
    """Whether the report is a step of the run that it reports."""
    last = [d for d in session.documents if d["kind"] in ("step-start", "step-stop", "stop")][-1:]
    return bool(last) and last[0]["kind"] == "step-start" and last[0].get("do") == "report"


def planned_steps(session: Session) -> list[tuple[int, str, str, str]]:
    """Number, name, settings and state of every step of the procedure, begun or not."""
    begun = {d.get("step"): d for d in session.documents if d["kind"] == "step-start"}
    ended = {d.get("step") for d in session.documents if d["kind"] == "step-stop"}
    planned = list(_unrolled((session.start.get("procedure") or {}).get("steps", ())))
    total = max([len(planned), *(int(d.get("of") or 0) for d in begun.values())])
    rows = []
    for number in range(1, total + 1):
        document = begun.get(number)
        plan = planned[number - 1] if number <= len(planned) else {}
        settings: JsonDict = document.get("parameters") or {} if document else {k: v for k, v in plan.items() if k != "do"}
        name = str((document or plan).get("do", "not known"))
        if number in ended:
            state = "done"
        elif document is None:
            state = "not begun"
        else:
            state = "this report" if name == "report" and being_written(session) else "not finished"
        rows.append((number, name, ", ".join(f"{key} {value}" for key, value in settings.items()), state))
    return rows


def _unrolled(steps: object) -> Iterator[JsonDict]:
    """Steps as written, those of a repeat as often as they are done."""
    for step in steps if isinstance(steps, list | tuple) else ():
        if isinstance(step, dict) and step.get("do") == "repeat":
            for _ in range(int(step.get("times", 1))):
                yield from _unrolled(step.get("steps"))
        elif isinstance(step, dict):
            yield step


def _of_the_run(session: Session) -> list[str]:
    found = []
    found += [str(remark) for remark in session.start.get("remarks") or ()]
    for document in session.documents:
        if document["kind"] == "maxima" and document.get("more"):
            found.append(f"{document['more']} more maxima are as near to the limit as those that were read again: they were not read")
    if session.start.get("backend") == "sim":
        found.append("simulated bench: no real motor and no real instrument was measured")
    if session.status != "done" and not being_written(session):
        reason = next((str(d["reason"]) for d in reversed(session.documents) if d["kind"] == "stop" and d.get("reason")), "no stop document")
        found.append(f"the run did not end well ({session.status}): {reason}")
    again = [str(d.get("step")) for d in session.documents if d["kind"] == "resume"]
    if again:
        found.append(f"the run was interrupted and went on later (at step {', '.join(again)})")
    steps = planned_steps(session)
    unfinished = [f"{number} ({name})" for number, name, _, state in steps if state == "not finished"]
    if unfinished:
        found.append(f"steps not finished: {', '.join(unfinished)}")
    missed = [f"{number} ({name})" for number, name, _, state in steps if state == "not begun"]
    if missed:
        found.append(f"{len(missed)} of {len(steps)} steps were not begun: {', '.join(missed)}")
    unsafe = [d for d in session.documents if d["kind"] == "safe" and d.get("safe") is False]
    found += [f"{d.get('role')} could not be brought into its safe state: {d.get('problem')}" for d in unsafe]
    found += [f"{file}: {mark}" for file, state in states_of(session.documents) for mark in marks_of(state)]
    return found


def _of_the_set_up(session: Session) -> list[str]:
    found = []
    found += [str(d["says"]) for d in session.documents if d["kind"] == "doubt"]
    # A procedure with an interval of its own was refused where it is exceeded.
    if "calibration_within" not in (session.start.get("procedure") or {}):
        ages = session.start.get("calibration_age_days") or {}
        found += [doubt for role, age in ages.items() if (doubt := calibration_doubt(role, age))]
    if session.start.get("analyser_assumed"):
        found.append("the analyser was not named: the size of its errors is estimated from the data")
    for sweep in session.sweeps:
        compensated = sweep.metadata.get("compensated")
        if isinstance(compensated, list) and not {"open", "short"} <= set(map(str, compensated)):
            found.append(f"{sweep.termination} sweep: the fixture was not compensated with both open and short standard")
    return found


def _of_the_analysis(materials: Materials) -> list[str]:
    session, steps = materials.session, materials.steps
    found = []
    if not session.sweeps:
        found.append("no impedance sweep was measured")
    if not steps:
        found.append("no fit was made")
    else:
        found += [f"the fit of the {model_name(step)} did not converge: it is not shown as a result" for step in steps if not is_result(step)]
        found += steps[-1].warnings
        if is_result(steps[-1]) and steps[-1].undetermined():
            found.append(f"the data do not determine {', '.join(steps[-1].undetermined())}")
    if materials.comparison is None:
        found.append("the model was not compared with the measurement: nothing is judged")
    found += [
        f"the stored {name} was made by another version and cannot be read: {again}"
        for name, again in STORED.items()
        if name in materials.unreadable
    ]
    if materials.diagnosis is None:
        found += [] if "diagnosis" in materials.unreadable else ["no diagnosis was made"]
    elif steps and not _diagnosed(steps, materials.diagnosis):
        found.append("the diagnosis was made from another fit than those shown here: diagnose again")
    if not session.spectra:
        found.append("no emission spectrum was measured")
    elif materials.stored("prediction") is None and "prediction" not in materials.unreadable:
        found.append("the spectra were not held against a limit")
    return found


def _diagnosed(steps: tuple[Fit, ...], diagnosis: JsonDict) -> bool:
    """Whether a diagnosis started from one of the steps."""
    base, refitted = diagnosis["base"], any(finding["id"] in REFITTED for finding in findings_of(diagnosis))
    return any(
        list(step.effects) == base["effects"] and (refitted or math.isclose(step.rms_error_percent, base["rms_error_percent"], rel_tol=SAME_FIT))
        for step in steps
    )
