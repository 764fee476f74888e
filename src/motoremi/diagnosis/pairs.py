"""Two effects at once: which pairs are worth a look, and where they lead.

All pairs would be too many. The search starts from the best single effects, takes a few steps with every second one beside them, follows
those that begin best, and stops as soon as a pair describes the data down to the noise.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TypeAlias

from motoremi.arrays import Progress
from motoremi.diagnosis.evidence import Candidate, begun_with, glances, nearest, possible_effects, refitted
from motoremi.fitting.search import Begun, Scouted, followed, pursued, searched_through

# A first effect and a second one.
Pair: TypeAlias = tuple[str, str]
# From how many of the best single effects a second one is looked for, and from how many in all.
BEAM = 4
MOST_FIRST = 5
# Of those that begin together, how many are looked at further, and how many of these are pursued to their end. In 43 blind pairs of other
# seeds the right one was among the first five of its row in nine cases out of ten, and always among the first thirty of all.
FOLLOWED = 6
PURSUED = 2
# The same over all pairs where none of these is right, and how many are searched through then.
FOLLOWED_LATE = 12
PURSUED_LATE = 6
SEARCHED_LATE = 2
# How often better partners are sought for the two of the nearest pair.
EXCHANGES = 2
# Rivals for the second place beside a first effect that are looked at once a pair is right.
RIVALS = 12
# A second effect that leaves so many times the best one's chi-squared is no rival of it.
HOPELESS_FACTOR = 30.0
# How many are refitted where none is right.
REFITTED_IN_THE_DARK = 4


def rank_pairs(singles: Sequence[Candidate], progress: Progress | None = None) -> tuple[Candidate, list[Candidate]]:
    """The most promising of the single effects as the first of two, and candidates for the second one beside it.

    What describes the data best alone need not be one of the two, so the search starts from several; and since the fit of a single
    effect may lie in a wrong valley, the most promising are also looked at as the second one beside all others.

    Parameters
    ----------
    singles : sequence of Candidate
        On top of the same model, best evidence first.
    progress : callable, optional
        Told what is tried, how much is done, and of how much.
    """
    return _Search(singles, progress).result()


class _Search:
    def __init__(self, singles: Sequence[Candidate], progress: Progress | None) -> None:
        self._singles = {single.effect: single for single in singles}
        self._progress = progress
        self._begun: dict[Pair, Begun] = {}
        self._looks: dict[Pair, Scouted] = {}

    def result(self) -> tuple[Candidate, list[Candidate]]:
        waiting, tried = list(self._singles)[:BEAM], list[str]()
        while waiting and len(tried) < MOST_FIRST:
            first = waiting.pop(0)
            tried.append(first)
            self._look(self._row(first), FOLLOWED, PURSUED)
            if len(tried) == 1 or len(tried) > BEAM:
                # What the data favour most, alone or as a second effect, deserves a look from both sides.
                self._look(self._column(first), FOLLOWED, PURSUED)
            if (found := self._right()) is not None:
                return found
            if not waiting:
                # What helps as a second effect, whatever the first, may be one of the two though it says little alone.
                waiting = [second for _, second in nearest(self._looks) if second not in tried][:1]
        self._look(self._begun, FOLLOWED_LATE, PURSUED_LATE)
        for _ in range(EXCHANGES):
            if (found := self._right()) is not None:
                return found
            self._exchange(nearest(self._looks)[0])
        for pair in nearest(self._looks)[:SEARCHED_LATE]:
            self._looks[pair] = searched_through(self._looks[pair])
        if (found := self._right()) is not None:
            return found
        first, _ = nearest(self._looks)[0]
        return self._singles[first], self._beside(first)

    def _row(self, first: str) -> list[Pair]:
        """A first effect with every second one."""
        return [(first, second) for second in possible_effects(self._singles[first].fit)]

    def _column(self, second: str) -> list[Pair]:
        """A second effect beside every first one."""
        return [(first, second) for first in self._singles if first != second]

    def _look(self, pairs: Iterable[Pair], most: int, most_pursued: int) -> None:
        """Begin what has not been begun, follow those that begin best, and pursue the nearest."""
        wanted = list(pairs)
        fresh = ((pair, self._singles[pair[0]].fit, pair[1]) for pair in wanted if pair not in self._begun)
        self._begun.update(begun_with(fresh, progress=self._progress))
        left = {pair: self._begun[pair] for pair in wanted if pair not in self._looks}
        found = {pair: followed(left[pair]) for pair in nearest(left)[:most]}
        self._looks.update(found)
        for pair in nearest({pair: look for pair, look in self._looks.items() if pair in wanted})[:most_pursued]:
            self._looks[pair] = pursued(self._looks[pair])

    def _exchange(self, pair: Pair) -> None:
        """Look for a better partner of each of two effects, from where the two of them led."""
        near = self._looks[pair].values()
        for kept in pair:
            fit = self._singles[kept].fit
            begun = begun_with((((kept, other), fit, other) for other in possible_effects(fit)), near, self._progress)
            for name in nearest(begun)[:FOLLOWED]:
                look = pursued(followed(begun[name]))
                if name not in self._looks or look.objective < self._looks[name].objective:
                    self._looks[name] = look

    def _right(self) -> tuple[Candidate, list[Candidate]] | None:
        """The nearest pair with its rivals, if it describes the data."""
        right = {pair: look for pair, look in self._looks.items() if look.right}
        if not right:
            return None
        first, _ = nearest(right)[0]
        ranked = self._beside(first)
        return (self._singles[first], ranked) if ranked[0].good else None

    def _beside(self, first: str) -> list[Candidate]:
        """Candidates for the second effect beside a first one, best evidence first."""
        found = {pair[1]: look for pair, look in self._looks.items() if pair[0] == first}
        best = found[nearest(found)[0]]
        if best.right:
            found = glances(self._singles[first].fit, RIVALS, best.values(), self._progress) | found
        limit = HOPELESS_FACTOR * best.objective
        return refitted(self._singles[first].fit, {name: look for name, look in found.items() if look.objective <= limit})
