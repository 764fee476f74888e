"""A model with some effects added and its score: evidence times the prior of the effects and of their values."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import comb

import numpy as np
from scipy.special import ndtr

from motoremi.arrays import FloatArray, JsonDict
from motoremi.fitting.result import Fit
from motoremi.model.effects import find_effect, identifiers
from motoremi.model.motor import BASE_PARAMETERS, Motor
from motoremi.model.parameter import Parameter
from motoremi.quantities import show

Effects = tuple[str, ...]

# Prior of the number of effects that are missing in the circuit: none for half of the motors. An assumption; unconfirmed.
PRIOR_OF_SIZE = (0.5, 0.35, 0.12, 0.03)
# A parameter that the data push against a physical bound costs as much as odds of 150 to 1.
BOUND_PENALTY = 5.0
# In standard deviations, of which three are the analyser's specification: above this a finding says that larger errors are needed.
ALLOWED_SIGMA = 4.0
# A law with this many parameters is flexible: it can imitate another one.
FLEXIBLE = 3
# Standard deviations by which a value must lie beyond what is usual to count as unusual, as for a 95 % interval.
UNSURE = 2.0
# Share of an element by which another model must differ to be told: less is the tolerance of parts and windings.
CLEARLY_OTHER = 0.2
# Parts that have the impedance of an element.
LIKE_PART = {"Ca": "a capacitor across the terminals", "Cr": "a capacitor to the frame", "Cf": "a capacitor to the frame"}
# Parameters that damp a resonance (`Effect.damping_ratio`).
DAMPING = ("resistance_ohm", "quality")
# Parameters whose lower bound means zero (a lead or a capacitor below 1 mOhm): being at that bound costs nothing.
_SOFT = frozenset({"resistance_ohm", "esr_ohm"})


@dataclass(frozen=True, eq=False)
class Candidate:
    """A model with effects added to the one that is diagnosed, refitted.

    Parameters
    ----------
    added : tuple of str
        Effects, in the order in which they were added.
    fit : Fit
    score : float
        Log of evidence times prior; comparable among models of the same data only.
    at_bound : tuple of str
        Parameters of these effects that the data push against a bound.
    left_share : float
        Share of the error that the diagnosed model leaves undescribed which this one leaves too, at most 1.
    """

    added: Effects
    fit: Fit
    score: float
    at_bound: tuple[str, ...]
    left_share: float = 0.0

    @property
    def effect(self) -> str:
        """The effect that was added last."""
        return self.added[-1]

    @property
    def plausible(self) -> bool:
        """Whether all parameters lie within their physical range."""
        return not self.at_bound

    @cached_property
    def done(self) -> bool:
        """Whether nothing remains for another effect: neither an undescribed part nor errors of analyser or fixture beyond `ALLOWED_SIGMA`."""
        return self.fit.marginal.nothing_left >= 0.5 and self.fit.instrument_sigma <= ALLOWED_SIGMA

    @property
    def ordinary(self) -> bool:
        """Whether all values are usual and within their physical range."""
        return self.plausible and not self.unusual

    @property
    def leaves_nothing(self) -> bool:
        """Whether the model describes everything, with ordinary values."""
        return self.done and self.ordinary

    @property
    def exchanged(self) -> bool:
        """Whether an effect has exchanged places with an element: then it describes the winding, and La what is beside it.

        Not where both are seen to resonate and describe everything: then the larger part of a winding is named as the effect.
        """
        return self.larger_than_winding and not (self.fit.marginal.nothing_left >= 0.5 and _winding_resonates(self.fit))

    @property
    def larger_than_winding(self) -> bool:
        """Whether an effect is larger than the element that it is usually smaller than (`Effect.less_than`)."""
        labels = own_labels(self.fit.motor.effects, self.added)
        return any(find_effect(label.partition("#")[0]).effect.has_exchanged(label, self.fit.parameters) for label in labels)

    @cached_property
    def unusual(self) -> tuple[str, ...]:
        """Parameters of flexible laws (`FLEXIBLE`) outside their usual range by more than their uncertainty, or of a resonance that is overdamped.

        If an error remains undescribed, the laws are approximate: their values are known as well as they describe the motor.
        """
        sigma: Mapping[str, float]
        if self.fit.marginal.nothing_left < 0.5:
            sigma = {name: self.left_share * abs(value) / UNSURE for name, value in self.fit.parameters.items()}
        else:
            sigma = self.fit.exact_sigma
        return unusual_values(self.fit.motor, own_labels(self.fit.effects, self.added), self.fit.parameters, sigma)

    @property
    def unusual_in_words(self) -> str:
        """The unusual values in a line of text, and which resonances are none."""
        units = {parameter.name: parameter.unit for parameter in self.fit.motor.parameters}
        values = [f"{name} = {show(self.fit.parameters[name], units[name])}" for name in self.unusual]
        labels = sorted(own_labels(self.fit.effects, self.added))
        overdamped = [one for one in labels if _is_overdamped(one, self.fit.motor, self.fit.parameters)]
        loops = [one for one in labels if f"{one}.skin_hz" in self.unusual]
        return ", ".join(
            [
                *values,
                *(f"{label} is overdamped, so nothing resonates" for label in overdamped),
                *(f"{label} has more inductance within its conductor than outside, as no wire, bar or sleeve" for label in loops),
            ]
        )

    def parameters(self) -> JsonDict:
        """Parameters of the added effects by short name, those of the second and later effects by full name; SI units."""
        found = {}
        labels = own_labels(self.fit.effects, self.added)
        for parameter in self.fit.motor.parameters:
            label = parameter.name.rpartition(".")[0]
            if label in labels and parameter.name in self.fit.parameters:
                sigma = self.fit.sigma[parameter.name]
                found[parameter.short_name if len(labels) == 1 else parameter.name] = {
                    "value": self.fit.parameters[parameter.name],
                    "sigma": float(sigma) if np.isfinite(sigma) else None,
                    "at_bound": parameter.name in self.at_bound,
                    "unit": parameter.unit,
                }
        return found

    def describe(self) -> str:
        """Its parameters in a line of text."""
        return ", ".join(f"{name} = {show(entry['value'], entry['unit'])}" for name, entry in self.parameters().items())


def unusual_values(motor: Motor, labels: Container[str], values: Mapping[str, float], sigma: Mapping[str, float] | None = None) -> tuple[str, ...]:
    """Parameters of flexible laws (`FLEXIBLE`) that are outside their usual range, what damps a resonance that is overdamped, and `skin_hz` of a
    loop with more inductance within its conductor than outside.

    An overdamped resonant cell is a lossy inductance, which has other causes; such a loop is a wire's own skin effect, or its neighbours'.

    Parameters
    ----------
    values : mapping
        In SI units.
    sigma : mapping, optional
        Standard deviations; a value is then unusual only if it is two of them outside the range.
    """
    # One that no sweep shows has no value.
    own = [p for p in motor.parameters if p.name.rpartition(".")[0] in labels and p.name in values]
    counts = Counter(p.name.rpartition(".")[0] for p in own)
    flexible = [p for p in own if counts[p.name.rpartition(".")[0]] >= FLEXIBLE]
    outside = [p.name for p in flexible if _is_unusual(p, values[p.name], 0.0 if sigma is None else UNSURE * sigma[p.name])]
    damping = [f"{label}.{name}" for label in counts if _is_overdamped(label, motor, values) for name in DAMPING]
    overdamped = [name for name in damping if name in values and name not in outside]
    return (*outside, *overdamped, *(f"{label}.skin_hz" for label in counts if _is_within_itself(label, motor, values, sigma)))


def large_elements(fit: Fit) -> list[str]:
    """The capacitances of a fit's own elements that are larger than those of windings, in words: they are those of capacitors."""
    said = []
    for parameter in BASE_PARAMETERS:
        part, value = LIKE_PART.get(parameter.name), fit.parameters.get(parameter.name, 0.0)
        if part is None or parameter.usual is None or value <= parameter.usual[1]:
            continue
        if _is_unusual(parameter, value, UNSURE * fit.sigma[parameter.name]):
            most = f"{parameter.name} = {show(value, 'F')} is more than windings have (up to {show(parameter.usual[1], 'F')})"
            said.append(f"{most}: {part} has the same impedance, look for one")
    return said


