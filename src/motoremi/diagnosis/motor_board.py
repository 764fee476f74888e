"""Models of a motor as the search over sets of effects sees them: raced on thinned grids, the leaders refitted on all points."""

from __future__ import annotations

import dataclasses
from collections.abc import Hashable, Iterable, Mapping
from math import inf
from typing import TypeVar

from motoremi.arrays import Progress
from motoremi.diagnosis.candidates import Candidate, candidate, own_labels, possible_effects, seen_in, unusual_values
from motoremi.diagnosis.explore import Key, best_of
from motoremi.fitting.beside import Pairs
from motoremi.fitting.fit import on_all_points, task_without, trail_to
from motoremi.fitting.race import (
    ALIKE_ARRIVING,
    ARRIVING,
    BEHIND,
    BESIDE,
    GLANCE,
    IN_FULL,
    LEADERS,
    LOOK_ALIKE,
    LOOK_NEAR,
    PAIRS,
    SINGLES,
    Best,
    Standing,
    Trail,
    race,
    raced_alone,
)
from motoremi.fitting.result import Fit
from motoremi.fitting.search import Solution
from motoremi.model.effects import find_effect
from motoremi.progress import part
from motoremi.workers import Map

Name = TypeVar("Name", bound=Hashable)


class MotorBoard:
    """Effects on top of one fit.

    Parameters
    ----------
    base : Fit
    each : callable
        As the built-in `map`: by it models are worked on.
    further : int
        If no set of one size describes everything: number of further sets with usual values that are refitted on all points.
    """

    def __init__(self, base: Fit, each: Map = map, further: int = 0) -> None:
        self._base, self._each, self._further = base, each, further
        # Of all races, which have their points in common, by number of effects.
        self._best: dict[int, Best] = {}
        self._alone: Mapping[str, Trail] = {}
        self._reached: Mapping[str, Standing] = {}

    def start(self) -> Candidate:
        """The model with nothing added."""
        return candidate(self._base, self._base)

    def sets(self, size: int, found: Mapping[Key, Candidate], progress: Progress | None) -> list[Candidate]:
        """All single effects, or all pairs of them; those that stay near the best, and the next with values that motors have."""
        if size == 1:
            self._alone = {name: trail_to(self._base, name) for name in possible_effects(self._base)}
            trails: Mapping[Key, Trail] = {(name,): trail for name, trail in self._alone.items()}
            solutions, reached = race(trails, SINGLES, (), progress, self._each)
            self._reached = {key[-1]: standing for key, standing in reached.items()}
        else:
            pairs = self._leading_pairs(found, part(progress, 0.0, 0.8))
            beside = self._beside_the_best(found)
            races = ((pairs, ARRIVING, part(progress, 0.8, 0.9)), (beside, BESIDE, part(progress, 0.9, 1.0)))
            solutions = _likeliest_orders([race(each, rounds, (), own, self._each).solutions for each, rounds, own in races])
            trails = {**pairs, **beside}
        leading = self._near_best(size, solutions)
        near = self._refitted(trails, leading)
        others = {key: solution for key, solution in solutions.items() if key not in leading}
        # One effect more is never less likely than none more: those in false valleys then looked better on few points.
        if max((one.fit.log_evidence for one in near), default=-inf) < max(one.fit.log_evidence for one in found.values()):
            return near + self._refitted(trails, others)
        if any(one.done for one in near):
            return near
        # Where something is left, laws are not quite the motor's, and the decision asks which values motors have.
        usual = [key for key, solution in others.items() if not self._unusual(trails[key], solution)]
        return near + self._refitted(trails, {key: others[key] for key in usual[: self._further]})

    @staticmethod
    def _beside_the_best(found: Mapping[Key, Candidate]) -> Mapping[Key, Trail]:
        """Each effect beside the best single one, if that leaves little: only the likelihood tells such pairs apart, not points of equal weight."""
        best = best_of(one for key, one in found.items() if len(key) == 1)
        trails = {(*best.added, name): trail_to(best.fit, name) for name in possible_effects(best.fit)}
        return {pair: trail for pair, trail in trails.items() if trail.by_likelihood}

    def _unusual(self, trail: Trail, solution: Solution) -> bool:
        motor = trail.task.motor
        labels = own_labels(motor.effects, motor.effects[len(self._base.effects) :])
        return bool(unusual_values(motor, labels, solution.values))

    def _leading_pairs(self, found: Mapping[Key, Candidate], progress: Progress | None) -> Mapping[Key, Trail]:
        """Pairs of effects from where they have got to: those that lead all others, not too many with one effect in common."""
        fitted = {key[0]: one.fit for key, one in found.items() if len(key) == 1}
        pairs = Pairs(self._base, self._alone, self._reached, fitted, self._each)
        trails = pairs.at_a_glance()
        reached = race(trails, GLANCE, (), part(progress, 0.0, 0.5), self._each).reached
        leaders = sorted(reached, key=lambda pair: reached[pair].best)[:LEADERS]
        trails = {pair: dataclasses.replace(trails[pair], starts=reached[pair].starts) for pair in leaders}
        trails |= pairs.in_full({pair: reached[pair] for pair in leaders[:IN_FULL]})
        reached = race(trails, PAIRS, (), part(progress, 0.5, 1.0), self._each).reached
        chosen: list[Key] = []
        for pair in sorted(reached, key=lambda pair: reached[pair].best):
            if all(sum(effect in other for other in chosen) < ALIKE_ARRIVING for effect in pair):
                chosen.append(pair)
        return {pair: dataclasses.replace(trails[pair], starts=reached[pair].starts) for pair in chosen[: ARRIVING.arriving]}

    def swapped(self, model: Candidate, effect: str) -> list[Candidate]:
        """Those that show where the effect does in its place; itself as well, since beside the others it may belong in another valley."""
        under = self._without(model.fit, effect)
        place = seen_in(under, effect)
        names = [name for name in possible_effects(under) if seen_in(under, name) == place]
        near = {**under.parameters, **model.fit.nuisance}
        trails = {name: trail_to(under, name) if name == effect else trail_to(under, name, near=near, rival=model.fit) for name in names}
        alike = {name: trail for name, trail in trails.items() if name == effect or _alike(name, effect)}
        others = {name: trail for name, trail in trails.items() if name not in alike}
        # What may pass for the effect must arrive: only the likelihood tells them apart.
        solutions = [race(alike, LOOK_ALIKE, list(alike), each=self._each).solutions, race(others, LOOK_NEAR, each=self._each).solutions]
        return [one for group in solutions for one in self._refitted(trails, self._near_best(len(model.added), group))]

    def dropped(self, model: Candidate, effect: str) -> Candidate:
        """The model without an effect; without any, the base."""
        if len(model.added) == 1:
            return self.start()
        under = self._without(model.fit, effect)
        trail = Trail(under.task, [{**under.parameters, **model.fit.nuisance}], 1, under.sizes)
        return self._refitted({"": trail}, {"": raced_alone(trail)})[0]

    def _near_best(self, size: int, solutions: Mapping[Name, Solution]) -> dict[Name, Solution]:
        """Those that are near the best of their size, in this race and in those before it."""
        behind = self._best.setdefault(size, Best()).behind(solutions)
        return {name: solution for name, solution in solutions.items() if behind[name] <= BEHIND}

    def _refitted(self, trails: Mapping[Name, Trail], solutions: Mapping[Name, Solution]) -> list[Candidate]:
        """Solutions of races on all points."""
        jobs = [(trails[name], solution, self._base) for name, solution in solutions.items()]
        return [candidate(fit, self._base) for fit in self._each(on_all_points, jobs)]

    def _without(self, fit: Fit, effect: str) -> Fit:
        """A fit's values with an effect taken out of the model, not refitted: where to look from, and as much left as in the base."""
        task = task_without(fit, effect)
        names = {parameter.name for parameter in task.motor.parameters}
        return dataclasses.replace(
            fit,
            motor=task.motor,
            sizes=self._base.sizes,
            parameters={name: value for name, value in fit.parameters.items() if name in names},
            search_parameters={name: value for name, value in fit.search_parameters.items() if name in names},
            likeliest_parameters={name: value for name, value in fit.likeliest_parameters.items() if name in names},
            held=task.held,
            bounds=task.bounds,
        )


def _likeliest_orders(raced: Iterable[Mapping[Key, Solution]]) -> dict[Key, Solution]:
    """The solutions of several races, the best evidence first; of sets with the same effects only the best one."""
    ranked = sorted((pair for solutions in raced for pair in solutions.items()), key=lambda pair: -pair[1].log_evidence)
    best: dict[Key, tuple[Key, Solution]] = {}
    for key, solution in ranked:
        best.setdefault(tuple(sorted(key)), (key, solution))
    return dict(best.values())


def _alike(one: str, other: str) -> bool:
    """Whether two effects are the same, are it at two places, or are known to look alike: then neither may be left out for a poor first look."""
    effect, rival = find_effect(one).effect, find_effect(other).effect
    return effect is rival or bool({one, effect.name} & set(rival.look_alikes) or {other, rival.name} & set(effect.look_alikes))
