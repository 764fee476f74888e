"""Whether the effects that a larger set has beyond a smaller one are needed, from all models that were found."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from motoremi.diagnosis.belief import acceptance_of
from motoremi.diagnosis.candidates import ALLOWED_SIGMA, Candidate, Effects, seen_in
from motoremi.diagnosis.explore import Key, beside
from motoremi.diagnosis.thresholds import (
    ALIKE,
    CLEAR_GAIN,
    CONTENDING,
    ENOUGH_GAIN,
    FURTHER_RELIEF_SIGMA,
    HALF,
    NEARLY_ALIKE,
    NEARLY_ALL,
    NEXT_TO_ALL,
    RELIEF,
    SEVERAL_LAWS,
)
from motoremi.fitting.result import SPECIFIED_SIGMA, Fit
from motoremi.model.effects import find_effect

# Families of effects that are losses of one element each.
LOSSES = ("winding-loss", "insulation")


@dataclass(frozen=True, eq=False)
class Sets:
    """The models of all sets of effects that were found for one set of sweeps and one assumed analyser. Immutable.

    Parameters
    ----------
    base : Fit
        Without added effects.
    found : dict
        Candidate of each set of effects.
    """

    base: Fit
    found: Mapping[Key, Candidate]

    def under(self, model: Candidate) -> Candidate | None:
        """The most probable of the models with one effect fewer, or of those that it corrects; None if none was found."""
        fewer = [self.found[key] for key in combinations(sorted(model.added), len(model.added) - 1) if key in self.found]
        fewer += [one for one in self.found.values() if self.corrects_a_law(one, model)]
        return max(fewer, key=lambda one: one.score, default=None)

    def needs_all(self, model: Candidate, under: Candidate) -> bool:
        """Whether the effect that a model has beyond a smaller one does more than to reduce the analyser's error a little.

        An error of the analyser beside a model that is within its specification is none: the errors that it allows have structure too.
        """
        if self.corrects_laws(under, model):
            return False
        further = tuple(Counter(model.added) - Counter(under.added))
        of_analyser = of_the_analyser_alone(further)
        shown = of_analyser and _errs_less_than_assumed(under, model)
        if of_analyser and not shown and is_within(under.fit) and acceptance_of(self.base, under.fit) != "not":
            return False
        if is_assumed(under.fit) and self._only_relieves_what_is_assumed(under, model):
            return False
        needed = shown or comes_closer(under, model) or relieves(under, model)
        # The sizes of the errors of an analyser without a name are estimated from these sweeps: what is left beside them is no further error of it.
        if not (of_analyser and is_assumed(under.fit)):
            needed = needed or _leaves_less(under, model)
        return needed

    def corrects_laws(self, under: Candidate, model: Candidate) -> bool:
        """Whether a model that describes enough is followed by one with more effects at its place: they describe that laws are approximate."""
        # An error beyond what noise and the specification of a named analyser leave is no matter of its law alone.
        closer = not is_assumed(under.fit) and comes_closer(under, model) and model.score - under.score > CLEAR_GAIN
        at_its_place = _enough(under) and self._at_one_place((*under.added, *model.added)) and not closer
        return at_its_place or self.corrects_a_law(under, model)

    def corrects_a_law(self, under: Candidate, model: Candidate) -> bool:
        """Whether a further effect only corrects a law of a smaller model."""
        return self._corrects_a_loss(under, model) or self._adds_at_the_floor(under, model)

    def _adds_at_the_floor(self, under: Candidate, model: Candidate) -> bool:
        """Whether a further effect adds nothing to a circuit that errs by no more than noise and specification would leave.

        If one effect describes nearly all that was missing, and any of several ones the rest, that is as small as laws of real materials are
        inexact: a steel sleeve as a ladder left 0.24 % of 12 %, and four effects beside the cage described that, with odds of e^370. Then the
        second one has to bring the circuit clearly closer. None is needed with which the circuit errs clearly more, and only the analyser less:
        beside a cage of deep bars and a moist slot liner a resonance took the error from 0.13 to 0.20 %, and beside a capacitor across the
        brushes leads took it from 1.0 to 25 %.
        """
        fit, further = under.fit, Counter(model.added) - Counter(under.added)
        if not under.added or not further or Counter(under.added) - Counter(model.added) or of_the_analyser_alone(tuple(further)):
            return False
        # The errors of a network analyser may be a large part of Z, so that those of circuits say less.
        if under.unusual or fit.measurement.analyser.by_waves or fit.rms_error_percent > fit.floor_percent:
            return False
        if not self.leaves_at_most(NEARLY_ALL, under):
            return False
        change = model.fit.rms_error_percent / fit.rms_error_percent
        # Below the floor of a sharp resonance, a larger error of the circuit says less.
        if change >= NEARLY_ALIKE and (len(under.added) > 1 or model.fit.rms_error_percent > model.fit.floor_percent):
            return True
        return change > 1 / NEARLY_ALIKE and self._laws_beside(under) >= SEVERAL_LAWS

    def _laws_beside(self, one: Candidate) -> int:
        """Number of different laws of which each describes the data about as well as the best one beside a set."""
        scores = {name: self.found[key].score for name, key in beside(one.added, self.found).items()}
        return len({find_effect(name).effect.formula for name, score in scores.items() if score >= max(scores.values()) - CONTENDING})

    def _corrects_a_loss(self, under: Candidate, model: Candidate) -> bool:
        """Whether a further effect only corrects a loss of a smaller model: it is another loss of the same element, or two are in place of one.

        A model that leaves next to nothing, and a tenth of what is left without that loss, is as accurate as laws of real materials can be expected
        to be. A turn of thick wire, a cage as a ladder (each beside another effect) and an insulation by Jonscher's law left 0.1 to 0.2 % of 14 to
        18 %: hardly more than the analyser may err by, but no error of its usual shape.
        """
        if len(model.added) != len(under.added) + 1:
            return False
        further = Counter(model.added) - Counter(under.added)
        replaced = Counter(under.added) - Counter(model.added)
        slight = under.fit.rms_error_percent <= ALIKE * under.fit.floor_percent
        if replaced.total() > 1 or not slight or under.unusual:
            return False
        if not self.leaves_at_most(NEXT_TO_ALL, under):
            return False
        left = under.fit.unexplained_percent["value"]
        corrected = [loss for loss in (replaced or under.added) if all(_of_one_element(name, loss) for name in further)]
        alone = [self.found.get(tuple(sorted((Counter(under.added) - Counter([loss])).elements()))) for loss in corrected]
        # A set that the search did not fit on all points was far behind: it leaves much.
        return any(one is None or left <= NEARLY_ALL * one.fit.unexplained_percent["value"] for one in alone)

    def _only_relieves_what_is_assumed(self, under: Candidate, model: Candidate) -> bool:
        """Whether a further effect takes the circuit further away, and only what is assumed of an analyser without a name becomes smaller.

        A choke of drum shape: a relaxing capacitance erred by 0.62 %, and a suppressor choke beside it by 1.14 %. A network analyser's errors may
        be a large part of Z, so that the circuit's error says less.
        """
        farther = under.ordinary and under.fit.rms_error_percent < model.fit.rms_error_percent
        return farther and not under.fit.measurement.analyser.by_waves and acceptance_of(self.base, under.fit) != "not"

    def _at_one_place(self, effects: Effects) -> bool:
        """Whether all of these effects show in the same sweeps."""
        return len({seen_in(self.base, name) for name in effects}) == 1

    def leaves_at_most(self, share: float, one: Candidate) -> bool:
        """Whether a model leaves at most this share of what the base leaves undescribed."""
        return one.fit.unexplained_percent["value"] <= share * self.base.unexplained_percent["value"]


def is_within(fit: Fit) -> bool:
    """Whether a circuit errs by no more than noise and specification would leave, with the analyser's errors about as large as specified."""
    return fit.rms_error_percent <= fit.floor_percent and fit.analyser_sigma <= ALLOWED_SIGMA


