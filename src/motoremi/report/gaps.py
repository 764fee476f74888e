"""What was not done, or not done well: listed on the first page."""

from __future__ import annotations

import math

from motoremi.arrays import JsonDict
from motoremi.data.calibration import calibration_doubt
from motoremi.data.declaration import is_compensated
from motoremi.data.origin import measured_on
from motoremi.data.session import Session, is_up_to_date
from motoremi.data.state import marks_of, states_of
from motoremi.fitting.result import Fit
from motoremi.quantities import show_band
from motoremi.report.contents import Materials, is_result, model_name
from motoremi.report.equipment import not_stated, overdue
from motoremi.report.identity import how_many, imported_files, measured_items
from motoremi.report.steps import being_written, planned_steps
from motoremi.report.words import findings_of

# Stored values are not rounded: a larger difference means that the diagnosis was made from another fit.
SAME_FIT = 1e-3
# With these findings the diagnosis fitted the same model again, with another analyser or without outliers.
REFITTED = ("not-as-declared", "interference")
# Stored analyses that a report can leave out, and the command that makes them again; each stands before those it depends on.
STORED = {
    "diagnosis": "motoremi diagnose",
    "emission-diagnosis": "motoremi diagnose --emission",
    "emission": "motoremi diagnose --emission",
    "prediction": "motoremi predict",
}


def gaps(materials: Materials) -> tuple[str, ...]:
    """Every limitation that a reader has to know, each once."""
    session = materials.session
    found = [*of_the_run(session), *_of_the_import(session), *_of_the_set_up(session), *overdue(materials), *_of_the_analysis(materials)]
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


def of_the_run(session: Session) -> list[str]:
    """What the run itself says of its end and of its gaps."""
    found = []
    found += [str(remark) for remark in session.start.get("remarks") or ()]
    for document in session.documents:
        if document["kind"] == "maxima" and document.get("more"):
            found.append(f"{document['more']} more maxima are as near to the limit as those that were measured again: they were not measured")
    if session.start.get("backend") == "sim":
        found.append("simulated bench: no real motor and no real instrument was measured")
    elif session.simulated:
        found.append("simulated data: they come from a simulated bench, no real motor and no real instrument was measured")
    if session.status != "done" and not being_written(session):
        reason = next((str(d["reason"]) for d in reversed(session.documents) if d["kind"] == "stop" and d.get("reason")), "no stop document")
        found.append(f"the run did not end normally ({session.status}): {reason}")
    again = [_resumption(d, session.start.get("operator")) for d in session.documents if d["kind"] == "resume"]
    if again:
        found.append(f"the run was interrupted and resumed later (at step {', '.join(again)})")
    steps = planned_steps(session)
    unfinished = [f"{number} ({name})" for number, name, _, state in steps if state == "not finished"]
    if unfinished:
        found.append(f"steps not finished: {', '.join(unfinished)}")
    missed = [f"{number} ({name})" for number, name, _, state in steps if state == "not begun"]
    if missed:
        found.append(f"{len(missed)} of {len(steps)} steps were not begun: {', '.join(missed)}")
    unsafe = [d for d in session.documents if d["kind"] == "safe" and d.get("safe") is False]
    found += [f"{d.get('role')} could not be brought into its safe state: {d.get('problem')}" for d in unsafe]
    found += [f"{file}: {mark}" for file, state in states_of(session.used_documents) for mark in marks_of(state)]
    found += [f"{one['name']} was measured and withdrawn on {str(one['time'])[:10]}: {one['why']}" for one in session.withdrawn]
    return found


def _resumption(document: JsonDict, began: object) -> str:
    """The step at which a run was resumed, and by whom if another person began it."""
    by = document.get("operator")
    return f"{document.get('step')}" + (f" by {by}" if by and by != began else "")


def _of_the_import(session: Session) -> list[str]:
    files = imported_files(session)
    if not files:
        return []
    found = [f"imported: the data were read from {how_many(files)}; motoremi neither controlled the instruments nor knows their settings"]
    items = measured_items(session)
    undated = list(dict.fromkeys(str(item.metadata.get("source", "-")) for item in items if not measured_on(item.metadata)))
    if undated:
        what = "the files do" if len(undated) == len(set(files)) else f"{', '.join(undated)}: the header does"
        found.append(f"{what} not say when the data were measured")
    assumed = [name for key, name in (("detector_assumed", "detector"), ("rbw_assumed", "bandwidth")) if any(i.metadata.get(key) for i in items)]
    if assumed:
        found.append(f"the files do not state {' and '.join(assumed)} of the spectra: the usual ones are assumed")
    changed = {str(change) for item in items for change in item.metadata.get("changes") or ()}
    return found + [f"changed on import: {change}" for change in sorted(changed)]


def _of_the_set_up(session: Session) -> list[str]:
    found = [str(d["says"]) for d in session.documents if d["kind"] == "doubt"]
    # A run whose procedure states an interval is refused when it is exceeded.
    if "calibration_within" not in (session.start.get("procedure") or {}):
        ages = session.start.get("calibration_age_days") or {}
        # A bench file may state dates for instruments that this procedure does not use.
        used = {document.get("role") for document in session.documents if document["kind"] == "instrument"}
        found += [doubt for role, age in ages.items() if (role in used or not used) and (doubt := calibration_doubt(role, age))]
    if session.start.get("analyser_assumed"):
        found.append("the analyser was not named: the size of its errors is estimated from the data")
    for sweep in session.sweeps:
        if isinstance(sweep.metadata.get("compensated"), list) and not is_compensated(sweep):
            found.append(f"{sweep.termination} sweep: the fixture was not compensated with both open and short standard")
    return found


def _of_the_analysis(materials: Materials) -> list[str]:
    session, steps = materials.session, materials.steps
    found = [f"not stated: {', '.join(missing)}"] if (missing := not_stated(materials)) else []
    if not session.sweeps:
        found.append("no impedance sweep was measured")
    elif not steps:
        found.append("no fit was made")
    if steps:
        found += [f"the fit of the {model_name(step)} did not converge: it is not shown as a result" for step in steps if not is_result(step)]
        found += steps[-1].warnings
        if is_result(steps[-1]) and steps[-1].undetermined():
            found.append(f"the data do not determine {', '.join(steps[-1].undetermined())}")
    if materials.comparison is None and session.sweeps:
        found.append("the model was not compared with the measurement: nothing is judged")
    found += [
        f"the stored {name} was made by another version and cannot be read: {again}"
        for name, again in STORED.items()
        if name in materials.unreadable
    ]
    if materials.diagnosis is None:
        found += ["no diagnosis was made"] if session.sweeps and "diagnosis" not in materials.unreadable else []
    elif materials.diagnosis == session.analysis("diagnosis") and not is_up_to_date(session):
        found.append("sweeps or values were added after the diagnosis, which is shown as it was: diagnose again")
    elif steps and not _diagnosed(steps, materials.diagnosis):
        found.append("the diagnosis was made from another fit than those shown here: diagnose again")
    if not session.spectra:
        found.append("no emission spectrum was measured")
    elif materials.stored("prediction") is None and "prediction" not in materials.unreadable:
        found.append("the spectra were not judged against a limit")
    return found


def _diagnosed(steps: tuple[Fit, ...], diagnosis: JsonDict) -> bool:
    """Whether a diagnosis started from one of the steps."""
    base, refitted = diagnosis["base"], any(finding["id"] in REFITTED for finding in findings_of(diagnosis))
    return any(
        list(step.effects) == base["effects"] and (refitted or math.isclose(step.rms_error_percent, base["rms_error_percent"], rel_tol=SAME_FIT))
        for step in steps
    )
