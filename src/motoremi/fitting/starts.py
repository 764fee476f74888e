"""Start values that the data give away: rational fits of the two sweeps.

The short-circuit sweep is b0 + b1 s over 1 + a1 s + a2 s^2, and the frame's share of the open-circuit sweep is a ratio of the same
kind; both become linear least squares once multiplied by the denominator (Levy), reweighted with its last value (Sanathanan and
Koerner 1963).
"""

from __future__ import annotations

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.measurement import Measurement

MOST_POINTS = 200


def data_driven_starts(measurement: Measurement) -> list[dict[str, float]]:
    """Sets of start values in SI units; possibly none, never complete nonsense."""
    means = {}
    for sweep in measurement.sweeps:
        # A rational fit of seven coefficients gains nothing from more points than this.
        step = max(1, sweep.frequency_hz.size // MOST_POINTS)
        means[sweep.termination] = (sweep.frequency_hz[::step], sweep.mean_ohm[::step])
    starts: list[dict[str, float]] = []
    winding: dict[str, float] = {}
    if "short" in means:
        winding = _winding(*means["short"])
        if winding:
            starts.append(winding)
    if winding and "open" in means:
        frequency, impedance = means["open"]
        s = 2j * np.pi * frequency
        branch = winding["Ra"] + s * winding["La"]
        modelled = branch / (1 + s * winding["Ca"] * branch)
        frame = impedance - modelled
        short_f, short_z = means["short"]
        if short_f.size == frequency.size and np.allclose(short_f, frequency):
            frame = impedance - short_z
        for weight in (np.abs(frame) / np.abs(impedance), np.ones_like(frequency)):
            found = _frame(frequency, frame, weight)
            if found:
                starts.append({**winding, **found})
    return starts


def _rational(
    s: ComplexArray,
    response: ComplexArray,
    weight: FloatArray,
    top: tuple[int, ...],
    bottom: tuple[int, ...],
    known_top: int | None,
) -> tuple[FloatArray, FloatArray]:
    """Coefficients of N(s)/D(s), real, with powers `top` and `bottom`; the power `known_top` of N, or else power 0 of D, is one."""
    denominator = np.ones_like(s)
    coefficients = np.zeros(len(top) + len(bottom))
    for _ in range(8):
        scale = weight / np.abs(response * denominator)
        left = np.array([-(s**p) for p in top] + [response * s**p for p in bottom]).T * scale[:, None]
        right = (-response if known_top is None else s**known_top) * scale
        system = np.concatenate([left.real, left.imag])
        norms = np.linalg.norm(system, axis=0)
        solution = np.linalg.lstsq(system / norms, np.concatenate([right.real, right.imag]), rcond=None)[0] / norms
        if not np.all(np.isfinite(solution)):
            break
        coefficients = solution
        denominator = sum(c * s**p for c, p in zip(coefficients[len(top) :], bottom, strict=True)) + (0 if known_top is not None else 1)
        denominator = np.where(np.abs(denominator) < 1e-9, 1e-9, denominator)
    return coefficients[: len(top)], coefficients[len(top) :]


def _winding(frequency_hz: FloatArray, impedance_ohm: ComplexArray) -> dict[str, float]:
    """Ra, La, Ca from (b0 + b1 s)/(1 + a1 s + a2 s^2)."""
    middle = 2 * np.pi * float(np.sqrt(frequency_hz[0] * frequency_hz[-1]))
    s: ComplexArray = (2j * np.pi / middle) * frequency_hz.astype(np.complex128)
    (b0, b1), (_, a2) = _rational(s, impedance_ohm, np.ones_like(frequency_hz), (0, 1), (1, 2), None)
    if b1 <= 0 or a2 <= 0:
        return {}
    inductance = float(b1 / middle)
    return {"Ra": max(float(b0), 1e-3), "La": inductance, "Ca": float(a2 / b1 / middle)}


def _frame(frequency_hz: FloatArray, impedance_ohm: ComplexArray, weight: FloatArray) -> dict[str, float]:
    """Rr, Lr, Cr, Cf from (1 + A1 s + A2 s^2)/(B1 s + B2 s^2 + B3 s^3)."""
    middle = 2 * np.pi * float(np.sqrt(frequency_hz[0] * frequency_hz[-1]))
    s: ComplexArray = (2j * np.pi / middle) * frequency_hz.astype(np.complex128)
    (a1, a2), (b1, b2, b3) = _rational(s, impedance_ohm, weight, (1, 2), (1, 2, 3), 0)
    if min(a1, a2, b1) <= 0:
        return {}
    for cf in (b3 / a2, b2 / a1):
        cr = b1 - cf
        if cf > 0 and cr > 0:
            return {
                "Rr": float(a1 / cr),
                "Lr": float(a2 / cr / middle),
                "Cr": float(cr / middle),
                "Cf": float(cf / middle),
            }
    return {}
