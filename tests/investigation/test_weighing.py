"""The likelihood of new data, against numerical integration."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.stats import norm

from motoremi.arrays import BoolArray, FloatArray, IntArray
from motoremi.investigation.weighing import UNPREDICTED, Known, weigh

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
