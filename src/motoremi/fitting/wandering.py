"""How likely residuals are if what no model describes wanders along frequency: noise of known size, and an error of unknown size and roughness.

The error is an Ornstein-Uhlenbeck process over ln f: its correlation falls as exp(-distance / length). With a length below the distance of the
points it is white, with a long one it hardly changes from one point to the next. A smooth discrepancy (`data.covariance`) describes neither, and
a white error counts each of a thousand points as news, although the errors of neighbours are much the same. Being a Markov process, its
likelihood takes one pass over the points (a Kalman filter; S. Sarkka, Bayesian Filtering and Smoothing, 2013, chapter 4).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.interrupts import checkpoint

# Degrees of freedom of the innovations (Student's t): a few points that stand out do not decide between models. Four is usual
# (Lange, Little and Taylor, J. Am. Stat. Assoc. 84 (1989) 881).
TAILS = 4.0
# Variances tried, as multiples of the mean square of the residuals: from nothing to a process that wanders far beyond the band; and lengths in
# ln f: from white to three times the widest span of an analyser. Near the likeliest pair the likelihood hardly depends on either.
VARIANCES: FloatArray = np.geomspace(1e-6, 1e2, 25)[:, None]
LENGTHS: FloatArray = np.concatenate([[1e-6], np.geomspace(3e-3, 30.0, 9)])


def log_likelihood(residual: ComplexArray, frequency_hz: FloatArray, variance: FloatArray, sweeps: Iterable[slice]) -> float:
    """Log likelihood, up to a constant of the points, at the likeliest size and length of the error.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        Relative.
    frequency_hz : ndarray, shape (n,)
        Increasing within each sweep.
    variance : ndarray, shape (n,)
        Of the noise of real and of imaginary part.
    sweeps : iterable of slice
        Their errors are independent.
    """
    size = VARIANCES * max(0.5 * float(np.mean(np.abs(residual) ** 2)), 1e-14)
    total = np.zeros((VARIANCES.size, LENGTHS.size))
    for sweep in sweeps:
        checkpoint()
        kept = np.exp(-np.diff(np.log(frequency_hz[sweep]), prepend=-np.inf)[:, None] / LENGTHS)
        expected: np.ndarray = np.zeros(total.shape, dtype=np.complex128)
        uncertain = np.zeros(total.shape)
        for value, noise, share in zip(residual[sweep], variance[sweep], kept, strict=True):
            expected *= share
            uncertain = size + share**2 * (uncertain - size)
            spread = uncertain + noise
            news = value - expected
            far = (news.real**2 + news.imag**2) / spread
            total -= np.log(spread) + (0.5 * TAILS + 1) * np.log1p(far / TAILS)
            # A point that stands out tells as little as one of more noise.
            gain = uncertain / (uncertain + noise * np.maximum((TAILS + far) / (TAILS + 2), 1.0))
            expected += gain * news
            uncertain *= 1 - gain
    return float(total.max())
