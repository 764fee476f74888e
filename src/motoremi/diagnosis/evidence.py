"""Evidence for each effect: the refitted model's marginal likelihood, and whether its parameters are physically possible."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.fft import dct
from scipy.special import ndtr

from motoremi.arrays import JsonDict, Progress
from motoremi.diagnosis.scouts import Scouts, improved, nearest
from motoremi.fitting.fit import told, trail_to, trail_without
from motoremi.fitting.looks import FEW_POINTS, Scouted, pursue, search_through, settle
from motoremi.fitting.result import Fit
from motoremi.fitting.search import good_enough
from motoremi.model.effects import find_effect, identifiers
from motoremi.quantities import show
from motoremi.spread import spread

# Candidates whose first look ends within this factor (and so many units of chi-squared) of one that is right are refitted on all points.
PROMISING_FACTOR = 2.0
PROMISING_MARGIN = 100.0
# How many of the nearest are followed beyond a glance: all that may be rivals of one that is right; without one, the first few.
PURSUED = 6
PURSUED_IN_THE_DARK = 6
# How many of the nearest are searched through: with one that explains everything at hand, those within a factor of its chi-squared.
SEARCHED = 5
SEARCHED_FACTOR = 10.0
# One that leaves so many times the chi-squared of one that explains everything is no rival of it.
HOPELESS_FACTOR = 100.0
# A fit that leaves less than so many times what noise does is near.
NEAR_NOISE = 100.0
# How many are refitted on all points where none is right.
POLISHED_IN_THE_DARK = 2
# Cosines along each sweep that are looked at for a shape in what is left: those that a few resonances and corners can draw.
SLOWEST_COSINES = 16
# A parameter that the data push against a physical bound costs as much as odds of 150 to 1.
BOUND_PENALTY = 5.0


@dataclass(frozen=True, eq=False)
class Candidate:
    """A model with one more effect, refitted.

    Parameters
    ----------
    effect : str
    fit : Fit
    log_evidence : float
        Of its model, bounds counted against it; comparable among models of the same data only.
    at_bound : tuple of str
        Parameters of the effect that the data push against a bound.
    look : Scouted
        What led there.
    """

    effect: str
    fit: Fit
    log_evidence: float
    at_bound: tuple[str, ...]
    look: Scouted

    @property
    def plausible(self) -> bool:
        """Whether all its parameters lie within their physical range."""
        return not self.at_bound

    @property
    def good(self) -> bool:
        """Whether the model describes the data down to the noise."""
        return is_good(self.fit)

    def parameters(self) -> JsonDict:
        """Its own parameters by short name, SI units."""
        label = own_label(self.fit, self.effect)
        found = {}
        for parameter in self.fit.motor.parameters:
            if parameter.name.startswith(f"{label}."):
                sigma = self.fit.sigma[parameter.name]
                found[parameter.short_name] = {
                    "value": self.fit.parameters[parameter.name],
                    "sigma": float(sigma) if np.isfinite(sigma) else None,
                    "at_bound": parameter.short_name in self.at_bound,
                    "unit": parameter.unit,
                }
        return found

    def describe(self) -> str:
        """Its parameters in a line of text."""
        return ", ".join(f"{name} = {show(entry['value'], entry['unit'])}" for name, entry in self.parameters().items())


def own_label(fit: Fit, effect: str) -> str:
    """Prefix of the parameters of the last occurrence of an effect in a fit."""
    count = fit.effects.count(effect)
    return effect if count <= 1 else f"{effect}#{count}"


def is_good(fit: Fit) -> bool:
    """Whether what a fit leaves is what noise and analyser leave of a perfect model: no more, and without a shape along frequency."""
    return bool(fit.objective < good_enough(fit.problem)) and not has_shape(fit)


def has_shape(fit: Fit) -> bool:
    """Whether the whitened residuals swing slowly along frequency, beyond chance.

    A wrong model that nearly fits leaves a smooth misfit, which drowns in the chi-squared of all points but not in that of the slowest
    cosines of each sweep.
    """
    white = fit.problem.whitened(fit.unknowns)
    total, count = 0.0, 0
    for where in fit.problem.observed.slices.values():
        for part in (white[where].real, white[where].imag):
            slowest = dct(part, norm="ortho")[: min(SLOWEST_COSINES, part.size // 4)]
            total, count = total + float(np.sum(slowest**2)), count + slowest.size
    return bool(total > fit.measurement.doubt * (1.02 * count + 2 * np.sqrt(2 * count)))


def effective_share(fit: Fit) -> float:
    """Share of the points that count as independent: 1 for white residuals, less where they wander along frequency or noise is in doubt.

    The integrated autocorrelation of the whitened residuals, summed until it drowns in its own scatter. Without it a fraction of a
    percent of drift in the analyser would pass for overwhelming evidence.
    """
    white = fit.problem.whitened(fit.unknowns)
    total = 0.0
    series = [part[where] for where in fit.problem.observed.slices.values() for part in (white.real, white.imag)]
    noise = 2 / np.sqrt(sum(len(one) for one in series))
    for lag in range(1, min(40, min(len(one) for one in series) // 4)):
        correlation = float(np.mean([np.mean(one[lag:] * one[:-lag]) / np.mean(one**2) for one in series]))
        if correlation < noise:
            break
        total += correlation
    return 1 / (1 + 2 * total) / fit.measurement.doubt


def at_bound(fit: Fit, effect: str) -> tuple[str, ...]:
    """Parameters of an effect that the data, not just the prior, push against a bound."""
    label = own_label(fit, effect)
    problem, u = fit.problem, fit.unknowns
    gradient = fit.linearised.gradient
    pushed = []
    for index, parameter in enumerate(problem.unknowns):
        if not parameter.name.startswith(f"{label}.") or parameter.sigma is not None:
            continue
        span = problem.high[index] - problem.low[index]
        edge = u[index] < problem.low[index] + 1e-6 * span or u[index] > problem.high[index] - 1e-6 * span
        # Moving a fifth of the range back into the middle would cost more than two units of chi-squared.
        if edge and abs(gradient[index]) * 0.2 * span > 1.0 and parameter.special is None and parameter.short_name not in _SOFT:
            pushed.append(parameter.short_name)
    return tuple(pushed)


# A lead's resistance below a milliohm is none at all.
_SOFT = frozenset({"resistance_ohm"})


def simplest_form(fit: Fit, effect: str) -> float:
    """What the log evidence gains since half of the prior lies on an effect's simplest form (a relaxation with one time constant).

    The ratio of posterior to prior density there is that form's Bayes factor against the free one (Savage and Dickey), so it needs no
    refit. Without it, a law would lose to its exact equivalent for no reason but one more parameter.
    """
    label = own_label(fit, effect)
    problem, gained = fit.problem, 0.0
    for index, parameter in enumerate(problem.unknowns):
        if parameter.special is None or not parameter.name.startswith(f"{label}."):
            continue
        away = fit.unknowns[index] - problem.unknown(index, parameter.special)
        variance = max(float(fit.covariance[index, index]), 1e-18)
        factor = np.log((problem.high[index] - problem.low[index]) / np.sqrt(2 * np.pi * variance)) - 0.5 * away**2 / variance
        gained += float(np.logaddexp(0.0, factor) - np.log(2))
    return gained


def usual_size(fit: Fit, effect: str) -> float:
    """What the log evidence gains or loses since half of the prior of an element or an effect's parameter lies where most motors have it.

    An effect that fits only beside a rotor of 1 uF is none that most motors have.
    """
    label = own_label(fit, effect)
    problem, gained = fit.problem, 0.0
    for index, parameter in enumerate(problem.unknowns):
        if parameter.usual is None or not (parameter.name.startswith(f"{label}.") or "." not in parameter.name):
            continue
        low, high = (problem.unknown(index, value) for value in parameter.usual)
        deviation = np.sqrt(max(float(fit.covariance[index, index]), 1e-18))
        inside = float(ndtr((high - fit.unknowns[index]) / deviation) - ndtr((low - fit.unknowns[index]) / deviation))
        density = 0.5 + 0.5 * inside * (problem.high[index] - problem.low[index]) / (high - low)
        gained += float(np.log(density))
    return gained


def looked_elsewhere(fit: Fit, effect: str) -> float:
    """What the log evidence loses for a parameter that was found by a scan over all frequencies: it could have been any of them."""
    scanned = sum(not parameter.vary for parameter in find_effect(effect).effect.parameters)
    return float(scanned * np.log(np.unique(fit.problem.observed.frequency_hz).size))


def possible_effects(fit: Fit) -> list[str]:
    """Effects that could be added to a fit, given its sweeps."""
    names = []
    for name in identifiers():
        effect = find_effect(name).effect
        if name in fit.effects and not effect.repeatable:
            continue
        if seen_in(fit, name):
            names.append(name)
    return names


def seen_in(fit: Fit, effect: str) -> frozenset[str]:
    """Terminations of the sweeps in which an effect, added to a fit, would show."""
    motor, label = find_effect(effect).added_to(fit.motor), find_effect(effect).label_in(fit.motor)
    return frozenset(t for t in fit.measurement.terminations if any(name.startswith(f"{label}.") for name in motor.used_parameters(t)))


def possible_rivals(fit: Fit, effect: str) -> list[str]:
    """Effects that could be added to a fit and would show where another one does."""
    place = seen_in(fit, effect)
    return [name for name in possible_effects(fit) if seen_in(fit, name) == place]


def near_noise(fit: Fit) -> bool:
    """Whether a fit leaves more than noise, but little: what is missing beside it is then sought by the likelihood."""
    return bool(fit.objective < NEAR_NOISE * good_enough(fit.problem)) and not is_good(fit)


def glances(
    before: Fit,
    most: int | None = None,
    near: Mapping[str, float] | None = None,
    replacing: str | None = None,
    progress: Progress | None = None,
) -> dict[str, Scouted]:
    """A quick look at every possible effect; the nearest are followed to their end.

    Parameters
    ----------
    most : int, optional
        Leave it at so many of those that begin best.
    near : mapping, optional
        Parameters of a solution with another effect in its place, in SI units, to look from.
    replacing : str, optional
        That other effect: only those are looked at that show where it does, and its known look-alikes are followed in any case.
    progress : callable, optional
    """
    names = possible_effects(before) if replacing is None else possible_rivals(before, replacing)
    likely = near_noise(before)
    trails = {name: trail_to(before, name, near=near, points=FEW_POINTS, by_likelihood=likely) for name in names}
    with Scouts(trails) as scouts:
        first = scouts.begun(progress=progress)
        found = scouts.followed(first, most)
        if replacing is not None:
            found |= scouts.followed({name: one for name, one in first.items() if name not in found and _alike(name, replacing)})
        order = nearest(found)
        best = found[order[0]]
        if best.right:
            rivals = (*order[:PURSUED], *(name for name in order[PURSUED:] if _alike(name, order[0])))
            scouts.improve(found, (name for name in rivals if found[name].objective <= HOPELESS_FACTOR * best.objective), pursue)
        else:
            # What the search found nearest may need more steps by the likelihood than it has had.
            by_search = sorted(found, key=lambda name: found[name].searched)
            alternating = dict.fromkeys(name for both in zip(order, by_search, strict=True) for name in both)
            scouts.improve(found, list(alternating)[:PURSUED_IN_THE_DARK], pursue)
    return found


def _alike(one: str, other: str) -> bool:
    """Whether two effects are known to look alike on many motors: then neither may be left out for a poor first look."""
    effect, rival = find_effect(one).effect, find_effect(other).effect
    return bool({one, effect.name} & set(rival.look_alikes) or {other, rival.name} & set(effect.look_alikes))


def rank(before: Fit, progress: Progress | None = None) -> list[Candidate]:
    """Refit with every possible effect, the promising ones on all points; best evidence first.

    Parameters
    ----------
    progress : callable, optional
        Told the effect's name, how many are done, and of how many.
    """
    looks = glances(before, progress=progress)
    order = nearest(looks)
    best = looks[order[0]]
    if best.right:
        rivals = (name for name in order[:SEARCHED] if looks[name].objective < SEARCHED_FACTOR * best.objective)
        improved(looks, rivals, search_through)
    ranked = refitted(before, looks)
    first = ranked[0]
    if first.look.right and not is_good(first.fit):
        # On few points it passed for right what lies in the valley beside.
        beside = refitted(before, {first.effect: Scouted(first.look.trail, search_through(first.look))})[0]
        ranked = sorted((max(first, beside, key=_evidence), *ranked[1:]), key=_evidence, reverse=True)
    return ranked


def _evidence(candidate: Candidate) -> float:
    return candidate.log_evidence


def members(pair: Fit, one: str, other: str) -> tuple[Candidate, Candidate]:
    """Each of two effects of a fit without the other, from where the two of them led, which is a better valley than it may have found alone."""
    with Scouts({one: trail_without(pair, other), other: trail_without(pair, one)}) as scouts:
        looks = scouts.followed(scouts.begun())
        scouts.improve(looks, (one, other), pursue)
    found = {candidate.effect: candidate for candidate in refitted(pair, looks)}
    return found[one], found[other]


def refitted(before: Fit, looks: Mapping[str, Scouted]) -> list[Candidate]:
    """Candidates from looks, the promising ones polished on all points; best evidence first."""
    order = nearest(looks)
    best = looks[order[0]]
    limit = PROMISING_FACTOR * best.objective + PROMISING_MARGIN if best.right else looks[order[:POLISHED_IN_THE_DARK][-1]].objective
    found = spread(lambda look: settle(look, before.seed, thorough=False, polished=look.objective <= limit), [looks[name] for name in order])
    fits = [told(looks[name].trail.task, end, before) for name, end in zip(order, found, strict=True)]
    ranked = [_candidate(name, fit, looks[name]) for name, fit in zip(order, fits, strict=True)]
    return sorted(ranked, key=_evidence, reverse=True)


def _candidate(effect: str, fit: Fit, look: Scouted) -> Candidate:
    bounds = at_bound(fit, effect)
    prior = simplest_form(fit, effect) + usual_size(fit, effect) - looked_elsewhere(fit, effect) - BOUND_PENALTY * len(bounds)
    return Candidate(effect, fit, fit.log_evidence + prior, bounds, look)
