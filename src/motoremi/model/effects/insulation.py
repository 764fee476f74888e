"""Effects of the insulation, which a constant capacitance does not describe; each can be at Ca, Cr or Cf."""

from __future__ import annotations

from collections.abc import Mapping

from motoremi.model import laws, materials
from motoremi.model.circuit import Leaf, Parallel
from motoremi.model.effects import rational_starts
from motoremi.model.effects.effect import Effect
from motoremi.model.effects.winding import scale
from motoremi.model.motor import Motor
from motoremi.model.parameter import Parameter

PLACES = ("Ca", "Cr", "Cf")


def _leakage(motor: Motor, place: str, parameters: Mapping[str, Parameter]) -> Motor:
    leak = Leaf("leak", laws.resistor, tuple(parameters.values()))
    return motor.replaced(place, lambda whole: Parallel((whole, leak)))


EFFECTS = (
    Effect(
        name="dielectric-loss",
        group="insulation",
        title="dielectric loss with a constant loss angle",
        formula="C * (s / (2 * pi * 1e6))**(-2 * atan(tan_delta) / pi)",
        parameters=(Parameter("tan_delta", "", 5e-4, 1.0, "0.002 - 0.05 for slot liners and enamel, much more when damp", usual=(5e-4, 0.2)),),
        limit="tan_delta -> 0",
        limit_values={"tan_delta": 0.0},
        signature="phase of the capacitive part stays at -(90 - delta) deg; C falls slowly",
        look_alikes=("dielectric-relaxation", "insulation-leakage", "core-loss"),
        deciding="a sweep from 40 Hz (leakage falls as 1/f, a constant angle stays, a relaxation is a bell), temperature, drying",
        source="constant-phase element: Jonscher, Dielectric Relaxation in Solids (1983)",
        change=scale("", materials.constant_phase_factor),
        starts=({"tan_delta": 0.004}, {"tan_delta": 0.03}),
        places=PLACES,
        responds={"second-temperature": {"tan_delta": 1.4}, "dried": {"tan_delta": 0.5}},
        seen_as=("capacitance-angle",),
        needs_a="winding",
    ),
    Effect(
        name="dielectric-relaxation",
        group="insulation",
        title="relaxation of the insulation",
        formula="C * (1 + strength / (1 + (s / (2 * pi * corner_hz))**exponent))",
        parameters=(
            Parameter("strength", "", 0.005, 5.0, "0.02 - 0.5 for slot insulation, about 1 for PVC; damp layers above", usual=(0.02, 2.0)),
            Parameter("corner_hz", "Hz", 1e4, 60e6, "1 kHz - 10 MHz; below 10 kHz nothing shows in this band"),
            # Below a half a relaxation is as wide as the band, and hardly differs from a constant loss angle.
            Parameter(
                "exponent", "", 0.4, 1.0, "1 is Debye, less is Cole-Cole; one sweep hardly distinguishes them", special=1.0, usual=(0.5, 1.0)
            ),
        ),
        limit="strength -> 0",
        limit_values={"strength": 0.0, "corner_hz": 1e6, "exponent": 1.0},
        signature="C drops across the corner frequency, tan delta is a bell",
        look_alikes=("dielectric-loss", "insulation-leakage", "range-step"),
        deciding="a second temperature (the corner moves, the strength stays), a sweep from 40 Hz",
        source="Cole and Cole, J. Chem. Phys. 9 (1941) 341; PVC: von Hippel, Dielectric Materials and Applications (1954), tables",
        change=scale("", materials.relaxation_factor),
        starts=tuple({"strength": d, "corner_hz": f, "exponent": 0.95} for d in (0.02, 0.15) for f in (2e5, 1e6, 4e6, 1.2e7)),
        reader=rational_starts.relaxing_rotor,
        places=PLACES,
        repeatable=True,
        responds={"second-temperature": {"corner_hz": 3.0}, "dried": {"strength": 0.85, "corner_hz": 0.7}},
        seen_as=("capacitance-relaxation",),
        imitated={
            "Ca": "a winding with a tap or with unlike sections",
            "Cf": "a layer whose resistance is distributed (a semiconducting or damp coat)",
        },
        needs_a="lossy insulation",
    ),
    Effect(
        name="insulation-leakage",
        group="insulation",
        title="leakage through damp or dirty insulation",
        formula="1 / (s * C + 1 / resistance_ohm)",
        parameters=(
            Parameter(
                "resistance_ohm",
                "Ohm",
                100.0,
                1e7,
                "above 1 MOhm invisible in this band; below 20 kOhm rare, below 100 Ohm a fault",
                usual=(2e4, 1e7),
            ),
        ),
        limit="resistance_ohm -> infinity",
        limit_values={"resistance_ohm": 1e18},
        signature="tan delta falls as 1/f",
        look_alikes=("dielectric-loss", "bearing-film", "core-loss"),
        deciding="insulation resistance at DC, a sweep from 40 Hz, drying at 60 - 80 °C",
        source="IEEE Std 43 (insulation resistance of rotating machinery)",
        change=_leakage,
        starts=({"resistance_ohm": 2e5}, {"resistance_ohm": 2e4}, {"resistance_ohm": 1e3}),
        reader=rational_starts.leak,
        places=PLACES,
        responds={"second-temperature": {"resistance_ohm": 0.15}, "dried": {"resistance_ohm": 10.0}},
        seen_as=("capacitance-leakage",),
        needs_a="lossy insulation",
    ),
)
