"""The measurement with the most expected information about the remaining explanations per minute at the bench.

The expected information is the mutual information between explanation and outcome. Under each explanation the outcome is normal, its
mean and covariance linear in all that is not known: the model's own parameters, the responses, the analyser's errors, noise, and what no model
describes; with the responses that effects name, and without. The information in bits follows from draws of outcomes under each explanation.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, product
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import logsumexp

from motoremi.arrays import FloatArray, JsonDict
from motoremi.data.conditions import VALUES, SingleValue
from motoremi.data.measurement import Measurement
from motoremi.data.mislabelled import measured_twice
from motoremi.investigation.conditioned import POINTS_AHEAD, ahead, asked_condition
from motoremi.investigation.menu import BY_NAME, MENU, SWEEP_MINUTES, Option
from motoremi.investigation.outcome import Outcome, ValueOutcome
from motoremi.investigation.responses import ways
from motoremi.investigation.rivals import OUTSIDE, Rival, Rivals
from motoremi.investigation.system import Prediction
from motoremi.quantities import show
from motoremi.threads import one_blas_thread
from motoremi.workers import Map

Stop: TypeAlias = Literal["one-stands", "inseparable", "nothing-missing"]

# The investigation stops when one explanation is this many times as likely as all others together.
ODDS = 20.0
# Probability of an effect outside the catalogue if no effect describes the reference sweeps (an answer `unexplained` was true in 47 of 50 cases):
# enough to stop, since no measurement under another condition makes one of them describe these sweeps.
NONE_DESCRIBES = 0.9
_UNKNOWN = (
    f"{OUTSIDE} is left: no one or two effects of the catalogue describe the sweeps, so a measurement under another condition would not find them; "
    "repeat both sweeps, look where the model fails (motoremi inspect), or add an effect of your own (docs/howto/own-effect.md)"
)
# Largest number of explanations that are considered, and smallest probability of one.
MOST_ASKED, LEAST_ASKED = 6, 2e-3
# A measurement with less information (bits) than the first is useless; if all have less than the second, pairs of measurements are considered.
NOTHING_BITS, LITTLE_BITS = 0.03, 0.1
# Size of what no model describes of a change; in another circuit or span; and for a motor that no model describes, each with its share.
# Of a value, as a logarithm.
AHEAD = {2e-3: 1.0}
AHEAD_ELSEWHERE = {2e-3: 0.5, 3e-2: 0.5}
AHEAD_OUTSIDE = {2e-3: 0.5, 8e-3: 0.2, 0.06: 0.3}
OF_VALUE, OF_VALUE_OUTSIDE = {1e-6: 1.0}, {1e-6: 0.5, 0.3: 0.3, 1.5: 0.2}
# As `weighing.UNPREDICTED`, coarser: of changes that reach the effects, and of the others.
MOVED_AHEAD, MOVED_AHEAD_BESIDE = {0.05: 0.6, 1.0: 0.4}, {0.1: 1.0}
# Draws of the outcome under each explanation.
DRAWS = 40
# Number of measurements, those with the most information alone, of which pairs are considered.
PAIRED = 5
POINTS_OF_A_PAIR, POINTS_LISTED = 20, 14
# Number of measurements that are sent to another process together, a quarter of the menu: what they have in common is computed there once.
TOGETHER = 6
# A sweep that was measured with the other termination is requested so many times; then both terminations of this motor are the same.
SAME_AGAIN = 2
# An open direction of a model moves its prediction by no more than so many standard deviations of logarithms.
OPEN = 2.0
# Expected log odds with which two explanations count as distinguished: 20 to 1.
APART = 3.0


@dataclass(frozen=True)
class Worth:
    """The expected information of one measurement of the menu.

    Parameters
    ----------
    option : Option
    bits : float
    minutes : float
    separates : tuple of tuple of str
        Groups of explanations that the outcome would distinguish, by label.
    farthest : float
        Expected log odds of the pair that it distinguishes best.
    then : str
        A second measurement, if only both together give information.
    """

    option: Option
    bits: float
    minutes: float
    separates: tuple[tuple[str, ...], ...] = ()
    farthest: float = 0.0
    then: str = ""

    @property
    def rate(self) -> float:
        """Bits a minute."""
        return self.bits / self.minutes

    def asks(self) -> JsonDict:
        """The measurement in detail: key `asks` of `motoremi.next/2`."""
        option = self.option
        if option.kind == "value":
            return {
                "kind": "value",
                "termination": None,
                "condition": option.name,
                "value": None,
                "unit": VALUES[option.name].setting.unit,
                "instruction": option.action,
            }
        condition = asked_condition(option)
        kind = "standard" if option.kind == "standard" else "sweep"
        termination = option.sweeps[0] if len(option.sweeps) == 1 else "both"
        what = None if option.kind == "reference" else QUANTITY.get(option.name, option.name)
        return {
            "kind": kind,
            "termination": termination,
            "condition": what,
            "value": condition.value,
            "unit": condition.unit or None,
            "instruction": option.action,
        }

    def to_dict(self) -> JsonDict:
        """Plain data."""
        found: JsonDict = {
            "id": self.option.name,
            "condition_id": self.option.name if self.option.kind in ("sweep", "change", "standard") else None,
            "asks": self.asks(),
            "minutes": self.minutes,
            "information_bits": self.bits,
            "separates": [list(group) for group in self.separates],
        }
        return {**found, "then": self.then} if self.then else found


# The quantity that is set up, if it is not the menu's name.
QUANTITY: Mapping[str, str] = {"second-temperature": "temperature", "dc-bias": "current"}


NOTHING_ASKED: JsonDict = {"id": None, "condition_id": None, "asks": None, "minutes": 0.0, "information_bits": 0.0, "separates": []}


@dataclass(frozen=True)
class Question:
    """The next measurement, or the reason to stop.

    Parameters
    ----------
    worths : tuple of Worth
        All that can still be measured, the best first.
    stop : str or None
    why : str
    """

    worths: tuple[Worth, ...]
    stop: Stop | None
    why: str
    standing: Mapping[str, float] = field(default_factory=dict)

    @property
    def asked(self) -> Worth | None:
        """The measurement to make; None if none is requested."""
        return None if self.stop is not None or not self.worths else self.worths[0]

    @property
    def outside_stands(self) -> bool:
        """Whether it stops because the explanation outside the catalogue is the most probable one."""
        return self.stop == "one-stands" and next(iter(self.standing), "") == OUTSIDE

    def to_dict(self) -> JsonDict:
        """Plain data in the schema `motoremi.next/2`."""
        asked = self.asked
        content = NOTHING_ASKED if asked is None else asked.to_dict()
        others = [one for one in self.worths if one is not asked]
        return {
            "schema": "motoremi.next/2",
            **content,
            "why": self.why,
            "alternatives": [one.to_dict() for one in others],
            "probabilities": dict(self.standing),
            "stop": self.stop,
        }


@one_blas_thread
def next_question(
    rivals: Rivals,
    measurement: Measurement,
    without: Iterable[str] = (),
    odds: float = ODDS,
    sweep_minutes: float = SWEEP_MINUTES,
    each: Map = map,
) -> Question:
    """The measurement with the most expected information per minute.

    Parameters
    ----------
    rivals : Rivals
        After all data so far (`rivals.update`).
    measurement : Measurement
        The data so far; what is measured already is not requested again.
    without : iterable of str
        Measurements that this bench cannot do, or that somebody refused.
    odds : float
        At which one explanation counts as the only one left.
    sweep_minutes : float
        Duration of one sweep.
    each : callable
        Like the built-in `map`; computes the information of several measurements.

    Returns
    -------
    Question
    """
    needed = _needed(measurement)
    left_out = {*without, *measurement.done}
    possible = [option for option in MENU if option.name not in left_out and option.kind != "reference"]
    standing = _asked_about(rivals)
    labels = rivals.by_label
    best = max(rivals.members, key=lambda one: one.log_weight)
    share = rivals.probabilities[best.key]
    stands = share >= odds / (1 + odds)
    # If one explanation is left, the remaining measurements are only listed.
    points = POINTS_LISTED if stands else POINTS_AHEAD
    predicted = [option for option in possible if option.predicted]
    parts = [predicted[at : at + TOGETHER] for at in range(0, len(predicted), TOGETHER)]
    jobs = [(options, standing, measurement, sweep_minutes, points) for options in parts]
    worths = [one for found in each(_worths, jobs) for one in found]
    ranked = sorted((one for one in worths if one is not None), key=_order, reverse=True)
    # The information of these is not predicted.
    unpredicted = [BY_NAME["repeats"], *(option for option in possible if not option.predicted)]
    ranked += [Worth(option, 0.0, _minutes(option, sweep_minutes)) for option in unpredicted if option.name not in left_out]
    if needed is not None and needed[0].name not in left_out:
        option, because = needed
        first = Worth(option, _bits(weight for _, weight in standing) / 2, _minutes(option, sweep_minutes))
        return Question((first, *ranked), None, f"{option.action}: {because}", labels)
    if stands:
        if not best.key:
            return Question(tuple(ranked), "nothing-missing", "nothing is missing that these data could show", labels)
        if best.imitated_by:
            return Question(tuple(ranked), "inseparable", _imitated(best), labels)
        return Question(tuple(ranked), "one-stands", f"{best.label} is the explanation left, with a probability of {share:.2g}", labels)
    if best.outside and share >= NONE_DESCRIBES - 1e-9 and not rivals.taught and measurement.analyser.fixture is None:
        return Question(tuple(ranked), "one-stands", _UNKNOWN, labels)
    if not ranked or max(one.bits for one in ranked) < LITTLE_BITS:
        ranked = _with_pairs(ranked, standing, measurement, sweep_minutes)
    needed_bits = _bits(labels.values()) - _bits_at(odds)
    if not ranked or max(one.bits for one in ranked) < NOTHING_BITS or _all_together(ranked) < needed_bits:
        return Question(tuple(ranked), "inseparable", _proof(ranked, standing, needed_bits), labels)
    return Question(tuple(ranked), None, _why(ranked[0], labels), labels)


def _order(worth: Worth) -> tuple[bool, float]:
    """Sort key: bits per minute."""
    teaches = worth.bits >= NOTHING_BITS
    return teaches, worth.rate if teaches else worth.bits


def _needed(measurement: Measurement) -> tuple[Option, str] | None:
    """A reference sweep that is missing, or is the other one again, and why it is needed."""
    if len(measurement.sweeps) < 2:
        return BY_NAME["open-sweep" if measurement.terminations == ("short",) else "short-sweep"], "one sweep cannot locate an effect"
    twice = measured_twice(measurement.sweeps, measurement.floors)
    repeats = [sweep.repeats for sweep in measurement.sweeps]
    if twice is None or max(repeats) >= min(repeats) + SAME_AGAIN:
        return None
    return BY_NAME[f"{twice.wrong}-sweep"], "the sweeps of both terminations are the same: one of them may have been measured twice"


def _asked_about(rivals: Rivals) -> list[tuple[Rival, float]]:
    """The most probable explanations with probabilities that sum to one; the one outside the catalogue is always included.

    What is known of their unknowns is taken as normal: outcomes are predicted so, and it can be sent to another process.
    """
    ranked = sorted(rivals.members, key=lambda one: -one.log_weight)
    kept = [one for one in ranked if rivals.probabilities[one.key] >= LEAST_ASKED][:MOST_ASKED]
    kept += [one for one in ranked if one.outside and one not in kept]
    weights = np.array([max(rivals.probabilities[one.key], LEAST_ASKED) for one in kept])
    normal = [replace(one, known=one.known.normal) for one in kept]
    return [(one, float(weight)) for one, weight in zip(normal, weights / weights.sum(), strict=True)]


def _minutes(option: Option, sweep_minutes: float) -> float:
    return option.minutes + sweep_minutes * len(option.sweeps) * (2 if option.name == "repeats" else 1)


def _bits(probabilities: Iterable[float]) -> float:
    """Entropy of the probabilities, in bits."""
    return float(-sum(p * np.log2(p) for p in probabilities if p > 0))


def _all_together(ranked: Sequence[Worth]) -> float:
    """Upper bound of the information of all remaining measurements together: their sum, because outcomes are independent given the explanation."""
    return sum(one.bits for one in ranked)


def _bits_at(odds: float) -> float:
    """Entropy, in bits, of two explanations with these odds."""
    share = odds / (1 + odds)
    return _bits((share, 1 - share))


@dataclass(frozen=True, eq=False)
class _Component:
    """A normal distribution of outcomes: share, mean, and square root of the covariance (lower triangle)."""

    log_share: float
    mean: FloatArray
    root: FloatArray

    @property
    def log_scale(self) -> float:
        return -float(np.sum(np.log(np.diag(self.root)))) - 0.5 * self.mean.size * float(np.log(2 * np.pi))

    def log_density(self, outcomes: FloatArray) -> FloatArray:
        white = solve_triangular(self.root, (outcomes - self.mean).T, lower=True, check_finite=False)
        return self.log_scale + self.log_share - 0.5 * np.sum(white**2, axis=0)


def _predictions(option: Option, rival: Rival, measurement: Measurement, points: int) -> list[tuple[float, Prediction]]:
    """Predictions of one explanation, with the probability of each kind of response."""
    if option.kind == "value":
        guess = ValueOutcome(rival.fit, _value(option, rival))
        return [(1.0, guess)] if guess.known else []
    sweeps = ahead(option, measurement, points)
    if not sweeps:
        return []
    if rival.outside and option.reaches_motor:
        return [(1.0, Outcome(rival.fit, sweeps, None, option))]
    if rival.outside and option.kind == "standard":
        return [(0.5, Outcome(rival.fit, sweeps, option=option)), (0.5, Outcome(rival.fit, sweeps, option=option, sound=True))]
    answering = Outcome(rival.fit, sweeps, option=option).answering
    return [(share, Outcome(rival.fit, sweeps, silent, option)) for share, silent in ways(answering)]


def _value(option: Option, rival: Rival) -> SingleValue:
    quantity = VALUES[option.name]
    return SingleValue(option.name, 1.0, quantity.setting.unit, quantity.relative)


class _Predicted(NamedTuple):
    """One way in which a measurement may come out: its share, mean, derivatives for the model's own unknowns, other columns, white noise."""

    share: float
    mean: FloatArray
    own: FloatArray
    columns: FloatArray
    sigma: FloatArray


