"""The section Emission: its plots and tables, from the spectra and a stored prediction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from motoremi.arrays import FloatArray, JsonDict
from motoremi.emission.judge import rule_in_words
from motoremi.quantities import show, show_band
from motoremi.report.axes import BLACK, BLUE, GREEN, ORANGE, PURPLE, frequency_axis, legend_above, panels
from motoremi.report.contents import Materials, Picture, Section, Table
from motoremi.report.plots import ranking_figure, spectrum_figure
from motoremi.report.svg import picture
from motoremi.report.words import in_words, lag, levels_of, probability_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from motoremi.data.session import Session
    from motoremi.emission.spectrum_fit import EmissionFit

_COLOURS = {"peak": BLUE, "quasi-peak": PURPLE, "average": ORANGE, "cispr-average": GREEN, "rms-average": BLACK}


def prediction_figure(prediction: JsonDict, height_inch: float = 0.0) -> Figure:
    """Measured levels thin, predicted ones dashed, limits dotted; below, measured minus predicted levels.

    Parameters
    ----------
    prediction : dict
        As `Prediction.to_dict` gives it.
    height_inch : float, optional
        Chosen to fit if not given.
    """
    below = bool(prediction["measured_dbuv"] and prediction["predicted_dbuv"])
    figure, axes = panels(9.0, height_inch or 5.4, 2, 1, height_ratios=(3, 1)) if below else panels(9.0, height_inch or 4.2)
    panel = axes[0, 0]
    frequency = np.array(prediction["frequency_hz"], dtype=np.float64)
    measured = prediction["measured_dbuv"]
    # Not stored by earlier versions.
    guard = _guard_db(prediction, float(prediction.get("expanded_uncertainty_db", 0.0)))
    shown = list(measured) or ["peak", "quasi-peak", "average"]
    for detector in shown:
        if detector in measured:
            panel.plot(frequency, _levels(measured[detector]), color=_COLOURS[detector], linewidth=0.9, label=f"{detector}, measured")
        if detector in prediction["predicted_dbuv"]:
            predicted = _levels(prediction["predicted_dbuv"][detector])
            panel.plot(frequency, predicted, "--", color=_COLOURS[detector], linewidth=1.4, label=f"{detector}, predicted")
    for detector in dict.fromkeys(one["detector"] for one in prediction.get("finals", ())):
        own = [one for one in prediction["finals"] if one["detector"] == detector]
        places, levels = [one["frequency_hz"] for one in own], [one["level_dbuv"] for one in own]
        panel.plot(places, levels, "D", color=_COLOURS[detector], markersize=4, label=f"{detector}, final")
    for detector, bound in prediction["limit_dbuv"].items():
        level = _levels(bound)
        if np.isfinite(level).any():
            panel.plot(frequency, level, ":", color=_COLOURS[detector], linewidth=1.6, label=f"limit, {detector}, with guard band")
            panel.fill_between(frequency, level - guard, level + guard, color=_COLOURS[detector], alpha=0.15, linewidth=0)
    panel.set_ylabel(f"level ({prediction['limit'].get('unit', 'dBuV').replace('u', 'µ')})")
    frequency_axis(panel, frequency, label=not below)
    if below:
        errors = {name: (frequency, _levels(level) - _levels(prediction["predicted_dbuv"][name])) for name, level in measured.items()}
        _residuals(axes[1, 0], frequency, errors)
    legend_above(figure, panel)
    return figure


def _residuals(panel: Axes, frequency_hz: FloatArray, errors: Mapping[str, tuple[FloatArray, FloatArray]]) -> None:
    """Measured minus model for each detector, in dB."""
    panel.axhline(0.0, color=BLACK, linewidth=0.8)
    for detector, (frequency, error) in errors.items():
        panel.plot(frequency, error, color=_COLOURS[detector], linewidth=0.6)
    panel.set_ylabel("measured minus\nmodel (dB)")
    frequency_axis(panel, frequency_hz)


def emission_fit_figure(fit: EmissionFit) -> Figure:
    """Measured levels and the model of the spectra at the fitted frequencies, the difference below."""
    problem, errors = fit.problem, fit.error_db()
    figure, axes = panels(9.0, 5.4, 2, 1, height_ratios=(3, 1))
    top = axes[0, 0]
    for detector, (frequency, error) in errors.items():
        measured = problem.measured_dbuv[problem.where[detector]]
        top.plot(frequency, measured, color=_COLOURS[detector], linewidth=0.9, label=f"{detector}, measured")
        top.plot(frequency, measured - error, "--", color=_COLOURS[detector], linewidth=1.4, label=f"{detector}, model")
    top.set_ylabel("level (dBµV)")
    frequency_axis(top, problem.grid_hz, label=False)
    _residuals(axes[1, 0], problem.grid_hz, errors)
    legend_above(figure, top)
    return figure


def _levels(values: list[float | None]) -> FloatArray:
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)


def prediction_tables(prediction: JsonDict) -> tuple[Table, ...]:
    """Tables of the verdicts, and of the difference between measurement and prediction."""
    tables = [*final_tables(prediction), limit_table(prediction)]
    if prediction["error_bands"]:
        rows = tuple(
            (
                str(row["detector"]),
                f"{row['band_hz'][0] / 1e6:g} - {row['band_hz'][1] / 1e6:g} MHz",
                f"{row['mean_error_db']:+.1f} dB",
                f"{row['rms_error_db']:.1f} dB",
            )
            for row in prediction["error_bands"]
        )
        tables.append(Table("Measured minus predicted", ("detector", "band", "mean", "rms"), rows))
    return tuple(tables)


def limit_table(prediction: JsonDict) -> Table:
    """The verdict on the levels of each detector."""
    judged = tuple(
        (
            levels_of(one),
            str(one["line"]),
            "-" if one["worst_margin_db"] is None else f"{one['worst_margin_db']:+.1f} dB",
            str(one["verdict"] or "none").upper(),
            str(one["why"]),
        )
        for one in prediction["judged"]
    )
    marked = frozenset(index for index, one in enumerate(prediction["judged"]) if one["verdict"] == "fail")
    return Table(f"Against {prediction['limit']['title']}", ("levels of", "limit for", "smallest margin", "verdict", "why"), judged, marked)


def spectra_picture(materials: Materials, height_inch: float = 0.0) -> Picture:
    """The levels with prediction and limit, or the measured levels alone if there is no prediction."""
    prediction = materials.stored("prediction")
    if prediction is None:
        return picture("spectrum", spectrum_figure(materials.session.corrected_spectra), "Conducted emission, corrected levels.")
    predicted = ", the levels that source and fitted motor should produce," if prediction["predicted_dbuv"] else ""
    return picture("prediction", prediction_figure(prediction, height_inch), f"Measured levels{predicted} and the limit with its guard band.")


def final_tables(prediction: JsonDict) -> list[Table]:
    """The final values, if any were measured; earlier versions stored none."""
    finals = prediction.get("finals") or []
    if not finals:
        return []
    unit = prediction["limit"].get("unit", "dBuV")
    columns = (
        "frequency", "detector", "reading", "correction", f"level ({unit})", "limit", "margin", "bandwidth", "dwell", "line", "operating state",
    )  # fmt: skip
    rows = tuple(
        (
            f"{one['frequency_hz'] / 1e6:.6g} MHz",
            one["detector"],
            f"{one['reading_dbuv']:.1f} dBuV",
            f"{one['correction_db']:+.1f} dB",
            f"{one['level_dbuv']:.1f}" + (" or more: overloaded" if one["overload"] else ""),
            "-" if one["limit_dbuv"] is None else f"{one['limit_dbuv']:.1f}",
            "-" if one["margin_db"] is None else f"{one['margin_db']:+.1f} dB",
            show(one["resolution_bandwidth_hz"], "Hz"),
            # A receiver's file need not state it.
            show(one["dwell_s"], "s") if one["dwell_s"] else "-",
            one["line"] or "-",
            one["operating"] or "-",
        )
        for one in finals
    )
    above = frozenset(index for index, one in enumerate(finals) if one["margin_db"] is not None and one["margin_db"] < 0)
    return [Table("Final values, the highest over lines and operating states", columns, rows, above)]


def correction_tables(session: Session) -> tuple[Table, ...]:
    """The receiver's corrections, and raw and corrected levels at the highest point of each spectrum."""
    entries = session.corrections.role("receiver")
    if not entries:
        return ()
    parts = tuple((entry.name, entry.describe().removeprefix(f"{entry.name}: "), entry.file or "-") for entry in entries)
    rows = []
    for read, corrected in zip(session.spectra, session.corrected_spectra, strict=True):
        top = int(np.argmax(corrected.level_dbuv))
        at_hz = corrected.frequency_hz[top : top + 1]
        each = [f"{entry.added_db(at_hz)[0]:+.2f} dB" for entry in entries]
        levels = f"{read.level_dbuv[top]:.1f} dBuV", *each, f"{corrected.level_dbuv[top]:.1f} {session.corrections.level_unit}"
        rows.append((read.detector, read.condition, show(float(at_hz[0]), "Hz"), *levels))
    columns = ("detector", "condition", "at", "reading", *(entry.name for entry in entries), "corrected")
    return (
        Table("Corrections of the receiver's readings: reading + loss - gain + transducer", ("part", "is", "file"), parts),
        Table("Readings and corrected levels, where each spectrum is highest", columns, tuple(rows)),
    )


