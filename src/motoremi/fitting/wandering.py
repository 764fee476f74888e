"""How likely residuals are if what no model describes wanders along frequency: noise of known size, and an error of unknown size and roughness.

The error is an Ornstein-Uhlenbeck process over ln f: its correlation falls as exp(-distance / length). With a length below the distance of the
points it is white, with a long one it hardly changes from one point to the next. A smooth discrepancy (`data.covariance`) describes neither, and
a white error counts a thousand points as independent, although the errors of neighbours are much the same. Because it is a Markov process, its
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
# Variances tried, as multiples of the mean square of the residuals: from nothing to a process that wanders far beyond the band. Near the most
# probable one the likelihood hardly depends on it.
VARIANCES: FloatArray = np.geomspace(1e-6, 1e2, 25)[:, None]
# In ln f: from white to nearly a decade, over which the errors of analysers change. With longer ones a circuit that describes the analyser's
# errors would be more probable than the true one, because no error remains.
LENGTHS: FloatArray = np.concatenate([[1e-6], np.geomspace(3e-3, 2.0, 9)])


def log_likelihood(residual: ComplexArray, frequency_hz: FloatArray, noise: FloatArray, systematic: FloatArray, sweeps: Iterable[slice]) -> float:
    """Log likelihood, up to a constant of the points, at the most probable size and length of the error.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        Relative.
    frequency_hz : ndarray, shape (n,)
        Increasing within each sweep.
    noise, systematic : ndarray, shape (n,)
        Variance of real and of imaginary part: of the noise, and of what the analyser may err by. The error wanders by that much at least: a
        circuit that leaves less is not more probable.
    sweeps : iterable of slice
        Their errors are independent.
    """
    size = VARIANCES * max(0.5 * float(np.mean(np.abs(residual) ** 2)), 1e-14)
    total = np.zeros((VARIANCES.size, LENGTHS.size))
    for sweep in sweeps:
        checkpoint()
        kept = np.exp(-np.diff(np.log(frequency_hz[sweep]), prepend=-np.inf)[:, None] / LENGTHS)
        # The process is followed in units of its own standard deviation at each point.
        sigma = np.sqrt(size + systematic[sweep, None, None])
        expected: np.ndarray = np.zeros(total.shape, dtype=np.complex128)
        variance = np.ones(total.shape)
        for value, white, deviation, correlation in zip(residual[sweep], noise[sweep], sigma, kept, strict=True):
            expected *= correlation
            variance = 1 + correlation**2 * (variance - 1)
            predicted = deviation**2 * variance
            spread = predicted + white
            innovation = value - deviation * expected
            squared = (innovation.real**2 + innovation.imag**2) / spread
            total -= np.log(spread) + (0.5 * TAILS + 1) * np.log1p(squared / TAILS)
            # An outlier gives as little information as a point of more noise.
            gain = predicted / (predicted + white * np.maximum((TAILS + squared) / (TAILS + 2), 1.0))
            expected += gain * innovation / deviation
            variance *= 1 - gain
    return float(total.max())
