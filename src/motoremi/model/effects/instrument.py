"""Errors of analyser and fixture beyond their specification; errors within the specification are in `data.analyser`."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

from motoremi.model import laws
from motoremi.model.circuit import Leaf, Scaled, Series, Shunted, ThroughCable
from motoremi.model.effects.effect import Change, Effect
from motoremi.model.effects.start import Subtract
from motoremi.model.laws import Law
from motoremi.model.motor import BOTH, Motor, OpenSweepFactor, Outwards, Terminations
from motoremi.model.parameter import Parameter

# Less than any contact: taken for none.
NO_CONTACT_OHM = 1e-3


def _wrapped(kind: type[Scaled] | type[Shunted] | type[ThroughCable], law: Law) -> Change:
    def change(motor: Motor, place: str, parameters: Mapping[str, Parameter]) -> Motor:
        return motor.attached(lambda node: kind(node, law, tuple(parameters.values())), place=Outwards.ANALYSER)

    return change


def _series(motor: Motor, law: Law, parameters: Mapping[str, Parameter], terminations: Terminations) -> Motor:
    part = Leaf("residual", law, tuple(parameters.values()))
    return motor.attached(lambda node: Series((node, part)), terminations, Outwards.ANALYSER)


def _short_residual(motor: Motor, place: str, parameters: Mapping[str, Parameter]) -> Motor:
    return _series(motor, laws.resistance_and_inductance, parameters, BOTH)


def _contact(motor: Motor, place: str, parameters: Mapping[str, Parameter]) -> Motor:
    in_open = _series(motor, laws.resistor, {"open_ohm": parameters["open_ohm"]}, ("open",))
    return _series(in_open, laws.resistor, {"short_ohm": parameters["short_ohm"]}, ("short",))


def _drift(motor: Motor, place: str, parameters: Mapping[str, Parameter]) -> Motor:
    insulation = OpenSweepFactor("Ca", laws.drift_factor, (parameters["capacitance_change"],))
    copper = OpenSweepFactor("Ra", laws.rise_factor, (parameters["resistance_change"],))
    return dataclasses.replace(motor, open_factors=(*motor.open_factors, insulation, copper))


EFFECTS = (
    Effect(
        name="open-residual",
        group="instrument",
        title="open-circuit residual of the fixture beyond its specification",
        formula="Z / (1 + (conductance_s + s * capacitance_f) * Z)",
        parameters=(
            Parameter("conductance_s", "S", -1e-5, 1e-4, "leaky or dirty fixture", scale="linear", sigma=1e-7),
            Parameter(
                "capacitance_f",
                "F",
                -2.5e-12,
                2.5e-12,
                "0.1 pF is the class of a good fixture; ten times that is a fault",
                "linear",
                0.7e-12,
            ),
        ),
        limit="conductance_s, capacitance_f -> 0",
        limit_values={"conductance_s": 0.0, "capacitance_f": 0.0},
        signature="worst at the parallel resonance, where |Z| is high",
        look_alikes=("terminal-capacitance", "temperature-drift", "cable-delay"),
        deciding="repeat the open compensation and measure the open fixture",
        source="residual admittance of fixtures: Keysight, Impedance Measurement Handbook; the range is an estimate",
        change=_wrapped(Shunted, laws.conductance_and_capacitance),
        starts=({"conductance_s": 0.0, "capacitance_f": 0.0},),
        responds={"repeat-compensation": {"conductance_s": 0.0, "capacitance_f": 0.0}},
    ),
    Effect(
        name="short-residual",
        group="instrument",
        title="short-circuit residual of the fixture beyond its specification",
        formula="Z + resistance_ohm + s * inductance_h",
        parameters=(
            Parameter("resistance_ohm", "Ohm", -0.2, 0.2, "10 mOhm is the specified repeatability", scale="linear", sigma=0.03),
            Parameter("inductance_h", "H", -50e-9, 50e-9, "3 nH is the class of a good fixture", scale="linear", sigma=15e-9),
        ),
        limit="resistance_ohm, inductance_h -> 0",
        limit_values={"resistance_ohm": 0.0, "inductance_h": 0.0},
        signature="worst at the series resonance, where |Z| is low",
        look_alikes=("lead-inductance",),
        deciding="repeat the short compensation and measure a short bar",
        source="residual impedance of fixtures: Keysight, Impedance Measurement Handbook; the range is an estimate",
        change=_short_residual,
        starts=({"resistance_ohm": 0.0, "inductance_h": 0.0},),
        responds={"repeat-compensation": {"resistance_ohm": 0.0, "inductance_h": 0.0}},
    ),
    Effect(
        name="gain-error",
        group="instrument",
        title="load error of analyser or fixture beyond its specification",
        formula="Z * (1 + error * (f / 30e6)**2)",
        parameters=(Parameter("error", "", -0.3, 0.3, "4.5 % at 30 MHz is a fixture's specification", scale="linear", sigma=0.08),),
        limit="error -> 0",
        limit_values={"error": 0.0},
        signature="smooth, the same in both sweeps whatever |Z|",
        look_alikes=("lead-inductance",),
        deciding="50 Ohm and 100 pF standards on the fixture",
        source="Keysight, Impedance Measurement Handbook: 0.5 % (f / 10 MHz)^2 for a four-terminal-pair fixture",
        change=_wrapped(Scaled, laws.square_law_gain),
        starts=({"error": 0.0},),
        responds={"repeat-compensation": {"error": 0.0}},
    ),
    Effect(
        name="cable-delay",
        group="instrument",
        title="length of cable that was not compensated",
        formula="50 * (Z + 50 * tanh(s * delay_s)) / (50 + Z * tanh(s * delay_s))",
        parameters=(Parameter("delay_s", "s", -2e-9, 2e-9, "0.01 - 0.5 ns, 2 ns is 40 cm of cable", scale="linear", sigma=0.4e-9),),
        limit="delay_s -> 0",
        limit_values={"delay_s": 0.0},
        signature="phase error as f whose sign turns where |Z| passes 50 Ohm",
        look_alikes=("lead-inductance", "terminal-capacitance", "open-residual"),
        deciding="open and short standards at the motor's end of the cable",
        source="lossless line (textbook); the range is an estimate",
        change=_wrapped(ThroughCable, laws.line_tangent),
        starts=({"delay_s": 1e-10, Subtract("Ca"): 2e-12},),
        responds={"repeat-compensation": {"delay_s": 0.0}},
    ),
    Effect(
        name="contact-resistance",
        group="instrument",
        title="contact resistance in one of the two sweeps, or in both",
        formula="Z + open_ohm in the open-circuit sweep, Z + short_ohm in the short-circuit sweep",
        parameters=tuple(
            Parameter(name, "Ohm", NO_CONTACT_OHM, 30.0, "5 - 100 mOhm if clean, Ohms if dirty; 1 mOhm is none", special=NO_CONTACT_OHM)
            for name in ("open_ohm", "short_ohm")
        ),
        limit="open_ohm, short_ohm -> 0",
        limit_values={"open_ohm": 0.0, "short_ohm": 0.0},
        signature="an offset of R, seen where |Z| is low",
        look_alikes=("brush-contact", "lead-inductance", "short-residual"),
        deciding="clean the contacts and repeat both sweeps",
        source="resistance of a contact in series; the values are estimates without a source",
        change=_contact,
        starts=(
            {"open_ohm": 0.3, "short_ohm": NO_CONTACT_OHM},
            {"open_ohm": NO_CONTACT_OHM, "short_ohm": 0.3},
            {"open_ohm": 1.0, "short_ohm": 1.0},
        ),
        responds={"contacts-cleaned": {"open_ohm": 0.0, "short_ohm": 0.0}},
    ),
    Effect(
        name="range-step",
        group="instrument",
        title="step of gain where the analyser switches ranges",
        formula="Z * exp(real_step + 1j * imaginary_step) from frequency_hz upwards",
        parameters=(
            Parameter("real_step", "", -0.2, 0.2, "0.05 - 1.5 % specified; 3 % seen in real data", scale="linear", sigma=0.02),
            Parameter("imaginary_step", "", -0.2, 0.2, "as the real step", scale="linear", sigma=0.02),
            Parameter("frequency_hz", "Hz", 40.0, 110e6, "found by a scan over the points", vary=False),
        ),
        limit="real_step, imaginary_step -> 0",
        limit_values={"real_step": 0.0, "imaginary_step": 0.0, "frequency_hz": 1e6},
        signature="a jump between two neighbouring points, in all that follows",
        look_alikes=("dielectric-relaxation",),
        deciding="sweep downwards, or at another level: the step moves",
        source="steps in the specification of the 4294A at 1 and 15 MHz; seen in a measured motor file at 1.42 kHz and 5.22 MHz",
        change=_wrapped(Scaled, laws.gain_step),
        starts=({"real_step": 0.0, "imaginary_step": 0.0, "frequency_hz": 5e6},),
        repeatable=True,
        responds={"sweep-downwards": {"real_step": 0.0, "imaginary_step": 0.0}},
        of_ranges=True,
    ),
    Effect(
        name="temperature-drift",
        group="instrument",
        title="the motor's capacitance and resistance drift between the two sweeps",
        formula="Ca * (1 + capacitance_change) and Ra * (1 + resistance_change) in the open-circuit sweep",
        parameters=(
            Parameter("capacitance_change", "", -0.1, 0.1, "0.05 - 0.5 %/K over a warm-up", scale="linear", sigma=0.02),
            Parameter("resistance_change", "", -0.2, 0.2, "copper 0.4 %/K; a hot motor that cools down", scale="linear", sigma=0.02),
        ),
        limit="capacitance_change -> 0",
        limit_values={"capacitance_change": 0.0, "resistance_change": 0.0},
        signature="each sweep fits alone but not both together; residuals of opposite sign at the resonance",
        look_alikes=("terminal-capacitance", "open-residual"),
        deciding="repeat the first sweep after the last one; log the temperature",
        source="copper: 0.393 %/K at 20 °C (IEC 60028); the change of a capacitance with temperature is an estimate without a source",
        change=_drift,
        starts=({"capacitance_change": 0.0, "resistance_change": 0.0},),
        responds={"repeat-first-sweep": {"capacitance_change": 0.0, "resistance_change": 0.0}},
    ),
)
