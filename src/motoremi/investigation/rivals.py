"""The remaining explanations, and how data under conditions change their probabilities.

log odds of two rivals change by the difference of log p(new data | rival, sweeps at hand). An effect outside the catalogue is always one of
the rivals: its prediction is that of the most probable model, with a wide departure. A mistake of the operator is a possible explanation of
each sweep as well, so that no wrong sweep decides anything.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import combinations
from weakref import WeakValueDictionary

import numpy as np
from scipy.special import logsumexp

from motoremi.arrays import JsonDict
from motoremi.data.conditions import VALUES, SingleValue
from motoremi.data.measurement import Measurement
from motoremi.fitting.result import Fit
from motoremi.investigation.conditioned import by_condition
from motoremi.investigation.known import Known
from motoremi.investigation.menu import BY_NAME, Option
from motoremi.investigation.mistakes import STRANGE_VALUE, WRONG, Mistake, mistakes, of_no_kind, repeated
from motoremi.investigation.outcome import Observed, Outcome, ValueOutcome
from motoremi.investigation.responses import ways
from motoremi.investigation.weighing import UNDESCRIBED_ELSEWHERE, UNDESCRIBED_OUTSIDE, UNPREDICTED_OUTSIDE, Weighed, anything, mixed, weigh
from motoremi.model.effects import find_effect
from motoremi.quantities import show
from motoremi.threads import one_blas_thread

Key = tuple[str, ...]
# Label of the explanation by an effect outside the catalogue.
OUTSIDE = "outside-the-catalogue"
# Models further behind the best than this (log odds) are not evaluated; their distance is kept.
BEHIND = 12.0
MOST_RIVALS = 10
# Share of true explanations whose predicted response is completely wrong: no single measurement refutes an effect by another one by more than
# 50 to 1.
DOUBT = 0.02
# The same of a sweep of the motor as it is, in another circuit or over another span: it needs no response, and the models allow for departures.
DOUBT_ELSEWHERE = 0.002
# Number of the most probable explanations that an effect outside the catalogue may resemble.
LIKE = 3
# How often an effect outside the catalogue departs independently at each point, and by how much, as a logarithm. An assumption; unconfirmed.
DEPARTS, DEPARTS_BY = 0.1, (0.03, 0.1, 0.3)
# How often nothing changes under a condition that may change elements; and how often it was not set up. Assumptions; unconfirmed.
UNMOVED, NOTHING_DONE = 0.2, 0.025
# A mistake is considered if it is within these log odds of what was requested.
PLAUSIBLE = 8.0


@dataclass(frozen=True, eq=False)
class Rival:
    """One explanation.

    Parameters
    ----------
    key : tuple of str
        Effects that it adds; (OUTSIDE,) for an effect outside the catalogue.
    fit : Fit
    log_weight : float
    known : Known
        Distribution of its unknowns after the data so far.
    """

    key: Key
    fit: Fit
    log_weight: float
    known: Known

    @property
    def outside(self) -> bool:
        """Whether it is the explanation by an effect outside the catalogue."""
        return self.key == (OUTSIDE,)

    @property
    def label(self) -> str:
        """Its name in output."""
        return " + ".join(self.key) or "nothing missing"

    @property
    def imitated_by(self) -> str:
        """Something outside the catalogue that no measurement of the menu distinguishes from its one effect; empty if nothing is known."""
        return find_effect(self.key[0]).imitated_by if len(self.key) == 1 and not self.outside else ""


@dataclass(frozen=True)
class Taught:
    """The information from one condition or value.

    Parameters
    ----------
    id : str
        As it is written, for example `second-temperature=53degC`.
    bits : float
        Information: how far the probabilities moved (Kullback and Leibler).
    probabilities : dict
        Afterwards, by label.
    mistakes : tuple of Mistake
        Mistakes that were found; the sweeps concerned are not used.
    """

    id: str
    bits: float
    probabilities: Mapping[str, float]
    mistakes: tuple[Mistake, ...] = ()

    def to_dict(self) -> JsonDict:
        """Plain data."""
        return {
            "id": self.id,
            "information_bits": self.bits,
            "probabilities": dict(self.probabilities),
            "mistakes": [{"kind": one.kind, "says": one.says} for one in self.mistakes],
        }


@dataclass(frozen=True, eq=False)
class Rivals:
    """Explanations with their probabilities; the last is an effect outside the catalogue. Immutable.

    Parameters
    ----------
    members : tuple of Rival
    taught : tuple of Taught
        The information of the further measurements.
    imitated_share : float
        Of the probability of one effect that is imitated (`Effect.imitated`), the share of what imitates it.
    """

    members: tuple[Rival, ...]
    taught: tuple[Taught, ...] = ()
    imitated_share: float = 0.0

    @cached_property
    def learnt(self) -> dict[tuple[bytes, ...], Rivals]:
        """The same explanations after further measurements, by their data; `Lessons` fills it."""
        return {}

    @cached_property
    def probabilities(self) -> dict[Key, float]:
        """Of each explanation."""
        logs = np.array([one.log_weight for one in self.members])
        weights = np.exp(logs - logsumexp(logs))
        return {one.key: float(weight) for one, weight in zip(self.members, weights, strict=True)}

    @property
    def by_label(self) -> dict[str, float]:
        """The same by label, the most probable first; what imitates an explanation counts as outside the catalogue."""
        imitated = {one.key: self.imitated_share if one.imitated_by else 0.0 for one in self.members}
        own = {one.label: self.probabilities[one.key] * (1 - imitated[one.key]) for one in self.members}
        if any(imitated.values()):
            own[OUTSIDE] = self.outside + sum(self.probabilities[key] * share for key, share in imitated.items())
        return dict(sorted(own.items(), key=lambda pair: -pair[1]))

    @property
    def likeliest(self) -> Rival:
        """The most probable explanation of the catalogue."""
        return max((one for one in self.members if not one.outside), key=lambda one: one.log_weight)

    @property
    def nearest(self) -> tuple[Rival, ...]:
        """The most probable explanations of the catalogue; an effect outside it is assumed to resemble one of them."""
        return tuple(sorted((one for one in self.members if not one.outside), key=lambda one: -one.log_weight)[:LIKE])

    @property
    def outside(self) -> float:
        """Probability of an effect outside the catalogue."""
        return self.probabilities.get((OUTSIDE,), 0.0)


def rivals_of(fits: Mapping[Key, tuple[Fit, float]], outside: float, imitated_share: float = 0.0) -> Rivals:
    """Explanations from fits with their log scores.

    Parameters
    ----------
    fits : mapping
        Effects that were added -> fit and log of evidence times prior.
    outside : float
        Probability of an effect outside the catalogue, above 0 and below 1.
    imitated_share : float
        As of `Rivals`.
    """
    best = max(score for _, score in fits.values())
    near = sorted((key for key, (_, score) in fits.items() if score >= best - BEHIND), key=lambda key: -fits[key][1])[:MOST_RIVALS]
    members = [Rival(key, fits[key][0], fits[key][1] - best, Known.of(fits[key][0])) for key in near]
    inside = float(logsumexp([one.log_weight for one in members]))
    leading = members[0]
    members.append(Rival((OUTSIDE,), leading.fit, inside + float(np.log(outside / (1 - outside))), leading.known))
    made = Rivals(tuple(members), imitated_share=imitated_share)
    return _MADE.setdefault((imitated_share, *((one.key, id(one.fit), one.log_weight) for one in members)), made)


# Explanations with the same fits and weights are one object while it is in use, so that what they were taught is computed once. It holds its fits:
# no other fit has their `id` meanwhile.
_MADE: WeakValueDictionary[tuple[object, ...], Rivals] = WeakValueDictionary()


def update(rivals: Rivals, measurement: Measurement) -> Rivals:
    """The same explanations after all sweeps under conditions and single values of a measurement.

    Parameters
    ----------
    rivals : Rivals
        After the reference sweeps.
    measurement : Measurement
        Of which `conditioned` and `values` are new.
    """
    return Lessons(rivals).after(measurement)


class Lessons:
    """The explanations after each further measurement, cached, so that only new data have to be evaluated.

    Parameters
    ----------
    start : Rivals
        As the reference sweeps left them.
    """

    def __init__(self, start: Rivals) -> None:
        self._start = start
        self._learnt = start.learnt

    @one_blas_thread
    def after(self, measurement: Measurement) -> Rivals:
        """The explanations after all sweeps under conditions and single values of a measurement with these reference sweeps."""
        rivals = self._start
        taken: tuple[bytes, ...] = ()
        for option, sweeps in by_condition(measurement):
            taken = (*taken, b"".join(sweep.key for sweep in sweeps))
            rivals = self._kept(taken, partial(_after_sweeps, rivals, measurement, option, sweeps))
        for value in measurement.values:
            taken = (*taken, str(value).encode())
            rivals = self._kept(taken, partial(_after_value, rivals, value))
        return rivals

    def _kept(self, taken: tuple[bytes, ...], learn: Callable[[], Rivals]) -> Rivals:
        if taken not in self._learnt:
            self._learnt[taken] = learn()
        return self._learnt[taken]


def _after_sweeps(rivals: Rivals, measurement: Measurement, option: Option, sweeps: Sequence[Observed]) -> Rivals:
    leading = rivals.likeliest
    # All explanations describe the reference sweeps, so the most probable one predicts a repeat for all of them.
    strange = {one.termination: of_no_kind(one, leading.fit, leading.known) for one in sweeps}
    again = {one.termination: repeated(one, leading.fit, leading.known, strange[one.termination]) for one in sweeps}
    wrong = {
        one.termination: mistakes(one, option, measurement, leading.fit, leading.known, again[one.termination], strange[one.termination])
        for one in sweeps
    }
    done = _weighed_all(rivals, sweeps, again, sum(strange.values()))
    right = float(np.log(1 - WRONG))
    logs: list[dict[Key, float]] = [{(): one.log_likelihood + len(sweeps) * right} for one in done]
    learnt: list[dict[Key, Known]] = [{(): one.known} for one in done]
    best = max(log[()] for log in logs)
    for size in range(1, len(sweeps) + 1):
        for left_out in combinations(sorted(wrong), size):
            used = [one for one in sweeps if one.termination not in left_out]
            instead = sum(wrong[name].log_likelihood for name in left_out)
            guess = _weighed(leading, used, rivals, again) if used else Weighed(0.0, leading.known)
            if guess.log_likelihood + instead + len(used) * right < best - PLAUSIBLE:
                continue
            least = sum(strange[one.termination] for one in used)
            all_used = (
                _weighed_all(rivals, used, again, least, {leading.key: guess}) if used else [Weighed(0.0, rival.known) for rival in rivals.members]
            )
            for found, log, known in zip(all_used, logs, learnt, strict=True):
                log[left_out] = found.log_likelihood + instead + len(used) * right
                known[left_out] = found.known
    doubt = DOUBT_ELSEWHERE if option.kind == "sweep" else DOUBT
    doubted = with_doubt(rivals, [float(logsumexp(list(log.values()))) for log in logs], doubt)
    members = []
    shares: dict[Key, float] = {}
    total = float(logsumexp([rival.log_weight + value for rival, log in zip(rivals.members, logs, strict=True) for value in log.values()]))
    for rival, log, known, factor in zip(rivals.members, logs, learnt, doubted, strict=True):
        for left_out, value in log.items():
            shares[left_out] = shares.get(left_out, 0.0) + float(np.exp(rival.log_weight + value - total))
        members.append(dataclasses.replace(rival, log_weight=rival.log_weight + factor, known=known[max(log.items(), key=lambda pair: pair[1])[0]]))
    unchanged = sum(np.exp(rival.log_weight + log[()] - total) * one.unchanged for rival, log, one in zip(rivals.members, logs, done, strict=True))
    noticed = tuple(wrong[name] for name in sorted(wrong) if sum(share for left_out, share in shares.items() if name in left_out) > 0.5)
    condition = str(sweeps[0].condition)
    # More probable than before the sweeps.
    if unchanged > NOTHING_DONE + (1 - NOTHING_DONE) * UNMOVED:
        says = f"{condition}: the sweeps show no change: either nothing in this motor responds to it, or it was not done"
        noticed += (Mistake("nothing-changed", says, float(np.log(NOTHING_DONE)), used=True),)
    return _with(rivals, members, condition, noticed)


def with_doubt(rivals: Rivals, logs: Sequence[float], doubt: float = DOUBT) -> list[float]:
    """Log likelihoods if each rival may be right and its response wrong.

    The outcome is then as likely as with the effect of the catalogue that predicts it best, so that no measurement changes the odds of two of these
    by more than 1 / `doubt`; or it is predicted by any of them, an effect outside the catalogue included.
    """
    weights = np.array([one.log_weight for one in rivals.members])
    any_of_them = float(logsumexp(weights - logsumexp(weights) + np.array(logs)))
    best = max([log for one, log in zip(rivals.members, logs, strict=True) if not one.outside], default=-np.inf)
    return [float(np.logaddexp(np.log(1 - doubt) + log, np.log(doubt) + max(best, any_of_them))) for log in logs]


def _weighed_all(
    rivals: Rivals, sweeps: Sequence[Observed], again: Mapping[str, float], least: float, done: Mapping[Key, Weighed] | None = None
) -> list[Weighed]:
    """Each explanation's likelihood of sweeps under a condition; `least` as of `weigh`, `done` are computed already."""
    found = dict(done or {})
    # The most probable ones first: others may be hopeless beside them.
    for rival in sorted((one for one in rivals.members if one.key not in found), key=lambda one: -one.log_weight):
        found[rival.key] = _weighed(rival, sweeps, rivals, again, max([least, *(one.log_likelihood for one in found.values())]))
    return [found[rival.key] for rival in rivals.members]


