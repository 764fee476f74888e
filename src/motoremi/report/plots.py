"""Plots over log frequency in ohm, dB and degrees, with the uncertainty as a band and the error below the curves.

Matplotlib is slow to import, so this is done only when a plot is drawn.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from motoremi.arrays import JsonDict
from motoremi.data.measurement import Measurement
from motoremi.data.spectrum import Spectrum
from motoremi.data.sweep import RepeatedSweep
from motoremi.fitting.result import Fit
from motoremi.inspection.compare import Comparison, compare
from motoremi.model.effects.names import as_sum
from motoremi.quantities import percent, show
from motoremi.report.axes import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    arrange,
    frequency_axis,
    grid,
    legend_above,
    literal,
    log_values,
    panels,
)
from motoremi.report.contents import model_name
from motoremi.report.resonance_labels import mark_resonances
from motoremi.report.svg import to_svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "comparison_figure",
    "fit_figure",
    "ladder_figure",
    "measured_figure",
    "ranking_figure",
    "spectrum_figure",
    "sweeps_figure",
    "to_svg",
    "training_figure",
]

TITLES = {"short": "short-circuit sweep (winding)", "open": "open-circuit sweep (terminal to frame)"}
UNCERTAINTY = "expanded uncertainty (k = 2)"
MOST_CANDIDATES = 10
# Below odds of 30 to 1 two candidates count as one family: 2 ln(1/0.03).
DISTINGUISHED = 7.0


def sweeps_figure(base: Fit, best: Fit, height_inch: float = 6.6) -> Figure:
    """Both sweeps: measured, the base model, and the model with its effects; the error in percent below."""
    sweeps = base.measurement.sweeps
    figure, axes = panels(5.0 * len(sweeps), height_inch, 3, len(sweeps), height_ratios=(3, 2, 2))
    models = [(base, model_name(base), VERMILION, "--")]
    if best.effects != base.effects:
        models.append((best, f"with {as_sum(best.effects)}", BLUE, "-"))
    uncertainty = {sweep: curve.uncertainty_percent for sweep, curve in compare(base).curves.items()}
    errors = [fit.errors() for fit, *_ in models]
    for column, sweep in enumerate(sweeps):
        frequency, magnitude = sweep.frequency_hz, np.abs(sweep.mean_ohm)
        expanded = uncertainty[sweep.termination]
        top, middle, bottom = axes[:, column]
        _draw_measured(top, middle, sweep)
        top.fill_between(frequency, magnitude * (1 - np.minimum(expanded, 99) / 100), magnitude * (1 + expanded / 100), color=GREY, alpha=0.5)
        for (fit, name, colour, style), error in zip(models, errors, strict=True):
            modelled = fit.model_ohm(sweep.termination)
            top.plot(frequency, np.abs(modelled), style, color=colour, linewidth=1.2, label=name)
            middle.plot(frequency, np.degrees(np.angle(modelled)), style, color=colour, linewidth=1.2)
            bottom.plot(frequency, 100 * np.abs(error[sweep.termination]), style, color=colour, linewidth=1.0)
        bottom.fill_between(frequency, 1e-6, expanded, color=GREY, alpha=0.5, linewidth=0, label=UNCERTAINTY)
        log_values(bottom)
        bottom.set_ylim(bottom=0.1 * base.floor_percent)
        bottom.set_ylabel("error (%)")
        for panel in (top, middle, bottom):
            frequency_axis(panel, frequency, label=panel is bottom)
    legend_above(figure, axes[0, 0], axes[2, 0])
    return figure


def measured_figure(measurement: Measurement) -> Figure:
    """The sweeps alone, for a session without a model."""
    sweeps = measurement.sweeps
    figure, axes = panels(5.0 * len(sweeps), 4.8, 2, len(sweeps), height_ratios=(3, 2))
    for column, sweep in enumerate(sweeps):
        top, middle = axes[:, column]
        _draw_measured(top, middle, sweep)
        for panel in (top, middle):
            frequency_axis(panel, sweep.frequency_hz, label=panel is middle)
    legend_above(figure, axes[0, 0])
    return figure


def _draw_measured(top: Axes, middle: Axes, sweep: RepeatedSweep) -> None:
    """Measured magnitude in ohm and phase in degrees, drawn broad so that they can be seen behind a model."""
    frequency, magnitude = sweep.frequency_hz, np.abs(sweep.mean_ohm)
    top.plot(frequency, magnitude, color=BLACK, linewidth=3.0, alpha=0.35, label=f"measured, mean of {sweep.repeats}")
    middle.plot(frequency, np.degrees(np.angle(sweep.mean_ohm)), color=BLACK, linewidth=3.0, alpha=0.35)
    log_values(top, prefixes=True)
    mark_resonances(top, frequency, magnitude)
    top.set_title(TITLES[sweep.termination], fontsize=10)
    top.set_ylabel("|Z| (Ω)")
    middle.set_ylabel("phase (deg)")
    middle.set_yticks((-90, -45, 0, 45, 90))


def fit_figure(fit: Fit) -> Figure:
    """Both sweeps against one model."""
    return sweeps_figure(fit, fit)


def comparison_figure(comparison: Comparison) -> Figure:
    """Error, and error of magnitude and of phase, against uncertainty and tolerance; bands shaded, failing points marked."""
    figure, axes = panels(5.0 * len(comparison.curves), 5.8, 3, len(comparison.curves))
    tolerance = comparison.tolerance
    for column, (sweep, curve) in enumerate(comparison.curves.items()):
        expanded = curve.uncertainty_percent
        rows = (
            ("error (%)", curve.error_percent, expanded, tolerance.error_percent),
            ("magnitude error (dB)", np.abs(curve.magnitude_db), 20 * np.log10(1 + expanded / 100), tolerance.magnitude_db),
            ("phase error (deg)", np.abs(curve.phase_deg), np.degrees(expanded / 100), tolerance.phase_deg),
        )
        for panel, (label, error, uncertainty, limit) in zip(axes[:, column], rows, strict=True):
            shown = np.maximum(error, 1e-9)
            panel.fill_between(curve.frequency_hz, 1e-9, uncertainty, color=GREY, alpha=0.5, linewidth=0, label=UNCERTAINTY)
            panel.plot(curve.frequency_hz, shown, color=BLUE, linewidth=1.0, label="error of the model")
            if curve.fails.any():
                panel.plot(curve.frequency_hz[curve.fails], shown[curve.fails], "x", color=VERMILION, markersize=4, label="fails")
            if limit is not None:
                panel.axhline(limit, color=GREEN, linestyle="-.", linewidth=1.4, label=f"tolerance {limit:g} {label.split()[-1].strip('()')}")
            log_values(panel)
            panel.set_ylim(bottom=0.1 * float(np.median(shown)), top=6 * max(float(shown.max()), float(uncertainty.max()), limit or 0.0))
            panel.set_ylabel(label)
            frequency_axis(panel, curve.frequency_hz, label=panel is axes[-1, column])
        _separate_bands(axes[:, column], [band for band in comparison.bands if band["sweep"] == sweep])
        axes[0, column].set_title(TITLES[sweep], fontsize=10)
    legend_above(figure, *axes.flat)
    return figure


def _separate_bands(column: Sequence[Axes], bands: Sequence[JsonDict]) -> None:
    """A line between the bands, and the verdict of each at the top."""
    for number, band in enumerate(bands):
        low, high = band["band_hz"]
        for panel in column if number else ():
            # No shading: the uncertainty is an area.
            panel.axvline(low, color=GREY, linestyle=":", linewidth=0.8, zorder=0)
        failed = band["verdict"] == "fail"
        column[0].annotate(
            band["verdict"].upper() if failed else band["verdict"],
            (float(np.sqrt(low * high)), 0.97),
            xycoords=("data", "axes fraction"),
            ha="center",
            va="top",
            fontsize=8,
            color=VERMILION if failed else BLACK,
            weight="bold" if failed else "normal",
        )


def training_figure(fit: Fit) -> Figure:
    """The training curve: rms deviation over evaluations of the model."""
    from matplotlib.ticker import EngFormatter

    figure, axes = panels(5.0, 3.0)
    panel = axes[0, 0]
    count = [point["evaluations"] for point in fit.history]
    deviation = [point["rms_deviation_percent"] for point in fit.history]
    panel.plot(count, deviation, "o", color=GREY, markersize=3, label="best of the round")
    panel.step(count, np.minimum.accumulate(deviation), where="post", color=BLUE, label="best so far")
    panel.axhline(fit.floor_percent, color=GREEN, linestyle="-.", linewidth=1.2, label="noise and analyser would leave")
    log_values(panel)
    panel.xaxis.set_major_formatter(EngFormatter(sep=" "))
    panel.set_xlabel("evaluations of the model")
    panel.set_ylabel("rms deviation (%)")
    grid(panel)
    legend_above(figure, panel)
    return figure


def ladder_figure(steps: Sequence[Fit]) -> Figure:
    """The error at each step, with the floor that noise and analyser would leave."""
    figure, axes = panels(max(5.0, 1.8 * len(steps)), 3.0)
    panel = axes[0, 0]
    errors = [step.rms_error_percent for step in steps]
    names = [f"+ {step.effects[-1]}" if step.effects else model_name(step) for step in steps]
    panel.plot(range(len(errors)), errors, "o-", color=BLUE, label="error of the model (rms)")
    for number, error in enumerate(errors):
        panel.annotate(percent(error), (number, error), textcoords="offset points", xytext=(7, 4), ha="left", fontsize=9)
    floor = steps[-1].floor_percent
    panel.axhline(floor, color=GREEN, linestyle="-.", linewidth=1.2, label=f"noise and analyser would leave {percent(floor, 2)}")
    log_values(panel)
    panel.set_xlim(-0.4, len(errors) - 0.4)
    panel.set_ylim(0.4 * min(*errors, floor), 4 * max(errors))
    panel.set_xticks(range(len(errors)), names, fontsize=8)
    panel.set_ylabel("rms error (%)")
    grid(panel)
    legend_above(figure, panel)
    return figure


def ranking_figure(diagnosis: JsonDict) -> Figure:
    """ΔBIC of the candidates and the error that each leaves: in percent for impedance, in dB for spectra."""
    from matplotlib.patches import Patch
    from matplotlib.ticker import EngFormatter, NullLocator

    # null was stored for infinite values: such candidates are left out.
    ranked = [c for c in diagnosis["candidates"] if None not in (c["delta_bic"], c["rms_error_percent"])]
    candidates = ranked[:MOST_CANDIDATES]
    figure, axes = panels(7.5, 1.3 + 0.28 * max(3, len(candidates)))
    panel = axes[0, 0]
    named = set(diagnosis["effects"])
    kin = {name for family in diagnosis["families"] for name in family} - named
    looks = {"named": (BLUE, ""), "not distinguished from it": (SKY, "//"), "other": (GREY, "")}
    kinds = ["named" if c["effect"] in named else "not distinguished from it" if c["effect"] in kin else "other" for c in candidates]
    behind = [max(float(c["delta_bic"]), 0.0) + 1 for c in candidates]
    for row, (candidate, kind) in enumerate(zip(candidates, kinds, strict=True)):
        colour, hatch = looks[kind]
        panel.barh(row, behind[row], color=colour, hatch=hatch, edgecolor="white", height=0.65)
        bound = "" if candidate["plausible"] else ", at a bound"
        left = f"{candidate['rms_error_db']:.2g} dB" if diagnosis.get("of") == "emission" else percent(candidate["rms_error_percent"])
        text = f"leaves {left}{bound}"
        place = {"xytext": (5, 0), "textcoords": "offset points", "va": "center", "fontsize": 8}
        panel.annotate(text, (behind[row], row), bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5}, **place)
    panel.axvline(1 + DISTINGUISHED, color=BLACK, linestyle=":", linewidth=1)
    panel.set_xscale("log")
    panel.xaxis.set_major_formatter(EngFormatter(sep=" "))
    panel.xaxis.set_minor_locator(NullLocator())
    # A third more on the log axis holds the text after the longest bar.
    panel.set_xlim(0.8, 3 * max([*behind, 10]) ** 1.4)
    panel.set_ylim(max(len(candidates), 1) - 0.4, -0.6)
    panel.set_yticks(range(len(candidates)), [literal(str(c["effect"])) for c in candidates], fontsize=8)
    panel.set_xlabel("1 + ΔBIC to the best effect: less is better; beyond the dotted line the data distinguish the two", loc="right")
    # The best of effects of which none is needed is not the best explanation.
    said = {"other": "not named: nothing missing is more probable"} if diagnosis["verdict"] == "adequate" else {}
    handles = [
        Patch(facecolor=looks[kind][0], hatch=looks[kind][1], edgecolor="white", label=said.get(kind, kind)) for kind in looks if kind in kinds
    ]
    arrange(figure, 1)
    figure.legend(handles=handles, loc="upper center", borderaxespad=0.2, ncols=3, fontsize=8, frameon=False)
    return figure


# Enough for a prescan with two detectors on both lines and its backgrounds; all differ in grey print.
SPECTRUM_LOOKS = (
    (BLUE, "-"), (ORANGE, "--"), (PURPLE, "-."), (BLACK, ":"),
    (GREEN, (0, (8, 2))), (SKY, (0, (3, 1, 1, 1, 1, 1))), (VERMILION, (0, (1, 3))), (GREY, (0, (6, 1, 1, 1))),
)  # fmt: skip


def spectrum_figure(spectra: Sequence[Spectrum]) -> Figure:
    """Level over frequency; spectra of the same detector, condition and line have the same look."""
    figure, axes = panels(9.0, 3.6)
    panel = axes[0, 0]
    kinds = [(spectrum.detector, spectrum.condition, str(spectrum.metadata.get("line", ""))) for spectrum in spectra]
    detectors = dict.fromkeys(kinds)
    looks = dict(zip(detectors, itertools.cycle(SPECTRUM_LOOKS), strict=False))
    for spectrum, kind in zip(spectra, kinds, strict=True):
        colour, style = looks[kind]
        parts = [spectrum.detector, show(spectrum.resolution_bandwidth_hz, "Hz"), str(spectrum.metadata.get("line", ""))]
        label = ", ".join(text for text in (*parts, "motor off" if spectrum.is_background else "") if text)
        panel.plot(spectrum.frequency_hz, spectrum.level_dbuv, linestyle=style, color=colour, linewidth=0.8, label=label)
        if spectrum.overload.any():
            marked = spectrum.overload
            panel.plot(spectrum.frequency_hz[marked], spectrum.level_dbuv[marked], "x", color=VERMILION, label="receiver overloaded: not judged")
    unit = str(spectra[0].metadata.get("level_unit", "dBuV"))
    panel.set_ylabel(f"level ({unit.replace('u', 'µ')})")
    ends = np.array([min(s.frequency_hz[0] for s in spectra), max(s.frequency_hz[-1] for s in spectra)])
    frequency_axis(panel, ends)
    legend_above(figure, panel)
    return figure
