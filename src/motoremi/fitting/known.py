"""A fit is also tried from solutions that are known already."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from motoremi.fitting.base_fit import with_larger_winding
from motoremi.fitting.parts import most_parts, numbers_of_parts
from motoremi.fitting.polish import polish
from motoremi.fitting.refit import better_than, hidden, search_values
from motoremi.fitting.result import Fit, summarise
from motoremi.fitting.search import ROUGH, Found, arrived_on_all, misses_by_far, relative_solution
from motoremi.model.effects import find_effect
from motoremi.threads import one_blas_thread


class Known(NamedTuple):
    """A solution of a model that an earlier fit or a diagnosis has found, perhaps for other data, bounds or held values.

    Parameters
    ----------
    values : dict
        Parameters, and nuisances if they are known, in SI units.
    fit : Fit, optional
        The fit that they are of.
    """

    values: Mapping[str, float]
    fit: Fit | None = None


@one_blas_thread
def also_from(fitted: Fit, known: Iterable[Known], held: Mapping[str, float] | None = None) -> Fit:
    """A fit, or one of the same model from values that are known already, if that is better.

    A search may miss what another one has found. Each known solution is only a place to start from: it is fitted to these data, moved into these
    bounds, and what is held keeps its value.

    Parameters
    ----------
    held : mapping, optional
        What the user holds, in SI units. What an effect keeps while it is fitted, such as a number of parts, is that of the known solution.
    """
    for one in known:
        found = _unless_the_same(one.fit, _from_known(fitted, one, held or {}), fitted)
        if found is not None and better_than(fitted, found):
            fitted = found
    return fitted


def _unless_the_same(stored: Fit | None, found: Fit | None, fitted: Fit) -> Fit | None:
    """What was found from a stored fit, or that fit itself where nothing is gained: fits that are repeated do not wander among equals."""
    if stored is None or found is None or (stored.bounds, stored.held, stored.method) != (found.bounds, found.held, found.method):
        return found
    if better_than(stored, found) or better_than(found, stored):
        return found
    return dataclasses.replace(stored, seed=fitted.seed, history=found.history, evaluations=found.evaluations, elapsed_s=found.elapsed_s)


def _from_known(fitted: Fit, known: Known, held: Mapping[str, float]) -> Fit | None:
    """The model of a fit from a known solution; None if that has more parts than these data can determine."""
    started = time.perf_counter()
    fixed = {p.name: held[p.name] for p in fitted.motor.parameters if p.name in held}
    numbers = [name for name, _ in numbers_of_parts(fitted.motor)]
    for p in fitted.motor.parameters:
        if not p.vary and p.name not in fixed:
            value = known.values.get(p.name, fitted.held.get(p.name))
            if value is None or (p.name in numbers and value > most_parts(fitted.measurement)):
                return None
            fixed[p.name] = value
    task = dataclasses.replace(fitted.task, held=fixed)
    effects = [find_effect(label).effect for label in fitted.effects]
    sizes, known_search = (None, {}) if known.fit is None else (known.fit.sizes, dict(known.fit.search_parameters))
    if sizes is not None and misses_by_far(sizes) and any(effect.describes for effect in effects):
        # As in `_described`: the likelihood would lead to another description.
        problem = task.relative()
        ends = polish(problem, problem.vectors([known.values]), iterations=100, precision=ROUGH)
        solution = relative_solution(task, ends, sizes)
    else:
        solution = arrived_on_all(task, [known.values], sizes, known_search)
    searched = known_search or search_values(task, solution)
    result = summarise(task, Found(solution, fitted.history, searched), fitted.method, fitted.seed)
    result = hidden(result, [name for effect in effects for name in effect.hides]) if effects else with_larger_winding(result)
    elapsed_s = fitted.elapsed_s + time.perf_counter() - started
    return dataclasses.replace(result, evaluations=fitted.evaluations + result.evaluations, elapsed_s=elapsed_s)
