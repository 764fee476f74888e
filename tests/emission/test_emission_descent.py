"""Levenberg-Marquardt in a box: against scipy on linear problems, and on a curved valley with a known end."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from motoremi.emission.descent import descend


@pytest.mark.parametrize("seed", range(5))
def test_a_linear_problem_in_a_box_ends_where_scipy_ends(seed):
    rng = np.random.default_rng(seed)
    matrix, right = rng.normal(size=(30, 6)), rng.normal(size=30) * 3
    low, high = np.full(6, -0.2), np.full(6, 0.2)
    wanted = lsq_linear(matrix, right, bounds=(low, high), tol=1e-12)
    assert np.any(np.abs(np.abs(wanted.x) - 0.2) < 1e-9), "no bound is active: the case tests nothing of the box"
    found = descend(lambda x: matrix @ x - right, lambda x: matrix, np.zeros(6), low, high, 50)
    # It stops where a step gains less than a ten-thousandth of the cost.
    assert found.cost == pytest.approx(wanted.cost, rel=2e-4)
    assert np.all((found.x >= low) & (found.x <= high))


def test_a_curved_valley_is_followed_to_the_face_of_the_box():
    """Rosenbrock's function with x at most 0.5: the least value is at (0.5, 0.25)."""
    found = descend(
        lambda x: np.array([1 - x[0], 10 * (x[1] - x[0] ** 2)]), lambda x: np.array([[-1.0, 0.0], [-20 * x[0], 10.0]]),
        np.array([-1.2, 1.0]), np.array([-2.0, -2.0]), np.array([0.5, 2.0]), 100,
    )  # fmt: skip
    assert found.x == pytest.approx([0.5, 0.25], abs=1e-3)


def test_no_more_slopes_are_worked_out_than_asked_for():
    asked = []

    def slopes(x):
        asked.append(x)
        return np.array([[-1.0, 0.0], [-20 * x[0], 10.0]])

    descend(lambda x: np.array([1 - x[0], 10 * (x[1] - x[0] ** 2)]), slopes, np.array([-1.2, 1.0]), np.full(2, -2.0), np.full(2, 2.0), 4)
    assert len(asked) == 4
