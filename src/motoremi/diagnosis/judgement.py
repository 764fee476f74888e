"""What the search found for one set of sweeps, taken for those of one analyser, and what is believed of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from motoremi.arrays import Progress
from motoremi.diagnosis.belief import MOST_NAMES, Belief, Standing, believe, stands
from motoremi.diagnosis.candidates import ALLOWED_SIGMA, Candidate, Effects
from motoremi.diagnosis.explore import Budget, Key, best_of, explore
from motoremi.diagnosis.motors import MotorBoard
from motoremi.fitting.result import Fit
from motoremi.model.effects import find_effect

BUDGET = Budget()
# What a named effect must leave at most of what was left, or of how far the analyser's errors had to go where that was too far. Odds of e^60 need
# no halving; below them what lies beyond the catalogue's ranges may be meant, and leads that differ between the sweeps are likelier than
# a part of the motor of their size.
HALF, RELIEF = 0.5, 0.6
CLEAR_GAIN = 60.0
# A line of resistance and capacitance is a sum of relaxations (its Foster form), and over this band two terms of it are enough.
RELAXING_TWICE = ({"dielectric-relaxation@Cf", "dielectric-relaxation@Cr"}, {"dielectric-relaxation@Cf", "bearing-film"})


@dataclass(frozen=True, eq=False)
class Judgement:
    """All models that were found, and what they let one believe. Immutable.

    Parameters
    ----------
    base : Fit
    found : dict
        Candidate of each set of effects.
    belief : Belief
    """

    base: Fit
    found: Mapping[Key, Candidate]
    belief: Belief

    @cached_property
    def best(self) -> Candidate:
        """The likeliest model."""
        return best_of(self.found.values())

    @cached_property
    def named(self) -> Effects:
        """The effects that are believed: those of the likeliest model, if they matter."""
        return self.belief.named if self.belief.named and self._matters else ()

    @property
    def _matters(self) -> bool:
        """Whether the likeliest model is better for a user too: it describes what the base leaves, or asks the analyser for much less."""
        before, after = self.base, self.best.fit
        clear = self.gain > CLEAR_GAIN
        left = before.unexplained_percent["value"]
        # A network analyser sees best at its reference resistance: an error that is small there may be large elsewhere.
        seen = left > before.measurement.good_enough_percent or before.measurement.analyser.by_reflection
        halved = after.unexplained_percent["value"] <= HALF * left
        described = before.marginal.nothing_left < 0.5 and seen and (clear or halved)
        closer = before.rms_error_percent > before.floor_percent and after.rms_error_percent <= HALF * before.rms_error_percent
        relieved = before.analyser_sigma > ALLOWED_SIGMA and after.analyser_sigma <= RELIEF * before.analyser_sigma
        of_the_instrument = all(find_effect(name).effect.group == "instrument" for name in self.best.added)
        return described or closer or (relieved and clear) or (of_the_instrument and (relieved or clear))

    @cached_property
    def model(self) -> Candidate:
        """The one that is believed: the base where nothing is named."""
        return self.best if self.named else self.found[()]

    @cached_property
    def standing(self) -> Standing:
        """Whether it leaves so little that it can be called the motor's."""
        standing = stands(self.base, self.model.fit)
        if len(self.model.added) > MOST_NAMES:
            return "not"
        stated = self.base.measurement.accuracy_percent is not None
        if len(self.model.added) == MOST_NAMES and standing != "not" and not stated and self.model.fit.marginal.nothing_left < 0.5:
            # Two effects bend to almost anything: they are believed only where they leave nothing, and not with values that few motors have.
            return "not"
        if len(self.model.added) == MOST_NAMES and (self.model.unusual or self.distributed):
            return "not"
        return standing

    @property
    def distributed(self) -> bool:
        """Whether the likeliest model is of two relaxations along the path to the frame: so is any one layer whose resistance is distributed."""
        return set(self.best.added) in RELAXING_TWICE

    @property
    def described(self) -> bool:
        """Whether one or two effects leave nothing, believed or not: then neither analyser nor sweeps are in question."""
        return self.best.done and len(self.best.added) <= MOST_NAMES

    @property
    def stands(self) -> bool:
        """Whether it stands at all."""
        return self.standing != "not"

    @property
    def accurate(self) -> bool:
        """Whether the base is as good as the accuracy that the owner of the data stated."""
        return self.base.measurement.accuracy_percent is not None and self.base.explained

    @cached_property
    def closest(self) -> Candidate:
        """The one whose circuit errs least: what to show where none stands, since there the likeliest may lean on the analyser's errors."""
        return min(self.found.values(), key=lambda one: one.fit.rms_error_percent)

    @property
    def gain(self) -> float:
        """Log odds of the likeliest model against the base."""
        return self.best.score - self.found[()].score

    def rivals(self) -> list[Fit]:
        """The fits that these data cannot tell from the believed one, it first; empty where there are none."""
        fits = [self.model.fit]
        for effect, family in self.belief.families.items():
            rest = list(self.model.added)
            rest.remove(effect)
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


def judge(base: Fit, progress: Progress | None = None, budget: Budget = BUDGET) -> Judgement:
    """Search what is missing from a fit, and decide."""
    board = MotorBoard(base)
    found = explore(board, board.start(), budget, progress)
    return Judgement(base, found, believe(found))
