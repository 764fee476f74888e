"""The laws that the white noise of analysers follows: a sum of parts of known dependence on the impedance and unknown size.

A bridge has a relative part, an additive part in impedance (visible at low |Z|) and an additive part in admittance (visible at high |Z|). A
network analyser measures the coefficient of a reflection or a transmission (`quantity`), with a part that does not depend on it and one that is
proportional to it: relative to Z both grow without limit far from the reference resistance, however sharp a resonance is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from motoremi.arrays import ComplexArray, FloatArray, IntArray
from motoremi.data.quantity import Quantity

# Smallest noise that is assumed: files have 6 or 7 digits, and the export of a 4294A with the lowest noise at hand scatters by 6e-5.
SMALLEST_SIGMA = 1e-5


@dataclass(frozen=True, eq=False)
class Domain:
    """The quantity in which an analyser's noise follows a simple law: ln Z itself, or the coefficient that is measured.

    Parameters
    ----------
    to_relative : ndarray, shape (n,)
        Real or complex; change relative to Z for one of the quantity.
    law : ndarray, shape (n, m)
        Parts of the variance of its white noise, each of unknown size.
    rational : ndarray, shape (n,)
        Complex; what is measured as a rational function of frequency: the impedance in ohm, or the coefficient.
    of_rational : ndarray, shape (n,)
        Noise of `rational` for one of the quantity.
    """

    to_relative: FloatArray | ComplexArray
    law: FloatArray
    rational: ComplexArray
    of_rational: FloatArray


def domain_of(quantity: Quantity | None, impedance_ohm: ComplexArray) -> Domain:
    """The domain of a bridge or, with a `quantity`, of a network analyser that measures this."""
    return _relative_domain(impedance_ohm) if quantity is None else _wave_domain(quantity, impedance_ohm)


def _relative_domain(impedance_ohm: ComplexArray) -> Domain:
    """Noise relative to Z: r^2 + (z/|Z|)^2 + (y |Z|)^2."""
    magnitude = np.abs(impedance_ohm)
    law = np.column_stack([np.ones_like(magnitude), 1 / magnitude**2, magnitude**2])
    return Domain(np.ones(magnitude.size), law, impedance_ohm, magnitude)


def _wave_domain(quantity: Quantity, impedance_ohm: ComplexArray) -> Domain:
    """Noise of a coefficient c: a^2 + (b |c|)^2."""
    coefficient = quantity.coefficient_of(impedance_ohm)
    law = np.column_stack([np.ones(coefficient.size), np.abs(coefficient) ** 2])
    return Domain(quantity.relative(impedance_ohm), law, coefficient, np.ones(coefficient.size))


def fitted_by_law(variance: FloatArray, law: FloatArray, at: IntArray | slice = slice(None), known: FloatArray | None = None) -> FloatArray:
    """The parts of a law fitted to sample variances, whose scatter is proportional to their size.

    Parameters
    ----------
    variance : ndarray, shape (k,)
    law : ndarray, shape (n, m)
    at : ndarray of int, shape (k,), or slice
        Points at which the variance was sampled.
    known : ndarray, shape (n,), optional
        A further part of the variance, of known size.

    Returns
    -------
    ndarray, shape (n,)
        The variance by the law, at all points.
    """
    given = np.zeros(len(law)) if known is None else known
    fitted = np.full(len(law), max(float(np.mean(variance)), SMALLEST_SIGMA**2))
    for _ in range(8):
        scaled = law[at] / fitted[at][:, None]
        norms = np.maximum(np.linalg.norm(scaled, axis=0), 1e-30)
        coefficients = nnls(scaled / norms, (variance - given[at]) / fitted[at])[0] / norms
        fitted = np.maximum(law @ coefficients + given, SMALLEST_SIGMA**2)
    return fitted
