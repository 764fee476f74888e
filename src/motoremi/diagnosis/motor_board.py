"""Models of a motor for the search over sets of effects: compared on few points, the best refitted on all."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Hashable, Iterable, Mapping, Sequence
from math import inf
from typing import Any, TypeVar

from motoremi.arrays import Progress
from motoremi.diagnosis.candidates import (
    Candidate,
    as_in_every_winding,
    candidate,
    own_labels,
    possible_effects,
    seen_in,
    unusual_values,
)
from motoremi.diagnosis.explore import Key, ranked
from motoremi.fitting.beside import Pairs
from motoremi.fitting.parts import counted, counted_near, parts_of
from motoremi.fitting.race import (
    ALIKE_ARRIVING,
    ARRIVING,
    BEHIND,
    BESIDE,
    GLANCE,
    IN_FULL,
    LEADERS,
    LITTLE,
    LOOK_ALIKE,
    LOOK_NEAR,
    PAIRS,
    SINGLES,
    Best,
    Standing,
    Trail,
    left_behind,
    little_is_left,
    race,
    raced_alone,
)
from motoremi.fitting.refit import on_all_points
from motoremi.fitting.result import SPECIFIED_SIGMA, Fit
from motoremi.fitting.search import CLOSER, PLAIN, Solution, misses_by_far
from motoremi.fitting.trail import task_without, trail_from, trail_to, values_without
from motoremi.model.effects import find_effect
from motoremi.progress import part
from motoremi.workers import Map

Name = TypeVar("Name", bound=Hashable)
# Share of the error that the best single effect may leave for only pairs with it to be compared. On two hard boards (seeds 26113301, 26113402)
# pairs were searched 25 times; the best one contained the best single effect in all 11 searches in which that left less than 8 %, and in 11 others.
# If an effect with usual values leaves so little, the number of parts of another one is not counted either.
MOST_LEFT = 0.05
# The same if no more than this is missing in all: less than what one sees on a plot, or than most analysers err.
SLIGHT_PERCENT = 0.2
# Log evidence by which the same circuit may differ from itself: it is found by steps.
SAME = 0.1
# What every winding has: losses of its copper, each as one law, and of its insulation.
COPPER, INSULATION = ("skin-effect", "proximity-effect"), "dielectric-loss@Ca"


class MotorBoard:
    """Effects on top of one fit.

    Parameters
    ----------
    base : Fit
    each : callable
        Like the built-in `map`; computes the models.
    further : int
        If no set of one size describes everything: number of further sets with usual values that are refitted on all points.
    """

    def __init__(self, base: Fit, each: Map = map, further: int = 0) -> None:
        self._base, self._each, self._further = base, each, further
        # Best result of all races, by number of effects; they use the same points.
        self._best: dict[int, Best] = {}
        self._alone: Mapping[str, Trail] = {}
        self._reached: Mapping[str, Standing] = {}

    @property
    def much_is_left(self) -> bool:
        """Whether the base errs by far.

        Of a capacitor across the terminals and another one to the frame (5 and 7 nF) each alone took the error from 60 % to 35 %, which is no gain
        in evidence; both together left nothing.
        """
        return misses_by_far(self._base.sizes)

    def start(self) -> Candidate:
        """The model with nothing added."""
        return candidate(self._base, self._base)

    def sets(self, size: int, found: Mapping[Key, Candidate], progress: Progress | None) -> list[Candidate]:
        """Of all single effects, all pairs, or all third effects beside the best pair: those near the best, and the next ones with usual values."""
        return [one for one in self._sets(size, found, progress) if not one.exchanged]

    def _sets(self, size: int, found: Mapping[Key, Candidate], progress: Progress | None) -> list[Candidate]:
        if size == 1:
            trails, solutions = self._singles(self._trails(self._base, possible_effects(self._base)), progress)
        elif size > 2:
            trails = self._beside_the_best(found, size - 1)
            solutions = _likeliest_orders([race(trails, BESIDE, (), progress, self._each).solutions])
        else:
            pairs = {} if self._contain_the_best(found) else self.leading_pairs(found, part(progress, 0.0, 0.8))
            arrived = race(pairs, ARRIVING, (), part(progress, 0.8, 0.9), self._each).solutions
            beside = {**self._only_beside(found), **self._beside_singles(found)}
            if pairs and not any(little_is_left(solution.sizes) for solution in arrived.values()):
                # Among pairs in wrong minima the right one may be left behind: of a suppressor and the inductance of the frame strap all that
                # arrived left 23 %, and the strap was found beside the suppressor, the best single effect.
                beside |= self._beside(ranked(found, 1)[0])
            found_beside = race(beside, BESIDE, (), part(progress, 0.9, 1.0), self._each).solutions
            solutions = _likeliest_orders([arrived, found_beside])
            trails = {**pairs, **beside}
        leading = self._near_best(size, solutions)
        near = self._refitted(trails, leading)
        if all(one.exchanged for one in near):
            # They are not kept, so those near the best of the others are fitted instead.
            kept = {key: solution for key, solution in solutions.items() if key not in leading}
            following = {key: kept[key] for key, distance in Best().behind(kept).items() if distance <= BEHIND}
            leading, near = {**leading, **following}, near + self._refitted(trails, following)
        if size == 1 and not any(one.leaves_nothing and one.fit.instrument_sigma <= SPECIFIED_SIGMA for one in near):
            behind = {key: trail for key, trail in trails.items() if key not in solutions}
            # Counting parts takes as long as the race of all single effects; it is of use only if another number of parts may be what is missing.
            nearly_described = any(one.left_share <= MOST_LEFT and one.ordinary for one in near)
            with_parts, again = ({}, {}) if nearly_described else self._counted()
            again |= left_behind(behind, {key: self._reached[key[-1]] for key in behind}, self._each)
            trails, solutions = {**trails, **with_parts}, _likeliest_orders([{**solutions, **again}])
            further = self._near_best(size, again)
            leading, near = {**leading, **further}, near + self._refitted(trails, further)
        others = {key: solution for key, solution in solutions.items() if key not in leading}
        # A further effect cannot be less probable than none: the leaders are then in wrong minima, and the others are fitted too.
        lost = max((one.fit.log_evidence for one in near), default=-inf) < max(one.fit.log_evidence for one in found.values())
        least = min((one.fit.rms_error_percent for one in near), default=inf)
        by_far = size == 1 and misses_by_far(self._base.sizes) and least > CLOSER * self._base.rms_error_percent
        if lost or by_far:
            return near + self._refitted(trails, {**others, **(self._lines(trails, solutions) if by_far else {})})
        if any(one.leaves_nothing for one in near):
            return near
        # If an error remains, or only unusual values describe everything, the decision also uses the values: sets with usual ones are refitted too.
        usual = {key: solution for key, solution in others.items() if not self._unusual(trails[key], solution)}
        return near + self._refitted(trails, {key: others[key] for key in _unlike(usual)[: self._further]})

    def _singles(self, alone: Mapping[str, Trail], progress: Progress | None = None) -> tuple[Mapping[Key, Trail], dict[Key, Solution]]:
        """The race between single effects, whose end is kept for pairs."""
        trails: dict[Key, Trail] = {(name,): trail for name, trail in alone.items()}
        # If nothing is missing, pairs are not searched.
        solutions, reached = race(trails, BESIDE if self.start().done else SINGLES, (), progress, self._each)
        self._alone = {**self._alone, **alone}
        self._reached = {**self._reached, **{key[-1]: standing for key, standing in reached.items()}}
        return trails, solutions

    def every_winding(self) -> list[Candidate]:
        """Losses of copper and insulation, alone and together, for a sweep of a winding alone.

        Of an air coil, skin effect and a loss angle together left 0.13 %, and a shorted turn or a core, which it has not, imitated both with 0.2 %
        and 0.13 %.
        """
        if not {*COPPER, INSULATION} <= self._alone.keys():
            return []
        alone = self._each_alone({(name,): self._alone[name] for name in (*COPPER, INSULATION)})
        copper = [one for one in alone if one.effect in COPPER]
        together = self._each_alone({(*one.added, INSULATION): trail_to(one.fit, INSULATION) for one in copper})
        return alone + [as_in_every_winding(one, self._base) for one in together]

    def _each_alone(self, trails: Mapping[Key, Trail]) -> list[Candidate]:
        """Each of these models, whatever the others reach."""
        return self._refitted(trails, dict(zip(trails, self._each(raced_alone, trails.values()), strict=True)))

    def _counted(self) -> tuple[Mapping[Key, Trail], dict[Key, Solution]]:
        """The race of effects with a number of parts, if more steps find another number than the brief choice did."""
        again = {name: counted(trail, each=self._each) for name, trail in self._alone.items()}
        return self._singles({name: trail for name, trail in again.items() if trail.task.held != self._alone[name].task.held})

    def _lines(self, trails: Mapping[Key, Trail], solutions: Mapping[Key, Solution]) -> dict[Key, Solution]:
        """Lines and chains of sections that the race has left behind, each searched alone and from more starts.

        Their resonances make many local minima: with a shorted cable, which the base missed by 96 %, every effect left 95 % in the race, but the
        line left 15 % when it was searched alone.
        """
        behind = {key: trail for key, trail in trails.items() if key not in solutions and trail.task.motor.is_line}
        return dict(zip(behind, self._each(raced_alone, behind.values()), strict=True))

    def _beside_the_best(self, found: Mapping[Key, Candidate], size: int) -> Mapping[Key, Trail]:
        """Each effect with the best set of a size that leaves little: the likelihood must compare such sets, not points of equal weight.

        Two effects whose circuit errs little leave little, even if the rest needs larger errors of the analyser than declared: what a third one
        does (a loss angle beside a core of two materials, which left 0.3 %) may be in them.
        """
        best = _best_with_little_left(found, size, errs_little=True)
        return {} if best is None else self._beside(best)

    def _beside_singles(self, found: Mapping[Key, Candidate]) -> Mapping[Key, Trail]:
        """Each effect with each single one that leaves little, one for each law.

        Beside a relaxing permeability, the most probable single effect, nothing was as probable as a contact beside a rotor cage, which alone was
        less probable by e^36. Where little is missing in all, every single effect leaves little: those that are no more probable than none do not
        count (a healthy motor on an analyser with a step of its range: 127 s for 550 pairs instead of 31 s).
        """
        if (best := _best_with_little_left(found, 1)) is None:
            return {}
        most_percent = best.fit.rms_error_percent
        little = [one for one in ranked(found, 1) if little_is_left(one.fit.sizes) or one.fit.rms_error_percent < most_percent]
        gaining = [one for one in little if one is best or one.score > found[()].score]
        of_each_law = {find_effect(one.effect).effect.formula: one for one in reversed(gaining)}
        return {key: trail for one in of_each_law.values() for key, trail in self._beside(one).items()}

    def _only_beside(self, found: Mapping[Key, Candidate]) -> Mapping[Key, Trail]:
        """Effects that make a difference only beside another one (a choke between a capacitor and the brushes), beside each of those."""
        alone = set(possible_effects(self._base))
        singles = [one for key, one in found.items() if len(key) == 1]
        return {key: trail for one in singles for key, trail in self._beside(one, alone).items()}

    def _contain_the_best(self, found: Mapping[Key, Candidate]) -> bool:
        """Whether the best pair can be expected to contain the best single effect: that leaves next to nothing, or there was little to describe."""
        best = _best_with_little_left(found, 1)
        return best is not None and (self._base.unexplained_percent["value"] <= SLIGHT_PERCENT or best.left_share <= MOST_LEFT)

    def _unusual(self, trail: Trail, solution: Solution) -> bool:
        motor = trail.task.motor
        labels = own_labels(motor.effects, motor.effects[len(self._base.effects) :])
        return bool(unusual_values(motor, labels, solution.values))

    def leading_pairs(self, found: Mapping[Key, Candidate], progress: Progress | None) -> Mapping[Key, Trail]:
        """The best pairs with their current values as start values; few of them share an effect."""
        fitted = {key[0]: one.fit for key, one in found.items() if len(key) == 1}
        # If an effect was fitted with two numbers of parts, the more probable one is used.
        self._alone = {name: _holding(trail, fitted.get(name, self._base)) for name, trail in self._alone.items()}
        pairs = Pairs(self._base, self._alone, self._reached, fitted, self._each)
        trails = pairs.at_a_glance()
        reached = race(trails, GLANCE, (), part(progress, 0.0, 0.5), self._each).reached
        leaders = sorted(reached, key=lambda pair: reached[pair].best)[:LEADERS]
        trails = {pair: dataclasses.replace(trails[pair], starts=reached[pair].starts) for pair in leaders}
        # Numbers of parts are chosen again beside the other effect, from the values that the first rounds have reached.
        near = dict(zip(leaders[:IN_FULL], self._each(counted_near, [trails[pair] for pair in leaders[:IN_FULL]]), strict=True))
        for pair, trail in pairs.in_full({pair: reached[pair] for pair in near}).items():
            trails[pair] = dataclasses.replace(trail, task=near[pair].task)
        reached = race(trails, PAIRS, (), part(progress, 0.5, 1.0), self._each).reached
        chosen: list[Key] = []
        for pair in sorted(reached, key=lambda pair: reached[pair].best):
            if all(sum(effect in other for other in chosen) < ALIKE_ARRIVING for effect in pair):
                chosen.append(pair)
        return {pair: dataclasses.replace(trails[pair], starts=reached[pair].starts) for pair in chosen[: ARRIVING.arriving]}

    def swapped(self, model: Candidate, effect: str, only: str = "") -> list[Candidate]:
        """The model with each effect that is visible in the same sweeps, or with `only` one, instead of this one.

        Also with this one from new start values, since its local minimum may be a wrong one.
        """
        under = self._without(model.fit, effect)
        place = seen_in(under, effect)
        names = [name for name in possible_effects(under) if (name == only if only else seen_in(under, name) == place)]
        near = {**under.parameters, **model.fit.nuisance}
        parts = {name: parts_of(trail, name) for name, trail in self._alone.items()}
        others = {name: {"held": parts.get(name), "near": near, "rival": model.fit} for name in names if name != effect}
        trails = self._trails(under, names, others)
        if model.done:
            # Others may leave nothing too, and equal weights of the points distinguish nothing there: all starts of a rotor cage in the place of a
            # skin effect were in a minimum whose log evidence is lower by 96. With next to no discrepancy no start leaves its minimum: those of a
            # cage in the place of a relaxation all ended far from the true one, which was more probable than the relaxation by e^68.
            left = model.fit.sizes._replace(discrepancy=max(model.fit.sizes.discrepancy, PLAIN))
            trails = {name: dataclasses.replace(trail, left=left) for name, trail in trails.items()}
        alike = {name: trail for name, trail in trails.items() if name == effect or _alike(name, effect)}
        unlike = {name: trail for name, trail in trails.items() if name not in alike}
        # Look-alikes are fitted to the end: only the likelihood distinguishes them.
        solutions = [race(alike, LOOK_ALIKE, list(alike), each=self._each).solutions, race(unlike, LOOK_NEAR, each=self._each).solutions]
        found = [one for group in solutions for one in self._refitted(trails, self._near_best(len(model.added), group))]
        return [one for one in (*found, *self._renamed(model, effect, trails)) if not one.exchanged]

    def _renamed(self, model: Candidate, effect: str, trails: Mapping[str, Trail]) -> list[Candidate]:
        """The same circuit under another name, for each effect with the same formula: races compare plain errors and may leave this solution."""
        found, law = [], find_effect(effect).effect
        for name, trail in trails.items():
            other = find_effect(name).effect
            if other is not law and other.formula == law.formula:
                own = {f"{name}.{p.name}": model.fit.parameters[f"{effect}.{p.name}"] for p in law.parameters}
                alone = dataclasses.replace(trail, starts=[{**model.fit.parameters, **model.fit.nuisance, **own}], group=1)
                found += self._refitted({name: alone}, {name: raced_alone(alone)})
        return found

    def dropped(self, model: Candidate, effect: str) -> Candidate:
        """The model without an effect; the base without any, or if the other one's place makes no difference then."""
        if len(model.added) == 1:
            return self.start()
        under = self._without(model.fit, effect)
        if not all(find_effect(name).differs_in(under.motor) for name in under.effects):
            # It would be the usual place under another name, which the race of single effects has searched.
            return self.start()
        trail = Trail(under.task, [{**under.parameters, **model.fit.nuisance}], 1, under.sizes)
        return self._refitted({"": trail}, {"": raced_alone(trail)})[0]

    def beside(self, model: Candidate) -> list[Candidate]:
        """Each possible effect with a set that was found later than those of its size."""
        trails = self._beside(model)
        solutions = race(trails, BESIDE, each=self._each).solutions
        near = self._refitted(trails, self._near_best(len(model.added) + 1, _likeliest_orders([solutions])))
        return [one for one in near if not one.exchanged]

    def _beside(self, one: Candidate, without: Collection[str] = ()) -> Mapping[Key, Trail]:
        """Each possible effect, but for some, added to a set."""
        names = [name for name in possible_effects(one.fit) if name not in without]
        return {(*one.added, name): trail for name, trail in self._trails(one.fit, names).items()}

    def _trails(self, fit: Fit, names: Sequence[str], further: Mapping[str, Mapping[str, Any]] | None = None) -> dict[str, Trail]:
        """Each of these effects added to a fit, with `further` arguments of `trail_to` for some."""
        jobs = [(fit, name, (further or {}).get(name, {})) for name in names]
        return dict(zip(names, self._each(trail_from, jobs), strict=True))

    def _near_best(self, size: int, solutions: Mapping[Name, Solution]) -> dict[Name, Solution]:
        """Those that are near the best of their size, in this race and in those before it."""
        behind = self._best.setdefault(size, Best()).behind(solutions)
        return {name: solution for name, solution in solutions.items() if behind[name] <= BEHIND}

    def _refitted(self, trails: Mapping[Name, Trail], solutions: Mapping[Name, Solution]) -> list[Candidate]:
        """Solutions of races on all points."""
        jobs = [(trails[name], solution, self._base) for name, solution in solutions.items()]
        return [candidate(fit, self._base) for fit in self._each(on_all_points, jobs)]

    def _without(self, fit: Fit, effect: str) -> Fit:
        """A fit without one of its effects, not refitted, as start values; error sizes are those of the base."""
        task = task_without(fit, effect)
        names = {parameter.name for parameter in task.motor.parameters}
        return dataclasses.replace(
            fit,
            motor=task.motor,
            sizes=self._base.sizes,
            parameters=values_without(fit, task.motor),
            search_parameters={name: value for name, value in fit.search_parameters.items() if name in names},
            likeliest_parameters={name: value for name, value in fit.likeliest_parameters.items() if name in names},
            held=task.held,
            bounds=task.bounds,
        )


