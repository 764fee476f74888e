"""The parts that every machine has, fitted all at once: leads, strap, terminals, losses of copper, iron and insulation, suppressors.

If several of them are visible, a search that adds one effect after the other fails: fitted alone, each takes values with which it also describes
part of the others. So they are fitted together, from many start values, and those that are not needed are then left out again.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Container, Mapping, Sequence
from itertools import product

import numpy as np

from motoremi.arrays import Progress
from motoremi.data.covariance import Sizes
from motoremi.diagnosis.candidates import Candidate, Effects, candidate, own_labels, possible_effects, prior_of_set
from motoremi.fitting.band_scaling import bands, scale_factors, scaled_ranges
from motoremi.fitting.race import ALL, Round, Rounds, Trail, race, raced_alone
from motoremi.fitting.refit import better_than, on_all_points
from motoremi.fitting.result import Fit
from motoremi.fitting.search import Solution, Task
from motoremi.fitting.starts import base_starts
from motoremi.fitting.trail import trail_to
from motoremi.model.effects import Effect, add_effects, find_effect
from motoremi.model.effects.start import with_start
from motoremi.model.parameter import Parameter
from motoremi.workers import Map

# In every machine, as far as the sweeps can show them.
ALWAYS = ("lead-inductance", "ground-strap-inductance", "terminal-capacitance", "dielectric-loss@Cf", "insulation-leakage@Cf")
# Losses of copper, and of iron: the first of each row is fitted first, then each other one in its place, from the values that were reached.
LOSSES = (("skin-effect", "proximity-effect"), ("eddy-laminations", "permeability-relaxation", "rotor-cage"))
# What is built into many machines, or nothing; and whether the winding's capacitance to the frame is spread along it.
BUILT_IN = ("", "suppressor-capacitor@frame", "suppressor-capacitor", "suppressor-capacitor@pair")
WINDING = ("", "distributed-winding")
# Start values that can be computed from the data, of elements and of some effects, are drawn around these, with these standard deviations of their
# logarithm, all others over their usual ranges. Of four machines with five to twelve effects all came near the truth from a thousand starts, three
# from six hundred.
STARTS, SPREADS = 1000, (0.3, 2.0)
# Share of the starts in which a law has its simplest form, as in its prior.
SIMPLEST = 0.5
# Error sizes with which the likelihood compares the parts from the start: equal weights of the points do not show which parts are needed.
NEARLY_ALL = Sizes(0.01, 1.0)
# Number of the sets, the best ones by then, that are fitted to the end.
FINISHED = 3
# Few steps from all starts, then to the end from the best ones. With half as many in the last rounds and two sets, it depended on the rounding of
# the computer whether a machine with five parts was found.
WHOLE = Rounds((Round(60, 8, ALL, ALL), Round(60, 20, 120, ALL), Round(60, 40, 40, ALL), Round(80, 60, 8, ALL)), 2, 80)


def whole_machine(base: Fit, each: Map = map, progress: Progress | None = None, most_percent: float = np.inf) -> Candidate | None:
    """The model with all ordinary parts that the sweeps need; None if it has no more than two.

    Parameters
    ----------
    base : Fit
        Nothing added; its own effects stay.
    each : callable
        As the built-in `map`.
    progress : callable, optional
    most_percent : float
        None too if the circuit errs by more than this with all parts: without some of them it errs no less.
    """
    possible = set(possible_effects(base)) - set(base.effects)
    ordinary = [name for name in (*ALWAYS, *(row[0] for row in LOSSES)) if name in possible]
    sets = {tuple(name for name in (*ordinary, *further) if name in possible) for further in product(WINDING, BUILT_IN)}
    trails = {names: _scattered(base, names, [{}]) for names in sorted(sets)}
    reached = race(trails, WHOLE, (), progress, each).reached
    best_sets = sorted(reached, key=lambda names: reached[names].best)[:FINISHED]
    leading = [_by_evidence([_near(base, names, start) for start in reached[names].starts], each)[0] for names in best_sets]
    whole = [_with_likeliest_losses(base, one, possible, each) for one in leading]
    ends = [_needed(base, one, each) for one in whole if _error_percent(*one) <= most_percent]
    if not ends:
        return None
    found = max(ends, key=lambda end: end[1].log_evidence + prior_of_set(base, len(_names(base, end[0]))))
    return candidate(on_all_points((*found, base)), base) if len(_names(base, found[0])) > 2 else None


def _error_percent(trail: Trail, solution: Solution) -> float:
    """Relative error of the circuit alone, rms in percent."""
    relative = trail.task.relative()
    return float(100 * np.sqrt(relative.objective(relative.vector(solution.values)) / relative.size))


def _scattered(base: Fit, names: Effects, factors: Sequence[Mapping[str, float]]) -> Trail:
    """All effects at once, from start values drawn around those computed from the data, near and far.

    Parameters
    ----------
    factors : sequence of mapping
        Of parameters by name: what is drawn from their ranges is scaled by one of these.
    """
    task, rng = _task(base, names), np.random.default_rng(len(names))
    places = [*base_starts({**base.parameters, **base.search_parameters}, base.measurement.coarse, few=False)]
    places += [dict(start) for name in names if find_effect(name).effect.reader for start in trail_to(base, name).starts]
    starts: list[Mapping[str, float]] = []
    for index in range(STARTS):
        spread = SPREADS[index % len(SPREADS)]
        place = places[index // len(SPREADS) % len(places)]
        values = {name: value * float(np.exp(spread * rng.standard_normal())) for name, value in place.items()}
        added = [p for p in task.motor.parameters if p.name not in values and p.name not in base.held]
        factor = factors[int(rng.integers(len(factors)))]
        starts.append({**values, **{p.name: factor.get(p.name, 1.0) * _drawn(p, rng) for p in added}})
    return Trail(task, starts, 1, base.sizes)


def _task(base: Fit, names: Effects) -> Task:
    motor = add_effects(base.motor, names)
    own = {p.name for p in motor.parameters}
    return Task(motor, base.measurement, {name: range_ for name, range_ in base.bounds.items() if name in own}, base.held)


def _drawn(parameter: Parameter, rng: np.random.Generator) -> float:
    if parameter.special is not None and rng.random() < SIMPLEST:
        return parameter.special
    low, high = parameter.usual or (parameter.low, parameter.high)
    return float(np.exp(rng.uniform(np.log(low), np.log(high))) if parameter.scale == "log" else rng.uniform(low, high))


def _with_likeliest_losses(base: Fit, found: tuple[Trail, Solution], possible: Container[str], each: Map) -> tuple[Trail, Solution]:
    """The same with those losses that are the most probable, each row's others tried from the present values."""
    trail, best = found
    for first, *others in LOSSES:
        names = _names(base, trail)
        instead = {other: tuple(other if name == first else name for name in names) for other in others if other in possible and first in names}
        trails = [
            dataclasses.replace(
                near := _near(base, kept, best.values),
                starts=[with_start(near.starts[0], start, other) for start in find_effect(other).effect.starts],
            )
            for other, kept in instead.items()
        ]
        for one, solution in zip(trails, each(raced_alone, trails), strict=True):
            if solution.log_evidence > best.log_evidence:
                trail, best = one, solution
    return trail, best


