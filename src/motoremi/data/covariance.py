"""Covariance of the residuals that a correct circuit would have: noise, errors of the analyser, and model discrepancy.

ln Z of all sweeps is one complex vector. Its covariance is diag(sigma^2) plus columns times their adjoint for every part that is smooth
along frequency, so that each part is marginalised exactly:

=====================  ==========================================================================================
white noise            sigma^2, of the mean of the repeats (`noise`)
correlated noise       c^2 K of lengths 0.03, 0.1, 0.3 and 1 decade, for each sweep; its size from the repeats
drift                  d d', change of the motor from repeat to repeat and within a sweep, for each sweep
moved leads            m m' for a shunt G, of an ideal analyser also for R, L and C, which else are unknowns (`fitting.problem`)
analyser               its smooth errors, common to all sweeps, times the square of `declared` (`analyser`)
discrepancy in value   delta^2 [0.8 K(0.3 decades) + 0.2 K(0.08 decades)], for each sweep
discrepancy in place   delta^2 D K(0.3) D*, D = d ln Z / d ln f: near a resonance of quality Q a model may be off by Q times as much
=====================  ==========================================================================================

K is the Matern correlation (`kernels`). The discrepancy is the part of the data that neither circuit, analyser nor noise describes (Kennedy
and O'Hagan, Journal of the Royal Statistical Society B 63, 2001).
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
from motoremi.data.kernels import Parts, by_parabolas, slope, smooth_basis
from motoremi.data.noise import Noise
from motoremi.data.quantity import Quantity
from motoremi.data.repeats import CORRELATED
from motoremi.interrupts import checkpoint
from motoremi.threads import one_blas_thread

VALUE: Parts = ((0.8, 0.3), (0.2, 0.08))
PLACE: Parts = ((1.0, 0.3),)
# Directions whose share of the variance is less than this are left out.
LEAST_SHARE = 1e-4
# The same while a fit is on its way to the solution: half as many directions are left.
ROUGH_SHARE = 1e-2
# Number of results that are cached: a search returns to the same few sizes again and again.
KEPT = 4


class Sizes(NamedTuple):
    """Sizes that are estimated from the data.

    Parameters
    ----------
    discrepancy : float
        Relative standard deviation of the discrepancy.
    declared : float
        Factor on the analyser's declared errors.
    """

    discrepancy: float
    declared: float


class Part(NamedTuple):
    """The points of one sweep that are used: those that `chosen` selects."""

    frequency_hz: FloatArray
    impedance_ohm: ComplexArray
    noise: Noise
    chosen: np.ndarray


@dataclass(frozen=True, eq=False)
class Columns:
    """The smooth parts of the covariance of some points: each matrix B of columns adds B B* to it.

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
        """The parts for the chosen points of some sweeps."""
        known, discrepancy, places = [], [], []
        for part in parts:
            frequency = part.frequency_hz[part.chosen]
            slopes = slope(part.frequency_hz, part.impedance_ohm, float(np.median(part.noise.sigma)))[part.chosen]
            correlated = [] if part.noise.correlated is None else [part.noise.correlated[part.chosen, None] * smooth_basis(frequency, CORRELATED)]
            drift = [] if part.noise.drift is None else [part.noise.drift[part.chosen, None] / np.sqrt(2)]
            drift += [] if part.noise.within is None else [part.noise.within[part.chosen, None]]
            # A problem has unknowns for R, L and C of a connection, unless the analyser is ideal.
            moved = slice(None) if analyser.ideal else slice(2, 3)
            drift += [] if part.noise.moved is None else [part.noise.moved[part.chosen, moved] / np.sqrt(2)]
            known.append(np.concatenate([np.zeros((frequency.size, 0)), *correlated, *drift], axis=1))
            discrepancy.append(np.concatenate([smooth_basis(frequency, VALUE), slopes[:, None] * smooth_basis(frequency, PLACE)], axis=1))
            places.append((frequency, part.impedance_ohm[part.chosen]))
        frequency, impedance_ohm = (np.concatenate(values) for values in zip(*places, strict=True))
        sigma = np.concatenate([part.noise.sigma[part.chosen] for part in parts])
        quantity = analyser.quantity
        coefficient = None if quantity is None else np.concatenate([_with_less_noise(part, quantity) for part in parts])
        return cls(sigma, tuple(known), tuple(discrepancy), error_basis(analyser, frequency, impedance_ohm, coefficient))

    @property
    def known(self) -> ComplexArray:
        """Correlated noise and drift of all sweeps, shape (n, q)."""
        return _blocks(self.known_of)

    @property
    def discrepancy(self) -> ComplexArray:
        """The discrepancy at size one of all sweeps, shape (n, q)."""
        return _blocks(self.discrepancy_of)

    @cached_property
    def sweep_blocks(self) -> SweepBlocks:
        """The inverse covariance without the analyser's errors, which are common to all sweeps: one block for each sweep."""
        return _sweep_blocks(self)

    @cached_property
    def whitening(self) -> Callable[[float], Whitening]:
        """The covariance at one scale of the declared errors, for every size of the discrepancy."""
        return lru_cache(KEPT)(lambda declared: Whitening(self.sweep_blocks, declared))


