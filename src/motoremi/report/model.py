"""The report as plain data; every rendering is made from it and computes nothing."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np

from motoremi.arrays import JsonDict
from motoremi.data.session import Session
from motoremi.data.text import clean_text
from motoremi.diagnosis.compare import Comparison
from motoremi.fitting.result import Fit
from motoremi.model.effects import find_effect
from motoremi.quantities import show, show_band
from motoremi.report import plots


@dataclass(frozen=True)
class Materials:
    """What a report is made of.

    Parameters
    ----------
    session : Session
    steps : tuple of Fit
        The ladder, base first; empty before the first fit.
    comparison : Comparison, optional
        Of the model that stands.
    diagnosis : dict, optional
        As `Diagnosis.to_dict` gives it.
    """

    session: Session
    steps: tuple[Fit, ...]
    comparison: Comparison | None
    diagnosis: JsonDict | None


@dataclass(frozen=True)
class Table:
    """A table of texts."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    marked: frozenset[int] = frozenset()


@dataclass(frozen=True)
class Picture:
    """A plot with its caption."""

    svg: str
    caption: str


@dataclass(frozen=True)
class Section:
    """A heading with what stands under it."""

    title: str
    texts: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()


@dataclass(frozen=True)
class Report:
    """Everything that a report says.

    Parameters
    ----------
    title, subtitle : str
    headline : tuple of (label, text, mood)
        The first page in a few lines; mood is "good", "bad" or "plain".
    warnings : tuple of str
        What was not done or not well, in plain sight.
    sections : tuple of Section
    data : dict
        The same for machines.
    """

    title: str
    subtitle: str
    headline: tuple[tuple[str, str, str], ...]
    warnings: tuple[str, ...]
    sections: tuple[Section, ...]
    data: JsonDict


def build_report(materials: Materials) -> Report:
    """Make the report of a session."""
    session, steps = materials.session, materials.steps
    sections = [_sweeps(materials)]
    if steps:
        sections += [_fit_section(steps), _ladder_section(steps)]
    if materials.comparison is not None:
        sections.append(_comparison_section(materials.comparison))
    if materials.diagnosis is not None:
        sections.append(_diagnosis_section(materials.diagnosis))
    if session.spectra:
        sections.append(_spectra_section(session))
    sections.append(_identity_section(session))
    motor = _text(session.start.get("motor") or "motor not named")
    return Report(
        title="Common-mode impedance test report",
        subtitle=f"{motor} · {_text(session.start.get('title', ''))} · {_text(session.start.get('time', ''))}",
        headline=tuple(_headline(materials)),
        warnings=tuple(_warnings(materials)),
        sections=tuple(sections),
        data=_data(materials),
    )


def _text(value: object) -> str:
    """Text from outside, in one line, controls shown."""
    return clean_text(" ".join(str(value).split(" ")), 300)


def _headline(materials: Materials) -> list[tuple[str, str, str]]:
    lines: list[tuple[str, str, str]] = []
    steps, diagnosis = materials.steps, materials.diagnosis
    if steps:
        base, last = steps[0], steps[-1]
        lines.append(("Error of the paper's circuit", f"{base.rms_error_percent:.3g} % rms ({base.rms_error_db:.2g} dB)", "plain"))
    if diagnosis is not None:
        spans = [f"{span['sweep']} {show_band(*span['band_hz'])} ({100 * span['share']:.0f} %)" for span in diagnosis["where"][:3]]
        lines.append(("Where it fails", "; ".join(spans) or "nowhere beyond the uncertainty", "plain"))
        named = ", ".join(diagnosis["effects"]) or "-"
        good = diagnosis["verdict"] == "adequate"
        lines.append(("Diagnosis", f"{diagnosis['verdict']}: {named}; confidence {diagnosis['confidence']:.2f}", "good" if good else "plain"))
        for family in diagnosis["families"]:
            lines.append(("Not told apart", ", ".join(family), "plain"))
    if steps:
        reached = last.rms_error_percent < 1.5 * last.floor_percent
        model = "with " + " + ".join(last.effects) if last.effects else "paper's circuit"
        lines.append((f"Error now ({model})", f"{last.rms_error_percent:.3g} % rms", "good" if reached else "bad"))
        lines.append(("Noise floor", f"{last.floor_percent:.2g} %", "plain"))
    if materials.comparison is not None:
        passed = materials.comparison.passed
        lines.append(("Model against measurement", "PASS" if passed else "FAIL", "good" if passed else "bad"))
    if diagnosis is not None:
        lines.append(("Measure next", str(diagnosis["next_measurement"]["why"]), "plain"))
    return lines


