"""Effects of the winding beyond Ra, La and Ca, and the rotor's bearing film."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from motoremi.model import laws, materials
from motoremi.model.circuit import Leaf, Parallel, Series, with_law
from motoremi.model.effects import rational_starts
from motoremi.model.effects.effect import Change, Effect
from motoremi.model.effects.start import Scale
from motoremi.model.laws import Law
from motoremi.model.motor import Motor
from motoremi.model.parameter import Parameter


def scale(element: str, law: Law) -> Change:
    """The change that a law of one element's material makes: it scales the element's impedance."""

    def change(motor: Motor, place: str, parameters: Mapping[str, Parameter]) -> Motor:
        return motor.replaced(element or place, lambda whole: with_law(whole, law, tuple(parameters.values())))

    return change


def _core_loss(motor: Motor, place: str, parameters: Mapping[str, Parameter]) -> Motor:
    shunt = Leaf("Re", laws.resistor, tuple(parameters.values()))
    return motor.replaced("La", lambda whole: Parallel((whole, shunt)))


def _second_resonance(motor: Motor, place: str, parameters: Mapping[str, Parameter]) -> Motor:
    return motor.with_first_turns(Leaf("cell", laws.resonant_cell, tuple(parameters.values())))


def _cell_as_winding(values: Mapping[str, float]) -> dict[str, float]:
    """A cell and the winding that have exchanged places: each has the other's resonance, and at it the other's resistance."""
    cell, w = values["inductance_h"], 2 * np.pi * values["resonance_hz"]
    winding, own = values["La"], 1 / np.sqrt(values["La"] * values["Ca"])
    return {
        "La": cell,
        "Ca": 1 / (w**2 * cell),
        "Ra": (w * cell) ** 2 / values["resistance_ohm"],
        "inductance_h": winding,
        "resonance_hz": own / (2 * np.pi),
        "resistance_ohm": (own * winding) ** 2 / values["Ra"],
        "series_share": 0.0,
    }


# Stands for none: of a capacitance of exactly zero the impedance is infinite. No resonance shows so small a share.
NO_END_SHARE = 1e-9
END_SHARE = Parameter(
    "end_share",
    "",
    NO_END_SHARE,
    1 - NO_END_SHARE,
    "share of Ca from one end of the winding to the other instead of between turns: connections, brush holders; 1e-9 is none",
    "linear",
    special=NO_END_SHARE,
)


def _distributed(motor: Motor, place: str, parameters: Mapping[str, Parameter]) -> Motor:
    return dataclasses.replace(motor, distribution=parameters["share"], ends=parameters["end_share"])


def _film(element: str) -> Change:
    """A contact with its film, R parallel C, in series with an element."""

    def change(motor: Motor, place: str, parameters: Mapping[str, Parameter]) -> Motor:
        film = Parallel(
            (
                Leaf("film R", laws.resistor, (parameters["resistance_ohm"],)),
                Leaf("film C", laws.capacitor, (parameters["capacitance_f"],)),
            )
        )
        return motor.replaced(element, lambda whole: Series((whole, film)))

    return change


_COPPER_SHARE = Parameter(
    "share", "", 1e-4, 1.0, "copper's share of Ra: at MHz most of Ra may be core losses; 1 is a coil without a core", special=1.0
)

EFFECTS = (
    Effect(
        name="skin-effect",
        group="winding",
        kin="winding-loss",
        title="skin effect in round wire",
        formula="Ra * (1 + share * (x * I0(x) / (2 * I1(x)) - 1)), x = radius_m * sqrt(s * mu0 * sigma_copper)",
        parameters=(Parameter("radius_m", "m", 0.1e-3, 1.5e-3, "enamelled wire of 0.2 to 3 mm diameter"), _COPPER_SHARE),
        limit="radius_m -> 0",
        limit_values={"radius_m": 1e-8, "share": 1.0},
        signature="R grows as sqrt(f), phase of the extra part +45 deg, the resonance of La and Ca is damped a little",
        look_alikes=("proximity-effect", "eddy-laminations"),
        deciding="a sweep from 40 Hz (the corner shows below 150 kHz) and the DC resistance",
        source="Bessel solution for a round conductor (Lammeraner and Stafl, Eddy Currents, 1966); copper at 20 °C",
        change=scale("Ra", materials.wire_factor),
        starts=({"radius_m": 0.4e-3, "share": 1.0}, {"radius_m": 0.4e-3, "share": 0.03}),
        copper={"radius_m": -0.5},
        seen_as=("conductor-skin",),
        needs_a="winding",
    ),
    Effect(
        name="proximity-effect",
        group="winding",
        kin="winding-loss",
        title="proximity effect in a layered winding",
        formula="Ra * (1 + share * (y / tanh(y) + (layers**2 - 1) * y * tanh(y / 2) / 1.5 - 1)), y = height_m * sqrt(s * mu0 * sigma_copper * 0.8)",
        parameters=(
            Parameter("height_m", "m", 0.05e-3, 2e-3, "equivalent foil height of 0.06 to 2.3 mm wire"),
            Parameter("layers", "", 1.0, 60.0, "one layer to a full slot; more with thin wire in a deep slot", usual=(1.0, 20.0)),
            _COPPER_SHARE,
        ),
        limit="height_m -> 0",
        limit_values={"height_m": 1e-8, "layers": 2.0, "share": 1.0},
        signature="R grows as f^2, then as sqrt(f), far above the skin effect's; the inductance falls",
        look_alikes=("skin-effect", "eddy-laminations", "core-loss"),
        deciding="a sweep from 40 Hz (region of f^2), rotor removed, DC resistance at two temperatures",
        source="Dowell, Proc. IEE 113 (1966) 1387 (textbook form, porosity 0.8 assumed: unconfirmed for a given motor)",
        change=scale("Ra", materials.layers_factor),
        # Over a band in which thick wire is far above its corner, what looks like Ra is its resistance times some thirty.
        starts=(
            {"height_m": 0.2e-3, "layers": 4.0, "share": 1.0},
            {"height_m": 0.08e-3, "layers": 8.0, "share": 1.0},
            {"height_m": 0.05e-3, "layers": 3.0, "share": 1.0},
            {"height_m": 0.5e-3, "layers": 5.0, "share": 1.0, Scale("Ra"): 0.03},
            {"height_m": 0.5e-3, "layers": 5.0, "share": 0.01},
            {"height_m": 0.1e-3, "layers": 8.0, "share": 0.1},
        ),
        copper={"height_m": -0.5},
        seen_as=("conductor-layers",),
        needs_a="winding",
    ),
    Effect(
        name="eddy-laminations",
        group="winding",
        kin="winding-loss",
        title="eddy currents in the core's laminations",
        formula="s * La * (1 - share + share * tanh(x) / x), x = sqrt(s / (pi * corner_hz))",
        parameters=(
            Parameter("share", "", 0.01, 0.999, "share of La whose flux crosses laminations; nearly all with a small air gap"),
            Parameter(
                "corner_hz",
                "Hz",
                300.0,
                1e6,
                "steel sheet of 0.35 to 0.65 mm; up to 1 MHz for thin or resistive material",
            ),
        ),
        limit="share -> 0",
        limit_values={"share": 0.0, "corner_hz": 1e5},
        signature="L falls as f^-0.5 and R grows as f^0.5 over decades, without a resonance of its own",
        look_alikes=("skin-effect", "proximity-effect", "permeability-relaxation"),
        deciding="a sweep from 40 Hz (knee at the corner frequency), DC bias, rotor in and out",
        source="one-dimensional diffusion in a sheet (Lammeraner and Stafl, Eddy Currents, 1966)",
        change=scale("La", materials.lamination_factor),
        # A small share with a high corner frequency is a false minimum next to the true one, so the grid covers both.
        # Above the corner frequency only (1 - share) of La is left, so La starts higher by that factor.
        starts=tuple({"share": k, "corner_hz": f, Scale("La"): 1 / (1 - k)} for k in (0.06, 0.3, 0.65) for f in (4e3, 3e4, 2e5)),
        responds={"dc-bias": {"corner_hz": 1.25, "share": 0.85}, "second-temperature": {"corner_hz": 1.1}},
        seen_as=("inductance-diffusion",),
        needs_a="core",
    ),
    Effect(
        name="permeability-relaxation",
        group="winding",
        kin="winding-loss",
        title="magnetic relaxation of the core",
        formula="s * La * (1 - share + share / (1 + x**exponent + (quality * x)**2)), x = s / (2 * pi * corner_hz)",
        parameters=(
            Parameter(
                "share",
                "",
                0.01,
                0.9999,
                "share of La that relaxes; nearly all of a closed ferrite core's, and the field inside the wires (skin effect) is a few per cent",
                # A round wire's own field is 50 nH per metre of it, and a coil has at least 0.6 uH per metre.
                usual=(0.08, 0.9999),
            ),
            Parameter(
                "corner_hz",
                "Hz",
                5e4,
                1e9,
                "MnZn ferrites 1 - 5 MHz, NiZn 5 - 300 MHz, powder and bonded material to 1 GHz",
            ),
            Parameter(
                "exponent",
                "",
                0.5,
                1.0,
                "1 is one time constant (Debye), less is many (Cole-Cole); 0.55 - 1 in cores, 0.5 of laminations",
                special=1.0,
                usual=(0.5, 1.0),
            ),
            Parameter(
                "quality",
                "",
                0.01,
                10.0,
                "of a damped resonance (Lorentz) at corner_hz / quality; 0.01 is none, cores have up to 1 (docs/cores.md)",
                special=0.01,
                # Twice the largest of docs/cores.md; the N87 material of docs/materials.md has 6, which leaves the other half of the prior.
                usual=(0.01, 2.0),
            ),
        ),
        limit="share -> 0",
        limit_values={"share": 0.0, "corner_hz": 1e6, "exponent": 1.0, "quality": 0.01},
        signature="one step of L round the corner frequency, R as f^2 below it and flat above",
        look_alikes=("core-loss", "field-coupling", "eddy-laminations"),
        deciding="DC bias (moves permeability, not a shorted turn), rotor in and out",
        source=(
            "Cole and Cole, J. Chem. Phys. 9 (1941) 341, for permeability; damped resonance: Nakamura, J. Appl. Phys. 88 (2000) 348; corners: "
            "Magnetochemistry 8 (2022) 60, doi 10.3390/magnetochemistry8060060, and the cores of docs/cores.md"
        ),
        change=scale("La", materials.permeability_factor),
        starts=(
            *({"share": 0.03, "corner_hz": f, **rational_starts.ONE_TIME_CONSTANT} for f in (3e5, 1e6, 4e6, 12e6)),
            *({"share": 0.3, "corner_hz": f, **rational_starts.ONE_TIME_CONSTANT} for f in (1e6, 8e6, 6e7)),
        ),
        reader=rational_starts.relaxing_core,
        repeatable=True,
        responds={"dc-bias": {"share": 0.8, "corner_hz": 1.25}, "second-temperature": {"corner_hz": 0.94}},
        seen_as=("inductance-relaxation",),
        needs_a="core",
    ),
    Effect(
        name="core-loss",
        group="winding",
        kin="winding-loss",
        title="core loss as a resistance across La",
        formula="s * La * resistance_ohm / (s * La + resistance_ohm)",
        parameters=(
            Parameter("resistance_ohm", "Ohm", 30.0, 100e3, "0.5 - 20 kOhm in motors of 0.1 - 10 kW, a decade beyond", usual=(500.0, 20e3)),
        ),
        limit="resistance_ohm -> infinity",
        limit_values={"resistance_ohm": 1e15},
        signature="flattens the resonance of La and Ca, R grows as f^2 below it, |Z| far from it unchanged",
        look_alikes=("dielectric-loss@Ca", "permeability-relaxation", "proximity-effect"),
        deciding="shape of R below the resonance over a decade (f^2 here, f^3 for tan delta, f^0.5 for laminations)",
        source="Mirafzal, Skibinski, Tallam, IEEE Trans. Ind. Appl. 43 (2007) 1233",
        change=_core_loss,
        starts=({"resistance_ohm": 5e2}, {"resistance_ohm": 3e3}, {"resistance_ohm": 3e4}),
        responds={"dc-bias": {"resistance_ohm": 0.95}, "second-temperature": {"resistance_ohm": 1.05}},
        seen_as=("inductance-shunted",),
        needs_a="core",
    ),
    Effect(
        name="second-resonance",
        group="winding",
        kin="winding-resonance",
        title="a second resonant cell (first turns, end winding)",
        formula=(
            "(s * inductance_h + series_share * (w * inductance_h)**2 / resistance_ohm) / (1 + s * inductance_h / resistance_ohm + s**2 / w**2), "
            "w = 2 * pi * resonance_hz"
        ),
        parameters=(
            Parameter("inductance_h", "H", 1e-9, 1e-4, "0.001 to 0.1 of La, with room for large windings"),
            Parameter("resonance_hz", "Hz", 2e5, 60e6, "3 - 25 MHz seen in motors, wider for large and small ones"),
            Parameter(
                "resistance_ohm", "Ohm", 0.05, 50e3, "0.05 - 2 kOhm in motors, from a heavily damped turn to a light cell", usual=(1.0, 50e3)
            ),
            Parameter(
                "series_share",
                "",
                0.0,
                1.0,
                "of the damping: 0 is a resistance across the cell (core), 1 one in series with its L (copper)",
                "linear",
                special=0.0,
            ),
        ),
        limit="inductance_h -> 0",
        limit_values={"inductance_h": 1e-18, "resonance_hz": 1e7, "resistance_ohm": 1e3, "series_share": 0.0},
        signature="a local bump with a dip of phase at one frequency, in both sweeps",
        look_alikes=("field-coupling", "distributed-winding"),
        deciding="touch or tape an end turn: the bump moves; several regular bumps mean a distributed winding",
        source="Mirafzal, Skibinski, Tallam, IEEE Trans. Ind. Appl. 43 (2007) 1233 (first turns)",
        change=_second_resonance,
        # Weak cells on a fine grid (its step is narrower than the resonance), strong ones on a coarse grid.
        starts=(
            *({"inductance_h": 2e-8, "resonance_hz": f, "resistance_ohm": 1e-6 * f, "series_share": 0.0} for f in np.geomspace(4e5, 29e6, 30)),
            *({"inductance_h": 3e-7, "resonance_hz": f, "resistance_ohm": 200.0, "series_share": 0.0} for f in (3e6, 6e6, 11e6, 18e6)),
        ),
        repeatable=True,
        reader=rational_starts.second_cell,
        less_than={"inductance_h": "La"},
        exchange=_cell_as_winding,
        damping_ratio=lambda own: np.pi * own["resonance_hz"] * own["inductance_h"] / own["resistance_ohm"],
        responds={"end-turn-touched": {"resonance_hz": 0.97}, "second-temperature": {"resistance_ohm": 1.06}},
        seen_as=("inductance-resonance", "cell"),
    ),
    Effect(
        name="distributed-winding",
        group="winding",
        kin="winding-resonance",
        title="capacitance to the frame spread along the winding",
        formula=(
            "1 / (1 / (Zc * tanh(theta)) + s * end_share * Ca), theta = sqrt(Za * share * s * Cf), Zc = sqrt(Za / (share * s * Cf)), "
            "Za = (Ra + s * La) / (1 + s * (1 - end_share) * Ca * (Ra + s * La))"
        ),
        parameters=(
            Parameter("share", "", 0.002, 0.95, "share of Cf that is not at the far end"),
            END_SHARE,
        ),
        limit="share -> 0",
        limit_values={"share": 1e-12, "end_share": NO_END_SHARE},
        signature="the short-circuit sweep turns capacitive and resonant below La-Ca; several regular bumps",
        look_alikes=("second-resonance", "terminal-capacitance"),
        deciding="swap the terminals; ground the far end as a third termination",
        source="uniform line (textbook); on motors: Mirafzal, Skibinski, Tallam, IEEE Trans. Ind. Appl. 45 (2009) 142",
        excludes=("machine-winding",),
        change=_distributed,
        # Without the effect, the fit counted the distributed capacitance as a part of Ca.
        starts=tuple(
            {"share": k, "end_share": NO_END_SHARE, Scale("Ca"): c}
            for k, c in ((0.01, 1.0), (0.03, 0.9), (0.06, 0.8), (0.1, 0.7), (0.15, 0.6), (0.22, 0.5), (0.3, 0.3))
        ),
        reader=rational_starts.distributed_winding,
    ),
    Effect(
        name="field-coupling",
        group="winding",
        kin="winding-resonance",
        title="coupling to the field winding or a damper",
        formula=(
            "s * La * (1 - coupling**2 * s * (s + g) / ((s + a) * (s + g) + w**2)), a = w / quality - g, g = across_share * w / quality, "
            "w = 2 * pi * resonance_hz"
        ),
        parameters=(
            Parameter("coupling", "", 0.003, 0.999, "0 - 0.3 with crossed axes, 0.9 for series windings, more on one core", usual=(0.02, 0.5)),
            Parameter("resonance_hz", "Hz", 1e4, 60e6, "self-resonance of the other winding"),
            # An open field winding of 26 mH has a quality of 58 (independent generator).
            Parameter("quality", "", 0.05, 200.0, "a shorted damper to a free winding, which rings", usual=(1.0, 100.0)),
            Parameter(
                "across_share",
                "",
                0.0,
                1.0,
                "of the damping: 0 is in the other winding's copper, 1 a resistance across it (its core and insulation)",
                "linear",
                special=0.0,
            ),
        ),
        limit="coupling -> 0",
        limit_values={"coupling": 0.0, "resonance_hz": 1e6, "quality": 5.0, "across_share": 0.0},
        signature="a narrow pair of bump and dip at the other winding's resonance, in both sweeps",
        look_alikes=("permeability-relaxation", "second-resonance"),
        deciding="open and short the field winding",
        source="coupled coils (textbook); no measured motor is cited",
        change=scale("La", laws.lossy_coupled_winding_factor),
        starts=(
            *({"coupling": 0.04, "resonance_hz": f, "quality": 10.0, "across_share": 0.0} for f in np.geomspace(2e5, 25e6, 24)),
            *({"coupling": 0.2, "resonance_hz": f, "quality": q, "across_share": 0.0} for f in (1e5, 5e5, 2e6, 6e6, 15e6) for q in (0.5, 10.0)),
        ),
        reader=rational_starts.coupled_winding,
        damping_ratio=lambda own: 0.5 / own["quality"],
        responds={
            "field-winding": {"coupling": 0.1},
            "shaft-turned": {"coupling": 1.05},
            "end-turn-touched": {"resonance_hz": 0.98},
            "second-temperature": {"quality": 0.92},
        },
        seen_as=("inductance-resonance",),
    ),
    Effect(
        name="brush-contact",
        group="winding",
        kin="contact",
        title="brush and commutator contact with its film",
        formula="Ra + resistance_ohm / (1 + s * resistance_ohm * capacitance_f)",
        parameters=(
            Parameter("resistance_ohm", "Ohm", 5e-3, 100.0, "5 - 500 mOhm at rated current, tens of ohms at an analyser's level (estimate)"),
            Parameter("capacitance_f", "F", 0.1e-9, 1e-6, "film of copper oxide (estimate)"),
        ),
        limit="resistance_ohm -> 0",
        limit_values={"resistance_ohm": 1e-12, "capacitance_f": 1e-9},
        signature="R falls from a low-frequency value: nearly invisible beside Ra",
        look_alikes=("contact-resistance",),
        deciding="turn the rotor, DC bias of 0 - 1 A, measure on the bars",
        source="Holm, Electric Contacts (1967), for films; the capacitance is an estimate without a source",
        change=_film("Ra"),
        starts=tuple({"resistance_ohm": r, "capacitance_f": c} for r in (1.0, 20.0) for c in (2e-9, 3e-8)),
        responds={
            "shaft-turned": {"resistance_ohm": 1.5, "capacitance_f": 0.7},
            "dc-bias": {"resistance_ohm": 0.3},
            "brushes-lifted": {"resistance_ohm": 0.0},
            "second-temperature": {"resistance_ohm": 0.9},
        },
        seen_as=("film",),
    ),
    Effect(
        name="bearing-film",
        group="rotor",
        title="oil film of the bearings",
        formula="Rr + resistance_ohm / (1 + s * resistance_ohm * capacitance_f)",
        parameters=(
            Parameter("resistance_ohm", "Ohm", 0.1, 1e6, "metal contact to an intact film"),
            Parameter("capacitance_f", "F", 20e-12, 5e-9, "20 - 500 pF a bearing (textbook), standing races more", usual=(20e-12, 1e-9)),
        ),
        limit="resistance_ohm -> 0",
        limit_values={"resistance_ohm": 1e-12, "capacitance_f": 1e-10},
        signature="none at standstill; while turning Cr shrinks and the sweep scatters",
        look_alikes=("insulation-leakage@Cr", "dielectric-relaxation@Cr"),
        deciding="at rest against turning slowly, shaft grounded by a brush, level of the drive",
        source="Busse et al., IEEE Ind. Appl. Mag. 3 (1997) no. 6, 21",
        change=_film("Rr"),
        starts=tuple({"resistance_ohm": r, "capacitance_f": c} for r in (5.0, 300.0, 5e3) for c in (1e-10, 1e-9)),
        reader=rational_starts.film,
        responds={
            "shaft-turned": {"resistance_ohm": 5.0, "capacitance_f": 0.6},
            "second-temperature": {"resistance_ohm": 0.5},
            "rotor-out": {"resistance_ohm": 0.0},
        },
        seen_as=("film",),
    ),
)
