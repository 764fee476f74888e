"""The paper's circuit, written out: what the model is held against."""

from __future__ import annotations

import numpy as np
from conftest import FREQUENCY_HZ

# Table 1 of the paper with Rr in ohm, and Ra as a winding with core loss has it.
DAMPED = {"Ra": 20.0, "La": 12.1e-6, "Ca": 22e-12, "Rr": 39.8, "Lr": 1.6e-6, "Cr": 424e-12, "Cf": 210e-12}
# Table 1 as printed.
PRINTED = {**DAMPED, "Ra": 21.3e-3, "Rr": 39.8e3}


def impedance(values: dict[str, float], termination: str, frequency_hz: np.ndarray = FREQUENCY_HZ) -> np.ndarray:
    """Equations (1) and (2) of the paper, written out."""
    s = 2j * np.pi * frequency_hz
    v = values
    winding = (v["Ra"] + s * v["La"]) / (1 + s * v["Ra"] * v["Ca"] + s**2 * v["La"] * v["Ca"])
    if termination == "short":
        return winding
    branch = v["Rr"] + s * v["Lr"] + 1 / (s * v["Cr"])
    return winding + 1 / (1 / branch + s * v["Cf"])
