"""Fig. 6 - 8 as plots; matplotlib is imported when they are drawn."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from motoremi.data.storage import as_storage_error, write_whole
from motoremi.paper.printed import FAILS_ABOVE_HZ, TRAINING_LOOPS
from motoremi.paper.reproduction import Reproduction, training
from motoremi.report.axes import BLACK, BLUE, GREEN, GREY, VERMILION, frequency_axis, grid, legend_above, log_values, panels
from motoremi.report.plots import TITLES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LOOKS = ((VERMILION, "--"), (BLUE, "-"), (GREEN, "-."))


def prepare(folder: Path) -> None:
    """Create the folder before anything is computed; raises `StorageError` if that fails."""
    with as_storage_error(folder):
        folder.mkdir(parents=True, exist_ok=True)


def write_figures(result: Reproduction, folder: Path) -> list[Path]:
    """Each figure as SVG and as PNG."""
    written = []
    for name, figure in (
        ("fig6_training", training_figure(result)),
        ("fig7_impedance", impedance_figure(result)),
        ("fig8_error", error_figure(result)),
    ):
        for kind in ("svg", "png"):
            buffer = io.BytesIO()
            figure.savefig(buffer, format=kind, dpi=110)
            path = folder / f"{name}.{kind}"
            write_whole(path, buffer.getvalue())
            written.append(path)
    return written


def training_figure(result: Reproduction) -> Figure:
    """Fig. 6: best deviation so far over evaluations, the colony as printed and ours."""
    figure, axes = panels(7.5, 3.6)
    panel = axes[0, 0]
    for (name, one), (colour, style) in zip(list(result.fits.items())[:2], LOOKS, strict=False):
        panel.step(*training(one), style, where="post", marker=".", color=colour, label=name)
    panel.axhline(result.ours.noise_percent, color=GREEN, linestyle=":", label="noise alone would leave")
    panel.axvline(150 * TRAINING_LOOPS, color=GREY, label=f"{TRAINING_LOOPS} loops (the paper)")
    panel.set_xscale("log")
    log_values(panel)
    panel.set_xlabel("evaluations of the model")
    panel.set_ylabel("deviation (%)")
    grid(panel)
    legend_above(figure, panel)
    return figure


def impedance_figure(result: Reproduction) -> Figure:
    """Fig. 7: both sweeps, simulated measurement against models."""
    sweeps = result.ours.measurement.sweeps
    figure, axes = panels(5.0 * len(sweeps), 4.0, 1, len(sweeps))
    for panel, sweep in zip(axes[0], sweeps, strict=True):
        panel.plot(sweep.frequency_hz, np.abs(sweep.mean_ohm), color=BLACK, linewidth=3.0, alpha=0.35, label="simulated measurement")
        for (name, one), (colour, style) in zip(result.fits.items(), LOOKS, strict=True):
            panel.plot(sweep.frequency_hz, np.abs(one.model_ohm(sweep.termination)), style, color=colour, linewidth=1.2, label=name)
        panel.set_title(TITLES[sweep.termination], fontsize=10)
        panel.set_ylabel("|Z| (Ω)")
        log_values(panel, prefixes=True)
        frequency_axis(panel, sweep.frequency_hz)
    legend_above(figure, axes[0, 0])
    return figure


def error_figure(result: Reproduction) -> Figure:
    """Fig. 8: the error of each model over frequency."""
    sweeps = result.ours.measurement.sweeps
    figure, axes = panels(5.0 * len(sweeps), 4.0, 1, len(sweeps))
    errors = {name: one.errors() for name, one in result.fits.items()}
    for panel, sweep in zip(axes[0], sweeps, strict=True):
        for (name, error), (colour, style) in zip(errors.items(), LOOKS, strict=True):
            shown = np.maximum(100 * np.abs(error[sweep.termination]), 1e-3)
            panel.plot(sweep.frequency_hz, shown, style, color=colour, linewidth=1.0, label=name)
        panel.axvline(FAILS_ABOVE_HZ, color=GREY)
        panel.set_title(TITLES[sweep.termination], fontsize=10)
        panel.set_ylabel("error (%)")
        log_values(panel)
        frequency_axis(panel, sweep.frequency_hz)
    legend_above(figure, axes[0, 0])
    return figure
