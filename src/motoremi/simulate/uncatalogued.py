"""More effects that are not in the catalogue, for the hard blind board; a motor with one of them has no other hidden effect."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.sweep import Termination
from motoremi.errors import BadInput
from motoremi.simulate import ladders
from motoremi.simulate.hidden import EffectKind, Elements, Sizes, log_uniform, uniform
from motoremi.simulate.network import Network, impedance
from motoremi.simulate.simulated_motor import GROUND, TERMINAL, SimulatedMotor


def _draw_tertiary(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    henry, frequency, quality = log_uniform(rng, 2e-6, 2e-5), log_uniform(rng, 2e6, 1.2e7), log_uniform(rng, 4.0, 15.0)
    omega = 2 * np.pi * frequency
    return {
        "inductance_h": henry,
        "capacitance_f": 1 / (omega**2 * henry),
        "resistance_ohm": omega * henry / quality,
        "coupling_winding": uniform(rng, 0.15, 0.35),
        "coupling_rotor": uniform(rng, 0.25, 0.5),
    }


def _apply_tertiary(network: Network, elements: Elements, sizes: Sizes) -> Network:
    """A closed resonant loop, earthed on one side, that is coupled to the winding and to the rotor."""
    return (
        network.inductor("Lx", "G", "loop", sizes["inductance_h"])
        .resistor("Rx", "loop", "turn", sizes["resistance_ohm"])
        .capacitor("Cx", "turn", "G", sizes["capacitance_f"])
        .couple("La", "Lx", sizes["coupling_winding"])
        .couple("Lr", "Lx", sizes["coupling_rotor"])
    )


def _draw_fractional(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    return {
        "capacitance_f": elements["Cf"] * uniform(rng, 0.4, 1.0),
        "tan_delta": uniform(rng, 0.5, 0.95),
        "resistance_ohm": log_uniform(rng, 200.0, 1.5e3),
    }


def _apply_fractional(network: Network, elements: Elements, sizes: Sizes) -> Network:
    """A capacitor of fractional order behind a resistor, from the far end to the frame."""
    rough = ladders.constant_phase(sizes["capacitance_f"], sizes["tan_delta"])
    return network.resistor("Rx", "Y", "rough", sizes["resistance_ohm"]).block("Cx", "rough", "G", rough)


def _draw_level(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    return {"inductance_drop": uniform(rng, 0.04, 0.12), "resistance_drop": uniform(rng, 0.1, 0.3)}


def _apply_level(network: Network, elements: Elements, sizes: Sizes) -> Network:
    """A core with less inductance and less loss at less current: in the open-circuit sweep."""
    less = network.item("La").scaled(1 - sizes["inductance_drop"])
    return network.with_item("La", less).with_item("Ra", network.item("Ra").scaled(1 - sizes["resistance_drop"]))


def _draw_stray(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    return {
        "lead_inductance_h": log_uniform(rng, 2e-7, 5e-7),
        "strap_inductance_h": log_uniform(rng, 1.5e-7, 4e-7),
        "coupling_strap": uniform(rng, 0.3, 0.6),
        "coupling_rotor": uniform(rng, 0.3, 0.6),
    }


def _apply_stray(network: Network, elements: Elements, sizes: Sizes) -> Network:
    """Lead and frame strap run in parallel and are coupled, and the lead is also coupled to the rotor."""
    return (
        network.with_node("X", "winding")
        .with_node("G", "frame")
        .inductor("Ll", "X", "winding", sizes["lead_inductance_h"])
        .inductor("Lg", "frame", "G", sizes["strap_inductance_h"])
        .couple("Ll", "Lg", sizes["coupling_strap"])
        .couple("Ll", "Lr", -sizes["coupling_rotor"])
    )


_KINDS = {
    kind.name: kind
    for kind in (
        EffectKind("outside-tertiary-loop", _draw_tertiary, _apply_tertiary),
        EffectKind("outside-fractional-frame", _draw_fractional, _apply_fractional),
        EffectKind("outside-level-dependent-core", _draw_level, _apply_level, terminations=("open",)),
        EffectKind("outside-stray-coupling", _draw_stray, _apply_stray),
    )
}
UNCATALOGUED_EFFECTS: tuple[str, ...] = tuple(_KINDS)


@dataclass(frozen=True)
class UncataloguedMotor:
    """A motor with one effect of `UNCATALOGUED_EFFECTS`.

    Parameters
    ----------
    motor : SimulatedMotor
        The motor without the effect.
    effect : str
    seed : int
        Seed of the sizes of the effect.
    """

    motor: SimulatedMotor
    effect: str
    seed: int

    def __post_init__(self) -> None:
        if self.effect not in _KINDS:
            raise BadInput(f"unknown effect {self.effect!r}; use one of {', '.join(_KINDS)}")

    @cached_property
    def sizes(self) -> dict[str, float]:
        """Sizes of the effect, SI units."""
        rng = np.random.default_rng([self.seed, zlib.crc32(self.effect.encode())])
        return _KINDS[self.effect].draw(rng, self.motor.elements)

    @property
    def elements(self) -> Elements:
        """The seven element values of the motor without the effect, SI units."""
        return self.motor.elements

    def network(self, termination: Termination) -> Network:
        """The network between X and G, as `SimulatedMotor.network`."""
        kind, network = _KINDS[self.effect], self.motor.network("open")
        if termination in kind.terminations:
            network = kind.apply(network, self.motor.elements, self.sizes)
        return network.with_node("Y", GROUND) if termination == "short" else network

    def impedance(self, termination: Termination, frequency_hz: FloatArray) -> ComplexArray:
        """True impedance in one sweep, in ohm."""
        return impedance(self.network(termination), TERMINAL, GROUND, frequency_hz)
