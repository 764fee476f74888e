"""Correlated noise and drift, estimated from the repeats of a sweep.

The estimates use contrasts: orthonormal combinations of the repeats in which the impedance itself cancels, so that it need not be known
(restricted maximum likelihood, Patterson and Thompson, Biometrika 58, 1971).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import fdtri

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.directions import directions
from motoremi.data.kernels import Parts, smooth_basis

# Correlated noise (flicker, temperature, cables) has no single scale: correlation lengths in decades, a quarter of the variance each.
CORRELATED: Parts = ((0.25, 0.03), (0.25, 0.1), (0.25, 0.3), (0.25, 1.0))
# Correlation length in decades of the motor's drift.
DRIFTING: Parts = ((1.0, 0.15),)
# Twice the gain in log likelihood above which a drift is accepted.
DRIFT_GAIN = 10.0
# Probability with which repeats that differ at random, such as after the leads were moved, may pass for a drift.
BY_CHANCE = 0.1
# Repeats of one motor differ by less of |Z| at half of the points, also after the leads were connected anew: those of simulated motors that warm by
# 0.4 %. If they differ by more, one is of another motor, termination or unit: as noise, that would leave nothing to fit.
UNLIKE = 0.1
# Largest ratio of correlated to white noise that is considered.
MOST_CORRELATED = 100.0


def contrasts(relative: ComplexArray) -> ComplexArray:
    """Orthonormal contrasts, shape (R - 1, n), of repeats of shape (R, n); the first increases linearly with the number of the repeat."""
    repeats = len(relative)
    order = np.vander(np.arange(repeats) - (repeats - 1) / 2, repeats, increasing=True)
    orthonormal = np.linalg.qr(order)[0][:, 1:]
    # The signs of the decomposition are arbitrary; here the last repeat counts positive.
    return (orthonormal * np.sign(orthonormal[-1])).T @ relative


class CorrelatedPart(NamedTuple):
    """Correlated noise, estimated from contrasts.

    Parameters
    ----------
    size : float
        Standard deviation; 0 if it does not improve the likelihood significantly.
    factor : float
        On the variance of the white noise that goes with it.
    log_likelihood : float
        Of the contrasts with both.
    """

    size: float
    factor: float
    log_likelihood: float


def correlated_part(frequency_hz: FloatArray, sigma: FloatArray, free: ComplexArray) -> CorrelatedPart:
    """Correlated noise of one repeat.

    Parameters
    ----------
    frequency_hz, sigma : ndarray, shape (n,)
        White noise of one repeat.
    free : ndarray, shape (m, n)
        Contrasts.
    """
    basis = smooth_basis(frequency_hz, CORRELATED) / sigma[:, None]
    vectors, variances = directions(basis)
    parts = np.abs((free / sigma) @ vectors) ** 2
    rest = float(np.sum(np.abs(free / sigma) ** 2) - parts.sum())
    count = len(free)
    total = count * sigma.size

    def cost(log_ratio: float) -> tuple[float, float]:
        """Minus the log likelihood at c^2 relative to the white variance, which is at its optimum; and that optimum."""
        own = 1 + np.exp(log_ratio) * variances
        white = (float(np.sum(parts / own)) + rest) / (2 * total)
        return float(total * np.log(white) + count * np.sum(np.log(own))), white

    scale = float(np.median(sigma)) ** 2
    found = minimize_scalar(lambda value: cost(value)[0], bounds=(np.log(1e-4 * scale), np.log(MOST_CORRELATED**2 * scale)), method="bounded")
    white_only, factor_only = cost(-np.inf)
    scales = 2 * count * float(np.sum(np.log(sigma)))
    # Chi-squared of one degree of freedom at its boundary exceeds 2.7 by chance once in twenty.
    if 2 * (white_only - found.fun) < 2.7:
        return CorrelatedPart(0.0, factor_only, -white_only - scales)
    factor = cost(float(found.x))[1]
    return CorrelatedPart(float(np.sqrt(np.exp(found.x) * factor)), factor, -float(found.fun) - scales)


def _in_order(scaled: ComplexArray, shape: FloatArray) -> bool:
    """Whether the smooth part of the first contrast exceeds that of the others by more than chance allows (F test of one against the rest).

    One degree of freedom for each contrast: what is moved between repeats, such as a lead, has one size for all frequencies. White noise, of unit
    variance here, is taken off.
    """
    vectors, variances = directions(shape)
    first, *others = variances @ np.abs(vectors.T @ scaled.T) ** 2 - 2 * variances.sum()
    by_noise = 2 * float(np.sqrt(np.sum(variances**2) / len(others)))
    return bool(first > fdtri(1, len(others), 1 - BY_CHANCE) * max(np.mean(others), by_noise))


def drift_of(frequency_hz: FloatArray, sigma: FloatArray, correlated: float, free: ComplexArray) -> ComplexArray | None:
    """Change of ln Z from one repeat to the next, smooth along frequency, shape (n,); None if the repeats show no drift.

    A drift needs a linear contrast far above noise, and far above the other contrasts: repeats in any order have those in equal parts.

    Parameters
    ----------
    sigma, correlated
        White and correlated noise of one repeat.
    free : ndarray, shape (m, n)
        Contrasts, the first linear in the order of the repeats.
    """
    weighted, shape = free[0] / sigma, smooth_basis(frequency_hz, DRIFTING) / sigma[:, None]
    wander, strengths = directions(smooth_basis(frequency_hz, CORRELATED) * (correlated / sigma)[:, None])
    root = np.sqrt(1 + strengths)

    def whitened(values: np.ndarray) -> np.ndarray:
        return values - wander @ ((1 - 1 / root) * (wander.T @ values).T).T

    vectors, variances = directions(whitened(shape))
    components = vectors.T @ whitened(weighted)
    along = np.abs(components) ** 2

    def gain(log_variance: float) -> float:
        extra = np.exp(log_variance) * variances
        return float(np.sum(along * extra / (1 + extra) - 2 * np.log1p(extra)))

    level = 2 * np.log(float(np.median(sigma)))
    found = minimize_scalar(lambda value: -gain(value), bounds=(level - 8, level + 16), method="bounded")
    if gain(float(found.x)) < DRIFT_GAIN or not _in_order(free / sigma, shape):
        return None
    weight = np.exp(found.x) * variances
    white = vectors @ (weight / (1 + weight) * components)
    fitted = sigma * (white + wander @ ((root - 1) * (wander.T @ white)))
    repeats = len(free) + 1
    # The linear contrast of unit length, for one step from repeat to repeat.
    length = np.sqrt(repeats * (repeats**2 - 1) / 12)
    return fitted / length
