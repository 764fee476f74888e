"""Effects of machines and suppressors: networks of ideal parts against the catalogue's laws, and against finer networks."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from contextlib import closing
from itertools import combinations

import numpy as np
import pytest

from motoremi.arrays import ComplexArray
from motoremi.cli import demo
from motoremi.data.sweep import TERMINATIONS
from motoremi.errors import BadInput
from motoremi.export.realise import impedance_of
from motoremi.model.effects import add_effects, find_effect, identifiers
from motoremi.model.effects.winding import NO_END_SHARE
from motoremi.model.motor import dc_motor
from motoremi.schema.procedure import load_procedure
from motoremi.simulate import hidden_machine, ladders
from motoremi.simulate.hidden_effects import ANALYSER_FAULTS, HIDDEN_EFFECTS
from motoremi.simulate.network import Network, impedance
from motoremi.simulate.simulated_motor import SimulatedMotor
from motoremi.virtual.simulated_bench import SimulatedBench

WIDE = np.geomspace(100.0, 30e6, 201)
# Parameters for which the catalogue's law equals the network.
OTHERWISE: Mapping[str, Mapping[str, float]] = {
    "shorted-turn": {"skin_hz": 1e12},
    "second-resonance": {"series_share": 0.0},
    "permeability-relaxation": {"exponent": 1.0, "quality": 1e-9},
    "suppressor-choke": {"exponent": 1.0},
    "distributed-winding": {"end_share": NO_END_SHARE},
    "winding-sections": {"end_share": NO_END_SHARE},
    "suppressor-choke@brushes": {"exponent": 1.0},
    **{f"dielectric-relaxation@{place}": {"exponent": 1.0} for place in ("Ca", "Cr", "Cf")},
}
# What is hidden by other sizes than the catalogue's has tests elsewhere: conductors in test_simulate_ladders, a coupled mesh in
# test_rational_starts, a cable below, the far end's wire in test_connections_together; a motor that warms up changes all its capacitances, the
# catalogue's only Ca.
OTHER_SIZES = ("skin-effect", "proximity-effect", "field-coupling", "temperature-drift", "supply-cable", "far-end-tie")


def in_the_catalogue(motor: SimulatedMotor, termination: str) -> ComplexArray:
    """The same motor by the laws of the catalogue."""
    model, values = dc_motor(), dict(motor.elements)
    for effect in motor.effects:
        sizes = {**OTHERWISE.get(effect.name, {}), **effect.sizes}
        names = [effect.name]
        if effect.name == "common-mode-flux":
            sizes = {"share": 1 - sizes["share_lost"]}
        if effect.name == "second-resonance":
            sizes["resonance_hz"] = 1 / (2 * np.pi * np.sqrt(sizes["inductance_h"] * sizes.pop("capacitance_f")))
        if effect.name == "winding-modes":
            names *= 3
            for label, mode in (("", "first"), ("#2", "second"), ("#3", "third")):
                values |= {f"winding-modes{label}.{what}": sizes[f"{mode}_{what}"] for what in ("capacitance_f", "resonance_hz")}
            sizes = {"quality": sizes["quality"]}
        values |= {f"{effect.name}.{name}": size for name, size in sizes.items()}
        model = add_effects(model, names)
    return impedance_of(model.circuit(termination), values, WIDE)


def worst(value: ComplexArray, expected: ComplexArray) -> float:
    return float(np.max(np.abs(value / expected - 1)))


ALONE = [(name,) for name in HIDDEN_EFFECTS if name in identifiers() and name not in (*ANALYSER_FAULTS, *OTHER_SIZES)]


@pytest.mark.parametrize("termination", TERMINATIONS)
@pytest.mark.parametrize(
    "hidden",
    [
        *ALONE,
        ("machine-winding", "winding-modes", "suppressor-choke"),
        ("distributed-winding", "winding-modes"),
        ("distributed-winding", "suppressor-capacitor"),
        ("winding-sections",),
        ("winding-sections", "suppressor-capacitor", "lead-inductance"),
        ("common-mode-flux", "core-loss", "suppressor-capacitor@pair"),
        ("suppressor-choke@brushes", "suppressor-capacitor", "suppressor-capacitor@frame", "second-resonance"),
    ],
)
def test_the_network_is_what_the_catalogue_says(hidden: tuple[str, ...], termination: str) -> None:
    for seed in range(4):
        motor = SimulatedMotor.random(seed, hidden)
        assert worst(motor.impedance(termination, WIDE), in_the_catalogue(motor, termination)) < 2e-4, seed


# In the network each takes its share of the whole La, in the catalogue of what the other leaves: the same curve, other parameter values.
OF_THE_CORE = {"eddy-laminations", "permeability-relaxation", "rotor-cage", "shorted-turn"}
# The leak across the whole of Cf in the catalogue is across its lumped part in the network: another number for it.
RENAMED = {("insulation-leakage@Cf", "distributed-winding")}

CONDUCTORS = {"lead-inductance", "ground-strap-inductance"}


@pytest.mark.slow
def test_the_network_of_each_pair_is_what_the_catalogue_says() -> None:
    compared = 0
    for pair in combinations([name for (name,) in ALONE], 2):
        if set(pair) <= OF_THE_CORE or pair in RENAMED:
            continue
        try:
            motor = SimulatedMotor.random(0, pair)
        except BadInput:
            # They change the same parts of the winding.
            continue
        compared += 1
        # Below, the simulated lead is a round wire without skin effect; the catalogue's has a quarter of that resistance and the rest is in Ra.
        shown = (100e3 if CONDUCTORS & set(pair) else 0.0) < WIDE
        for termination in TERMINATIONS:
            simulated, catalogued = motor.impedance(termination, WIDE), in_the_catalogue(motor, termination)
            assert worst(simulated[shown], catalogued[shown]) < 2e-4, (pair, termination)
    assert compared > 350


@pytest.mark.parametrize("termination", TERMINATIONS)
def test_a_cable_of_cells_is_a_line(termination: str) -> None:
    """Against the closed form, with the wire's own impedance; cells and branches of the loss angle in between."""
    s = 2j * np.pi * WIDE
    for seed in range(4):
        motor = SimulatedMotor.random(seed, ("supply-cable",))
        load = dataclasses.replace(motor, effects=()).impedance(termination, WIDE)
        sizes = motor.effects[0].sizes
        # At 1 MHz the skin effect of copper wire of 1 mm radius adds 7.566 times its resistance at DC.
        wire = impedance(ladders.round_wire(sizes["skin_ohm"] / 7.566, 1e-3), "in", "out", WIDE)
        loss = (s / (2j * np.pi * 1e6)) ** (-2 / np.pi * np.arctan(sizes["tan_delta"])) * np.exp(-1j * np.arctan(sizes["tan_delta"]))
        series, shunt = s * sizes["inductance_h"] + wire, s * sizes["capacitance_f"] * loss
        wave, angle = np.sqrt(series / shunt), np.sqrt(series * shunt)
        expected = wave * (load + wave * np.tanh(angle)) / (wave + load * np.tanh(angle))
        assert worst(motor.impedance(termination, WIDE), expected) < 2e-4, seed


