"""Policies for the choice of the next measurement: that of this software, others for comparison, and one that knows the truth."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from motoremi.arrays import JsonDict
from motoremi.blind.scoring import Answer
from motoremi.blind.sealed import Asked
from motoremi.data.conditions import VALUES
from motoremi.errors import BadInput
from motoremi.workflow_investigate import request_of

# Fixed order of an experienced engineer without a model: first measurements that are free or complete the data, then the instrument, then what
# needs no tools, then what needs tools, then heat and disassembly.
EXPERT = (
    "open-sweep", "short-sweep", "repeat-compensation", "repeats", "dc-resistance", "insulation-resistance", "wide-sweep", "far-end-grounded",
    "contacts-cleaned", "repeat-first-sweep", "sweep-downwards", "fixture-short", "fixture-open", "fixture-load", "standards", "shaft-turned",
    "longer-lead", "longer-strap", "terminal-block", "end-turn-touched", "known-capacitor", "field-winding", "dc-bias", "second-temperature",
    "brushes-lifted", "dried", "rotor-out",
)  # fmt: skip
# The order of the menu.
FIXED = (
    "short-sweep", "open-sweep", "wide-sweep", "far-end-grounded", "dc-resistance", "insulation-resistance", "repeat-first-sweep",
    "sweep-downwards", "shaft-turned", "contacts-cleaned", "field-winding", "standards", "repeat-compensation", "longer-lead", "longer-strap",
    "terminal-block", "end-turn-touched", "dc-bias", "second-temperature", "dried", "repeats", "known-capacitor", "brushes-lifted", "rotor-out",
    "fixture-open", "fixture-short", "fixture-load",
)  # fmt: skip
# Number of the cheapest measurements among which the policy that knows the truth chooses.
TRIED = 8
_HALF = 0.5


@dataclass(frozen=True)
class Offer:
    """A possible next measurement.

    Parameters
    ----------
    asked : Asked
    minutes, bits : float
        Its time, and its expected information.
    """

    asked: Asked
    minutes: float
    bits: float

    @property
    def id(self) -> str:
        """Identifier on the menu."""
        return self.asked.id

    @classmethod
    def of(cls, entry: JsonDict) -> Offer:
        """From an entry of `motoremi next --json`."""
        request = request_of(entry)
        terminations = () if entry["id"] in VALUES else request.terminations
        return cls(Asked(request.id, request.condition, terminations), float(entry["minutes"]), float(entry["information_bits"]))


@dataclass(frozen=True)
class Assessment:
    """The assessment of the evidence so far.

    Parameters
    ----------
    probabilities : dict
        Probability of each explanation by its label.
    offers : tuple of Offer
        Possible next measurements, this software's choice first.
    stop : str
        Reason to stop; empty if there is a useful next measurement.
    mistaken : tuple of str
        Measurements that were probably not done as requested.
    conclude : callable
        Returns the final answer.
    seconds : float
        Time to compute the probabilities and to choose.
    search_seconds : float
        Time of the search for explanations, if the reference sweeps were new.
    without : callable, optional
        Returns the same with the question asked again without some measurements of the menu.
    """

    probabilities: Mapping[str, float]
    offers: tuple[Offer, ...]
    conclude: Callable[[], Answer]
    stop: str = ""
    mistaken: tuple[str, ...] = ()
    seconds: float = 0.0
    search_seconds: float = 0.0
    without: Callable[[tuple[str, ...]], Assessment] | None = None

    def within(self, left_minutes: float) -> Assessment:
        """As `motoremi investigate`: what takes longer than the time left is not requested; if only that would tell more, the budget is spent."""
        now, too_long = self, list[str]()
        while self.without is not None and not now.stop and now.offers and now.offers[0].minutes > left_minutes:
            too_long.append(now.offers[0].id)
            now = self.without(tuple(too_long))
        return replace(now, stop="budget") if too_long and (now.stop or not now.offers) else now


# The assessment after a measurement; used only by the policy that knows the truth.
Look: TypeAlias = Callable[[Offer], Assessment]
# (assessment, look-ahead, truth, random stream) -> next measurement
Policy: TypeAlias = Callable[[Assessment, Look, tuple[str, ...], np.random.Generator], Offer]


def _by_rate(assessment: Assessment, look: Look, truth: tuple[str, ...], rng: np.random.Generator) -> Offer:
    return assessment.offers[0]


def _by_bits(assessment: Assessment, look: Look, truth: tuple[str, ...], rng: np.random.Generator) -> Offer:
    return max(assessment.offers, key=lambda offer: offer.bits)


def _cheapest(assessment: Assessment, look: Look, truth: tuple[str, ...], rng: np.random.Generator) -> Offer:
    return min(assessment.offers, key=lambda offer: offer.minutes)


def _random(assessment: Assessment, look: Look, truth: tuple[str, ...], rng: np.random.Generator) -> Offer:
    return assessment.offers[int(rng.integers(len(assessment.offers)))]


def _in_order(order: tuple[str, ...]) -> Policy:
    def choose(assessment: Assessment, look: Look, truth: tuple[str, ...], rng: np.random.Generator) -> Offer:
        return min(assessment.offers, key=lambda offer: order.index(offer.id) if offer.id in order else len(order))

    return choose


def _clairvoyant(assessment: Assessment, look: Look, truth: tuple[str, ...], rng: np.random.Generator) -> Offer:
    """The cheapest measurement after which the truth is the only explanation; otherwise the one that most increases its probability per minute."""
    label = " + ".join(sorted(truth))
    best: tuple[float, Offer] | None = None
    for offer in sorted(assessment.offers, key=lambda one: one.minutes)[:TRIED]:
        after = look(offer)
        if after.stop == "one-stands" and _share(after, label) > _HALF:
            return offer
        gain = (_share(after, label) - _share(assessment, label)) / offer.minutes
        if best is None or gain > best[0]:
            best = (gain, offer)
    if best is None:
        raise BadInput("nothing is left to choose from")
    return best[1]


def _share(assessment: Assessment, label: str) -> float:
    return max((share for name, share in assessment.probabilities.items() if " + ".join(sorted(name.split(" + "))) == label), default=0.0)


# The policy of this software.
OWN_POLICY = "information per minute"
POLICIES: Mapping[str, Policy] = {
    OWN_POLICY: _by_rate,
    "information alone": _by_bits,
    "frozen expert": _in_order(EXPERT),
    "cheapest first": _cheapest,
    "fixed order": _in_order(FIXED),
    "random": _random,
    "clairvoyant": _clairvoyant,
}
