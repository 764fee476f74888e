"""Connections and suppressors beside each other, against the nodal analysis of the simulated motor, which has its own netlists."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from motoremi.export.realise import realise
from motoremi.model.circuit import Tape
from motoremi.model.effects import add_effects
from motoremi.model.effects.winding import NO_END_SHARE
from motoremi.model.motor import dc_motor
from motoremi.simulate.simulated_motor import SimulatedMotor

FREQUENCY_HZ = np.geomspace(150e3, 30e6, 101)
# The loss of the simulated capacitor is a ladder of four branches per decade; most near a resonance, but by less than this, it differs from a
# constant loss angle.
LADDER = 3e-6
# Leads and straps of the simulation are round wires of 2 mm diameter: at 150 kHz their impedance differs from that of a half space by 1.6 % of
# their DC resistance: less than this share of the motor's impedance.
ROUND_WIRE = 4e-5
# From the motor outwards, as they are connected.
OUTWARDS = (
    "second-resonance",
    "suppressor-capacitor",
    "suppressor-capacitor@frame",
    "suppressor-capacitor@pair",
    "suppressor-choke",
    "ground-strap-inductance",
    "lead-inductance",
    "terminal-capacitance",
)
# It does not matter when they are added.
ORDERS = [
    *combinations(OUTWARDS, 2),
    *combinations(reversed(OUTWARDS), 2),
    ("suppressor-capacitor@frame", "suppressor-choke", "ground-strap-inductance"),
    ("terminal-capacitance", "suppressor-capacitor@pair", "ground-strap-inductance"),
    ("lead-inductance", "suppressor-capacitor@frame", "ground-strap-inductance"),
    ("suppressor-capacitor", "second-resonance", "suppressor-choke"),
]
LINES = ("distributed-winding", "winding-sections", "machine-winding")


def values_of(simulated: SimulatedMotor) -> dict[str, float]:
    """As the catalogue calls them: a cell by its resonance."""
    values = {**simulated.elements, **{f"{one.name}.{name}": value for one in simulated.effects for name, value in one.sizes.items()}}
    if (farad := values.pop("second-resonance.capacitance_f", None)) is not None:
        values["second-resonance.resonance_hz"] = 1 / (2 * np.pi * np.sqrt(values["second-resonance.inductance_h"] * farad))
        values["second-resonance.series_share"] = 0.0
    # The simulated choke's ferrite has one time constant.
    values["suppressor-choke.exponent"] = 1.0
    # Ca of the simulated lines lies between turns.
    values |= {f"{line}.end_share": NO_END_SHARE for line in LINES}
    return values


def wire_ohm(sizes: dict[str, float], s: np.ndarray) -> np.ndarray:
    """A contact, the inductance around a wire and the impedance of its skin, which at 1 MHz is `skin_ohm` times 1 + j."""
    return sizes["resistance_ohm"] + s * sizes["inductance_h"] + sizes["skin_ohm"] * (1 + 1j) * np.sqrt(s.imag / (2e6 * np.pi))


@pytest.mark.parametrize("names", ORDERS, ids=" + ".join)
def test_effects_of_the_connection_are_where_the_simulated_motor_has_them(names: tuple[str, ...]) -> None:
    simulated = SimulatedMotor.random(5, names)
    motor = add_effects(dc_motor(), names)
    values = values_of(simulated)
    parameters = [parameter.name for parameter in motor.parameters]
    ladder = LADDER if any(name.startswith(("suppressor-capacitor", "terminal-capacitance")) for name in names) else 1e-9
    ladder = ROUND_WIRE if {"lead-inductance", "ground-strap-inductance"} & set(names) else ladder
    netlist = realise(motor, values, (FREQUENCY_HZ[0], FREQUENCY_HZ[-1]))
    for termination in ("short", "open"):
        expected = simulated.impedance(termination, FREQUENCY_HZ)
        seen = Tape(motor.circuit(termination), parameters).impedance(2j * np.pi * FREQUENCY_HZ, np.array([values[name] for name in parameters]))
        np.testing.assert_allclose(seen, expected, rtol=ladder)
        # The choke's loss is a ladder there, within what the export states.
        np.testing.assert_allclose(
            netlist.impedance(termination, FREQUENCY_HZ), expected, rtol=max(ladder, 3 * max(netlist.ladder_errors.values(), default=0))
        )


@pytest.mark.parametrize(
    "beside",
    [
        (),
        ("ground-strap-inductance",),
        ("lead-inductance", "terminal-capacitance"),
        ("suppressor-capacitor@frame",),
        ("second-resonance", "suppressor-capacitor"),
        ("distributed-winding",),
        ("winding-sections",),
    ],
    ids=" + ".join,
)
def test_the_wire_from_the_far_end_is_beside_the_path_through_the_frame(beside: tuple[str, ...]) -> None:
    simulated = SimulatedMotor.random(5, ("far-end-tie", *beside))
    motor = add_effects(dc_motor(), [one.name for one in simulated.effects])
    values = values_of(simulated)
    parameters = [parameter.name for parameter in motor.parameters]
    for termination in ("short", "open"):
        seen = Tape(motor.circuit(termination), parameters).impedance(2j * np.pi * FREQUENCY_HZ, np.array([values[name] for name in parameters]))
        np.testing.assert_allclose(seen, simulated.impedance(termination, FREQUENCY_HZ), rtol=max(LADDER, ROUND_WIRE))


def test_with_its_far_end_on_the_frame_the_strap_carries_the_suppressor_as_well() -> None:
    simulated = SimulatedMotor.random(5, ("suppressor-capacitor@frame", "ground-strap-inductance"))
    motor = add_effects(dc_motor(), [one.name for one in simulated.effects])
    values = {**simulated.elements, **{f"{one.name}.{name}": value for one in simulated.effects for name, value in one.sizes.items()}}
    parameters = [parameter.name for parameter in motor.parameters]
    s = 2j * np.pi * FREQUENCY_HZ
    seen = Tape(motor.circuit("grounded"), parameters).impedance(s, np.array([values[name] for name in parameters]))
    bare = SimulatedMotor(**simulated.elements)
    sizes = {one.name: one.sizes for one in simulated.effects}
    capacitor, strap = sizes["suppressor-capacitor@frame"], sizes["ground-strap-inductance"]
    loss = (s / (2 * np.pi * 1e6)) ** (2 / np.pi * np.arctan(capacitor["tan_delta"]))
    branch = capacitor["esr_ohm"] + s * capacitor["esl_h"] + loss / (s * capacitor["capacitance_f"])
    expected = 1 / (1 / bare.impedance("short", FREQUENCY_HZ) + 1 / branch) + wire_ohm(strap, s)
    np.testing.assert_allclose(seen, expected, rtol=LADDER)


@pytest.mark.parametrize("line", LINES)
@pytest.mark.parametrize("across", [(), ("suppressor-capacitor",)], ids=["bare", "suppressor-capacitor"])
def test_the_slopes_of_a_winding_whose_frame_is_behind_a_strap_are_those_of_finite_differences(line: str, across: tuple[str, ...]) -> None:
    simulated = SimulatedMotor.random(3, (line, *across, "ground-strap-inductance"))
    motor = add_effects(dc_motor(), [one.name for one in simulated.effects])
    values = values_of(simulated)
    names = [parameter.name for parameter in motor.parameters]
    tape, s = Tape(motor.circuit("short"), names), 2j * np.pi * FREQUENCY_HZ
    at = np.array([values[name] for name in names])
    gradient = tape.gradient(s, at)[1]
    for place, name in enumerate(names):
        if name == "winding-sections.sections":
            continue
        step = 1e-6 * at[place]
        apart = [tape.impedance(s, at + sign * step * (np.arange(at.size) == place)) for sign in (1, -1)]
        # A difference of 1e-6 of a value: its square of what bends, and the last digits of the impedance.
        allowed = 1e-4 * np.abs(gradient[place]) + 1e-13 * np.abs(apart[0]) / step
        assert np.all(np.abs(gradient[place] - (apart[0] - apart[1]) / (2 * step)) <= allowed), name
