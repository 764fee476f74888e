"""Local rational functions through the points of a sweep: two poles and two zeros follow a resonance however sharp it is, more a wide window."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray, IntArray

# Poles, and zeros, unless others are asked for, and the coefficients of numerator and denominator: (a + b x + c x^2) / (1 + d x + e x^2).
ORDER = 2
COEFFICIENTS = 2 * ORDER + 1


class LocalEquations(NamedTuple):
    """Equations for the coefficients in one window around each point, linear after multiplication by the denominator.

    Parameters
    ----------
    place : ndarray, shape (n, k)
        Distance in frequency from the point, the largest 1.
    values : ndarray, shape (n, k)
        Complex; what is described, in any unit for each point.
    columns : ndarray, shape (n, k, m)
        Complex; what the m coefficients are multiplied by, those of the numerator first.
    """

    place: FloatArray
    values: ComplexArray
    columns: ComplexArray

    @classmethod
    def of(cls, frequency_hz: FloatArray, center_hz: FloatArray, values: ComplexArray, windows: IntArray, order: int = ORDER) -> LocalEquations:
        """The equations around frequencies of shape (n,), for values in windows, both (n, k): the indices of the points that are used for each."""
        x = frequency_hz[windows] - center_hz[:, None]
        x = x / np.abs(x).max(axis=1, keepdims=True)
        powers = [x**power for power in range(order + 1)]
        return cls(x, values, np.stack([*(power + 0j for power in powers), *(-values * power for power in powers[1:])], axis=2))

    def weights(self, noise: FloatArray) -> FloatArray:
        """Weights of the equations for a noise of the values, both of shape (n, k).

        The noise of each equation is that of the point times the denominator there (Sanathanan, Koerner, 1963), which a first solution gives.
        """
        weight = 1 / noise
        basis, triangle = np.linalg.qr(self.columns * weight[:, :, None])
        projected = np.swapaxes(basis.conj(), 1, 2) @ (self.values * weight)[:, :, None]
        # A curve that needs fewer coefficients leaves the triangle singular.
        regular = triangle + 1e-12 * np.abs(triangle).max(axis=(1, 2), keepdims=True) * np.eye(self.columns.shape[2])
        coefficients = np.linalg.solve(regular, projected)[:, :, 0]
        # Limited, since a point where the denominator is almost zero would decide alone.
        return np.asarray(1 / (noise * np.maximum(np.abs(self.denominator(coefficients)), 1e-3)))

    def denominator(self, coefficients: np.ndarray) -> np.ndarray:
        """Of the rational functions with these coefficients, shape (n, k)."""
        order = self.columns.shape[2] // 2
        found = np.ones_like(self.values)
        for power in range(order, 0, -1):
            found = found + coefficients[:, order + power, None] * self.place**power
        return found
