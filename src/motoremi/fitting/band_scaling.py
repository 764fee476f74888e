"""The catalogue's start values and ranges, carried over to other bands and impedances.

They are written for motors as the paper measures them, 150 kHz - 30 MHz at some hundred ohms. A circuit scaled in frequency by a and in
impedance by b is again a circuit, with R b, L b/a and C / (a b); so a sweep is divided into bands as wide as that one, and each gets the
catalogue's values scaled by its own a and b. Instrument effects keep theirs: an analyser's errors do not depend on the motor.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from motoremi.data.measurement import Measurement
from motoremi.model.effects import Effect
from motoremi.model.effects.start import Subtract
from motoremi.model.motor import BASE_PARAMETERS
from motoremi.model.parameter import Parameter

REFERENCE_BAND_HZ = (150e3, 30e6)
REFERENCE_OHM = 300.0
# Start values cover so much either way: a band that lies within is not scaled.
COVERED_HZ = 1.5
COVERED_OHM = 4.0
# Exponents of a and of b by unit. A wire's radius goes with the skin depth, a delay with the period.
EXPONENTS: Mapping[str, tuple[float, float]] = {
    "Hz": (1, 0), "Ohm": (0, 1), "H": (-1, 1), "F": (-1, -1), "S": (0, -1), "s": (-1, 0), "m": (-0.5, 0), "": (0, 0),
}  # fmt: skip


@dataclass(frozen=True)
class Band:
    """A part of a sweep against the reference: frequency and impedance ratio."""

    frequency: float
    impedance: float

    def factor(self, unit: str) -> float:
        """By which a quantity of that unit is scaled."""
        a, b = EXPONENTS[unit]
        return float(self.frequency**a * self.impedance**b)


@lru_cache(maxsize=8)
def bands(measurement: Measurement) -> tuple[Band, ...]:
    """The parts of a measurement's span, from low to high."""
    frequency = np.concatenate([sweep.frequency_hz for sweep in measurement.sweeps])
    magnitude = np.concatenate([np.abs(sweep.mean_ohm) for sweep in measurement.sweeps])
    low, high = float(frequency.min()), float(frequency.max())
    width = np.log(REFERENCE_BAND_HZ[1] / REFERENCE_BAND_HZ[0])
    count = max(1, round(np.log(high / low) / width))
    edges = np.geomspace(low, high, count + 1)
    found = []
    for first, last in itertools.pairwise(edges):
        inside = (frequency >= first * (1 - 1e-9)) & (frequency <= last * (1 + 1e-9))
        ratio_hz = np.sqrt(first * last / (REFERENCE_BAND_HZ[0] * REFERENCE_BAND_HZ[1]))
        ratio_ohm = np.exp(np.mean(np.log(magnitude[inside]))) / REFERENCE_OHM if inside.any() else 1.0
        found.append(Band(_beyond(float(ratio_hz), COVERED_HZ), _beyond(float(ratio_ohm), COVERED_OHM)))
    return tuple(found)


def _beyond(ratio: float, covered: float) -> float:
    return 1.0 if 1 / covered <= ratio <= covered else ratio


def _scales(effect: Effect, parameter: Parameter) -> bool:
    """Not the analyser's own errors, nor what is found by a scan."""
    return effect.group != "instrument" and parameter.scale == "log" and parameter.vary


def scale_factors(effect: Effect, measurement: Measurement) -> list[dict[str, float]]:
    """For each band of a measurement, by which those parameters of an effect that are scaled are scaled there, by their short names."""
    scaling = [p for p in effect.parameters if _scales(effect, p)]
    return [{p.name: band.factor(p.unit) for p in scaling} for band in bands(measurement)]


def scaled_starts(effect: Effect, measurement: Measurement) -> list[dict[Any, float]]:
    """An effect's start values for each band of a measurement, SI units."""
    elements = () if effect.group == "instrument" else BASE_PARAMETERS
    of_elements = [{Subtract(p.name): band.factor(p.unit) for p in elements} for band in bands(measurement)]
    factors: list[dict[Any, float]] = [{**own, **other} for own, other in zip(scale_factors(effect, measurement), of_elements, strict=True)]
    scaled = [{name: value * factor.get(name, 1.0) for name, value in start.items()} for factor in factors for start in effect.starts]
    return [start for index, start in enumerate(scaled) if start not in scaled[:index]]


def scaled_ranges(effect: Effect, label: str, measurement: Measurement) -> dict[str, tuple[float, float]]:
    """Ranges of an effect's parameters that reach further than the catalogue's because the sweep does; none for a sweep like the paper's.

    Suppressors are parts that can be bought: their sizes do not follow the motor's.
    """
    found: dict[str, tuple[float, float]] = {}
    if effect.kin == "suppressor":
        return found
    of_bands = scale_factors(effect, measurement)
    for parameter in effect.parameters:
        factors = [factor.get(parameter.name, 1.0) for factor in of_bands]
        low, high = parameter.low * min(1.0, *factors), parameter.high * max(1.0, *factors)
        if (low, high) != (parameter.low, parameter.high):
            found[f"{label}.{parameter.name}"] = (low, high)
    return found
