"""The open-circuit sweep alone: the resonances of winding and frame can be exchanged without a change of the curve.

With C = Cr + Cf and p = Cr / C the frame is a capacitance C in series with a parallel resonance of p^2 Rr, p^2 Lr and Cf / p: the same
circuit as the winding's. So the two can be exchanged without any change of the curve. The short-circuit sweep distinguishes them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from motoremi.arrays import FloatArray
from motoremi.fitting.polish import polish

if TYPE_CHECKING:
    from motoremi.fitting.problem import Problem

ELEMENTS = ("Ra", "La", "Ca", "Rr", "Lr", "Cr", "Cf")
# Twice the log of the odds up to which the other assignment is possible: 20 to 1.
AS_GOOD = 2 * float(np.log(20.0))
# Steps of the refit of the other assignment with the model's effects; if more are needed, it is no solution.
STEPS = 25
EXCHANGEABLE = (
    "the resonances of winding and frame can be exchanged without a change of the open-circuit sweep: parameters that depend on it are not "
    "determined; measure the short-circuit sweep"
)


def exchanged(elements: Mapping[str, float]) -> dict[str, float]:
    """The seven elements with winding's and frame's resonances in each other's place: the same impedance with the far end open."""
    whole = elements["Cr"] + elements["Cf"]
    share = elements["Cr"] / whole
    other = whole / (whole + elements["Ca"])
    return {
        "Ra": elements["Rr"] * share**2,
        "La": elements["Lr"] * share**2,
        "Ca": elements["Cf"] / share,
        "Rr": elements["Ra"] / other**2,
        "Lr": elements["La"] / other**2,
        "Cr": whole * other,
        "Cf": whole * (1 - other),
    }


def may_be_exchanged(problem: Problem) -> bool:
    """Whether both assignments of the resonances must be considered: only the open-circuit sweep, and no element held."""
    return problem.measurement.terminations == ("open",) and {p.name for p in problem.unknowns} >= set(ELEMENTS)


def other_assignment(problem: Problem, u: FloatArray) -> FloatArray | None:
    """The solution with both resonances in each other's place, as a step from `u`; None if the data exclude it.

    Parameters
    ----------
    problem : Problem
        Of the likelihood.
    u : ndarray, shape (k,)
        Its solution.
    """
    if not may_be_exchanged(problem):
        return None
    values = problem.named(u)
    start = problem.vector({**values, **exchanged(values)})
    ends = polish(problem, start, iterations=STEPS)
    if ends.objective[0] - float(problem.objective(u)) > AS_GOOD:
        return None
    return ends.u[0] - u