def of_the_analyser_alone(effects: Sequence[str]) -> bool:
    """Whether all of these effects are errors of the analyser or its fixture."""
    return all(find_effect(name).effect.group == "instrument" for name in effects)


def _of_one_element(one: str, other: str) -> bool:
    """Whether two effects are losses of one element, of copper and core or of an insulation."""
    first, second = find_effect(one), find_effect(other)
    return first.effect.family == second.effect.family and first.effect.family in LOSSES and first.place == second.place


def _enough(one: Candidate) -> bool:
    """Whether effects describe the motor as well as is asked for, with usual values.

    Another effect at the same place would then only correct their laws, which are never exactly those of the motor: a choke of two materials and a
    loss angle that is not quite constant left 0.03 to 0.04 %, with odds of e^165 and more for a second effect.
    """
    return bool(one.added) and one.ordinary and as_asked_for(one)


def as_asked_for(one: Candidate) -> bool:
    """Whether a model does as well as asked for, with the analyser and its fixture about as good as specified.

    Otherwise something may be missing that was attributed to the analyser's errors or to its fixture, as a lead of 400 nH was.
    """
    return one.fit.explained and one.fit.instrument_sigma <= ALLOWED_SIGMA


def _leaves_less(before: Candidate, after: Candidate) -> bool:
    """Whether the undescribed part is reduced: an effect that only allows larger analyser errors describes nothing.

    Far from its reference resistance a network analyser multiplies the fine structure of its errors, so that a second effect needs clear odds; so
    it does beside one that leaves at most 0.1 %, which may be the difference between that effect's law and the motor's.
    """
    left = after.fit.unexplained_percent["value"] < before.fit.unexplained_percent["value"]
    doubtful = before.fit.measurement.analyser.by_waves or _enough(before)
    clear = not (before.added and doubtful) or after.score - before.score > CLEAR_GAIN
    return before.fit.marginal.nothing_left < 0.5 and left and clear


