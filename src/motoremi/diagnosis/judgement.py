"""What the models show that were found for one set of sweeps and one assumed analyser: the named effects, their acceptance, families and rivals."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from motoremi.diagnosis.belief import (
    FAMILY_SHARE,
    MOST_ERRING_PERCENT,
    SLIGHT_SHARE,
    Acceptance,
    Belief,
    acceptance_of,
    agreeing,
    believe,
)
from motoremi.diagnosis.candidates import ALLOWED_SIGMA, Candidate, Effects
from motoremi.diagnosis.explore import Key, best_of, in_place_of
from motoremi.diagnosis.needed import Sets, comes_closer, is_assumed, is_within, of_the_analyser_alone, relieves
from motoremi.diagnosis.thresholds import (
    ALIKE,
    BEYOND_SIGMA_OF_NETWORK,
    CLEAR_GAIN,
    ENOUGH_GAIN,
    HALF,
    HARDLY_ANYTHING,
    MOVED_SIGMA,
    NEARLY_ALL,
    NEXT_TO_ALL,
)
from motoremi.fitting.result import SPECIFIED_SIGMA, Fit
from motoremi.fitting.search import BEYOND_SIGMA, PLAIN
from motoremi.model.effects import find_effect
from motoremi.model.effects.effect import Needs

# What a device needs for an effect, in the order in which effects are named that sweeps of a winding alone do not distinguish.
COMMONEST_FIRST: tuple[Needs, ...] = ("winding", "core", "lossy insulation", "part")
# Effects of which two together have the impedance of a line of resistance and capacitance: such a line is a sum of relaxations (its Foster form),
# and over this band two of them are enough, along the path to the frame or across a winding of different sections.
RELAXING = (frozenset({"dielectric-relaxation@Cf", "dielectric-relaxation@Cr", "bearing-film"}), frozenset({"dielectric-relaxation@Ca"}))


@dataclass(frozen=True, eq=False)
class Judgement:
    """All models that were found, and the decision from them. Immutable.

    Parameters
    ----------
    base : Fit
    found : dict
        Candidate of each set of effects.
    belief : Belief
    none_named : bool
        Whether no effect is named because no model with effects is accepted and the base's error is within the specification.
    proven : bool
        Whether further measurements confirm the most probable model, alone or with others that they cannot distinguish: it is then named even if
        the sweeps alone show little of it.
    aside : dict
        More probable models whose additional effect only reduces the analyser's error: not named, but considered by an investigation.
    whole : Candidate, optional
        The ordinary parts of a machine, all at once, if they come much closer than the sets that were found; shown, and never named.
    pair_is_better : bool
        Whether the most probable model is a pair that is accepted because one effect, which would be named instead, is worse (`is_better_than`), or
        because nothing else is accepted and it `leaves_hardly_anything`.
    """

    base: Fit
    found: Mapping[Key, Candidate]
    belief: Belief
    none_named: bool = False
    proven: bool = False
    aside: Mapping[Key, Candidate] = field(default_factory=dict)
    whole: Candidate | None = None
    pair_is_better: bool = False

    @cached_property
    def _sets(self) -> Sets:
        return Sets(self.base, {**self.found, **self.aside})

    @cached_property
    def best(self) -> Candidate:
        """The most probable model, without effects that only reduce the analyser's error, unless by clear odds."""
        best = self.found[tuple(sorted(self.belief.named))] if self.belief.named else best_of(self.found.values())
        while len(best.added) > 1 and not self.proven and (under := self._sets.under(best)) is not None and not self._sets.needs_all(best, under):
            best = under
        return best

    @property
    def of_needed(self) -> Judgement:
        """The judgement among the sets of the most probable model's size and the larger ones of which every effect is needed."""
        best, size = self.best, len(self.best.added)
        more = {key: one for key, one in self.found.items() if len(key) > size}
        # What the correction of a law describes needs no other effect, unless that is clearly more probable.
        least = max((one.score + CLEAR_GAIN for one in more.values() if self._sets.corrects_a_law(best, one)), default=-np.inf)
        # Another set with more effects at the place of one that describes enough is no better than that one with a further effect.
        under = {key: self._sets.under(one) for key, one in more.items() if one.score > least and not self._sets.corrects_laws(best, one)}
        larger = {key: self.found[key] for key, fewer in under.items() if fewer is not None and self._sets.needs_all(self.found[key], fewer)}
        return self.among({**{key: one for key, one in self.found.items() if len(key) <= size}, **larger})

    @cached_property
    def named(self) -> Effects:
        """The named effects: those of the most probable model, if they matter."""
        return self.best.added if self.belief.named and (self._matters or self.proven) and not self.none_named else ()

    @property
    def _matters(self) -> bool:
        """Whether the most probable model differs enough from the base to matter to a user."""
        base = self.found[()]
        # An error of the analyser that its specification allows is no fault; nor is one that is assumed of an analyser without a name, of which
        # nobody knows the specification (an open residual of 60 nS, of which the circuit errs by 0.60 %, where 0.61 % are assumed).
        slight = self._little_is_left or acceptance_of(self.base, self.base) == "slight"
        assumed_of_it = is_assumed(self.base) and self.base.rms_error_percent <= self.base.floor_percent
        within = assumed_of_it or (slight and is_within(self.base))
        allowed = of_the_analyser_alone(self.best.added) and within and not self._moves_an_element
        # If the base leaves no more than an analyser without a name may cause, a smaller error of that analyser is no reason for unusual values.
        assumed = self.best.unusual and is_assumed(self.base) and acceptance_of(self.base, self.base) != "not"
        return not allowed and (self._describes or comes_closer(base, self.best) or (not assumed and relieves(base, self.best)))

    @property
    def _moves_an_element(self) -> bool:
        """Whether the most probable model clearly describes everything, and the base's error bars do not hold an element's value with it.

        The base's elements are then wrong by more than is said of them: behind a cable of 12 cm beyond the calibration of a network analyser Cf was
        272 pF instead of 180 pF, with an error bar of 7 pF.
        """
        if self.gain <= CLEAR_GAIN or not self.best.leaves_nothing:
            return False
        base, values = self.base, self.best.fit.parameters
        known = [name for name in base.parameters if base.determined(name)]
        return any(abs(values[name] - base.parameters[name]) > MOVED_SIGMA * base.sigma[name] for name in known)

    @property
    def _describes(self) -> bool:
        """Whether it describes the error that the base leaves, and that error is large enough for an effect to be named."""
        before, by_waves = self.base, self.base.measurement.analyser.by_waves
        enough = self.gain > ENOUGH_GAIN and self.best.leaves_nothing
        # The large errors of a network analyser can describe all that an effect does, so nothing may remain without it; then the odds decide.
        if before.marginal.nothing_left >= 0.5:
            return enough and by_waves
        # A network analyser is most sensitive at its reference resistance: an error that is small there may be large elsewhere. What is less than
        # counts has to show in the circuit: of a sound motor with flicker a coupling took 0.02 % to nothing, and the circuit erred more.
        left = before.unexplained_percent["value"]
        closer = self.best.fit.rms_error_percent < before.rms_error_percent
        seen = left > before.measurement.good_enough_percent or by_waves or (self.best.leaves_nothing and self.gain > CLEAR_GAIN and closer)
        # If little remains compared with the analyser's error, halving it proves nothing: half may be fine structure of that error.
        halved = acceptance_of(before, before) == "not" and self.best.fit.unexplained_percent["value"] <= HALF * left
        return seen and (self.gain > CLEAR_GAIN or enough or halved)

    @property
    def hardly_matters(self) -> bool:
        """Whether effects are named although the base leaves less than what counts; of a network analyser see `_describes`.

        If the analyser has no name, an undescribed part that is `slight` beside its possible errors does not count either: their fine structure is
        unknown.
        """
        analyser = self.base.measurement.analyser
        little = self._little_is_left or (not analyser.named and acceptance_of(self.base, self.base) == "slight")
        return bool(self.named) and little and not analyser.by_waves

    @property
    def _little_is_left(self) -> bool:
        """Whether the base leaves less than what counts, with the analyser nearly within its specification."""
        base = self.base
        return base.unexplained_percent["value"] <= base.measurement.good_enough_percent and base.analyser_sigma <= ALLOWED_SIGMA

    @property
    def unusual_instead(self) -> Candidate | None:
        """What describes everything with unusual values, in whose place something less probable is named; of several effects if clearly less."""
        best = best_of(self.found.values())
        describes = best.fit.marginal.nothing_left >= 0.5 and not best.ordinary
        instead = describes and best is not self.model and len(self.named) == len(best.added) > 0
        return best if instead and (len(self.named) == 1 or best.score - self.model.score > CLEAR_GAIN) else None

    @property
    def absorbing_instead(self) -> Candidate | None:
        """A more probable set in whose place the named one is because its circuit comes closer (`_of_the_closer_circuit`)."""
        best = best_of(self.found.values())
        larger = best.fit.rms_error_percent >= ALIKE * self.model.fit.rms_error_percent
        return best if self.named and is_assumed(best.fit) and larger and best.fit.marginal.nothing_left >= 0.5 else None

    @property
    def instead_of_every_winding(self) -> Candidate | None:
        """If losses of copper and insulation are named for a winding alone: a single effect that needs more and describes it about as well."""
        only = self.base.measurement.terminations == ("short",) and len(self.named) == 2
        if not only or any(needs(name) != COMMONEST_FIRST[0] for name in self.named):
            return None
        most_percent = ALIKE * self.model.fit.rms_error_percent
        singles = [one for key, one in self.found.items() if len(key) == 1 and one.ordinary and needs(key[0]) != COMMONEST_FIRST[0]]
        return max((one for one in singles if one.fit.rms_error_percent <= most_percent), key=lambda one: one.score, default=None)

    @property
    def commoner_than(self) -> Candidate | None:
        """If one effect is named because it is commoner (`_commonest_first`): the most probable one of its family, if that is another."""
        if len(self.named) != 1 or self.base.measurement.terminations != ("short",) or not self.families[self.named[0]]:
            return None
        rivals = self.instead_of(self.named[0])
        likeliest = best_of([self.model, *(rivals[name] for name in self.families[self.named[0]])])
        needs_more = COMMONEST_FIRST.index(needs(likeliest.effect)) > COMMONEST_FIRST.index(needs(self.named[0]))
        return likeliest if needs_more else None

    @property
    def describes_nearly_all(self) -> Candidate | None:
        """If two effects are named: the most probable single one with usual values that leaves next to nothing by itself.

        The laws of effects are not known so accurately that a second one is certain.
        """
        if len(self.named) != 2:
            return None
        singles = [one for key, one in self.found.items() if len(key) == 1 and one.ordinary]
        return max((one for one in singles if self._sets.leaves_at_most(NEXT_TO_ALL, one)), key=lambda one: one.score, default=None)

    @property
    def of_several(self) -> str | None:
        """How reliable it is that several effects are named, a key of `belief.RELIABLE`; None for one effect or none."""
        if len(self.named) < 2:
            return None
        if len(self.named) > 2:
            return "three names"
        return "two names" if self.describes_nearly_all is None else "two names, one describes nearly all"

    @property
    def undecided(self) -> bool:
        """Whether an effect is more probable than none but not named, because analyser errors describe the same."""
        return bool(self.belief.named) and not self.named and not self.accurate

    @property
    def instead_of_the_analyser(self) -> Candidate | None:
        """If none is named and the analyser would have to err beyond its specification: the most probable effect with which it need not."""
        if self.named or self.base.analyser_sigma <= BEYOND_SIGMA:
            return None
        singles = [one for key, one in self.found.items() if len(key) == 1 and one.leaves_nothing and not of_the_analyser_alone(key)]
        return max((one for one in singles if one.fit.analyser_sigma <= SPECIFIED_SIGMA), key=lambda one: one.score, default=None)

    @cached_property
    def model(self) -> Candidate:
        """The accepted model: the base if no effect is named."""
        return self.best if self.named else self.found[()]

    @cached_property
    def acceptance(self) -> Acceptance:
        """Whether its remaining error is small enough to accept it."""
        found = acceptance_of(self.base, self.model.fit)
        unusual_single = len(self.model.added) == 1 and self.model.unusual and self.leaves_something
        # An effect with unusual values is not accepted if others come as close or much remains; if it has a family, the family is named.
        as_close = unusual_single and any(map(self._is_as_close, self.instead_of(*self.model.added).values()))
        poorly = unusual_single and (self.model.fit.unexplained_percent["value"] >= 100 * PLAIN or as_close)
        if (poorly and not any(self.belief.families.values())) or self._only_by_analyser_errors:
            return "not"
        # If most of the error is described but the rest exceeds what an impedance analyser can cause, more is missing. A law that is only
        # approximately that of the motor leaves such a rest as well, but a small one.
        if found == "mostly" and self.beyond_specification and not self._nearly_all_described:
            return "not"
        return found if len(self.model.added) < 2 or self._several_are_credible else "not"

    @property
    def _only_by_analyser_errors(self) -> bool:
        """Whether the circuit errs more than the base's and the difference is described by analyser errors far beyond the specification."""
        fit = self.model.fit
        return fit.analyser_sigma > BEYOND_SIGMA and fit.rms_error_percent > self.base.rms_error_percent

    @property
    def beyond_specification(self) -> bool:
        """Whether the accepted model needs errors far beyond the analyser's specification: more is missing, or another analyser was used.

        Errors of a network analyser's connection are less known: on real cores the right effect needed three times the specification.
        """
        return exceeds(self.model.fit)

    @property
    def leaves_hardly_anything(self) -> bool:
        """Whether a pair leaves so little that it is accepted although an impedance analyser would have to err beyond its specification.

        The circuit itself has to be as close, or to err by no more than noise and specification would leave: errors of the analyser that absorb the
        rest do not count.
        """
        pair, base = self.model, self.base
        if len(pair.added) != 2 or pair.unusual or self.distributed or base.measurement.analyser.by_waves:
            return False
        closer = pair.fit.rms_error_percent <= max(NEXT_TO_ALL * base.rms_error_percent, pair.fit.floor_percent)
        return self._sets.leaves_at_most(HARDLY_ANYTHING, pair) and closer and pair.fit.analyser_sigma > SPECIFIED_SIGMA

    @property
    def hardly_closer(self) -> bool:
        """Whether the accepted model's circuit misses by more than half, and more than half as far as the base: analyser errors do the rest.

        A fixture that nobody compensated is part of that error: if it is of ordinary size, the error says nothing.
        """
        fit = self.model.fit
        ordinary_fixture = fit.fixture_sigma > 0 and fit.instrument_sigma <= ALLOWED_SIGMA
        return not ordinary_fixture and fit.rms_error_percent > max(100 * HALF, HALF * self.base.rms_error_percent)

    @property
    def _nearly_all_described(self) -> bool:
        """Whether the accepted model describes all but a small share of what the base leaves."""
        return self._sets.leaves_at_most(NEARLY_ALL, self.model)

    @property
    def leaves_something(self) -> bool:
        """Whether an error remains beyond noise and analyser, and beyond a stated accuracy.

        Errors of the analyser that could describe everything only beyond its specification leave what the circuit does.
        """
        return leaves_an_error(self.model.fit) and not accurate(self.model.fit)

    @property
    def _several_are_credible(self) -> bool:
        """Whether two or three effects are acceptable.

        Pairs fit almost any curve, so they must leave nothing, or no more than specification or stated accuracy allow; or, with the analyser within
        its specification, at most 0.1 % or a tenth of what the base leaves; or a fiftieth of that, with a named analyser within twice its
        specification or one without a name within what is assumed. Or `pair_is_better`, whatever they leave, or if a further effect only corrects a
        law of them. Three must leave nothing, with the analyser within its specification. All with usual values.
        """
        fit = self.model.fit
        if self.pair_is_better or any(self._sets.corrects_a_law(self.model, one) for one in self.aside.values()):
            return True
        if len(self.model.added) > 2:
            return self.model.leaves_nothing and fit.analyser_sigma <= SPECIFIED_SIGMA and not self.distributed
        # Of an unnamed analyser only the size of the errors is known, so an error much smaller than these may be its own. The scatter of short
        # sweeps does not count as such an error. A pair that leaves next to nothing of the base's undescribed part is accepted too: of two motors
        # on unnamed analysers (two independent generators) the right pair left 0.5 % and 1.3 % of it.
        analyser_percent = np.sqrt(max(fit.floor_percent**2 - fit.noise_percent**2, 0.0))
        slight = fit.rms_error_percent <= SLIGHT_SHARE * min(analyser_percent, MOST_ERRING_PERCENT)
        within = fit.analyser_sigma <= SPECIFIED_SIGMA
        little = within and (fit.explained or self._nearly_all_described)
        next_to_all = self._sets.leaves_at_most(NEXT_TO_ALL, self.model)
        # A pair that leaves next to nothing is accepted up to twice the specification: of a cable with a lossy slot liner it left 0.04 %, and the
        # cable alone 50 times as much, with four times the errors of the analyser.
        allowed = fit.within_specification or little or next_to_all if fit.measurement.analyser.named else slight or (within and next_to_all)
        enough = allowed or not self.leaves_something
        return enough and not self.beyond_specification and not self.model.unusual and not self.distributed

    def is_better_than(self, single: Judgement) -> bool:
        """Whether a pair that is not accepted is better than one effect that would be named instead.

        It leaves next to nothing, and a tenth of what that effect leaves. Besides, that effect needs errors far beyond the analyser's
        specification, and the pair smaller ones (a choke at the brushes behind a capacitor left 0.1 %, and the capacitor alone 65 times as much
        with 14 times the specification); or the pair's circuit errs a tenth as much, and by no more than noise and specification would leave, which
        that effect's does not (skin effect of a thick strip behind half a metre of wire: 0.3 %, and the wire alone 5 %, where 2 % would be left).
        """
        pair, one = self.model, single.model
        if len(pair.added) != 2 or len(one.added) != 1 or pair.unusual or self.distributed:
            return False
        left, left_by_one, base = (fit.unexplained_percent["value"] for fit in (pair.fit, one.fit, self.base))
        relieved = single.beyond_specification and pair.fit.analyser_sigma < one.fit.analyser_sigma
        errs, one_errs = pair.fit.rms_error_percent, one.fit.rms_error_percent
        closer = errs <= min(NEARLY_ALL * one_errs, pair.fit.floor_percent) and one_errs > one.fit.floor_percent
        return left <= min(NEXT_TO_ALL * base, NEARLY_ALL * left_by_one) and (relieved or closer)

    @property
    def distributed(self) -> bool:
        """Whether the most probable model has two relaxations at one place: a part whose resistance is distributed has the same impedance."""
        return distributed(self.best.added)

    @property
    def described(self) -> bool:
        """Whether everything is described, by an accepted model or not: other analysers and contradictory sweeps are then not considered."""
        return self.best.done

    @property
    def accepted(self) -> bool:
        """Whether any model is accepted."""
        return self.acceptance != "not"

    @property
    def accurate(self) -> bool:
        """Whether the base is as good as the accuracy that the owner of the data stated."""
        return accurate(self.base)

    @cached_property
    def closest(self) -> Candidate:
        """The model that is shown if none is accepted: the whole machine, or the closest of those that were found."""
        return self.closest_found if self.whole is None else self.whole

    @cached_property
    def closest_found(self) -> Candidate:
        """The model whose circuit errs least; the most probable one may need large analyser errors.

        One with a fault of the analyser or its fixture is it only if it errs half as much: such a fault also describes part of a missing resonance.
        """
        faulty = {key for key in self.found if any(find_effect(name).effect.group == "instrument" for name in key)}
        return min(self.found.items(), key=lambda found: found[1].fit.rms_error_percent * (ALIKE if found[0] in faulty else 1.0))[1]

    @property
    def nearly_described(self) -> bool:
        """Whether the closest model leaves only a small share of what the base does: its effects may be those that are missing."""
        found = self.closest_found
        return bool(found.added) and self._sets.leaves_at_most(NEARLY_ALL, found)

    @property
    def gain(self) -> float:
        """Log odds of the most probable model against the base."""
        return self.best.score - self.found[()].score

    @property
    def of_singles(self) -> Judgement | None:
        """The judgement without larger sets, if one effect describes most by itself; None otherwise.

        It is in the most probable set; or its circuit errs at most as much (with usual values: less than twice as much), so that the set adds
        little; or no other single effect comes near it.
        """
        under = self.among({key: one for key, one in self.found.items() if len(key) <= 1})
        if not under.named or not under.accepted or self.distributed:
            return None
        alike = 1.0 if under.model.unusual else ALIKE
        closer = under.model.fit.rms_error_percent <= alike * self.best.fit.rms_error_percent
        return under if closer or set(under.named) & set(self.best.added) or under._unrivalled else None

    @property
    def _unrivalled(self) -> bool:
        """Whether every other model with as many effects is clearly less probable and errs more than twice as much."""
        own = self.model
        others = [one for one in self.found.values() if len(one.added) == len(own.added) and one is not own]
        return all(own.score - one.score > CLEAR_GAIN and one.fit.rms_error_percent > ALIKE * own.fit.rms_error_percent for one in others)

    @property
    def of_closest(self) -> Judgement | None:
        """The judgement among the single effects that come closest, if the most probable one does not; None if none of those is accepted.

        If every single effect leaves more than a per cent, the laws are approximate. The most probable effect may only allow larger analyser
        errors; the one with usual values that reduces the circuit's error most is better evidence.
        """
        singles = {key: one for key, one in self.found.items() if len(key) == 1}
        close = {key: one for key, one in singles.items() if one.ordinary}
        if not close or self.distributed:
            return None
        likeliest = best_of(singles.values())
        if likeliest.fit.unexplained_percent["value"] < 100 * PLAIN:
            return None
        least = min(one.fit.rms_error_percent for one in close.values())
        close = {key: one for key, one in close.items() if one.fit.rms_error_percent <= ALIKE * least}
        # The others stay known: one at a bound may be as close, and is then its family.
        closest = dataclasses.replace(self, belief=believe({key: one for key, one in self.found.items() if not key or key in close}))
        return closest if likeliest not in close.values() and closest.named and closest.accepted else None

    @property
    def or_closest(self) -> Judgement:
        """This judgement, or `of_closest` if one effect is named and leaves a part."""
        return (self.of_closest if self.acceptance == "mostly" and len(self.named) == 1 else None) or self

    @property
    def of_singles_as_good(self) -> Judgement | None:
        """`of_singles`, if the most probable set is a pair that leaves an error too and is not much more probable; None otherwise.

        A single effect beside which the analyser would err beyond its specification is not as good as a pair beside which it does not.
        """
        if len(self.named) < 2 or not self.leaves_something:
            return None
        single = self.of_singles
        if single is None or self.model.score - single.model.score > CLEAR_GAIN:
            return None
        excessive = single.model.fit.analyser_sigma > ALLOWED_SIGMA >= self.model.fit.analyser_sigma
        return None if excessive else single

    def among(self, found: Mapping[Key, Candidate]) -> Judgement:
        """The judgement if only these sets of effects had been tried."""
        return Judgement(self.base, found, believe(found))

    @cached_property
    def families(self) -> Mapping[str, Key]:
        """For each effect of the accepted model, the others that could replace it.

        If a model describes most and not all, its laws are approximate and likelihood ratios mean little: effects whose circuit errs about as
        much are its family.
        """
        own = {effect: (*family, *self._twins(effect, family)) for effect, family in self.belief.families.items()}
        if self.model.fit.marginal.nothing_left >= 0.5:
            return own
        return {effect: tuple(dict.fromkeys((*own[effect], *self._alike(effect)))) for effect in self.model.added}

    def _twins(self, effect: str, family: Key) -> Key:
        """Other effects with the law of one of a family, as a cage has that of a shorted turn: only their priors differ, so both are told."""
        named, posterior = tuple(sorted(self.belief.named)), self.belief.posterior
        told = {find_effect(name).effect.name: find_effect(name).effect.formula for name in family}
        least, twins = FAMILY_SHARE * posterior[named], []
        for name, key in in_place_of(effect, named, posterior).items():
            law = find_effect(name).effect
            if law.name not in told and law.formula in told.values() and posterior[key] >= least:
                twins.append(name)
        return tuple(twins)

    @property
    def probability(self) -> float:
        """Probability of the named effects, families included."""
        return agreeing(self.belief.posterior, self.named, self.families)

    @property
    def of_accurate(self) -> Judgement | None:
        """The judgement among the single effects that reach the stated accuracy, if one does; None otherwise.

        A second effect, or a more probable one that misses the accuracy, is then not needed.
        """
        enough = {key: one for key, one in self.found.items() if not key or (len(key) == 1 and accurate(one.fit))}
        if len(enough) == 1 or self.best.done:
            return None
        single = self.among(enough)
        return single if single.named and single.accepted else None

    @property
    def of_within(self) -> Judgement | None:
        """The judgement among the single effects with usual values that do as well as asked for or as the analyser can tell, if one is accepted.

        Only if the analyser would have to err far beyond its specification without an effect. That may be more probable, since smooth errors of any
        size describe much: of two turns on a core (NanoVNA) six effects left 0.4 to 0.8 % of 23 %, where noise and specification would leave 4 %,
        and each was less probable than 15 times the specification.
        """
        if not exceeds(self.base):
            return None
        singles = {key: one for key, one in self.found.items() if len(key) == 1 and one.ordinary}
        enough: dict[Key, Candidate] = {key: one for key, one in singles.items() if accurate(one.fit) or is_within(one.fit)}
        if not enough:
            return None
        single = dataclasses.replace(self, belief=believe(enough))
        return single if single.named and single.accepted else None

    def instead_of(self, effect: str) -> Mapping[str, Candidate]:
        """Models with another effect in the place of one of the accepted model's, by its name."""
        return {name: self.found[key] for name, key in in_place_of(effect, self.model.added, self.found).items()}

    def _is_as_close(self, one: Candidate) -> bool:
        """Whether another circuit errs about as little as the accepted model's."""
        return one.fit.rms_error_percent <= ALIKE * self.model.fit.rms_error_percent

    def _alike(self, effect: str) -> Key:
        """Effects that do about as well in the place of an accepted one, beside others only with usual values; the most probable first.

        Circuits that err by no more than noise and specification would leave are about equally good; so are those that leave less than what counts,
        as a leak of 420 kOhm in a wet slot (0.06 %) and a film of its resistance (0.03 %), but not beside unusual values.
        """
        limit = ALIKE * self.model.fit.unexplained_percent["value"]
        if not self.model.unusual:
            limit = max(limit, self.base.measurement.good_enough_percent)
        rivals = self.instead_of(effect)
        close = {name: one for name, one in rivals.items() if self._is_as_close(one) or is_within(one.fit)}
        alike = [name for name, one in close.items() if one.fit.unexplained_percent["value"] <= limit and not (len(one.added) > 1 and one.unusual)]
        return tuple(sorted(alike, key=lambda name: -close[name].score))

    @property
    def of_none(self) -> Judgement | None:
        """The judgement that no effect is missing, if the rest may be the analyser's error; None otherwise."""
        base = self.base
        # Median over the points of what the analyser may err by.
        typical_percent = 100 * float(np.median(np.concatenate(base.measurement.floors)))
        acceptance = acceptance_of(base, base)
        enough = acceptance == "explained" or (acceptance == "slight" and base.unexplained_percent["value"] <= typical_percent)
        return dataclasses.replace(self, none_named=True) if base.within_specification or enough else None

    @property
    def alternatives(self) -> list[Key]:
        """Sets that were found in which one effect of the accepted model is replaced by another of its family."""
        sets = []
        for effect in self.model.added:
            rest = list(self.model.added)
            rest.remove(effect)
            sets += [tuple(sorted((*rest, name))) for name in self.families[effect]]
        return [key for key in dict.fromkeys(sets) if key in self.found]

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
    """Whether a set has two relaxations at one place."""
    return any(sum(name in at_one_place for name in key) > 1 for at_one_place in RELAXING)


def accurate(base: Fit) -> bool:
    """Whether a circuit is as good as the accuracy that the owner of the data stated."""
    return base.measurement.accuracy_percent is not None and base.explained


def exceeds(fit: Fit) -> bool:
    """Whether a model needs errors far beyond the specification of a named analyser."""
    analyser = fit.measurement.analyser
    return analyser.named and fit.analyser_sigma > (BEYOND_SIGMA_OF_NETWORK if analyser.by_waves else BEYOND_SIGMA)


def needs(name: str) -> Needs:
    return find_effect(name).effect.needs_a


def leaves_an_error(fit: Fit) -> bool:
    """Whether the laws of a model are approximate: likelihood ratios then mean little."""
    return fit.marginal.nothing_left < 0.5 or fit.unexplained_percent["value"] >= 100 * PLAIN
