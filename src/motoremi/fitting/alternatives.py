"""Other solutions of the same model that are about as probable, far from the best one: error bars from the curvature there leave them out.

A likelihood may have several minima, or rise from one and then stay level. An iron whose corner lies below the band shows only a product of share
and corner; a path to the frame that resonates above the band shows little but its capacitance. Such solutions are looked for along each parameter
of a law and at the path to the frame, and widen the error bars that `Fit` shows.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np

from motoremi.arrays import BoolArray, FloatArray
from motoremi.fitting.identify import RISE_95, Along
from motoremi.fitting.polish import polish
from motoremi.fitting.problem import Problem
from motoremi.fitting.result import Fit, on_fits
from motoremi.fitting.search import ARRIVAL_POINTS, AS_PROBABLE, CLOSE, misses_by_far
from motoremi.fitting.starts import resonant_frame
from motoremi.model.motor import BASE_PARAMETERS
from motoremi.threads import one_blas_thread

# How much the objective, which is twice a negative logarithm, may rise to another solution that is far; within the rise of a 95 % interval it need
# not be far but only APART, a factor of 1.6 in some parameter, so that the interval of one that is hardly determined contains it.
RISE, APART = 2 * AS_PROBABLE, 0.5
# The path to the frame: its resonance as a multiple of the highest frequency, the share of Cr in its capacitance, and its quality.
RESONANCES, CR_SHARES, QUALITIES = (0.5, 1.0, 2.0, 4.0), (0.3, 0.7), (0.7, 3.0)
FRAME = frozenset({"Rr", "Lr", "Cr", "Cf"})
# Steps towards another solution.
STEPS = 30


@one_blas_thread
def alternatives(fit: Fit) -> FloatArray:
    """Steps from the solution of a fit to others that the data allow, shape (m, k), the farthest first.

    Parameters
    ----------
    fit : Fit
        One with a large error has none, nor one that did not converge or is the paper's colony's: it is no solution.
    """
    solved = fit.converged and fit.method != "paper" and not misses_by_far(fit.sizes)
    found = [*_along_laws(fit), *_at_the_frame(fit)] if solved else []
    steps = np.array(found).reshape(-1, len(fit.unknowns))
    size = np.max(np.abs(steps[:, fit.weighed.own]), axis=1, initial=0.0)
    return steps[np.argsort(-size, kind="stable")]


def _along_laws(fit: Fit) -> list[FloatArray]:
    """As far as each parameter of an effect can be changed, with all others fitted there."""
    problem = fit.weighed
    found: list[FloatArray] = []
    for index, parameter in enumerate(problem.unknowns):
        if parameter not in BASE_PARAMETERS and problem.own[index]:
            for bound in (problem.low[index], problem.high[index]):
                reached = Along(fit, index).walk(float(bound), fit.objective + RISE)
                found += _allowed(fit, {**fit.held, parameter.name: reached.values[parameter.name]}, [reached.values])
    return found


def _at_the_frame(fit: Fit) -> list[FloatArray]:
    """With other paths to the frame of the same capacitance, that resonate at the end of the band or above it.

    Only if one of its elements is hardly known: where all are, the sweeps show the resonance.
    """
    problem = fit.weighed
    known = {p.name: deviation for p, deviation in zip(problem.unknowns, np.sqrt(np.diag(fit.exact_covariance)), strict=True)}
    if not known.keys() >= FRAME or 2 * max(known[name] for name in FRAME) < APART:
        return []
    seen = fit.parameters
    # The capacitance that the path has together, where the one of the branch is seen.
    lowest, highest = (float(end) for end in (problem.observed.frequency_hz.min(), problem.observed.frequency_hz.max()))
    middle = 2 * np.pi * np.sqrt(lowest * highest)
    branch = 1 / (seen["Rr"] + 1j * (middle * seen["Lr"] - 1 / (middle * seen["Cr"])))
    whole = seen["Cf"] + max(float(branch.imag / middle), 0.0)
    starts = [
        {**seen, **fit.nuisance, **resonant_frame(whole, share, multiple * highest, quality)}
        for multiple, share, quality in product(RESONANCES, CR_SHARES, QUALITIES)
    ]
    coarse = fit.task.likelihood(ARRIVAL_POINTS, fit.sizes)
    ends = polish(coarse, coarse.vectors(starts), iterations=STEPS, precision=CLOSE)
    near = ends.u[ends.objective <= _level(fit, coarse)]
    return _allowed(fit, fit.held, [coarse.named(u) for u in near])


def _level(fit: Fit, problem: Problem) -> float:
    """The objective up to which a solution is about as probable, on the points of a problem."""
    return float(polish(problem, fit.unknowns, iterations=STEPS, precision=CLOSE).objective[0]) + RISE


def _allowed(fit: Fit, held: Mapping[str, float], near: Sequence[Mapping[str, float]]) -> list[FloatArray]:
    """The steps to solutions on all points near these ones, if they are about as probable and not near the solution of the fit."""
    starts = [values for values in near if _far_or_apart(fit, _steps(fit, [values]))[0].any()]
    if not starts:
        return []
    problem = dataclasses.replace(fit.task, held=held).likelihood(None, fit.sizes)
    ends = polish(problem, problem.vectors(starts), iterations=STEPS, precision=CLOSE)
    steps = _steps(fit, [problem.named(u) for u in ends.u])
    rise = fit.weighed.objective(fit.unknowns + steps) - fit.objective
    return list(steps[(_far_or_apart(fit, steps) & (rise[:, None] <= (RISE, RISE_95))).any(axis=1)])


def _steps(fit: Fit, solutions: Sequence[Mapping[str, float]]) -> FloatArray:
    """From the solution of the fit to others, shape (m, k)."""
    return fit.weighed.vectors(solutions) - fit.unknowns


def _far_or_apart(fit: Fit, steps: FloatArray) -> BoolArray:
    """Whether each step is far, and whether it is apart, shape (m, 2)."""
    return np.stack([fit.far(steps), (np.abs(steps[:, fit.weighed.own]) > APART).any(axis=1)], axis=1)


on_fits.alternatives = alternatives
