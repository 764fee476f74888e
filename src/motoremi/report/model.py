"""The report as plain data, from which every output format is rendered without further computation."""

from __future__ import annotations

import dataclasses
import hashlib

from motoremi.arrays import JsonDict
from motoremi.data.conditions import SingleValue
from motoremi.data.session import Session
from motoremi.report.all_sections import all_sections
from motoremi.report.contents import Choice, Letterhead, Materials, Picture, Report, Section, Table, is_result
from motoremi.report.emission_section import rule_of
from motoremi.report.equipment import equipment_of
from motoremi.report.gaps import gaps
from motoremi.report.headline import boxes
from motoremi.report.identity import imported_files, measured_when, report_facts, stated_utc
from motoremi.report.kinds import SECTIONS
from motoremi.report.short import short_sections
from motoremi.report.steps import planned_steps
from motoremi.report.words import SIMULATED

__all__ = ["Choice", "Materials", "Picture", "Report", "Section", "Table", "build_report", "session_hash"]

WHOLE = Choice()
SHORT_PAGES = 2


def build_report(materials: Materials, choice: Choice = WHOLE) -> Report:
    """Make the report of a session."""
    if materials.steps and not is_result(materials.steps[-1]):
        # A fit that did not converge has no verdict.
        materials = dataclasses.replace(materials, comparison=None)
    session, laboratory = materials.session, materials.laboratory
    start = session.start
    digest = session_hash(session)
    number = str(materials.issue["number"]) if materials.issue is not None else ""
    when = measured_when(session) if imported_files(session) else stated_utc(session)
    head = (str(start.get("motor") or "motor not named"), str(start.get("title", "")), when)
    short = choice.form == "short"
    return Report(
        title=_title(session),
        subtitle=" · ".join(part for part in head if part),
        boxes=boxes(materials, short),
        warnings=(*gaps(materials), *_left_out(choice)),
        sections=short_sections(materials) if short else all_sections(materials, digest, choice),
        data=_data(materials),
        begun=str(start.get("time", "")),
        footer=" · ".join((*(part for part in head if part), f"data {digest[:16]}")),
        signatures=_signatures(materials),
        letterhead=None if laboratory is None else Letterhead(laboratory.name, laboratory.address, laboratory.logo_png, laboratory.logo_svg),
        number=number,
        facts=report_facts(materials),
        statements=_statements(materials),
        mark=SIMULATED if session.simulated else "",
        pages=SHORT_PAGES if short else 0,
    )


def _title(session: Session) -> str:
    kinds = [name for name, measured in (("Common-mode impedance", session.sweeps), ("conducted emission", session.spectra)) if measured]
    title = " and ".join(kinds) or "Common-mode impedance"
    return f"{title[:1].upper()}{title[1:]} test report"


def _left_out(choice: Choice) -> list[str]:
    """What this form or choice of sections leaves out."""
    if choice.form == "short":
        return ["this is the short form: all values, settings and steps are in the long one"]
    missing = [name for name in SECTIONS if not choice.holds(name)]
    return [f"this report leaves out: {', '.join(missing)}"] if missing else []


def _signatures(materials: Materials) -> tuple[str, ...]:
    measured = f"measured by: {materials.session.start.get('operator') or 'not stated'}; date, signature"
    laboratory = materials.laboratory
    if laboratory is None or not laboratory.authoriser:
        return measured, "checked by: name, date, signature"
    return measured, f"authorised by: {laboratory.authoriser}; date, signature"


def _statements(materials: Materials) -> tuple[str, ...]:
    if (laboratory := materials.laboratory) is None:
        return ()
    rule, prediction = laboratory.decision_rule, materials.stored("prediction")
    if rule is None:
        return (laboratory.statement,)
    # The laboratory's words are its own: what was done stands beside them.
    done = f" The emission verdicts of this report: {rule_of(prediction)}." if prediction and "expanded_uncertainty_db" in prediction else ""
    return laboratory.statement, f"Decision rule: {rule.rule} Source: {rule.source}{'' if rule.source.endswith('.') else '.'}{done}"


def session_hash(session: Session) -> str:
    """The hash that ties a report to its session: of the measured data, which later analyses do not change."""
    digest = hashlib.sha256()
    for document in session.used_documents:
        if document["kind"] in ("sweep", "spectrum", "final"):
            digest.update(str(document["sha256"]).encode())
        elif document["kind"] == "value":
            digest.update(SingleValue.restored(document).text.encode())
    return digest.hexdigest()


def _without_levels(prediction: JsonDict | None) -> JsonDict | None:
    """A prediction without its thousands of levels, which are in the session's own files."""
    if prediction is None:
        return None
    return {name: value for name, value in prediction.items() if name != "frequency_hz" and not name.endswith("_dbuv")}


def _data(materials: Materials) -> JsonDict:
    session = materials.session
    return {
        "schema": "motoremi.report/1",
        "title": session.start.get("title", ""),
        "motor": session.start.get("motor", ""),
        "serial": session.start.get("serial", ""),
        "operator": session.start.get("operator", ""),
        "ambient": session.start.get("ambient", ""),
        "calibrated": session.start.get("calibrated") or {},
        "begun": session.start.get("time", ""),
        "software": session.start.get("software", ""),
        "simulated": session.simulated,
        "laboratory": None if materials.laboratory is None else materials.laboratory.model_dump(mode="json", exclude={"logo_png", "logo_svg"}),
        "issue": materials.issue,
        "measured": measured_when(session),
        "imported": list(imported_files(session)),
        "equipment": [dataclasses.asdict(item) for item in equipment_of(materials)],
        "session_sha256": session_hash(session),
        "status": session.status,
        "instruments": [
            {key: document.get(key) for key in ("role", "resource", "identity", "settings")}
            for document in session.documents
            if document["kind"] == "instrument"
        ],
        "withdrawn": list(session.withdrawn),
        "sweeps": [sweep.extent() for sweep in session.sweeps],
        "conditioned": [sweep.extent() for sweep in session.conditioned],
        "values": [value.to_dict() for value in session.values],
        "steps": [dict(zip(("number", "does", "with", "state"), step, strict=True)) for step in planned_steps(session)],
        "spectra": [
            {"detector": s.detector, "condition": s.condition, "points": len(s), "highest_dbuv": float(s.level_dbuv.max())}
            for s in session.corrected_spectra
        ],
        "ladder": [{**step.to_dict(), "result": is_result(step)} for step in materials.steps],
        "comparison": None if materials.comparison is None else materials.comparison.to_dict(),
        "diagnosis": materials.diagnosis,
        "prediction": _without_levels(materials.stored("prediction")),
        "emission_diagnosis": materials.stored("emission-diagnosis"),
        "emission_ladder": (materials.stored("emission") or {}).get("steps", []),
        "warnings": list(gaps(materials)),
    }
