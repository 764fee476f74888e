"""Weak hidden effects: scaling of each effect, and the strength at which the seven elements leave a given multiple of the noise."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
from scipy.optimize import brentq, least_squares

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.sweep import TERMINATIONS
from motoremi.errors import BadInput
from motoremi.simulate.analyser_errors import noise_sd_ohm
from motoremi.simulate.hidden import ELEMENTS
from motoremi.simulate.simulated_motor import SimulatedMotor
from motoremi.simulate.uncatalogued import UncataloguedMotor

# The sizes that scale an effect, each with the power of the strength that it is proportional to.
STRENGTH: Mapping[str, Mapping[str, float]] = {
    "skin-effect": {"radius_m": 0.5},
    "proximity-effect": {"height_m": 0.5},
    "field-coupling": {"coupling": 0.5},
    "eddy-laminations": {"share": 1},
    "permeability-relaxation": {"share": 1},
    "core-loss": {"resistance_ohm": -1},
    "brush-contact": {"resistance_ohm": 1},
    "distributed-winding": {"share": 1},
    "second-resonance": {"inductance_h": 1, "capacitance_f": -1, "resistance_ohm": 1},
    "dielectric-loss": {"tan_delta": 1},
    "dielectric-relaxation": {"strength": 1},
    "insulation-leakage": {"resistance_ohm": -1},
    "bearing-film": {"resistance_ohm": 1, "capacitance_f": -1},
    "lead-inductance": {"inductance_h": 1, "resistance_ohm": 1, "skin_ohm": 1},
    "ground-strap-inductance": {"inductance_h": 1, "resistance_ohm": 1, "skin_ohm": 1},
    "terminal-capacitance": {"capacitance_f": 1},
    "supply-cable": {"inductance_h": 1, "capacitance_f": 1, "skin_ohm": 1},
    "rotor-cage": {"share": 1},
    "shorted-turn": {"share": 1},
    "machine-winding": {"slots_f": 1, "cage_share": 1, "iron_hz": -1},
    "frame-eddy": {"share": 1},
    "common-mode-flux": {"share_lost": 1},
    "winding-sections": {"share": 1},
    "winding-modes": {"first_capacitance_f": 1, "second_capacitance_f": 1, "third_capacitance_f": 1},
    "suppressor-capacitor": {"capacitance_f": 1},
    "suppressor-choke": {"inductance_h": 1, "resistance_ohm": 1},
}
_LEAST_STRENGTH = 1e-4
# Bound of the fitted elements: natural logarithm of the factor on the motor's own.
_FARTHEST = 1.5


def weakened(motor: SimulatedMotor, strength: float) -> SimulatedMotor:
    """The motor with all hidden effects at `strength` (0 .. 1) of their size.

    Raises
    ------
    BadInput
        For an effect that is not in `STRENGTH`.
    """
    effects = []
    for effect in motor.effects:
        if (powers := STRENGTH.get(effect.name.split("@")[0])) is None:
            raise BadInput(f"no way is known to weaken {effect.name!r}")
        sizes = {name: size * strength ** powers.get(name, 0) for name, size in effect.sizes.items()}
        effects.append(dataclasses.replace(effect, sizes=sizes))
    return dataclasses.replace(motor, effects=tuple(effects))


def misfit(motor: SimulatedMotor | UncataloguedMotor, frequency_hz: FloatArray, bandwidth_factor: int, repeats: int) -> float:
    """Rms residual of the best fit of the seven elements, in multiples of the random noise of the mean of the repeats."""
    truth = [motor.impedance(termination, frequency_hz) for termination in TERMINATIONS]
    weights = [np.abs(z) / noise_sd_ohm(frequency_hz, z, bandwidth_factor) * np.sqrt(repeats / 2) for z in truth]
    weight, target = np.concatenate(weights), np.log(np.concatenate(truth))

    def left(logarithms: FloatArray) -> FloatArray:
        rest = (target - _response(logarithms, frequency_hz)).view(np.float64).reshape(-1, 2)
        turns = np.angle(np.exp(1j * rest[:, 1]))
        return np.concatenate([rest[:, 0] * weight, turns * weight])

    start = np.log([motor.elements[name] for name in ELEMENTS])
    found = least_squares(left, start, bounds=(start - _FARTHEST, start + _FARTHEST), x_scale="jac", xtol=1e-10, ftol=1e-6, max_nfev=60)
    return float(np.sqrt(np.sum(found.fun**2) / target.size))


def _response(logarithms: FloatArray, frequency_hz: FloatArray) -> ComplexArray:
    plain = SimulatedMotor(**dict(zip(ELEMENTS, np.exp(logarithms).tolist(), strict=True)))
    return np.log(np.concatenate([plain.impedance(termination, frequency_hz) for termination in TERMINATIONS]))


def strength_for(motor: SimulatedMotor, floors: float, frequency_hz: FloatArray, bandwidth_factor: int, repeats: int) -> float:
    """The strength at which the residual of the seven elements is `floors` times the noise; 1 if it is smaller at full size."""

    def excess(logarithm: float) -> float:
        return float(np.log(max(misfit(weakened(motor, float(np.exp(logarithm))), frequency_hz, bandwidth_factor, repeats), 1e-9) / floors))

    high, low = 0.0, 0.0
    if excess(high) <= 0:
        return 1.0
    while low > np.log(_LEAST_STRENGTH):
        high, low = low, low - np.log(4)
        if excess(low) < 0:
            return float(np.exp(brentq(excess, low, high, xtol=0.02)))
    return _LEAST_STRENGTH
