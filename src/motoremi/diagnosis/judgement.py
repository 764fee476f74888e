"""What the search found for one set of sweeps, taken for those of one analyser, and what is believed of it."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations

import numpy as np

from motoremi.arrays import Progress
from motoremi.diagnosis.belief import FAMILY_TOGETHER, MOST_NAMES, SLIGHT_SHARE, Belief, Standing, agreeing, believe, in_place_of, stands
from motoremi.diagnosis.candidates import ALLOWED_SIGMA, Candidate, Effects
from motoremi.diagnosis.explore import Budget, Key, best_of, explore
from motoremi.diagnosis.motor_board import MotorBoard
from motoremi.fitting.result import Fit
from motoremi.fitting.search import BEYOND_SIGMA, PLAIN
from motoremi.model.effects import find_effect
from motoremi.workers import Map

BUDGET = Budget()
# A search for one effect.
GLANCE = Budget(swaps=(0,))
# Sets of one size that are refitted on all points beside the likeliest where none is enough: what the decision may fall back on.
FURTHER = 4
# What a named effect must leave at most of what was left, or of how far the analyser's errors had to go where that was too far. Odds of e^60 need
# no halving; below them what lies beyond the catalogue's ranges may be meant, and leads that differ between the sweeps are likelier than
# a part of the motor of their size.
HALF, RELIEF = 0.5, 0.6
CLEAR_GAIN = 60.0
# Enough for an effect that leaves nothing, with values that motors have. The best effect that no motor hid gained at most 6 in 45 sets of sweeps
# of healthy motors outside the protocol (seed 881177), and another one's for the drift of a motor's capacitance 21.
ENOUGH_GAIN = 25.0
# An error is small beside the analyser's only as far as that is below this: no working analyser errs by more at impedances that it is made for.
MOST_ERRING_PERCENT = 10.0
# Circuits whose errors differ by less than this factor are about equally good.
ALIKE = 2.0
# A line of resistance and capacitance is a sum of relaxations (its Foster form), and over this band two terms of it are enough: along the path to
# the frame, or across a winding whose sections are unlike.
RELAXING = (frozenset({"dielectric-relaxation@Cf", "dielectric-relaxation@Cr", "bearing-film"}), frozenset({"dielectric-relaxation@Ca"}))


@dataclass(frozen=True, eq=False)
class Judgement:
    """All models that were found, and what they let one believe. Immutable.

    Parameters
    ----------
    base : Fit
    found : dict
        Candidate of each set of effects.
    belief : Belief
    none_named : bool
        Whether the base is to stand without what could be added, since no such model stands and the base errs within the specification.
    proven : bool
        Whether measurements beside the sweeps speak for the likeliest model, or for it and others that cannot be told from it: it is then named,
        however little the sweeps alone show of it.
    aside : dict
        Likelier models with one more effect that are not believed, since all that it does is to bring the analyser back towards its
        specification: an investigation weighs them as well.
    """

    base: Fit
    found: Mapping[Key, Candidate]
    belief: Belief
    none_named: bool = False
    proven: bool = False
    aside: Mapping[Key, Candidate] = field(default_factory=dict)

    @cached_property
    def best(self) -> Candidate:
        """The likeliest model of as many effects as are needed, without those that only take strain off the analyser, and that by no clear odds."""
        best = self.found[tuple(sorted(self.belief.named))] if self.belief.named else best_of(self.found.values())
        while len(best.added) > 1 and not self.proven:
            fewer = [self.found[key] for key in combinations(sorted(best.added), len(best.added) - 1) if key in self.found]
            under = max(fewer, key=lambda one: one.score, default=None)
            needed = under is not None and (_leaves_less(under, best) or _comes_closer(under, best) or _relieves(under, best))
            if under is None or (needed and not _enough(under)):
                break
            best = under
        return best

    @cached_property
    def named(self) -> Effects:
        """The named effects: those of the likeliest model, if they matter."""
        return self.best.added if self.belief.named and (self._matters or self.proven) and not self.none_named else ()

    @property
    def _matters(self) -> bool:
        """Whether the likeliest model differs enough from the base to matter to a user."""
        base = self.found[()]
        return self._describes or _comes_closer(base, self.best) or _relieves(base, self.best)

    @property
    def _describes(self) -> bool:
        """Whether it describes the error that the base leaves, and that error is large enough for an effect to be named."""
        before, by_waves = self.base, self.base.measurement.analyser.by_waves
        enough = self.gain > ENOUGH_GAIN and self.best.leaves_nothing
        # The wide errors of a network analyser can take up all that an effect does, and the odds against that say how unlikely it is.
        if before.marginal.nothing_left >= 0.5:
            return enough and by_waves
        # A network analyser sees best at its reference resistance: an error that is small there may be large elsewhere.
        left = before.unexplained_percent["value"]
        seen = left > before.measurement.good_enough_percent or by_waves
        # Where little is left beside what the analyser may err by, half of it may be the fine structure of the analyser's errors.
        halved = stands(before, before) == "not" and self.best.fit.unexplained_percent["value"] <= HALF * left
        return seen and (self.gain > CLEAR_GAIN or enough or halved)

    @property
    def undecided(self) -> bool:
        """Whether effects are likelier than none and not named, since an analyser may do as well what they describe."""
        return bool(self.belief.named) and not self.named and not self.accurate

    @cached_property
    def model(self) -> Candidate:
        """The accepted model: the base if no effect is named."""
        return self.best if self.named else self.found[()]

    @cached_property
    def standing(self) -> Standing:
        """Whether its remaining error is small enough to accept it."""
        standing = stands(self.base, self.model.fit)
        bends = len(self.model.added) == 1 and self.model.unusual and self.leaves_something
        # With values that few motors have a law only bends to the curve, if others come as close or much is left; one with a family is told
        # with it.
        poorly = bends and (self.model.fit.unexplained_percent["value"] >= 100 * PLAIN or self._as_close(*self.model.added))
        if (poorly and not any(self.belief.families.values())) or self._only_strains:
            return "not"
        # What removes most of an error and still leaves more than an impedance analyser could do is not all that is missing.
        if standing == "mostly" and self.strains:
            return "not"
        if len(self.model.added) < MOST_NAMES:
            return standing
        return standing if len(self.model.added) == MOST_NAMES and self._pair_is_credible else "not"

    @property
    def _only_strains(self) -> bool:
        """Whether the likeliest circuit errs more than the base, and an analyser far beyond its specification takes that up."""
        fit = self.model.fit
        return fit.analyser_sigma > BEYOND_SIGMA and fit.rms_error_percent > self.base.rms_error_percent

    @property
    def strains(self) -> bool:
        """Whether the accepted model needs errors far beyond the specification of an impedance analyser: more is missing, or it is not that one.

        What a network analyser's connection does is less well known: on real cores that needed more than three times its specification the name
        was right.
        """
        analyser = self.model.fit.measurement.analyser
        return analyser.named and not analyser.by_waves and self.model.fit.analyser_sigma > BEYOND_SIGMA

    @property
    def leaves_something(self) -> bool:
        """Whether something is left beyond noise and analyser, and beyond a stated accuracy."""
        return self.model.fit.marginal.nothing_left < 0.5 and not accurate(self.model.fit)

    @property
    def _pair_is_credible(self) -> bool:
        """Whether two effects, which bend to almost anything, leave nothing or what analyser or owner allow, with values that motors have."""
        fit = self.model.fit
        # The errors of an analyser that nobody named are known by their size alone: what is small beside them may be theirs. Not so what is
        # small beside the scatter of a sweep of few points only.
        analyser_percent = np.sqrt(max(fit.floor_percent**2 - fit.noise_percent**2, 0.0))
        slight = fit.rms_error_percent <= SLIGHT_SHARE * min(analyser_percent, MOST_ERRING_PERCENT)
        allowed = fit.within_specification if fit.measurement.analyser.named else slight
        enough = allowed or not self.leaves_something
        return enough and not self.strains and not self.model.unusual and not self.distributed

    @property
    def distributed(self) -> bool:
        """Whether the likeliest model is of two relaxations at one place: so is any one part whose resistance is distributed."""
        return distributed(self.best.added)

    @property
    def described(self) -> bool:
        """Whether one or two effects leave nothing, believed or not: then neither analyser nor sweeps are in question."""
        return self.best.done and len(self.best.added) <= MOST_NAMES

    @property
    def stands(self) -> bool:
        """Whether any model is accepted."""
        return self.standing != "not"

    @property
    def accurate(self) -> bool:
        """Whether the base is as good as the accuracy that the owner of the data stated."""
        return accurate(self.base)

    @cached_property
    def closest(self) -> Candidate:
        """The one whose circuit errs least: what to show where none stands, since there the likeliest may lean on the analyser's errors."""
        return min(self.found.values(), key=lambda one: one.fit.rms_error_percent)

    @property
    def gain(self) -> float:
        """Log odds of the likeliest model against the base."""
        return self.best.score - self.found[()].score

    @property
    def of_singles(self) -> Judgement | None:
        """The judgement without larger sets, where one effect describes most by itself; None elsewhere.

        It is one of the likeliest set; or its circuit errs no more than that set's, with values that motors have about as little: what the set
        describes beyond it is then a small rest; or no other single effect comes near it.
        """
        under = self.among({key: one for key, one in self.found.items() if len(key) <= 1})
        if not under.named or not under.stands or self.distributed:
            return None
        alike = 1.0 if under.model.unusual else ALIKE
        closer = under.model.fit.rms_error_percent <= alike * self.best.fit.rms_error_percent
        return under if closer or set(under.named) & set(self.best.added) or under._unrivalled else None

    @property
    def _unrivalled(self) -> bool:
        """Whether every other model of as many effects is clearly less likely and errs by a multiple."""
        own = self.model
        others = [one for one in self.found.values() if len(one.added) == len(own.added) and one is not own]
        return all(own.score - one.score > CLEAR_GAIN and one.fit.rms_error_percent > ALIKE * own.fit.rms_error_percent for one in others)

    @property
    def of_closest(self) -> Judgement | None:
        """The judgement among the single effects that come closest, where the likeliest does not; None where none of those stands.

        Where every single effect leaves more than a per cent, the laws are not quite the motor's. The likeliest may then only let the analyser
        take up more, and what removes most of the circuit's own error, with values that motors have, tells more.
        """
        singles = {key: one for key, one in self.found.items() if len(key) == 1}
        close = {key: one for key, one in singles.items() if one.plausible and not one.unusual}
        if not close or self.distributed:
            return None
        likeliest = best_of(singles.values())
        if likeliest.fit.unexplained_percent["value"] < 100 * PLAIN:
            return None
        least = min(one.fit.rms_error_percent for one in close.values())
        close = {key: one for key, one in close.items() if one.fit.rms_error_percent <= ALIKE * least}
        closest = self.among({key: one for key, one in self.found.items() if not key or key in close})
        return closest if likeliest not in close.values() and closest.named and closest.stands else None

    @property
    def of_singles_as_good(self) -> Judgement | None:
        """The same where the likeliest is a pair that leaves something too, and is not much likelier than that one effect; None elsewhere."""
        if len(self.named) < MOST_NAMES or not self.leaves_something:
            return None
        single = self.of_singles
        return single if single is not None and self.model.score - single.model.score <= CLEAR_GAIN else None

    def among(self, found: Mapping[Key, Candidate]) -> Judgement:
        """The judgement if only these sets of effects had been tried."""
        return Judgement(self.base, found, believe(found))

    @cached_property
    def families(self) -> Mapping[str, Key]:
        """For each effect of the likeliest model, the others that would do in its place.

        Where a model describes most and not all, its laws are not quite the motor's and likelihood ratios mean little: others whose circuit
        errs about as much are not told from it.
        """
        if self.model.fit.marginal.nothing_left >= 0.5:
            return self.belief.families
        return {effect: tuple(dict.fromkeys((*self.belief.families[effect], *self._alike(effect)))) for effect in self.model.added}

    @property
    def probability(self) -> float:
        """Probability of the named effects, families included."""
        return agreeing(self.belief.posterior, self.named, self.families)

    @property
    def of_accurate(self) -> Judgement | None:
        """The judgement among the single effects that reach the accuracy that was stated, where one does; None elsewhere.

        What a second effect, or a likelier one that misses the accuracy, does to the rest is then of no interest to the owner of the data.
        """
        enough = {key: one for key, one in self.found.items() if not key or (len(key) == 1 and accurate(one.fit))}
        if len(enough) == 1 or self.best.done:
            return None
        single = self.among(enough)
        return single if single.named and single.stands else None

    def _as_close(self, effect: str) -> Mapping[str, Candidate]:
        """Models with another effect in the place of one of the likeliest, by its name, whose circuit errs about as little."""
        limit = ALIKE * self.model.fit.rms_error_percent
        rivals = {name: self.found[key] for name, key in in_place_of(effect, self.model.added, self.found).items()}
        return {name: one for name, one in rivals.items() if one.fit.rms_error_percent <= limit}

    def _alike(self, effect: str) -> Key:
        """Effects in whose place one of the likeliest model does as well, a pair with values that motors have; the likeliest first."""
        limit = ALIKE * self.model.fit.unexplained_percent["value"]
        rivals = self._as_close(effect)
        alike = [
            name
            for name, one in rivals.items()
            if one.fit.unexplained_percent["value"] <= limit and not (len(one.added) == MOST_NAMES and one.unusual)
        ]
        return tuple(sorted(alike, key=lambda name: -rivals[name].score))

    @property
    def of_none(self) -> Judgement | None:
        """The judgement that the base does, where what it leaves may be the analyser's; None elsewhere."""
        base = self.base
        # At most points the analyser may err by as much as is left.
        typical_percent = 100 * float(np.median(np.concatenate(base.measurement.floors)))
        slight = stands(base, base) == "slight" and base.unexplained_percent["value"] <= typical_percent
        return dataclasses.replace(self, none_named=True) if base.within_specification or slight else None

    def rivals(self) -> list[Fit]:
        """The fits that these data cannot tell from the believed one, it first; empty where there are none."""
        fits = [self.model.fit]
        for effect in dict.fromkeys(self.model.added):
            rest = list(self.model.added)
            rest.remove(effect)
            family = self.families[effect]
            fits += [self.found[key].fit for name in family if (key := tuple(sorted((*rest, name)))) in self.found]
        return fits if len(fits) > 1 else []

    def steps(self, last: Candidate) -> tuple[Fit, ...]:
        """From the base to a model, one effect at a time as far as such models were found."""
        path = [self.base]
        left: list[str] = list(last.added)
        taken: Effects = ()
        while len(left) > 1:
            nexts = [(self.found[key].score, name) for name in left if (key := tuple(sorted((*taken, name)))) in self.found]
            if not nexts:
                break
            name = max(nexts)[1]
            taken = (*taken, name)
            left.remove(name)
            path.append(self.found[tuple(sorted(taken))].fit)
        return (*path, last.fit) if last.added else (self.base,)


