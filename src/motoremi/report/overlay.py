"""Overlay plots of several sessions, with a colour and line style for each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.sweep import RepeatedSweep
from motoremi.report.axes import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION, frequency_axis, legend_above, literal, log_values, panels
from motoremi.report.plots import TITLES, UNCERTAINTY

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from motoremi.data.spectrum import Spectrum

# All differ in grey print.
LOOKS = (
    (BLACK, "-"), (VERMILION, "--"), (BLUE, "-."), (GREEN, ":"),
    (PURPLE, (0, (8, 2))), (ORANGE, (0, (3, 1, 1, 1, 1, 1))), (SKY, (0, (1, 3))), (GREY, (0, (6, 1, 1, 1))),
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Change:
    """The ratio of a session's sweep to the first session's, where both were measured.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
    ratio : ndarray of complex, shape (n,)
        Z over that of the first session.
    uncertainty : ndarray, shape (n,)
        Expanded (k = 2), relative, of both sweeps together.
    """

    frequency_hz: FloatArray
    ratio: ComplexArray
    uncertainty: FloatArray

    @property
    def magnitude_db(self) -> FloatArray:
        """Magnitude of the ratio in dB."""
        return 20 * np.log10(np.abs(self.ratio))

    @property
    def beyond(self) -> FloatArray:
        """1 where the change is beyond the uncertainty, else 0."""
        return (np.abs(self.ratio - 1) > self.uncertainty).astype(np.float64)


def sweeps_overlay(sweeps: Mapping[str, Mapping[str, RepeatedSweep]], changes: Mapping[str, Mapping[str, Change]]) -> Figure:
    """Magnitude and phase of all sessions, below the change of magnitude against the first.

    Parameters
    ----------
    sweeps, changes : mapping
        Session -> termination -> its sweep, or its change against the first session.
    """
    terminations = [name for name in TITLES if any(name in own for own in sweeps.values())]
    figure, axes = panels(5.0 * len(terminations), 6.6, 3, len(terminations), height_ratios=(3, 2, 2))
    for column, termination in enumerate(terminations):
        top, middle, bottom = axes[:, column]
        shown = []
        for (name, own), (colour, style) in zip(sweeps.items(), LOOKS, strict=False):
            if termination not in own:
                continue
            frequency, mean = own[termination].frequency_hz, own[termination].mean_ohm
            shown.append(frequency)
            top.plot(frequency, np.abs(mean), linestyle=style, color=colour, linewidth=1.3, label=literal(name))
            middle.plot(frequency, np.degrees(np.angle(mean)), linestyle=style, color=colour, linewidth=1.3)
            change = changes.get(name, {}).get(termination)
            if change is not None:
                bottom.plot(change.frequency_hz, change.magnitude_db, linestyle=style, color=colour, linewidth=1.1)
                band = 20 * np.log10(1 + change.uncertainty)
                bottom.fill_between(change.frequency_hz, -band, band, color=GREY, alpha=0.35, linewidth=0, label=UNCERTAINTY)
        log_values(top, prefixes=True)
        top.set_title(TITLES[termination], fontsize=10)
        top.set_ylabel("|Z| (Ω)")
        middle.set_ylabel("phase (deg)")
        middle.set_yticks((-90, -45, 0, 45, 90))
        bottom.set_ylabel("change of |Z|\nto the first (dB)")
        ends = np.array([min(f[0] for f in shown), max(f[-1] for f in shown)])
        for panel in (top, middle, bottom):
            frequency_axis(panel, ends, label=panel is bottom)
    legend_above(figure, *axes[0], *axes[2])
    return figure


def spectra_overlay(spectra: Mapping[str, Sequence[Spectrum]]) -> Figure:
    """Levels with the motors running, a panel for each detector."""
    detectors = list(dict.fromkeys(spectrum.detector for own in spectra.values() for spectrum in own))
    figure, axes = panels(9.0, 1.0 + 2.6 * len(detectors), len(detectors), 1)
    every = [spectrum for own in spectra.values() for spectrum in own]
    ends = np.array([min(s.frequency_hz[0] for s in every), max(s.frequency_hz[-1] for s in every)])
    for row, detector in enumerate(detectors):
        panel = axes[row, 0]
        for (name, own), (colour, style) in zip(spectra.items(), LOOKS, strict=False):
            for spectrum in own:
                if spectrum.detector == detector:
                    panel.plot(spectrum.frequency_hz, spectrum.level_dbuv, linestyle=style, color=colour, linewidth=0.8, label=literal(name))
        panel.set_ylabel(f"{detector} level (dBµV)")
        frequency_axis(panel, ends, label=row == len(detectors) - 1)
    legend_above(figure, *axes[:, 0])
    return figure
