"""Hidden suppressors: capacitors at the brushes, a choke in the lead."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from motoremi.data.sweep import TERMINATIONS, Termination
from motoremi.simulate import ladders
from motoremi.simulate.hidden import EffectKind, Elements, Sizes, log_uniform, uniform
from motoremi.simulate.parts import IN, OUT, Network


def _capacitor(
    name: str, low_farad: float, high_farad: float, ends: Sequence[tuple[str, str]], terminations: tuple[Termination, ...] = TERMINATIONS
) -> EffectKind:
    """A capacitor with a constant loss angle and its wires between each of some pairs of nodes."""

    def draw(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
        return {
            "capacitance_f": log_uniform(rng, low_farad, high_farad),
            "esr_ohm": log_uniform(rng, 0.05, 1.0),
            "esl_h": log_uniform(rng, 5e-9, 4e-8),
            "tan_delta": log_uniform(rng, 5e-4, 0.03),
        }

    def apply(network: Network, elements: Elements, sizes: Sizes) -> Network:
        capacitor = (
            Network()
            .block("c", IN, "foil", ladders.lossy_capacitor(sizes["capacitance_f"], sizes.get("tan_delta", 0.0)))
            .resistor("r", "foil", "wire", sizes["esr_ohm"])
            .inductor("l", "wire", OUT, sizes["esl_h"])
        )
        for number, (positive, negative) in enumerate(ends):
            network = network.block(f"suppressor{number}", positive, negative, capacitor)
        return network

    return EffectKind(name, draw, apply, terminations=terminations)


def _draw_choke(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    return {
        "inductance_h": log_uniform(rng, 2e-6, 1e-5),
        "share": uniform(rng, 0.5, 0.9),
        "corner_hz": log_uniform(rng, 2e6, 3e7),
        "capacitance_f": log_uniform(rng, 5e-13, 5e-12),
        "resistance_ohm": log_uniform(rng, 5e-3, 5e-2),
    }


def _choke(name: str, inner: str) -> EffectKind:
    """A choke between all parts so far, whose terminal becomes the node `inner`, and the terminal."""

    def apply(network: Network, elements: Elements, sizes: Sizes) -> Network:
        # The flux of a rod is partly in ferrite, whose loss is a parallel resistor, and partly in air.
        rod = sizes["share"] * sizes["inductance_h"]
        choke = (
            Network()
            .inductor("air", IN, "a", sizes["inductance_h"] - rod)
            .inductor("rod", "a", "b", rod)
            .resistor("loss", "a", "b", 2 * np.pi * sizes["corner_hz"] * rod)
            .resistor("wire", "b", OUT, sizes["resistance_ohm"])
            .capacitor("turns", IN, OUT, sizes["capacitance_f"])
        )
        return network.with_node("X", inner).block(f"choke at {inner}", "X", inner, choke)

    return EffectKind(name, _draw_choke, apply)


# In order from the brushes outwards.
SUPPRESSOR_EFFECTS = (
    _choke("suppressor-choke@brushes", "brush"),
    _capacitor("suppressor-capacitor", 5e-9, 2e-7, [("X", "Y")]),
    _capacitor("suppressor-capacitor@frame", 1e-9, 1e-8, [("X", "G")]),
    _capacitor("suppressor-capacitor@pair", 1e-9, 1e-8, [("X", "G"), ("Y", "G")]),
    # A guard takes its current in the short-circuit sweep.
    _capacitor("suppressor-capacitor@guarded", 1e-9, 1e-8, [("X", "G")], terminations=("open",)),
    _choke("suppressor-choke", "holder"),
)
