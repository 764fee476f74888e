"""Hidden effects of leads, terminals, frame strap, bearing and temperature."""

from __future__ import annotations

import numpy as np

from motoremi.simulate.hidden import EffectKind, Elements, Sizes, behind, log_uniform, uniform
from motoremi.simulate.parts import IN, OUT, Network


def _draw_bearing(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    # A purely capacitive film cannot be distinguished from a smaller Cr; a film with leakage in the band can.
    return {"capacitance_f": log_uniform(rng, 5e-11, 5e-10), "resistance_ohm": log_uniform(rng, 1e3, 1e4)}


def _apply_bearing(network: Network, elements: Elements, sizes: Sizes) -> Network:
    film = Network().capacitor("c", IN, OUT, sizes["capacitance_f"]).resistor("r", IN, OUT, sizes["resistance_ohm"])
    return behind(network, "Cr", film)


def _draw_strap(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    return {"inductance_h": log_uniform(rng, 1.2e-7, 3e-7), "resistance_ohm": log_uniform(rng, 1e-3, 0.1)}


def _apply_strap(network: Network, elements: Elements, sizes: Sizes) -> Network:
    return (
        network.with_node("G", "frame")
        .inductor("Lg", "frame", "strap", sizes["inductance_h"])
        .resistor("Rg", "strap", "G", sizes["resistance_ohm"])
    )


def _draw_lead(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    return {"inductance_h": log_uniform(rng, 1e-7, 3e-7), "resistance_ohm": log_uniform(rng, 1e-3, 0.05)}


def _apply_lead(network: Network, elements: Elements, sizes: Sizes) -> Network:
    return (
        network.with_node("X", "winding")
        .inductor("Ll", "X", "lead", sizes["inductance_h"])
        .resistor("Rl", "lead", "winding", sizes["resistance_ohm"])
    )


def _draw_terminal(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    return {"capacitance_f": uniform(rng, 5e-12, 2e-11)}


def _apply_terminal(network: Network, elements: Elements, sizes: Sizes) -> Network:
    return network.capacitor("Ct", "X", "G", sizes["capacitance_f"])


def _draw_drift(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    return {"capacitance_rise": uniform(rng, 0.01, 0.03)}


def _apply_drift(network: Network, elements: Elements, sizes: Sizes) -> Network:
    return network.with_capacitors(1 + sizes["capacitance_rise"])


ROTOR_EFFECTS = (EffectKind("bearing-film", _draw_bearing, _apply_bearing),)
# In order from the motor outwards.
CONNECTION_EFFECTS = (
    EffectKind("ground-strap-inductance", _draw_strap, _apply_strap),
    EffectKind("lead-inductance", _draw_lead, _apply_lead),
    EffectKind("terminal-capacitance", _draw_terminal, _apply_terminal),
)
# The short-circuit sweep is measured first; until the open-circuit sweep the motor has warmed up.
DRIFT_EFFECTS = (EffectKind("temperature-drift", _draw_drift, _apply_drift, terminations=("open",)),)
