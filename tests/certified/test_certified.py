"""Certified motors: `fit` against minima found by independent 60-digit arithmetic (certify.py), as lmfit does with NIST's StRD."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

import motoremi as me
from motoremi.data.covariance import Sizes
from motoremi.data.files import read_impedance
from motoremi.fitting.marginal import marginal
from motoremi.fitting.polish import SHARP, polish, sharpened
from motoremi.fitting.problem import AS_DECLARED
from motoremi.fitting.result import Fit, summarise
from motoremi.fitting.search import Found, Solution
from motoremi.model.effects import add_effects

pytestmark = pytest.mark.slow

HERE = Path(__file__).parent
CERTIFIED = json.loads((HERE / "certified.json").read_text())
# A parameter counts as well determined if its certified error bar is below this share of it. What the final steps leave is a millionth of
# the error bar, so six digits of it are then certain.
WELL = 0.1
DIGITS = 6
# Rounding: the objective sums 1e3 squares, the error bars come from an inverse.
DIGITS_OF_OBJECTIVE, DIGITS_OF_SIGMA = 9, 4
# Certified is the likelihood of noise alone. The sizes that a fit chooses for itself move its solution within the error bar; what it takes for
# no discrepancy at all does so by less than a thousandth of it.
NOISE_ALONE = Sizes(0.0, 1.0)
AS_GOOD_AS_NONE = 1e-3


def log_relative_error(found: float, certified: float) -> float:
    """Digits in common, 15 at most."""
    return 15.0 if found == certified else min(15.0, -math.log10(abs(found - certified) / abs(certified)))


def solved_at(fit: Fit, sizes: Sizes) -> Fit:
    """The same fit, brought to its minimum at other sizes."""
    problem = fit.task.likelihood(None, sizes)
    u, evaluations = sharpened(problem, polish(problem, problem.vector(fit.parameters)).u[0])
    solution = Solution(problem.named(u), sizes, marginal(problem, u), True, evaluations)
    return summarise(fit.task, Found(solution, (), {}), fit.method, fit.seed)


@pytest.mark.parametrize("name", CERTIFIED)
def test_fit_agrees_with_the_certified_minimum(name):
    certified = CERTIFIED[name]
    effects = [certified["effect"]] if certified["effect"] else []
    sweeps = [read_impedance(HERE / name / f"{termination}.csv", termination) for termination in ("short", "open")]
    found = me.fit(add_effects(me.dc_motor(), effects), sweeps, analyser="none")
    assert found.converged
    fit, declared = solved_at(found, NOISE_ALONE), solved_at(found, AS_DECLARED)
    assert log_relative_error(fit.objective, float(certified["objective"])) >= DIGITS_OF_OBJECTIVE
    assert fit.parameters.keys() == certified["parameters"].keys()
    well = 0
    for key, text in certified["parameters"].items():
        value, sigma = float(text), float(certified["sigma"][key])
        assert abs(found.parameters[key] - value) < sigma
        assert abs(declared.parameters[key] - value) < AS_GOOD_AS_NONE * sigma
        assert abs(fit.parameters[key] - value) < 10 * SHARP * sigma
        if sigma < WELL * value:
            well += 1
            assert log_relative_error(fit.parameters[key], value) >= DIGITS
            assert log_relative_error(fit.exact_sigma[key], sigma) >= DIGITS_OF_SIGMA
    assert well >= 5
    if found.sizes == AS_DECLARED:
        # The fit itself is as sharp as the arithmetic allows.
        assert all(abs(found.parameters[key] - value) < 10 * SHARP * declared.sigma[key] for key, value in declared.parameters.items())