def rule_of(prediction: JsonDict) -> str:
    """The rule by which levels were judged, in words."""
    uncertainty = float(prediction["expanded_uncertainty_db"])
    return rule_in_words(_guard_db(prediction, uncertainty), uncertainty)


def _guard_db(prediction: JsonDict, uncertainty_db: float) -> float:
    """The guard band; earlier versions stored none, and used the uncertainty."""
    stored = prediction.get("guard_band_db")
    return uncertainty_db if stored is None else float(stored)


def prediction_texts(prediction: JsonDict, diagnosis: JsonDict | None) -> tuple[str, ...]:
    """The verdict in words, what is missing, and what a reader has to know."""
    effects = ", ".join(prediction["effects"]) or "no effect of source or path"
    texts = [f"The {prediction['judged_what']} levels are judged: {str(prediction['verdict']).upper()}."]
    texts += [f"{reason[:1].upper()}{reason[1:]}." for reason in prediction.get("reasons", ())]
    if prediction["predicted_dbuv"]:
        texts.append(f"The prediction holds {effects}.")
    if "expanded_uncertainty_db" in prediction:
        rule = rule_of(prediction)
        texts.append(f"{rule[:1].upper()}{rule[1:]}.")
    if diagnosis is not None:
        texts.append(f"Diagnosis of the spectra: {in_words(diagnosis)}; confidence {100 * diagnosis['confidence']:.0f} %.")
        texts += [str(reason)[:1].upper() + str(reason)[1:] + "." for reason in diagnosis["reasons"]]
        texts += [str(one["text"])[:1].upper() + str(one["text"])[1:] + "." for one in diagnosis["observations"]]
        texts.append(f"Measure next: {diagnosis['next_measurement']['why']}.")
    return (*texts, *(f"{remark[:1].upper()}{remark[1:]}." for remark in prediction["remarks"]))


