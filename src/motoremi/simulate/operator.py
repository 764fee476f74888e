"""A simulated operator, who now and then does something else than was asked."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

# other termination: the sweep of this name is of the other one (a far end that nobody connected, or joined by mistake).
# nothing done: the change was forgotten. other standard: mixed up. two wires: the leads were measured as well.
# terminals: the insulation tester stood across the winding.
Kind: TypeAlias = Literal["other termination", "nothing done", "other standard", "two wires", "terminals"]

# How often an action goes wrong.
MISTAKEN = 0.05
# What can go wrong with each measurement; those that are not here need no hands.
_MISTAKES: Mapping[str, tuple[Kind, ...]] = {
    "short-sweep": ("other termination",),
    "open-sweep": ("other termination",),
    "wide-sweep": ("other termination",),
    "far-end-grounded": ("other termination",),
    "dc-resistance": ("two wires",),
    "insulation-resistance": ("terminals",),
    "fixture-open": ("other standard",),
    "fixture-short": ("other standard",),
    "fixture-load": ("other standard",),
    "standards": ("other standard",),
    **dict.fromkeys(
        (
            "shaft-turned", "contacts-cleaned", "field-winding", "longer-lead", "longer-strap", "terminal-block", "end-turn-touched",
            "rotor-out", "brushes-lifted", "dc-bias", "second-temperature", "dried", "known-capacitor",
        ),
        ("nothing done", "other termination"),
    ),
    "repeat-compensation": ("nothing done",),
}  # fmt: skip


@dataclass(frozen=True)
class Mistake:
    """What went wrong.

    Parameters
    ----------
    kind : str
    of : int
        Which of the sweeps, where it is about one of several; counts from 0 and goes round.
    """

    kind: Kind
    of: int


@dataclass(frozen=True)
class Operator:
    """Somebody who does what is asked, most of the time.

    Parameters
    ----------
    seed : int
    mistaken : float
        Share of the actions that go wrong.
    """

    seed: int
    mistaken: float = MISTAKEN

    def mistake(self, condition: str, turn: int = 0) -> Mistake | None:
        """What goes wrong when this is asked for the `turn`-th time (from 0); None if it is done as asked."""
        kinds = _MISTAKES.get(condition, ())
        rng = np.random.default_rng([self.seed, turn, zlib.crc32(f"operator {condition}".encode())])
        if not kinds or rng.random() >= self.mistaken:
            return None
        return Mistake(kinds[int(rng.integers(len(kinds)))], int(rng.integers(2)))
