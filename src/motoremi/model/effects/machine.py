"""Effects of larger machines: rotor, frame, flux paths, shorted turns, and the winding as a whole."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from motoremi.model import laws, materials
from motoremi.model.circuit import Leaf, Series, find, with_law
from motoremi.model.effects import rational_starts
from motoremi.model.effects.effect import Effect
from motoremi.model.effects.start import Scale
from motoremi.model.effects.winding import scale
from motoremi.model.motor import Motor, OpenSweepFactor
from motoremi.model.parameter import Parameter

# Above this a cage, or a turn of thick copper, is a constant loss and a smaller La, and little more where its skin effect is weak.
CAGE_SEEN_BELOW_HZ = 20e3
# A closed loop of solid metal that encloses a part of the flux, in the rotor or in the winding.
LOOP = "s * La * (1 - share * s / (s + w * x / tanh(x))), w = 2 * pi * corner_hz, x = sqrt(s / (2 * pi * skin_hz))"


# Corner and skin frequency to start a cage from. With both below the band only a term that grows as sqrt(f) is seen, with the factor
# share * corner / sqrt(skin): starts with a high skin frequency then end in a local minimum, with a log evidence lower by 9.
_CAGES = ((100.0, 3e5), (500.0, 100.0), (500.0, 3e5), (1.5e3, 2e3), (2e3, 3e5), (2e4, 3e5))


def _within(own: Mapping[str, float]) -> float:
    """Inductance within a loop's conductor over that outside: for low f, w * x / tanh(x) is w + s * corner_hz / (3 * skin_hz).

    For a ring of round wire it is 1 / (4 * (ln(8 r / a) - 2)) (Grover, Inductance Calculations, 1946), 0.08 with r = 20 a; for a sleeve a third
    of its thickness over its radius.
    """
    return own["corner_hz"] / (3 * own["skin_hz"])


def _common_mode(motor: Motor, place: str, parameters: Mapping[str, Parameter]) -> Motor:
    path = OpenSweepFactor("La", laws.share_factor, (parameters["share"],))
    return dataclasses.replace(motor, open_factors=(*motor.open_factors, path))


def _machine(motor: Motor, place: str, parameters: Mapping[str, Parameter]) -> Motor:
    core = tuple(parameters[name] for name in ("cage_share", "cage_hz", "iron_hz", "exponent"))
    path = Series(
        (
            Leaf("path", laws.resistor, (parameters["path_ohm"],)),
            Leaf("slots", laws.capacitor, (parameters["slots_f"],)),
        )
    )
    relaxing = motor.replaced("La", lambda whole: with_law(whole, materials.machine_core_factor, core))
    return dataclasses.replace(relaxing, spread=path)


def _mode(motor: Motor, place: str, parameters: Mapping[str, Parameter]) -> Motor:
    first = find(motor.winding, "mode")
    # All modes share the quality of the first.
    quality = parameters["quality"] if first is None else first.own_parameters[-1]
    return motor.with_branch(Leaf("mode", laws.resonant_branch, (parameters["capacitance_f"], parameters["resonance_hz"], quality)))


EFFECTS = (
    Effect(
        name="winding-modes",
        group="winding",
        kin="winding-resonance",
        title="one more mode of the winding, as seen from its terminals",
        formula="Z_winding / (1 + Z_winding * s * capacitance_f / (1 + s / (w * quality) + (s / w)**2)), w = 2 * pi * resonance_hz",
        parameters=(
            Parameter("capacitance_f", "F", 0.1e-12, 10e-9, "10 - 40 pF a mode on a machine of 1.5 HP, wider for other sizes"),
            Parameter("resonance_hz", "Hz", 1e4, 200e6, "from the first resonance of a large winding to the end of what analysers see"),
            Parameter("quality", "", 1.0, 200.0, "2 - 10 on machines; one value for all modes"),
        ),
        limit="capacitance_f -> 0",
        limit_values={"capacitance_f": 1e-24, "resonance_hz": 1e7, "quality": 5.0},
        signature="a step down of the apparent capacitance at its frequency, with a dip of |Z|; several of them in a row",
        look_alikes=("second-resonance", "suppressor-capacitor"),
        deciding="none: a mode says that the winding resonates there, not why; geometry (taps, coils a slot) says the rest",
        source="modal description of a network (Foster 1924), one damping for all modes; no published model of machines is followed",
        change=_mode,
        starts=tuple({"capacitance_f": 1e-11, "resonance_hz": f, "quality": 5.0} for f in np.geomspace(3e5, 30e6, 8)),
        reader=rational_starts.winding_modes,
        repeatable=True,
        describes=True,
        hides=("Ra", "lead-inductance.resistance_ohm", "lead-inductance.skin_ohm"),
    ),
    Effect(
        name="machine-winding",
        group="winding",
        kin="winding-resonance",
        title="a machine's winding: copper and relaxing iron as a line to the core, a cage in the rotor, Ca across the ends",
        formula=(
            "1 / (1 / (Zc * tanh(theta)) + s * Ca), theta = sqrt(Za / Zs), Zc = sqrt(Za * Zs), Zs = path_ohm + 1 / (s * slots_f), "
            "Za = Ra + s * La * ((1 - cage_share) / (1 + (s / (2 * pi * iron_hz))**exponent) + cage_share / (1 + s / (2 * pi * cage_hz)))"
        ),
        parameters=(
            Parameter("slots_f", "F", 5e-12, 1e-6, "winding to core, from a fractional to some hundred kW; as the line's far end is shorted"),
            Parameter("path_ohm", "Ohm", 0.1, 20e3, "through laminations to the frame"),
            # Iron and cages are the same in a sweep of lower frequencies, for which the ranges are wider.
            Parameter("iron_hz", "Hz", 300.0, 10e6, "sheets of 0.35 to 0.65 mm, to solid or finely divided iron", usual=(300.0, 10e6)),
            Parameter("exponent", "", 0.3, 1.0, "0.5 is diffusion, 1 one time constant"),
            Parameter("cage_share", "", 1e-3, 0.95, "share of La that the rotor's conductors screen"),
            Parameter(
                "cage_hz", "Hz", 5.0, 20e3, "resistance of a cage over its inductance; an armature's shorted coils lie higher", usual=(5.0, 20e3)
            ),
        ),
        limit="slots_f, cage_share -> 0, iron_hz -> infinity",
        limit_values={"slots_f": 1e-24, "path_ohm": 1.0, "iron_hz": 1e24, "exponent": 1.0, "cage_share": 0.0, "cage_hz": 300.0},
        signature="R far above copper from a few hundred hertz on, L falling over decades, a broad resonance, then a chain of shallow ones",
        look_alikes=("distributed-winding", "eddy-laminations", "rotor-cage"),
        deciding="sweep from 100 Hz; with the rotor out the cage's share is gone",
        source="measured on a 1.5 HP machine (docs/real_motor.md); line and cage as in Mirafzal et al., IEEE Trans. Ind. Appl. 43 (2007) 1233",
        change=_machine,
        starts=tuple(
            {"slots_f": c, "path_ohm": 100.0, "iron_hz": 5e4, "exponent": 0.7, "cage_share": 0.3, "cage_hz": 500.0} for c in (1e-11, 1e-10, 1e-9)
        ),
        reader=rational_starts.machine_winding,
        responds={"dc-bias": {"cage_share": 1.1, "iron_hz": 1.25}, "rotor-out": {"cage_share": 0.0}, "second-temperature": {"iron_hz": 1.1}},
        copper={"cage_hz": 1.0},
        below_hz=CAGE_SEEN_BELOW_HZ,
        shows_below_hz=CAGE_SEEN_BELOW_HZ,
        hides=("Ra",),
        excludes=("distributed-winding",),
    ),
    Effect(
        name="rotor-cage",
        group="rotor",
        kin="winding-loss",
        title="a cage, a sleeve or other solid conductors in the rotor",
        formula=LOOP,
        parameters=(
            Parameter("share", "", 0.02, 0.95, "0.3 - 0.9 of the flux of an induction machine; less with a wide air gap"),
            Parameter(
                "corner_hz",
                "Hz",
                5.0,
                # A sleeve of radius r and thickness t: rho / (pi mu0 r t); of stainless steel 18 kHz with 10 and 1 mm, 180 kHz with 5 and 0.2 mm.
                500e3,
                "resistance over inductance: 330 Hz of the cage of a machine of 1.5 HP, 10 to 200 kHz of a sleeve of steel around magnets",
            ),
            Parameter(
                "skin_hz",
                "Hz",
                10.0,
                10e6,
                "where current keeps to the surface: 10 Hz in 26 mm of aluminium, 5 MHz in 0.2 mm of steel; at the upper end it is not seen",
                special=10e6,
                # Bars are no deeper for a sweep of lower frequencies, for which the range is wider.
                usual=(10.0, 10e6),
            ),
        ),
        limit="share -> 0",
        limit_values={"share": 0.0, "corner_hz": 300.0, "skin_hz": 10e6},
        signature="L falls by its share within a decade of the corner, R rises to a plateau and on as sqrt(f) with deep bars",
        look_alikes=("shorted-turn", "eddy-laminations", "permeability-relaxation", "skin-effect", "proximity-effect"),
        deciding="take the rotor out: the cage goes with it, a shorted turn stays",
        source="coupled circuits; deep bars: Alger, Induction Machines (1970); corner measured on a 1.5 HP machine (docs/real_motor.md)",
        change=scale("La", materials.shorted_loop_factor),
        starts=tuple({"share": k, "corner_hz": f, "skin_hz": b, Scale("La"): 1 / (1 - k)} for k in (0.2, 0.6) for f, b in _CAGES),
        # It may be of copper, aluminium or steel, and the temperature of a rotor is not that of the winding.
        responds={"dc-bias": {"share": 1.05}, "rotor-out": {"share": 0.0}, "second-temperature": {"corner_hz": 1.12, "skin_hz": 1.12}},
        within=_within,
        # The armature of a DC motor is wound, and what acts like a cage there is solid iron, which other effects describe as well. An estimate.
        odds=0.2,
        seen_as=("inductance-loop",),
        shows_below_hz=CAGE_SEEN_BELOW_HZ,
    ),
    Effect(
        name="shorted-turn",
        group="winding",
        kin="winding-loss",
        title="a shorted turn or coil of the winding",
        formula=LOOP,
        parameters=(
            Parameter("share", "", 1e-3, 0.5, "square of the coupling; about the share of turns that are shorted"),
            Parameter(
                "corner_hz",
                "Hz",
                50.0,
                1e6,
                # 60 mm of wire of 0.2 mm have 33 mOhm and, without iron, 60 nH: 90 kHz. Wire of 0.1 mm has four times, a contact in it more.
                "resistance of the turn and its contact over its inductance: from 50 Hz of thick copper to 90 kHz of thin wire in air",
            ),
            Parameter("skin_hz", "Hz", 1e3, 100e6, "wire of 0.03 to 3 mm; at the upper end it is not seen", special=100e6, usual=(1e3, 100e6)),
        ),
        limit="share -> 0",
        limit_values={"share": 0.0, "corner_hz": 3e3, "skin_hz": 1e6},
        signature="L lower by its share above the corner, R higher by a constant that no copper explains",
        look_alikes=("rotor-cage", "permeability-relaxation", "eddy-laminations"),
        deciding="compare with a healthy winding of the same type; the DC resistance falls by the share of the turns, the cage's does not",
        source="coupled circuits (textbook); the ranges are estimates: no measured machine with a shorted turn was at hand",
        change=scale("La", materials.shorted_loop_factor),
        starts=tuple({"share": k, "corner_hz": f, "skin_hz": 3e6, Scale("La"): 1 / (1 - k)} for k in (0.02, 0.2) for f in (300.0, 3e3, 2e4, 2e5)),
        # How far the poles couple to the turn changes with the angle of the armature; an estimate.
        responds={"shaft-turned": {"share": 1.4}},
        copper={"corner_hz": 1.0, "skin_hz": 1.0},
        within=_within,
        seen_as=("inductance-loop",),
        shows_below_hz=CAGE_SEEN_BELOW_HZ,
    ),
    Effect(
        name="frame-eddy",
        group="rotor",
        kin="frame-loss",
        title="eddy currents and skin effect in core, frame and shaft, through which the common-mode current returns",
        formula="s * Lr * (1 - share + share * tanh(x) / x), x = sqrt(s / (pi * corner_hz))",
        parameters=(
            Parameter("share", "", 0.05, 0.95, "share of Lr whose flux lies in laminations and frame"),
            Parameter("corner_hz", "Hz", 1e3, 10e6, "sheets of 0.35 to 0.65 mm, and thinner effective layers"),
        ),
        limit="share -> 0",
        limit_values={"share": 0.0, "corner_hz": 1e5},
        signature="open-circuit sweep only: R of the return grows as sqrt(f), its inductance falls",
        look_alikes=("ground-strap-inductance", "bearing-film"),
        deciding="a second point on the frame for the strap: the loss of the strap changes, that of the core stays",
        source="Maki-Ontto and Luomi, IEEE IEMDC 2005, 1653 (abstract only); one-dimensional diffusion in a sheet",
        change=scale("Lr", materials.lamination_factor),
        starts=tuple({"share": k, "corner_hz": f, Scale("Lr"): 1 / (1 - 0.8 * k)} for k in (0.3, 0.8) for f in (1e4, 1e5, 1e6)),
        responds={"second-temperature": {"corner_hz": 1.1}},
        seen_as=("inductance-diffusion",),
    ),
    Effect(
        name="common-mode-flux",
        group="winding",
        kin="winding-loss",
        title="a flux path of its own for common-mode current",
        formula="s * La * share in the open-circuit sweep",
        parameters=(Parameter("share", "", 0.005, 2.0, "1 % of the differential inductance on a machine of 100 HP; near 1 with one winding"),),
        limit="share -> 1",
        limit_values={"share": 1.0},
        signature="La of the open-circuit sweep differs from that of the short-circuit sweep, by far more than leads do",
        look_alikes=("temperature-drift", "lead-inductance"),
        deciding="tie the far end to the frame and sweep again: with the return inside the winding La is that of the short-circuit sweep",
        source="Mirafzal, Skibinski, Tallam, IEEE Trans. Ind. Appl. 45 (2009) 142: 1 % on a machine of 100 HP",
        change=_common_mode,
        starts=tuple({"share": k} for k in (0.02, 0.2, 0.7, 1.3)),
        responds={"dc-bias": {"share": 0.9}},
    ),
)
