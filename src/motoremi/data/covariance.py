"""The covariance of what a perfect circuit would leave: noise, analyser, and what no model describes.

ln Z of all sweeps is one complex vector. Its covariance is diag(sigma^2) plus columns times their adjoint for every part that is smooth
along frequency, so that each part is marginalised exactly:

=====================  ==========================================================================================
white noise            sigma^2, of the mean of the repeats (`noise`)
correlated noise       c^2 K of lengths 0.03, 0.1, 0.3 and 1 decade, for each sweep; its size from the repeats
drift                  d d', what the motor changed from repeat to repeat and within each, for each sweep
analyser               its smooth errors, common to all sweeps, times the square of `declared` (`analyser`)
discrepancy in value   delta^2 [0.8 K(0.3 decades) + 0.2 K(0.08 decades)], for each sweep: what no model describes
discrepancy in place   delta^2 D K(0.3) D*, D = d ln Z / d ln f: near a sharp resonance a model may be off by Q times as much
=====================  ==========================================================================================

The discrepancy follows Kennedy and O'Hagan (Journal of the Royal Statistical Society B 63, 2001).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.analyser import Analyser, error_basis
from motoremi.data.directions import directions as directions_of
from motoremi.data.kernels import Parts, slope, smooth_basis, smoothed
from motoremi.data.noise import Noise
from motoremi.data.repeats import WANDERING
from motoremi.interrupts import checkpoint

VALUE: Parts = ((0.8, 0.3), (0.2, 0.08))
PLACE: Parts = ((1.0, 0.3),)
# A direction that holds less than this share of the noise's variance tells nothing.
LEAST_SHARE = 1e-4
# On the way to a solution one that holds less than this need not be followed: half as many are left.
ROUGH_SHARE = 1e-2
# A search returns to the same few sizes again and again.
KEPT = 4


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
    """The smooth parts of the covariance of some points: columns B of which each adds B B* to it.

    Parameters
    ----------
    sigma : ndarray, shape (n,)
        White noise.
    known_of, discrepancy_of : tuple of ndarray, shape (points of the sweep, q) each
        Correlated noise and drift, and the discrepancy at size one, of each sweep.
    analyser : ndarray, shape (n, q)
        At its declared size; common to all sweeps.
    """

    sigma: FloatArray
    known_of: tuple[ComplexArray, ...]
    discrepancy_of: tuple[ComplexArray, ...]
    analyser: ComplexArray

    @classmethod
    def of(cls, parts: Sequence[Part], analyser: Analyser) -> Columns:
        """Those of the chosen points of some sweeps."""
        known, free, places = [], [], []
        for part in parts:
            frequency = part.frequency_hz[part.chosen]
            quiet = smoothed(part.impedance_ohm)
            turning = slope(part.frequency_hz, part.impedance_ohm, float(np.median(part.noise.sigma)))[part.chosen]
            wander = part.noise.correlated * smooth_basis(frequency, WANDERING) if part.noise.correlated else np.zeros((frequency.size, 0))
            moved = [] if part.noise.drift is None else [part.noise.drift[part.chosen, None] / np.sqrt(2)]
            moved += [] if part.noise.within is None else [part.noise.within[part.chosen, None]]
            known.append(np.concatenate([wander, *moved], axis=1))
            free.append(np.concatenate([smooth_basis(frequency, VALUE), turning[:, None] * smooth_basis(frequency, PLACE)], axis=1))
            places.append((frequency, quiet[part.chosen]))
        frequency, quiet = (np.concatenate(values) for values in zip(*places, strict=True))
        sigma = np.concatenate([part.noise.sigma[part.chosen] for part in parts])
        return cls(sigma, tuple(known), tuple(free), error_basis(analyser, frequency, quiet))

    @property
    def known(self) -> ComplexArray:
        """Correlated noise and drift of all sweeps, shape (n, q)."""
        return _blocks(self.known_of)

    @property
    def discrepancy(self) -> ComplexArray:
        """The discrepancy at size one of all sweeps, shape (n, q)."""
        return _blocks(self.discrepancy_of)

    @cached_property
    def apart(self) -> Apart:
        """What each sweep's covariance is without the analyser, which all share."""
        return _apart(self)

    @cached_property
    def whitening(self) -> Callable[[float], Whitening]:
        """The covariance at one scale of the declared errors, ready for every size of the discrepancy."""
        return lru_cache(KEPT)(lambda declared: Whitening(self.apart, declared))


@dataclass(frozen=True, eq=False)
class Apart:
    """W (1 - F f F* - H V s V* H) W with W = 1/sigma is the inverse covariance without the analyser: noise, then the discrepancy on top.

    Parameters
    ----------
    fixed : ndarray, shape (n, p)
        F: orthonormal directions of the noise in weighted residuals.
    fixed_shares : ndarray, shape (p,)
        f: what each takes up of its variance, 0 .. 1.
    spread : ndarray, shape (n, q)
        H V: orthonormal directions V of the discrepancy once the noise is white (H), brought back.
    strengths : ndarray, shape (q,)
        Variance of each at a discrepancy of one.
    analyser : ndarray, shape (n, r)
        Weighted, at its declared size.
    """

    sigma: FloatArray
    fixed: ComplexArray
    fixed_shares: FloatArray
    spread: ComplexArray
    strengths: FloatArray
    analyser: ComplexArray

    def shares(self, discrepancy: FloatArray) -> FloatArray:
        """What each direction of the discrepancy takes up, shape (..., q)."""
        variance = discrepancy[..., None] ** 2 * self.strengths
        return variance / (1 + variance)

    def products(self, weighted: ComplexArray, discrepancies: FloatArray) -> ComplexArray:
        """Inner products of weighted residuals, shape (m, n), and the analyser's columns after them; shape (sizes, m + r, m + r)."""
        rows = np.concatenate([weighted, self.analyser.T])
        noise, along = rows @ self.fixed.conj(), rows @ self.spread.conj()
        quiet = rows.conj() @ rows.T - (noise.conj() * self.fixed_shares) @ noise.T
        shares = self.shares(discrepancies)[:, None, :]
        return quiet - (along.conj() * shares) @ along.T


