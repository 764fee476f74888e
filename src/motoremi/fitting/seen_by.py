"""What the start values of one more effect are read from: the sweeps beside what a fit makes of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from motoremi.arrays import ComplexArray
from motoremi.data.measurement import Measurement
from motoremi.fitting.result import Fit
from motoremi.fitting.starts import seen
from motoremi.model.circuit import Tape
from motoremi.model.effects import find_effect
from motoremi.model.effects.open_alone import Division, divisions
from motoremi.model.effects.seen import Across, Seen
from motoremi.model.motor import Motor

# The effect that describes a resonance of the winding without a cause, and a capacitance of it that changes nothing.
MODES, NEXT_TO_NOTHING_F = "winding-modes", 1e-18


@lru_cache(maxsize=4)
def seen_by(fit: Fit, place: str = "") -> Seen:
    """The sweeps beside what a fit makes of them, for an effect at a place."""
    across = seen_across(fit.motor, fit.parameters, fit.measurement.coarse)
    return dataclasses.replace(seen(fit.measurement.coarse), across=across, parameters=fit.parameters, place=place)


def seen_across(motor: Motor, values: Mapping[str, float], measurement: Measurement) -> Across | None:
    """What an admittance across the winding changes in the short-circuit sweep, or in the open-circuit one if that is the only one.

    It is what a mode of next to no capacitance changes, divided by the mode's admittance; None beside an effect that excludes modes.
    """
    if not find_effect(MODES).fits(motor):
        return None
    sweep = next((one for one in measurement.sweeps if one.termination == "short"), measurement.sweeps[0])
    added = find_effect(MODES)
    label, with_mode = added.label_in(motor), added.added_to(motor)
    own = {f"{label}.{name}": value for name, value in {**added.effect.limit_values, "capacitance_f": NEXT_TO_NOTHING_F}.items()}
    everything = {**own, **values}
    names = list(with_mode.used_parameters(sweep.termination))
    s: ComplexArray = np.asarray(2j * np.pi * sweep.frequency_hz, dtype=np.complex128)
    impedance, gradient = Tape(with_mode.circuit(sweep.termination), names).gradient(s, np.array([everything[name] for name in names]))
    x = s / (2 * np.pi * everything[f"{label}.resonance_hz"])
    decrease = -gradient[names.index(f"{label}.capacitance_f")] / impedance * (1 + x / everything[f"{MODES}.quality"] + x**2) / s
    return Across(sweep.frequency_hz, sweep.mean_ohm, impedance, np.asarray(decrease, dtype=np.complex128))


@lru_cache(maxsize=4)
def open_alone(measurement: Measurement) -> list[Division]:
    """If there is only the open-circuit sweep: what both sweeps may be."""
    if measurement.terminations != ("open",):
        return []
    (sweep,) = measurement.coarse.sweeps
    return divisions(sweep.frequency_hz, sweep.mean_ohm)


@lru_cache(maxsize=4)
def seen_in(fit: Fit, place: str) -> Seen:
    """A fit's own impedance in the place of the sweeps."""
    terminations = fit.measurement.terminations
    if "short" not in terminations:
        return Seen(parameters=fit.parameters, place=place)
    points = {sweep.termination: sweep.frequency_hz for sweep in fit.measurement.coarse.sweeps}
    own = Seen(points["short"], fit.model_ohm("short", points["short"]), parameters=fit.parameters, place=place)
    if "open" not in terminations:
        return own
    at = points["open"]
    return dataclasses.replace(own, frame_hz=at, open_ohm=fit.model_ohm("open", at), through_ohm=fit.model_ohm("short", at))