def _weighed(rival: Rival, sweeps: Sequence[Observed], rivals: Rivals, again: Mapping[str, float], least: float = -np.inf) -> Weighed:
    """An explanation's likelihood of sweeps under a condition, whether it responds as predicted, or in another way, or not at all.

    `least` as of `weigh`.
    """
    cases = [(1.0, _weighed_outside(sweeps, rivals))] if rival.outside else _responding(rival, sweeps, least)
    as_it_was = sum(again[one.termination] for one in sweeps) if BY_NAME[sweeps[0].condition.id].may_change_nothing else -np.inf
    if np.isneginf(as_it_was):
        return mixed(cases)
    *responding, (silent, other) = [(share * (1 - NOTHING_DONE), case) for share, case in cases]
    unchanged = Weighed(as_it_was, rival.known, unchanged=1.0)
    return mixed([*responding, (silent * (1 - UNMOVED), other), (NOTHING_DONE + silent * UNMOVED, unchanged)])


def _responding(rival: Rival, sweeps: Sequence[Observed], least: float) -> list[tuple[float, Weighed]]:
    """With the responses that the effects name, if they name any, and without those of some or all; each case with its probability."""
    whole = Outcome(rival.fit, sweeps)
    sizes = UNDESCRIBED_ELSEWHERE if whole.elsewhere else None
    found: list[tuple[float, Weighed]] = []
    for share, silent in ways(whole.answering):
        found.append((share, weigh(Outcome(rival.fit, sweeps, silent), rival.known, sizes, least=least)))
        least = max(least, found[-1][1].log_likelihood)
    return found