@dataclass(frozen=True, eq=False)
class Whitening:
    """The inverse covariance at one scale of the declared errors: W (1 - D D*) W."""

    apart: Apart
    declared: float

    @cached_property
    def directions(self) -> Callable[..., ComplexArray]:
        """Of a size of the discrepancy, and a least share: D, shape (n, r), such that 1 - D D* is the inverse covariance of weighted residuals."""
        return lru_cache(KEPT)(self._directions)

    def _directions(self, discrepancy: float, least_share: float = LEAST_SHARE) -> ComplexArray:
        checkpoint()
        apart = self.apart
        shares, fixed = apart.shares(np.asarray(discrepancy)), apart.fixed_shares > least_share
        used = shares > least_share
        alone = np.concatenate([apart.fixed[:, fixed] * np.sqrt(apart.fixed_shares[fixed]), apart.spread[:, used] * np.sqrt(shares[used])], axis=1)
        if not apart.analyser.shape[1]:
            return alone
        columns = self.declared * apart.analyser
        columns = columns - alone @ (alone.conj().T @ columns)
        factor = np.linalg.cholesky(np.eye(columns.shape[1]) + self.declared * (apart.analyser.conj().T @ columns))
        return np.concatenate([alone, np.linalg.solve(factor, columns.conj().T).conj().T], axis=1)

    def less_analyser(self, products: ComplexArray, count: int) -> tuple[ComplexArray, FloatArray]:
        """Of `Apart.products`, those of the first `count` under the whole covariance, and ln det of what the analyser adds to it.

        Returns
        -------
        products : ndarray, shape (sizes, count, count)
        log_determinants : ndarray, shape (sizes,)
        """
        own, mixed = products[:, :count, :count], products[:, count:, :count]
        added = self.declared**2 * products[:, count:, count:] + np.eye(products.shape[-1] - count)
        taken = np.swapaxes(mixed.conj(), -1, -2) @ np.linalg.solve(added, self.declared**2 * mixed)
        return own - taken, np.linalg.slogdet(added)[1]

    def log_determinants(self, discrepancies: FloatArray) -> FloatArray:
        """ln det of the covariance at each size of the discrepancy, without what the analyser adds to it."""
        apart = self.apart
        fixed = -np.sum(np.log1p(-apart.fixed_shares)) + 2 * np.sum(np.log(apart.sigma))
        return fixed + np.sum(np.log1p(discrepancies[:, None] ** 2 * apart.strengths), axis=1)


def orthonormal(directions: ComplexArray) -> tuple[ComplexArray, FloatArray]:
    """Orthonormal directions, shape (n, p), and what each takes up, 0 .. 1, for D of an inverse covariance 1 - D D*."""
    variances, vectors = np.linalg.eigh(directions.conj().T @ directions)
    used = variances > 1e-10
    return directions @ vectors[:, used] / np.sqrt(variances[used]), variances[used]


def _apart(columns: Columns) -> Apart:
    weight = 1 / columns.sigma
    fixed, shares, spread, strengths = [], [], [], []
    first = 0
    for known, free in zip(columns.known_of, columns.discrepancy_of, strict=True):
        own = weight[first : first + len(known), None]
        first += len(known)
        checkpoint()
        directions, variances = directions_of(known * own, LEAST_SHARE)
        # H = 1 - back F*, the inverse root of the noise's covariance.
        back = directions * (1 - 1 / np.sqrt(1 + variances))
        quiet = free * own
        quiet = quiet - back @ (directions.conj().T @ quiet)
        along, strength = directions_of(quiet, 1e-12 * float(np.max(np.sum(np.abs(quiet) ** 2, axis=0), initial=0.0)))
        fixed.append(directions)
        shares.append(variances / (1 + variances))
        spread.append(along - back @ (directions.conj().T @ along))
        strengths.append(strength)
    return Apart(
        columns.sigma,
        _blocks(fixed),
        np.concatenate(shares),
        _blocks(spread),
        np.concatenate(strengths),
        columns.analyser * weight[:, None],
    )


def _blocks(parts: Sequence[np.ndarray]) -> ComplexArray:
    """Columns of each sweep, zero in the others."""
    rows, columns = np.cumsum([0, *(len(part) for part in parts)]), np.cumsum([0, *(part.shape[1] for part in parts)])
    whole = np.zeros((rows[-1], columns[-1]), dtype=np.complex128)
    for index, part in enumerate(parts):
        whole[rows[index] : rows[index + 1], columns[index] : columns[index + 1]] = part
    return whole