def _predicted(option: Option, rival: Rival, measurement: Measurement, points: int) -> list[_Predicted]:
    widths = MOVED_AHEAD if option.reaches else MOVED_AHEAD_BESIDE
    found = []
    for share, prediction in _predictions(option, rival, measurement, points):
        if option.kind == "value":
            sizes = OF_VALUE_OUTSIDE if rival.outside else OF_VALUE
        elif rival.outside and option.reaches_motor:
            sizes = AHEAD_OUTSIDE
        else:
            sizes = AHEAD_ELSEWHERE if prediction.elsewhere else AHEAD
        mean, own, by_eta = prediction.at(rival.known.centre, np.zeros(prediction.size))
        for (size, part), (width, likely) in product(sizes.items(), widths.items()):
            answers = by_eta * np.where(prediction.unpredicted == 2, width, 1.0)[:, None]
            columns = np.concatenate([answers, prediction.errors, size * prediction.smooth])
            found.append(_Predicted(share * part * likely, mean, own, columns, prediction.sigma))
    return found


def _distributions(options: Sequence[Option], rival: Rival, measurement: Measurement, points: int) -> list[_Component]:
    """The outcomes of measurements that are made one after the other: the model's own unknowns are the same in all of them."""
    parts = [_predicted(option, rival, measurement, points) for option in options]
    if not all(parts):
        return []
    precision = rival.known.precision + np.eye(rival.known.centre.size) / OPEN**2
    half = np.linalg.inv(np.linalg.cholesky(precision))
    found = []
    for chosen in product(*parts):
        own = half @ np.concatenate([one.own for one in chosen], axis=1)
        covariance = own.T @ own + np.diag(np.concatenate([one.sigma for one in chosen]) ** 2)
        start = 0
        for one in chosen:
            inside = slice(start, start + one.mean.size)
            covariance[inside, inside] += one.columns.T @ one.columns
            start = inside.stop
        root = np.linalg.cholesky(covariance + 1e-12 * np.diag(np.diag(covariance)))
        share = float(np.prod([one.share for one in chosen]))
        found.append(_Component(float(np.log(share)), np.concatenate([one.mean for one in chosen]), root))
    return found


