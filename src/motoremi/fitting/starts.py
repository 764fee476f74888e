"""Start values from the data.

The short-circuit sweep is b0 + b1 s over 1 + a1 s + a2 s^2, a rational fit. The frame's share of the open-circuit sweep is weaker than
its noise over much of the band, where that way is biased; but with its resonance and damping given it is linear in 1/(Cr + Cf) and
1/Cf, so those two are scanned and the rest solved for.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.measurement import Measurement
from motoremi.fitting.observed import informative_points
from motoremi.model.effects.seen import Seen, winding_of
from motoremi.model.path_to_frame import frames

FRAME_POINTS = 80
# Frames are tried at so many places of the last one and a half decades of the band: neighbours are a factor of 1.6 apart.
_PLACES, _DECADE_AND_HALF = 8, 30.0
# Resonances of a winding that the short-circuit sweep does not show are tried at frequencies this factor apart, as far as a polish reaches.
STEP = 1.07


@lru_cache(maxsize=8)
def data_driven_starts(measurement: Measurement) -> tuple[Mapping[str, float], ...]:
    """Sets of plausible start values in SI units, the most probable first; possibly none."""
    winding = _winding(measurement)
    if not winding:
        return ()
    both = seen(measurement)
    if both.frame is None or both.open_ohm is None:
        return (winding,)
    chosen = informative_points(both.frame.frequency_hz, both.open_ohm, FRAME_POINTS)
    return tuple({**winding, **elements} for elements in frames(*both.frame.at(chosen)))


def open_and_winding(measurement: Measurement) -> tuple[FloatArray, ComplexArray, ComplexArray] | None:
    """Frequency in Hz, and in ohms the open-circuit sweep and the winding's share of it; None where it is not known."""
    sweeps = {sweep.termination: sweep for sweep in measurement.sweeps}
    winding = _winding(measurement)
    if not winding or "open" not in sweeps:
        return None
    at = sweeps["open"].frequency_hz
    return at, sweeps["open"].mean_ohm, sweeps["short"].mean_ohm if measurement.on_the_same_frequencies else _winding_ohm(at, winding)


def _winding_ohm(frequency_hz: FloatArray, winding: Mapping[str, float]) -> ComplexArray:
    s = 2j * np.pi * frequency_hz
    branch = winding["Ra"] + s * winding["La"]
    return branch / (1 + s * winding["Ca"] * branch)


def starts_without_ca(measurement: Measurement) -> list[dict[str, float]]:
    """Start values for an open-circuit sweep that goes on above the short-circuit sweep, which then shows no Ca: one for each of many resonances
    of the winding above it."""
    winding, sweeps = _winding(measurement), {sweep.termination: sweep for sweep in measurement.sweeps}
    if not winding or "open" not in sweeps:
        return []
    at, open_ohm, highest_hz = sweeps["open"].frequency_hz, sweeps["open"].mean_ohm, sweeps["short"].frequency_hz[-1]
    chosen = informative_points(at, open_ohm, FRAME_POINTS)
    count = int(np.ceil(np.log(at[-1] / highest_hz) / np.log(STEP)))
    starts: list[dict[str, float]] = []
    for resonance_hz in highest_hz * STEP ** np.arange(1, count + 1):
        tried = {**winding, "Ca": 1 / ((2 * np.pi * resonance_hz) ** 2 * winding["La"])}
        through_ohm = _winding_ohm(at, tried)
        frame = Seen(frame_hz=at[chosen], open_ohm=open_ohm[chosen], through_ohm=through_ohm[chosen]).frame
        starts += [{**tried, **elements} for elements in frames(*frame)] if frame is not None else []
    return starts


@lru_cache(maxsize=8)
def seen(measurement: Measurement) -> Seen:
    """The data from which start values are computed."""
    apart = open_and_winding(measurement)
    at, open_ohm, through_ohm = apart if apart is not None else (None, None, None)
    return dataclasses.replace(_short(measurement), frame_hz=at, open_ohm=open_ohm, through_ohm=through_ohm)


