"""Start values of a motor's cable: the line of a scan that, taken away, leaves the impedance of a winding."""

from __future__ import annotations

from typing import Any

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.model.effects.seen import LEAST_OHM, Seen, winding_of
from motoremi.model.effects.start import Set
from motoremi.model.path_to_frame import frames
from motoremi.model.rational import Rational, rational_fit

# Minor parameters: a metre of thin wire in a good insulation.
REST = {"skin_ohm": 0.1, "tan_delta": 0.01}
# The scan: wave impedances and delays; points of the short-circuit and of the open-circuit sweep; number of lines that are tried.
WAVES_OHM, DELAYS_S = (50.0, 75.0, 110.0, 170.0), np.geomspace(2.5e-9, 8e-8, 16)
POINTS, FRAME_POINTS, TRIED = 60, 80, 3
# Between two delays of the scan the phase at the highest frequency changes by at most this much, in radians: the line that is taken away must
# have the right number of resonances. The shortest is a quarter wave there, and of the longest so many points lie between two resonances.
PHASE_STEP, QUARTER, POINTS_EACH = 1.0, 0.25, 2.5
# What is behind a line whose far end is shorted or open, relative to the line's own inductance and capacitance, and the impedance of an open end.
NEXT_TO_NOTHING, OPEN_OHM = 1e-3, 1e9
# Damping of the lines of the scan, relative to s: a line without any has an infinite impedance at its resonances.
DAMPING = 0.005


def winding_behind_cable(seen: Seen) -> list[dict[Any, float]]:
    """Line, winding and frame: for each line of the scan, a rational fit of what it leaves of the short-circuit sweep."""
    if seen.frequency_hz is None or seen.short_ohm is None:
        return _open_cable(seen)
    step = max(1, seen.frequency_hz.size // POINTS)
    frequency, measured = seen.frequency_hz[::step], seen.short_ohm[::step]
    found = []
    for wave in WAVES_OHM:
        for delay in _delays(frequency):
            alone = _through(frequency, measured, wave, -delay)
            winding = rational_fit(frequency, alone, 1 / np.abs(alone), (1, 2))
            error = np.log(_through(frequency, _value(winding, frequency), wave, delay) / measured)
            found.append((float(np.sum(np.abs(error) ** 2)), wave, float(delay), winding))
    starts = []
    best = sorted((one for one in found if np.isfinite(one[0])), key=lambda one: one[0])[:TRIED]
    for _, wave, delay, winding in best:
        elements = winding_of(winding.numerator[0], winding.numerator[1], winding.denominator[2], winding.middle)
        # Behind a cable whose far end is shorted there is nothing that can be read.
        nothing = {"Ra": LEAST_OHM, "La": NEXT_TO_NOTHING * wave * delay, "Ca": NEXT_TO_NOTHING * delay / wave}
        elements = {name: value if value > 0 else nothing[name] for name, value in elements.items()}
        start = {**{Set(name): value for name, value in elements.items()}, "wave_ohm": wave, "delay_s": delay, **REST}
        starts += [{**start, **frame} for frame in _frames(seen, winding, wave, delay)]
    return starts


def _open_cable(seen: Seen) -> list[dict[Any, float]]:
    """From the open-circuit sweep alone: a cable with hardly anything at its far end, as one measures it without the motor."""
    if seen.across is None:
        return []
    step = max(1, seen.across.frequency_hz.size // POINTS)
    frequency, measured = seen.across.frequency_hz[::step], seen.across.measured_ohm[::step]
    nothing = np.full(frequency.size, OPEN_OHM, dtype=np.complex128)
    found = [
        (float(np.sum(np.abs(np.log(_through(frequency, nothing, wave, delay) / measured)) ** 2)), wave, delay)
        for wave in WAVES_OHM
        for delay in _delays(frequency)
    ]
    starts = []
    for _, wave, delay in sorted(found)[:TRIED]:
        henry, farad = NEXT_TO_NOTHING * wave * delay, NEXT_TO_NOTHING * delay / wave
        elements = {"Ra": LEAST_OHM, "La": henry, "Ca": farad, "Rr": 1.0, "Lr": henry, "Cr": farad, "Cf": farad}
        start: dict[Any, float] = {Set(name): value for name, value in elements.items()}
        starts.append({**start, "wave_ohm": wave, "delay_s": delay, **REST})
    return starts


def _delays(frequency_hz: FloatArray) -> list[float]:
    """The delays of the scan, close enough for lines of many resonances and for the shortest that resonate."""
    coarse, highest = DELAYS_S.tolist(), float(frequency_hz[-1])
    longest = min(coarse[-1], 1 / (2 * POINTS_EACH * float(np.max(np.diff(frequency_hz)))))
    fine = np.arange(min(coarse[0], QUARTER / highest), longest, PHASE_STEP / (2 * np.pi * highest))
    return sorted({*coarse, *fine.tolist()}) if fine.size > len(coarse) else coarse


def _frames(seen: Seen, winding: Rational, wave: float, delay: float) -> list[dict[Any, float]]:
    """The path to the frame from the open-circuit sweep without line and winding."""
    if seen.frame_hz is None or seen.open_ohm is None:
        return [{}]
    step = max(1, seen.frame_hz.size // FRAME_POINTS)
    frequency = seen.frame_hz[::step]
    alone, through = _through(frequency, seen.open_ohm[::step], wave, -delay), _value(winding, frequency)
    found = frames(frequency, alone - through, np.hypot(np.abs(alone), np.abs(through)))
    return [{Set(name): value for name, value in one.items()} for one in found[:1]]


def _through(frequency_hz: FloatArray, impedance: ComplexArray, wave: float, delay: float) -> ComplexArray:
    """The impedance at the near end of a line; a negative delay takes the line away."""
    tangent = np.tanh((DAMPING + 1j) * 2 * np.pi * frequency_hz * delay)
    return np.asarray(wave * (impedance + wave * tangent) / (wave + impedance * tangent), dtype=np.complex128)


def _value(rational: Rational, frequency_hz: FloatArray) -> ComplexArray:
    p = 2j * np.pi * frequency_hz / rational.middle
    return np.asarray(np.polyval(rational.numerator[::-1], p) / np.polyval(rational.denominator[::-1], p), dtype=np.complex128)
