"""Judges measurements of known standards: the residual error of a compensated fixture, and whether it was compensated with the right one."""

from __future__ import annotations

import numpy as np

from motoremi.arrays import FloatArray, JsonDict
from motoremi.bench.impedance_analyser import Standard
from motoremi.data.sweep import ImpedanceSweep
from motoremi.quantities import percent, show
from motoremi.schema.procedure_steps import Check

# Through a fixture or cable without compensation, at most 1 Ohm and 1 uH in series with a standard, and 0.1 mS and 100 pF across it: a short is
# below 1 Ohm + 2 pi f 1 uH, an open above 1/(0.1 mS + 2 pi f 100 pF). Their geometric mean is 100 Ohm at every frequency; at `HIGHEST_HZ` each of
# them is a factor of three from it.
BETWEEN_OHM, HIGHEST_HZ = 100.0, 5e6
# A load of 50 or 100 Ohm stays within this factor of its resistance, as does every one within this factor of `BETWEEN_OHM`; others are not judged.
LOAD_FACTOR = 3.0


def wrong_standard(standard: Standard, sweep: ImpedanceSweep, nominal_ohm: float | None = None) -> str:
    """Why what was measured cannot be this standard, in a line of text; "" if it can be.

    Parameters
    ----------
    standard : {"open", "short", "load"}
    sweep : ImpedanceSweep
        Of the standard through the fixture, without compensation.
    nominal_ohm : float, optional
        Of the load.
    """
    frequency_hz = float(sweep.frequency_hz[0])
    # The lowest twentieth of the points, so that the noise of one does not decide.
    ohm = float(np.median(np.abs(sweep.impedance_ohm[: max(1, len(sweep.frequency_hz) // 20)])))
    if frequency_hz > HIGHEST_HZ:
        return ""
    shown = f"the {standard} standard measured {show(ohm, 'ohm')} at {show(frequency_hz, 'Hz')}"
    if standard == "open" and ohm < BETWEEN_OHM:
        return f"{shown}; an open is above {show(BETWEEN_OHM, 'ohm')}, so a short or a load seems to be connected"
    if standard == "short" and ohm > BETWEEN_OHM:
        return f"{shown}; a short is below {show(BETWEEN_OHM, 'ohm')}, so nothing or a load seems to be connected"
    if standard == "load" and nominal_ohm is not None and _is_near(nominal_ohm, BETWEEN_OHM) and not _is_near(ohm, nominal_ohm):
        return f"{shown}; the load is {show(nominal_ohm, 'ohm')}, so another standard seems to be connected"
    return ""


def _is_near(ohm: float, other_ohm: float) -> bool:
    return 1 / LOAD_FACTOR <= ohm / other_ohm <= LOAD_FACTOR


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