def distributed(key: Key) -> bool:
    """Whether a set is of two relaxations at one place."""
    return len(key) == MOST_NAMES and any(set(key) <= at_one_place for at_one_place in RELAXING)


def accurate(base: Fit) -> bool:
    """Whether a circuit is as good as the accuracy that the owner of the data stated."""
    return base.measurement.accuracy_percent is not None and base.explained


def _enough(one: Candidate) -> bool:
    """Whether effects describe the motor as well as is asked for, with values that motors have: laws are never quite the motor's.

    A choke of two materials, and a loss angle that is not quite constant, left 0.03 to 0.04 % (odds of e^165 and more for a second effect); hidden
    pairs left at least 0.15 % with one of them.
    """
    return bool(one.added) and one.plausible and not one.unusual and one.fit.explained and one.fit.analyser_sigma <= ALLOWED_SIGMA


def _leaves_less(before: Candidate, after: Candidate) -> bool:
    """Whether it describes some of what is left: what only lets the analyser take up more describes nothing.

    Far from its reference resistance a network analyser multiplies the fine structure of its errors, so that a second effect needs clear odds.
    """
    left = after.fit.unexplained_percent["value"] < before.fit.unexplained_percent["value"]
    clear = not before.added or not before.fit.measurement.analyser.by_waves or after.score - before.score > CLEAR_GAIN
    return before.fit.marginal.nothing_left < 0.5 and left and clear


