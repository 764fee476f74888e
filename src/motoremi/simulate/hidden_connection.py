"""Hidden effects of leads, cable, terminals, frame strap, bearing and temperature."""

from __future__ import annotations

import numpy as np

from motoremi.simulate import ladders
from motoremi.simulate.hidden import EffectKind, Elements, Sizes, behind, log_uniform, uniform
from motoremi.simulate.parts import IN, OUT, Block, Network

# Leads and straps are round wire of this radius; at 1 MHz the skin effect adds its DC resistance times radius over twice the penetration depth.
_WIRE_RADIUS_M = 1e-3
_SKIN_AT_1MHZ = _WIRE_RADIUS_M / 2 * np.sqrt(np.pi * 1e6 * ladders.MU_0 * ladders.COPPER_S_PER_M)
# Cells of a cable: at 30 MHz the electrical length of one of 4 m is then too large by 2e-5 of itself.
CABLE_CELLS = 256


def _draw_bearing(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    # A purely capacitive film cannot be distinguished from a smaller Cr; a film with leakage in the band can.
    return {"capacitance_f": log_uniform(rng, 5e-11, 5e-10), "resistance_ohm": log_uniform(rng, 1e3, 1e4)}


def _apply_bearing(network: Network, elements: Elements, sizes: Sizes) -> Network:
    film = Network().capacitor("c", IN, OUT, sizes["capacitance_f"]).resistor("r", IN, OUT, sizes["resistance_ohm"])
    return behind(network, "Cr", film)


def _conductor(sizes: Sizes) -> Network:
    """A contact, a wire with skin effect and the inductance of the field around it.

    Far above its corner frequency the wire has a quarter of its DC resistance and a part that grows with the root of frequency; the contact
    has the rest of `resistance_ohm`.
    """
    conductor = Network().inductor("l", IN, "end", sizes["inductance_h"])
    # Sizes without a skin effect, as in motors stored by earlier versions, mean none.
    if not (skin := sizes.get("skin_ohm", 0.0)):
        return conductor.resistor("r", "end", OUT, sizes["resistance_ohm"])
    wire = skin / _SKIN_AT_1MHZ
    conductor = conductor.resistor("contact", "end", "joint", sizes["resistance_ohm"] - wire / 4)
    return conductor.block("wire", "joint", OUT, ladders.round_wire(wire, _WIRE_RADIUS_M))


def _draw_conductor(rng: np.random.Generator, inductance_h: float, contact_ohm: float) -> dict[str, float]:
    # 0.04 Ohm at 1 MHz of a metre of this wire, three times as much of a thinner one.
    skin = inductance_h / 1e-6 * log_uniform(rng, 0.04, 0.12)
    return {"inductance_h": inductance_h, "resistance_ohm": contact_ohm + skin / _SKIN_AT_1MHZ / 4, "skin_ohm": skin}


def _draw_strap(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    return _draw_conductor(rng, log_uniform(rng, 1.2e-7, 3e-7), log_uniform(rng, 1e-3, 0.1))


def _apply_strap(network: Network, elements: Elements, sizes: Sizes) -> Network:
    return network.with_node("G", "frame").block("strap", "frame", "G", _conductor(sizes))


def _draw_tie(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    return _draw_conductor(rng, log_uniform(rng, 1e-7, 3e-7), log_uniform(rng, 1e-3, 0.05))


def _apply_tie(network: Network, elements: Elements, sizes: Sizes) -> Network:
    return network.with_node("Y", "far end").block("tie", "far end", "Y", _conductor(sizes))


def _draw_lead(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    return _draw_conductor(rng, log_uniform(rng, 1e-7, 3e-7), log_uniform(rng, 1e-3, 0.05))


def _apply_lead(network: Network, elements: Elements, sizes: Sizes) -> Network:
    return network.with_node("X", "winding").block("lead", "X", "winding", _conductor(sizes))


def _draw_terminal(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    return {"capacitance_f": uniform(rng, 5e-12, 2e-11), "tan_delta": log_uniform(rng, 5e-4, 0.03)}


def _apply_terminal(network: Network, elements: Elements, sizes: Sizes) -> Network:
    return network.block("Ct", "X", "G", ladders.lossy_capacitor(sizes["capacitance_f"], sizes.get("tan_delta", 0.0)))


def _draw_cable(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    # Supply cables with plastic insulation: waves have half to two thirds of the speed of light; the wire's skin effect as of leads.
    length_m, wave_ohm, speed = log_uniform(rng, 0.5, 4.0), uniform(rng, 60.0, 150.0), uniform(rng, 1.6e8, 2.1e8)
    return {
        "inductance_h": wave_ohm * length_m / speed,
        "capacitance_f": length_m / speed / wave_ohm,
        "skin_ohm": length_m * log_uniform(rng, 0.05, 0.25),
        "tan_delta": log_uniform(rng, 1e-3, 0.05),
    }


def _apply_cable(network: Network, elements: Elements, sizes: Sizes) -> Network:
    wire = ladders.round_wire(sizes["skin_ohm"] / _SKIN_AT_1MHZ, _WIRE_RADIUS_M)
    conductor = Network().inductor("l", IN, "end", sizes["inductance_h"]).block("wire", "end", OUT, wire)
    insulation = Block("insulation", "X", "G", ladders.lossy_capacitor(sizes["capacitance_f"], sizes["tan_delta"]))
    cells = ladders.winding_line(conductor, insulation, "X", "terminal", CABLE_CELLS, "cable ")
    return network.with_node("X", "terminal").plus(*cells)


def _draw_drift(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    # Copper of half of the motors warms by 1 to 5 K, 0.39 % each.
    return {"capacitance_rise": uniform(rng, 0.01, 0.03), "resistance_rise": float(rng.integers(2)) * uniform(rng, 4e-3, 2e-2)}


def _apply_drift(network: Network, elements: Elements, sizes: Sizes) -> Network:
    warmer = network.with_capacitors(1 + sizes["capacitance_rise"])
    # Motors stored by earlier versions have no such rise.
    rise = sizes.get("resistance_rise", 0.0)
    return warmer.with_item("Ra", warmer.item("Ra").scaled(1 + rise)) if rise else warmer


ROTOR_EFFECTS = (EffectKind("bearing-film", _draw_bearing, _apply_bearing),)
# In order from the motor outwards.
CONNECTION_EFFECTS = (
    EffectKind("ground-strap-inductance", _draw_strap, _apply_strap),
    EffectKind("far-end-tie", _draw_tie, _apply_tie, terminations=("short",)),
    EffectKind("lead-inductance", _draw_lead, _apply_lead),
    EffectKind("terminal-capacitance", _draw_terminal, _apply_terminal),
    EffectKind("supply-cable", _draw_cable, _apply_cable),
)
# The short-circuit sweep is measured first; until the open-circuit sweep the motor has warmed up.
DRIFT_EFFECTS = (EffectKind("temperature-drift", _draw_drift, _apply_drift, terminations=("open",)),)
