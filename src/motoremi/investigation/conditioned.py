"""Sweeps under conditions, thinned and with their noise; also those that a measurement would give, without data."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from motoremi.arrays import FloatArray
from motoremi.data.conditions import NEXT_TO_NOTHING, VALUES, Condition, SingleValue
from motoremi.data.measurement import Conditioned, Measurement
from motoremi.data.noise import Noise
from motoremi.data.sweep import RepeatedSweep
from motoremi.investigation.menu import BY_NAME, Option
from motoremi.investigation.outcome import Observed
from motoremi.investigation.responses import ROOM_DEGC

# Points of a sweep that are used: changes are smooth but for resonances, which move by more than their width over so many.
POINTS = 100
# Points of a sweep that is only predicted.
POINTS_AHEAD = 40
# A point with more noise than this is not used, except of a shorting bar and an open fixture, whose impedance or admittance is near zero.
LARGEST_NOISE = 0.3
_NOTHING_TO_COMPARE = "the session has no {} sweep of the motor as it is to compare it with"


def by_condition(measurement: Measurement) -> list[tuple[Option, list[Observed]]]:
    """The sweeps of each condition that the menu knows, in the order in which they came."""
    found = []
    for condition in dict.fromkeys(one.condition for one in measurement.conditioned):
        option = BY_NAME.get(condition.id)
        own = [one for one in measurement.conditioned if one.condition == condition]
        if option is not None and option.predicted:
            sweeps = [seen for one in own if (seen := _observed(one, option, measurement)) is not None]
            if sweeps:
                found.append((option, sweeps))
    return found


def without_use(measurement: Measurement) -> list[tuple[Conditioned | SingleValue, str]]:
    """Sweeps under conditions and single values that tell nothing about the explanations, each with the reason."""
    found: list[tuple[Conditioned | SingleValue, str]] = []
    for one in measurement.conditioned:
        option, termination = BY_NAME.get(one.condition.id), one.sweep.termination
        if option is None or not option.predicted:
            found.append((one, "how the effects respond to it is not known"))
        elif _reference(measurement, termination) is None:
            found.append((one, _NOTHING_TO_COMPARE.format(termination)))
        elif _observed(one, option, measurement) is None:
            found.append((one, f"it has less than two usable points at the frequencies of the {termination} sweep of the motor as it is"))
    for value in measurement.values:
        needed = VALUES[value.name].termination
        if needed not in (None, *measurement.terminations):
            found.append((value, _NOTHING_TO_COMPARE.format(needed)))
    return found


def _observed(one: Conditioned, option: Option, measurement: Measurement) -> Observed | None:
    """A sweep as it is used; None without a reference sweep to compare with, or if it is only noise."""
    sweep, reference = one.sweep, _reference(measurement, one.sweep.termination)
    if reference is None:
        return None
    inside = np.ones(sweep.frequency_hz.size, dtype=np.bool_)
    sigma = np.sqrt(one.noise.variance)
    if option.kind == "change":
        before, noise = reference
        frequency = before.frequency_hz
        # Beyond the reference sweep there is no change to see.
        inside &= (sweep.frequency_hz >= frequency[0] * (1 - 1e-9)) & (sweep.frequency_hz <= frequency[-1] * (1 + 1e-9))
        # Of the reference sweep the noise of the coefficient that is compared, in units of what was measured.
        coefficient = measurement.analyser.coefficient
        of_reference = np.sqrt(noise.variance) / np.abs(coefficient.relative(before.mean_ohm))
        there = np.interp(np.log(sweep.frequency_hz), np.log(frequency), of_reference)
        sigma = np.hypot(sigma, there * np.abs(coefficient.relative(sweep.mean_ohm)))
    inside &= one.noise.regular & ((sigma < LARGEST_NOISE) | (option.name in NEXT_TO_NOTHING))
    kept = np.flatnonzero(inside)
    if kept.size < 2:
        return None
    kept = kept[np.unique(np.linspace(0, kept.size - 1, min(POINTS, kept.size)).round().astype(np.intp))]
    return Observed(one.condition, sweep.termination, sweep.frequency_hz[kept], sigma[kept], sweep.mean_ohm[kept])


def _reference(measurement: Measurement, termination: str) -> tuple[RepeatedSweep, Noise] | None:
    pairs = zip(measurement.sweeps, measurement.noise, strict=True)
    return next(((sweep, noise) for sweep, noise in pairs if sweep.termination == termination), None)


def asked_condition(option: Option) -> Condition:
    """The condition that a measurement of the menu asks for."""
    value = option.asked
    if option.name == "second-temperature" and value is not None:
        value = ROOM_DEGC + value
    return Condition(option.name, value, option.unit if value is not None else "")


def ahead(option: Option, measurement: Measurement, points: int = POINTS_AHEAD) -> list[Observed]:
    """The sweeps that a measurement of the menu would give, without data; none of a termination that the session has no sweep of."""
    sweeps = []
    for termination in option.sweeps:
        reference = _reference(measurement, termination)
        if reference is None:
            continue
        before, noise = reference
        frequency = before.frequency_hz
        low, high = measurement.analyser.span_hz if option.name == "wide-sweep" else (float(frequency[0]), float(frequency[-1]))
        grid = (
            np.geomspace(min(low, frequency[0]), max(high, frequency[-1]), points) if option.name == "wide-sweep" else _thinned(frequency, points)
        )
        sigma = np.interp(np.log(grid), np.log(frequency), np.sqrt(noise.variance))
        sweeps.append(Observed(asked_condition(option), termination, grid, np.sqrt(2) * sigma if option.kind == "change" else sigma))
    return sweeps


def _thinned(frequency_hz: FloatArray, points: int) -> FloatArray:
    index: Sequence[int] = np.unique(np.linspace(0, frequency_hz.size - 1, min(points, frequency_hz.size)).round().astype(np.intp)).tolist()
    return frequency_hz[list(index)]
