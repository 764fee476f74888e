"""Block cross-validation: how well a model predicts parts of the data that it was not fitted to, without refitting.

With H the block's part of the hat matrix, the residuals that a fit without the block would leave there are (1 - H)^-1 r, and their
covariance is (1 - H)^-1 (Cook 1977, for any linear model; the model is linear enough within its own error bars). Blocks rather than points, since
neighbours in frequency predict each other whatever the model.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from motoremi.arrays import FloatArray, JsonDict
from motoremi.fitting.result import Fit

BLOCKS = 8


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


def cross_validated(fit: Fit) -> Validation:
    """Leave out blocks of a fit's data, one after the other."""
    problem = fit.problem
    here = fit.linearised
    residual, jacobian = _white(fit, here.residual), _white(fit, here.jacobian)
    # A parameter that only the left-out data determine is spread over its range.
    spread = np.where(problem.precision == 0, 12 / (problem.high - problem.low) ** 2, 0.0)
    covariance: FloatArray = np.linalg.pinv(here.matrix + np.diag(spread), hermitian=True).astype(np.float64)
    frequency = np.tile(problem.observed.frequency_hz, 2)
    edges = np.geomspace(frequency.min(), frequency.max() * (1 + 1e-9), BLOCKS + 1)
    inside = [(low <= frequency) & (frequency < high) for low, high in pairwise(edges)]
    bands = sum(_left_out(residual, jacobian, covariance, block) for block in inside if block.any())
    slices = problem.observed.slices
    if len(slices) == 1:
        return Validation(bands, None)
    second = np.zeros(problem.size, dtype=np.bool_)
    second[slices["open"]] = True
    return Validation(bands, _left_out(residual, jacobian, covariance, np.tile(second, 2)))


def _white(fit: Fit, rows: FloatArray) -> FloatArray:
    """Rows of shape (..., 2 n), weighted by the noise, with the analyser's gain error taken out as far as it goes."""
    directions = fit.problem.observed.directions
    shares = np.sum(directions**2, axis=0)
    parts = rows.reshape(*rows.shape[:-1], 2, fit.problem.size)
    white: FloatArray = parts - (parts @ directions * ((1 - np.sqrt(1 - shares)) / shares)) @ directions.T
    return white.reshape(rows.shape)


def _left_out(residual: FloatArray, jacobian: FloatArray, covariance: FloatArray, block: np.ndarray) -> float:
    """Log predictive density of a block, without the constant."""
    own, slopes = residual[block], jacobian[:, block]
    # (1 - J' S J)^-1 by way of the few parameters instead of the many points.
    gram = slopes @ slopes.T
    root = _root(covariance)
    inner = np.eye(len(covariance)) - root.T @ gram @ root
    values = np.clip(np.linalg.eigvalsh(inner), 1e-12, None)
    pull = root.T @ (slopes @ own)
    return float(-0.5 * (own @ own + pull @ np.linalg.solve(inner + 1e-12 * np.eye(len(inner)), pull)) + 0.5 * np.sum(np.log(values)))


def _root(covariance: FloatArray) -> FloatArray:
    values, vectors = np.linalg.eigh(covariance)
    root: FloatArray = vectors * np.sqrt(np.clip(values, 0.0, None))
    return root
