"""Likelihood of new data under a model fitted to the earlier sweeps, by Laplace's method around the most likely unknowns.

Integrated over are the model's parameters (`known`), the response numbers, the analyser's errors, and what no model describes of the change
(`system`), whose size is summed over; the most likely ones are found by `likeliest`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import inf
from weakref import WeakKeyDictionary

import numpy as np
from scipy.special import logsumexp

from motoremi.arrays import FloatArray
from motoremi.fitting.integrated import valley
from motoremi.fitting.result import Fit
from motoremi.fitting.search import PLAIN
from motoremi.investigation.known import Known
from motoremi.investigation.likeliest import after, best_from, best_near
from motoremi.investigation.system import Point, Prediction, Smooth, System, Whitening

# Relative size of what no model describes of a change -> prior. The least is what a motor repeats to. An assumption; unconfirmed.
UNDESCRIBED = {5e-4: 0.45, 2e-3: 0.3, 8e-3: 0.17, 3e-2: 0.08}
# The same in a circuit or over a span in which the model was not fitted.
UNDESCRIBED_ELSEWHERE = {5e-4: 0.2, 2e-3: 0.22, 8e-3: 0.22, 3e-2: 0.2, 0.1: 0.12, 0.4: 0.04}
# The same for an effect outside the catalogue, if the condition changes the motor itself: half of them respond like
# any other motor.
UNDESCRIBED_OUTSIDE = {5e-4: 0.23, 2e-3: 0.2, 8e-3: 0.2, 3e-2: 0.17, 0.1: 0.13, 0.4: 0.07}
# Share of their prior width by which elements, and parameters of effects, change without a predicted response -> prior. It is one number for all
# elements and one for all effects: otherwise a model with many parameters, none of which changed, would be penalised for each. An assumption;
# unconfirmed.
UNPREDICTED = {0.01: 0.4, 0.1: 0.3, 1.0: 0.3}
# The same for an effect outside the catalogue: it may change the elements that describe it by more than any element of a motor. An assumption;
# unconfirmed.
UNPREDICTED_OUTSIDE = {0.01: 0.3, 0.1: 0.25, 1.0: 0.25, 10.0: 0.2}
# Where the search for the best ends: at a size in the middle.
MIDDLE = 2e-3
# White noise that is added at first and reduced in stages: probable responses are then found before every point is fitted.
BLURS = (0.3, 0.03, 0.0)
# An explanation that is less likely than another one by so much, in log odds, is not refined: doubt about responses (`rivals.DOUBT_ELSEWHERE`, 6)
# and the largest distance of two explanations before (`rivals.BEHIND`, 12) make up for 18 at most.
HOPELESS = 50.0


@dataclass(frozen=True, eq=False)
class Weighed:
    """The result of new data for one model.

    Parameters
    ----------
    log_likelihood : float
        Of the data, all unknowns integrated over; comparable among models, and among explanations of the same sweeps.
    known : Known
        Distribution of the model's own unknowns afterwards.
    unchanged : float
        Probability that the data show the motor as it was.
    """

    log_likelihood: float
    known: Known
    unchanged: float = 0.0


def weigh(
    prediction: Prediction,
    known: Known,
    sizes: dict[float, float] | None = None,
    unpredicted: dict[float, float] | None = None,
    least: float = -inf,
) -> Weighed:
    """The likelihood of data under one prediction.

    Parameters
    ----------
    prediction : Outcome or ValueOutcome
    known : Known
        Distribution of the model's unknowns before these data.
    sizes : dict, optional
        Sizes of what no model describes -> prior.
    unpredicted : dict, optional
        Shares of their prior width by which elements and parameters change without a predicted response -> prior.
    least : float
        Log likelihood of another explanation of the same data. If this one is certainly less likely by `HOPELESS`, the search ends early, and the
        result is an upper bound, from which nothing is learnt.
    """
    sizes, unpredicted = sizes or UNDESCRIBED, unpredicted or UNPREDICTED
    # Of a change the unknowns that do not respond stay, in a linear model.
    whole, known = known, known if prediction.moving.all() else known.normal
    # First with the largest size, then with a typical one: with the latter alone, a resonance that moved by more than its width is not found.
    largest, in_the_middle = (max(sizes), 1.0, 1.0), (min(sizes, key=lambda size: abs(np.log(size / MIDDLE))), 1.0, 1.0)
    here = Point.of(prediction, known.centre, np.zeros(prediction.size))
    whitenings = [Whitening(prediction, blur) for blur in BLURS]
    noise = prediction.density + whitenings[-1].log_density
    elements, effects = (unpredicted if np.any(prediction.unpredicted == kind) else {1.0: 1.0} for kind in (1, 2))
    widest = (max(sizes), max(elements), max(effects))
    for white in whitenings:
        smooth = Smooth.of(white(prediction.smooth))
        best = best_near(System(prediction, known, here, white, smooth), largest)
        # Without the blur, with any other sizes, and integrated over the unknowns, it is less.
        bound = noise - 0.5 * best.cost(widest)
        if bound < least - HOPELESS:
            return Weighed(bound, whole)
        here = best.here
    best = best_near(best, in_the_middle)
    if prediction.elsewhere and known.sweeps is not None:
        # The least known parameter may have to move far along a valley.
        best = best_from(_valley(known.sweeps.fit), best, in_the_middle)
        if best.likeliest([(size, 1.0, 1.0) for size in sizes])[0] >= PLAIN:
            # It misses by per cents: a resonance that the sweeps at hand do not show may be in the wrong place.
            others = known.sweeps.fit.unknowns + known.sweeps.fit.alternatives
            best = best_from(others, best, in_the_middle)
    priors = {
        (size, *widths): float(np.log(prior * elements[widths[0]] * effects[widths[1]]))
        for size, prior in sizes.items()
        for widths in product(elements, effects)
    }
    scales, log_priors = list(priors), np.array(list(priors.values()))
    best = best_near(best, best.likeliest(scales, log_priors))
    logs = noise + best.log_integrals(scales) + log_priors
    return Weighed(float(logsumexp(logs)), after(whole, best.learnt(scales[int(np.argmax(logs))]), prediction.moving))


def _valley(fit: Fit) -> FloatArray:
    if fit not in _VALLEYS:
        _VALLEYS[fit] = valley(fit)
    return _VALLEYS[fit]


# Each takes tenths of a second and is asked for at every measurement of another span or circuit.
_VALLEYS: WeakKeyDictionary[Fit, FloatArray] = WeakKeyDictionary()


def anything(prediction: Prediction, known: Known, sizes: Sequence[float]) -> float:
    """Log likelihood of data that depart from a prediction at each point by itself, by one of these sizes: from what is no law at all.

    Without it, what no smooth departure describes would be put down to the least wrong explanation.
    """
    mean, _, _ = prediction.at(known.centre, np.zeros(prediction.size))
    squares = prediction.residual(mean) ** 2
    variance = prediction.sigma**2 + np.array(sizes)[:, None] ** 2
    logs = -0.5 * np.sum(np.log(2 * np.pi * variance) + squares / variance, axis=1)
    return prediction.density + float(logsumexp(logs) - np.log(len(sizes)))


def mixed(cases: Sequence[tuple[float, Weighed]]) -> Weighed:
    """The result if one of several cases, each with its probability, is true: the likelihood of all, and the unknowns of the most probable one."""
    logs = np.array([np.log(share) + case.log_likelihood for share, case in cases])
    total = float(logsumexp(logs))
    unchanged = float(np.exp(logs - total) @ [case.unchanged for _, case in cases])
    return replace(cases[int(np.argmax(logs))][1], log_likelihood=total, unchanged=unchanged)
