"""Responses of the parts of a simulated motor to a condition: temperature, bias, turned shaft, drying and others.

Typical sizes are textbook values (unconfirmed for any one motor). Each motor has its own response within a factor of two of the typical one,
and one effect in ten does not respond at all. Only copper always follows the tables.
"""

from __future__ import annotations

import dataclasses
import math
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from motoremi.simulate.hidden import ELEMENTS, log_uniform, uniform
from motoremi.simulate.hidden_effects import HiddenEffect
from motoremi.simulate.simulated_motor import SimulatedMotor
from motoremi.simulate.stand import AMBIENT_DEGC

COPPER_PER_KELVIN = 0.00393
# Share of the effects that do not respond to a condition; the others respond within this factor of the typical size.
SILENT, FACTOR = 0.1, 2.0
USUAL_RISE_KELVIN, USUAL_BIAS_AMPERE = 30.0, 1.0
_BOLTZMANN_EV = 8.617e-5
_ICE_KELVIN = 273.15
# Share of iron in a winding's inductance, and current at which the squared permeability has decreased to a half.
_IRON_SHARE, _KNEE_AMPERE = (0.3, 0.8), (0.7, 3.0)
_ROD_KNEE_AMPERE = (1.0, 8.0)
# Largest share of a coil's flux in a coupled loop or in iron.
_LARGEST_SHARE = 0.9

# (temperature rise in kelvin, strength of the response, random stream) -> factor
Law: TypeAlias = Callable[[float, float, np.random.Generator], float]


def _copper(power: float = 1.0) -> Law:
    """Resistance of copper: the same in every motor."""
    return lambda rise, strength, rng: (1 + COPPER_PER_KELVIN * rise) ** power


def _linear(per_kelvin: float) -> Law:
    return lambda rise, strength, rng: math.exp(strength * math.log1p(per_kelvin * rise))


def _activated(electron_volt: float) -> Law:
    """Arrhenius's law, as of ions and dipoles in an insulation; a positive energy for a quantity that grows with temperature."""

    def law(rise: float, strength: float, rng: np.random.Generator) -> float:
        cold = AMBIENT_DEGC + _ICE_KELVIN
        return math.exp(strength * electron_volt / _BOLTZMANN_EV * (1 / cold - 1 / (cold + rise)))

    return law


def _times(factor: float) -> Law:
    return lambda rise, strength, rng: factor**strength


def _scatter(relative: float) -> Law:
    """A random change each time: a contact or film that was moved."""
    return lambda rise, strength, rng: math.exp(strength * relative * rng.standard_normal())


