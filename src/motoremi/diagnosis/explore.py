"""The search over sets of effects: a beam, with three moves.

From the models at hand an effect is *added*; in the best of what that gives, one effect is *swapped* for another, started from the
solution so that a look-alike cannot lose by not converging; and one that was there before may be *dropped*. The search ends when nothing is
left, when a further effect gains nothing, or at the largest size. Where the answer of such a search is least certain, a second one
(`explore_again`) spends more on it. What can be added, and how likely a model is, the board says: motors and
their sweeps (`motors`), or sources and their spectra (`emission.diagnose`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import Protocol, TypeVar

from motoremi.arrays import Progress
from motoremi.progress import part

Key = tuple[str, ...]
# What adding takes of the time of one size, roughly; swapping takes the rest.
ADDING = 0.6


class Model(Protocol):
    """A model with effects added."""

    @property
    def added(self) -> Key:
        """Effects, in the order in which they were added."""

    @property
    def score(self) -> float:
        """Log of evidence times prior."""

    @property
    def done(self) -> bool:
        """Whether nothing is left that another effect could describe."""


M = TypeVar("M", bound=Model)


class Board(Protocol[M]):
    """What a search is about."""

    def added(self, model: M, progress: Progress | None) -> Iterable[M]:
        """The model with each effect that can be added; those worth a thought."""

    def swapped(self, model: M, effect: str) -> Iterable[M]:
        """The model with others in the place of one of its effects, sought from its solution."""

    def dropped(self, model: M, effect: str) -> M:
        """The model without one of its effects, sought from its solution."""

    def twins(self, one: M, other: M) -> bool:
        """Whether two models describe the data alike, so that adding to one of them is enough."""


class ThoroughBoard(Board[M], Protocol[M]):
    """What a second search needs beside."""

    def alike(self, one: M, other: M) -> bool:
        """Whether two models differ only in one effect that is known to look like the other's."""

    def error(self, model: M) -> float:
        """By how much it misses the data."""

    def sought_anew(self, model: M) -> Iterable[M]:
        """The model, each of its effects in turn from all its start values."""


@dataclass(frozen=True)
class Budget:
    """What a search may spend.

    Parameters
    ----------
    beam : int
        Models of one size that are added to. Four single effects were enough for the pairs of the blind seeds 5 and 6.
    swapped : int
        Models of one size in which effects are swapped. The second is for what ends within the gain of the first.
    swaps : tuple of int
        How often at most each size is swapped before it stands still. There are no larger sets: more than two effects describe almost any
        curve, right or wrong, and none such is named.
    share : float
        Models that gain less than this share of what the best of their size gains are not added to: what two effects gain together, one of
        them mostly gains a good part of alone.
    gain : float
        What a further effect, or a swap, must gain in log score: odds of 20 to 1.
    again : int
        Models that a second search adds to where the first ended with two effects that leave nothing: such an effect is mostly the best alone, or
        the second if it is a twin.
    """

    beam: int = 4
    swapped: int = 2
    swaps: tuple[int, ...] = (2, 3)
    share: float = 0.3
    gain: float = 3.0
    again: int = 2

    @property
    def most_effects(self) -> int:
        """Size of the largest sets."""
        return len(self.swaps)


def key_of(model: Model) -> Key:
    """A model by what is added, whatever the order."""
    return tuple(sorted(model.added))


def best_of(models: Iterable[M]) -> M:
    """The model of the highest score."""
    return max(models, key=lambda model: model.score)


def explore(board: Board[M], base: M, budget: Budget, progress: Progress | None = None) -> dict[Key, M]:
    """All models that were found, by what is added; `base` itself under the empty key.

    Parameters
    ----------
    board : Board
    base : Model
        Nothing added.
    budget : Budget
    progress : callable, optional
        Told what is being tried.
    """
    found: dict[Key, M] = {(): base}
    beam = [base]
    for size in range(1, budget.most_effects + 1):
        before = best_of(found.values())
        own = part(progress, (size - 1) / budget.most_effects, size / budget.most_effects)
        for place, model in enumerate(beam):
            _take(found, board.added(model, part(own, ADDING * place / len(beam), ADDING * (place + 1) / len(beam))))
        # Where no further effect is worth having, neither is another in its place.
        if best_of(found.values()).score - before.score < budget.gain:
            break
        _swap(board, found, size, budget, part(own, ADDING, 1.0))
        best = best_of(found.values())
        if len(best.added) == size > 1:
            _take(found, (board.dropped(best, effect) for effect in best.added))
        if best.done:
            break
        beam = _without_twins(board, _worth_adding_to(_ranked(found, size), base, budget))[: budget.beam]
    return found