def comes_closer(before: Candidate, after: Candidate) -> bool:
    """Whether it halves an error that noise and specification do not account for.

    Near a sharp resonance of a sound motor the error can exceed what they leave on average, and errors within the specification describe it; then
    the odds must be large too.
    """
    fit = before.fit
    closer = fit.rms_error_percent > fit.floor_percent and after.fit.rms_error_percent <= HALF * fit.rms_error_percent
    accounted_for = acceptance_of(fit, fit) != "not" and fit.analyser_sigma <= SPECIFIED_SIGMA
    return closer and (not accounted_for or after.score - before.score > ENOUGH_GAIN)


def relieves(before: Candidate, after: Candidate) -> bool:
    """Whether the analyser's error becomes much smaller.

    For an effect of the analyser this or clear odds suffice; an effect of the motor needs both.
    """
    least = FURTHER_RELIEF_SIGMA if before.added else ALLOWED_SIGMA
    relieved = before.fit.analyser_sigma > least and after.fit.analyser_sigma <= RELIEF * before.fit.analyser_sigma
    gain = after.score - before.score
    clear = gain > CLEAR_GAIN or (gain > ENOUGH_GAIN and after.leaves_nothing)
    added = list(after.added)
    for name in before.added:
        added.remove(name)
    if of_the_analyser_alone(added):
        return relieved or clear
    return relieved and clear


def is_assumed(fit: Fit) -> bool:
    """Whether the analyser's errors are assumed ones: those of an analyser without a name."""
    return not fit.measurement.analyser.named


def _errs_less_than_assumed(under: Candidate, model: Candidate) -> bool:
    """Whether a model that describes everything shows an analyser without a name to err less than is assumed, and the smaller model errs more.

    A clamp of 6 Ohm in one sweep: the analyser erred by a tenth of what is assumed, and the circuit by 2 % without the clamp.
    """
    shown = is_assumed(model.fit) and model.leaves_nothing and model.fit.sizes.declared < 1
    return shown and model.fit.rms_error_percent <= HALF * under.fit.rms_error_percent and model.score - under.score > CLEAR_GAIN