# Condition -> element or effect (without its place) -> size -> law.
LAWS: Mapping[str, Mapping[str, Mapping[str, Law]]] = {
    "second-temperature": {
        "Ra": {"": _copper()},
        "La": {"": _linear(2e-4)},
        "Ca": {"": _linear(5e-4)},
        "Rr": {"": _linear(1e-3)},
        "Cr": {"": _linear(3e-4)},
        "Cf": {"": _linear(6e-4)},
        # For a field, warmer copper is equivalent to thinner wire, or to a layer with less copper.
        "skin-effect": {"radius_m": _copper(-0.5)},
        "proximity-effect": {"porosity": _copper(-1.0)},
        "eddy-laminations": {"corner_hz": _linear(1.5e-3)},
        "permeability-relaxation": {"corner_hz": _linear(-2e-3)},
        "core-loss": {"resistance_ohm": _linear(1.5e-3)},
        "brush-contact": {"resistance_ohm": _linear(-3e-3)},
        "field-coupling": {"field_resistance_ohm": _linear(3e-3)},
        "second-resonance": {"resistance_ohm": _linear(2e-3)},
        "dielectric-loss": {"tan_delta": _activated(0.12)},
        "dielectric-relaxation": {"corner_hz": _activated(0.35)},
        "insulation-leakage": {"resistance_ohm": _activated(-0.5)},
        "bearing-film": {"resistance_ohm": _activated(-0.25), "capacitance_f": _linear(6e-3)},
        "rotor-cage": {"corner_hz": _linear(4e-3), "skin_hz": _linear(4e-3)},
        "shorted-turn": {"corner_hz": _copper()},
        "frame-eddy": {"corner_hz": _linear(4e-3)},
        "machine-winding": {"iron_hz": _linear(2e-3), "cage_hz": _linear(4e-3)},
        "winding-modes": {"quality": _linear(-2e-3)},
        "suppressor-capacitor": {"capacitance_f": _linear(-1e-3)},
        "suppressor-choke": {"resistance_ohm": _copper(), "corner_hz": _linear(-2e-3)},
        "lead-inductance": {"resistance_ohm": _copper(), "skin_ohm": _copper(0.5)},
        "ground-strap-inductance": {"resistance_ohm": _copper(), "skin_ohm": _copper(0.5)},
        "far-end-tie": {"resistance_ohm": _copper(), "skin_ohm": _copper(0.5)},
        "supply-cable": {"skin_ohm": _copper(0.5)},
        "outside-charge-diffusion": {"resistance_ohm": _activated(-0.2)},
    },
    "shaft-turned": {
        "La": {"": _scatter(3e-3)},
        "Ra": {"": _scatter(2e-3)},
        "Cr": {"": _scatter(5e-3)},
        "bearing-film": {"resistance_ohm": _scatter(0.8), "capacitance_f": _scatter(0.35)},
        "brush-contact": {"resistance_ohm": _scatter(0.4), "capacitance_f": _scatter(0.3)},
        "shorted-turn": {"share": _scatter(0.4)},
        "field-coupling": {"coupling": _scatter(0.05)},
        "outside-rotor-coupling": {"coupling": _scatter(0.2)},
    },
    "dried": {
        "Ca": {"": _times(0.99)},
        "Cf": {"": _times(0.985)},
        "dielectric-loss": {"tan_delta": _times(0.55)},
        "dielectric-relaxation": {"strength": _times(0.85), "corner_hz": _times(0.7)},
        "insulation-leakage": {"resistance_ohm": _times(8.0)},
        "outside-charge-diffusion": {"resistance_ohm": _times(3.0)},
    },
    "end-turn-touched": {
        "Ca": {"": _times(1.01)},
        "Cf": {"": _times(1.02)},
        "second-resonance": {"capacitance_f": _times(1.06)},
        "field-coupling": {"field_capacitance_f": _times(1.05)},
        "winding-modes": {f"{mode}_resonance_hz": _times(0.98) for mode in ("first", "second", "third")},
    },
    # The open terminals of the field winding are shorted: its capacitance is then negligible.
    "field-winding": {"field-coupling": {"field_capacitance_f": _times(1e6)}},
    "longer-strap": {"ground-strap-inductance": {"inductance_h": _times(2.0), "resistance_ohm": _times(2.0), "skin_ohm": _times(2.0)}},
    "terminal-block": {"terminal-capacitance": {"capacitance_f": _times(0.05)}},
    # The leads are connected to single commutator bars, while brushes cover several.
    "brushes-lifted": {"Ra": {"": _scatter(0.02)}, "La": {"": _scatter(0.02)}, "Ca": {"": _scatter(0.02)}, "Cf": {"": _times(0.99)}},
    "rotor-out": {
        "La": {"": _times(0.6)},
        "Cr": {"": _times(0.2)},
        "bearing-film": {"resistance_ohm": _times(1e-3)},
        "rotor-cage": {"share": _times(0.03)},
        "machine-winding": {"cage_share": _times(0.03)},
        "outside-rotor-coupling": {"coupling": _times(0.05)},
    },
}
# Conditions under which every part responds, with the typical size.
_CERTAIN = {"rotor-out"}
_BOUNDED = {"share": _LARGEST_SHARE, "cage_share": _LARGEST_SHARE, "coupling": _LARGEST_SHARE, "tan_delta": 0.9, "porosity": 1.0}


