"""Draws of complex numbers, and the covariance of a measurement as a dense matrix."""

from __future__ import annotations

import numpy as np

from motoremi.arrays import ComplexArray
from motoremi.data.covariance import Columns


def complex_normal(rng: np.random.Generator, *shape: int) -> ComplexArray:
    """Standard normal in the real and in the imaginary part."""
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


def dense(columns: Columns, discrepancy: float, declared: float) -> ComplexArray:
    """Noise, analyser and what no model knows, all points against all."""
    total = np.diag(columns.sigma**2).astype(np.complex128)
    for factor, part in ((1.0, columns.known), (declared, columns.analyser), (discrepancy, columns.discrepancy)):
        total += factor**2 * part @ part.conj().T
    return total
