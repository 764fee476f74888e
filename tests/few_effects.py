"""Diagnoses that seek a few effects: for tests of what is done with an answer, or of the way to it, whatever else is in the catalogue."""

from __future__ import annotations

from collections.abc import Container, Iterator
from contextlib import contextmanager
from unittest import mock

from motoremi.diagnosis import motor_board
from motoremi.fitting.result import Fit

# Some of each group, among them look-alikes.
FEW = frozenset({
    "skin-effect", "eddy-laminations", "core-loss", "dielectric-loss@Ca", "dielectric-loss@Cf", "insulation-leakage@Ca", "insulation-leakage@Cf",
    "lead-inductance", "terminal-capacitance", "ground-strap-inductance", "open-residual", "contact-resistance",
})  # fmt: skip


@contextmanager
def seeking(names: Container[str] = FEW) -> Iterator[None]:
    """The search is over these alone; over few it takes a third of the time, and a fifth if it goes on to pairs. Priors are those of all."""
    every = motor_board.possible_effects

    def some(fit: Fit) -> list[str]:
        return [name for name in every(fit) if name in names]

    with mock.patch.object(motor_board, "possible_effects", some):
        yield
