"""Effects that are not in the catalogue, for blind tests of the verdict `unexplained`."""

from __future__ import annotations

import numpy as np

from motoremi.simulate import ladders
from motoremi.simulate.hidden import EffectKind, Elements, Sizes, beside, log_uniform, replaced, uniform
from motoremi.simulate.parts import IN, OUT, Network


def _draw_tap(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    return {
        "tap": uniform(rng, 0.3, 0.6),
        "coupling": uniform(rng, 0.5, 0.9),
        "first_resistance_ohm": log_uniform(rng, 500.0, 2e3),
        "first_corner_hz": log_uniform(rng, 8e5, 2e6),
        "second_resistance_ohm": log_uniform(rng, 100.0, 500.0),
        "second_corner_hz": log_uniform(rng, 8e6, 2e7),
    }


def _apply_tap(network: Network, elements: Elements, sizes: Sizes) -> Network:
    """Two R-C branches across part of the turns, which are coupled to the rest."""
    tap, coupling = sizes["tap"], sizes["coupling"]
    # Inductance is proportional to the square of the turns; both parts and twice their mutual inductance add up to La.
    unit = elements["La"] / (tap**2 + (1 - tap) ** 2 + 2 * coupling * tap * (1 - tap))
    inner = (
        Network()
        .inductor("tapped", IN, "tap", unit * tap**2)
        .inductor("rest", "tap", OUT, unit * (1 - tap) ** 2)
        .couple("tapped", "rest", coupling)
    )
    for step in ("first", "second"):
        ohm = sizes[f"{step}_resistance_ohm"]
        inner = inner.resistor(f"{step}_r", IN, step, ohm).capacitor(f"{step}_c", step, "tap", 1 / (2 * np.pi * sizes[f"{step}_corner_hz"] * ohm))
    return replaced(network, "La", inner)


def _draw_diffusion(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    return {
        "resistance_ohm": log_uniform(rng, 2e3, 2e4),
        "capacitance_f": elements["Cf"] * uniform(rng, 0.3, 1.0),
    }


def _apply_diffusion(network: Network, elements: Elements, sizes: Sizes) -> Network:
    return beside(network, "Cf", ladders.resistive_line(sizes["resistance_ohm"], sizes["capacitance_f"]))


def _draw_rotor(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    return {"coupling": uniform(rng, 0.15, 0.4)}


def _apply_rotor(network: Network, elements: Elements, sizes: Sizes) -> Network:
    return network.couple("La", "Lr", sizes["coupling"])


OUTSIDE_EFFECTS = (
    EffectKind("outside-tapped-winding", _draw_tap, _apply_tap),
    EffectKind("outside-charge-diffusion", _draw_diffusion, _apply_diffusion),
    EffectKind("outside-rotor-coupling", _draw_rotor, _apply_rotor),
)
