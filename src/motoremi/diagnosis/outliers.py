"""Single points that no smooth error explains: each is held against what all the others say of it."""

from __future__ import annotations

import numpy as np

from motoremi.arrays import BoolArray
from motoremi.fitting.result import Fit

# Chi-squared of two degrees of freedom of one point given the others: by chance once in three million.
FAR_OFF = 30.0
# More points than this share are no single points.
MOST = 0.08


def outlying(fit: Fit) -> dict[str, BoolArray]:
    """Points far off what noise, analyser, discrepancy and all other points allow, by termination; empty where none or too many are.

    With K the inverse covariance, a residual given all others has the variance 1 / K_ii and lies (K r)_i / K_ii off (Rasmussen and
    Williams, 2006, eq. 5.12).
    """
    problem = fit.problem
    weight = problem.observed.weight
    whitening = problem.whitening
    directions = whitening.directions(fit.sizes.discrepancy)
    weighted = problem.residual(fit.unknowns) * weight
    pulled = weighted - directions @ (directions.conj().T @ weighted)
    own = np.maximum(1 - np.sum(np.abs(directions) ** 2, axis=1), 1e-12)
    far = np.abs(pulled) ** 2 / own > FAR_OFF
    if not far.any() or np.mean(far) > MOST:
        return {}
    return {termination: far[where] for termination, where in problem.observed.slices.items() if far[where].any()}
