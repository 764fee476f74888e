"""Hidden effects of the winding, its core and its turns."""

from __future__ import annotations

import dataclasses
from itertools import combinations, pairwise

import numpy as np

from motoremi.simulate import ladders
from motoremi.simulate.hidden import EffectKind, Elements, Sizes, behind, beside, log_uniform, replaced, uniform
from motoremi.simulate.parts import IN, OUT, Block, Network, Part


def _draw_skin(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    # The wire's internal inductance is a part of La: the radius is chosen so that it is only a share of it.
    share = uniform(rng, 0.15, 0.35)
    per_square_metre = ladders.wire_inductance(elements["Ra"], 1.0)
    return {"radius_m": max(1e-4, float(np.sqrt(share * elements["La"] / per_square_metre)))}


def _apply_skin(network: Network, elements: Elements, sizes: Sizes) -> Network:
    inside = ladders.wire_inductance(elements["Ra"], sizes["radius_m"])
    outside = network.item("La").scaled(1 - inside / elements["La"])
    return replaced(network, "Ra", ladders.round_wire(elements["Ra"], sizes["radius_m"])).with_item("La", outside)


def _draw_proximity(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    # The inductance of the flux between the layers is a share of La. This determines the copper resistance, which is all of Ra here.
    height, layers, porosity = uniform(rng, 2e-4, 5e-4), int(rng.integers(2, 7)), uniform(rng, 0.6, 0.95)
    share = uniform(rng, 0.2, 0.5)
    per_ohm = ladders.foil_inductance(1.0, height, layers, porosity * ladders.COPPER_S_PER_M)
    return {"height_m": height, "layers": layers, "porosity": porosity, "Ra": share * elements["La"] / per_ohm}


def _apply_proximity(network: Network, elements: Elements, sizes: Sizes) -> Network:
    winding = (
        elements["Ra"],
        sizes["height_m"],
        int(sizes["layers"]),
        sizes["porosity"] * ladders.COPPER_S_PER_M,
    )
    outside = network.item("La").scaled(1 - ladders.foil_inductance(*winding) / elements["La"])
    return replaced(network, "Ra", ladders.foil_winding(*winding)).with_item("La", outside)


def _draw_laminations(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    return {"share": uniform(rng, 0.2, 0.7), "corner_hz": log_uniform(rng, 1e3, 1e5)}


def _apply_laminations(network: Network, elements: Elements, sizes: Sizes) -> Network:
    sheet = ladders.lamination(sizes["share"] * elements["La"], sizes["corner_hz"])
    return behind(network, "La", sheet, 1 - sizes["share"])


def _draw_relaxation(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    """A core with one time constant, with many (Cole and Cole), or with a damped resonance (Lorentz)."""
    sizes = {"share": uniform(rng, 0.1, 0.6), "corner_hz": log_uniform(rng, 5e5, 1e7)}
    kind = rng.integers(3)
    if kind == 1:
        sizes["exponent"] = uniform(rng, 0.6, 0.8)
    elif kind == 2:
        sizes["quality"] = uniform(rng, 0.5, 2.0)
    return sizes


def _apply_relaxation(network: Network, elements: Elements, sizes: Sizes) -> Network:
    henry, omega = sizes["share"] * elements["La"], 2 * np.pi * sizes["corner_hz"]
    if "exponent" in sizes:
        core = ladders.spread_relaxation(henry, sizes["corner_hz"], sizes["exponent"])
    else:
        core = Network().inductor("l", IN, OUT, henry).resistor("r", IN, OUT, omega * henry)
    if "quality" in sizes:
        core = core.capacitor("c", IN, OUT, sizes["quality"] ** 2 / (omega**2 * henry))
    return behind(network, "La", core, 1 - sizes["share"])


def _draw_core_loss(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    return {"resistance_ohm": log_uniform(rng, 800.0, 8e3)}


def _apply_core_loss(network: Network, elements: Elements, sizes: Sizes) -> Network:
    return beside(network, "La", Network().resistor("r", IN, OUT, sizes["resistance_ohm"]))


def _draw_field(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    henry, frequency, quality = log_uniform(rng, 1e-4, 5e-3), log_uniform(rng, 1e6, 1.5e7), log_uniform(rng, 3.0, 20.0)
    omega = 2 * np.pi * frequency
    return {
        "coupling": uniform(rng, 0.2, 0.4),
        "field_inductance_h": henry,
        "field_resistance_ohm": omega * henry / quality,
        "field_capacitance_f": 1 / (omega**2 * henry),
    }


def _apply_field(network: Network, elements: Elements, sizes: Sizes) -> Network:
    inner = (
        Network((dataclasses.replace(network.item("La"), name="La", positive=IN, negative=OUT),))
        .inductor("Lf", OUT, "coil", sizes["field_inductance_h"])
        .resistor("Rf", "coil", "turns", sizes["field_resistance_ohm"])
        .capacitor("Cw", "turns", OUT, sizes["field_capacitance_f"])
        .couple("La", "Lf", sizes["coupling"])
    )
    return replaced(network, "La", inner)


def _draw_brush(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    return {"resistance_ohm": uniform(rng, 0.3, 0.5), "capacitance_f": log_uniform(rng, 2e-8, 1e-7)}


def _apply_brush(network: Network, elements: Elements, sizes: Sizes) -> Network:
    film = Network().resistor("r", IN, OUT, sizes["resistance_ohm"]).capacitor("c", IN, OUT, sizes["capacitance_f"])
    return behind(network, "Ra", film)


def _draw_distributed(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    return {"share": log_uniform(rng, 0.03, 0.3)}


def _without_leak(insulation: Part | Block) -> Part | Block:
    """Insulation without the resistor in parallel that a leak adds last (`hidden.beside`); losses of the material have more than one part."""
    if isinstance(insulation, Block):
        beside_it = [item for item in insulation.network.items if item.name == "beside"]
        if any(isinstance(item, Block) and len(item.network.items) == 1 for item in beside_it):
            return insulation.network.item("Cf")
    return insulation


def _apply_distributed(network: Network, elements: Elements, sizes: Sizes) -> Network:
    own = ("Ra", "La", "Ca")
    winding = Network(tuple(network.item(name) for name in own)).with_node("X", IN).with_node("Y", OUT)
    rest = dataclasses.replace(network, items=tuple(item for item in network.items if item.name not in own))
    lumped = network.item("Cf").scaled(1 / (1 - sizes["share"]))
    # The same insulation, with the same losses; a leak is at one place, in the lumped part.
    insulation = _without_leak(network.item("Cf"))
    slots = dataclasses.replace(insulation, name="slots", positive="X", negative="G").scaled(1 / sizes["share"])
    line = ladders.winding_line(winding, slots, "X", "Y", ladders.LINE_CELLS)
    return rest.with_item("Cf", lumped).plus(*line)


def _draw_sections(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    return {"share": log_uniform(rng, 0.1, 0.6), "sections": float(rng.integers(4, 11)), "coupling": uniform(rng, 0.2, 0.7)}


def _apply_sections(network: Network, elements: Elements, sizes: Sizes) -> Network:
    """Coils in series, each with its share of copper and capacitance; their coupling decreases with the distance."""
    count, coupling = int(sizes["sections"]), sizes["coupling"]
    order = range(count)
    # The sum of all self and mutual inductances is La.
    henry = elements["La"] / sum(coupling ** abs(i - j) for i in order for j in order)
    nodes = ["X", *(f"coil{number}" for number in range(1, count)), "Y"]
    rest = dataclasses.replace(network, items=tuple(item for item in network.items if item.name not in ("Ra", "La", "Ca")))
    rest = rest.with_item("Cf", network.item("Cf").scaled(1 / (1 - sizes["share"])))
    for number, (left, right) in enumerate(pairwise(nodes)):
        rest = (
            rest.resistor(f"Ra{number}", left, f"in{number}", elements["Ra"] / count)
            .inductor(f"La{number}", f"in{number}", right, henry)
            .capacitor(f"Ca{number}", left, right, elements["Ca"] * count)
        )
    for number, node in enumerate(nodes):
        at_end = node in ("X", "Y")
        rest = rest.capacitor(f"slot{number}", node, "G", sizes["share"] * elements["Cf"] / count * (0.5 if at_end else 1.0))
    for first, second in combinations(order, 2):
        rest = rest.couple(f"La{first}", f"La{second}", coupling ** (second - first))
    return rest


def _draw_second(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    henry, frequency = elements["La"] * log_uniform(rng, 0.02, 0.1), log_uniform(rng, 3e6, 2e7)
    return {
        "inductance_h": henry,
        "capacitance_f": 1 / ((2 * np.pi * frequency) ** 2 * henry),
        "resistance_ohm": log_uniform(rng, 200.0, 2e3),
    }


def _apply_second(network: Network, elements: Elements, sizes: Sizes) -> Network:
    return (
        network.with_node("X", "firstturns")
        .inductor("L2", "X", "firstturns", sizes["inductance_h"])
        .capacitor("C2", "X", "firstturns", sizes["capacitance_f"])
        .resistor("R2", "X", "firstturns", sizes["resistance_ohm"])
    )


# In the order in which they must be added: effects that change an element first, effects that move a node last.
MATERIAL_EFFECTS = (
    EffectKind("skin-effect", _draw_skin, _apply_skin),
    EffectKind("proximity-effect", _draw_proximity, _apply_proximity),
    EffectKind("field-coupling", _draw_field, _apply_field),
    EffectKind("eddy-laminations", _draw_laminations, _apply_laminations),
    EffectKind("permeability-relaxation", _draw_relaxation, _apply_relaxation),
)
BESIDE_EFFECTS = (
    EffectKind("core-loss", _draw_core_loss, _apply_core_loss),
    EffectKind("brush-contact", _draw_brush, _apply_brush),
)
# Effects that change or distribute the elements of the winding in another way: sections are made of the plain elements.
_INCOMPATIBLE = (
    "distributed-winding",
    "machine-winding",
    *(kind.name for kind in (*MATERIAL_EFFECTS, *BESIDE_EFFECTS)),
    "rotor-cage",
    "shorted-turn",
    "winding-modes",
    "common-mode-flux",
    "outside-tapped-winding",
    "outside-rotor-coupling",
    *(f"{name}@{place}" for name in ("dielectric-loss", "dielectric-relaxation", "insulation-leakage") for place in ("Ca", "Cf")),
)
TURN_EFFECTS = (
    EffectKind("distributed-winding", _draw_distributed, _apply_distributed),
    EffectKind("winding-sections", _draw_sections, _apply_sections, excludes=_INCOMPATIBLE),
    EffectKind("second-resonance", _draw_second, _apply_second),
)