def _weighed_outside(sweeps: Sequence[Observed], rivals: Rivals) -> Weighed:
    """An effect outside the catalogue responds like any model that describes the reference sweeps, or departs from it."""
    departs = BY_NAME[sweeps[0].condition.id].reaches_motor
    near = rivals.nearest
    priors = (UNDESCRIBED_OUTSIDE, UNPREDICTED_OUTSIDE) if departs else (None, None)
    own = [weigh(Outcome(one.fit, sweeps, None), one.known, *priors) for one in near]
    logs = np.array([one.log_weight for one in near])
    like_them = float(logsumexp(logs - logsumexp(logs) + [one.log_likelihood for one in own]))
    if BY_NAME[sweeps[0].condition.id].kind == "standard":
        sound = weigh(Outcome(near[0].fit, sweeps, sound=True), near[0].known).log_likelihood
        like_them = float(np.logaddexp(like_them, sound) - np.log(2))
    if departs:
        like_them = float(np.logaddexp.reduce([np.log(1 - DEPARTS) + like_them, *_departing(sweeps, near[0])]))
    return dataclasses.replace(own[0], log_likelihood=like_them)


def _departing(sweeps: Sequence[Observed], nearest: Rival) -> list[float]:
    """Log likelihood, prior included, of some of the sweeps departing independently at each point while the others are like a rival's."""
    found = []
    subsets = [chosen for size in range(1, len(sweeps) + 1) for chosen in combinations(range(len(sweeps)), size)]
    for chosen in subsets:
        free = sum(anything(Outcome(nearest.fit, [sweeps[at]]), nearest.known, DEPARTS_BY) for at in chosen)
        others = [sweep for at, sweep in enumerate(sweeps) if at not in chosen]
        like = weigh(Outcome(nearest.fit, others, None), nearest.known).log_likelihood if others else 0.0
        found.append(free + like + float(np.log(DEPARTS / len(subsets))))
    return found


