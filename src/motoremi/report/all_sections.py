"""The report's sections: sweeps, fit, ladder, comparison, diagnosis, emission, state, equipment, identity, procedure."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from motoremi.arrays import JsonDict
from motoremi.data.measurement import Measurement
from motoremi.data.noise import Noise, rms_percent
from motoremi.errors import BadInput
from motoremi.fitting.result import Fit
from motoremi.inspection.compare import Comparison, compare
from motoremi.model.effects.names import as_sum
from motoremi.quantities import error_bar, percent, show, show_band
from motoremi.report import plots
from motoremi.report.cause import diagnosis_section, title_of
from motoremi.report.conditions_section import beside_tables
from motoremi.report.contents import Choice, Materials, Picture, Section, Table, is_result, model_name
from motoremi.report.emission_section import emission_section
from motoremi.report.equipment import equipment_section
from motoremi.report.headline import spans
from motoremi.report.identity import identity_section, procedure_section
from motoremi.report.motor_state_section import state_section
from motoremi.report.svg import picture
from motoremi.report.words import beside_the_error, described, number, would_leave

NOISE_SOURCES = {
    "repeats": "the repeats",
    "stated": "stated in the file",
    "scatter": "the sweep's own scatter, which misses slow drift",
}
# What each element stands for, as in docs/paper.md.
ELEMENTS = {
    "Ra": "winding resistance",
    "La": "winding inductance",
    "Ca": "turn-to-turn capacitance",
    "Rr": "resistance of core and bearings",
    "Lr": "inductance of the core",
    "Cr": "capacitance winding to core",
    "Cf": "capacitance winding to frame",
}
# In standard deviations of the specification. A larger residual is more likely an error of the model that the fixture's parameters absorb.
BELIEVABLE_SIGMAS = 3.0
# Error bar over value. With more, not even the order of magnitude is known.
KNOWN_AT_ALL = 3.0
# A derived quantity is determined if its error bar over its value is less, as in `Fit.determined`.
DETERMINED = 0.5
# Height of the figure of the sweeps in inches: it fits on the page of its heading.
SWEEPS_INCH = 4.6


def all_sections(materials: Materials, session_sha256: str, choice: Choice) -> tuple[Section, ...]:
    """Every chosen section that has content; the first page says what is missing."""
    possible = _possible_sections(materials, session_sha256)
    return tuple(section for name, make in possible if choice.holds(name) and (section := make()) is not None)


def _possible_sections(materials: Materials, session_sha256: str) -> Iterator[tuple[str, Callable[[], Section | None]]]:
    """The name of each section that these materials allow, and a function that makes it or returns None: only chosen ones are made and plotted."""
    session, steps, comparison, diagnosis = materials.session, materials.steps, materials.comparison, materials.diagnosis
    if session.sweeps:
        yield "sweeps", lambda: sweeps_section(materials)
    if steps:
        yield "fit", lambda: _fit(steps)
        yield "ladder", lambda: _ladder(steps, session.ladder)
    if comparison is not None:
        yield "comparison", lambda: _comparison(comparison)
    if diagnosis is not None:
        yield "diagnosis", lambda: diagnosis_section(diagnosis, session.analysis("investigation"))
    if session.spectra:
        yield "emission", lambda: emission_section(materials)
    yield "state", lambda: state_section(session)
    yield "equipment", lambda: equipment_section(materials)
    yield "identity", lambda: identity_section(session, session_sha256)
    yield "procedure", lambda: procedure_section(session)


def sweeps_section(materials: Materials) -> Section:
    """The measured sweeps, with the models if there are any."""
    session, results = materials.session, results_of(materials.steps)
    try:
        measurement = results[0].measurement if results else Measurement.of(session.corrected_sweeps)
    except BadInput as error:
        return Section("Sweeps", (f"The sweeps cannot be used together: {error}.",))
    rows = tuple(
        (
            sweep.termination,
            f"{sweep.frequency_hz.size}",
            show_band(float(sweep.frequency_hz[0]), float(sweep.frequency_hz[-1])),
            f"{sweep.repeats}",
            _noise_in_words(noise),
            NOISE_SOURCES[noise.source],
        )
        for sweep, noise in zip(measurement.sweeps, measurement.noise, strict=True)
    )
    texts = [f"Analyser: {measurement.analyser.title}."]
    if measurement.accuracy_percent is not None:
        texts.append(f"Accuracy stated for these data: {measurement.accuracy_percent:g} %; a model within it counts as adequate.")
    table = Table("Sweeps", ("termination", "points", "span", "repeats", "noise of the mean (rms)", "noise known from"), rows)
    tables = (table, *beside_tables(session))
    if not results:
        alone = picture("sweeps", plots.measured_figure(measurement), "Measured impedance, mean of the repeats.")
        return Section("Sweeps", (*texts, *(f"{text[:1].upper()}{text[1:]}." for text in measurement.caveats())), tables, (alone,))
    return Section("Sweeps and model", tuple(texts), tables, (sweeps_picture(results),))


def _noise_in_words(noise: Noise) -> str:
    """Noise of the mean of the repeats, without points that stand out: their low weight is written as a large noise."""
    apart = 0 if noise.outliers is None else int(np.count_nonzero(noise.outliers))
    said = percent(rms_percent([noise.variance[noise.regular]]), 2)
    if not apart:
        return said
    return f"{said} without {apart} point{'s' if apart > 1 else ''} that stand{'' if apart > 1 else 's'} out"


def sweeps_picture(results: Sequence[Fit]) -> Picture:
    """Measurement and models in one figure."""
    caption = "Measured impedance, the paper's circuit, and the current model; below, the error against the uncertainty."
    return picture("sweeps", plots.sweeps_figure(results[0], results[-1], SWEEPS_INCH), caption)


def results_of(steps: Sequence[Fit]) -> tuple[Fit, ...]:
    """The steps that may be quoted (`is_result`); the values of others are not shown."""
    return tuple(step for step in steps if is_result(step))


def _fit(steps: tuple[Fit, ...]) -> Section:
    last = steps[-1]
    caption = f"Training curve of the base fit ({steps[0].method}): the best of each round, and the best so far."
    pictures = (picture("training", plots.training_figure(steps[0]), caption),) if steps[0].history else ()
    if not is_result(last):
        return Section("Fit", ("The fit did not converge; its values are not shown.",), (), pictures)
    texts = [
        f"{'Ant colony of the paper, as printed' if last.method == 'paper' else 'Ant colony with polish'}, seed {last.seed}; "
        f"evaluations of the model at each step: {', '.join(str(step.evaluations) for step in steps)}. "
        f"chi2_reduced {number(last.chi2_reduced, 4)} over noise and analyser as declared ({last.measurement.analyser.title}).",
        f"Error of the circuit {percent(last.rms_error_percent)} rms; {'; '.join(beside_the_error(last))}.",
    ]
    if last.undetermined():
        loose = ", ".join(f"{name} ({_looseness(last, name)})" for name in last.undetermined())
        texts.append(f"The data do not determine {loose}; do not quote values for them.")
    if (other := last.another_solution()) is not None:
        texts.append(f"{other[0].upper()}{other[1:]}.")
    if last.unseen():
        texts.append(f"These sweeps do not show {', '.join(last.unseen())}.")
    if not last.explained:
        texts.append("While an effect is missing, the elements absorb its influence: their values are not those of the motor.")
    tables = [parameters_table(steps), _derived(last)]
    # A circuit with a large error was fitted with an ideal analyser, which has no residuals.
    if any(last.nuisance.values()):
        tables.append(_residuals(last))
    return Section("Fit", tuple(texts), tuple(tables), pictures)


def _looseness(fit: Fit, name: str) -> str:
    """The error bar of an undetermined parameter in words."""
    value, sigma = abs(fit.parameters[name]), fit.sigma[name]
    return error_bar(value, sigma) if sigma < KNOWN_AT_ALL * value else "any value fits"


def _derived(fit: Fit) -> Table:
    """Quantities derived from the elements: often well determined where the elements are not."""
    rows, marked = [], set()
    for index, quantity in enumerate(fit.derived()):
        known = quantity.sigma < DETERMINED * abs(quantity.value)
        bar = error_bar(quantity.value, quantity.sigma) if known else "not determined by these data"
        rows.append((quantity.name, show(quantity.value, quantity.unit), bar))
        if not known:
            marked.add(index)
    return Table("Quantities derived from the elements", ("quantity", "value", "standard uncertainty"), tuple(rows), frozenset(marked))


def parameters_table(steps: tuple[Fit, ...]) -> Table:
    """Values and uncertainties of the current model."""
    base, last = steps[0], steps[-1]
    units = {p.name: p.unit for p in base.motor.parameters}
    columns = ["parameter", "is", "value", "standard uncertainty"]
    before = {name: show(value, units[name]) for name, value in base.parameters.items()} if last.effects != base.effects and is_result(base) else {}
    if before:
        columns.append("in the paper's circuit alone")
    rows, marked = [], set()
    for index, (name, value, bar) in enumerate(last.rows()):
        effect = name.rpartition(".")[0].partition("#")[0]
        rows.append((name, ELEMENTS.get(name) or title_of(effect), value, bar, *([before.get(name, "-")] if before else [])))
        if "not determined" in bar or name in last.at_bounds:
            marked.add(index)
    return Table("Parameters", tuple(columns), tuple(rows), frozenset(marked))


def _residuals(fit: Fit) -> Table:
    """What the fit says of the fixture's compensation: residuals in multiples of their specification, improbable ones marked."""
    known = {p.name: p for p in fit.problem.everything}
    rows, marked = [], set()
    for index, (name, value) in enumerate(fit.nuisance.items()):
        sigma = known[name].sigma
        if sigma and abs(value) > BELIEVABLE_SIGMAS * sigma:
            marked.add(index)
        # The conductance is fitted in multiples of its specification, which depends on frequency.
        written = f"{value:.2g} times its specification" if known[name].unit == "1" else show(value, known[name].unit, 2)
        rows.append((name, written, f"{value / sigma:+.2g}" if sigma else "-"))
    return Table(
        "Estimated residuals of the fixture's compensation",
        ("residual", "value", "in standard deviations of its specification"),
        tuple(rows),
        frozenset(marked),
    )