def explore_again(board: ThoroughBoard[M], found: Mapping[Key, M], budget: Budget, progress: Progress | None = None) -> dict[Key, M]:
    """What a search found, and what a second one finds beside it.

    Single effects are tried once more unless the first ended with two that leave nothing. To the best of them, twins as well, to the closest, and
    to those that the first ended with, others are added; and the look-alikes of what is then the likeliest are sought anew.

    Parameters
    ----------
    board : ThoroughBoard
    found : mapping
        By what is added, the base under the empty key.
    budget : Budget
    progress : callable, optional
        Told what is being tried.
    """
    found = dict(found)
    base, best = found[()], best_of(found.values())
    beam = budget.again
    if len(best.added) < 2 or not best.done:
        _take(found, board.added(base, part(progress, 0.0, 0.2)))
        beam = budget.beam
    singles = _ranked(found, 1)
    under = _worth_adding_to(singles, base, budget)[:beam]
    if beam == budget.beam:
        # What is missing beside an effect may make it look less likely than none, though it comes closest.
        under.append(min(singles, key=board.error))
    under = list({key_of(one): one for one in (*under, *(found[(name,)] for name in best.added if (name,) in found))}.values())
    for place, model in enumerate(under):
        _take(found, board.added(model, part(progress, 0.2 + 0.6 * place / len(under), 0.2 + 0.6 * (place + 1) / len(under))))
    # Effects of what the first search ended with were swapped then.
    if best_of(found.values()).score > best.score + budget.gain:
        _swap(board, found, 2, budget, part(progress, 0.8, 1.0))
    best = best_of(found.values())
    for model in [one for one in found.values() if len(one.added) == len(best.added) > 1 and board.alike(one, best)]:
        _take(found, board.sought_anew(model))
    return found


def _worth_adding_to(ranked: Sequence[M], base: M, budget: Budget) -> list[M]:
    """Those that gain a good part of what the best gains."""
    least = base.score + budget.share * (ranked[0].score - base.score)
    return [model for model in ranked if model.score >= least]


def _without_twins(board: Board[M], ranked: Sequence[M]) -> list[M]:
    """Of twins only the better, since the other is swapped in where it is meant."""
    kept: list[M] = []
    for model in ranked:
        if not any(board.twins(one, model) for one in kept):
            kept.append(model)
    return kept


def _swap(board: Board[M], found: dict[Key, M], size: int, budget: Budget, progress: Progress | None) -> None:
    """Swap effects of the best models of one size until that changes nothing."""
    swapped: set[Key] = set()
    best = -inf
    times = budget.swaps[size - 1]
    done, most = 0, times * budget.swapped * size
    for _ in range(times):
        ranked = _ranked(found, size)
        if not ranked or ranked[0].score < best + budget.gain:
            return
        best = ranked[0].score
        # Beside one that leaves nothing, only its own look-alikes matter.
        count = 1 if ranked[0].done else budget.swapped
        models = [model for model in ranked[:count] if key_of(model) not in swapped and model.score > best - budget.gain]
        for model in models:
            swapped.add(key_of(model))
            for effect in model.added:
                if progress is not None:
                    progress(f"others for {effect}", done, most)
                done += 1
                _take(found, board.swapped(model, effect))


def _ranked(found: Mapping[Key, M], size: int) -> list[M]:
    return sorted((model for key, model in found.items() if len(key) == size), key=lambda model: -model.score)


def _take(found: dict[Key, M], models: Iterable[M]) -> None:
    """Keep the better of two models of one key."""
    for model in models:
        key = key_of(model)
        if key not in found or model.score > found[key].score:
            found[key] = model
