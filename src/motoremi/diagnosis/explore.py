"""The search over sets of effects, those of one size after the other.

All sets of a size are compared (`Board.sets`). In the best of them one effect is then *swapped* for another, started from the
solution so that a look-alike cannot lose by not converging; a swap that hardly changes a likely model is made in the others as well; and one that
was there before may be *dropped*: if that leads to a smaller set that is better than all of its size before, further effects are compared beside
it. The search ends when everything is described, when a further effect gains nothing (pairs are tried nevertheless if the base errs by far), or at
the largest size. A `Board` supplies the models and their scores: of motors for sweeps (`motor_board`), of sources for spectra (`emission.board`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations
from math import inf
from typing import Protocol, TypeVar

from motoremi.arrays import Progress
from motoremi.progress import part

Key = tuple[str, ...]
# Rough share of the time that the comparison of one size takes, for the progress bar; swapping takes the rest.
COMPARING = 0.7


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
        """Whether nothing remains for another effect to describe."""


M = TypeVar("M", bound=Model)


class Board(Protocol[M]):
    """The interface through which a search gets its models."""

    @property
    def much_is_left(self) -> bool:
        """Whether the model with nothing added errs so much that two effects may describe together what neither does alone."""

    def sets(self, size: int, found: Mapping[Key, M], progress: Progress | None) -> Iterable[M]:
        """Models with this many effects, given those with fewer; only those near the best."""

    def swapped(self, model: M, effect: str, only: str = "") -> Iterable[M]:
        """The model with others, or `only` one, in the place of one of its effects, fitted from its solution."""

    def dropped(self, model: M, effect: str) -> M:
        """The model without one of its effects, fitted from its solution."""

    def beside(self, model: M) -> Iterable[M]:
        """The model with a further effect, each in turn; only those near the best."""


@dataclass(frozen=True)
class Budget:
    """Limits of a search.

    Parameters
    ----------
    swapped : tuple of int
        Number of models of each size in which effects are swapped. A second one is swapped only if its score is within `gain` of the first.
    swaps : tuple of int
        Largest number of rounds of swaps, for each size. Their count is the largest size: more than three effects describe almost any curve.
    gain : float
        Smallest gain in log score of a further effect or a swap: odds of 20 to 1.
    loss : float
        Models within this log score of the best one are rivals of it (as in an investigation, `rivals.BEHIND`): a swap between two of them is made
        in all.
    """

    swapped: tuple[int, ...] = (2, 2, 1)
    swaps: tuple[int, ...] = (2, 3, 2)
    gain: float = 3.0
    loss: float = 12.0

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


def explore(
    board: Board[M], base: M, budget: Budget, progress: Progress | None = None, further: Callable[[M], bool] = lambda best: True
) -> dict[Key, M]:
    """All models that were found, by what is added; `base` itself under the empty key.

    Parameters
    ----------
    board : Board
    base : Model
        Nothing added.
    budget : Budget
    progress : callable, optional
        Called with a text, the work done and its total.
    further : callable, optional
        Asked with the best model with at most one effect, if it does not describe everything: whether larger sets are to be compared.
    """
    found: dict[Key, M] = {(): base}
    for size in range(1, budget.most_effects + 1):
        before = best_of(found.values())
        own = part(progress, (size - 1) / budget.most_effects, size / budget.most_effects)
        _take(found, board.sets(size, found, part(own, 0.0, COMPARING)))
        if best_of(found.values()).score - before.score >= budget.gain:
            _swap(board, found, size, budget, part(own, COMPARING, 1.0))
            _swap_as_well(board, found, size, budget)
        elif size > 1 or not board.much_is_left:
            # If no further effect gains enough, swapping it cannot help.
            break
        best = best_of(found.values())
        if len(best.added) == size > 1:
            _drop(board, found, best, budget)
            best = best_of(found.values())
        if best.done or (size == 1 < budget.most_effects and not further(best)):
            break
    return found


def _swap(board: Board[M], found: dict[Key, M], size: int, budget: Budget, progress: Progress | None) -> None:
    """Swap effects of the best models of one size until that changes nothing."""
    # The score of a set when its effects were swapped: it may be found again, in another local minimum, with a higher one.
    swapped: dict[Key, float] = {}
    best = -inf
    times, models_of_size = budget.swaps[size - 1], budget.swapped[size - 1]
    done, most = 0, times * models_of_size * size
    for _ in range(times):
        leaders = ranked(found, size)
        if not leaders or leaders[0].score < best + budget.gain:
            return
        best = leaders[0].score
        # If the best model describes everything, only its own effects are swapped.
        count = 1 if leaders[0].done else models_of_size
        near = [model for model in leaders[:count] if model.score > best - budget.gain]
        for model in (one for one in near if one.score > swapped.get(key_of(one), -inf) + budget.gain):
            swapped[key_of(model)] = model.score
            for effect in model.added:
                if progress is not None:
                    progress(f"others for {effect}", done, most)
                done += 1
                _take(found, board.swapped(found[key_of(model)], effect))


def _drop(board: Board[M], found: dict[Key, M], best: M, budget: Budget) -> None:
    """Drop each effect of the best model, and compare further effects beside a smaller set that is better than all of its size before.

    Of a snubber and an inductive strap the snubber alone had been in a wrong minimum, so that pairs were compared beside others; it was found only
    without the second effect of a wrong pair.
    """
    size = len(best.added)
    known = max((model.score for model in ranked(found, size - 1)), default=-inf)
    _take(found, (board.dropped(best, effect) for effect in best.added))
    smaller = ranked(found, size - 1)
    if smaller and smaller[0].score >= known + budget.gain and not best.done:
        _take(found, board.beside(smaller[0]))
        _swap(board, found, size, budget, None)


def _swap_as_well(board: Board[M], found: dict[Key, M], size: int, budget: Budget) -> None:
    """Make each swap that hardly changed one of the likely models of a size in the others that have the same effect.

    If both effects of a pair have a look-alike, the model with both of these is as likely as well, and no swap in the best model leads to it.
    """
    leaders = ranked(found, size)
    near = [model for model in leaders if model.score >= leaders[0].score - budget.loss]
    tried: set[Key] = set()
    for before, after in permutations(near, 2):
        gone, new = Counter(before.added) - Counter(after.added), Counter(after.added) - Counter(before.added)
        if gone.total() != 1:
            continue
        (old,), (other,) = gone, new
        for model in near:
            expected = model.score + after.score - before.score
            key = tuple(sorted((Counter(model.added) - gone + new).elements()))
            missed = key not in found or found[key].score < expected - budget.gain
            if old in model.added and key not in tried and missed and expected >= leaders[0].score - budget.loss:
                tried.add(key)
                _take(found, board.swapped(model, old, other))


def beside(key: Sequence[str], found: Iterable[Key]) -> dict[str, Key]:
    """Effects, each with the set that was found with it as the only further one beside some others."""
    further: dict[str, Key] = {}
    for other in found:
        left = list(other)
        for name in key:
            if name in left:
                left.remove(name)
        if len(other) == len(key) + 1 and len(left) == 1:
            further[left[0]] = other
    return further


def in_place_of(effect: str, key: Sequence[str], found: Iterable[Key]) -> dict[str, Key]:
    """Other effects, each with the set that was found with it in the place of one effect of a set."""
    rest = list(key)
    rest.remove(effect)
    return {name: other for name, other in beside(rest, found).items() if name != effect}


def ranked(found: Mapping[Key, M], size: int) -> list[M]:
    """The models of one size, the most probable first."""
    return sorted((model for key, model in found.items() if len(key) == size), key=lambda model: -model.score)


def _take(found: dict[Key, M], models: Iterable[M]) -> None:
    """Keep the better of two models of one key."""
    for model in models:
        key = key_of(model)
        if key not in found or model.score > found[key].score:
            found[key] = model
