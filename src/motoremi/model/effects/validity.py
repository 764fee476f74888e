"""Checks of an effect: it must be passive, and different from every effect of the catalogue.

The impedance of a passive part has a non-negative real part in the whole right half-plane of s (positive real; Brune, J. Math. Phys. 10
(1931) 191). The frequency axis alone is not enough: a negative permeability is a negative inductance, whose resistance is zero there.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.errors import BadInput
from motoremi.model.circuit import Tape
from motoremi.model.effects.effect import AddedEffect, Effect
from motoremi.model.motor import BOTH, Motor, dc_motor
from motoremi.model.parameter import Parameter

# The paper's motor (table 1) with small resistances, which would otherwise hide a small negative resistance.
MOTOR: Mapping[str, float] = {"Ra": 1e-3, "La": 12.1e-6, "Ca": 22e-12, "Rr": 0.04, "Lr": 1.6e-6, "Cr": 424e-12, "Cf": 210e-12}
SIZES = 2 * np.pi * np.geomspace(40.0, 1e9, 60)
AXIS = np.asarray(1j * SIZES, dtype=np.complex128)
# From the frequency axis to the axis of real s.
ANGLES = np.pi * np.array([0.5, 0.4, 0.25, 0.0])
# Rounding error of the real part of a loss-free part, relative to |Z|.
ROUNDING = 1e-7
# Largest number of combinations of the ends of the ranges that are checked.
MOST_COMBINATIONS = 64
# Relative difference below which two laws are the same.
SAME = 1e-9


def check_effect(effect: Effect, known: Iterable[Effect]) -> None:
    """Refuse a user's effect that is not passive somewhere in its ranges, that is already in the catalogue, or that has no possible prior odds.

    Errors of the analyser are not a part of the motor and need not be passive.

    Raises
    ------
    BadInput
        With the values at which it is not passive, the name of the same effect, or the odds.
    """
    if not (isinstance(effect.odds, (int, float)) and 0 < effect.odds < math.inf):
        raise BadInput(f"{effect.name}: its odds are {effect.odds!r}; give a number above 0, 1 for an effect that every motor may have")
    alike = [other for other in known if (other.group == "instrument") == (effect.group == "instrument")]
    for identifier, place in zip(effect.identifiers, effect.places or ("",), strict=True):
        try:
            motor = AddedEffect(effect, identifier, place).added_to(dc_motor())
            if effect.group != "instrument":
                _check_passive(effect, identifier, motor)
            other = _same_as(effect, motor, alike)
        except BadInput:
            raise
        except Exception as error:
            raise BadInput(f"{identifier}: its change or its law fails: {type(error).__name__}: {error}") from error
        if other is not None:
            raise BadInput(f"{identifier} is {other} under another name: use that one")


def _check_passive(effect: Effect, identifier: str, motor: Motor) -> None:
    own = [{f"{identifier}.{name}": value for name, value in values.items()} for values in _combined(effect)]
    if (found := active_at(motor, own)) is not None:
        values, where = found
        units = {p.name: p.unit for p in effect.parameters}
        short = {name.rpartition(".")[2]: value for name, value in values.items()}
        settings = ", ".join(f"{name} = {value:.3g} {units[name]}".rstrip() for name, value in short.items())
        raise BadInput(f"{identifier} is not passive with {settings}: {where}; correct its law or its ranges")


def active_at(motor: Motor, settings: Sequence[Mapping[str, float]]) -> tuple[Mapping[str, float], str] | None:
    """The first setting with which a motor would not be passive, and the reason in words; None if there is none.

    Parameters
    ----------
    motor : Motor
    settings : sequence of mapping
        Values of parameters in SI units; the others are those of a small motor, or the middle of their range.
    """
    names = [p.name for p in motor.parameters]
    rows = np.array([[setting.get(p.name, MOTOR.get(p.name, p.middle)) for p in motor.parameters] for setting in settings])
    for angle in ANGLES:
        for termination in BOTH:
            impedance = _impedance(motor, termination, names, SIZES * np.exp(1j * angle), rows)
            with np.errstate(invalid="ignore"):
                active = impedance.real < -ROUNDING * np.abs(impedance)
            if active.any():
                row, column = np.argwhere(active)[0]
                on_axis = f"its resistance is below zero at {SIZES[column] / (2 * np.pi):.3g} Hz"
                return settings[row], on_axis if angle == ANGLES[0] else "an inductance or a capacitance of it is below zero"
    return None


def _impedance(motor: Motor, termination: str, names: Sequence[str], s: ComplexArray, rows: FloatArray) -> ComplexArray:
    with np.errstate(all="ignore"):
        return np.atleast_2d(Tape(motor.circuit(termination), names).impedance(s, rows))


def _combined(effect: Effect) -> list[dict[str, float]]:
    """Start values and ends of the ranges."""
    starts = [{p.name: start[p.name] for p in effect.parameters} for start in effect.starts]
    ends = itertools.product(*((p.low, p.high) for p in effect.parameters))
    return starts + [dict(zip((p.name for p in effect.parameters), values, strict=True)) for values in itertools.islice(ends, MOST_COMBINATIONS)]


def _same_as(effect: Effect, motor: Motor, known: Iterable[Effect]) -> str | None:
    """The effect of the catalogue that gives the same impedance with the same parameter values in some order."""
    units = [p.unit for p in effect.parameters]
    mine = _both_sweeps(motor, effect.parameters, [p.middle for p in effect.parameters])
    for other in known:
        if sorted(p.unit for p in other.parameters) != sorted(units):
            continue
        for identifier, place in zip(other.identifiers, other.places or ("",), strict=True):
            its = AddedEffect(other, identifier, place).added_to(dc_motor())
            for order in itertools.permutations(range(len(units))):
                if all(p.unit == units[i] for p, i in zip(other.parameters, order, strict=True)):
                    theirs = _both_sweeps(its, other.parameters, [effect.parameters[i].middle for i in order])
                    if np.allclose(mine, theirs, rtol=SAME, atol=0.0):
                        return identifier
    return None


def _both_sweeps(motor: Motor, parameters: Sequence[Parameter], values: Sequence[float]) -> ComplexArray:
    """Impedance in both sweeps of a motor whose effect has these values."""
    own = dict(zip((p.name for p in parameters), values, strict=True))
    row = np.array([[MOTOR.get(p.name, own.get(p.short_name, 0.0)) for p in motor.parameters]])
    names = [p.name for p in motor.parameters]
    return np.concatenate([_impedance(motor, t, names, AXIS, row)[0] for t in BOTH])
