"""Interference suppressors built into motors: capacitors at the brushes and chokes in the leads."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

from motoremi.model import laws, materials
from motoremi.model.circuit import Leaf, Node, Parallel, Scaled, Series
from motoremi.model.effects import suppressor_starts
from motoremi.model.effects.effect import Effect
from motoremi.model.effects.start import Subtract
from motoremi.model.motor import Motor, Outwards
from motoremi.model.parameter import Parameter


def _capacitor(motor: Motor, place: str, parameters: Mapping[str, Parameter]) -> Motor:
    loss = (parameters["tan_delta"],)
    branch = Series(
        (
            Scaled(Leaf("suppressor C", laws.capacitor, (parameters["capacitance_f"],)), materials.constant_phase_factor, loss),
            Leaf("suppressor ESR", laws.resistance_and_inductance, (parameters["esr_ohm"], parameters["esl_h"])),
        )
    )
    if not place:
        return motor.with_across(branch)
    if place == "guarded":
        return motor.with_part_to_frame(branch, ("open",))
    shunted = motor.with_part_to_frame(branch)
    if place == "frame":
        return shunted
    return dataclasses.replace(shunted, frame=Parallel((shunted.frame, branch)))


def _choke(motor: Motor, place: str, parameters: Mapping[str, Parameter]) -> Motor:
    core = (parameters["share"], parameters["corner_hz"], parameters["exponent"])
    coil = Scaled(Leaf("choke L", laws.inductor, (parameters["inductance_h"],)), materials.cole_cole_factor, core)
    choke: Node = Series((Leaf("choke R", laws.resistor, (parameters["resistance_ohm"],)), coil))
    choke = Parallel((choke, Leaf("choke C", laws.capacitor, (parameters["capacitance_f"],))))
    return motor.with_first_turns(choke) if place == "brushes" else motor.attached(lambda node: Series((node, choke)), place=Outwards.CHOKE)


EFFECTS = (
    Effect(
        name="suppressor-capacitor",
        group="connection",
        kin="suppressor",
        title=(
            "a suppressor capacitor, alone or with a resistor (snubber): across the terminals, from the terminal to the frame, one from either "
            "terminal to the frame, or from the terminal to a frame that a guard holds in the short-circuit sweep, which then does not show it"
        ),
        formula=(
            "Z_across / (1 + Z_across / (esr_ohm + s * esl_h + (s / (2 * pi * 1e6))**(2 * atan(tan_delta) / pi) / (s * capacitance_f)))"
        ),
        parameters=(
            Parameter(
                "capacitance_f", "F", 0.4e-9, 10e-6,
                "1 nF to the frame, 10 nF - 1 uF across the terminals; a varistor is one of 0.5 - 5 nF", usual=(0.5e-9, 10e-6),
            ),
            Parameter("esr_ohm", "Ohm", 1e-3, 300.0, "10 mOhm - 1 Ohm of capacitors, more of varistors; 10 - 200 Ohm in a snubber"),
            Parameter("esl_h", "H", 0.3e-9, 200e-9, "1 nH a chip, 1 nH a millimetre of wire"),
            Parameter(
                "tan_delta",
                "",
                1e-4,
                0.1,
                "0.0005 polypropylene, 0.01 polyester, up to 0.035 ceramic of class 2, more of varistors; 1e-4 is none",
                special=1e-4,
            ),
        ),
        limit="capacitance_f -> 0",
        limit_values={"capacitance_f": 1e-24, "esr_ohm": 0.1, "esl_h": 1e-8, "tan_delta": 1e-4},
        signature="|Z| low over a wide band with a sharp series resonance at 1 - 50 MHz, inductive above",
        look_alikes=("second-resonance", "winding-modes", "terminal-capacitance"),
        deciding="look: a disc or film capacitor, or a varistor, at the brush holder; lift one of its legs and sweep again",
        source=(
            "IEC 60384-14 (capacitors of class X and Y), IEC 60384-9 (loss of ceramic capacitors of class 2); values as in data sheets, "
            "unconfirmed for a given motor"
        ),
        change=_capacitor,
        starts=tuple(
            {"capacitance_f": c, "esr_ohm": 0.1, "esl_h": x, "tan_delta": suppressor_starts.LITTLE_LOSS}
            for c in (1e-9, 1e-8, 1e-7)
            for x in (5e-9, 3e-8)
        ),
        reader=suppressor_starts.suppressor_capacitor,
        places=("", "frame", "pair", "guarded"),
        responds={"second-temperature": {"capacitance_f": 0.97}, "brushes-lifted": {"capacitance_f": 0.0}},
    ),
    Effect(
        name="suppressor-choke",
        group="connection",
        kin="suppressor",
        title="a suppressor choke in the lead: a coil on a ferrite rod, outside of suppressor capacitors or between them and the brushes",
        places=("", "brushes"),
        beside={"brushes": "suppressor-capacitor"},
        formula=(
            "Z + 1 / (1 / (resistance_ohm + s * inductance_h * (1 - share + share / (1 + (s / (2 * pi * corner_hz))**exponent))) "
            "+ s * capacitance_f)"
        ),
        parameters=(
            Parameter("inductance_h", "H", 0.3e-6, 1e-3, "2 - 50 uH on rods of 3 to 8 mm"),
            Parameter("share", "", 0.05, 0.97, "share of the flux in the ferrite: a rod's air path leaves little below 0.5", usual=(0.3, 0.97)),
            Parameter("corner_hz", "Hz", 0.5e6, 300e6, "MnZn 1 - 5 MHz, NiZn 5 - 300 MHz"),
            Parameter("exponent", "", 0.75, 1.0, "1 is one time constant; ferrites have several (0.75 - 0.95 in docs/cores.md)", special=1.0),
            Parameter("capacitance_f", "F", 0.1e-12, 20e-12, "between the turns"),
            Parameter("resistance_ohm", "Ohm", 1e-3, 1.0, "of its wire"),
        ),
        limit="inductance_h, resistance_ohm -> 0",
        limit_values={"inductance_h": 1e-18, "share": 0.5, "corner_hz": 1e7, "exponent": 1.0, "capacitance_f": 1e-18, "resistance_ohm": 1e-12},
        signature="some uH more in both sweeps than the winding's, lossy above a few MHz, a broad parallel resonance at 10 - 100 MHz",
        look_alikes=("lead-inductance", "second-resonance", "permeability-relaxation"),
        deciding="look: a rod with a few turns at each brush; bridge it with a wire and sweep again",
        source=(
            "share from the apparent permeability of rods, which their length over diameter limits: Payne, The Inductance of Ferrite Rod Antennas, "
            "and the curves at bytemark.com/products/rodperm.htm; inductances and capacitances are estimates, unconfirmed for a given motor"
        ),
        change=_choke,
        starts=tuple(
            {"inductance_h": x, "share": 0.8, "corner_hz": f, "exponent": 0.95, "capacitance_f": 2e-12, "resistance_ohm": 0.02, Subtract("La"): x}
            for x in (1e-6, 4e-6)
            for f in (3e6, 2e7)
        ),
        reader=suppressor_starts.suppressor_choke,
        responds={
            # A bias makes the ferrite less permeable: its part of the inductance falls, that of the air path stays.
            "dc-bias": {"inductance_h": 0.85, "share": 0.95, "corner_hz": 1.15},
            "second-temperature": {"corner_hz": 0.94},
            "brushes-lifted": {"inductance_h": 0.0, "resistance_ohm": 0.0},
        },
        copper={"resistance_ohm": 1.0},
    ),
)  # fmt: skip