# Probability that a value was read wrongly, and that its unit has a wrong prefix, by these factors.
SLIP = 0.02
PREFIXES = (1e-6, 1e-3, 1e3, 1e6)
# Test leads, whose resistance is in a reading with two wires: typical value, and its logarithm's standard deviation. An assumption; unconfirmed.
TEST_LEADS_OHM, TEST_LEADS_SPREAD = 0.2, 0.7
# The mistakes of a value in words.
_READ_WRONGLY = "far from the prediction of every explanation"
_WRONG_PREFIX = "the prefix of its unit is probably wrong"
_TWO_WIRES = "it was probably measured with two wires, so that the resistance of the test leads is in it"
_ACROSS_WINDING = "it is probably that of the winding: the tester was connected across it, not to the frame"


def _after_value(rivals: Rivals, value: SingleValue) -> Rivals:
    """The explanations after a value, which may have been read or written wrongly, or measured at the wrong place."""
    setting = VALUES[value.name].setting
    slip = float(np.log(SLIP) - np.log(np.log(setting.high / setting.low)))
    logs, known = [], []
    weights: dict[str, list[float]] = {}
    for rival in rivals.members:
        prediction = ValueOutcome(rival.fit, value)
        if not prediction.known:
            return rivals
        widths = OUTSIDE_VALUE if rival.outside else AS_READ
        found = weigh(prediction, rival.known, widths)
        others = [weigh(ValueOutcome(rival.fit, _scaled(value, factor)), rival.known, widths).log_likelihood for factor in PREFIXES]
        wrong = {
            _READ_WRONGLY: slip,
            _WRONG_PREFIX: float(logsumexp(others) + np.log(SLIP / len(PREFIXES))),
            **_measured_wrongly(rival, value),
        }
        own = found.log_likelihood + float(np.log(1 - 2 * SLIP - (WRONG if len(wrong) > 2 else 0.0)))
        logs.append(float(logsumexp([own, *wrong.values()])))
        known.append(found.known if own > max(wrong.values()) else rival.known)
        for why, log in {"": own, **wrong}.items():
            weights.setdefault(why, []).append(rival.log_weight + log)
    shares = {why: float(logsumexp(each)) for why, each in weights.items()}
    members = [
        dataclasses.replace(rival, log_weight=rival.log_weight + factor, known=own)
        for rival, factor, own in zip(rivals.members, with_doubt(rivals, logs), known, strict=True)
    ]
    noticed: tuple[Mistake, ...] = ()
    as_read = shares.pop("")
    if as_read < logsumexp(list(shares.values())):
        why = max(shares, key=lambda one: shares[one])
        noticed = (Mistake(STRANGE_VALUE, f"{value.name} of {show(value.value_si, value.unit)}: {why}", slip, used=True),)
    return _with(rivals, members, value.text, noticed)