@dataclass(frozen=True, eq=False)
class SweepBlocks:
    """The inverse covariance without the analyser's errors: W (1 - F f F* - H V s V* H) W with W = 1/sigma.

    Parameters
    ----------
    fixed : ndarray, shape (n, p)
        F: orthonormal directions of the noise in weighted residuals.
    fixed_shares : ndarray, shape (p,)
        f: share of the variance along each that is noise, 0 .. 1.
    spread : ndarray, shape (n, q)
        H V: orthonormal directions V of the discrepancy in residuals that H whitens of the noise, transformed back by H.
    strengths : ndarray, shape (q,)
        Variance along each at a discrepancy of one.
    analyser : ndarray, shape (n, r)
        Columns of the analyser's errors, weighted, at the declared size.
    sweeps : tuple of slice
        The points of each sweep.
    """

    sigma: FloatArray
    fixed: ComplexArray
    fixed_shares: FloatArray
    spread: ComplexArray
    strengths: FloatArray
    analyser: ComplexArray
    sweeps: tuple[slice, ...]

    def shares(self, discrepancy: FloatArray) -> FloatArray:
        """Share of the variance along each direction that is discrepancy, shape (..., q)."""
        variance = discrepancy[..., None] ** 2 * self.strengths
        return variance / (1 + variance)

    def products(self, weighted: ComplexArray, discrepancies: FloatArray) -> ComplexArray:
        """Inner products of weighted residuals, shape (m, n), and of the analyser's columns after them; shape (sizes, m + r, m + r)."""
        rows = np.concatenate([weighted, self.analyser.T])
        noise, along = rows @ self.fixed.conj(), rows @ self.spread.conj()
        quiet = rows.conj() @ rows.T - (noise.conj() * self.fixed_shares) @ noise.T
        shares = self.shares(discrepancies)[:, None, :]
        return quiet - (along.conj() * shares) @ along.T


@dataclass(frozen=True, eq=False)
class Whitening:
    """The inverse covariance at one scale of the declared errors: W (1 - D D*) W."""

    blocks: SweepBlocks
    declared: float

    @cached_property
    def directions(self) -> Callable[..., ComplexArray]:
        """(size of the discrepancy, least share) -> D, shape (n, r): 1 - D D* is the inverse covariance of weighted residuals."""
        return lru_cache(KEPT)(self._directions)

    @one_blas_thread
    def _directions(self, discrepancy: float, least_share: float = LEAST_SHARE) -> ComplexArray:
        checkpoint()
        blocks = self.blocks
        shares, fixed = blocks.shares(np.asarray(discrepancy)), blocks.fixed_shares > least_share
        used = shares > least_share
        own = np.concatenate([blocks.fixed[:, fixed] * np.sqrt(blocks.fixed_shares[fixed]), blocks.spread[:, used] * np.sqrt(shares[used])], axis=1)
        if not blocks.analyser.shape[1]:
            return own
        columns = self.declared * blocks.analyser
        columns = columns - own @ (own.conj().T @ columns)
        factor = np.linalg.cholesky(np.eye(columns.shape[1]) + self.declared * (blocks.analyser.conj().T @ columns))
        return np.concatenate([own, np.linalg.solve(factor, columns.conj().T).conj().T], axis=1)

    @cached_property
    def adjoints(self) -> Callable[..., tuple[tuple[slice, ComplexArray], ...]]:
        """(size of the discrepancy, least share) -> D* in parts, each with the points at which it is not zero.

        Most directions are those of one sweep, the others go through all. D D* is that of `directions`; no part has more directions than points:
        noise and discrepancy of a sweep may have that many each.
        """
        return lru_cache(KEPT)(self._adjoints)

    @one_blas_thread
    def _adjoints(self, discrepancy: float, least_share: float) -> tuple[tuple[slice, ComplexArray], ...]:
        adjoint, parts = self.directions(discrepancy, least_share).conj(), []
        for points in self.blocks.sweeps:
            elsewhere = np.ones(len(adjoint), dtype=np.bool_)
            elsewhere[points] = False
            own = ~adjoint[elsewhere].any(axis=0)
            parts.append((points, _square(adjoint[points, own])))
            adjoint = adjoint[:, ~own]
        parts.append((slice(None), np.ascontiguousarray(adjoint)))
        return tuple((points, part) for points, part in parts if part.shape[1])

    def with_analyser(self, products: ComplexArray, count: int) -> tuple[ComplexArray, FloatArray]:
        """From `SweepBlocks.products`, the products of the first `count` rows under the whole covariance, and ln det of the analyser's addition.

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
        """ln det of the covariance at each size of the discrepancy, without the analyser's addition to it."""
        blocks = self.blocks
        fixed = -np.sum(np.log1p(-blocks.fixed_shares)) + 2 * np.sum(np.log(blocks.sigma))
        return fixed + np.sum(np.log1p(discrepancies[:, None] ** 2 * blocks.strengths), axis=1)