def changed_elements(fit: Fit, others: Mapping[str, Fit]) -> str:
    """The motor's elements that a fit determines and of which another has clearly another value, in words; empty if there are none.

    Parameters
    ----------
    fit : Fit
    others : mapping
        Fits by the name of the effect that they have instead, or in addition.
    """
    said = []
    for parameter in BASE_PARAMETERS:
        name = parameter.name
        if name not in fit.parameters or not fit.determined(name):
            continue
        own = fit.parameters[name]
        values = {label: other.parameters[name] for label, other in others.items() if name in other.parameters and other.determined(name)}
        # The value that is furthest away, as a ratio.
        label = max(values, key=lambda one: abs(np.log(values[one] / own)), default="")
        if label and abs(values[label] - own) > max(UNSURE * fit.sigma[name], CLEARLY_OTHER * own):
            said.append(f"{name} is {show(own, parameter.unit)} here and {show(values[label], parameter.unit)} with {label}")
    return ", ".join(said)


def _winding_resonates(fit: Fit) -> bool:
    """Whether La and Ca resonate within the sweeps, damped less than critically."""
    ra, la, ca = (fit.parameters.get(name, 0.0) for name in ("Ra", "La", "Ca"))
    if not la * ca:
        return False
    resonance_hz = 1 / (2 * np.pi * np.sqrt(la * ca))
    inside = any(sweep.frequency_hz[0] <= resonance_hz <= sweep.frequency_hz[-1] for sweep in fit.measurement.sweeps)
    return bool(inside and 0.5 * ra * np.sqrt(ca / la) < 1)


