"""Labels of the resonances of a sweep, beside its curve."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from motoremi.arrays import FloatArray
from motoremi.quantities import show
from motoremi.report.axes import BLACK
from motoremi.report.peaks import clear_maxima

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# A resonance is labelled if |Z| falls, or rises, by at least this much on both sides.
CLEAR_DB = 3.0
# A line of text below the curve takes this share of a low panel.
NAME_SHARE = 0.3
# In points: height of the letters and of a line, width for each letter, distance from the mark.
SIZE, LINE, LETTER, GAP = 8.0, 10.0, 4.9, 6.0
# Where a label may stand: direction from the mark, and the alignment that goes with it. The first is preferred.
PEAK = ((1, 0.5), (-1, 0.5), (0, 1), (1, 1), (-1, 1), (1, -1), (-1, -1))
DIP = ((0, -1), (1, -0.5), (-1, -0.5), (1, -1), (-1, -1), (1, 1), (-1, 1))
ALIGNED = {-1: "right", 0: "center", 1: "left"}
# (left, right, bottom, top) in points.
Box = tuple[float, float, float, float]


def mark_resonances(axes: Axes, frequency_hz: FloatArray, magnitude_ohm: FloatArray) -> None:
    """Mark the clear maxima and minima of |Z| and write their frequencies where they cover neither the curve nor each other."""
    low, high = float(magnitude_ohm.min()), float(magnitude_ohm.max())
    axes.set_ylim(low / max(2.0, (high / low) ** NAME_SHARE), high * 2.5)
    level = 20 * np.log10(magnitude_ohm)
    marks = [(index, sign) for sign in (1, -1) for index in clear_maxima(sign * level, CLEAR_DB)]
    across, up = _in_points(axes, frequency_hz, magnitude_ohm)
    # One place for each typographic point of its length: the sweep's own points lie too far apart where the curve is steep.
    length = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(across), np.diff(up)))])
    everywhere = np.arange(0.0, length[-1])
    curve_across, curve_up = np.interp(everywhere, length, across), np.interp(everywhere, length, up)
    width, height = _size(axes)
    covered: list[Box] = [(across[at] - 3, across[at] + 3, up[at] - 3, up[at] + 3) for at, _ in marks]
    for number, (at, sign) in enumerate(marks):
        place = (frequency_hz[at], magnitude_ohm[at])
        axes.plot(*place, "v" if sign > 0 else "^", color=BLACK, markersize=4)
        text = show(float(frequency_hz[at]), "Hz", 3)
        others = [box for other, box in enumerate(covered) if other != number]
        ways = PEAK if sign > 0 else DIP
        boxes = [_box(way, text, across[at], up[at]) for way in ways]
        hidden = []
        for box in boxes:
            left, right, bottom, top = box
            points = np.count_nonzero((curve_across >= left) & (curve_across <= right) & (curve_up >= bottom) & (curve_up <= top))
            beyond = left < 0 or right > width or bottom < 0 or top > height
            # Cost of a place: each covered point of the curve 1, overlap with other labels 50 times its area, a place beyond the panel 1000.
            hidden.append(points + 50 * sum(_overlap(box, other) for other in others) + 1000 * beyond)
        chosen = int(np.argmin(hidden))
        best = ways[chosen]
        covered.append(boxes[chosen])
        axes.annotate(
            text,
            place,
            textcoords="offset points",
            xytext=(GAP * best[0], GAP * best[1]),
            ha=ALIGNED[int(np.sign(best[0]))],
            va="bottom" if best[1] > 0 else "top",
            fontsize=SIZE,
        )


def _size(axes: Axes) -> tuple[float, float]:
    box = axes.get_window_extent()
    points = 72 / axes.figure.dpi
    return float(box.width * points), float(box.height * points)


def _in_points(axes: Axes, frequency_hz: FloatArray, magnitude_ohm: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The curve in points from the panel's corner."""
    width, height = _size(axes)
    low, high = np.log(axes.get_ylim())
    place = np.log(frequency_hz / frequency_hz[0]) / np.log(frequency_hz[-1] / frequency_hz[0]) * width
    level = (np.log(magnitude_ohm) - low) / (high - low) * height
    return place, level


def _box(way: tuple[float, float], text: str, across: float, up: float) -> Box:
    """What a label covers, in points."""
    width = LETTER * len(text)
    left = across + GAP * way[0] - {-1: width, 0: width / 2, 1: 0.0}[int(np.sign(way[0]))]
    bottom = up + GAP * way[1] - (0.0 if way[1] > 0 else LINE)
    return left, left + width, bottom, bottom + LINE


def _overlap(one: Box, other: Box) -> bool:
    return one[0] < other[1] and other[0] < one[1] and one[2] < other[3] and other[2] < one[3]
