"""Effects of the connection between motor and fixture: leads, terminals, frame strap."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

from motoremi.model import laws, materials
from motoremi.model.circuit import Leaf, Line, Parallel, Scaled, Series
from motoremi.model.effects import cable_starts, rational_starts
from motoremi.model.effects.effect import Effect
from motoremi.model.effects.start import Subtract
from motoremi.model.motor import Motor, Outwards
from motoremi.model.parameter import Parameter


def _conductor(name: str, parameters: Mapping[str, Parameter]) -> Leaf:
    return Leaf(name, laws.conductor, tuple(parameters[key] for key in ("resistance_ohm", "inductance_h", "skin_ohm")))


def _lead(motor: Motor, place: str, parameters: Mapping[str, Parameter]) -> Motor:
    lead = _conductor("lead", parameters)
    return motor.attached(lambda node: Series((node, lead)))


def _terminal(motor: Motor, place: str, parameters: Mapping[str, Parameter]) -> Motor:
    capacitor = Leaf("terminal", laws.capacitor, (parameters["capacitance_f"],))
    terminal = Scaled(capacitor, materials.constant_phase_factor, (parameters["tan_delta"],))
    return motor.attached(lambda node: Parallel((node, terminal)), place=Outwards.TERMINALS)


def _cable(motor: Motor, place: str, parameters: Mapping[str, Parameter]) -> Motor:
    wave, delay = parameters["wave_ohm"], parameters["delay_s"]
    series = Leaf("cable", laws.line_series, (wave, delay, parameters["skin_ohm"]))
    shunt = Scaled(Leaf("cable", laws.line_shunt, (wave, delay)), materials.constant_phase_factor, (parameters["tan_delta"],))
    return motor.attached(lambda node: Line(series, shunt, node), place=Outwards.CABLE)


def _tie(motor: Motor, place: str, parameters: Mapping[str, Parameter]) -> Motor:
    return dataclasses.replace(motor, tie=_conductor("tie", parameters))


def _strap(motor: Motor, place: str, parameters: Mapping[str, Parameter]) -> Motor:
    strap = _conductor("strap", parameters)
    return dataclasses.replace(motor, strap=strap if motor.strap is None else Series((motor.strap, strap)))


_SKIN = Parameter(
    "skin_ohm",
    "Ohm",
    1e-4,
    3.0,
    "at 1 MHz 0.04 Ohm a metre of copper wire of 2 mm diameter, 0.13 of 0.6 mm; of steel some twenty times as much; 1e-4 is none",
    special=1e-4,
    usual=(1e-4, 0.3),
)

# Start values of a wire or strap of 1 to 40 cm.
_WIRES = tuple({**rational_starts.CONDUCTOR_REST, "inductance_h": henry} for henry in (1e-8, 5e-8, 1.5e-7, 4e-7))

EFFECTS = (
    Effect(
        name="lead-inductance",
        group="connection",
        title="inductance and resistance of the leads",
        formula="Z + resistance_ohm + s * inductance_h + skin_ohm * sqrt(2 * s / (2 * pi * 1e6))",
        parameters=(
            Parameter("resistance_ohm", "Ohm", 1e-3, 5.0, "1 - 50 mOhm; thin wire of a metre more", usual=(1e-3, 0.5)),
            Parameter("inductance_h", "H", 15e-9, 5e-6, "0.7 - 1.3 nH a millimetre; 20 mm to 2 m, a long cable more", usual=(15e-9, 2e-6)),
            _SKIN,
        ),
        limit="resistance_ohm, inductance_h, skin_ohm -> 0",
        limit_values={"resistance_ohm": 0.0, "inductance_h": 0.0, "skin_ohm": 0.0},
        signature="the same inductive difference in both sweeps, growing with f; a series resonance at high f",
        look_alikes=("short-residual", "gain-error", "ground-strap-inductance"),
        deciding="add a known 50 mm of lead; measure a short bar and a 100 pF standard on the same fixture",
        source="inductance of straight wires: Grover, Inductance Calculations (1946)",
        change=_lead,
        starts=({**rational_starts.CONDUCTOR_REST, "inductance_h": 1e-7},),
        reader=rational_starts.winding_behind_lead,
        seen_as=("series-inductance",),
    ),
    Effect(
        name="terminal-capacitance",
        group="connection",
        title="stray capacitance across the terminals",
        formula="Z / (1 + s * capacitance_f * Z / (s / (2 * pi * 1e6))**(2 * atan(tan_delta) / pi))",
        parameters=(
            Parameter("capacitance_f", "F", 0.8e-12, 400e-12, "terminal blocks of 1 - 20 pF, a metre of cable 100 pF, filters more"),
            Parameter("tan_delta", "", 1e-4, 0.1, "0.0005 PTFE, 0.02 glass epoxy, 0.03 phenolic, up to 0.1 PVC cable; 1e-4 is none", special=1e-4),
        ),
        limit="capacitance_f -> 0",
        limit_values={"capacitance_f": 1e-24, "tan_delta": 1e-4},
        signature="adds to Ca in the short-circuit sweep and shunts everything in the open one: the two disagree on Ca",
        look_alikes=("open-residual", "temperature-drift"),
        deciding="lift the lead and measure the terminal block alone",
        source="a capacitance across the terminals; values of terminal blocks are estimates without a source",
        change=_terminal,
        starts=tuple({"capacitance_f": c, "tan_delta": 0.002, Subtract("Ca"): c} for c in (2e-12, 1e-11, 3e-11)),
        responds={"terminal-block": {"capacitance_f": 0.0}, "brushes-lifted": {"capacitance_f": 0.0}},
    ),
    Effect(
        name="supply-cable",
        group="connection",
        title="the motor's cable as a line",
        formula="Zc * (Z + Zc * tanh(g)) / (Zc + Z * tanh(g)), Zc = sqrt(a / y), g = sqrt(a * y), "
        "a = s * wave_ohm * delay_s + skin_ohm * sqrt(2 * s / (2 * pi * 1e6)), "
        "y = s * delay_s / wave_ohm / (s / (2 * pi * 1e6))**(2 * atan(tan_delta) / pi)",
        parameters=(
            Parameter("wave_ohm", "Ohm", 25.0, 400.0, "50 - 75 Ohm coaxial, 80 - 150 Ohm supply cables, 300 Ohm wires apart", usual=(40.0, 200.0)),
            Parameter("delay_s", "s", 2e-9, 2e-7, "5 ns a metre: 0.4 m, of which less is a lead, to 40 m", usual=(2e-9, 5e-8)),
            Parameter("skin_ohm", "Ohm", 1e-3, 30.0, "at 1 MHz 0.04 - 0.3 Ohm a metre; 1e-3 is none", special=1e-3, usual=(1e-3, 3.0)),
            Parameter("tan_delta", "", 1e-4, 0.1, "0.0005 PTFE and polyethylene, up to 0.1 PVC; 1e-4 is none", special=1e-4),
        ),
        limit="delay_s, skin_ohm -> 0",
        limit_values={"wave_ohm": 100.0, "delay_s": 1e-20, "skin_ohm": 0.0, "tan_delta": 1e-4},
        signature="leads and capacitance at low f; then the resonances of a quarter wave and its multiples, the same in both sweeps",
        look_alikes=("lead-inductance", "terminal-capacitance", "cable-delay", "distributed-winding"),
        deciding="measure without the cable, or the cable alone with its far end open and shorted",
        source="line with losses (textbook); capacitance and inductance of supply cables are estimates from catalogues (unconfirmed)",
        change=_cable,
        starts=tuple(
            {"wave_ohm": ohm, "delay_s": delay, **cable_starts.REST, Subtract("Ca"): delay / ohm, Subtract("Cf"): delay / ohm}
            for ohm in (60.0, 150.0)
            for delay in (4e-9, 1.5e-8)
        ),
        reader=cable_starts.winding_behind_cable,
    ),
    Effect(
        name="ground-strap-inductance",
        group="connection",
        title="inductance and resistance of the frame strap",
        formula="Z_frame + resistance_ohm + s * inductance_h + skin_ohm * sqrt(2 * s / (2 * pi * 1e6))",
        parameters=(
            Parameter("resistance_ohm", "Ohm", 1e-3, 1.0, "1 - 100 mOhm and the path through the laminations"),
            Parameter("inductance_h", "H", 5e-9, 1e-6, "10 - 300 nH for a strap or a wire"),
            _SKIN,
        ),
        limit="resistance_ohm, inductance_h, skin_ohm -> 0",
        limit_values={"resistance_ohm": 0.0, "inductance_h": 0.0, "skin_ohm": 0.0},
        signature="open-circuit sweep only, inductive at high f; series resonance with Cf",
        look_alikes=("lead-inductance",),
        deciding="shorten or double the strap",
        source="Mirafzal, Skibinski, Tallam, IEEE Trans. Ind. Appl. 45 (2009) 142; straight wires: Grover (1946)",
        change=_strap,
        starts=_WIRES,
        reader=rational_starts.frame_behind_strap,
        responds={"longer-strap": {"resistance_ohm": 2.0, "inductance_h": 2.0, "skin_ohm": 2.0}},
    ),
    Effect(
        name="far-end-tie",
        group="instrument",
        title="inductance and resistance of the wire from the winding's far end to the analyser in the short-circuit sweep",
        formula="Z_winding + 1 / (1 / Z_tie + 1 / Z_frame), Z_tie = resistance_ohm + s * inductance_h + skin_ohm * sqrt(2 * s / (2 * pi * 1e6))",
        parameters=(
            Parameter("resistance_ohm", "Ohm", 1e-3, 1.0, "1 - 100 mOhm: wire and clamps"),
            Parameter("inductance_h", "H", 5e-9, 1e-6, "0.7 - 1.3 nH a millimetre: 10 mm to 1 m"),
            _SKIN,
        ),
        limit="resistance_ohm, inductance_h, skin_ohm -> 0",
        # Not 0, at which a line has no admittance at its end.
        limit_values={"resistance_ohm": 1e-9, "inductance_h": 0.0, "skin_ohm": 0.0},
        signature="short-circuit sweep only: inductive at high f, where the open one has nothing of it",
        look_alikes=("lead-inductance", "contact-resistance"),
        deciding="tie the far end with a wide strap as short as possible, and repeat the short-circuit sweep",
        source="inductance of straight wires: Grover, Inductance Calculations (1946)",
        change=_tie,
        # Without the open sweep the path through the frame is not known: beside the wire it would bend to any curve, and leads do as well.
        needs=("open",),
        starts=_WIRES,
    ),
)