def emission_section(materials: Materials) -> Section:
    """Measured levels and, if there is a prediction, the comparison with it and with the limit, and the diagnosis of the spectra."""
    session = materials.session
    spectra, unit = session.corrected_spectra, session.corrections.level_unit
    rows = tuple(
        (
            s.detector,
            s.condition,
            str(s.metadata.get("line") or "-"),
            f"{len(s)}",
            show_band(float(s.frequency_hz[0]), float(s.frequency_hz[-1])),
            show(s.resolution_bandwidth_hz, "Hz"),
            f"{s.level_dbuv.max():.1f} {unit} at {show(float(s.frequency_hz[np.argmax(s.level_dbuv)]), 'Hz')}",
            f"{int(s.overload.sum())}",
        )
        for s in spectra
    )
    columns = ("detector", "condition", "line", "points", "span", "bandwidth", "highest level, corrected", "overloaded points")
    drawn = picture("spectrum", spectrum_figure(spectra), "Conducted emission, corrected levels.")
    table, prediction = Table("Spectra", columns, rows), materials.stored("prediction")
    corrected = correction_tables(session)
    if prediction is None:
        return Section("Emission", ("Measured levels; they are not judged against a limit here.",), (table, *corrected), (drawn,))
    diagnosis = materials.stored("emission-diagnosis")
    pictures = [spectra_picture(materials), drawn]
    tables = [table, *corrected, *prediction_tables(prediction)]
    steps = (materials.stored("emission") or {}).get("steps", ())
    if len(steps) > 1:
        tables.append(_ladder(steps))
    if diagnosis is not None and diagnosis["candidates"]:
        tables.append(_ranking(diagnosis))
        pictures.append(picture("emission-ranking", ranking_figure(diagnosis), "Evidence of the effects of source and path."))
    return Section("Emission", prediction_texts(prediction, diagnosis), tuple(tables), tuple(pictures))


def _ladder(steps: Sequence[JsonDict]) -> Table:
    rows = tuple((" + ".join(("source and path", *step["effects"])), f"{step['rms_error_db']:.2g} dB") for step in steps)
    return Table("Models of the spectra, step by step", ("model", "rms error"), rows)


def _ranking(diagnosis: JsonDict) -> Table:
    rows = tuple(
        (
            str(one["effect"]),
            f"{probability_of(one, diagnosis):.3g}",
            lag(one["delta_bic"]),
            f"{one['rms_error_db']:.2g} dB",
            "yes" if one["plausible"] else "no, at a bound",
            ", ".join(f"{name} = {show(entry['value'], entry['unit'])}" for name, entry in one["parameters"].items()),
        )
        for one in diagnosis["candidates"]
    )
    return Table("Ranking of the effects of source and path", ("effect", "probability", "ΔBIC", "error left", "plausible", "parameters"), rows)
