"""The report as plain data; every rendering is made from it and computes nothing."""

from __future__ import annotations

import dataclasses
import hashlib

from motoremi.arrays import JsonDict
from motoremi.data.session import Session
from motoremi.report.gaps import gaps, planned_steps
from motoremi.report.headline import headline
from motoremi.report.parts import Materials, Picture, Report, Section, Table, is_result
from motoremi.report.sections import all_sections

__all__ = ["Materials", "Picture", "Report", "Section", "Table", "build_report", "session_hash"]


def build_report(materials: Materials) -> Report:
    """Make the report of a session."""
    if materials.steps and not is_result(materials.steps[-1]):
        # Neither pass nor fail means anything for a fit that stopped on its way.
        materials = dataclasses.replace(materials, comparison=None)
    start = materials.session.start
    digest = session_hash(materials.session)
    head = (str(start.get("motor") or "motor not named"), str(start.get("title", "")), str(start.get("time", ""))[:19].replace("T", " "))
    return Report(
        title="Common-mode impedance test report",
        subtitle=" · ".join(part for part in head if part),
        headline=headline(materials),
        warnings=gaps(materials),
        sections=all_sections(materials, digest),
        data=_data(materials),
        begun=str(start.get("time", "")),
        footer=" · ".join((*(part for part in head if part), f"data {digest[:16]}")),
        signatures=(f"measured by: {start.get('operator') or 'not stated'}; date, signature", "checked by: name, date, signature"),
    )


def session_hash(session: Session) -> str:
    """What ties a report to its session: a digest of the measured data, which later analyses do not change."""
    digest = hashlib.sha256()
    for document in session.documents:
        if document["kind"] in ("sweep", "spectrum", "final"):
            digest.update(str(document["sha256"]).encode())
    return digest.hexdigest()


def _without_levels(prediction: JsonDict | None) -> JsonDict | None:
    """The verdicts; thousands of levels are in the session's own files."""
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
        "simulated": session.start.get("backend") == "sim",
        "session_sha256": session_hash(session),
        "status": session.status,
        "instruments": [
            {key: document.get(key) for key in ("role", "resource", "identity", "settings")}
            for document in session.documents
            if document["kind"] == "instrument"
        ],
        "sweeps": [{"termination": s.termination, "points": len(s), "span_hz": list(s.span_hz)} for s in session.sweeps],
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
