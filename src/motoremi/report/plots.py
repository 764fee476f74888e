"""Plots as a bench engineer draws them: log frequency, dB and degrees, the uncertainty as a band, the error under the curve.

Matplotlib is heavy, so it is imported when a plot is asked for. Colours are Okabe and Ito's; line styles differ as well, for grey prints.
"""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from motoremi.arrays import FloatArray, JsonDict
from motoremi.data.spectrum import Spectrum
from motoremi.diagnosis.compare import Comparison
from motoremi.fitting.result import Fit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION, PURPLE = "#000000", "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00", "#CC79A7"
TITLES = {"short": "short-circuit sweep (winding)", "open": "open-circuit sweep (terminal to frame)"}


def _figure(width: float, height: float, rows: int, columns: int, **grid: Any) -> tuple[Figure, Any]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False, gridspec_kw=grid or None)


def _log_frequency(axes: Axes, label: bool = True) -> None:
    from matplotlib.ticker import EngFormatter, LogLocator, NullFormatter

    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 3.0)))
    axes.xaxis.set_major_formatter(EngFormatter(sep=" "))
    axes.xaxis.set_minor_locator(LogLocator(subs=tuple(np.arange(2, 10))))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.grid(True, which="major", color="#cccccc", linewidth=0.6)
    axes.grid(True, which="minor", color="#eeeeee", linewidth=0.4)
    if label:
        axes.set_xlabel("frequency (Hz)")


def _resonances(frequency_hz: FloatArray, magnitude: FloatArray) -> list[int]:
    """Indices of the clear maxima and minima of |Z|."""
    from scipy.signal import find_peaks

    level = 20 * np.log10(magnitude)
    found = np.concatenate([find_peaks(level, prominence=3)[0], find_peaks(-level, prominence=3)[0]])
    return sorted(int(index) for index in found)


def sweeps_figure(base: Fit, best: Fit) -> Figure:
    """Both sweeps: measured, the base model, and the model with its effects; the error in percent below."""
    from matplotlib.ticker import EngFormatter

    sweeps = base.measurement.sweeps
    figure, axes = _figure(5.2 * len(sweeps), 6.6, 3, len(sweeps), height_ratios=(3, 2, 2))
    models = [(base, "paper's circuit" if not base.effects else " + ".join(base.effects), VERMILION, "--")]
    if best.effects != base.effects:
        models.append((best, "with " + " + ".join(best.effects), BLUE, "-"))
    for column, (sweep, noise) in enumerate(zip(sweeps, base.measurement.noise, strict=True)):
        frequency, measured = sweep.frequency_hz, sweep.mean_ohm
        systematic = base.measurement.analyser.uncertainty(frequency, measured)
        expanded = 200 * np.sqrt(2 * noise.sigma**2 + systematic**2)
        top, middle, bottom = axes[:, column]
        top.loglog(frequency, np.abs(measured), color=BLACK, linewidth=2.4, alpha=0.45, label=f"measured, mean of {sweep.repeats}")
        middle.plot(frequency, np.degrees(np.angle(measured)), color=BLACK, linewidth=2.4, alpha=0.45)
        for fit, name, colour, style in models:
            modelled = fit.model_ohm(sweep.termination)
            top.plot(frequency, np.abs(modelled), style, color=colour, linewidth=1.2, label=name)
            middle.plot(frequency, np.degrees(np.angle(modelled)), style, color=colour, linewidth=1.2)
            bottom.loglog(frequency, 100 * np.abs(fit.errors()[sweep.termination]), style, color=colour, linewidth=1.0)
        for index in _resonances(frequency, np.abs(measured)):
            top.annotate(
                EngFormatter(places=2, sep=" ")(frequency[index]) + "Hz",
                (frequency[index], np.abs(measured[index])),
                textcoords="offset points",
                xytext=(4, 4),
                fontsize=7,
            )
        bottom.fill_between(frequency, 1e-4, expanded, color="#bbbbbb", alpha=0.5, label="expanded uncertainty (k = 2)")
        bottom.set_ylim(bottom=1e-3)
        top.set_title(TITLES[sweep.termination], fontsize=10)
        top.set_ylabel("|Z| (Ω)")
        top.yaxis.set_major_formatter(EngFormatter(sep=" "))
        middle.set_ylabel("phase (deg)")
        middle.set_yticks((-90, -45, 0, 45, 90))
        bottom.set_ylabel("error (%)")
        for row, panel in enumerate((top, middle, bottom)):
            _log_frequency(panel, label=row == 2)
        top.legend(fontsize=7, loc="best")
        bottom.legend(fontsize=7, loc="best")
    return figure


