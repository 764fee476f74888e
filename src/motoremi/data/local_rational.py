"""Local rational functions (two poles, two zeros) through the points of a sweep: they follow a resonance however sharp it is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray, IntArray

# Coefficients of numerator and denominator: (a + b x + c x^2) / (1 + d x + e x^2).
COEFFICIENTS = 5


class LocalEquations(NamedTuple):
    """Equations for the coefficients in one window around each point, linear after multiplication by the denominator.

    Parameters
    ----------
    place : ndarray, shape (n, k)
        Distance in frequency from the point, the largest 1.
    values : ndarray, shape (n, k)
        Complex; what is described, in any unit for each point.
    columns : ndarray, shape (n, k, 5)
        Complex; what the coefficients are multiplied by.
    """

    place: FloatArray
    values: ComplexArray
    columns: ComplexArray

    @classmethod
    def of(cls, frequency_hz: FloatArray, center_hz: FloatArray, values: ComplexArray, windows: IntArray) -> LocalEquations:
        """The equations around frequencies of shape (n,), for values in windows, both (n, k): the indices of the points that are used for each."""
        x = frequency_hz[windows] - center_hz[:, None]
        x = x / np.abs(x).max(axis=1, keepdims=True)
        return cls(x, values, np.stack([np.ones_like(values), x + 0j, x**2 + 0j, -values * x, -values * x**2], axis=2))

    def weights(self, noise: FloatArray) -> FloatArray:
        """Weights of the equations for a noise of the values, both of shape (n, k).

        The noise of each equation is that of the point times the denominator there (Sanathanan, Koerner, 1963), which a first solution gives.
        """
        weight = 1 / noise
        basis, triangle = np.linalg.qr(self.columns * weight[:, :, None])
        projected = np.swapaxes(basis.conj(), 1, 2) @ (self.values * weight)[:, :, None]
        # A curve that needs fewer coefficients leaves the triangle singular.
        regular = triangle + 1e-12 * np.abs(triangle).max(axis=(1, 2), keepdims=True) * np.eye(COEFFICIENTS)
        coefficients = np.linalg.solve(regular, projected)[:, :, 0]
        # Limited, since a point where the denominator is almost zero would decide alone.
        return np.asarray(1 / (noise * np.maximum(np.abs(self.denominator(coefficients)), 1e-3)))

    def denominator(self, coefficients: np.ndarray) -> np.ndarray:
        """Of the rational functions with these coefficients, shape (n, k)."""
        return 1 + coefficients[:, 3:4] * self.place + coefficients[:, 4:5] * self.place**2
