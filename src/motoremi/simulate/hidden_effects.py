"""All effects that a simulated motor can hide: drawn by seed and added to the motor's network."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from motoremi.data.sweep import Termination
from motoremi.errors import BadInput
from motoremi.simulate.hidden import ELEMENTS, EffectKind, Elements
from motoremi.simulate.hidden_connection import CONNECTION_EFFECTS, DRIFT_EFFECTS, ROTOR_EFFECTS
from motoremi.simulate.hidden_insulation import INSULATION_EFFECTS
from motoremi.simulate.hidden_machine import FLUX_EFFECTS, LOOP_EFFECTS, MACHINE_EFFECTS, MODE_EFFECTS
from motoremi.simulate.hidden_suppressor import SUPPRESSOR_EFFECTS
from motoremi.simulate.hidden_winding import BESIDE_EFFECTS, MATERIAL_EFFECTS, TURN_EFFECTS
from motoremi.simulate.outside import OUTSIDE_EFFECTS as _OUTSIDE
from motoremi.simulate.parts import Network

# In the order in which effects are added to the network: elements, then distributed windings and extensions, then the terminals.
_KINDS: Mapping[str, EffectKind] = {
    kind.name: kind
    for kind in (
        *MATERIAL_EFFECTS,
        *LOOP_EFFECTS,
        *FLUX_EFFECTS,
        *BESIDE_EFFECTS,
        *INSULATION_EFFECTS,
        *MODE_EFFECTS,
        *_OUTSIDE,
        *ROTOR_EFFECTS,
        *TURN_EFFECTS,
        *MACHINE_EFFECTS,
        *SUPPRESSOR_EFFECTS,
        *CONNECTION_EFFECTS,
        *DRIFT_EFFECTS,
    )
}
MOTOR_EFFECTS: tuple[str, ...] = tuple(_KINDS)
OUTSIDE_EFFECTS: tuple[str, ...] = tuple(kind.name for kind in _OUTSIDE)
# Added by the simulated analyser, see `analyser_errors.py`.
ANALYSER_FAULTS: tuple[str, ...] = (
    "open-residual",
    "short-residual",
    "gain-error",
    "cable-delay",
    "contact-resistance",
    "range-step",
)
HIDDEN_EFFECTS: tuple[str, ...] = (*MOTOR_EFFECTS, *ANALYSER_FAULTS)
DEMO_EFFECTS: tuple[str, ...] = (
    "eddy-laminations",
    "core-loss",
    "second-resonance",
    "distributed-winding",
    "dielectric-loss@Cf",
    "insulation-leakage@Cf",
    "lead-inductance",
    "open-residual",
)


@dataclass(frozen=True)
class HiddenEffect:
    """One effect in one motor.

    Parameters
    ----------
    name : str
        One of `MOTOR_EFFECTS`.
    sizes : mapping
        Its physical parameters, SI units, each named with its unit.
    """

    name: str
    sizes: Mapping[str, float]

    def __post_init__(self) -> None:
        check_motor_effect(self.name)

    def apply(self, network: Network, elements: Elements, termination: Termination) -> Network:
        """The network with this effect, if it applies to this sweep."""
        kind = _KINDS[self.name]
        return kind.apply(network, elements, self.sizes) if termination in kind.terminations else network


def check_motor_effect(name: str) -> None:
    """Raise `BadInput` with the known names unless a motor can hide it."""
    if name in ANALYSER_FAULTS:
        raise BadInput(f"{name!r} is an effect of the analyser, not of the motor: give it to SimulatedAnalyser(faults=...)")
    if name not in _KINDS:
        raise BadInput(f"unknown effect {name!r}; the simulation knows {', '.join(HIDDEN_EFFECTS)}")


def split_effects(effects: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Split names into effects of the motor and faults of the analyser.

    Raises
    ------
    BadInput
        For a name that is neither.
    """
    faults = tuple(name for name in effects if name in ANALYSER_FAULTS)
    hidden = tuple(name for name in effects if name not in ANALYSER_FAULTS)
    for name in hidden:
        check_motor_effect(name)
    return hidden, faults


def excluding(names: Sequence[str]) -> list[tuple[str, str]]:
    """The pairs of these effects that no motor can hide together; faults of the analyser exclude none."""
    return [(name, other) for name in names if name in _KINDS for other in sorted(set(names) & set(_KINDS[name].excludes))]


def draw_effects(seed: int, names: Sequence[str], elements: Elements) -> tuple[dict[str, float], tuple[HiddenEffect, ...]]:
    """Draw sizes for effects; the size of an effect does not depend on the other effects.

    Returns
    -------
    elements : dict
        The seven elements; an effect may set one (proximity sets the copper resistance).
    effects : tuple of HiddenEffect
        In the order in which they must be applied.
    """
    for name in names:
        check_motor_effect(name)
    if len(set(names)) < len(names):
        raise BadInput(f"an effect is named twice: {', '.join(names)}")
    for name, other in excluding(names):
        raise BadInput(f"{name} and {other} change the same parts of the winding: hide one of them")
    changed: dict[str, float] = {}
    effects = []
    for name in sorted(names, key=MOTOR_EFFECTS.index):
        rng = np.random.default_rng([seed, zlib.crc32(name.encode())])
        sizes = _KINDS[name].draw(rng, {**elements, **changed})
        for element in ELEMENTS:
            if element in sizes:
                # The first effect decides: proximity-effect takes part of La in proportion to the copper resistance that it sets.
                changed.setdefault(element, sizes.pop(element))
        effects.append(HiddenEffect(name, sizes))
    return {**elements, **changed}, tuple(effects)
