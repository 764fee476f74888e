"""What was measured, with what, by whom, when, and in which steps."""

from __future__ import annotations

from collections.abc import Iterator

from motoremi.arrays import JsonDict
from motoremi.data.session import Session
from motoremi.data.spectrum import Spectrum
from motoremi.data.sweep import ImpedanceSweep
from motoremi.report.gaps import planned_steps
from motoremi.report.parts import Section, Table


def identity_section(session: Session, session_sha256: str) -> Section:
    """Motor, people, instruments with their serial numbers and settings, files with their hashes."""
    start = session.start
    ages = start.get("calibration_age_days") or {}
    calibrated = [
        f"{role} {day}" + (f" ({ages[role]} days before)" if role in ages else "") for role, day in (start.get("calibrated") or {}).items()
    ]
    facts = (
        ("motor", str(start.get("motor") or "not named")),
        ("serial number of the motor", str(start.get("serial") or "not stated")),
        ("operator", str(start.get("operator") or "not stated")),
        ("ambient", str(start.get("ambient") or "not stated")),
        ("bench", "simulated" if start.get("backend") == "sim" else str(start.get("backend") or "files that were imported")),
        ("calibrated", ", ".join(calibrated) or "not stated"),
        ("software", str(start.get("software", ""))),
        ("begun (UTC)", str(start.get("time", ""))),
        ("ended", session.status),
        ("read from files", ", ".join(map(str, start.get("imported") or ())) or "-"),
        ("SHA-256 over the hashes of the measured files", session_sha256),
    )
    tables = [Table("Session", ("what", "is"), facts)]
    instruments = []
    for document in session.documents:
        if document["kind"] == "instrument":
            identity = document.get("identity") or {}
            who = " ".join(str(identity[key]) for key in ("vendor", "model") if identity.get(key))
            role = str(document.get("role"))
            others = (identity.get("serial"), identity.get("firmware"), document.get("resource"), (start.get("calibrated") or {}).get(role))
            instruments.append((role, who or "did not say", *(str(value or "-") for value in others), _settings(document)))
    if instruments:
        tables.append(Table("Instruments", ("role", "instrument", "serial", "firmware", "resource", "calibrated", "settings"), tuple(instruments)))
    measured = [d for d in session.documents if d["kind"] in ("sweep", "spectrum", "final")]
    sources: dict[str, Iterator[ImpedanceSweep | Spectrum]] = {
        "sweep": iter(session.sweeps),
        "spectrum": iter(session.spectra),
        "final": iter(session.finals),
    }
    files = tuple(
        (str(d.get("file")), str(source.metadata.get("source", "-")), str(d.get("points")), str(d.get("sha256")))
        for d, source in ((d, next(sources[d["kind"]])) for d in measured)
    )
    if files:
        tables.append(Table("Measured files", ("file", "came from", "points", "SHA-256"), files))
    return Section("Identity", (), tuple(tables))


def _settings(document: JsonDict) -> str:
    settings = document.get("settings")
    return ", ".join(f"{name} {value}" for name, value in settings.items()) if isinstance(settings, dict) and settings else "-"


def procedure_section(session: Session) -> Section:
    """Every step, done or not."""
    steps = planned_steps(session)
    if not steps:
        return Section("Procedure", ("No bench procedure: the data were brought in by other means.",))
    rows = tuple((f"{number}", name, settings or "-", state) for number, name, settings, state in steps)
    missed = frozenset(index for index, step in enumerate(steps) if step[3] in ("not begun", "not finished"))
    return Section("Procedure", (), (Table("Steps", ("step", "does", "with", "state"), rows, missed),))