def fit_figure(fit: Fit) -> Figure:
    """Both sweeps against one model."""
    return sweeps_figure(fit, fit)


def comparison_figure(comparison: Comparison) -> Figure:
    """Error of magnitude and phase over frequency against the uncertainty; points that fail are marked."""
    figure, axes = _figure(5.2 * len(comparison.curves), 5.4, 3, len(comparison.curves))
    for column, (sweep, curve) in enumerate(comparison.curves.items()):
        tolerance = comparison.tolerance
        expanded = curve.uncertainty_percent
        panels = (
            ("error (%)", curve.error_percent, expanded, tolerance.error_percent),
            ("magnitude error (dB)", np.abs(curve.magnitude_db), 20 * np.log10(1 + expanded / 100), tolerance.magnitude_db),
            ("phase error (deg)", np.abs(curve.phase_deg), np.degrees(expanded / 100), tolerance.phase_deg),
        )
        for row, (label, error, uncertainty, limit) in enumerate(panels):
            panel = axes[row, column]
            panel.loglog(curve.frequency_hz, np.maximum(error, 1e-6), color=BLUE, linewidth=1.0)
            panel.fill_between(curve.frequency_hz, 1e-6, uncertainty, color="#bbbbbb", alpha=0.5, label="expanded uncertainty (k = 2)")
            panel.plot(curve.frequency_hz[curve.fails], error[curve.fails], ".", color=VERMILION, markersize=4, label="fails")
            if limit is not None:
                panel.axhline(limit, color=GREEN, linestyle="-.", linewidth=1.2, label=f"tolerance {limit:g}")
            panel.set_ylim(bottom=max(1e-5, 0.1 * float(np.median(np.maximum(error, 1e-5)))))
            panel.set_ylabel(label)
            _log_frequency(panel, label=row == 2)
        axes[0, column].set_title(TITLES[sweep], fontsize=10)
        axes[0, column].legend(fontsize=7)
    return figure


def training_figure(fit: Fit) -> Figure:
    """The training curve: rms deviation over evaluations of the model."""
    from matplotlib.ticker import EngFormatter

    figure, axes = _figure(5.2, 2.8, 1, 1)
    panel = axes[0, 0]
    count = [point["evaluations"] for point in fit.history]
    deviation = np.minimum.accumulate([point["rms_deviation_percent"] for point in fit.history])
    panel.step(count, deviation, where="post", color=BLUE, marker="." if len(count) < 60 else "", label="best so far")
    panel.axhline(fit.floor_percent, color=GREEN, linestyle="-.", linewidth=1.2, label="random noise")
    panel.set_yscale("log")
    panel.xaxis.set_major_formatter(EngFormatter(sep=" "))
    panel.set_xlabel("evaluations of the model")
    panel.set_ylabel("rms deviation (%)")
    panel.grid(True, which="both", color="#eeeeee")
    panel.legend(fontsize=7)
    return figure


