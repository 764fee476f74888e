"""A simulated operator who makes mistakes at random."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

# other termination: the far end was not connected, or connected by mistake. nothing done: the condition was not set up. other standard: the
# standards were mixed up. two wires: the resistance of the leads was included. terminals: the insulation tester was connected across the winding.
Kind: TypeAlias = Literal["other termination", "nothing done", "other standard", "two wires", "terminals"]

# Probability of a mistake.
MISTAKEN = 0.05
# Possible mistakes of each measurement; the others need no action of the operator.
_MISTAKES: Mapping[str, tuple[Kind, ...]] = {
    "short-sweep": ("other termination",),
    "open-sweep": ("other termination",),
    "wide-sweep": ("other termination",),
    "far-end-grounded": ("nothing done",),
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
    """A mistake of the operator.

    Parameters
    ----------
    kind : str
    of : int
        Index of the sweep that it applies to, from 0, modulo the number of sweeps.
    """

    kind: Kind
    of: int


@dataclass(frozen=True)
class Operator:
    """An operator with a given probability of mistakes.

    Parameters
    ----------
    seed : int
    mistaken : float
        Probability of a mistake.
    """

    seed: int
    mistaken: float = MISTAKEN

    def mistake(self, condition: str, turn: int = 0) -> Mistake | None:
        """The mistake when this is requested for the `turn`-th time (from 0); None if it is done as requested."""
        kinds = _MISTAKES.get(condition, ())
        rng = np.random.default_rng([self.seed, turn, zlib.crc32(f"operator {condition}".encode())])
        if not kinds or rng.random() >= self.mistaken:
            return None
        return Mistake(kinds[int(rng.integers(len(kinds)))], int(rng.integers(2)))