def _holding(trail: Trail, fit: Fit) -> Trail:
    """The same model and start values, with the parameters held that a fit holds."""
    return dataclasses.replace(trail, task=dataclasses.replace(trail.task, held={**trail.task.held, **fit.held}))


def _best_with_little_left(found: Mapping[Key, Candidate], size: int, errs_little: bool = False) -> Candidate | None:
    """The best set of a size that leaves little; with `errs_little`, also by its circuit's own error."""
    most_percent = 100 * LITTLE if errs_little else 0.0
    return next((one for one in ranked(found, size) if little_is_left(one.fit.sizes) or one.fit.rms_error_percent < most_percent), None)


def _unlike(solutions: Mapping[Key, Solution]) -> list[Key]:
    """Sets without those that only have an effect at another place, where it is no more or less probable: there it is the same circuit.

    In the short-circuit sweep a capacitor across the terminals is one to the frame; all three of its places were refitted, and a core was not.
    """
    chosen: dict[tuple[str, ...], float] = {}
    kept = []
    for key, solution in solutions.items():
        laws = tuple(sorted(find_effect(name).effect.name for name in key))
        if abs(solution.log_evidence - chosen.get(laws, inf)) > SAME:
            kept.append(key)
            chosen[laws] = solution.log_evidence
    return kept


def _likeliest_orders(raced: Iterable[Mapping[Key, Solution]]) -> dict[Key, Solution]:
    """The solutions of several races, the best evidence first; of sets with the same effects only the best one."""
    ranked = sorted((pair for solutions in raced for pair in solutions.items()), key=lambda pair: -pair[1].log_evidence)
    best: dict[Key, tuple[Key, Solution]] = {}
    for key, solution in ranked:
        best.setdefault(tuple(sorted(key)), (key, solution))
    return dict(best.values())


def _alike(one: str, other: str) -> bool:
    """Whether two effects are the same, are it at two places, or are known to look alike: such effects are not dropped after a poor first round."""
    effect, rival = find_effect(one).effect, find_effect(other).effect
    return effect is rival or bool({one, effect.name} & set(rival.look_alikes) or {other, rival.name} & set(effect.look_alikes))
