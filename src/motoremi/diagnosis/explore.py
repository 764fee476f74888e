"""The search over sets of effects, those of one size after the other.

All sets of a size are compared (`Board.sets`). In the best of them one effect is then *swapped* for another, started from the
solution so that a look-alike cannot lose by not converging; and one that was there before may be *dropped*. The search ends when nothing is
left, when a further effect gains nothing, or at the largest size. What sets there are, and how likely a model is, the board says: motors and
their sweeps (`motor_board`), or sources and their spectra (`emission.board`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import inf
from typing import Protocol, TypeVar

from motoremi.arrays import Progress
from motoremi.progress import part

Key = tuple[str, ...]
# What comparing all sets of one size takes of its time, roughly; swapping takes the rest.
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
        """Whether nothing is left that another effect could describe."""


M = TypeVar("M", bound=Model)


class Board(Protocol[M]):
    """The interface through which a search gets its models."""

    def sets(self, size: int, found: Mapping[Key, M], progress: Progress | None) -> Iterable[M]:
        """Models with this many effects, given those with fewer; only those that may lead."""

    def swapped(self, model: M, effect: str) -> Iterable[M]:
        """The model with others in the place of one of its effects, sought from its solution."""

    def dropped(self, model: M, effect: str) -> M:
        """The model without one of its effects, sought from its solution."""


@dataclass(frozen=True)
class Budget:
    """Limits of a search.

    Parameters
    ----------
    swapped : int
        Models of one size in which effects are swapped. The second is for what ends within the gain of the first.
    swaps : tuple of int
        How often at most each size is swapped before it stands still. There are no larger sets: more than two effects describe almost any
        curve, right or wrong, and none such is named.
    gain : float
        What a further effect, or a swap, must gain in log score: odds of 20 to 1.
    """

    swapped: int = 2
    swaps: tuple[int, ...] = (2, 3)
    gain: float = 3.0

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
    for size in range(1, budget.most_effects + 1):
        before = best_of(found.values())
        own = part(progress, (size - 1) / budget.most_effects, size / budget.most_effects)
        _take(found, board.sets(size, found, part(own, 0.0, COMPARING)))
        # Where no further effect is worth having, neither is another in its place.
        if best_of(found.values()).score - before.score < budget.gain:
            break
        _swap(board, found, size, budget, part(own, COMPARING, 1.0))
        best = best_of(found.values())
        if len(best.added) == size > 1:
            _take(found, (board.dropped(best, effect) for effect in best.added))
        if best.done:
            break
    return found


def _swap(board: Board[M], found: dict[Key, M], size: int, budget: Budget, progress: Progress | None) -> None:
    """Swap effects of the best models of one size until that changes nothing."""
    swapped: set[Key] = set()
    best = -inf
    times = budget.swaps[size - 1]
    done, most = 0, times * budget.swapped * size
    for _ in range(times):
        leaders = ranked(found, size)
        if not leaders or leaders[0].score < best + budget.gain:
            return
        best = leaders[0].score
        # Beside one that leaves nothing, only its own look-alikes matter.
        count = 1 if leaders[0].done else budget.swapped
        models = [model for model in leaders[:count] if key_of(model) not in swapped and model.score > best - budget.gain]
        for model in models:
            swapped.add(key_of(model))
            for effect in model.added:
                if progress is not None:
                    progress(f"others for {effect}", done, most)
                done += 1
                _take(found, board.swapped(model, effect))


def ranked(found: Mapping[Key, M], size: int) -> list[M]:
    """The models of one size, the likeliest first."""
    return sorted((model for key, model in found.items() if len(key) == size), key=lambda model: -model.score)


def _take(found: dict[Key, M], models: Iterable[M]) -> None:
    """Keep the better of two models of one key."""
    for model in models:
        key = key_of(model)
        if key not in found or model.score > found[key].score:
            found[key] = model
