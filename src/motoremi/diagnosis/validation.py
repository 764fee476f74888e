"""Block cross-validation: how well a model predicts parts of the data that it was not fitted to, without refitting.

All that is Gaussian is marginalised: noise, analyser, discrepancy, and the parameters within the linear model round the solution. With P
the inverse covariance of the residuals r then, the prediction error of a left-out block is (P_bb)^-1 (P r)_b, and its covariance is
(P_bb)^-1 (Sundararajan and Keerthi, Neural Computation 13, 2001). Blocks rather than points, since neighbours in frequency predict each
other whatever the model.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.fitting.result import Fit

BLOCKS = 8
# Smallest eigenvalue used; that of a direction which only the block determines is zero but for rounding.
LEAST = 1e-12
# Eigenvalues below this share of the largest are rounding errors.
ROUNDING = 1e-15


@dataclass(frozen=True)
class Validation:
    """Log predictive densities of left-out data, in nats; only differences between models of the same data mean anything.

    Parameters
    ----------
    bands : float
        Sum over blocks of frequency, each left out of all sweeps at once.
    across : float or None
        Of the open-circuit sweep given the short-circuit sweep; None with one sweep only.
    """

    bands: float
    across: float | None

    def gain_over(self, other: Validation) -> JsonDict:
        """How much better than another model this one predicts."""
        across = None if self.across is None or other.across is None else self.across - other.across
        return {"bands": self.bands - other.bands, "short_to_open": across}


# Cached: an investigation asks for the same two fits after each measurement.
@lru_cache(maxsize=4)
def cross_validated(fit: Fit) -> Validation:
    """Leave out blocks of a fit's data, one after the other."""
    problem = fit.weighed
    pulled, columns = inverse_covariance(fit)
    frequency = np.tile(problem.observed.frequency_hz, 2)
    edges = np.geomspace(frequency.min(), frequency.max() * (1 + 1e-9), BLOCKS + 1)
    inside = [(low <= frequency) & (frequency < high) for low, high in pairwise(edges)]
    bands = sum(_left_out(pulled, columns, block) for block in inside if block.any())
    slices = problem.observed.slices
    if len(slices) == 1:
        return Validation(bands, None)
    second = np.zeros(problem.size, dtype=np.bool_)
    second[slices["open"]] = True
    return Validation(bands, _left_out(pulled, columns, np.tile(second, 2)))


def inverse_covariance(fit: Fit) -> tuple[FloatArray, FloatArray]:
    """P r, shape (2 n,), and columns F, shape (2 n, m), of P = 1 - F F', for residuals weighted by the noise, real parts first."""
    problem, here = fit.weighed, fit.linearised
    directions = problem.whitening.directions(fit.sizes.discrepancy)

    def less_smooth(weighted: ComplexArray) -> ComplexArray:
        return weighted - (weighted @ directions.conj()) @ directions.T

    # A flat prior counts with the variance of its range, for parameters that only the left-out data determine.
    spread = np.where(problem.precision == 0, 12 / (problem.high - problem.low) ** 2, 0.0)
    root = _root_of_inverse(here.matrix + np.diag(spread))
    raw = here.slopes * here.chain[:, None]
    slopes = less_smooth(raw)
    by_parameters = np.concatenate([slopes.real, slopes.imag], axis=1).T @ root
    smooth = np.block([[directions.real, -directions.imag], [directions.imag, directions.real]])
    # A solution of least relative error is not at the maximum of the likelihood; the residual is taken at the linear model's maximum.
    step = root @ (root.T @ here.gradient)
    pulled = less_smooth(here.deviation - step @ raw)
    return np.concatenate([pulled.real, pulled.imag]), np.concatenate([smooth, by_parameters], axis=1)


def _left_out(pulled: FloatArray, columns: FloatArray, block: np.ndarray) -> float:
    """Log predictive density of a block, without what is common to all models."""
    own, inside = pulled[block], columns[block]
    # The left-out block's share of P, 1 - F F', decomposed in its points or, if those are fewer, in its columns.
    if len(own) <= inside.shape[1]:
        values, vectors = np.linalg.eigh(np.eye(len(own)) - inside @ inside.T)
        values = np.maximum(values, LEAST)
        return float(-0.5 * np.sum((vectors.T @ own) ** 2 / values) + 0.5 * np.sum(np.log(values)))
    values, vectors = np.linalg.eigh(np.eye(inside.shape[1]) - inside.T @ inside)
    values = np.maximum(values, LEAST)
    pull = vectors.T @ (inside.T @ own)
    return float(-0.5 * (own @ own + np.sum(pull**2 / values)) + 0.5 * np.sum(np.log(values)))


def _root_of_inverse(matrix: FloatArray) -> FloatArray:
    """R with R R' the inverse of a positive matrix, shape (k, k); its unknowns may be of very different scales."""
    scale = np.sqrt(np.diag(matrix))
    values, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
    return vectors / np.sqrt(np.maximum(values, ROUNDING * values[-1])) / scale[:, None]
