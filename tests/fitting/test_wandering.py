"""The likelihood of residuals that wander along frequency, against dense covariance matrices, and what many points of one curve are worth."""

from __future__ import annotations

import numpy as np
import pytest
from covariances import complex_normal

from motoremi.fitting import wandering
from motoremi.fitting.wandering import LENGTHS, VARIANCES, log_likelihood


def test_without_heavy_tails_it_is_the_likelihood_of_the_whole_covariance(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wandering, "TAILS", 1e12)
    rng = np.random.default_rng(1)
    frequency = np.tile(np.geomspace(2e5, 3e7, 14), 2)
    sweeps = (slice(0, 14), slice(14, 28))
    residual, noise = 0.01 * complex_normal(rng, 28), 1e-6 * (1 + rng.random(28))
    systematic = 1e-5 * rng.random(28)
    least = 0.5 * np.mean(np.abs(residual) ** 2)
    likelihoods = []
    for size in VARIANCES.ravel() * least:
        for length in LENGTHS:
            total = 0.0
            for sweep in sweeps:
                x, own = np.log(frequency[sweep]), np.sqrt(size + systematic[sweep])
                covariance = own[:, None] * own * np.exp(-np.abs(x[:, None] - x) / length) + np.diag(noise[sweep])
                inverse = np.linalg.solve(covariance, residual[sweep])
                total -= np.linalg.slogdet(covariance)[1] + 0.5 * float((residual[sweep].conj() @ inverse).real)
            likelihoods.append(total)
    assert log_likelihood(residual, frequency, noise, systematic, sweeps) == pytest.approx(max(likelihoods), rel=1e-9)


def difference(points: int) -> float:
    """How much likelier errors that change slowly are than ones of twice the size, read at so many points with some noise."""
    x = np.linspace(0.0, 5.0, points)
    noise = 1e-3 * complex_normal(np.random.default_rng(points), points)
    found = []
    for size in (0.01, 0.02):
        errors = size * np.exp(1j * x) * np.cos(3 * x) + noise
        found.append(log_likelihood(errors, np.exp(x), np.full(points, 0.5e-6), np.zeros(points), [slice(0, points)]))
    return found[0] - found[1]


def test_ten_times_the_points_of_one_curve_are_not_ten_times_the_evidence() -> None:
    assert difference(100) > 20
    assert difference(1000) < 2 * difference(100)
    # Of white errors of unknown size each point would be worth 2 ln 2.
    assert difference(1000) < 0.2 * 1000 * 2 * np.log(2)


def test_a_point_that_stands_out_decides_little() -> None:
    n = 200
    rng = np.random.default_rng(3)
    frequency, quiet = np.geomspace(1e5, 1e7, n), np.full(n, 1e-8)
    residual = 1e-4 * complex_normal(rng, n)
    spoiled = residual.copy()
    spoiled[n // 2] = 0.1
    lost = log_likelihood(residual, frequency, quiet, 0 * quiet, [slice(0, n)]) - log_likelihood(
        spoiled, frequency, quiet, 0 * quiet, [slice(0, n)]
    )
    # Of Student's t distribution with four degrees of freedom: three times the logarithm of how far it stands out in squares.
    assert 0 < lost < 3 * np.log(1e6) + 10
