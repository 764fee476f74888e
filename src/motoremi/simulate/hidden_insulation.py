"""Hidden effects of the insulation at Ca, Cr and Cf."""

from __future__ import annotations

import numpy as np

from motoremi.simulate import ladders
from motoremi.simulate.hidden import EffectKind, Elements, Sizes, beside, log_uniform, replaced, uniform
from motoremi.simulate.parts import IN, OUT, Network

_PLACES = ("Cf", "Ca", "Cr")
# Above these frequencies other elements hide the capacitor: Rr in series with Cr, and Cr in parallel with Cf.
_HIGHEST_CORNER_HZ = {"Cf": 4e6, "Ca": 1e7, "Cr": 2e6}


def _loss(place: str) -> EffectKind:
    def draw(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
        return {"tan_delta": uniform(rng, 0.02, 0.05)}

    def apply(network: Network, elements: Elements, sizes: Sizes) -> Network:
        return replaced(network, place, ladders.constant_phase(elements[place], sizes["tan_delta"]))

    return EffectKind(f"dielectric-loss@{place}", draw, apply)


def _relaxation(place: str) -> EffectKind:
    def draw(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
        return {"strength": uniform(rng, 0.2, 0.4), "corner_hz": log_uniform(rng, 3e5, _HIGHEST_CORNER_HZ[place])}

    def apply(network: Network, elements: Elements, sizes: Sizes) -> Network:
        farad = sizes["strength"] * elements[place]
        ohm = 1 / (2 * np.pi * sizes["corner_hz"] * farad)
        slow = Network().capacitor("c", IN, "n", farad).resistor("r", "n", OUT, ohm)
        return beside(network, place, slow)

    return EffectKind(f"dielectric-relaxation@{place}", draw, apply)


def _leakage(place: str) -> EffectKind:
    def draw(rng: np.random.Generator, elements: Elements) -> dict[str, float]:
        return {"resistance_ohm": log_uniform(rng, 5e3, 6e4)}

    def apply(network: Network, elements: Elements, sizes: Sizes) -> Network:
        return beside(network, place, Network().resistor("r", IN, OUT, sizes["resistance_ohm"]))

    return EffectKind(f"insulation-leakage@{place}", draw, apply)


# The loss replaces the capacitor, so it comes first; the others are added in parallel.
INSULATION_EFFECTS = tuple(make(place) for make in (_loss, _relaxation, _leakage) for place in _PLACES)
