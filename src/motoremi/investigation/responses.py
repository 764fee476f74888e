"""What a condition changes in a model: response parameters with priors, each a standard normal number until something is measured.

Known physics is tight (copper's temperature coefficient), the rest wide: a response that an effect names is known within a factor of two and
may be absent; elements and effects without a named response change by what `menu` states, at least by the repeatability of a motor.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from motoremi.arrays import FloatArray, IntArray
from motoremi.data.conditions import Condition
from motoremi.investigation.menu import BY_NAME, REPEATABILITY, UNREACHED, Moved, Option
from motoremi.model.effects import find_effect
from motoremi.model.motor import BASE_PARAMETERS

# Of copper and nearly of aluminium, per kelvin at 20 degC (IEC 60028).
COPPER_PER_K = 3.93e-3
# Assumed room temperature if it is not stated, and uncertainty of the winding's temperature; degC and K.
ROOM_DEGC, ROOM_SIGMA_K = 23.0, 3.0
# The menu's responses to warmth are for so many kelvin.
WARMED_BY_K = 30.0
# A response is known within this factor.
RESPONSE_FACTOR = 2.0
# Probability that an effect does not respond as the catalogue says. An assumption; unconfirmed.
NONE_AT_ALL = 0.1
# What "gone" leaves.
GONE = 0.05


@dataclass(frozen=True)
class Response:
    """How a parameter of the model moves with response numbers eta.

    Parameters
    ----------
    parameter : str
    mean : float
        Of the logarithm of its factor.
    sigma : float
        Logarithm of the factor = mean + sigma * eta; for `listed` with a mean, mean * exp(sigma * eta): its sign is known, its size within a
        factor.
    number : int
        Which eta.
    listed : bool
    unpredicted : int
        For a response that is not predicted, all of a measurement share one size: 1 of an element, 2 of an effect; 0 for a predicted one.
    """

    parameter: str
    mean: float
    sigma: float
    number: int
    listed: bool = False
    unpredicted: int = 0

    @property
    def label(self) -> str:
        """Label of the effect that the parameter belongs to; empty for an element."""
        return self.parameter.rpartition(".")[0]

    def logarithm(self, eta: FloatArray) -> tuple[float, float]:
        """Of the factor, and its derivative for eta."""
        own = float(eta[self.number])
        if not self.listed or not self.mean:
            return self.mean + self.sigma * own, self.sigma
        value = self.mean * math.exp(self.sigma * min(own, 5.0))
        return value, value * self.sigma


@dataclass(frozen=True)
class Responses:
    """All changes of one model by a condition.

    Parameters
    ----------
    members : tuple of Response
    size : int
        How many numbers eta.
    """

    members: tuple[Response, ...]
    size: int

    @property
    def unpredicted(self) -> IntArray:
        """Which response numbers belong to changes that cannot be predicted, shape (size,): `Response.unpredicted` of each."""
        found = np.zeros(self.size, dtype=np.intp)
        for one in self.members:
            found[one.number] = one.unpredicted
        return found

    @property
    def typical(self) -> FloatArray:
        """Response numbers of a typical response, shape (size,): zero, and one where the sign is not known."""
        found = np.zeros(self.size)
        for one in self.members:
            found[one.number] = one.listed and not one.mean
        return found

    @property
    def answering(self) -> tuple[str, ...]:
        """Labels of the effects with a stated response."""
        return tuple(dict.fromkeys(one.label for one in self.members if one.listed))

    def without(self, silent: Collection[str]) -> Responses:
        """The same without the stated responses of these effects."""
        return Responses(tuple(one for one in self.members if not (one.listed and one.label in silent)), self.size)


def responses(condition: Condition, parameters: Sequence[str], option: Option | None = None) -> Responses:
    """What a condition changes in a model with these parameters (`La`, `eddy-laminations.corner_hz`); errors of the analyser are none of it."""
    option = option or BY_NAME[condition.id]
    warmed_k = (condition.value or 0.0) - ROOM_DEGC if condition.id == "second-temperature" else None
    strength = 1.0 if warmed_k is None else warmed_k / WARMED_BY_K
    # A part of known size is in the circuit: no other part has to respond.
    known = option.name in ("longer-lead", "longer-strap", "known-capacitor") and condition.value is not None
    elements = {parameter.name for parameter in BASE_PARAMETERS}
    members: list[Response] = []
    # Number 0 is the winding's true warmth, shared by all its copper.
    count = 1
    for name in parameters:
        label, _, short = name.rpartition(".")
        power = _copper(label, short) if warmed_k is not None else None
        if power is not None and warmed_k is not None:
            share = math.log1p(COPPER_PER_K * warmed_k / (1 + COPPER_PER_K * (ROOM_DEGC - 20)))
            doubt = ROOM_SIGMA_K * COPPER_PER_K
            members.append(Response(name, power * share, power * doubt, 0))
        if name in elements:
            moved = option.elements.get(name, Moved(0.0, 0.0)) if power is None else Moved(0.0, 0.0)
            members.append(
                Response(name, moved.mean * strength, math.hypot(moved.sigma * strength, REPEATABILITY), count, unpredicted=int(not moved.mean))
            )
            count += 1
        elif label and short not in _shapes(label):
            effect = find_effect(label.split("#")[0]).effect
            factor = None if known else effect.responds.get(option.name, {}).get(short)
            if factor is not None and power is None:
                size = math.log(max(factor, GONE)) * strength
                mean, sigma = (0.0, size) if option.either_way else (size, math.log(RESPONSE_FACTOR))
                members.append(Response(name, mean, sigma, count, listed=True))
                count += 1
            reached = factor is None and effect.group in option.reaches
            members.append(Response(name, 0.0, option.others if reached else UNREACHED, count, unpredicted=2))
            count += 1
    return Responses(tuple(members), count)


def ways(answering: Sequence[str]) -> list[tuple[float, tuple[str, ...]]]:
    """Which of these effects do not respond, each case with its probability; first none of them, last all.

    Each by itself: of two effects one may respond to warmth and the other not.
    """
    cases = [silent for size in range(len(answering) + 1) for silent in combinations(answering, size)]
    return [(NONE_AT_ALL ** len(silent) * (1 - NONE_AT_ALL) ** (len(answering) - len(silent)), silent) for silent in cases]


def _shapes(label: str) -> set[str]:
    """Pure numbers that give a law its shape and have a simplest value: no property of a part that a condition would move."""
    return {
        parameter.name for parameter in find_effect(label.split("#")[0]).effect.parameters if not parameter.unit and parameter.special is not None
    }


def _copper(label: str, short: str) -> float | None:
    """Power of the copper's resistivity that a parameter follows; None for what is not copper."""
    if not label:
        return 1.0 if short == "Ra" else None
    return find_effect(label.split("#")[0]).effect.copper.get(short)


def factors(found: Responses, eta: FloatArray, names: Sequence[str]) -> tuple[FloatArray, FloatArray]:
    """Factor on each parameter, shape (p,), and the derivative of its logarithm for each eta, shape (q, p)."""
    place = {name: index for index, name in enumerate(names)}
    logarithms, slopes = np.zeros(len(names)), np.zeros((found.size, len(names)))
    for one in found.members:
        if (at := place.get(one.parameter)) is not None:
            value, slope = one.logarithm(eta)
            logarithms[at] += value
            slopes[one.number, at] += slope
    return np.exp(logarithms), slopes