@one_blas_thread
def _worths(job: tuple[Sequence[Option], Sequence[tuple[Rival, float]], Measurement, float, int]) -> list[Worth | None]:
    """`_worth` of several measurements."""
    options, standing, measurement, sweep_minutes, points = job
    return [_worth(option, standing, measurement, sweep_minutes, points) for option in options]


def _worth(option: Option, standing: Sequence[tuple[Rival, float]], measurement: Measurement, sweep_minutes: float, points: int) -> Worth | None:
    """The expected information of one measurement; None if it cannot be predicted from the sweeps so far."""
    found = _information([option], standing, measurement, points)
    if found is None:
        return None
    bits, groups, largest_odds = found
    return Worth(option, bits, _minutes(option, sweep_minutes), groups, largest_odds)


def _information(
    options: Sequence[Option], standing: Sequence[tuple[Rival, float]], measurement: Measurement, points: int
) -> tuple[float, tuple[tuple[str, ...], ...], float] | None:
    """Bits, the distinguished groups, and the largest expected log odds of a pair."""
    outcomes = [_distributions(options, rival, measurement, points) for rival, _ in standing]
    if not all(outcomes):
        return None
    rng = np.random.default_rng(0)
    weights = np.array([weight for _, weight in standing])
    count = len(standing)
    expected = np.zeros((count, count))
    bits = 0.0
    normal = rng.standard_normal((DRAWS, outcomes[0][0].mean.size))
    for place, components in enumerate(outcomes):
        drawn = _draws(components, normal, rng)
        logs = np.array([logsumexp([one.log_density(drawn) for one in other], axis=0) for other in outcomes])
        mixture = logsumexp(logs + np.log(weights)[:, None], axis=0)
        bits += weights[place] * float(np.mean(logs[place] - mixture)) / np.log(2)
        expected[place] = np.mean(logs[place] - logs, axis=1)
    apart = np.minimum(expected, expected.T)
    return float(np.clip(bits, 0.0, _bits(weights))), _groups([rival.label for rival, _ in standing], apart), float(np.max(apart))


