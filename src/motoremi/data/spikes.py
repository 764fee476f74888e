"""Outliers that all repeats have in common: a broadcast station, a bad contact, a wrong digit.

Each point is predicted from its neighbours by a local rational function (two poles, two zeros), which follows a resonance however sharp it
is. Where the neighbours do not determine the point, as at a peak between two of them, the prediction has a large uncertainty. A point that
stands out is predicted again by a function with more poles and zeros.
"""

from __future__ import annotations

import numpy as np

from motoremi.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from motoremi.data.local_rational import ORDER, LocalEquations
from motoremi.interrupts import checkpoint

# Neighbours of a point.
NEIGHBOURS = 12
# Points with fewer neighbours on one side, at the ends of a sweep, are not tested.
BESIDE = 4
# Largest ratio of the frequencies between which the neighbours of a tested point lie: where points are few, there are more resonances among the
# neighbours than the function has poles. With 5 to 7 points a decade 16 to 22 of 240 sweeps of simulated motors had outliers that are none.
WIDEST = 20.0
# Neighbours, and poles, of the function that has to miss the point too. Of 240 such sweeps (17 and 29 points a decade) 84 and 26 had outliers that
# are none without this second test, one and none with it; as many of the outliers that were put into them are found.
MORE_NEIGHBOURS, MORE_POLES = 20, 6
# Standard deviations of the prediction. Of t-distributed deviations with 14 degrees of freedom three in ten million are larger.
FAR = 9.0
# If more than this share of the points deviate, they are not single outliers, and none is reported.
MOST = 0.08


def spikes(frequency_hz: FloatArray, impedance_ohm: ComplexArray, sigma: FloatArray) -> FloatArray:
    """Deviation of outliers from their prediction, relative to Z; zero for all other points.

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
    # Of each point the neighbours from which it was predicted last, and what came of it.
    known = np.zeros((off.size, NEIGHBOURS), dtype=np.intp)
    deviations, uncertainties = np.zeros(off.size), np.ones(off.size)
    while np.count_nonzero(off) <= MOST * off.size:
        checkpoint()
        kept = np.flatnonzero(off == 0)
        if kept.size <= NEIGHBOURS:
            break
        # Only points beside those that were taken out have other neighbours than before.
        windows = kept[_windows(kept.size, NEIGHBOURS)]
        changed = np.any(windows != known[kept], axis=1)
        new, around = kept[changed], windows[changed]
        known[new] = around
        deviations[new], uncertainties[new] = _against_neighbours(frequency_hz, impedance_ohm, sigma, new, around, ORDER)
        deviation = deviations[kept]
        ratio = deviation / uncertainties[kept]
        # At the ends of the sweep the prediction would be an extrapolation.
        ratio[:BESIDE], ratio[-BESIDE:] = 0.0, 0.0
        ratio[frequency_hz[windows[:, -1]] > WIDEST * frequency_hz[windows[:, 0]]] = 0.0
        worst = np.flatnonzero(_peaks(ratio) & (ratio > FAR))
        if worst.size and kept.size > MORE_NEIGHBOURS:
            around = kept[_windows(kept.size, MORE_NEIGHBOURS)[worst]]
            again, uncertainty = _against_neighbours(frequency_hz, impedance_ohm, sigma, kept[worst], around, MORE_POLES)
            worst = worst[again > FAR * uncertainty]
        if not worst.size:
            return off
        off[kept[worst]] = deviation[worst]
    return np.zeros(frequency_hz.size)


def _peaks(ratio: FloatArray) -> BoolArray:
    """Points that deviate more than all their neighbours, whose predictions they distort."""
    windows = _windows(ratio.size, NEIGHBOURS)
    return ratio >= ratio[windows].max(axis=1)


def _windows(count: int, neighbours: int) -> IntArray:
    """Indices of the neighbours of each point, without the point itself; shape (count, neighbours)."""
    first = np.clip(np.arange(count) - neighbours // 2, 0, count - neighbours - 1)
    inside = first[:, None] + np.arange(neighbours + 1)
    return inside[inside != np.arange(count)[:, None]].reshape(count, neighbours)


def _against_neighbours(
    frequency_hz: FloatArray, impedance: ComplexArray, sigma: FloatArray, points: IntArray, windows: IntArray, order: int
) -> tuple[FloatArray, FloatArray]:
    """|Z/prediction - 1| of some points and its standard deviation, both of shape (n,), from their neighbours, shape (n, k)."""
    equations = LocalEquations.of(frequency_hz, frequency_hz[points], impedance[windows] / impedance[points][:, None], windows, order)
    y, columns = equations.values, equations.columns
    noise = sigma[windows] * np.abs(y)
    denominator = np.ones_like(y)
    # The noise of each equation is that of the point times the denominator there, known after the first iteration (Sanathanan, Koerner, 1963).
    for _ in range(2):
        weight = 1 / (noise * np.maximum(np.abs(denominator), 1e-6))
        rows = columns * weight[:, :, None]
        inverse = np.linalg.pinv(rows, rcond=1e-10)
        coefficients = (inverse @ (y * weight)[:, :, None])[:, :, 0]
        denominator = equations.denominator(coefficients)
    left = y * weight - (rows @ coefficients[:, :, None])[:, :, 0]
    # Variance of the residuals in units of the noise; a value below 1 is chance.
    excess = np.maximum(np.sum(np.abs(left) ** 2, axis=1) / (2 * (windows.shape[1] - columns.shape[2])), 1.0)
    predicted = coefficients[:, 0]
    variance = excess * np.sum(np.abs(inverse[:, 0]) ** 2, axis=1)
    magnitude = np.maximum(np.abs(predicted), 1e-12)
    deviation: FloatArray = np.abs(1 / predicted - 1)
    uncertainty: FloatArray = np.sqrt(variance / magnitude**2 + sigma[points] ** 2)
    return deviation, uncertainty