def added_together(base: Fit, names: Effects, each: Map = map) -> list[Fit]:
    """Several effects added to a fit at once, as steps of one effect each, in the order of `by_need`.

    Raises
    ------
    BadInput
        If an effect is unknown, cannot be added, or is given twice.
    """
    base = in_wider_ranges(base, names)
    return falling(base, list(each(on_all_points, by_need(base, nearest(base, names, each)[0], each))))


def in_wider_ranges(base: Fit, names: Effects) -> Fit:
    """A fit with the ranges in which each of these effects is sought alone: those of a sweep in another band are wider than the catalogue's."""
    wider: dict[str, tuple[float, float]] = {}
    for label, effect in _labelled(base, names):
        wider |= scaled_ranges(effect, label, base.measurement)
    return dataclasses.replace(base, bounds={**wider, **base.bounds})


def _labelled(base: Fit, names: Effects) -> list[tuple[str, Effect]]:
    """Effects that are added to a fit, each with the prefix of its parameters."""
    return [(label, find_effect(label.partition("#")[0]).effect) for label in sorted(own_labels((*base.effects, *names), names))]


def _factors(base: Fit, names: Effects) -> list[dict[str, float]]:
    """Factors that scale the effects' parameters, by name: none for the catalogue's own band, then those for each other band of the measurement."""
    scaled = [(label, scale_factors(effect, base.measurement)) for label, effect in _labelled(base, names)]
    count = len(bands(base.measurement))
    found = [{f"{label}.{name}": value for label, of_bands in scaled for name, value in of_bands[at].items()} for at in range(count)]
    return [{}, *(factor for factor in found if set(factor.values()) - {1.0})]


