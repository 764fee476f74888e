"""Two effects at once: which pairs are worth a look, and where they lead.

All pairs would be too many. The search starts from the best single effects, takes a few steps with every second one beside them, follows
those that begin best, and stops as soon as a pair describes the data down to the noise.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import TypeAlias

from motoremi.arrays import Progress
from motoremi.diagnosis.evidence import (
    Candidate,
    glances,
    near_noise,
    possible_effects,
    possible_rivals,
    refitted,
)
from motoremi.diagnosis.scouts import Scouts, improved, nearest
from motoremi.fitting.fit import trail_to
from motoremi.fitting.looks import FEW_POINTS, Begun, Scouted, Trail, pursue, search_through
from motoremi.fitting.search import surely_right

# A first effect and a second one.
Pair: TypeAlias = tuple[str, str]
# From how many of the best single effects a second one is looked for at once, and from how many in the end.
FIRSTS = 3
MORE_FIRSTS = 5
# Where these do not do, how many of those that recur in the nearest pairs are tried beside each other.
RECURRING = 6
# Of those that begin together, how many are followed: one more than it took. In 115 blind pairs of other seeds the right one was never behind
# the third of a row, nor behind the seventh of those begun from a pair that is near.
FOLLOWED = 4
FOLLOWED_IF_NEAR = 8
# How many of those followed are pursued if they are near.
PURSUED = 2
# Of all looks, so many are pursued whether near or not.
NEAREST = 4
# Pairs that leave less than so many times the chi-squared of noise alone are near: one of the two may have a rival that is right.
NEAR_FACTOR = 100.0
# Better partners for the two of the nearest pair are sought again where they leave so much less, but no more than so many times.
NEARER = 0.3
MOST_EXCHANGES = 2
# How many rivals for the second place beside a first effect are looked at once a pair is right.
RIVALS = 6
# Where nothing is right, so many of the nearest are searched through, and looked at from the other side.
THOROUGH = 1
# Rivals for each place of a pair that are tried together: two effects may look like two others, neither of which fits beside one of them.
CROSSED = 3
# How often a pair that is right on a thinned grid is tried on all points.
MOST_JUDGEMENTS = 5
# A second effect that leaves so many times the best one's chi-squared is no rival of it.
HOPELESS_FACTOR = 30.0


def rank_pairs(singles: Sequence[Candidate], progress: Progress | None = None) -> tuple[Candidate, list[Candidate]]:
    """The most promising of the single effects as the first of two, and candidates for the second one beside it.

    What describes the data best alone need not be one of the two, so the search starts from several; since the fit of a single
    effect may lie in a wrong valley, the most promising is also looked at as the second one beside all others; and from a pair that is
    near, better partners are sought for each of the two.

    Parameters
    ----------
    singles : sequence of Candidate
        On top of the same model, best evidence first.
    progress : callable, optional
        Told what is tried, how much is done, and of how much.
    """
    return _Search(singles, progress).result()


def crossed(
    singles: Mapping[str, Candidate], pair: Mapping[str, float], firsts: Mapping[str, Scouted], seconds: Mapping[str, Scouted]
) -> dict[Pair, Scouted]:
    """The nearest rivals for both places of a pair together.

    Parameters
    ----------
    singles : mapping
        Single effects by name.
    pair : mapping
        Parameters with the pair, SI units.
    firsts, seconds : mapping
        Looks at others in the one and in the other place, by name.
    """
    trails = {}
    for first in nearest(firsts)[:CROSSED]:
        for second in nearest(seconds)[:CROSSED]:
            if first != second and first in singles:
                own = {**_own(firsts[first], first), **_own(seconds[second], second)}
                trail = trail_to(singles[first].fit, second, near=pair, points=FEW_POINTS)
                trails[first, second] = dataclasses.replace(trail, starts=[{**pair, **own}], group=1)
    with Scouts(trails) as scouts:
        looks = scouts.followed(scouts.begun(), FOLLOWED)
        scouts.improve(looks, nearest(looks)[:PURSUED], pursue)
    return looks


def _own(look: Scouted, effect: str) -> dict[str, float]:
    return {name: value for name, value in look.values().items() if name.startswith(f"{effect}.")}


class _Search:
    def __init__(self, singles: Sequence[Candidate], progress: Progress | None) -> None:
        self._singles = {single.effect: single for single in singles}
        self._firsts = list(self._singles)
        self._near_noise = {single.effect: near_noise(single.fit) for single in singles}
        self._progress = progress
        self._begun: dict[Pair, Begun] = {}
        self._followed: set[Pair] = set()
        self._looks: dict[Pair, Scouted] = {}
        self._judged: set[Pair] = set()
        self._ends: dict[Pair, float] = {}
        self._exchange_below = NEAR_FACTOR
        self._exchanged = 0

    def result(self) -> tuple[Candidate, list[Candidate]]:
        near, wide = (self._pursued, self._exchanges), (self._more_rows, self._exchanges, self._recombined)
        for stage in (self._rows, *near, *wide, *near, self._thoroughly):
            found = stage()
            if found is not None:
                return found
        first, second = nearest(self._looks)[0]
        return self._singles[first], self._refitted(first, {second: self._looks[first, second]})

    def _rows(self) -> tuple[Candidate, list[Candidate]] | None:
        """Every second effect beside the best single ones; what the data favour most deserves a look from both sides."""
        best, *others = self._firsts[:FIRSTS]
        for pairs in (self._row(best), self._column(best), [pair for first in others for pair in self._row(first)]):
            self._look(pairs)
            if (found := self._right()) is not None:
                return found
        return None

    def _more_rows(self) -> tuple[Candidate, list[Candidate]] | None:
        """Where several single effects draw the same curve, the right one may come later."""
        self._look([pair for first in self._firsts[FIRSTS:MORE_FIRSTS] for pair in self._row(first)])
        return self._right()

    def _recombined(self) -> tuple[Candidate, list[Candidate]] | None:
        """What recurs in the nearest pairs, each beside each: what one says little alone, it may say beside the right other."""
        recurring = list(dict.fromkeys(name for pair in nearest(self._looks) for name in pair))[:RECURRING]
        self._look([(first, second) for first in recurring if first in self._singles for second in recurring if first != second])
        return self._right()

    def _exchanges(self) -> tuple[Candidate, list[Candidate]] | None:
        """Look for a better partner of each of two effects that are near, from where the two of them led."""
        while True:
            pair = nearest(self._looks)[0]
            if _factor(self._looks[pair]) > self._exchange_below or self._exchanged == MOST_EXCHANGES:
                return None
            self._exchanged += 1
            self._exchange_below = NEARER * _factor(self._looks[pair])
            near = self._looks[pair].values()
            self._look([*self._instead(pair[0], pair[1]), *self._instead(pair[1], pair[0])], FOLLOWED_IF_NEAR, near)
            if (right := self._right()) is not None:
                return right
            self._keep(crossed(self._singles, near, self._others(pair[1], pair), self._others(pair[0], pair)))
            if (right := self._right()) is not None:
                return right

    def _thoroughly(self) -> tuple[Candidate, list[Candidate]] | None:
        """The nearest pairs from the other side, then searched through."""
        ahead = nearest(self._looks)[:THOROUGH]
        self._look([(second, first) for first, second in ahead if second in self._singles and (second, first) not in self._followed])
        if (found := self._right()) is not None:
            return found
        improved(self._looks, nearest(self._looks)[:THOROUGH], search_through)
        return self._right()

    def _pursued(self) -> tuple[Candidate, list[Candidate]] | None:
        """The nearest of all, near or not, to their end."""
        ahead = [pair for pair in nearest(self._looks)[:NEAREST] if self._looks[pair].objective != self._ends.get(pair)]
        improved(self._looks, ahead, pursue)
        self._ends |= {pair: self._looks[pair].objective for pair in ahead}
        return self._right()

    def _others(self, first: str, without: Pair) -> dict[str, Scouted]:
        return {pair[1]: look for pair, look in self._looks.items() if pair[0] == first and pair[1] not in without}

    def _row(self, first: str) -> list[Pair]:
        """Every second effect beside a first one."""
        return [(first, second) for second in possible_effects(self._singles[first].fit)]

    def _instead(self, first: str, second: str) -> list[Pair]:
        """Beside a first effect, all that show where a second one does."""
        if first not in self._singles:
            return []
        return [(first, rival) for rival in possible_rivals(self._singles[first].fit, second)]

    def _column(self, second: str) -> list[Pair]:
        """A second effect beside every first one."""
        return [(first, second) for first in self._singles if first != second]

    def _look(self, pairs: Sequence[Pair], most: int = FOLLOWED, near: Mapping[str, float] | None = None) -> None:
        """Look at pairs; what is begun by the likelihood is not compared with what is not."""
        for is_near in (True, False):
            if these := [pair for pair in pairs if self._near_noise[pair[0]] == is_near]:
                self._look_at(these, is_near, most, near)

    def _trail(self, pair: Pair, likely: bool, near: Mapping[str, float] | None) -> Trail:
        return trail_to(self._singles[pair[0]].fit, pair[1], near=near, points=FEW_POINTS, by_likelihood=likely)

    def _look_at(self, pairs: Sequence[Pair], likely: bool, most: int, near: Mapping[str, float] | None) -> None:
        """Begin what has not been begun (anew where a pair is `near`), follow those that begin best, and pursue the nearest."""
        pairs = pairs if near else [pair for pair in pairs if pair not in self._followed]
        old = {} if near else {pair: self._begun[pair] for pair in pairs if pair in self._begun}
        trails = {pair: old[pair].trail if pair in old else self._trail(pair, likely, near) for pair in pairs}
        with Scouts(trails) as scouts:
            found = scouts.begun([pair for pair in pairs if pair not in old], self._progress)
            looks = scouts.followed({**old, **found}, most)
            ahead = nearest(looks)[:PURSUED]
            scouts.improve(looks, (pair for pair in ahead if _factor(looks[pair]) < NEAR_FACTOR), pursue)
        if not near:
            self._begun |= found
            self._followed |= set(looks)
        self._keep(looks)

    def _keep(self, looks: Mapping[Pair, Scouted]) -> None:
        """The better look at each pair."""
        for pair, look in looks.items():
            if pair not in self._looks or look.objective < self._looks[pair].objective:
                self._looks[pair] = look

    def _right(self) -> tuple[Candidate, list[Candidate]] | None:
        """The nearest pair that describes the data on all points, with its rivals."""
        right = {pair: look for pair, look in self._looks.items() if look.right}
        for first, second in nearest(right):
            if (first, second) in self._judged or len(self._judged) >= MOST_JUDGEMENTS:
                continue
            self._judged.add((first, second))
            if self._refitted(first, {second: right[first, second]})[0].good:
                return self._singles[first], self._beside(first)
        return None

    def _beside(self, first: str) -> list[Candidate]:
        """Candidates for the second effect beside a first one, best evidence first."""
        found = {pair[1]: look for pair, look in self._looks.items() if pair[0] == first}
        best = found[nearest(found)[0]]
        for name, look in glances(self._singles[first].fit, RIVALS, best.values(), nearest(found)[0], self._progress).items():
            if name not in found or look.objective < found[name].objective:
                found[name] = look
        limit = HOPELESS_FACTOR * best.objective
        return self._refitted(first, {name: look for name, look in found.items() if look.objective <= limit})

    def _refitted(self, first: str, looks: Mapping[str, Scouted]) -> list[Candidate]:
        return refitted(self._singles[first].fit, looks)


def _factor(look: Scouted) -> float:
    """What a look leaves over what noise alone would."""
    return look.objective / surely_right(look.trail.likelihood)
