"""Plot of an effect's signature on a motor."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from motoremi.inspection.effect_signature import Shown, Signature
from motoremi.model.effects import find_effect
from motoremi.quantities import show
from motoremi.report.axes import BLUE, GREEN, GREY, VERMILION, frequency_axis, legend_above, panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DB = 20 / np.log(10)


def signature_figure(signature: Signature) -> Figure:
    """Change of magnitude above and of phase below, a column for each sweep; dashed: what remains after the elements are refitted."""
    sweeps = signature.frequency_hz
    figure, axes = panels(5.0 * len(sweeps), 5.0, 2, len(sweeps))
    for column, (termination, frequency) in enumerate(sweeps.items()):
        top, bottom = axes[:, column]
        for size, colour in zip(signature.sizes, (GREEN, BLUE, VERMILION), strict=False):
            change, left = size.change[termination], size.remaining[termination]
            top.plot(frequency, DB * change.real, color=colour, linewidth=1.2, label=_named(size, signature.effect))
            bottom.plot(frequency, np.degrees(change.imag), color=colour, linewidth=1.2)
            top.plot(frequency, DB * left.real, "--", color=colour, linewidth=1.0)
            bottom.plot(frequency, np.degrees(left.imag), "--", color=colour, linewidth=1.0)
        uncertainty = signature.uncertainty[termination]
        top.fill_between(frequency, -DB * uncertainty, DB * uncertainty, color=GREY, alpha=0.5, linewidth=0, label="expanded uncertainty (k = 2)")
        bottom.fill_between(frequency, -np.degrees(uncertainty), np.degrees(uncertainty), color=GREY, alpha=0.5, linewidth=0)
        top.set_title(f"{signature.effect} in the {termination}-circuit sweep", fontsize=10)
        top.set_ylabel("change of |Z| (dB)")
        bottom.set_ylabel("change of phase (deg)")
        for panel in (top, bottom):
            frequency_axis(panel, frequency, label=panel is bottom)
    top.plot([], [], "--", color="black", label="remaining after the elements are refitted")
    legend_above(figure, axes[0, -1])
    return figure


def _named(size: Shown, effect: str) -> str:
    """The parameters with their units; a name such as `corner_hz` needs none of its own beside the value's."""
    units = {parameter.name: parameter.unit for parameter in find_effect(effect).effect.parameters}
    return ", ".join(f"{name} {show(value, units[name], 3)}".rstrip() for name, value in size.parameters.items())
