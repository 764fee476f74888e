"""The covariance of what a perfect circuit would leave: noise, analyser, and what no model describes.

ln Z of all sweeps is one complex vector. Its covariance is diag(sigma^2) plus columns times their adjoint for every part that is smooth
along frequency, so that each part is marginalised exactly:

=====================  ==========================================================================================
white noise            sigma^2, of the mean of the repeats (`noise`)
correlated noise       c^2 K of lengths 0.03, 0.1, 0.3 and 1 decade, for each sweep; its size from the repeats
drift                  d d', what the motor changed from repeat to repeat, for each sweep
analyser               its smooth errors, common to all sweeps, times the square of `declared` (`analyser`)
discrepancy in value   delta^2 [0.8 K(0.3 decades) + 0.2 K(0.08 decades)], for each sweep: what no model describes
discrepancy in place   delta^2 D K(0.3) D*, D = d ln Z / d ln f: near a sharp resonance a model may be off by Q times as much
=====================  ==========================================================================================

The discrepancy follows Kennedy and O'Hagan (Journal of the Royal Statistical Society B 63, 2001).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.analyser import Analyser, error_basis
from motoremi.data.kernels import Parts, slope, smooth_basis, smoothed
from motoremi.data.noise import Noise
from motoremi.data.repeats import WANDERING

VALUE: Parts = ((0.8, 0.3), (0.2, 0.08))
PLACE: Parts = ((1.0, 0.3),)
# A direction that holds less than this share of the noise's variance tells nothing.
LEAST_SHARE = 1e-4
# Kept whitenings: one for each scale of the declared errors (up to four), each grid (four) and each analyser that is tried (three).
KEPT = 64


class Sizes(NamedTuple):
    """Sizes that the data, not the specification, decide.

    Parameters
    ----------
    discrepancy : float
        Relative standard deviation of what no model describes.
    declared : float
        Factor on the analyser's declared errors.
    """

    discrepancy: float
    declared: float


class Part(NamedTuple):
    """The points of one sweep that are used: of all its points, those `chosen`."""

    frequency_hz: FloatArray
    impedance_ohm: ComplexArray
    noise: Noise
    chosen: np.ndarray


@dataclass(frozen=True, eq=False)
class Columns:
    """The smooth parts of the covariance of some points, shape (n, q) each.

    Parameters
    ----------
    sigma : ndarray, shape (n,)
        White noise.
    known : ndarray
        Correlated noise and drift.
    analyser : ndarray
        At its declared size.
    discrepancy : ndarray
        At size one.
    """

    sigma: FloatArray
    known: ComplexArray
    analyser: ComplexArray
    discrepancy: ComplexArray

    @classmethod
    def of(cls, parts: Sequence[Part], analyser: Analyser) -> Columns:
        """Those of the chosen points of some sweeps."""
        known, free, places = [], [], []
        for part in parts:
            frequency = part.frequency_hz[part.chosen]
            quiet = smoothed(part.impedance_ohm)
            turning = slope(part.frequency_hz, part.impedance_ohm, float(np.median(part.noise.sigma)))[part.chosen]
            wander = part.noise.correlated * smooth_basis(frequency, WANDERING) if part.noise.correlated else np.zeros((frequency.size, 0))
            drift = np.zeros((frequency.size, 0)) if part.noise.drift is None else part.noise.drift[part.chosen, None] / np.sqrt(2)
            known.append(np.concatenate([wander, drift], axis=1))
            free.append(np.concatenate([smooth_basis(frequency, VALUE), turning[:, None] * smooth_basis(frequency, PLACE)], axis=1))
            places.append((frequency, quiet[part.chosen]))
        frequency, quiet = (np.concatenate(values) for values in zip(*places, strict=True))
        return cls(
            np.concatenate([part.noise.sigma[part.chosen] for part in parts]),
            _blocks(known),
            error_basis(analyser, frequency, quiet),
            _blocks(free),
        )

    def whitening(self, declared: float) -> Whitening:
        """The covariance at one scale of the declared errors, ready for every size of the discrepancy."""
        return _whitening(self, declared)


@dataclass(frozen=True, eq=False)
class Whitening:
    """W (1 - H V s V* H) W with W = 1/sigma is the inverse covariance: what noise and analyser are, then the discrepancy on top.

    Parameters
    ----------
    fixed : ndarray, shape (n, p)
        Orthonormal directions of noise and analyser in weighted residuals.
    fixed_shares : ndarray, shape (p,)
        What each takes up of its variance, 0 .. 1.
    spread : ndarray, shape (n, q)
        H V: orthonormal directions V of the discrepancy once noise and analyser are white, brought back.
    strengths : ndarray, shape (q,)
        Variance of each at a discrepancy of one.
    """

    sigma: FloatArray
    fixed: ComplexArray
    fixed_shares: FloatArray
    spread: ComplexArray
    strengths: FloatArray

    def shares(self, discrepancy: float) -> FloatArray:
        """What each direction of the discrepancy takes up, shape (q,)."""
        variance = discrepancy**2 * self.strengths
        shares: FloatArray = variance / (1 + variance)
        return shares

    def directions(self, discrepancy: float) -> ComplexArray:
        """D, shape (n, r), such that 1 - D D* is the inverse covariance of weighted residuals."""
        shares = self.shares(discrepancy)
        used = shares > LEAST_SHARE
        return np.concatenate([self.fixed * np.sqrt(self.fixed_shares), self.spread[:, used] * np.sqrt(shares[used])], axis=1)

    def half(self, weighted: ComplexArray) -> ComplexArray:
        """Weighted residuals, shape (..., n), with noise and analyser white."""
        taken = 1 - np.sqrt(1 - self.fixed_shares)
        white: ComplexArray = weighted - ((weighted @ self.fixed.conj()) * taken) @ self.fixed.T
        return white

    def along(self, weighted: ComplexArray) -> ComplexArray:
        """Components of weighted residuals, shape (..., n), along the directions of the discrepancy, shape (..., q)."""
        found: ComplexArray = weighted @ self.spread.conj()
        return found

    def log_determinants(self, discrepancies: FloatArray) -> FloatArray:
        """ln det of the covariance at each size of the discrepancy, up to what is common to all."""
        fixed = -np.sum(np.log1p(-self.fixed_shares)) + 2 * np.sum(np.log(self.sigma))
        extra: FloatArray = fixed + np.sum(np.log1p(discrepancies[:, None] ** 2 * self.strengths), axis=1)
        return extra


@lru_cache(maxsize=KEPT)
def _whitening(columns: Columns, declared: float) -> Whitening:
    weight = 1 / columns.sigma
    known: ComplexArray = np.concatenate([columns.known, declared * columns.analyser], axis=1)
    fixed, variances = _directions(known * weight[:, None], LEAST_SHARE)
    shares = variances / (1 + variances)
    first = Whitening(columns.sigma, fixed, shares, np.zeros((weight.size, 0), dtype=np.complex128), np.zeros(0))
    free = first.half((columns.discrepancy * weight[:, None]).T).T
    spread, strengths = _directions(free, 1e-12 * float(np.max(np.sum(np.abs(free) ** 2, axis=0), initial=0.0)))
    return Whitening(columns.sigma, fixed, shares, first.half(spread.T).T, strengths)


def _directions(columns: ComplexArray, least: float) -> tuple[ComplexArray, FloatArray]:
    """Orthonormal directions of columns, shape (n, q), and their variances, those above `least`."""
    if columns.shape[1] == 0:
        return np.zeros((len(columns), 0), dtype=np.complex128), np.zeros(0)
    if columns.shape[1] > len(columns):
        variances, vectors = np.linalg.eigh(columns @ columns.conj().T)
        keep = variances > max(least, 0.0)
        return vectors[:, keep], variances[keep]
    variances, vectors = np.linalg.eigh(columns.conj().T @ columns)
    keep = variances > max(least, 1e-14 * float(variances[-1]))
    # Of small ones beside large ones only the largest digits are orthogonal so far; the large ones come first, since they are exact.
    orthonormal = np.linalg.qr((columns @ vectors[:, keep])[:, ::-1] / np.sqrt(variances[keep][::-1]))[0]
    return orthonormal, variances[keep][::-1]


def _blocks(parts: Sequence[np.ndarray]) -> ComplexArray:
    """Columns of each sweep, zero in the others."""
    rows, columns = np.cumsum([0, *(len(part) for part in parts)]), np.cumsum([0, *(part.shape[1] for part in parts)])
    whole = np.zeros((rows[-1], columns[-1]), dtype=np.complex128)
    for index, part in enumerate(parts):
        whole[rows[index] : rows[index + 1], columns[index] : columns[index + 1]] = part
    return whole