def _draws(components: Sequence[_Component], normal: FloatArray, rng: np.random.Generator) -> FloatArray:
    shares = np.exp([one.log_share for one in components])
    which = rng.choice(len(components), size=len(normal), p=shares / shares.sum())
    return np.array([components[index].mean + components[index].root @ row for index, row in zip(which, normal, strict=True)])


def _groups(labels: Sequence[str], apart: FloatArray) -> tuple[tuple[str, ...], ...]:
    """Groups of explanations that the measurement does not distinguish."""
    group = list(range(len(labels)))
    for one, other in combinations(range(len(labels)), 2):
        if apart[one, other] < APART:
            group = [group[one] if own == group[other] else own for own in group]
    return tuple(tuple(label for label, own in zip(labels, group, strict=True) if own == number) for number in dict.fromkeys(group))


def _with_pairs(ranked: Sequence[Worth], standing: Sequence[tuple[Rival, float]], measurement: Measurement, sweep_minutes: float) -> list[Worth]:
    """The ranking with measurements that give information only together with a second one."""
    firsts = sorted((one for one in ranked if one.bits > 0), key=lambda one: -one.bits)[:PAIRED]
    found = list(ranked)
    for one, other in combinations(firsts, 2):
        together = _information([one.option, other.option], standing, measurement, POINTS_OF_A_PAIR)
        if together is not None and together[0] > max(one.bits + other.bits, NOTHING_BITS) * 1.5:
            first, second = sorted((one, other), key=lambda each: each.minutes)
            found.append(Worth(first.option, together[0], first.minutes + second.minutes, together[1], together[2], then=second.option.name))
    best: dict[str, Worth] = {}
    for each in found:
        if each.option.name not in best or each.rate > best[each.option.name].rate:
            best[each.option.name] = each
    return sorted(best.values(), key=lambda each: -each.rate)