def _is_overdamped(label: str, motor: Motor, values: Mapping[str, float]) -> bool:
    """Whether an effect is a resonance that is damped more than critically: a resonance that is none."""
    damping_ratio = find_effect(label.partition("#")[0]).effect.damping_ratio
    return damping_ratio is not None and damping_ratio(_by_short_name(label, motor, values)) > 1


def _is_within_itself(label: str, motor: Motor, values: Mapping[str, float], sigma: Mapping[str, float] | None) -> bool:
    """Whether an effect is a loop with more inductance within its conductor than outside, by more than its uncertainty (`Effect.within`)."""
    within = find_effect(label.partition("#")[0]).effect.within
    if within is None:
        return False
    own = _by_short_name(label, motor, values)
    deviations = {} if sigma is None else _by_short_name(label, motor, sigma)
    of_corner, of_skin = (deviations.get(name, 0.0) / own[name] for name in ("corner_hz", "skin_hz"))
    return bool(np.log(within(own)) > UNSURE * np.hypot(of_corner, of_skin))


def _by_short_name(label: str, motor: Motor, values: Mapping[str, float]) -> dict[str, float]:
    """Those of one effect's parameters that are not held without a value."""
    return {p.short_name: values[p.name] for p in motor.parameters if p.name.rpartition(".")[0] == label and p.name in values}


def _is_unusual(parameter: Parameter, value: float, uncertainty: float) -> bool:
    # An effect that the data exclude is held at the values at which it vanishes.
    if parameter.usual is None or (parameter.scale == "log" and not value):
        return False
    low, high = parameter.usual
    if parameter.scale == "log":
        return bool(max(np.log(low / value), np.log(value / high)) > uncertainty / value)
    return max(low - value, value - high) > uncertainty


def candidate(fit: Fit, base: Fit) -> Candidate:
    """The candidate for a fit with more effects than `base`, with its score."""
    added = fit.effects[len(base.effects) :]
    bounds = at_bounds(fit, added)
    score = fit.log_evidence + prior_of_set(base, len(added)) + prior_of_effects(added) + prior_of_values(fit, added) - BOUND_PENALTY * len(bounds)
    before, after = base.unexplained_percent["value"], fit.unexplained_percent["value"]
    return Candidate(added, fit, float(score), bounds, min(1.0, after / before) if before else 0.0)


def prior_of_set(base: Fit, size: int) -> float:
    """Log prior of one set of so many effects."""
    return prior_of_size(size, len(possible_effects(base)))


def as_in_every_winding(one: Candidate, base: Fit) -> Candidate:
    """The same with the prior of a single effect, for losses of copper and insulation together: no coincidence, as every winding has both."""
    return dataclasses.replace(one, score=one.score + prior_of_set(base, 1) - prior_of_set(base, len(one.added)))


def prior_of_size(size: int, possible: int) -> float:
    """Log prior of one set of so many of the possible effects: sets of one size are equally likely."""
    return float(np.log(PRIOR_OF_SIZE[min(size, len(PRIOR_OF_SIZE) - 1)]) - np.log(comb(max(possible, size), size)))


def prior_of_effects(added: Sequence[str]) -> float:
    """Change of a set's log prior by effects that few motors have."""
    return float(np.sum(np.log([find_effect(name).effect.odds for name in added])))