def _measured_wrongly(rival: Rival, value: SingleValue) -> dict[str, float]:
    """The mistake that is usual with a value, in words, with its log likelihood, prior included."""
    if value.name == "dc-resistance":
        return {_TWO_WIRES: _with_leads(rival, value) + float(np.log(WRONG))}
    across = ValueOutcome(rival.fit, dataclasses.replace(value, name="dc-resistance"))
    if value.name == "insulation-resistance" and across.known:
        return {_ACROSS_WINDING: weigh(across, rival.known, AS_READ).log_likelihood + float(np.log(WRONG))}
    return {}


def _with_leads(rival: Rival, value: SingleValue) -> float:
    """Log likelihood of the logarithm of a resistance that was read together with test leads."""
    prediction = ValueOutcome(rival.fit, value)
    mean, own, _ = prediction.at(rival.known.centre, np.zeros(prediction.size))
    variance = float(prediction.sigma[0] ** 2 + own[:, 0] @ np.linalg.solve(rival.known.precision, own[:, 0]))
    # The winding's resistance at equal steps of its normal distribution; the rest of the reading are the leads.
    steps = np.linspace(-5, 5, 201)
    share = np.exp(-0.5 * steps**2) / np.sum(np.exp(-0.5 * steps**2))
    leads = value.value_si - np.exp(mean[0] + np.sqrt(variance) * steps)
    there = leads > 0
    away = np.log(leads[there] / TEST_LEADS_OHM) / TEST_LEADS_SPREAD
    density = np.exp(-0.5 * away**2) / (np.sqrt(2 * np.pi) * TEST_LEADS_SPREAD * leads[there])
    return float(np.log(max(value.value_si * float(share[there] @ density), 1e-300)))


def _scaled(value: SingleValue, factor: float) -> SingleValue:
    return dataclasses.replace(value, value_si=value.value_si * factor, sigma=value.sigma * factor)


# What no model describes of a value, as a logarithm.
AS_READ = {1e-6: 1.0}
OUTSIDE_VALUE = {1e-6: 0.5, 0.3: 0.3, 1.5: 0.2}


def _with(rivals: Rivals, members: Sequence[Rival], name: str, noticed: tuple[Mistake, ...]) -> Rivals:
    leading = Rivals(tuple(members)).likeliest
    # An effect outside the catalogue is predicted like the explanation that is the most probable now.
    known = tuple(dataclasses.replace(one, fit=leading.fit, known=leading.known) if one.outside else one for one in members)
    after = dataclasses.replace(rivals, members=known)
    bits = sum(p * np.log2(p / max(rivals.probabilities[key], 1e-300)) for key, p in after.probabilities.items() if p > 0)
    taught = Taught(name, float(max(bits, 0.0)), after.by_label, noticed)
    return dataclasses.replace(after, taught=(*rivals.taught, taught))
