"""Single points that stand out of a sweep although they do in every repeat: a broadcast station, a bad contact, a digit misread.

Each point is predicted from its neighbours by a local rational function (two poles, two zeros), which follows a resonance however
sharp it is; where the neighbours say nothing of the point, as at a peak between two of them, the prediction is as uncertain.
"""

from __future__ import annotations

import numpy as np

from motoremi.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from motoremi.interrupts import checkpoint

# Neighbours of a point, and coefficients of numerator and denominator.
NEIGHBOURS, COEFFICIENTS = 12, 5
# A point at the ends of a sweep with fewer neighbours on one side is not judged.
BESIDE = 4
# Standard deviations of the prediction. Of t-distributed deviations with 14 degrees of freedom three in ten million are larger.
FAR = 9.0
# Where more points than this share stand out, they are no single points.
MOST = 0.08


def spikes(frequency_hz: FloatArray, impedance_ohm: ComplexArray, sigma: FloatArray) -> FloatArray:
    """How far points stand out, relative to Z; zero for all others.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
    impedance_ohm : ndarray, shape (n,)
        Complex, in ohm.
    sigma : ndarray, shape (n,)
        Relative noise of the real and of the imaginary part each.

    Returns
    -------
    ndarray, shape (n,)
    """
    off = np.zeros(frequency_hz.size)
    while np.count_nonzero(off) <= MOST * off.size:
        checkpoint()
        kept = np.flatnonzero(off == 0)
        if kept.size <= NEIGHBOURS:
            break
        deviation, uncertainty = _against_neighbours(frequency_hz[kept], impedance_ohm[kept], sigma[kept])
        ratio = deviation / uncertainty
        # Beyond its neighbours a local function says nothing.
        ratio[:BESIDE], ratio[-BESIDE:] = 0.0, 0.0
        worst = _peaks(ratio) & (ratio > FAR)
        if not worst.any():
            return off
        off[kept[worst]] = deviation[worst]
    return np.zeros(frequency_hz.size)


def _peaks(ratio: FloatArray) -> BoolArray:
    """Points that stand out more than all that they are neighbours of: those draw the others' prediction with them."""
    windows = _windows(ratio.size)
    return ratio >= ratio[windows].max(axis=1)


def _windows(count: int) -> IntArray:
    """Indices of each point's neighbours, itself left out; shape (count, NEIGHBOURS)."""
    first = np.clip(np.arange(count) - NEIGHBOURS // 2, 0, count - NEIGHBOURS - 1)
    inside = first[:, None] + np.arange(NEIGHBOURS + 1)
    return inside[inside != np.arange(count)[:, None]].reshape(count, NEIGHBOURS)


def _against_neighbours(frequency_hz: FloatArray, impedance: ComplexArray, sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
    """|Z/prediction - 1| of each point and its standard deviation, both of shape (n,)."""
    windows = _windows(frequency_hz.size)
    x = frequency_hz[windows] - frequency_hz[:, None]
    x = x / np.abs(x).max(axis=1, keepdims=True)
    y = impedance[windows] / impedance[:, None]
    columns = np.stack([np.ones_like(y), x + 0j, x**2 + 0j, -y * x, -y * x**2], axis=2)
    noise = sigma[windows] * np.abs(y)
    denominator = np.ones_like(y)
    # The noise of an equation is the point's times the denominator there, which the first round finds (Sanathanan and Koerner, 1963).
    for _ in range(2):
        weight = 1 / (noise * np.maximum(np.abs(denominator), 1e-6))
        rows = columns * weight[:, :, None]
        inverse = np.linalg.pinv(rows, rcond=1e-10)
        coefficients = (inverse @ (y * weight)[:, :, None])[:, :, 0]
        denominator = 1 + coefficients[:, 3:4] * x + coefficients[:, 4:5] * x**2
    left = y * weight - (rows @ coefficients[:, :, None])[:, :, 0]
    # In units of the noise; less than the noise is chance.
    excess = np.maximum(np.sum(np.abs(left) ** 2, axis=1) / (2 * (NEIGHBOURS - COEFFICIENTS)), 1.0)
    predicted = coefficients[:, 0]
    variance = excess * np.sum(np.abs(inverse[:, 0]) ** 2, axis=1)
    magnitude = np.maximum(np.abs(predicted), 1e-12)
    deviation: FloatArray = np.abs(1 / predicted - 1)
    uncertainty: FloatArray = np.sqrt(variance / magnitude**2 + sigma**2)
    return deviation, uncertainty
