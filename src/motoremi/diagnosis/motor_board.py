"""Models of a motor as the search over sets of effects sees them: raced on thinned grids, the leaders refitted on all points."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from functools import reduce
from itertools import zip_longest
from math import inf

import numpy as np

from motoremi.arrays import Progress
from motoremi.diagnosis.candidates import Candidate, candidate, possible_effects, seen_in
from motoremi.fitting.fit import on_all_points, task_without, trail_to
from motoremi.fitting.race import (
    BEHIND,
    LOOK,
    LOOK_AGAIN,
    LOOK_AGAIN_BESIDE,
    LOOK_ALIKE,
    LOOK_BESIDE,
    LOOK_NEAR,
    THOROUGH,
    Best,
    Rounds,
    Trail,
    race,
)
from motoremi.fitting.result import Fit
from motoremi.model.effects import find_effect
from motoremi.workers import Map

# The circuits of twins differ by so much of what either leaves.
TWINS_APART = 0.3


class MotorBoard:
    """Effects on top of one fit.

    Parameters
    ----------
    base : Fit
    each : callable
        As the built-in `map`: by it models are worked on.
    singles : int
        How many single effects at least are refitted on all points, however far behind the best: one that does a part of what two effects do is
        far behind another one that bends to both.
    ended_with : sequence of str, optional
        The likeliest effects of a first search: this is then a second one, which takes more steps before it leaves a model out, and leaves none out
        that is known to look like one of these.
    """

    def __init__(self, base: Fit, each: Map = map, singles: int = 1, ended_with: Sequence[str] | None = None) -> None:
        self._base, self._each, self._singles = base, each, singles
        self._ended_with = ended_with
        self._alone, self._beside = (LOOK, LOOK_BESIDE) if ended_with is None else (LOOK_AGAIN, LOOK_AGAIN_BESIDE)
        # Of all races, which have their points in common, by number of effects.
        self._best: dict[int, Best] = {}

    def start(self) -> Candidate:
        """The model with nothing added."""
        return candidate(self._base, self._base)

    def added(self, model: Candidate, progress: Progress | None) -> list[Candidate]:
        """The model with each possible effect; those that stay near the best."""
        fit, beside = model.fit, bool(model.added)
        trails = {(*model.added, name): trail_to(fit, name) for name in possible_effects(fit)}
        if beside and self._ended_with is not None:
            again = self._sought_alone(model)
            trails = {key: dataclasses.replace(one, starts=[*one.starts, *trail_to(again, key[-1]).starts]) for key, one in trails.items()}
        kept = [key for key in trails if beside and any(_alike(key[-1], name) for name in self._ended_with or ())]
        return self._raced(fit, trails, self._beside if beside else self._alone, kept=kept, progress=progress, least=fit.log_evidence)

    def _sought_alone(self, model: Candidate) -> Fit:
        """The fit with one effect, sought without others beside it.

        Two fits that are equally likely differ in the values from where a further effect starts, and with them in which of these are found.
        """
        return reduce(Fit.add, model.added, self._base)

    def error(self, model: Candidate) -> float:
        """Of its circuit alone, however much the analyser could take up."""
        return model.fit.rms_error_percent

    def swapped(self, model: Candidate, effect: str) -> list[Candidate]:
        """Those that show where the effect does in its place; itself as well, since beside the others it may belong in another valley."""
        under = self._without(model.fit, effect)
        place = seen_in(under, effect)
        names = [name for name in possible_effects(under) if seen_in(under, name) == place]
        near = _near(model.fit, under)
        trails = {
            (*under.effects, name): trail_to(under, name) if name == effect else trail_to(under, name, near=near, rival=model.fit) for name in names
        }
        alike = {key: trail for key, trail in trails.items() if key[-1] == effect or _alike(key[-1], effect)}
        others = {key: trail for key, trail in trails.items() if key not in alike}
        # What may pass for the effect must arrive: only the likelihood tells them apart.
        return self._raced(under, alike, LOOK_ALIKE, kept=list(alike)) + self._raced(under, others, LOOK_NEAR)

    def alike(self, one: Candidate, other: Candidate) -> bool:
        """Whether two models have the same effects, but for one that is known to look like the other's."""
        own, others = ((Counter(a.added) - Counter(b.added)).elements() for a, b in ((one, other), (other, one)))
        different = list(zip_longest(own, others))
        return len(different) <= 1 and all(a is not None and b is not None and _alike(a, b) for a, b in different)

    def sought_anew(self, model: Candidate) -> list[Candidate]:
        """The same effects, each in turn from all its start values: one that was found alone may belong in another valley beside a second."""
        found = []
        for effect in model.added:
            under = self._without(model.fit, effect)
            found += self._raced(under, {(*under.effects, effect): trail_to(under, effect)}, THOROUGH)
        return found

    def dropped(self, model: Candidate, effect: str) -> Candidate:
        """The model without an effect; without any, the base."""
        if len(model.added) == 1:
            return self.start()
        under = self._without(model.fit, effect)
        trail = Trail(under.task, [_near(model.fit, under)], 1, under.sizes)
        return candidate(on_all_points((trail, race({"": trail}, THOROUGH)[""], under)), self._base)

    def twins(self, one: Candidate, other: Candidate) -> bool:
        """Whether two models describe the sweeps by nearly the same impedances."""
        own, others = one.fit.errors(), other.fit.errors()
        apart = np.concatenate([own[name] - others[name] for name in own])
        left = np.concatenate(list(own.values()))
        return bool(np.linalg.norm(apart) <= TWINS_APART * np.linalg.norm(left))

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

    def _raced(
        self,
        before: Fit,
        trails: Mapping[tuple[str, ...], Trail],
        rounds: Rounds,
        kept: Sequence[tuple[str, ...]] = (),
        progress: Progress | None = None,
        least: float = -inf,
    ) -> list[Candidate]:
        """Candidates from a race, refitted on all points where they are near the best of their size; all of them if none of those reaches `least`.

        One effect more is never less likely than none more: on few points those in false valleys then looked better than the others.
        """
        solutions = race(trails, rounds, kept, progress, self._each)
        size = len(before.effects) + 1
        best = self._best.setdefault(size, Best())
        near = [key for key, behind in best.behind(solutions).items() if behind <= BEHIND]

        def refitted(keys: Iterable[tuple[str, ...]]) -> list[Candidate]:
            return [candidate(fit, self._base) for fit in self._each(on_all_points, [(trails[key], solutions[key], before) for key in keys])]

        found = refitted(near)
        if max((one.fit.log_evidence for one in found), default=-inf) < least:
            return found + refitted(key for key in solutions if key not in near)
        if before is self._base and (self._ended_with is not None or not any(one.done for one in found)):
            # They will be added to.
            found += refitted([key for key in solutions if key not in near][: max(self._singles - len(near), 0)])
        return found


def _near(fit: Fit, under: Fit) -> dict[str, float]:
    """Values of a solution that a model without one of its effects has too."""
    return {**under.parameters, **fit.nuisance}


def _alike(one: str, other: str) -> bool:
    """Whether two effects are the same, are it at two places, or are known to look alike: then neither may be left out for a poor first look."""
    effect, rival = find_effect(one).effect, find_effect(other).effect
    return effect is rival or bool({one, effect.name} & set(rival.look_alikes) or {other, rival.name} & set(effect.look_alikes))
