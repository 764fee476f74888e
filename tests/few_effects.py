"""Diagnoses over a few effects, for tests that do not depend on the rest of the catalogue: of the steps of a search, or of its results."""

from __future__ import annotations

from collections.abc import Container, Iterator
from contextlib import contextmanager
from unittest import mock

from motoremi.diagnosis import motor_board, whole_machine
from motoremi.fitting.result import Fit

# Some of each group, among them look-alikes.
FEW = frozenset({
    "skin-effect", "eddy-laminations", "core-loss", "dielectric-loss@Ca", "dielectric-loss@Cf", "insulation-leakage@Ca", "insulation-leakage@Cf",
    "lead-inductance", "terminal-capacitance", "ground-strap-inductance", "open-residual", "contact-resistance",
})  # fmt: skip
# Further laws that bend to almost any smooth curve.
BENDING = frozenset({"permeability-relaxation", "dielectric-relaxation@Ca", "second-resonance", "field-coupling"})


@contextmanager
def seeking(names: Container[str] = FEW) -> Iterator[None]:
    """Search these effects only: a third of the time, or a fifth if pairs are searched. Priors are those of the whole catalogue.

    What none of them describes is not described as a machine with other parts or with modes either.
    """
    every = motor_board.possible_effects

    def some(fit: Fit) -> list[str]:
        return [name for name in every(fit) if name in names]

    with (
        mock.patch.object(motor_board, "possible_effects", some),
        mock.patch.object(whole_machine, "possible_effects", some),
        mock.patch("motoremi.diagnosis.diagnosis.machine_with_modes", return_value=None),
    ):
        yield