def prior_of_values(fit: Fit, added: Sequence[str]) -> float:
    """Change of the log evidence by priors narrower than the parameter ranges."""
    labels = own_labels(fit.effects, added)
    gained = 0.0
    variances = np.diag(fit.covariance)
    for index, parameter in enumerate(fit.problem.unknowns):
        label = parameter.name.rpartition(".")[0]
        if label in labels and parameter.special is not None:
            gained += _simplest_form(fit, index, parameter, variances)
        if parameter.usual is not None and (label in labels or "." not in parameter.name):
            gained += _usual_size(fit, index, parameter, variances)
    effects = [find_effect(name).effect for name in added]
    # A scanned parameter has a uniform prior over the values tried, or over all frequencies.
    scanned = [
        len(effect.tried.get(p.name, ())) or np.unique(fit.problem.observed.frequency_hz).size
        for effect in effects
        for p in effect.parameters
        if not p.vary
    ]
    return gained - float(np.sum(np.log(scanned)))


def _simplest_form(fit: Fit, index: int, parameter: Parameter, variances: FloatArray) -> float:
    """Half of the prior lies on an effect's simplest form (a relaxation with one time constant).

    The ratio of posterior to prior density there is that form's Bayes factor against the free one (Savage and Dickey), so it needs no
    refit. Without it, a law would lose to its exact equivalent for no reason but one more parameter.
    """
    assert parameter.special is not None
    problem = fit.problem
    away = fit.unknowns[index] - problem.unknown(index, parameter.special)
    variance = max(float(variances[index]), 1e-18)
    factor = np.log((problem.high[index] - problem.low[index]) / np.sqrt(2 * np.pi * variance)) - 0.5 * away**2 / variance
    return float(np.logaddexp(0.0, factor) - np.log(2))


def _usual_size(fit: Fit, index: int, parameter: Parameter, variances: FloatArray) -> float:
    """Half of the prior is on the usual range: an effect that needs an element of unusual size, such as 1 uF to the core, becomes improbable."""
    assert parameter.usual is not None
    problem = fit.problem
    low, high = (problem.unknown(index, value) for value in parameter.usual)
    deviation = np.sqrt(max(float(variances[index]), 1e-18))
    inside = float(ndtr((high - fit.unknowns[index]) / deviation) - ndtr((low - fit.unknowns[index]) / deviation))
    return float(np.log(0.5 + 0.5 * inside * (problem.high[index] - problem.low[index]) / (high - low)))


def at_bounds(fit: Fit, added: Sequence[str]) -> tuple[str, ...]:
    """Parameters of effects that the data, not just the prior, push against a bound."""
    labels = own_labels(fit.effects, added)
    problem, u = fit.problem, fit.unknowns
    gradient = fit.linearised.gradient
    pushed = []
    for index, parameter in enumerate(problem.unknowns):
        if parameter.name.rpartition(".")[0] not in labels or parameter.sigma is not None:
            continue
        span = problem.high[index] - problem.low[index]
        edge = u[index] < problem.low[index] + 1e-6 * span or u[index] > problem.high[index] - 1e-6 * span
        # Moving a fifth of the range back into the middle would cost more than two units of chi-squared.
        if edge and abs(gradient[index]) * 0.2 * span > 1.0 and parameter.special is None and parameter.short_name not in _SOFT:
            pushed.append(parameter.name)
    return tuple(pushed)


def own_labels(effects: Sequence[str], added: Sequence[str]) -> set[str]:
    """Prefixes of the parameters of the effects that were added last."""
    labels = set()
    before = list(effects[: len(effects) - len(added)])
    for name in added:
        before.append(name)
        count = before.count(name)
        labels.add(name if count == 1 else f"{name}#{count}")
    return labels


def possible_effects(fit: Fit) -> list[str]:
    """Effects that could be missing from a fit, given its sweeps."""
    lowest = min(float(sweep.frequency_hz[0]) for sweep in fit.measurement.sweeps)
    return [name for name in identifiers() if _possible(fit, name, lowest) and seen_in(fit, name)]


def _possible(fit: Fit, name: str, lowest_hz: float) -> bool:
    added = find_effect(name)
    if added.effect.of_ranges and fit.measurement.analyser.by_waves:
        return False
    if not set(added.effect.needs) <= set(fit.measurement.terminations):
        return False
    if not (added.fits(fit.motor) and added.differs_in(fit.motor)):
        return False
    return not added.effect.describes and lowest_hz <= added.effect.below_hz


def seen_in(fit: Fit, effect: str) -> frozenset[str]:
    """Terminations of the sweeps in which an effect, added to a fit, is visible."""
    motor, label = find_effect(effect).added_to(fit.motor), find_effect(effect).label_in(fit.motor)
    return frozenset(t for t in fit.measurement.terminations if any(name.startswith(f"{label}.") for name in motor.used_parameters(t)))