def _with_less_noise(part: Part, quantity: Quantity) -> ComplexArray:
    """The coefficient at the chosen points, for the error terms: terms that contain its noise would be correlated with the residuals."""
    white = part.noise.sigma / np.abs(quantity.relative(part.impedance_ohm))
    return by_parabolas(quantity.coefficient_of(part.impedance_ohm), white)[part.chosen]


def _square(columns: ComplexArray) -> ComplexArray:
    """Columns B with the same B B*, no more of them than rows."""
    if columns.shape[1] <= columns.shape[0]:
        return np.ascontiguousarray(columns)
    triangle: ComplexArray = np.asarray(np.linalg.qr(columns.conj().T, mode="r"))
    return np.ascontiguousarray(triangle.conj().T)


def orthonormal(directions: ComplexArray) -> tuple[ComplexArray, FloatArray]:
    """Orthonormal directions, shape (n, p), and the share 0 .. 1 of each, for D of an inverse covariance 1 - D D*."""
    variances, vectors = np.linalg.eigh(directions.conj().T @ directions)
    used = variances > 1e-10
    return directions @ vectors[:, used] / np.sqrt(variances[used]), variances[used]


@one_blas_thread
def _sweep_blocks(columns: Columns) -> SweepBlocks:
    weight = 1 / columns.sigma
    fixed, shares, spread, strengths, sweeps = [], [], [], [], []
    first = 0
    for known, discrepancy in zip(columns.known_of, columns.discrepancy_of, strict=True):
        sweeps.append(slice(first, first + len(known)))
        own = weight[sweeps[-1], None]
        first += len(known)
        checkpoint()
        directions, variances = directions_of(known * own, LEAST_SHARE)
        # H = 1 - back F* is the inverse square root of the noise's covariance.
        back = directions * (1 - 1 / np.sqrt(1 + variances))
        whitened = discrepancy * own
        whitened = whitened - back @ (directions.conj().T @ whitened)
        along, strength = directions_of(whitened, 1e-12 * float(np.max(np.sum(np.abs(whitened) ** 2, axis=0), initial=0.0)))
        fixed.append(directions)
        shares.append(variances / (1 + variances))
        spread.append(along - back @ (directions.conj().T @ along))
        strengths.append(strength)
    return SweepBlocks(
        columns.sigma,
        _blocks(fixed),
        np.concatenate(shares),
        _blocks(spread),
        np.concatenate(strengths),
        columns.analyser * weight[:, None],
        tuple(sweeps),
    )


def _blocks(parts: Sequence[np.ndarray]) -> ComplexArray:
    """A block-diagonal matrix: the columns of each sweep are zero at the points of the others."""
    rows, columns = np.cumsum([0, *(len(part) for part in parts)]), np.cumsum([0, *(part.shape[1] for part in parts)])
    whole = np.zeros((rows[-1], columns[-1]), dtype=np.complex128)
    for index, part in enumerate(parts):
        whole[rows[index] : rows[index + 1], columns[index] : columns[index + 1]] = part
    return whole
