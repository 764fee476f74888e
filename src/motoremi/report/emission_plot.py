"""The picture of a prediction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from motoremi.report.axes import BLACK, BLUE, ORANGE, PURPLE, frequency_axis, legend_above, panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from motoremi.emission.predict import Prediction

_COLOURS = {"peak": BLUE, "quasi-peak": PURPLE, "average": ORANGE, "rms-average": BLACK}


def prediction_figure(prediction: Prediction) -> Figure:
    """Measured levels thin, predicted ones thick, limits stepped."""
    figure, axes = panels(9.0, 4.2)
    panel = axes[0, 0]
    measured = prediction.measured_dbuv()
    for detector, level in prediction.predicted_dbuv.items():
        if measured and detector not in measured:
            continue
        colour = _COLOURS[detector]
        if detector in measured:
            panel.plot(prediction.frequency_hz, measured[detector], color=colour, linewidth=0.6, alpha=0.6, label=f"{detector}, measured")
        if not measured and detector == "rms-average":
            continue
        panel.plot(prediction.frequency_hz, level, "--", color=colour, linewidth=1.4, label=f"{detector}, predicted")
    for line, bound in prediction.limit_dbuv().items():
        if np.isfinite(bound).any():
            panel.plot(prediction.frequency_hz, bound, ":", color=_COLOURS[line], linewidth=1.6, label=f"limit, {line}")
    panel.set_ylabel("level (dBµV)")
    frequency_axis(panel, prediction.frequency_hz)
    legend_above(figure, panel)
    return figure
