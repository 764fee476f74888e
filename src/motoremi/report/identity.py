"""Identity of a report and its session: item, dates, people, instrument settings, files and steps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from motoremi.arrays import JsonDict
from motoremi.data.origin import measured_on
from motoremi.data.session import Session
from motoremi.data.spectrum import Spectrum
from motoremi.data.sweep import ImpedanceSweep
from motoremi.quantities import show
from motoremi.report.contents import Materials, Section, Table
from motoremi.report.steps import planned_steps

MEASURED = ("sweep", "spectrum", "final")
_UNITS = {"hz": "Hz", "s": "s", "volt": "V", "db": "dB"}


def report_facts(materials: Materials) -> tuple[tuple[str, str], ...]:
    """Report number, customer, item tested, date and operator, for the first page."""
    session, laboratory, issue = materials.session, materials.laboratory, materials.issue
    start = session.start
    facts = []
    if issue is not None:
        facts += [("Report number", str(issue["number"])), ("Date of issue", str(issue["date"]))]
        if before := issue.get("replaces"):
            facts.append(("Replaces", f"report {before['number']} of {before['date']}"))
    if laboratory is not None and laboratory.customer:
        facts.append(("Customer", ", ".join(laboratory.customer)))
    serial = f", serial number {start['serial']}" if start.get("serial") else ""
    facts += [
        ("Item tested", str(start.get("motor") or "motor not named") + serial),
        ("Measured", measured_when(session)),
        ("Measured by", str(start.get("operator") or "not stated")),
        ("Ambient", str(start.get("ambient") or "not stated")),
    ]
    if files := imported_files(session):
        when = str(start.get("time", ""))[:10]
        facts.append(("Data", f"IMPORTED on {when} from {how_many(files)}; the instruments were not driven by motoremi"))
    if limit := (materials.stored("prediction") or {}).get("limit"):
        facts.append(("Limit", str(limit["title"])))
    return tuple(facts)


def how_many(files: Sequence[str]) -> str:
    """The number of files in words."""
    return f"{len(files)} files" if len(files) > 1 else "1 file"


def imported_files(session: Session) -> tuple[str, ...]:
    """Names of the files that a session was imported from, with those of the sweeps that were added later; none for a run."""
    files = tuple(map(str, session.start.get("imported") or ()))
    if not files:
        return ()
    measured, later = iter(measured_documents(session)), []
    added = False
    for document in session.used_documents:
        added = added or document["kind"] == "reopen"
        if document["kind"] in MEASURED:
            _, item = next(measured)
            # What was measured on a bench after the import has no file.
            if added and "source" in item.metadata:
                later.append(str(item.metadata["source"]))
    return (*files, *later)


def measured_items(session: Session) -> tuple[ImpedanceSweep | Spectrum, ...]:
    """All measured sweeps and spectra, also those under a condition."""
    return (*session.sweeps, *session.conditioned, *session.spectra, *session.finals)


def measured_documents(session: Session) -> list[tuple[JsonDict, ImpedanceSweep | Spectrum]]:
    """Each document of a measured file with what the file holds."""
    sources: dict[str, Iterator[ImpedanceSweep | Spectrum]] = {
        "sweep": iter(session.sweeps),
        "sweep under a condition": iter(session.conditioned),
        "spectrum": iter(session.spectra),
        "final": iter(session.finals),
    }
    measured = [d for d in session.used_documents if d["kind"] in MEASURED]
    return [(d, next(sources["sweep under a condition" if "condition" in d and d["kind"] == "sweep" else d["kind"]])) for d in measured]


def measured_when(session: Session) -> str:
    """The dates of the measurement: those of the run, or for imported data those stated in the files."""
    times = measured_times(session)
    if imported_files(session):
        return _span(times) if times else "date not stated in the files"
    return f"{_span(times)} UTC" if times else "nothing"


def stated_utc(session: Session) -> str:
    """When the session was begun, to the second."""
    time = _to_the_second(session.start)
    return f"{time} UTC" if time else ""


def _to_the_second(document: JsonDict) -> str:
    return str(document.get("time", ""))[:19].replace("T", " ")


def measured_times(session: Session) -> list[str]:
    """When each sweep and spectrum was measured: in UTC in a run; as the files state it, for imported data."""
    if imported_files(session):
        return [day for item in measured_items(session) if (day := measured_on(item.metadata))]
    return [str(d.get("time", ""))[:16].replace("T", " ") for d in session.used_documents if d["kind"] in MEASURED]


def _span(times: list[str]) -> str:
    first, last = min(times), max(times)
    return first if first == last else f"{first} to {last.removeprefix(first[:11]) if first[10:11] == ' ' else last}"


def identity_section(session: Session, session_sha256: str) -> Section:
    """Motor, people, settings of the instruments, files with their hashes."""
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
        ("bench", "simulated" if session.simulated else str(start.get("backend") or "files that were imported")),
        ("calibrated", ", ".join(calibrated) or "not stated"),
        ("software", str(start.get("software", ""))),
        ("measured", measured_when(session)),
        ("imported" if imported_files(session) else "begun", stated_utc(session)),
        ("ended", session.status),
        ("read from files", ", ".join(imported_files(session)) or "-"),
        ("SHA-256 over the hashes of the measured files", session_sha256),
    )
    tables = [Table("Session", ("what", "is"), facts)]
    # A resumed run identifies the same instruments again: list each once.
    settings = dict.fromkeys(
        (str(d.get("role")), str(d.get("resource") or "-"), str((d.get("identity") or {}).get("firmware") or "-"), _settings(d))
        for d in session.documents
        if d["kind"] == "instrument"
    )
    if settings:
        tables.append(Table("Settings of the instruments", ("role", "resource", "firmware", "settings"), tuple(settings)))
    files = tuple(_file(document, item, session) for document, item in measured_documents(session))
    if files:
        columns = ("file", "came from" if imported_files(session) else "measured (UTC)", "points", "SHA-256")
        tables.append(Table("Measured files", columns, files))
    return Section("Identity", (), tuple(tables))


def _file(document: JsonDict, item: ImpedanceSweep | Spectrum, session: Session) -> tuple[str, ...]:
    came = _to_the_second(document)
    if imported_files(session):
        day = measured_on(item.metadata)
        came = str(item.metadata.get("source", "-")) + (f" of {day}" if day else "")
    return str(document.get("file")), came, str(document.get("points")), str(document.get("sha256"))


def _settings(document: JsonDict) -> str:
    settings = document.get("settings")
    if not isinstance(settings, dict) or not settings:
        return "-"
    return ", ".join(f"{name} {_shown(name, value)}" for name, value in settings.items())


def _shown(name: str, value: object) -> str:
    """A setting with the unit that its name ends in."""
    unit = _UNITS.get(name.rpartition("_")[2])
    return show(value, unit) if unit and isinstance(value, int | float) and not isinstance(value, bool) else str(value)


def procedure_section(session: Session) -> Section:
    """Every step of the procedure, done or not."""
    steps = planned_steps(session)
    if not steps:
        return Section("Procedure", ("No bench procedure: the data were not measured by a run.",))
    rows = tuple((f"{number}", name, settings or "-", state) for number, name, settings, state in steps)
    missed = frozenset(index for index, step in enumerate(steps) if step[3] in ("not begun", "not finished"))
    return Section("Procedure", (), (Table("Steps", ("step", "does", "with", "state"), rows, missed),))