def _ladder(steps: tuple[Fit, ...], stored: Sequence[JsonDict]) -> Section:
    """The models so far with their errors; `stored` are the same steps as the session has them, with the notes that were made then."""
    rows, marked = [], set()
    for index, step in enumerate(steps):
        if not is_result(step):
            rows.append((model_name(step), "-", "did not converge", "-", "-", "-", "-"))
            marked.add(index)
            continue
        before = steps[index - 1] if index and is_result(steps[index - 1]) else None
        rows.append(
            (
                model_name(step),
                "-" if before is None else percent(before.rms_error_percent),
                percent(step.rms_error_percent),
                f"{step.rms_error_db:.3g} dB",
                "-" if step.measurement.analyser.ideal else f"{percent(step.corrected_error_percent)} ({step.analyser_sigma:.1f} sigma)",
                described(step.unexplained_percent),
                number(step.chi2_reduced, 4),
            )
        )
    columns = ("model", "rms error before", "rms error after", "rms magnitude", "analyser's likely error subtracted", "the circuit", "chi2_reduced")
    results = results_of(steps)
    texts = [f"The paper's circuit fails most at: {spans(compare(steps[0]).where, 4)}."] if is_result(steps[0]) else []
    texts.append(f"Of a perfect model {would_leave(steps[-1].floor_percent, steps[-1].noise_percent)}.")
    notes = tuple(f"At {as_sum(step['fit']['effects']) or 'the base'}: {note}." for step in stored for note in step.get("notes", ()))
    pictures = (picture("ladder", plots.ladder_figure(results), "The error at each step of the ladder."),) if results else ()
    tables = (Table("Models", columns, tuple(rows), frozenset(marked)), _bands_of_steps(results))
    return Section("Ladder", (*texts, *notes), tables, pictures)