def _short(measurement: Measurement) -> Seen:
    for sweep in measurement.sweeps:
        if sweep.termination == "short":
            return Seen(sweep.frequency_hz, sweep.mean_ohm)
    return Seen()


@lru_cache(maxsize=8)
def _winding(measurement: Measurement) -> Mapping[str, float]:
    """Ra, La, Ca from (b0 + b1 s)/(1 + a1 s + a2 s^2)."""
    found = _short(measurement).short_rational((1, 2))
    if found is None:
        return {}
    (b0, b1), a2 = found.numerator, found.denominator[2]
    return winding_of(b0, b1, a2, found.middle) if b1 > 0 and a2 > 0 else {}


def base_starts(parameters: Mapping[str, float], measurement: Measurement, few: bool, frame_anew: bool = False) -> list[dict[str, float]]:
    """Values of the elements to start an effect from.

    A model without the effect has wrong elements, so besides the fit itself there are values computed from the data (the frame's from the
    difference of the two sweeps, which no effect in the winding changes), Ra without the losses that it included, and a frame in the band.

    Parameters
    ----------
    few : bool
        Without other values of Ra, and without the frame in the band.
    frame_anew : bool
        With that frame nevertheless, whose capacitance is divided anew between Cr and Cf.
    """
    searched = dict(parameters)
    # If nothing is missing, the search already ended at the values from the data.
    bases = [searched, *({**searched, **start} for start in data_driven_starts(measurement)[:1] if not _is_the_same(searched, start))]
    if not few:
        bases = [{**base, "Ra": base.get("Ra", 1.0) * ra} for base in bases for ra in (1.0, 0.1)]
    if (frame_anew or not few) and searched.keys() >= {"Cr", "Cf"}:
        bases.append({**searched, **_neutral_frame(searched["Cr"] + searched["Cf"], measurement)})
    return bases


def _is_the_same(values: Mapping[str, float], start: Mapping[str, float]) -> bool:
    return all(name in values and np.isclose(values[name], value, rtol=1e-9, atol=0.0) for name, value in start.items())


def frames_across_the_band(parameters: Mapping[str, float], measurement: Measurement) -> list[dict[str, float]]:
    """The same low-frequency capacitance to the frame with its resonance all over the band, sharp and damped, the two capacitances unlike.

    Beside a winding of high impedance, a frame shows as a narrow feature of a per cent in the open-circuit sweep: starts that resonate
    elsewhere do not find it.
    """
    capacitance_f = parameters["Cr"] + parameters["Cf"]
    lowest, highest = (end(sweep.frequency_hz[at] for sweep in measurement.sweeps) for end, at in ((min, 0), (max, -1)))
    starts = []
    for resonance_hz in np.geomspace(max(lowest, highest / _DECADE_AND_HALF), highest, _PLACES):
        for share in (0.3, 0.7):
            starts += [{**parameters, **resonant_frame(capacitance_f, share, float(resonance_hz), quality)} for quality in (2.0, 8.0)]
    return starts


def resonant_frame(capacitance_f: float, share: float, resonance_hz: float, quality: float) -> dict[str, float]:
    """A path to the frame of a capacitance, of which Cr has a share, whose branch has a resonance and a quality; SI units."""
    cr = share * capacitance_f
    lr = 1 / ((2 * np.pi * resonance_hz) ** 2 * cr)
    return {"Cr": cr, "Cf": capacitance_f - cr, "Lr": lr, "Rr": float(np.sqrt(lr / cr)) / quality}


def _neutral_frame(capacitance_f: float, measurement: Measurement) -> dict[str, float]:
    """A frame that keeps its low-frequency capacitance and resonates, well damped, a third of the way below the end of the band."""
    omega = 2 * np.pi * 0.35 * max(sweep.frequency_hz[-1] for sweep in measurement.sweeps)
    cr, cf = 0.6 * capacitance_f, 0.4 * capacitance_f
    in_series = cr * cf / (cr + cf)
    lr = 1 / (omega**2 * in_series)
    return {"Cr": cr, "Cf": cf, "Lr": lr, "Rr": 0.7 * float(np.sqrt(lr / in_series))}