def _warnings(materials: Materials) -> list[str]:
    session, steps = materials.session, materials.steps
    warnings = []
    if session.status != "done" and not _running(session):
        reason = next((str(d.get("reason")) for d in session.documents if d["kind"] == "stop" and d.get("reason")), "no stop document")
        warnings.append(f"the run did not end well ({session.status}): {_text(reason)}")
    started = {d["step"]: d["do"] for d in session.documents if d["kind"] == "step-start"}
    stopped = {d["step"] for d in session.documents if d["kind"] == "step-stop"}
    total = next((int(d["of"]) for d in session.documents if d["kind"] == "step-start"), 0)
    unfinished = [f"{number} ({name})" for number, name in started.items() if number not in stopped and name != "report"]
    if unfinished:
        warnings.append(f"steps not finished: {', '.join(unfinished)}")
    if started and not _running(session) and len(started) < total:
        warnings.append(f"{total - len(started)} of {total} steps were not begun")
    if not steps:
        warnings.append("no fit was made")
    else:
        warnings += [_text(warning) for warning in steps[-1].warnings]
        if steps[-1].undetermined():
            warnings.append(f"the data do not determine {', '.join(steps[-1].undetermined())}")
    if materials.diagnosis is None:
        warnings.append("no diagnosis was made")
    if session.start.get("analyser_assumed"):
        warnings.append("the analyser was not named: the errors of a 4294A are assumed")
    if any(np.any(spectrum.overload) for spectrum in session.spectra):
        warnings.append("the receiver was overloaded: the points marked with a cross are not judged")
    return list(dict.fromkeys(warnings))


def _running(session: Session) -> bool:
    """Whether the report is a step of the run that it reports."""
    last = [d for d in session.documents if d["kind"] in ("step-start", "step-stop", "stop")][-1:]
    return bool(last) and last[0]["kind"] == "step-start" and last[0]["do"] == "report"


def _sweeps(materials: Materials) -> Section:
    session, steps = materials.session, materials.steps
    if not session.sweeps:
        return Section("Sweeps", ("This session holds no impedance sweep.",))
    noise = {}
    if steps:
        measurement = steps[0].measurement
        for group, estimate in zip(measurement.sweeps, measurement.noise, strict=True):
            noise[group.termination] = f"{100 * np.sqrt(np.mean(2 * estimate.sigma**2)):.2g} % (from {estimate.source})"
    rows = [
        (
            sweep.termination,
            f"{len(sweep)}",
            show_band(*sweep.span_hz),
            noise.get(sweep.termination, "-"),
            _text(sweep.metadata.get("source", "-")),
        )
        for sweep in session.sweeps
    ]
    table = Table("Sweeps", ("termination", "points", "span", "noise of the mean", "source"), tuple(rows))
    pictures: tuple[Picture, ...] = ()
    if steps:
        caption = "Measured impedance, the paper's circuit, and the model that stands; below, the error against the uncertainty."
        pictures = (Picture(plots.to_svg(plots.sweeps_figure(steps[0], steps[-1]), "sweeps"), caption),)
    return Section("Sweeps and model", (), (table,), pictures)


