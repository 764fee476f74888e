"""Hidden effects of larger machines (rotor, frame, flux paths, turns, modes), at the sizes of the simulated motors."""

from __future__ import annotations

import dataclasses

import numpy as np

from motoremi.simulate import ladders
from motoremi.simulate.hidden import EffectKind, Elements, Sizes, behind, beside, log_uniform, replaced, uniform
from motoremi.simulate.parts import IN, OUT, Block, Network, Part

# Coupling of a closed loop to the flux that it encloses; the rest is leakage.
_LOOP_COUPLING = 0.95
# Number of cells of the lossy line; twice as many change the result by less than 1e-4.
MACHINE_CELLS = 200
_MODES = ("first", "second", "third")


def _loop(elements: Elements, share: float, corner_hz: float, resistance: Network) -> Network:
    """A coil on part of the core with a closed loop coupled to it; `resistance` is the loop's, as a network of 1 ohm at low frequency."""
    henry = share / _LOOP_COUPLING**2 * elements["La"]
    return (
        Network()
        .inductor("coil", IN, OUT, henry)
        .inductor("loop", OUT, "ring", henry)
        .block("metal", "ring", OUT, resistance, 2 * np.pi * corner_hz * henry)
        .couple("coil", "loop", _LOOP_COUPLING)
    )


# A loop is visible below 20 kHz, where the reactance of La is small: Ra is the resistance of the wire alone there, without core losses.
def _draw_cage(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    return {
        "share": uniform(rng, 0.4, 0.8),
        "corner_hz": log_uniform(rng, 1e3, 4e3),
        "skin_hz": log_uniform(rng, 2e3, 5e4),
        "Ra": log_uniform(rng, 0.2, 0.6),
    }


def _apply_cage(network: Network, elements: Elements, sizes: Sizes) -> Network:
    # In a bar the current is displaced to the top: half of a sheet that is twice as deep.
    time = 1 / (2 * np.pi * sizes["skin_hz"])
    bar = ladders.half_sheet(time, time, "open")
    cage = _loop(elements, sizes["share"], sizes["corner_hz"], bar)
    return behind(network, "La", cage, 1 - sizes["share"] / _LOOP_COUPLING**2)


def _draw_turn(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    return {"share": uniform(rng, 0.05, 0.3), "corner_hz": log_uniform(rng, 5e3, 4e4), "Ra": log_uniform(rng, 0.5, 2.0)}


def _apply_turn(network: Network, elements: Elements, sizes: Sizes) -> Network:
    turn = _loop(elements, sizes["share"], sizes["corner_hz"], Network().resistor("r", IN, OUT, 1.0))
    return behind(network, "La", turn, 1 - sizes["share"] / _LOOP_COUPLING**2)


def _draw_frame(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    return {"share": uniform(rng, 0.5, 0.9), "corner_hz": log_uniform(rng, 2e5, 3e6)}


def _apply_frame(network: Network, elements: Elements, sizes: Sizes) -> Network:
    sheet = ladders.lamination(sizes["share"] * elements["Lr"], sizes["corner_hz"])
    return behind(network, "Lr", sheet, 1 - sizes["share"])


def _draw_flux(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    return {"share_lost": uniform(rng, 0.2, 0.9)}


def _apply_flux(network: Network, elements: Elements, sizes: Sizes) -> Network:
    """The flux of current that leaves through the frame closes outside the core, so less of it links the winding."""
    return network.with_item("La", network.item("La").scaled(1 - sizes["share_lost"]))


def _draw_modes(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    sizes = {"quality": log_uniform(rng, 3.0, 10.0)}
    frequency = log_uniform(rng, 1.5e6, 3e6)
    for mode in _MODES:
        sizes[f"{mode}_capacitance_f"] = elements["Ca"] * uniform(rng, 0.2, 0.6)
        sizes[f"{mode}_resonance_hz"] = frequency
        frequency *= uniform(rng, 1.7, 2.8)
    return sizes


def _apply_modes(network: Network, elements: Elements, sizes: Sizes) -> Network:
    rows = Network()
    for mode in _MODES:
        farad, omega = sizes[f"{mode}_capacitance_f"], 2 * np.pi * sizes[f"{mode}_resonance_hz"]
        rows = (
            rows.capacitor(f"{mode}_c", IN, f"{mode}_a", farad)
            .inductor(f"{mode}_l", f"{mode}_a", f"{mode}_b", 1 / (omega**2 * farad))
            .resistor(f"{mode}_r", f"{mode}_b", OUT, 1 / (omega * farad * sizes["quality"]))
        )
    return beside(network, "Ca", rows)


def _draw_machine(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
    return {
        "slots_f": elements["Cf"] * uniform(rng, 0.3, 1.0),
        "path_ohm": log_uniform(rng, 20.0, 200.0),
        "iron_hz": log_uniform(rng, 1e5, 1e6),
        "exponent": uniform(rng, 0.55, 0.75),
        "cage_share": uniform(rng, 0.3, 0.6),
        "cage_hz": log_uniform(rng, 1e3, 4e3),
        "Ra": log_uniform(rng, 0.2, 1.0),
    }


def _apply_machine(network: Network, elements: Elements, sizes: Sizes) -> Network:
    """Copper, iron and cage in many cells, each with its share of slot insulation and laminations; Ca across all cells."""
    own = ("Ra", "La")
    coil = network.item("La")
    assert isinstance(coil, Part)  # the effects that change La are excluded
    core = (
        Network()
        .block("iron", IN, "rotor", ladders.spread_relaxation((1 - sizes["cage_share"]) * coil.value, sizes["iron_hz"], sizes["exponent"]))
        .inductor("air", "rotor", OUT, sizes["cage_share"] * coil.value)
        .resistor("cage", "rotor", OUT, 2 * np.pi * sizes["cage_hz"] * sizes["cage_share"] * coil.value)
    )
    spread = replaced(network, "La", core)
    # The terminal, or the end of first turns.
    start = network.item("Ra").positive
    winding = Network(tuple(spread.item(name) for name in own)).with_node(start, IN).with_node("Y", OUT)
    rest = dataclasses.replace(spread, items=tuple(item for item in spread.items if item.name not in own))
    path = Network().capacitor("c", IN, "iron", sizes["slots_f"]).resistor("r", "iron", OUT, sizes["path_ohm"])
    return rest.plus(*ladders.winding_line(winding, Block("slots", start, "G", path), start, "Y", MACHINE_CELLS))


# Order: loops and flux before parts in parallel with the whole of La; modes after effects that replace Ca.
LOOP_EFFECTS = (
    EffectKind("rotor-cage", _draw_cage, _apply_cage),
    EffectKind("shorted-turn", _draw_turn, _apply_turn),
)
FLUX_EFFECTS = (
    EffectKind("frame-eddy", _draw_frame, _apply_frame),
    EffectKind("common-mode-flux", _draw_flux, _apply_flux, terminations=("open",)),
)
MODE_EFFECTS = (EffectKind("winding-modes", _draw_modes, _apply_modes),)
MACHINE_EFFECTS = (
    EffectKind(
        "machine-winding",
        _draw_machine,
        _apply_machine,
        excludes=(
            "distributed-winding",
            "field-coupling",
            "eddy-laminations",
            "permeability-relaxation",
            "core-loss",
            "rotor-cage",
            "shorted-turn",
            "outside-tapped-winding",
            "outside-rotor-coupling",
        ),
    ),
)
