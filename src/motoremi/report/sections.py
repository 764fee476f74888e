"""The report's sections, in the order in which a bench engineer asks: data, fit, ladder, verdict, cause, emission, identity."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from motoremi.arrays import JsonDict
from motoremi.data.measurement import Measurement
from motoremi.data.session import Session
from motoremi.diagnosis.compare import Comparison, compare
from motoremi.errors import BadInput
from motoremi.fitting.result import Fit
from motoremi.model.effects import find_effect
from motoremi.quantities import show, show_band
from motoremi.report import plots
from motoremi.report.emission import prediction_figure, prediction_tables, prediction_texts
from motoremi.report.gaps import planned_steps
from motoremi.report.headline import in_words, spans, tolerance
from motoremi.report.parts import Materials, Picture, Section, Table, is_result, model_name

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NOISE_SOURCES = {
    "repeats": "the repeats",
    "stated": "stated in the file",
    "scatter": "the sweep's own scatter, an upper bound",
}
ELEMENTS = {
    "Ra": "winding resistance",
    "La": "winding inductance",
    "Ca": "turn-to-turn capacitance",
    "Rr": "resistance of the rotor path",
    "Lr": "inductance of the rotor path",
    "Cr": "capacitance winding to rotor",
    "Cf": "capacitance winding to frame",
}
MOST_CANDIDATES = 10
# A residual beyond this is more likely a model that bends the fixture to its needs.
BELIEVABLE_SIGMAS = 3.0
# An error bar of several times the value says no more than that the value has a sign.
KNOWN_AT_ALL = 3.0


def all_sections(materials: Materials, session_sha256: str) -> tuple[Section, ...]:
    """Every section that the materials have something for; what is missing is said on the first page."""
    return tuple(_sections(materials, session_sha256))


def _sections(materials: Materials, session_sha256: str) -> Iterator[Section]:
    yield _sweeps(materials)
    if materials.steps:
        yield _fit(materials.steps)
        yield _ladder(materials.steps, materials.session.ladder)
    if materials.comparison is not None:
        yield _comparison(materials.comparison)
    if materials.diagnosis is not None:
        yield _diagnosis(materials.diagnosis)
    if materials.session.spectra:
        yield _spectra(materials.session)
    yield _identity(materials.session, session_sha256)
    yield _procedure(materials.session)


def _picture(name: str, figure: Figure, caption: str) -> Picture:
    return Picture(plots.to_svg(figure, name, caption), caption)


def _sweeps(materials: Materials) -> Section:
    session, results = materials.session, _results(materials.steps)
    if not session.sweeps:
        return Section("Sweeps", ("This session holds no impedance sweep.",))
    try:
        measurement = results[0].measurement if results else Measurement.of(session.sweeps)
    except BadInput as error:
        return Section("Sweeps", (f"The sweeps cannot be used together: {error}.",))
    rows = tuple(
        (
            sweep.termination,
            f"{sweep.frequency_hz.size}",
            show_band(float(sweep.frequency_hz[0]), float(sweep.frequency_hz[-1])),
            f"{sweep.repeats}",
            f"{100 * np.sqrt(np.mean(2 * noise.sigma**2)):.2g} %",
            NOISE_SOURCES[noise.source],
        )
        for sweep, noise in zip(measurement.sweeps, measurement.noise, strict=True)
    )
    table = Table("Sweeps", ("termination", "points", "span", "repeats", "noise of the mean (rms)", "noise known from"), rows)
    if not results:
        alone = _picture("sweeps", plots.measured_figure(measurement), "Measured impedance, mean of the repeats.")
        return Section("Sweeps", tuple(measurement.caveats()), (table,), (alone,))
    caption = "Measured impedance, the paper's circuit, and the model that stands; below, the error against the uncertainty."
    return Section("Sweeps and model", (), (table,), (_picture("sweeps", plots.sweeps_figure(results[0], results[-1]), caption),))


def _results(steps: Sequence[Fit]) -> tuple[Fit, ...]:
    """The steps that may be shown as results."""
    return tuple(step for step in steps if is_result(step))


def _fit(steps: tuple[Fit, ...]) -> Section:
    last = steps[-1]
    caption = f"Training curve of the base fit ({steps[0].method}): the best of each round, and the best so far."
    pictures = (_picture("training", plots.training_figure(steps[0]), caption),) if steps[0].history else ()
    if not is_result(last):
        return Section("Fit", ("The fit did not converge; its values are not shown.",), (), pictures)
    texts = [
        f"{'Ant colony of the paper, as printed' if last.method == 'paper' else 'Ant colony with polish'}, seed {last.seed}; "
        f"evaluations of the model at each step: {', '.join(str(step.evaluations) for step in steps)}. "
        f"chi2_reduced {last.chi2_reduced:.4g} with the errors of {last.measurement.analyser.title} allowed for."
    ]
    if last.undetermined():
        loose = ", ".join(f"{name} ({_looseness(last, name)})" for name in last.undetermined())
        texts.append(f"The data do not determine {loose}; do not quote values for them.")
    if last.chi2_reduced > 2:
        texts.append("While an effect is missing, the elements carry its weight: their values are not those of the motor.")
    tables = [_parameters(steps), _derived(last)]
    if last.nuisance:
        tables.append(_residuals(last))
    return Section("Fit", tuple(texts), tuple(tables), pictures)


def _looseness(fit: Fit, name: str) -> str:
    """How little is known of a parameter that the data do not determine."""
    if name not in fit.parameters:
        return "no sweep depends on it"
    value, sigma = abs(fit.parameters[name]), fit.sigma[name]
    return f"± {100 * sigma / value:.2g} %" if sigma < KNOWN_AT_ALL * value else "any value would do"


def _derived(fit: Fit) -> Table:
    """Often well known where the elements behind them are not."""
    rows, marked = [], set()
    for index, quantity in enumerate(fit.derived()):
        known = quantity.sigma < 0.5 * abs(quantity.value)
        bar = f"± {100 * quantity.sigma / abs(quantity.value):.2g} %" if known else "not determined by these data"
        rows.append((quantity.name, show(quantity.value, quantity.unit), bar))
        if not known:
            marked.add(index)
    return Table("What follows from the elements", ("quantity", "value", "standard uncertainty"), tuple(rows), frozenset(marked))


def _parameters(steps: tuple[Fit, ...]) -> Table:
    base, last = steps[0], steps[-1]
    units = {p.name: p.unit for p in base.motor.parameters}
    columns = ["parameter", "is", "value", "standard uncertainty"]
    before = {name: show(value, units[name]) for name, value in base.parameters.items()} if last.effects != base.effects and is_result(base) else {}
    if before:
        columns.append("in the paper's circuit alone")
    rows, marked = [], set()
    for index, (name, value, bar) in enumerate(last.rows()):
        effect = name.rpartition(".")[0].partition("#")[0]
        rows.append((name, ELEMENTS.get(name) or _title(effect), value, bar, *([before.get(name, "-")] if before else [])))
        if "not determined" in bar:
            marked.add(index)
    return Table("Parameters", tuple(columns), tuple(rows), frozenset(marked))


def _residuals(fit: Fit) -> Table:
    known = {p.name: p for p in fit.problem.everything}
    rows, marked = [], set()
    for index, (name, value) in enumerate(fit.nuisance.items()):
        sigma = known[name].sigma
        if sigma and abs(value) > BELIEVABLE_SIGMAS * sigma:
            marked.add(index)
        # The conductance has no unit of its own: it is fitted in multiples of its specification.
        written = "-" if known[name].unit == "1" else show(value, known[name].unit, 2)
        rows.append((name, written, f"{value / sigma:+.2g}" if sigma else "-"))
    return Table(
        "What the fixture's compensation is believed to have left",
        ("residual", "value", "in standard deviations of its specification"),
        tuple(rows),
        frozenset(marked),
    )


def _ladder(steps: tuple[Fit, ...], stored: Sequence[JsonDict]) -> Section:
    rows, marked = [], set()
    for index, step in enumerate(steps):
        if not is_result(step):
            rows.append((model_name(step), "-", "did not converge", "-", "-", "-"))
            marked.add(index)
            continue
        before = steps[index - 1] if index and is_result(steps[index - 1]) else None
        rows.append(
            (
                model_name(step),
                "-" if before is None else f"{before.rms_error_percent:.3g} %",
                f"{step.rms_error_percent:.3g} %",
                f"{step.rms_error_db:.3g} dB",
                f"{step.rms_error_percent / step.floor_percent:.3g}",
                f"{step.chi2_reduced:.4g}",
            )
        )
    columns = ("model", "rms error before", "rms error after", "rms magnitude", "error over noise floor", "chi2_reduced")
    results = _results(steps)
    texts = (f"The paper's circuit fails most at: {spans(compare(steps[0]).where, 4)}.",) if is_result(steps[0]) else ()
    notes = tuple(f"At {' + '.join(step['fit']['effects']) or 'the base'}: {note}." for step in stored for note in step.get("notes", ()))
    pictures = (_picture("ladder", plots.ladder_figure(results), "The error at each step of the ladder."),) if results else ()
    tables = (Table("Models", columns, tuple(rows), frozenset(marked)), _bands_of_steps(results))
    return Section("Ladder", texts + notes, tables, pictures)


def _bands_of_steps(steps: Sequence[Fit]) -> Table:
    """Error per band, a column for each step."""
    by_step = [compare(step).bands for step in steps]
    rows = [
        (bands[0]["sweep"], show_band(*bands[0]["band_hz"]), *(f"{band['rms_error_percent']:.3g} %" for band in bands))
        for bands in zip(*by_step, strict=True)
    ]
    return Table("Error by band at each step", ("sweep", "band", *(model_name(step) for step in steps)), tuple(rows))


def _comparison(comparison: Comparison) -> Section:
    rows, failed = [], set()
    for index, band in enumerate(comparison.bands):
        failing = ", ".join(show_band(*span) for span in band["fails_hz"][:3]) + (" ..." if len(band["fails_hz"]) > 3 else "")
        rows.append(
            (
                band["sweep"],
                show_band(*band["band_hz"]),
                f"{band['rms_error_percent']:.3g} %",
                f"{band['max_error_percent']:.3g} %",
                f"{band['max_error_db']:.3g} dB",
                f"{band['max_phase_deg']:.3g} deg",
                f"{100 * band['share_beyond_uncertainty']:.0f} %",
                band["verdict"].upper(),
                failing or "-",
            )
        )
        if band["verdict"] == "fail":
            failed.add(index)
    columns = ("sweep", "band", "rms error", "max error", "max magnitude", "max phase", "beyond uncertainty", "verdict", "fails at")
    texts = (
        f"Model: {' + '.join(('paper’s circuit', *comparison.effects))}. Tolerance at every point: {tolerance(comparison)}. "
        "A point fails if it is beyond the tolerance and beyond the expanded uncertainty of the measurement (k = 2).",
    )
    picture = _picture("comparison", plots.comparison_figure(comparison), "Error of the model that stands, against uncertainty and tolerance.")
    return Section("Model against measurement", texts, (Table("Bands", columns, tuple(rows), frozenset(failed)),), (picture,))


def _diagnosis(diagnosis: JsonDict) -> Section:
    rows = []
    for candidate in diagnosis["candidates"][:MOST_CANDIDATES]:
        values = ", ".join(
            f"{name} = {show(entry['value'], entry.get('unit', ''))}" + (" (at bound)" if entry["at_bound"] else "")
            for name, entry in candidate["parameters"].items()
        )
        rows.append(
            (
                str(candidate["effect"]),
                str(candidate["family"]),
                _number(candidate["probability"]),
                _number(candidate["delta_bic"]),
                f"{_number(candidate['rms_error_percent'])} %",
                "yes" if candidate["plausible"] else "no, at a bound",
                values,
            )
        )
    columns = ("effect", "family", "probability", "ΔBIC", "error left", "plausible", "fitted parameters")
    sentence = in_words(diagnosis)
    texts = [f"{sentence[:1].upper()}{sentence[1:]}; confidence {100 * diagnosis['confidence']:.0f} %."]
    texts += [str(reason)[:1].upper() + str(reason)[1:] + "." for reason in diagnosis["reasons"]]
    texts += [f"Not told apart by these data: {', '.join(family)}." for family in diagnosis["families"]]
    texts += [_explained(str(name)) for name in diagnosis["effects"]]
    texts.append(f"Measure next: {diagnosis['next_measurement']['why']}.")
    if not rows:
        return Section("Diagnosis", tuple(texts))
    others = len(diagnosis["candidates"]) - len(rows)
    title = "Ranking: each single effect on top of the diagnosed model" + (f" ({others} worse ones not shown)" if others else "")
    return Section(
        "Diagnosis",
        tuple(texts),
        (Table(title, columns, tuple(rows)),),
        (_picture("ranking", plots.ranking_figure(diagnosis), "Evidence of the single effects: how far each lies behind the best."),),
    )


def _number(value: float | None) -> str:
    """A number as it was stored; JSON has nothing for one that is not finite."""
    return "-" if value is None else f"{value:.3g}"


def _title(effect: str) -> str:
    """What an effect is; a stored diagnosis may speak of one that is not installed here."""
    try:
        return find_effect(effect).effect.title
    except BadInput:
        return "not in the catalogue of this installation"


def _explained(name: str) -> str:
    try:
        effect = find_effect(name).effect
    except BadInput:
        return f"{name}: {_title(name)}."
    return f"{name}: {effect.title}. Signature: {effect.signature}. Law: {effect.formula}. Source: {effect.source}."


def _spectra(session: Session) -> Section:
    rows = tuple(
        (
            s.detector,
            s.condition,
            f"{len(s)}",
            show_band(float(s.frequency_hz[0]), float(s.frequency_hz[-1])),
            show(s.resolution_bandwidth_hz, "Hz"),
            f"{s.level_dbuv.max():.1f} dBuV at {show(float(s.frequency_hz[np.argmax(s.level_dbuv)]), 'Hz')}",
            f"{int(s.overload.sum())}",
        )
        for s in session.spectra
    )
    columns = ("detector", "condition", "points", "span", "bandwidth", "highest level", "overloaded points")
    picture = _picture("spectrum", plots.spectrum_figure(session.spectra), "Conducted emission at the LISN.")
    table, prediction = Table("Spectra", columns, rows), session.analysis("prediction")
    if prediction is None:
        return Section("Emission", ("Measured levels; they are not judged against a limit here.",), (table,), (picture,))
    caption = "Measured levels, the levels that source and fitted motor should produce, and the limit."
    return Section(
        "Emission",
        prediction_texts(prediction, session.analysis("emission-diagnosis")),
        (table, *prediction_tables(prediction)),
        (_picture("prediction", prediction_figure(prediction), caption), picture),
    )


def _identity(session: Session, session_sha256: str) -> Section:
    start = session.start
    ages = start.get("calibration_age_days") or {}
    calibrated = [
        f"{role} {day}" + (f" ({ages[role]} days before)" if role in ages else "") for role, day in (start.get("calibrated") or {}).items()
    ]
    facts = (
        ("motor", str(start.get("motor") or "not named")),
        ("operator", str(start.get("operator") or "not stated")),
        ("bench", "simulated" if start.get("backend") == "sim" else str(start.get("backend") or "files that were imported")),
        ("calibrated", ", ".join(calibrated) or "not stated"),
        ("software", str(start.get("software", ""))),
        ("begun (UTC)", str(start.get("time", ""))),
        ("ended", session.status),
        ("imported files", ", ".join(map(str, start.get("imported") or ())) or "-"),
        ("SHA-256 over the hashes of the measured files", session_sha256),
    )
    tables = [Table("Session", ("what", "is"), facts)]
    instruments = []
    for document in session.documents:
        if document["kind"] == "instrument":
            identity = document.get("identity") or {}
            who = " ".join(str(identity[key]) for key in ("vendor", "model") if identity.get(key))
            others = (identity.get("serial"), identity.get("firmware"), document.get("resource"))
            instruments.append((str(document.get("role")), who or "did not say", *(str(value or "-") for value in others)))
    if instruments:
        tables.append(Table("Instruments", ("role", "instrument", "serial", "firmware", "resource"), tuple(instruments)))
    measured = [d for d in session.documents if d["kind"] in ("sweep", "spectrum")]
    sources = iter([str(s.metadata.get("source", "-")) for s in session.sweeps])
    files = tuple(
        (str(d.get("file")), next(sources, "-") if d["kind"] == "sweep" else "-", str(d.get("points")), str(d.get("sha256"))) for d in measured
    )
    if files:
        tables.append(Table("Measured files", ("file", "came from", "points", "SHA-256"), files))
    return Section("Identity", (), tuple(tables))


def _procedure(session: Session) -> Section:
    steps = planned_steps(session)
    if not steps:
        return Section("Procedure", ("No bench procedure: the data were brought in by other means.",))
    rows = tuple((f"{number}", name, settings or "-", state) for number, name, settings, state in steps)
    missed = frozenset(index for index, step in enumerate(steps) if step[3] in ("not begun", "not finished"))
    return Section("Procedure", (), (Table("Steps", ("step", "does", "with", "state"), rows, missed),))
