"""Labels of the resonances of a sweep, beside its curve: each where it covers neither the curve nor another label, as far as possible."""

from __future__ import annotations

from collections.abc import Sequence
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
# Room for labels on the axis of |Z|: below the curve the first factor, or this share of the curve's own decades if that is more; above it the last.
LEAST_BELOW, SHARE_BELOW, ABOVE = 2.0, 0.3, 2.5
# All lengths are in typographic points, as font sizes are: height of the letters and of a line, width for each letter, distance of a label from its
# mark, and half the width of a mark.
SIZE, LINE, LETTER, GAP, HALF_MARK = 8.0, 10.0, 4.9, 6.0, 3.0
# Directions (right, up) from the mark in which its label may stand, the preferred one first; and the alignment for each sign of the first number.
AT_A_PEAK = ((1, 0.5), (-1, 0.5), (0, 1), (1, 1), (-1, 1), (1, -1), (-1, -1), (1, -0.5), (-1, -0.5))
AT_A_DIP = ((0, -1), (1, -0.5), (-1, -0.5), (1, -1), (-1, -1), (1, 1), (-1, 1), (1, 0.5), (-1, 0.5))
ALIGNED = {-1: "right", 0: "center", 1: "left"}
# Cost of a place for each mark that it overlaps, in points of the curve's length that it covers.
OF_MARKS = 50
# (left, right, bottom, top), and (across, up).
Box = tuple[float, float, float, float]
Place = tuple[float, float]


def mark_resonances(axes: Axes, frequency_hz: FloatArray, magnitude_ohm: FloatArray) -> None:
    """Mark the clear maxima and minima of |Z| and write their frequencies where they can be read.

    Those that stand out most come first. One that would leave the panel, cover another label or be read as that of another mark is
    left out.
    """
    low, high = float(magnitude_ohm.min()), float(magnitude_ohm.max())
    axes.set_ylim(low / max(LEAST_BELOW, (high / low) ** SHARE_BELOW), high * ABOVE)
    level = 20 * np.log10(magnitude_ohm)
    found = sorted(((how_clear, index, sign) for sign in (1, -1) for index, how_clear in clear_maxima(sign * level, CLEAR_DB)), reverse=True)
    marks = [(index, sign) for _, index, sign in found]
    across, up = _in_points(axes, frequency_hz, magnitude_ohm)
    curve = _evenly_along(across, up)
    panel = _size(axes)
    labels: list[Box] = []
    for at, sign in marks:
        place = (frequency_hz[at], magnitude_ohm[at])
        axes.plot(*place, "v" if sign > 0 else "^", color=BLACK, markersize=4)
        text = show(float(frequency_hz[at]), "Hz", 3)
        own, others = (across[at], up[at]), [(across[other], up[other]) for other, _ in marks if other != at]
        directions = AT_A_PEAK if sign > 0 else AT_A_DIP
        boxes = {direction: _box(direction, text, *own) for direction in directions}
        rightly = [direction for direction, box in boxes.items() if _is_inside(box, panel) and _is_read_rightly(box, own, others)]
        free = [direction for direction in rightly if not any(_overlap(boxes[direction], one) for one in labels)]
        if not free:
            continue
        right, above = min(free, key=lambda direction: _cost(boxes[direction], curve, others))
        labels.append(boxes[right, above])
        axes.annotate(
            text,
            place,
            textcoords="offset points",
            xytext=(GAP * right, GAP * above),
            ha=ALIGNED[int(np.sign(right))],
            va="bottom" if above > 0 else "top",
            fontsize=SIZE,
        )


def _cost(box: Box, curve: tuple[FloatArray, FloatArray], others: Sequence[Place]) -> float:
    """How bad it would be to write a label there."""
    left, right, bottom, top = box
    across, up = curve
    points = int(np.count_nonzero((across >= left) & (across <= right) & (up >= bottom) & (up <= top)))
    return points + OF_MARKS * sum(_distance(box, other) < HALF_MARK for other in others)


def _is_inside(box: Box, panel: tuple[float, float]) -> bool:
    left, right, bottom, top = box
    return left >= 0 and right <= panel[0] and bottom >= 0 and top <= panel[1]


def _evenly_along(across: FloatArray, up: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The curve at every point of its length: where it is steep, the sweep's own points would be too far apart."""
    length = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(across), np.diff(up)))])
    everywhere = np.arange(0.0, length[-1])
    return np.interp(everywhere, length, across), np.interp(everywhere, length, up)


def _size(axes: Axes) -> tuple[float, float]:
    """Width and height of the panel."""
    box = axes.get_window_extent()
    points = 72 / axes.figure.dpi
    return float(box.width * points), float(box.height * points)


def _in_points(axes: Axes, frequency_hz: FloatArray, magnitude_ohm: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The sweep's points, measured from the lower left corner of the panel."""
    width, height = _size(axes)
    low, high = np.log(axes.get_ylim())
    place = np.log(frequency_hz / frequency_hz[0]) / np.log(frequency_hz[-1] / frequency_hz[0]) * width
    level = (np.log(magnitude_ohm) - low) / (high - low) * height
    return place, level


def _box(direction: tuple[float, float], text: str, across: float, up: float) -> Box:
    """What a label covers in this direction from its mark."""
    width = LETTER * len(text)
    left = across + GAP * direction[0] - {-1: width, 0: width / 2, 1: 0.0}[int(np.sign(direction[0]))]
    bottom = up + GAP * direction[1] - (0.0 if direction[1] > 0 else LINE)
    return left, left + width, bottom, bottom + LINE


def _is_read_rightly(box: Box, own: Place, others: Sequence[Place]) -> bool:
    """Whether no other mark is nearer to a label than its own."""
    return all(_distance(box, other) >= _distance(box, own) for other in others)


def _distance(box: Box, mark: Place) -> float:
    left, right, bottom, top = box
    return float(np.hypot(max(left - mark[0], 0.0, mark[0] - right), max(bottom - mark[1], 0.0, mark[1] - top)))


def _overlap(one: Box, other: Box) -> bool:
    return one[0] < other[1] and other[0] < one[1] and one[2] < other[3] and other[2] < one[3]
