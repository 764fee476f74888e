"""The likelihood of new data, against numerical integration."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.optimize import lsq_linear
from scipy.stats import norm

from motoremi.arrays import BoolArray, FloatArray, IntArray
from motoremi.investigation.known import Known, Sweeps, within
from motoremi.investigation.weighing import HOPELESS, UNPREDICTED, weigh

SIGMA, PRECISION = 0.01, 100.0


class Curved:
    """Two numbers that depend on one unknown of a model, and exponentially on one response that nobody can predict."""

    size = 1
    elsewhere = False
    density = 0.0
    moving: BoolArray = np.array([True])
    unpredicted: IntArray = np.array([1])
    sigma: FloatArray = np.full(2, SIGMA)
    smooth: FloatArray = np.zeros((1, 2))
    errors: FloatArray = np.zeros((0, 2))

    def __init__(self, data: FloatArray) -> None:
        self.data = data

    def at(self, u: FloatArray, eta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        value = np.exp(3 * eta[0])
        return np.array([u[0] + value, 2 * value - u[0]]), np.array([[1.0, -1.0]]), np.array([[3 * value, 6 * value]])

    def residual(self, mean: FloatArray) -> FloatArray:
        return self.data - mean


@pytest.mark.parametrize("eta", [0.0, 0.02, -0.2, 0.3, 1.0])
def test_the_likelihood_is_that_of_numerical_integration_however_far_a_response_went(eta: float) -> None:
    prediction = Curved(np.array([np.exp(3 * eta) + 0.05, 2 * np.exp(3 * eta) - 0.04]))
    known = Known(np.zeros(1), np.array([[PRECISION]]), np.array([-10.0]), np.array([10.0]))

    # The model's unknown is integrated exactly: the two numbers have a common part of variance 1 / precision, with opposite signs.
    covariance = np.diag([SIGMA**2] * 2) + np.array([[1, -1], [-1, 1]]) / PRECISION
    inverse, scale = np.linalg.inv(covariance), 1 / (2 * np.pi * np.sqrt(np.linalg.det(covariance)))

    # Over the value of the exponential, where the peak is about as wide for every response.
    value = np.exp(3 * eta) + np.linspace(-0.1, 0.1, 20001)
    response = np.log(value) / 3
    left = prediction.data[:, None] - np.array([[1.0], [2.0]]) * value
    likelihood = scale * np.exp(-0.5 * np.sum(left * (inverse @ left), axis=0))
    prior = sum(share * norm.pdf(response, scale=width) for width, share in UNPREDICTED.items())
    total = trapezoid(likelihood * prior / (3 * value), value)
    # Laplace's method leaves out how the prior and the slope change within the peak.
    assert weigh(prediction, known).log_likelihood == pytest.approx(np.log(total), abs=0.05)


def test_a_hopeless_explanation_gets_an_upper_bound_and_learns_nothing() -> None:
    prediction = Curved(np.array([1.5, 2.0]))
    known = Known(np.zeros(1), np.array([[PRECISION]]), np.array([-10.0]), np.array([10.0]))
    whole = weigh(prediction, known)
    assert weigh(prediction, known, least=whole.log_likelihood).log_likelihood == whole.log_likelihood
    bound = weigh(prediction, known, least=whole.log_likelihood + 3 * HOPELESS)
    assert whole.log_likelihood <= bound.log_likelihood < whole.log_likelihood + 2 * HOPELESS
    assert bound.known is known


class Reading:
    """One reading, a weighted sum of two unknowns of a model."""

    size = 0
    elsewhere = False
    density = 0.0
    moving: BoolArray = np.array([True, True])
    unpredicted: IntArray = np.zeros(0, dtype=np.intp)
    smooth: FloatArray = np.zeros((1, 1))
    errors: FloatArray = np.zeros((0, 1))

    def __init__(self, value: float, weights: tuple[float, float], sigma: float) -> None:
        self.value, self.weights, self.sigma = value, np.array(weights), np.full(1, sigma)

    def at(self, u: FloatArray, eta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        return np.array([self.weights @ u]), self.weights[:, None], np.zeros((0, 1))

    def residual(self, mean: FloatArray) -> FloatArray:
        return self.value - mean


def test_what_is_pushed_out_of_its_range_gains_nothing_there() -> None:
    """The second unknown, known to 1, could move by 0.8 freely; at its bound the first one, known to 0.1, has to take over."""
    known = Known(np.zeros(2), np.diag([100.0, 1.0]), np.array([-10.0, -10.0]), np.array([10.0, 0.01]))
    reading = 0.8
    found = weigh(Reading(reading, (1.0, 1.0), SIGMA), known)
    assert found.known.centre == pytest.approx([reading - 0.01, 0.01], abs=0.02)
    # The best within the bounds: x = 0.79 / (1 + 0.01), which costs (x / 0.1)^2 and more; freely it would cost 0.63.
    freely = weigh(Reading(reading, (1.0, 1.0), SIGMA), replace(known, high=np.full(2, 10.0)))
    least = (reading - 0.01) ** 2 / (0.1**2 + SIGMA**2) + 0.01**2
    assert freely.log_likelihood - found.log_likelihood == pytest.approx(0.5 * (least - reading**2 / (1.01 + SIGMA**2)), abs=0.05)


@pytest.mark.parametrize("seed", range(20))
def test_the_minimum_within_bounds_is_that_of_a_library(seed: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(4, 4)) + 2 * np.eye(4)
    right, low = rng.normal(size=4), np.full(4, -np.inf)
    # One bound that is exceeded, and three far away.
    free = np.linalg.solve(root.T @ root, right)
    high = np.where(np.arange(4) == seed % 4, free - 0.3, free + 100)
    expected = lsq_linear(root, np.linalg.solve(root.T, right), (low, high), tol=1e-12).x
    assert within(root.T @ root, right, low, high) == pytest.approx(expected, abs=1e-6)


class Valley:
    """The likelihood of sweeps that show only the sum of an exponential and another unknown: x + exp(y) = 1 within sigma, with both in [-4, 4]."""

    def __init__(self, sigma: float) -> None:
        self.sigma = sigma

    low: FloatArray = np.full(2, -4.0)
    high: FloatArray = np.full(2, 4.0)
    flat_precision: FloatArray = np.full(2, 2 * np.pi / 8**2)

    def objective(self, u: FloatArray) -> FloatArray:
        return ((u[..., 0] + np.exp(u[..., 1]) - 1) / self.sigma) ** 2

    def linearised(self, u: FloatArray) -> SimpleNamespace:
        slope = np.array([1.0, np.exp(u[1])]) / self.sigma
        left = (u[0] + np.exp(u[1]) - 1) / self.sigma
        return SimpleNamespace(objective=self.objective(u), gradient=slope * left, matrix=np.outer(slope, slope))

    def curvature_pull(self, here: SimpleNamespace, u: FloatArray, step: FloatArray) -> FloatArray:
        return np.array([1.0, np.exp(u[1])]) / self.sigma * np.exp(u[1]) * step[1] ** 2 / self.sigma


def direct(value: float) -> Reading:
    """A reading of the second unknown."""
    return Reading(value, (0.0, 1.0), 0.1)


@pytest.mark.parametrize("sigma", [1e-2, 1e-4])
def test_a_value_far_along_a_valley_is_compared_with_the_likelihood_itself(sigma: float) -> None:
    likelihood = Valley(sigma)
    centre = np.array([1 - np.exp(0.2), 0.2])
    flat = 2 * np.pi / 8**2 * np.eye(2)
    sweeps = Sweeps(likelihood, np.zeros((2, 2)), np.zeros(2), fit=None)  # type: ignore[arg-type]
    known = Known(centre, likelihood.linearised(centre).matrix + flat, likelihood.low, likelihood.high, sweeps)

    for value in (0.2, 0.7, -1.0):
        found = weigh(direct(value), known)
        # On the valley: where the sweeps and the value want it.
        assert found.known.centre[1] == pytest.approx(value, abs=0.02)
        assert found.known.centre.sum() - found.known.centre[1] + np.exp(found.known.centre[1]) == pytest.approx(1, abs=sigma)
        # The same on the next value: what was taught is kept beside the sweeps.
        again = weigh(direct(value), found.known)
        assert again.known.precision[1, 1] > found.known.precision[1, 1]

    # The sweeps leave y open over its range; x follows it. So all values are about as likely, which a normal distribution would deny.
    logs = [weigh(direct(value), known).log_likelihood for value in (0.2, 0.7, -1.0)]
    assert np.ptp(logs) < 1.0
    assert weigh(direct(-1.0), known.normal).log_likelihood < logs[2]
