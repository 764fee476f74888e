"""Plot of what an element would have to be at each frequency."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from motoremi.inspection.element import ElementCurve, Inspection
from motoremi.report.axes import BLACK, BLUE, ORANGE, VERMILION, frequency_axis, legend_above, panels

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAMES = {
    "H": ("inductance (H)", "loss tangent"),
    "F": ("capacitance (F)", "loss tangent"),
    "Ohm": ("resistance (Ω)", "reactance (Ω)"),
    "S": ("conductance (S)", "susceptance (S)"),
    "s": ("delay (s)", "imaginary part (s)"),
    "1": ("factor, real part", "factor, imaginary part"),
}


def inspection_figure(inspection: Inspection) -> Figure:
    """Value above, losses below, a column for each sweep; the band is twice the standard uncertainty."""
    figure, axes = panels(5.0 * len(inspection.curves), 5.4, 2, len(inspection.curves), height_ratios=(3, 2))
    upper, lower = NAMES[inspection.unit]
    for column, curve in enumerate(inspection.curves):
        top, bottom = axes[:, column]
        _draw(inspection, curve, top, bottom)
        top.set_title(f"{inspection.element} as the {curve.termination}-circuit sweep requires it", fontsize=10)
        top.set_ylabel(upper)
        bottom.set_ylabel(lower)
        top.yaxis.set_major_formatter(_engineering())
        if inspection.unit not in ("H", "F", "1"):
            bottom.yaxis.set_major_formatter(_engineering())
        for panel in (top, bottom):
            frequency_axis(panel, curve.frequency_hz, label=panel is bottom)
    legend_above(figure, *axes[0])
    return figure


def _engineering() -> object:
    from matplotlib.ticker import EngFormatter

    return EngFormatter(sep=" ")


def _draw(inspection: Inspection, curve: ElementCurve, top: Axes, bottom: Axes) -> None:
    known, f = curve.known, curve.frequency_hz
    lossy = inspection.unit in ("H", "F")
    # Both parts: with a plain nan the imaginary part would be 0.
    value = np.where(known, curve.value, complex(np.nan, np.nan))
    spread = 2 * np.where(known, curve.sigma_relative, np.nan) * np.abs(value)
    # For the loss tangent, the uncertainty of the imaginary part dominates.
    second, margin = (-value.imag / value.real, np.abs(spread / value.real)) if lossy else (value.imag, spread)
    model = -curve.model.imag / curve.model.real if lossy else curve.model.imag
    for axes, needed, width, has in ((top, value.real, spread, curve.model.real), (bottom, second, margin, model)):
        axes.fill_between(f, needed - width, needed + width, color=ORANGE, alpha=0.35, linewidth=0, label="expanded uncertainty (k = 2)")
        axes.plot(f, needed, color=BLACK, linewidth=1.2, label="what it would have to be")
        axes.plot(f, has, "--", color=VERMILION, linewidth=1.2, label="the model's")
        _limit(axes, f, needed, width, has)
    tried = inspection.laws.get(curve.termination)
    if tried and known.any():
        law = tried[0].value(f[known])
        top.plot(f[known], law.real, ":", color=BLUE, linewidth=1.6, label="nearest simple law")
        bottom.plot(f[known], -law.imag / law.real if lossy else law.imag, ":", color=BLUE, linewidth=1.6)


def _limit(axes: Axes, frequency_hz: np.ndarray, needed: np.ndarray, width: np.ndarray, has: np.ndarray) -> None:
    """Limit the axis to what the element would have to be, the model, and the uncertainty of the better-known half of the points.

    Where the worst-known fifth of the points would leave the others less than a third of the axis, it is cut there, with a mark for each point.
    """
    finite = np.isfinite(needed)
    if not finite.any():
        return
    good = finite & (width <= np.nanquantile(width, 0.8))
    better = finite & (width <= np.nanmedian(width))
    edges = np.concatenate([needed[better] - width[better], needed[better] + width[better], needed[good], has[good]])
    low, high = float(edges.min()), float(edges.max())
    least, most = min(low, float(needed[finite].min())), max(high, float(needed[finite].max()))
    if most - least <= 3 * (high - low):
        low, high = least, most
    margin = 0.08 * (high - low) + 0.01 * max(abs(low), abs(high))
    low, high = low - margin, high + margin
    axes.set_ylim(low, high)
    for beyond, edge, mark in ((needed > high, high, "^"), (needed < low, low, "v")):
        if beyond.any():
            axes.plot(frequency_hz[beyond], np.full(np.count_nonzero(beyond), edge), mark, color=BLACK, markersize=4, clip_on=False)
