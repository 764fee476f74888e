"""Whether the values of a sweep can be the impedance of a passive part: phase against the slope of |Z|, and the size of |Z|.

The impedance of a passive part is a minimum-phase function, so that the phase follows from the slope of ln|Z| over ln f (H. W. Bode, Network
Analysis and Feedback Amplifier Design, 1945, chapter 14): about 90 degrees for each unit of slope, with the same sign.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.quantities import show, show_band

WrongPhase: TypeAlias = Literal["wrong sign", "radians", "no phase", "no sign", "decibels", "exchanged"]
# Slopes are cut off at those of an L and a C: in a sharp resonance they are much larger, while the phase is not.
STEEPEST = 1.0
# Rms slope below which a sweep shows too little of a phase (a resistor).
LEAST_SLOPE = 0.3
# Correlation of phase and slope: 0.67 to 1 in 90 sweeps of real parts (windings, cores, coils, cables, loudspeakers), -1 with the wrong sign.
ALIKE = 0.5
# Phase for each unit of slope, relative to 90 degrees: 0.2 to 1 in the same sweeps, 1/57 for radians that are called degrees.
LEAST_PHASE = 0.05
# Where |Z| changes, its phase in radians is about as large as the changes of ln|Z| (of a coil over two decades 1.57 and 1.53 rms), and noise makes
# both alike: a phase below `LEAST_PHASE` of them was not measured. |Z| that changes by less than this, rms of ln|Z|, may be that of a resistor.
LEAST_CHANGE = 0.3
# Where the slope that Bode's weights average is below the first number over at least the second share of the span, a passive part is capacitive: a
# reactance that is positive at all points, with a phase of more than this part of 90 degrees over most of it, has lost its sign. Of 2348 random
# passive parts whose reactance is nowhere negative none is taken for such a one; of 2748 others, saved without the sign, 2245 are. Slopes are those
# of means of neighbours in so many groups: between the points of a dense sweep noise would be a slope.
FALLING, OF_SPAN, CLEARLY, GROUPS = -0.3, 0.1, 0.3, 80
# Re Z below this part of |Z| is no error of calibration, which turns a phase by a few degrees; a sweep says so if more than the second share of
# its points has one, or if all are below 0.
LEAST_RESISTANCE, OF_POINTS = -0.1, 0.01
# The phase averages the slope, so that it is no larger: at most 1.0003 for each unit of slope in 115 simulated sweeps of motors, more than the
# first number in 109 of them if |Z| is in decibels. |Z| is taken to be that if it would be possible as such too (at most so many decibels, and
# figures such as those of real parts): none of 49000 random passive parts with a slope of at least the last number is taken for such a one.
MOST_PHASE, MOST_DECIBELS, REAL_PHASE, REALLY_ALIKE, LEAST_OF_DECIBELS = 1.15, 140.0, (0.7, 1.05), 0.7, 0.1
# Exchanged R and X have such figures after another exchange, and more than a few points at which the phase is then less than this: a coil whose
# phase is in radians, or is missing, has almost the same slope and phase.
RESISTIVE = np.deg2rad(75)
# |Z| of a sweep is doubtful if no point lies between these: 10 nH have 2 Ohm at 30 MHz, 1 pF has 1 MOhm at 150 kHz.
LEAST_OHM, MOST_OHM = 0.05, 50e6
# Frequencies are doubtful if none is above the first or any is above the second: megahertz in a column called hertz end at some tens of hertz, and
# kilohertz in one called megahertz, of a sweep to 30 MHz, end at 30 GHz. No analyser of a bench procedure reaches further than 3 GHz.
LEAST_HIGHEST_HZ, MOST_HZ = 1e3, 3e9


class PhaseAgainstSlope(NamedTuple):
    """How the phase of a sweep follows the slope of |Z|.

    Parameters
    ----------
    slope : float
        Rms of the slope, cut off at `STEEPEST`.
    correlation : float
        Of phase and slope, over ln f.
    share : float
        Phase for each unit of slope, relative to 90 degrees.
    change : float
        Rms of ln|Z| about its mean.
    phase : float
        Rms of the phase, in radians.
    """

    slope: float
    correlation: float
    share: float
    change: float
    phase: float


def phase_against_slope(frequency_hz: FloatArray, impedance_ohm: ComplexArray) -> PhaseAgainstSlope:
    """The figures of one sweep; shapes (n,), frequencies increasing, impedances not zero."""
    place, size = np.log(frequency_hz), np.log(np.abs(impedance_ohm))
    slope = np.clip(np.gradient(size, place), -STEEPEST, STEEPEST)
    phase = np.angle(impedance_ohm) / (np.pi / 2)
    weight = np.gradient(place) / np.gradient(place).sum()
    both, of_slope, of_phase = (float(weight @ product) for product in (slope * phase, slope**2, phase**2))
    change = float(np.sqrt(weight @ (size - weight @ size) ** 2))
    together = float(np.sqrt(of_slope) * np.sqrt(of_phase))
    correlation, share = (both / together, both / of_slope) if together > 0 else (0.0, 0.0)
    return PhaseAgainstSlope(float(np.sqrt(of_slope)), correlation, share, change, float(np.sqrt(of_phase) * np.pi / 2))


def wrong_phase(frequency_hz: FloatArray, impedance_ohm: ComplexArray) -> WrongPhase | None:
    """What is wrong with the phase of a sweep; None for a possible one, and where |Z| hardly changes."""
    follows = phase_against_slope(frequency_hz, impedance_ohm)
    found = _wrong_phase(frequency_hz, impedance_ohm, follows)
    doubtful = found or _often_negative(impedance_ohm) or follows.correlation < ALIKE
    return "exchanged" if doubtful and _exchanged(frequency_hz, impedance_ohm) else found


def _wrong_phase(frequency_hz: FloatArray, impedance_ohm: ComplexArray, found: PhaseAgainstSlope) -> WrongPhase | None:
    if found.slope >= LEAST_SLOPE and found.correlation > ALIKE and found.share < LEAST_PHASE:
        return "radians"
    if found.change >= LEAST_CHANGE and found.phase < LEAST_PHASE * found.change:
        return "no phase"
    if found.slope >= LEAST_SLOPE and found.correlation < -ALIKE:
        return "wrong sign"
    if found.slope >= LEAST_OF_DECIBELS and found.correlation > ALIKE and found.share > MOST_PHASE and _in_decibels(frequency_hz, impedance_ohm):
        return "decibels"
    return "no sign" if _without_sign(frequency_hz, impedance_ohm) else None


def _like_a_real_part(frequency_hz: FloatArray, impedance_ohm: ComplexArray) -> bool:
    found = phase_against_slope(frequency_hz, impedance_ohm)
    least, most = REAL_PHASE
    return found.slope >= LEAST_SLOPE and found.correlation > REALLY_ALIKE and least < found.share < most


def _in_decibels(frequency_hz: FloatArray, impedance_ohm: ComplexArray) -> bool:
    size = np.abs(impedance_ohm)
    if size.max() > MOST_DECIBELS:
        return False
    return _like_a_real_part(frequency_hz, np.asarray(10 ** (size / 20) * np.exp(1j * np.angle(impedance_ohm))))


def _exchanged(frequency_hz: FloatArray, impedance_ohm: ComplexArray) -> bool:
    """Whether R and X are those of a real part if they are exchanged."""
    other = impedance_ohm.imag + 1j * impedance_ohm.real
    resistive = np.mean(np.abs(np.angle(other)) < RESISTIVE)
    return bool(resistive > OF_POINTS and not _often_negative(other) and _like_a_real_part(frequency_hz, other))


def _often_negative(impedance_ohm: ComplexArray) -> bool:
    """Whether the resistance is far below 0 at more than a few points."""
    return bool(np.sum(impedance_ohm.real < LEAST_RESISTANCE * np.abs(impedance_ohm)) > OF_POINTS * impedance_ohm.size)


def _without_sign(frequency_hz: FloatArray, impedance_ohm: ComplexArray) -> bool:
    if impedance_ohm.size < 3 or np.any(impedance_ohm.imag < 0):
        return False
    groups = np.array_split(np.arange(impedance_ohm.size), min(impedance_ohm.size, GROUPS))
    place, size, phase = (
        np.array([values[group].mean() for group in groups])
        for values in (np.log(frequency_hz), np.log(np.abs(impedance_ohm)), np.angle(impedance_ohm))
    )
    width = np.gradient(place)
    # Bode's weights, ln coth |u / 2|, for the distance u in ln f; a point's own cell counts as a quarter of its width away.
    near = -np.log(np.tanh(np.maximum(np.abs(place[:, None] - place), width / 4) / 2)) * width
    falling = near @ np.gradient(size, place) / near.sum(axis=1) < FALLING
    inductive = falling & (phase > CLEARLY * np.pi / 2)
    return bool(width @ falling >= OF_SPAN * width.sum() and width @ inductive > 0.5 * (width @ falling))


SENTENCES: dict[WrongPhase, str] = {
    "wrong sign": "|Z| rises where the phase is negative and falls where it is positive, which no passive part does: the reactance or the phase "
    "has the wrong sign",
    "no sign": "the reactance is positive at all points, also where |Z| falls like that of a capacitor: it was saved without its sign; save X "
    "or the phase with its sign",
    "radians": "the phase is a small part of what the slope of |Z| requires of a passive part: is it in radians, and called degrees?",
    "decibels": "the phase is larger than the slope of |Z| allows, and agrees with it if |Z| is in decibels: is |Z| in dBOhm, and called Ohm?",
    "exchanged": "R and X are those of a passive part if they are exchanged, and of none as they are: is each column what its title says?",
    "no phase": "|Z| changes as that of no resistor, but its phase is (almost) zero: |Z| alone is not enough, measure R and X, or phase too",
}


def implausible(frequency_hz: FloatArray, impedance_ohm: ComplexArray) -> tuple[str, ...]:
    """Sentences on values that cannot be those of a motor; shapes (n,)."""
    size = np.abs(impedance_ohm)
    rising = frequency_hz.size > 2 and frequency_hz[0] > 0 and np.all(np.diff(frequency_hz) > 0)
    if not (rising and np.all(np.isfinite(frequency_hz)) and np.all(np.isfinite(size)) and np.all(size > 0)):
        return ()
    found = wrong_phase(frequency_hz, impedance_ohm)
    said = [] if found is None else [SENTENCES[found]]
    if size.max() < LEAST_OHM or size.min() > MOST_OHM:
        said.append(
            f"|Z| is {show(float(size.min()), 'Ohm')} - {show(float(size.max()), 'Ohm')} at all frequencies: is the unit of its columns right?"
        )
    span = f"the frequencies are {show_band(float(frequency_hz[0]), float(frequency_hz[-1]))}"
    if frequency_hz[-1] < LEAST_HIGHEST_HZ or frequency_hz[0] > MOST_HZ:
        said.append(f"{span}: is their unit right?")
    elif frequency_hz[-1] > MOST_HZ:
        said.append(f"{span}, and no motor is measured up to {show(float(frequency_hz[-1]), 'Hz')}: is their unit right?")
    return tuple(said)


def negative_resistance(impedance_ohm: ComplexArray, from_waves: bool = False) -> tuple[str, ...]:
    """A sentence if the resistance is below 0 at all points, or far below at more than a few; shape (n,).

    With `from_waves` it was computed from S parameters, whose columns cannot be exchanged: then only a calibration can be at fault.
    """
    size = np.abs(impedance_ohm)
    below = int(np.sum(impedance_ohm.real < 0))
    if below < size.size and not _often_negative(impedance_ohm):
        return ()
    said = f"the resistance is below 0 at {below} of {size.size} points, which no passive part has"
    if from_waves:
        return (f"{said}: the part loses less there than the calibration is uncertain by; calibrate again",)
    return (f"{said}: is the sign of a column right (R, phase, Q, D)?",)