def ladder_figure(steps: Sequence[Fit]) -> Figure:
    """The error falling step by step, with the noise floor."""
    figure, axes = _figure(5.2, 2.8, 1, 1)
    panel = axes[0, 0]
    errors = [step.rms_error_percent for step in steps]
    names = ["paper's circuit", *(f"+ {step.effects[-1]}" for step in steps[1:])]
    bars = panel.bar(range(len(errors)), errors, color=[VERMILION, *[BLUE] * (len(errors) - 1)], width=0.55)
    for bar, error in zip(bars, errors, strict=True):
        panel.annotate(f"{error:.3g} %", (bar.get_x() + bar.get_width() / 2, error), ha="center", va="bottom", fontsize=8)
    panel.axhline(steps[-1].floor_percent, color=GREEN, linestyle="-.", linewidth=1.2, label="noise floor")
    panel.set_yscale("log")
    panel.set_ylim(0.4 * min(*errors, steps[-1].floor_percent), 3 * max(errors))
    panel.set_xticks(range(len(errors)), names, fontsize=8)
    panel.set_ylabel("rms error (%)")
    panel.legend(fontsize=7)
    return figure


def ranking_figure(diagnosis: JsonDict) -> Figure:
    """Candidates by evidence: how far each lies behind the best."""
    candidates = diagnosis["candidates"][:10]
    figure, axes = _figure(6.4, 0.9 + 0.27 * max(3, len(candidates)), 1, 1)
    panel = axes[0, 0]
    named = set(diagnosis["effects"])
    kin = {name for family in diagnosis["families"] for name in family} - named
    colours = [BLUE if c["effect"] in named else SKY if c["effect"] in kin else "#bbbbbb" for c in candidates]
    behind = [max(float(c["delta_bic"]), 0.0) + 1 for c in candidates]
    panel.barh(range(len(candidates)), behind, color=colours, height=0.6)
    panel.set_xscale("log")
    panel.set_xlim(0.8, 3 * max([*behind, 10]))
    panel.invert_yaxis()
    panel.set_yticks(range(len(candidates)), [c["effect"] for c in candidates], fontsize=8)
    for row, candidate in enumerate(candidates):
        text = f"  χ² {candidate['chi2_reduced']:.3g}" + ("" if candidate["plausible"] else ", at a bound")
        panel.annotate(text, (behind[row], row), va="center", fontsize=7)
    panel.set_xlabel("1 + ΔBIC to the best (less is better); dark: named, light: not told apart from it")
    return figure


def spectrum_figure(spectra: Sequence[Spectrum]) -> Figure:
    """Level over frequency for each detector."""
    figure, axes = _figure(7.2, 3.2, 1, 1)
    panel = axes[0, 0]
    for spectrum, colour, style in zip(spectra, (BLUE, ORANGE, GREEN, PURPLE, BLACK) * len(spectra), ("-", "--", "-.", ":") * len(spectra)):  # noqa: B905
        panel.plot(spectrum.frequency_hz, spectrum.level_dbuv, style, color=colour, linewidth=0.8, label=spectrum.detector)
        panel.plot(spectrum.frequency_hz[spectrum.overload], spectrum.level_dbuv[spectrum.overload], "x", color=VERMILION)
    panel.set_ylabel("level (dBµV)")
    _log_frequency(panel)
    panel.legend(fontsize=7)
    return figure


def to_svg(figure: Figure, name: str) -> str:
    """An SVG element to put into a page: same figure, same bytes; ids are unique by `name`."""
    import matplotlib

    buffer = io.BytesIO()
    # A fixed salt makes ids, and so the bytes, reproducible; text stays text, which is small and can be searched.
    with matplotlib.rc_context({"svg.hashsalt": name, "svg.fonttype": "none", "path.simplify": True}):
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    text = buffer.getvalue().decode("utf-8")
    text = text[text.index("<svg") :]
    text = re.sub(r'(\bid="|url\(#|xlink:href="#)', rf"\g<1>{name}-", text)
    return re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL).replace("<svg", f'<svg role="img" aria-label="{name}"', 1)