def _bands_of_steps(steps: Sequence[Fit]) -> Table:
    """Error per band, a column for each step."""
    by_step = [compare(step).bands for step in steps]
    rows = [
        (bands[0]["sweep"], show_band(*bands[0]["band_hz"]), *(percent(band["rms_error_percent"]) for band in bands))
        for bands in zip(*by_step, strict=True)
    ]
    return Table("Error by band at each step", ("sweep", "band", *(model_name(step) for step in steps)), tuple(rows))


def bands_table(comparison: Comparison) -> Table:
    """The verdict on each band."""
    rows, failed = [], set()
    for index, band in enumerate(comparison.bands):
        failing = ", ".join(show_band(*span) for span in band["fails_hz"][:3]) + (" ..." if len(band["fails_hz"]) > 3 else "")
        rows.append(
            (
                band["sweep"],
                show_band(*band["band_hz"]),
                percent(band["rms_error_percent"]),
                percent(band["max_error_percent"]),
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
    return Table("Bands", columns, tuple(rows), frozenset(failed))


def _comparison(comparison: Comparison) -> Section:
    texts = (
        f"Model: {as_sum(('paper’s circuit', *comparison.effects))}. Tolerance at every point: {comparison.tolerance.in_words}. "
        "A point fails if it is beyond the tolerance and beyond the expanded uncertainty of the measurement (k = 2).",
    )
    drawn = picture("comparison", plots.comparison_figure(comparison), "Error of the current model against uncertainty and tolerance.")
    return Section("Model against measurement", texts, (bands_table(comparison),), (drawn,))