def _comes_closer(before: Candidate, after: Candidate) -> bool:
    """Whether it halves an error that noise and specification do not account for."""
    return before.fit.rms_error_percent > before.fit.floor_percent and after.fit.rms_error_percent <= HALF * before.fit.rms_error_percent


def _relieves(before: Candidate, after: Candidate) -> bool:
    """Whether the analyser has to err much less. Of one of its own errors either that or clear odds are enough, of a part of the motor not."""
    relieved = before.fit.analyser_sigma > ALLOWED_SIGMA and after.fit.analyser_sigma <= RELIEF * before.fit.analyser_sigma
    gain = after.score - before.score
    clear = gain > CLEAR_GAIN or (gain > ENOUGH_GAIN and after.leaves_nothing)
    added = list(after.added)
    for name in before.added:
        added.remove(name)
    if all(find_effect(name).effect.group == "instrument" for name in added):
        return relieved or clear
    return relieved and clear


def judge(base: Fit, progress: Progress | None = None, budget: Budget = BUDGET, each: Map = map) -> Judgement:
    """Search what is missing from a fit, and decide."""
    # Of a circuit that is good enough, effects are shown and none is named.
    spent = GLANCE if accurate(base) else budget
    board = MotorBoard(base, each, FURTHER if spent.most_effects > 1 else 0)
    return decided(base, explore(board, board.start(), spent, progress))