def test_every_effect_of_the_catalogue_can_be_hidden() -> None:
    physical = {name for name in identifiers() if find_effect(name).effect.group != "instrument"}
    assert not physical - set(HIDDEN_EFFECTS)
    assert set(HIDDEN_EFFECTS) & set(identifiers()) == physical | {"temperature-drift", "far-end-tie", *ANALYSER_FAULTS}


def test_cores_of_all_kinds_are_hidden() -> None:
    """One time constant, many, and a damped resonance."""
    kinds = {tuple(sorted(SimulatedMotor.random(seed, ["permeability-relaxation"]).effects[0].sizes)) for seed in range(12)}
    assert kinds == {("corner_hz", "share"), ("corner_hz", "exponent", "share"), ("corner_hz", "quality", "share")}


@pytest.mark.parametrize("exponent", [0.55, 0.65, 0.75])
def test_iron_relaxes_over_decades(exponent: float) -> None:
    law = 2j * np.pi * WIDE * 1e-5 / (1 + (1j * WIDE / 3e5) ** exponent)
    value = impedance(ladders.spread_relaxation(1e-5, 3e5, exponent), "in", "out", WIDE)
    assert worst(value, law) < 2e-4
    finer = ladders.spread_relaxation(1e-5, 3e5, exponent, per_decade=12)
    assert worst(value, impedance(finer, "in", "out", WIDE)) < 2e-4


