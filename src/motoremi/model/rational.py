"""Rational functions fitted to measured values.

Multiplied by its denominator, the fit is a linear least-squares problem (Levy 1959); it is solved repeatedly, weighted with the denominator of
the previous solution (Sanathanan and Koerner 1963).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray

MOST_POINTS = 200
ROUNDS = 8


@dataclass(frozen=True)
class Rational:
    """Numerator over denominator, in powers of s over `middle`.

    Parameters
    ----------
    middle : float
        Angular frequency in rad/s.
    lowest : float
        Lowest angular frequency of the values, divided by `middle`.
    numerator, denominator : ndarray
        Coefficients of increasing powers; the denominator begins with 1.
    """

    middle: float
    lowest: float
    numerator: FloatArray
    denominator: FloatArray


def rational_fit(frequency_hz: FloatArray, value: ComplexArray, weight: FloatArray, degrees: tuple[int, int]) -> Rational:
    """The rational function of these degrees that is fitted to the values.

    Parameters
    ----------
    frequency_hz, value, weight : ndarray, shape (n,)
        The weight is the reciprocal of a value's error, up to a common factor.
    degrees : tuple of int
        Of numerator and denominator.
    """
    step = max(1, frequency_hz.size // MOST_POINTS)
    used = frequency_hz[::step].astype(np.float64), value[::step].astype(np.complex128), weight[::step].astype(np.float64)
    return _fitted(*(part.tobytes() for part in used), degrees)


# A search for two effects reads start values from the same sweeps beside each of the forty, and the scan of a cable alone makes 64 fits.
@lru_cache(maxsize=256)
def _fitted(frequency_bytes: bytes, value_bytes: bytes, weight_bytes: bytes, degrees: tuple[int, int]) -> Rational:
    frequency, weight = np.frombuffer(frequency_bytes), np.frombuffer(weight_bytes)
    value = np.frombuffer(value_bytes, dtype=np.complex128)
    middle = 2 * np.pi * float(np.sqrt(frequency[0] * frequency[-1]))
    top, bottom = (((2j * np.pi / middle) * frequency.astype(np.complex128))[:, None] ** np.arange(degree + 1) for degree in degrees)
    regressors = np.concatenate([top, -value[:, None] * bottom[:, 1:]], axis=1)
    solution, denominator = np.zeros(regressors.shape[1]), np.ones_like(value)
    for _ in range(ROUNDS):
        scale = weight / np.abs(denominator)
        left, right = regressors * scale[:, None], value * scale
        system = np.concatenate([left.real, left.imag])
        norms = np.linalg.norm(system, axis=0)
        if not (np.isfinite(norms).all() and norms.all()):
            break
        found = np.linalg.lstsq(system / norms, np.concatenate([right.real, right.imag]), rcond=None)[0] / norms
        if not np.all(np.isfinite(found)):
            break
        solution = found
        denominator = 1 + bottom[:, 1:] @ solution[top.shape[1] :]
        denominator = np.where(np.abs(denominator) < 1e-9, 1e-9, denominator)
    lowest = 2 * np.pi * float(frequency[0]) / middle
    above, below = solution[: top.shape[1]], np.concatenate([[1.0], solution[top.shape[1] :]])
    for coefficients in (above, below):
        coefficients.flags.writeable = False  # the same for all that ask for this fit
    return Rational(middle, lowest, above, below)
