"""Judges the residual error of a compensated fixture by the measurement of a known standard."""

from __future__ import annotations

import numpy as np

from motoremi.arrays import FloatArray, JsonDict
from motoremi.data.sweep import ImpedanceSweep
from motoremi.quantities import percent, show
from motoremi.schema.procedure_steps import Check


def judge_standard(step: Check, sweep: ImpedanceSweep) -> JsonDict:
    """Compare a standard's impedance with the limits of the step.

    Allowed are an impedance of R + 2 pi f L for a short, an admittance of G + 2 pi f C for an open, and the tolerance of a load: the
    residual error of a compensated fixture is a small R, L, G and C (Keysight, Impedance Measurement Handbook, 6th ed., section 4).

    Returns
    -------
    dict
        `verdict`, the largest `share_of_limit`, the frequency `worst_hz` where it is, and one line in `says`.
    """
    angular: FloatArray = 2 * np.pi * sweep.frequency_hz
    impedance = sweep.impedance_ohm
    if step.nominal is not None:
        share, limit = np.abs(impedance / step.nominal - 1) * 100 / step.tolerance_percent, "error of the load"
    elif step.standard == "short":
        share, limit = np.abs(impedance) / (step.resistance + angular * step.inductance), "residual impedance"
    else:
        share, limit = 1 / np.abs(impedance) / (step.conductance + angular * step.capacitance), "residual admittance"
    worst = int(np.argmax(share))
    frequency_hz = float(sweep.frequency_hz[worst])
    return {
        "verdict": "pass" if share[worst] <= 1 else "fail",
        "standard": step.standard,
        "share_of_limit": float(share[worst]),
        "worst_hz": frequency_hz,
        "says": f"{limit} at most {percent(100 * share[worst])} of its limit, at {show(frequency_hz, 'Hz')}",
    }
