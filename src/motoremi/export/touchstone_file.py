"""One sweep as Touchstone, version 1: S parameters in 50 ohm, or impedance normalised to 50 ohm, as the standard says."""

from __future__ import annotations

from typing import Literal

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.mislabelled import without_mislabelled
from motoremi.data.session import Session
from motoremi.data.sweep import group_repeats
from motoremi.errors import BadInput
from motoremi.fitting.result import Fit

REFERENCE_OHM = 50.0


def touchstone_text(frequency_hz: FloatArray, impedance_ohm: ComplexArray, parameter: Literal["S", "Z"], comments: tuple[str, ...] = ()) -> str:
    """The text of a one-port file, with all digits."""
    normalised = impedance_ohm / REFERENCE_OHM
    with np.errstate(divide="ignore", invalid="ignore"):
        values = normalised if parameter == "Z" else (normalised - 1) / (normalised + 1)
    if not np.all(np.isfinite(values)):
        raise BadInput("an impedance of -50 Ohm has no reflection coefficient: export it as .z1p")
    head = [f"! {comment}" for comment in comments] + (["! normalised to 50 Ohm"] if parameter == "Z" else [])
    rows = (f"{f!r} {z.real!r} {z.imag!r}" for f, z in zip(frequency_hz.tolist(), values.tolist(), strict=True))
    return "\n".join((*head, f"# HZ {parameter} RI R 50", *rows, ""))


def session_touchstone(session: Session, termination: str | None, parameter: Literal["S", "Z"], model_of: Fit | None = None) -> tuple[str, str]:
    """The mean of the repeats that a fit uses, or the model at their frequencies: the text, and the termination.

    Raises
    ------
    BadInput
        If there is no such sweep.
    """
    # The repeats that a fit averages: one that was measured with the other termination would change the mean.
    used, _ = without_mislabelled(group_repeats(session.corrected_sweeps))
    groups = {group.termination: group for group in used}
    chosen = termination or ("open" if "open" in groups else "short")
    if chosen not in groups:
        raise BadInput(f"{session.path.name} holds no {chosen}-circuit sweep")
    group = groups[chosen]
    what = f"mean of {group.repeats} sweeps" if group.repeats > 1 else "sweep"
    impedance = group.mean_ohm
    if model_of is not None:
        what, impedance = "fitted model", model_of.model_ohm(chosen, group.frequency_hz)
    comments = (f"motoremi: {chosen}-circuit {what} of {session.path.name}", *(("simulated: true",) if session.simulated else ()))
    return touchstone_text(group.frequency_hz, impedance, parameter, comments), chosen