@dataclass(frozen=True)
class Responses:
    """The responses of one motor; the same condition always gives the same response.

    Parameters
    ----------
    motor : SimulatedMotor
        The motor without a condition.
    seed : int
    """

    motor: SimulatedMotor
    seed: int

    def strength(self, condition: str, name: str) -> float:
        """Strength of the response of an element or effect, in units of the typical response; 0 if it does not respond."""
        if condition in _CERTAIN:
            return 1.0
        rng = self._rng(condition, name)
        return 0.0 if rng.random() < SILENT else log_uniform(rng, 1 / FACTOR, FACTOR)

    def under(self, condition: str, value: float | None = None, turn: int = 0) -> SimulatedMotor:
        """The motor under a condition.

        Parameters
        ----------
        condition : str
            Identifier; a condition that does not change the motor itself returns it unchanged.
        value : float, optional
            Temperature in degree Celsius, bias in ampere.
        turn : int
            Number of earlier times: a shaft that is turned again is in another position.
        """
        if condition == "dc-bias":
            return self._biased(USUAL_BIAS_AMPERE if value is None else abs(value))
        rise = USUAL_RISE_KELVIN if value is None else value - AMBIENT_DEGC
        laws = LAWS.get(condition, {})
        factors = {name: self._factors(condition, name, laws[name], rise, turn).get("", 1.0) for name in ELEMENTS if name in laws}
        elements = {name: value * factors.get(name, 1.0) for name, value in self.motor.elements.items()}
        effects = tuple(self._changed(effect, condition, laws.get(effect.name.split("@")[0], {}), rise, turn) for effect in self.motor.effects)
        return dataclasses.replace(self.motor, **elements, effects=effects)

    def _factors(self, condition: str, name: str, laws: Mapping[str, Law], rise: float, turn: int) -> dict[str, float]:
        strength, rng = self.strength(condition, name), self._rng(condition, f"{name} {turn}")
        return {size: law(rise, strength, rng) for size, law in laws.items()}

    def _changed(self, effect: HiddenEffect, condition: str, laws: Mapping[str, Law], rise: float, turn: int) -> HiddenEffect:
        factors = self._factors(condition, effect.name, laws, rise, turn)
        sizes = {name: min(size * factors.get(name, 1.0), _BOUNDED.get(name, math.inf)) for name, size in effect.sizes.items()}
        return dataclasses.replace(effect, sizes=sizes)

    def permeability(self, ampere: float) -> float:
        """Factor of a bias on the iron's differential permeability: 1 / sqrt(1 + (I / knee)^2), with a random knee current."""
        rng = self._rng("dc-bias", "iron")
        knee = log_uniform(rng, *_KNEE_AMPERE)
        return 1 / math.hypot(1.0, self.strength("dc-bias", "iron") * ampere / knee)

    def _biased(self, ampere: float) -> SimulatedMotor:
        """The motor under a bias: iron saturates, and the film under a brush conducts better."""
        left, shares = self.permeability(ampere), self._iron_shares()
        iron = max(shares.values(), default=uniform(self._rng("dc-bias", "share"), *_IRON_SHARE))
        rest = 1 - iron * (1 - left)
        effects = [self._biased_effect(effect, ampere, left, rest) for effect in self.motor.effects]
        return dataclasses.replace(self.motor, La=self.motor.La * rest, effects=tuple(effects))

    def _iron_shares(self) -> dict[str, float]:
        """The iron's share of La according to the hidden effects."""
        sizes = {effect.name: effect.sizes for effect in self.motor.effects}
        found: dict[str, float] = {name: sizes[name]["share"] for name in ("eddy-laminations", "permeability-relaxation") if name in sizes}
        if "machine-winding" in sizes:
            found["machine-winding"] = 1 - sizes["machine-winding"]["cage_share"]
        return found

    def _biased_effect(self, effect: HiddenEffect, ampere: float, left: float, rest: float) -> HiddenEffect:
        sizes = dict(effect.sizes)
        if effect.name in ("eddy-laminations", "permeability-relaxation"):
            # Less permeable iron is penetrated up to higher frequencies.
            sizes |= {"share": sizes["share"] * left / rest, "corner_hz": sizes["corner_hz"] / left}
        elif effect.name == "machine-winding":
            sizes |= {"cage_share": min(sizes["cage_share"] / rest, _LARGEST_SHARE), "iron_hz": sizes["iron_hz"] / left}
        elif effect.name == "core-loss":
            sizes["resistance_ohm"] *= left**0.3
        elif effect.name == "common-mode-flux":
            sizes["share_lost"] *= left**0.5
        elif effect.name == "brush-contact":
            sizes["resistance_ohm"] /= 1 + self.strength("dc-bias", effect.name) * ampere / 0.7
        elif effect.name in ("suppressor-choke", "suppressor-choke@brushes"):
            knee = log_uniform(self._rng("dc-bias", "rod"), *_ROD_KNEE_AMPERE)
            rod = sizes["share"] * sizes["inductance_h"] / math.hypot(1.0, self.strength("dc-bias", effect.name) * ampere / knee)
            whole = rod + (1 - sizes["share"]) * sizes["inductance_h"]
            sizes |= {"inductance_h": whole, "share": rod / whole}
        return dataclasses.replace(effect, sizes=sizes)

    def _rng(self, condition: str, name: str) -> np.random.Generator:
        return np.random.default_rng([self.seed, zlib.crc32(f"{condition} {name}".encode())])
