"""Where the search for two effects begins: each effect beside each other one, from what the race of single effects has reached.

An effect that does only a part of what is missing is far from the best by itself, so all pairs take part, whatever their effects do alone.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations_with_replacement

import numpy as np

from motoremi.fitting.fit import trail_to
from motoremi.fitting.race import Standing, Trail
from motoremi.fitting.result import Fit
from motoremi.model.effects import find_effect
from motoremi.threads import one_blas_thread
from motoremi.workers import Map

Pair = tuple[str, ...]
# Of up to a hundred start values of one effect beside another so many take part in the race, those with the least objective as they are.
BEGUN = 5
# Points a sweep on which they are compared.
POINTS = 40


def trails_of_pairs(base: Fit, alone: Mapping[str, Trail], reached: Mapping[str, Standing], each: Map = map) -> dict[Pair, Trail]:
    """The model with each two effects.

    Parameters
    ----------
    base : Fit
        Nothing added.
    alone : mapping
        Where the search for each effect by itself began.
    reached : mapping
        Where it has got to.
    each : callable
        As the built-in `map`.

    Returns
    -------
    dict
        By effects, in the order in which they are added; each pair once.
    """
    jobs = [(_with(base, alone[name], reached[name]), tuple(alone)) for name in alone]
    from_either: dict[str, dict[str, Trail]] = dict(zip(alone, each(_begun, jobs), strict=True))
    return dict(_joined(from_either))


def _joined(found: Mapping[str, Mapping[str, Trail]]) -> Iterator[tuple[Pair, Trail]]:
    for one, other in combinations_with_replacement(found, 2):
        pairs = {pair: found[pair[0]][pair[1]] for pair in {(one, other): None, (other, one): None} if pair[1] in found[pair[0]]}
        if not pairs:
            continue
        # A part that does not vary is chosen for what the model before leaves, so its effect comes last.
        last = max(pairs, key=lambda pair: any(not parameter.vary for parameter in find_effect(pair[1]).effect.parameters))
        starts = [start for trail in pairs.values() for start in trail.starts]
        yield last, dataclasses.replace(pairs[last], starts=starts, group=len(starts))


def _with(base: Fit, trail: Trail, reached: Standing) -> Fit:
    """The base with an effect where the race has left it, as far as start values of another one are read from it."""
    best, *others = reached.starts[:2]
    names = {parameter.name for parameter in trail.task.motor.parameters}
    own, second = ({name: value for name, value in values.items() if name in names} for values in (best, *(others or [best])))
    return dataclasses.replace(
        base,
        motor=trail.task.motor,
        parameters=own,
        search_parameters=own,
        likeliest_parameters=second if others else {},
        nuisance={name: value for name, value in best.items() if name not in names},
        held=trail.task.held,
        bounds=trail.task.bounds,
    )


@one_blas_thread
def _begun(job: tuple[Fit, Sequence[str]]) -> dict[str, Trail]:
    """Each effect that can be added to one, with the best of its start values."""
    fit, names = job
    return {name: _best_begun(trail_to(fit, name)) for name in names if find_effect(name).fits(fit.motor)}


def _best_begun(trail: Trail) -> Trail:
    problem = trail.averaged.problem(POINTS)
    objective = problem.objective(problem.vectors(trail.starts))
    return dataclasses.replace(trail, starts=[trail.starts[index] for index in np.argsort(objective, kind="stable")[:BEGUN]])