def falling(base: Fit, steps: Sequence[Fit]) -> list[Fit]:
    """The same steps; one that errs more than the step before is fitted anew from that, and the better of both fits is kept.

    The values of all effects together do not suit fewer, and a search for all at once may miss what the step before had found.
    """
    done = [base]
    for step in steps:
        again = None if step.rms_error_percent <= done[-1].rms_error_percent else done[-1].add(step.effects[-1])
        done.append(step if again is None or not better_than(step, again) else again)
    return done[1:]


def added_near(base: Fit, names: Effects, values: Mapping[str, float], each: Map = map) -> list[Fit]:
    """Effects added in this order, as steps of one each, from the values that they have together."""
    base = in_wider_ranges(base, names)
    return falling(base, list(each(_fitted_near, [(base, _near(base, names[: at + 1], values)) for at in range(len(names))])))


def _fitted_near(job: tuple[Fit, Trail]) -> Fit:
    base, trail = job
    return on_all_points((trail, raced_alone(trail), base))


def nearest(base: Fit, names: Effects, each: Map = map) -> list[tuple[Trail, Solution]]:
    """Where several effects together may be fitted best, the best first; their order makes no difference."""
    names = tuple(sorted(names))
    reached = race({names: _scattered(base, names, _factors(base, names))}, WHOLE, each=each).reached[names]
    return _by_evidence([_near(base, names, start) for start in reached.starts], each)


def _by_evidence(trails: Sequence[Trail], each: Map) -> list[tuple[Trail, Solution]]:
    """Trails of one model and their ends, those with the most evidence first: the one that leads after a race is not always the best then."""
    return sorted(zip(trails, each(raced_alone, trails), strict=True), key=lambda found: -found[1].log_evidence)


def by_need(base: Fit, found: tuple[Trail, Solution], each: Map = map) -> list[tuple[Trail, Solution, Fit]]:
    """What `on_all_points` takes for each step of a ladder to all effects: a step adds the effect without which the rest fits best."""
    path = [found]
    while len(_names(base, path[-1][0])) > 1:
        path.append(_without_one(base, *path[-1], each))
    ordered: list[str] = []
    for trail, _ in reversed(path):
        ordered += [name for name in _names(base, trail) if name not in ordered]
    return [(_near(base, tuple(ordered[: at + 1]), one.values), one, base) for at, (_, one) in enumerate(reversed(path))]


def _needed(base: Fit, found: tuple[Trail, Solution], each: Map) -> tuple[Trail, Solution]:
    """Without the effects that are more probably absent than present, one after the other."""
    trail, solution = found
    while (count := len(_names(base, trail))) > 1:
        fewer, without = _without_one(base, trail, solution, each)
        if without.log_evidence + prior_of_set(base, count - 1) < solution.log_evidence + prior_of_set(base, count):
            break
        trail, solution = fewer, without
    return trail, solution


def _without_one(base: Fit, trail: Trail, solution: Solution, each: Map) -> tuple[Trail, Solution]:
    """Without the effect whose absence leaves the most probable model."""
    names = _names(base, trail)
    trails = [_near(base, tuple(name for name in names if name != gone), solution.values) for gone in names]
    found = list(each(raced_alone, trails))
    best = max(range(len(names)), key=lambda at: found[at].log_evidence)
    return trails[best], found[best]


def _names(base: Fit, trail: Trail) -> Effects:
    """The effects that are added to the base."""
    names = list(trail.task.motor.effects)
    for name in base.effects:
        names.remove(name)
    return tuple(names)


def _near(base: Fit, names: Effects, values: Mapping[str, float]) -> Trail:
    """These effects, from the values of a solution with more of them or others."""
    return Trail(_task(base, names), [values], 1, NEARLY_ALL)