def _fit_section(steps: tuple[Fit, ...]) -> Section:
    last = steps[-1]
    if not last.converged and last.method != "paper":
        return Section("Fit", ("The fit did not converge; its values are not shown.",))
    texts = [
        f"{'Ant colony of the paper, as printed' if last.method == 'paper' else 'Ant colony with polish'}, seed {last.seed}, "
        f"{last.evaluations} evaluations; chi2_reduced {last.chi2_reduced:.4g} with the errors of {last.measurement.analyser.title} allowed for."
    ]
    if last.undetermined():
        texts.append(f"The data do not determine {', '.join(last.undetermined())}; do not quote values for them.")
    if last.chi2_reduced > 2:
        texts.append("While an effect is missing, the elements carry its weight: their values are not those of the motor.")
    bad = frozenset(index for index, row in enumerate(last.rows()) if "not determined" in row[2])
    tables = [Table("Parameters", ("parameter", "value", "standard uncertainty"), tuple(last.rows()), bad)]
    if last.nuisance:
        units = {p.name: p.unit for p in last.problem.everything}
        rows = tuple((name, show(value, units.get(name, ""), 2)) for name, value in last.nuisance.items())
        tables.append(Table("What the fixture's compensation is believed to have left", ("residual", "value"), rows))
    pictures = []
    if steps[0].history:
        caption = f"Training curve of the base fit ({steps[0].method})."
        pictures.append(Picture(plots.to_svg(plots.training_figure(steps[0]), "training"), caption))
    return Section("Fit", tuple(texts), tuple(tables), tuple(pictures))


def _ladder_section(steps: tuple[Fit, ...]) -> Section:
    rows = [
        (
            " + ".join(step.effects) or "paper's circuit",
            f"{step.rms_error_percent:.3g} %",
            f"{step.rms_error_db:.3g} dB",
            f"{step.rms_error_percent / step.floor_percent:.3g}",
            f"{step.chi2_reduced:.4g}",
            show(step.parameters["Ra"], "Ohm") if "Ra" in step.parameters else "-",
        )
        for step in steps
    ]
    table = Table("Models", ("model", "rms error", "rms magnitude", "error over noise floor", "chi2_reduced", "Ra"), tuple(rows))
    figure = Picture(plots.to_svg(plots.ladder_figure(steps), "ladder"), "The error at each step of the ladder.")
    return Section("Ladder", (), (table,), (figure,))


def _comparison_section(comparison: Comparison) -> Section:
    rows, failed = [], set()
    for index, band in enumerate(comparison.bands):
        spans = ", ".join(show_band(*span) for span in band["fails_hz"][:3]) + (" ..." if len(band["fails_hz"]) > 3 else "")
        rows.append(
            (
                band["sweep"],
                show_band(*band["band_hz"]),
                f"{band['rms_error_percent']:.3g} %",
                f"{band['max_error_db']:.3g} dB",
                f"{band['max_phase_deg']:.3g} deg",
                f"{100 * band['share_beyond_uncertainty']:.0f} %",
                band["verdict"].upper(),
                spans,
            )
        )
        if band["verdict"] == "fail":
            failed.add(index)
    columns = ("sweep", "band", "rms error", "max magnitude", "max phase", "points beyond uncertainty", "verdict", "fails at")
    limits = comparison.tolerance
    asked = [
        f"{value:g} {unit}"
        for value, unit in ((limits.error_percent, "% error"), (limits.magnitude_db, "dB magnitude"), (limits.phase_deg, "deg phase"))
        if value is not None
    ]
    texts = (f"Tolerance at every point: {', '.join(asked)}. A point fails if it is beyond the tolerance and beyond the uncertainty.",)
    figure = Picture(plots.to_svg(plots.comparison_figure(comparison), "comparison"), "Error of the model that stands.")
    return Section("Model against measurement", texts, (Table("Bands", columns, tuple(rows), frozenset(failed)),), (figure,))


def _diagnosis_section(diagnosis: JsonDict) -> Section:
    rows = []
    for candidate in diagnosis["candidates"][:10]:
        values = ", ".join(
            f"{name} = {show(entry['value'], entry['unit'])}" + (" (at bound)" if entry["at_bound"] else "")
            for name, entry in candidate["parameters"].items()
        )
        rows.append(
            (
                candidate["effect"],
                candidate["family"],
                f"{candidate['probability']:.3g}",
                f"{candidate['delta_bic']:.3g}",
                f"{candidate['chi2_reduced']:.4g}",
                f"{candidate['rms_error_percent']:.3g} %",
                values,
            )
        )
    columns = ("effect", "family", "probability", "ΔBIC", "chi2_reduced", "rms error", "fitted parameters")
    texts = [*(_text(reason) for reason in diagnosis["reasons"]), f"Measure next: {_text(diagnosis['next_measurement']['why'])}."]
    for name in diagnosis["effects"]:
        effect = find_effect(name).effect
        texts.append(f"{name}: {effect.title}. Signature: {effect.signature}. Law: {effect.formula}. Source: {effect.source}.")
    picture = Picture(plots.to_svg(plots.ranking_figure(diagnosis), "ranking"), "Evidence of the single effects on top of the base model.")
    pictures = (picture,) if rows else ()
    return Section("Diagnosis", tuple(texts), (Table("Ranking", columns, tuple(rows)),), pictures)