def decided(base: Fit, found: Mapping[Key, Candidate], together: float = FAMILY_TOGETHER, proven: bool = False) -> Judgement:
    """What the models that were found let one believe of a fit; `together` as in `belief.believe`, `proven` as in `Judgement`."""
    judgement = _with_usual_values(Judgement(base, found, believe(found, together), proven=proven), together)
    needed = len(judgement.best.added)
    if needed < len(judgement.belief.named):
        # What the larger set has more only strains the analyser: the likeliest of those without it may be another.
        fewer = judgement.among({key: one for key, one in judgement.found.items() if len(key) <= needed})
        larger = {key: one for key, one in judgement.found.items() if len(key) > needed}
        aside = {key: one for key, one in larger.items() if one.leaves_nothing and one.score > fewer.best.score}
        judgement = dataclasses.replace(fewer, aside=aside)
    if judgement.accurate:
        return dataclasses.replace(judgement, none_named=True)
    if (enough := judgement.of_accurate) is not None:
        return enough
    if (single := judgement.of_singles_as_good) is not None:
        return single
    # What the further effects of a larger set describe is a small rest: it stays undescribed, and the one that does most is named.
    return judgement if judgement.stands else judgement.of_singles or judgement.of_none or judgement.of_closest or judgement


def _with_usual_values(judgement: Judgement, together: float) -> Judgement:
    """The judgement among the sets with values that motors have, where the likeliest has others, and one of them does as well.

    Where something is left the laws are not quite the motor's, so that likelihood ratios mean little, and values decide. Two effects that leave
    nothing are not believed with such values; two others that leave nothing either are, unless the odds against them are clear.
    """
    likeliest = judgement.model
    leaves_nothing = likeliest.fit.marginal.nothing_left >= 0.5
    if not likeliest.unusual or (leaves_nothing and len(likeliest.added) < MOST_NAMES):
        return judgement
    for size in range(len(likeliest.added), MOST_NAMES + 1):
        usual = {key: one for key, one in judgement.found.items() if not one.unusual and len(key) <= size}
        other = dataclasses.replace(judgement, belief=believe(usual, together))
        if leaves_nothing:
            alike = other.model.done and likeliest.score - other.model.score <= ENOUGH_GAIN
        else:
            alike = other.model.fit.rms_error_percent <= ALIKE * likeliest.fit.rms_error_percent
        if other.named and other.stands and alike:
            return other
    return judgement
