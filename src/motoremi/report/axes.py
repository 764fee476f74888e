"""Axes: log frequency with engineering prefixes, plain numbers, a grid, and room for all texts."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from motoremi.arrays import FloatArray
from motoremi.data.text import clean_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's colours, distinguishable with any colour vision; line styles differ as well, for grey prints.
BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION, PURPLE = "#000000", "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00", "#CC79A7"
GREY = "#bbbbbb"
LONGEST_LABEL = 60
# Room for texts in inches; matplotlib's own layout would take a quarter of the time of a report.
EDGE, LINE, TICK, BELOW, BETWEEN = 0.07, 0.19, 0.18, 0.52, 0.16
TITLE, LEGEND_LINE, LETTER = 0.28, 0.19, 0.0085
RIGHT = 0.25
# The narrowest figure, of one sweep, is as wide as 60 letters of the legend. A sample of the line stands before each label (inches).
LEGEND_COLUMNS, LEGEND_LETTERS, LEGEND_POINTS, LEGEND_SAMPLE = 4, 60, 8, 0.5


def panels(width: float, height: float, rows: int = 1, columns: int = 1, **grid: Any) -> tuple[Figure, Any]:
    """A figure (size in inches) and its axes in rows and columns; panels above each other share their frequencies."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height))
    return figure, figure.subplots(rows, columns, squeeze=False, sharex="col" if rows > 1 else False, gridspec_kw=grid or None)


def frequency_axis(axes: Axes, frequency_hz: FloatArray, label: bool = True) -> None:
    """A logarithmic frequency axis, with a number at both ends and at every decade."""
    from matplotlib.ticker import EngFormatter, FixedLocator, FuncFormatter, NullLocator

    engineering = EngFormatter(sep=" ")
    low, high = float(frequency_hz[0]), float(frequency_hz[-1])
    if low == high:
        # A final value: one frequency alone is in the middle.
        low, high = low / 2, high * 2
    decades = 10.0 ** np.arange(np.ceil(np.log10(low)), np.floor(np.log10(high)) + 1)
    # With few decades there are labels at 3, 30, ... too; labels closer than a factor of 1.5 would overlap.
    between = 3 * decades if np.log10(high / low) < 4 else np.array([])
    ends = np.array([low, high])
    inner = [f for f in sorted([*decades, *between]) if np.all(np.abs(np.log(f / ends)) > np.log(1.5)) and low < f < high]
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    axes.xaxis.set_major_locator(FixedLocator([low, *inner, high]))
    # Three digits: a receiver's last step may end at 29.9985 MHz.
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: engineering(float(f"{value:.3g}"))))
    axes.xaxis.set_minor_locator(NullLocator())
    grid(axes)
    _minor_grid(axes, low, high)
    if label:
        axes.set_xlabel("frequency (Hz)")


def _minor_grid(axes: Axes, low_hz: float, high_hz: float) -> None:
    """Grid lines at 2, 3, ... 9 of each decade, as one artist: minor ticks would take most of the time of a report."""
    from matplotlib.collections import LineCollection

    decades = 10.0 ** np.arange(np.floor(np.log10(low_hz)), np.ceil(np.log10(high_hz)))
    inside = [f for f in np.outer(decades, np.arange(2, 10)).ravel() if low_hz < f < high_hz]
    lines = LineCollection(
        [[(f, 0.0), (f, 1.0)] for f in inside], colors="#eeeeee", linewidths=0.4, zorder=0.5, transform=axes.get_xaxis_transform()
    )
    axes.add_artist(lines)


def log_values(axes: Axes, prefixes: bool = False) -> None:
    """A logarithmic axis with 0.01, 0.1, 1, 10 in place of powers; with `prefixes`, 1 k and 10 k for large values."""
    from matplotlib.ticker import EngFormatter, FuncFormatter, NullLocator

    axes.set_yscale("log")
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(EngFormatter(sep=" ") if prefixes else FuncFormatter(lambda value, _: f"{value:g}"))


def grid(axes: Axes) -> None:
    """A grid behind the curves."""
    axes.set_axisbelow(True)
    axes.grid(True, which="major", color="#cccccc", linewidth=0.6)


def legend_above(figure: Figure, *sources: Axes) -> None:
    """One legend for the whole figure, above the panels, with as many columns as the figure is wide enough for."""
    found = {label: handle for axes in sources for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    entries = {textwrap.fill(label, LEGEND_LETTERS, break_on_hyphens=False): handle for label, handle in found.items()}
    columns = _legend_columns(list(entries), float(figure.get_figwidth()))
    arrange(figure, -(-len(entries) // columns) + sum(label.count("\n") for label in entries))
    figure.legend(
        list(entries.values()), list(entries), loc="upper center", borderaxespad=0.2, ncols=columns, fontsize=LEGEND_POINTS, frameon=False
    )


def _legend_columns(labels: list[str], width: float) -> int:
    """How many columns of labels, filled one after the other, are no wider than `width` in inches."""
    for columns in range(min(LEGEND_COLUMNS, len(labels)), 1, -1):
        longest = [max(len(line) for label in column for line in label.split("\n")) for column in np.array_split(labels, columns)]
        if LETTER * LEGEND_POINTS * sum(longest) + LEGEND_SAMPLE * columns <= width:
            return columns
    return 1


def arrange(figure: Figure, legend_lines: int) -> None:
    """Leave room for labels, titles and the legend around the panels."""
    width, height = figure.get_size_inches()
    every = figure.axes
    spec = every[0].get_gridspec()
    rows, columns = spec.get_geometry() if spec is not None else (1, 1)
    titled = any(axes.get_title() for axes in every)
    named = LINE * max(1 + axes.get_ylabel().count("\n") if axes.get_ylabel() else 0 for axes in every)
    left = EDGE + named + max(_tick_labels_in(axes) for axes in every) + TICK
    top = EDGE + TITLE * titled + LEGEND_LINE * legend_lines
    panel_width = width / columns - left - RIGHT
    panel_height = (height - top - BELOW - BETWEEN * (rows - 1)) / rows
    figure.subplots_adjust(
        left=left / width,
        right=1 - RIGHT / width,
        bottom=BELOW / height,
        top=1 - top / height,
        wspace=(left + RIGHT) / panel_width,
        hspace=BETWEEN / panel_height,
    )
    for axes in every:
        # Fixed, so that matplotlib need not measure tick labels, and aligned in one column.
        axes.yaxis.set_label_coords((EDGE + named - left) / panel_width, 0.5)


def _tick_labels_in(axes: Axes) -> float:
    """Width of the longest number or name beside a vertical axis, in inches."""
    low, high = sorted(axes.get_ylim())
    axis = axes.yaxis
    shown = axis.get_major_formatter().format_ticks([value for value in axis.get_majorticklocs() if low <= value <= high])
    points = float(axis.get_majorticklabels()[0].get_fontsize()) if shown else 0.0
    return LETTER * points * max(map(len, shown), default=0)


def literal(text: str) -> str:
    """Text from outside with control characters escaped, and `$`, which matplotlib would read as the start of a formula."""
    return clean_text(text, LONGEST_LABEL).replace("$", r"\$")
