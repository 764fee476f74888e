"""The fit of the paper's circuit without effects, by the ant colony or by the paper's own algorithm."""

from __future__ import annotations

import dataclasses

import numpy as np

from motoremi.arrays import Progress
from motoremi.fitting.exchange import exchanged
from motoremi.fitting.marginal import marginal
from motoremi.fitting.paper_colony import paper_colony
from motoremi.fitting.problem import Problem
from motoremi.fitting.result import Fit, summarise
from motoremi.fitting.search import Found, Solution, Task, arrived_on_all, search_base


def base_fit(task: Task, seed: int, progress: Progress | None = None) -> Fit:
    """The fit by the ant colony with polish."""
    return with_larger_winding(summarise(task, search_base(task, seed, progress), "ant-colony", seed))


def with_larger_winding(fitted: Fit) -> Fit:
    """Of two assignments of the resonances that are as good, the one whose winding has more inductance than the path to the frame.

    A winding has many turns and the path to the frame has none. This is an assumption; the error bars do not depend on it.
    """
    if fitted.exchange is None:
        return fitted
    index = [parameter.name for parameter in fitted.problem.unknowns].index("La")
    if fitted.exchange[index] <= 0:
        return fitted
    values = fitted.problem.named(fitted.unknowns + fitted.exchange)
    searched = {**fitted.search_parameters, **exchanged(fitted.search_parameters)}
    found = Found(arrived_on_all(fitted.task, [values], fitted.sizes), fitted.history, searched)
    return summarise(fitted.task, found, fitted.method, fitted.seed)


def fit_by_the_paper(task: Task, seed: int) -> Fit:
    """The fit by the paper's algorithm as printed; a warning says whether it met its stop rule."""
    search = Problem(task.motor, task.measurement, task.bounds, task.held, weights="log")
    outcome = paper_colony(search, np.random.default_rng(seed))
    values = search.named(outcome.u)
    likelihood = task.likelihood()
    found = marginal(likelihood, likelihood.vector(values))
    whole = likelihood.named(likelihood.vector(values))
    solution = Solution(whole, found.likeliest, found, outcome.converged, outcome.evaluations)
    result = summarise(task, Found(solution, outcome.history, values), "paper", seed)
    remark = (
        f"the paper's colony met its stop rule (deviation {outcome.deviation:.3g} <= 0.1)"
        if outcome.converged
        else f"the paper's colony did not meet its stop rule: deviation {outcome.deviation:.3g}, wanted 0.1"
    )
    return dataclasses.replace(result, warnings=(*result.warnings, remark))