def test_iron_with_no_spread_is_refused() -> None:
    with pytest.raises(BadInput, match="exponent"):
        ladders.spread_relaxation(1e-5, 3e5, 1.0)


def test_a_machine_of_four_times_the_cells(monkeypatch: pytest.MonkeyPatch) -> None:
    motors = [SimulatedMotor.random(seed, ["machine-winding"]) for seed in range(5)]
    before = [motor.impedance("open", WIDE) for motor in motors]
    monkeypatch.setattr(hidden_machine, "MACHINE_CELLS", 4 * hidden_machine.MACHINE_CELLS)
    for motor, value in zip(motors, before, strict=True):
        assert worst(value, motor.impedance("open", WIDE)) < 1e-4


def test_a_warm_machine_shares_its_cells_still() -> None:
    network = SimulatedMotor.random(1, ["machine-winding", "temperature-drift"]).network("open")
    cells = {id(item.network) for item in network.items if item.name.startswith("cell")}  # type: ignore[union-attr]
    assert len(cells) == 1


@pytest.mark.parametrize(("effect", "share"), [("rotor-cage", 0.02), ("shorted-turn", 0.02), ("machine-winding", 0.05)])
def test_loops_show_in_the_resistance_below_20_khz(effect: str, share: float) -> None:
    """The change is far above the 0.1 % of a good analyser, and neither Ra nor La can describe it."""
    for seed in range(10):
        seen = SimulatedMotor.random(seed, [effect]).impedance("short", WIDE[WIDE < 20e3])
        assert np.ptp(seen.real) > share * np.abs(seen).max(), seed


def test_eddy_currents_of_the_frame_show_in_the_resistance_of_the_return() -> None:
    for seed in range(10):
        motor = SimulatedMotor.random(seed, ["frame-eddy"])
        band = WIDE[WIDE > 1e6]
        path = motor.network("open").item("Lr")
        seen = impedance(Network((dataclasses.replace(path, positive="in", negative="out"),)), "in", "out", band)
        assert np.ptp(seen.real) > 0.1 * motor.Rr, seed


@pytest.mark.parametrize("effect", [name for name in HIDDEN_EFFECTS if name in identifiers()])
def test_every_effect_can_be_had_on_the_bench_in_a_band_that_shows_it(effect: str) -> None:
    with closing(SimulatedBench(4, (effect,))) as bench:
        assert effect in (*(hidden.name for hidden in bench.motor.effects), *ANALYSER_FAULTS)
    sweep = demo.story_procedure(effect).sweep
    assert sweep is not None
    assert sweep.start == (100.0 if effect in ("rotor-cage", "shorted-turn", "machine-winding", "winding-sections") else 150e3)


def test_the_demo_of_nothing_measures_the_usual_band() -> None:
    for effect in ("none", "outside-tapped-winding"):
        told, full = demo.story_procedure(effect), load_procedure("full_motor_test")
        assert told.sweep == full.sweep
        # The demo writes its report after the last step.
        assert [*told.steps, full.steps[-1]] == list(full.steps)


def test_two_accounts_of_one_winding_are_not_hidden_together() -> None:
    for other in ("distributed-winding", "rotor-cage", "core-loss"):
        with pytest.raises(BadInput, match="hide one of them"):
            SimulatedMotor.random(1, [other, "machine-winding"])


@pytest.mark.parametrize("seed", range(40))
def test_proximity_beside_a_cage_keeps_an_inductance(seed):
    """Both set the copper resistance, and the layers take part of La in proportion to it."""
    motor = SimulatedMotor.random(seed, effects=("rotor-cage", "shorted-turn", "proximity-effect"))
    assert np.all(np.isfinite(motor.impedance("short", np.geomspace(10e3, 30e6, 5))))