def _spectra_section(session: Session) -> Section:
    rows = tuple(
        (s.detector, f"{len(s)}", show_band(float(s.frequency_hz[0]), float(s.frequency_hz[-1])), f"{s.level_dbuv.max():.1f} dBuV")
        for s in session.spectra
    )
    table = Table("Spectra", ("detector", "points", "span", "highest level"), rows)
    figure = Picture(plots.to_svg(plots.spectrum_figure(session.spectra), "spectrum"), "Conducted emission at the LISN.")
    return Section("Emission", ("Measured levels; they are not judged against a limit here.",), (table,), (figure,))


def _identity_section(session: Session) -> Section:
    rows = []
    for document in session.documents:
        if document["kind"] == "instrument":
            identity = document.get("identity", {})
            who = " ".join(str(identity.get(key, "")) for key in ("vendor", "model"))
            rows.append(
                tuple(_text(v) for v in (document.get("role"), who, identity.get("serial"), identity.get("firmware"), document.get("resource")))
            )
    calibrated = session.start.get("calibrated") or {}
    facts = [
        ("operator", session.start.get("operator") or "not stated"),
        ("software", session.start.get("software", "")),
        ("calibrated", ", ".join(f"{role} {day}" for role, day in calibrated.items()) or "not stated"),
        ("imported files", ", ".join(session.start.get("imported", [])) or "-"),
        ("start", session.start.get("time", "")),
        ("hash of the first document", session_hash(session)),
    ]
    steps = [
        (str(d["step"]), _text(d["do"]), _text(", ".join(f"{k} {v}" for k, v in d.get("parameters", {}).items())))
        for d in session.documents
        if d["kind"] == "step-start"
    ]
    tables = [Table("Session", ("what", "is"), tuple((name, _text(value)) for name, value in facts))]
    if rows:
        tables.append(Table("Instruments", ("role", "instrument", "serial", "firmware", "resource"), tuple(rows)))
    if steps:
        tables.append(Table("Procedure", ("step", "does", "with"), tuple(steps)))
    return Section("Identity", (), tuple(tables))


def session_hash(session: Session) -> str:
    """What ties a report to its session: a digest of the measured data, which later analyses do not change."""
    digest = hashlib.sha256()
    for document in session.documents:
        if document["kind"] in ("sweep", "spectrum"):
            digest.update(str(document["sha256"]).encode())
    return digest.hexdigest()


def _data(materials: Materials) -> JsonDict:
    session = materials.session
    return {
        "schema": "motoremi.report/1",
        "title": session.start.get("title", ""),
        "motor": session.start.get("motor", ""),
        "operator": session.start.get("operator", ""),
        "software": session.start.get("software", ""),
        "session_sha256": session_hash(session),
        "status": session.status,
        "instruments": [
            {key: document.get(key) for key in ("role", "resource", "identity", "settings")}
            for document in session.documents
            if document["kind"] == "instrument"
        ],
        "sweeps": [{"termination": s.termination, "points": len(s), "span_hz": list(s.span_hz)} for s in session.sweeps],
        "spectra": [{"detector": s.detector, "points": len(s), "highest_dbuv": float(s.level_dbuv.max())} for s in session.spectra],
        "ladder": [step.to_dict() for step in materials.steps],
        "comparison": None if materials.comparison is None else materials.comparison.to_dict(),
        "diagnosis": materials.diagnosis,
        "warnings": _warnings(materials),
    }