def _why(asked: Worth, labels: Mapping[str, float]) -> str:
    separated = asked.separates[:3] if len(asked.separates) > 1 else [(label,) for label in list(labels)[:2]]
    groups = [f"({' or '.join(group)})" if len(group) > 1 else group[0] for group in separated]
    told = " and ".join([", ".join(groups[:-1]), groups[-1]]) if len(groups) > 1 else groups[0]
    then = f", and then {asked.then}" if asked.then else ""
    expected = f"{asked.bits:.2g} of the {_bits(labels.values()):.2g} bits that are missing, in {asked.minutes:.3g} minutes"
    return f"{asked.option.action}{then}: this should tell apart {told}; expected information: {expected}"


def _imitated(best: Rival) -> str:
    return (
        f"no measurement of the menu distinguishes {best.label} from {best.imitated_by}, which is not in the catalogue: it has nearly the same "
        "impedance, and whatever changes one changes the other alike; no other effect of the catalogue is left"
    )


def _proof(ranked: Sequence[Worth], standing: Sequence[tuple[Rival, float]], needed_bits: float) -> str:
    names = " and ".join(rival.label for rival, _ in standing if not rival.outside)
    best = max(ranked, key=lambda one: one.bits, default=None)
    if best is None:
        return f"no measurement is left on the menu that could distinguish {names}"
    if best.bits < NOTHING_BITS:
        return (
            f"no measurement of the menu distinguishes {names}: their outcomes coincide; of {len(ranked)} measurements {best.option.name} "
            f"would give most information, {show(best.bits, '', 2)} bits"
        )
    return (
        f"the measurements left on the menu do not distinguish {names}: all of them together would give at most "
        f"{show(_all_together(ranked), '', 2)} bits of information, and {show(needed_bits, '', 2)} are needed"
    )
