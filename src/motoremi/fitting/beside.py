"""Start values of the search for two effects: each effect with each other one, from the values that the race of single effects has reached.

An effect that describes only a part of the error is far from the best by itself, so all pairs take part, whatever their effects describe alone.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations_with_replacement

import numpy as np

from motoremi.fitting.parts import parts_of
from motoremi.fitting.race import Standing, Trail
from motoremi.fitting.result import Fit
from motoremi.fitting.trail import trail_to
from motoremi.model.effects import find_effect
from motoremi.threads import one_blas_thread
from motoremi.workers import Map

Pair = tuple[str, ...]
# Number of the start values of a pair (up to a hundred) in the first round, those with the smallest objective; more if a winding resonates, since
# a sharp resonance has many local minima: with five, a true line was 25th of the 35 pairs that have one, with twenty the first.
GLANCED, GLANCED_RESONATING = 5, 20
# Points a sweep on which they are compared.
POINTS = 40


class Pairs:
    """The models with two effects.

    Parameters
    ----------
    base : Fit
        Nothing added.
    alone : mapping
        Start values of each single effect.
    reached : mapping
        Its last state in the race.
    fitted : mapping
        Those that were fitted on all points, possibly from other start values.
    each : callable
        Like the built-in `map`.
    """

    def __init__(self, base: Fit, alone: Mapping[str, Trail], reached: Mapping[str, Standing], fitted: Mapping[str, Fit], each: Map = map) -> None:
        self._with = {name: _with(base, alone[name], reached[name], fitted.get(name)) for name in alone}
        self._alone = alone
        self._each = each

    def at_a_glance(self) -> dict[Pair, Trail]:
        """All pairs, each once, in the order in which their effects are added; with a few start values."""
        found = self._trails({one: tuple(self._with) for one in self._with}, at_a_glance=True)
        return {pair: trail for one, other in combinations_with_replacement(self._with, 2) for pair, trail in _joined(found, one, other)}

    def in_full(self, reached: Mapping[Pair, Standing]) -> dict[Pair, Trail]:
        """Some pairs with all their start values, and with the values that the first rounds have reached."""
        seconds = {one: tuple({pair[1 - at] for pair in reached for at in (0, 1) if pair[at] == one}) for one in self._with}
        found = self._trails({one: others for one, others in seconds.items() if others}, at_a_glance=False)
        whole = {pair: trail for first, second in reached for pair, trail in _joined(found, first, second)}
        return {
            pair: dataclasses.replace(trail, starts=[*reached[pair].starts, *trail.starts], group=len(reached[pair].starts) + trail.group)
            for pair, trail in whole.items()
        }

    def _trails(self, seconds: Mapping[str, Sequence[str]], at_a_glance: bool) -> dict[str, dict[str, Trail]]:
        """By first and second effect, the model with both and start values for adding the second."""
        # A number of parts takes a search of its own for each value: here it is the one that the effect has by itself.
        held = {name: parts_of(trail, name) for name, trail in self._alone.items()}
        jobs = [(self._with[one], {name: held[name] for name in others}, at_a_glance) for one, others in seconds.items()]
        return dict(zip(seconds, self._each(_begun, jobs), strict=True))


def _joined(found: Mapping[str, Mapping[str, Trail]], one: str, other: str) -> Iterator[tuple[Pair, Trail]]:
    """The pair with the start values from either order of adding; none if the effects exclude each other."""
    pairs = {pair: found[pair[0]][pair[1]] for pair in {(one, other): None, (other, one): None} if pair[1] in found[pair[0]]}
    if pairs:
        # A parameter that is not varied is chosen from the error of the model before, so its effect comes last.
        last = max(pairs, key=lambda pair: any(not parameter.vary for parameter in find_effect(pair[1]).effect.parameters))
        starts = [start for trail in pairs.values() for start in trail.starts]
        yield last, dataclasses.replace(pairs[last], starts=starts, group=len(starts))


def _with(base: Fit, trail: Trail, reached: Standing, fitted: Fit | None) -> Fit:
    """The base with an effect at the values that the race has reached, to compute start values of a second effect."""
    names = {parameter.name for parameter in trail.task.motor.parameters}
    of_race = [{name: value for name, value in start.items() if name in names} for start in reached.starts[:2]]
    nuisance = {name: value for name, value in reached.starts[0].items() if name not in names}
    best, second = (of_race[0], of_race[-1]) if fitted is None else (fitted.parameters, of_race[0])
    return dataclasses.replace(
        base,
        motor=trail.task.motor,
        parameters=best,
        search_parameters=best,
        likeliest_parameters=second,
        nuisance=nuisance if fitted is None else fitted.nuisance,
        held=trail.task.held,
        bounds=trail.task.bounds,
    )


@one_blas_thread
def _begun(job: tuple[Fit, Mapping[str, Mapping[str, float]], bool]) -> dict[str, Trail]:
    """Each effect that can be added to one, with all its start values, or for the first round the best of them."""
    fit, held, at_a_glance = job
    trails = {name: trail_to(fit, name, own) for name, own in held.items() if find_effect(name).fits(fit.motor)}
    return {name: _best_begun(trail) for name, trail in trails.items()} if at_a_glance else trails


def _best_begun(trail: Trail) -> Trail:
    problem = trail.averaged.problem(POINTS)
    objective = problem.objective(problem.vectors(trail.starts))
    resonates = any(find_effect(name).effect.kin == "winding-resonance" for name in trail.task.motor.effects)
    best = np.argsort(objective, kind="stable")[: GLANCED_RESONATING if resonates else GLANCED]
    return dataclasses.replace(trail, starts=[trail.starts[index] for index in best])
