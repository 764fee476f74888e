"""The equipment list: instruments, fixtures and corrections, with their calibration dates."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import date, timedelta

from motoremi.arrays import JsonDict
from motoremi.data.laboratory import Equipment
from motoremi.data.origin import measured_on
from motoremi.data.session import Session
from motoremi.quantities import parse
from motoremi.report.contents import Materials, Section, Table
from motoremi.report.identity import imported_files, measured_items

NOT_STATED = "not stated"
# Settings of an analyser that name a piece of equipment.
PARTS = ("adapter", "fixture")
# Kinds that are compensated or corrected for, and need no calibration date.
UNDATED = (*PARTS, "cable")


@dataclass(frozen=True)
class Item:
    """A piece of equipment; dates in ISO 8601, empty if not stated."""

    kind: str
    name: str
    serial: str = ""
    calibrated: str = ""
    due: str = ""
    certificate: str = ""
    table: str = ""


def equipment_section(materials: Materials) -> Section:
    """A row for each instrument, correction, adapter and fixture, and for each entry that the laboratory's profile adds."""
    items = equipment_of(materials)
    used = _used_on(materials.session)
    rows = tuple(
        (one.kind, one.name, one.serial or "-", one.calibrated or NOT_STATED, one.due or NOT_STATED, one.certificate or "-", one.table or "-")
        for one in items
    )
    late = frozenset(index for index, one in enumerate(items) if _is_late(one, used))
    columns = ("kind", "equipment", "serial number", "calibrated", "due", "certificate", "correction table")
    if not rows:
        return Section("Equipment", ("No equipment is stated.",))
    return Section("Equipment", (), (Table("Equipment used", columns, rows, late),))


def equipment_of(materials: Materials) -> tuple[Item, ...]:
    """All equipment; entries of session and profile with the same serial number are one."""
    laboratory = materials.laboratory
    stated = laboratory.equipment if laboratory is not None else ()
    items, joined = [], set()
    for item in _of_session(materials.session):
        own = next((one for one in stated if one.serial and one.serial == item.serial), None)
        if own is not None:
            joined.add(own)
        items.append(item if own is None else _joined(item, own))
    items += [_from_profile(one) for one in stated if one not in joined and _is_of(one, materials.session)]
    days = laboratory.calibration_interval if laboratory is not None else None
    return tuple(_with_due(item, days) for item in items)


def overdue(materials: Materials) -> list[str]:
    """Equipment that was used after its calibration was due, or before the calibration that is stated."""
    used, items = _used_on(materials.session), equipment_of(materials)
    found = [f"the calibration of the {one.kind} {one.name} was due on {one.due}" for one in items if _is_late(one, used)]
    later = [one for one in items if used and one.calibrated > used]
    return found + [f"the calibration of the {one.kind} {one.name} is dated {one.calibrated}, after the measurement" for one in later]


def not_stated(materials: Materials) -> list[str]:
    """Information that a test report should have and that was not stated."""
    session, start = materials.session, materials.session.start
    missing = [label for label, key in (("the motor's name", "motor"), ("the motor's serial number", "serial")) if not start.get(key)]
    missing += [label for label, key in (("who measured", "operator"), ("ambient conditions", "ambient")) if not start.get(key)]
    items = equipment_of(materials)
    kinds = {word for item in items for word in f"{item.kind} {item.name}".lower().replace("-", " ").split()}
    if imported_files(session) and not any(item.kind in ("instrument", "analyser", "receiver") for item in items):
        missing.append("the instruments and their serial numbers")
    if session.spectra and not kinds & {"lisn", "amn", "probe", "antenna", "network"}:
        missing.append("the LISN or transducer")
    if session.sweeps and "fixture" not in kinds:
        missing.append("the fixture")
    dated = [item for item in items if item.kind not in UNDATED]
    uncalibrated = list(dict.fromkeys(item.name if item.table else item.kind for item in dated if not item.calibrated))
    return missing + ([f"calibration dates ({', '.join(uncalibrated)})"] if uncalibrated else [])


def _of_session(session: Session) -> Iterator[Item]:
    calibrated = session.start.get("calibrated") or {}
    procedure = session.start.get("procedure") or {}
    days = float(parse(procedure["calibration_within"], "d")) if "calibration_within" in procedure else None
    seen = set()
    for document in session.documents:
        if document["kind"] != "instrument":
            continue
        identity, role = document.get("identity") or {}, str(document.get("role"))
        name = " ".join(str(identity[key]) for key in ("vendor", "model") if identity.get(key)) or "did not identify itself"
        item = Item(role, name, str(identity.get("serial") or ""), str(calibrated.get(role, "")))
        if item in seen:
            continue
        seen.add(item)
        yield _with_due(item, days)
        settings = document.get("settings")
        named: JsonDict = settings if isinstance(settings, dict) else {}
        for part in PARTS:
            if str(named.get(part, "none")).lower() not in ("none", "false", ""):
                yield Item(part, str(named[part]))
    for entry in session.corrections.entries:
        table = entry.file or (f"{len(entry.frequency_hz)} values" if entry.frequency_hz else "one value")
        day, due = (value.isoformat() if value is not None else "" for value in (entry.calibrated, entry.due))
        yield Item(f"{entry.role} correction", entry.name, entry.serial, day, due, table=table)


def _is_of(stated: Equipment, session: Session) -> bool:
    """Whether equipment from the profile alone belongs to a session; instruments do not if the session identified its own."""
    if stated.kind == "instrument" and any(document["kind"] == "instrument" for document in session.documents):
        return False
    return {"both": True, "impedance": bool(session.sweeps), "emission": bool(session.spectra)}[stated.used_for]


def _from_profile(one: Equipment) -> Item:
    return _joined(Item(one.kind, one.name, one.serial), one)


def _joined(item: Item, stated: Equipment) -> Item:
    """An entry with calibration dates of the laboratory's profile, which override those of the bench file."""
    calibrated, due = (value.isoformat() if value is not None else "" for value in (stated.calibrated, stated.due))
    newer = calibrated and calibrated != item.calibrated
    return replace(item, calibrated=calibrated or item.calibrated, due=due or ("" if newer else item.due), certificate=stated.certificate)


def _with_due(item: Item, days: float | None) -> Item:
    """An entry with a due date this many days after its calibration, unless one is stated."""
    if item.due or days is None:
        return item
    try:
        return replace(item, due=(date.fromisoformat(item.calibrated) + timedelta(days=days)).isoformat())
    except (ValueError, OverflowError):
        return item


def _used_on(session: Session) -> str:
    """The last day of a run, or the last day that imported files state; empty if they state none."""
    if imported_files(session):
        days = [measured_on(item.metadata)[:10] for item in measured_items(session)]
        return max((day for day in days if _is_day(day)), default="")
    return max((str(d.get("time", ""))[:10] for d in session.used_documents if d["kind"] in ("sweep", "spectrum", "final")), default="")


def _is_day(text: str) -> bool:
    try:
        return date.fromisoformat(text).isoformat() == text
    except ValueError:
        return False


def _is_late(item: Item, used: str) -> bool:
    return bool(used and item.due and item.due < used)
