"""Laws of materials (copper, iron, ferrite, insulation) as factors on the impedance of an element.

Conductors: skin and proximity effect. Magnetic materials: diffusion in sheets, relaxation with one or many time constants, damped
resonance, closed loops. Dielectrics: constant loss angle, relaxation. Each law is causal and passive over its whole range.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from scipy.special import ive

from motoremi.arrays import ComplexArray
from motoremi.model.laws import TWO_PI, Later, ValueAndSlopes

# Permeability of vacuum times the conductivity of copper at 20 °C (5.8e7 S/m), in s/m².
COPPER_MU_SIGMA = 4e-7 * np.pi * 5.8e7
# The table for round wires: ln|x| from where the factor is 1 to beyond any wire and frequency, in steps that keep the error below 1e-11.
_LOWEST, _HIGHEST, _STEP = np.log(1e-4), np.log(1e5), 0.0025


def skin_factor(s: ComplexArray, radius: Any) -> ValueAndSlopes:
    """Round copper wire: x I0(x) / (2 I1(x)), x = radius sqrt(s mu0 sigma). 1 for a thin wire."""
    # On the frequency axis x lies on one ray: a table over its logarithm is ten times faster than Bessel functions.
    table = _round_wire_table()
    place = (np.log(radius) + 0.5 * np.log(np.abs(s) * COPPER_MU_SIGMA) - _LOWEST) / _STEP
    if s.real.any() or place.min() < 0 or not place.max() < table.shape[1]:
        root = np.sqrt(s * COPPER_MU_SIGMA)
        value, slope = _round_wire(radius * root)
        return value, (slope * root,)
    index = place.astype(np.intp)
    t = (place - index).astype(np.complex128)
    c0, c1, c2, c3 = np.take(table, index, axis=1)
    cubic = t * c3
    second = c2 + cubic
    first = c1 + t * second
    return c0 + t * first, ((first + t * (second + cubic)) * (1 / (_STEP * radius)),)


def _round_wire(x: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """x I0(x) / (2 I1(x)) and its derivative."""
    # Scaled Bessel functions: the exponential factors cancel in the ratio, and unscaled functions would overflow.
    ratio = ive(0, x) / ive(1, x)
    return x * ratio / 2, (ratio + x * (1 - ratio**2 + ratio / x)) / 2


@cache
def _round_wire_table() -> ComplexArray:
    """Coefficients, shape (4, m), of the cubics through value and slope at equal steps of ln|x|."""
    x = np.exp(np.arange(_LOWEST, _HIGHEST, _STEP)) * np.exp(0.25j * np.pi)
    value, slope = _round_wire(x)
    rise, start, end = np.diff(value), (_STEP * slope * x)[:-1], (_STEP * slope * x)[1:]
    return np.array([value[:-1], start, 3 * rise - 2 * start - end, start + end - 2 * rise])


def dowell_factor(s: ComplexArray, height: Any, layers: Any) -> ValueAndSlopes:
    """Layers of copper foil (Dowell 1966): M + (m^2 - 1)/3 D.

    M = y coth(y), D = 2 y tanh(y/2), y = height sqrt(s mu0 sigma eta), porosity eta = 0.8.
    """
    root = np.sqrt(s * (COPPER_MU_SIGMA * 0.8))
    y = height * root
    half = np.tanh(0.5 * y)
    square = half**2
    coth = (1 + square) / (2 * half)
    d_term = 2 * y * half
    share = (layers**2 - 1) / 3
    slope = coth - y * (coth**2 - 1) + share * (2 * half + y * (1 - square))
    return y * coth + share * d_term, (slope * root, d_term * (2 * layers / 3))


def wire_factor(s: ComplexArray, radius: Any, share: Any) -> ValueAndSlopes:
    """`skin_factor` for the copper's share of a resistance."""
    return _of_a_share(skin_factor(s, radius), share)


def layers_factor(s: ComplexArray, height: Any, layers: Any, share: Any) -> ValueAndSlopes:
    """`dowell_factor` for the copper's share of a resistance."""
    return _of_a_share(dowell_factor(s, height, layers), share)


def _of_a_share(whole: ValueAndSlopes, share: Any) -> ValueAndSlopes:
    """(1 - k) + k F: the rest of the resistance, such as core losses and contacts, does not depend on frequency."""
    factor, slopes = whole
    return 1 + share * (factor - 1), (*(share * slope for slope in slopes), factor - 1)


def lamination_factor(s: ComplexArray, share: Any, corner_hz: Any) -> ValueAndSlopes:
    """Flux in laminations: (1 - k) + k tanh(x)/x, x = sqrt(s / (pi fe))."""
    x = np.sqrt(s) * np.sqrt(1 / (np.pi * corner_hz))
    tanh = np.tanh(x)
    shape = tanh / x
    by_logarithm = 1 - tanh**2 - shape
    return (1 - share) + share * shape, (shape - 1, by_logarithm * (-share / (2 * corner_hz)))


def debye_factor(s: ComplexArray, share: Any, corner_hz: Any) -> ValueAndSlopes:
    """Magnetic relaxation with one time constant (Debye): (1 - k) + k / (1 + s/wm)."""
    pole = 1 / (1 + s * (1 / (TWO_PI * corner_hz)))
    less = pole - 1
    return 1 + share * less, (less, pole * less * (-share / corner_hz))


def cole_cole_factor(s: ComplexArray, share: Any, corner_hz: Any, exponent: Any) -> ValueAndSlopes:
    """Magnetic relaxation (Cole and Cole): (1 - k) + k / (1 + (s/wm)^a)."""
    corner = np.log(TWO_PI * corner_hz)
    power = _power(s, corner, exponent)
    pole = 1 / (1 + power)

    def slopes() -> tuple[ComplexArray, ...]:
        turn = -share * pole**2 * power
        return pole - 1, turn * (-exponent / corner_hz), turn * (np.log(s) - corner)

    return 1 + share * (pole - 1), Later(slopes)


def permeability_factor(s: ComplexArray, share: Any, corner_hz: Any, exponent: Any, quality: Any) -> ValueAndSlopes:
    """Magnetic relaxation: (1 - k) + k / (1 + x^a + (Q x)^2), x = s/wm.

    a = 1 and Q -> 0 is Debye's law, a < 1 that of Cole and Cole, and Q > 0 a damped resonance (Lorentz) of the quality Q at wm/Q.
    """
    corner = TWO_PI * corner_hz
    power = _power(s, np.log(corner), exponent)
    inertia = (s * (quality / corner)) ** 2
    pole = 1 / (1 + power + inertia)

    def slopes() -> tuple[ComplexArray, ...]:
        turn = -share * pole**2
        by_corner = exponent * power + 2 * inertia
        return (
            pole - 1,
            turn * by_corner * (-1 / corner_hz),
            turn * power * (np.log(s) - np.log(corner)),
            turn * inertia * (2 / quality),
        )

    return 1 + share * (pole - 1), Later(slopes)


def shorted_loop_factor(s: ComplexArray, share: Any, corner_hz: Any, skin_hz: Any) -> ValueAndSlopes:
    """An inductance with a closed loop of solid metal coupled to it: 1 - k^2 s / (s + w B).

    k^2 is the share of the flux that the loop encloses, w its resistance over its inductance, and B = x coth x, x = sqrt(s / (2 pi fs)), the
    factor by which its resistance rises when the current is forced to the surface (a deep bar).
    """
    corner = TWO_PI * corner_hz
    x = np.sqrt(s) * np.sqrt(1 / (TWO_PI * skin_hz))
    tanh = np.tanh(x)
    rise = x / tanh
    through = corner * rise
    bottom = 1 / (s + through)
    taken = s * bottom
    # fs times minus dB/dfs, since x dB/dx = -2 fs dB/dfs.
    by_skin = 0.5 * (rise - x**2 * (1 / tanh**2 - 1))
    return 1 - share * taken, (
        -taken,
        share * taken * bottom * through * (1 / corner_hz),
        share * taken * bottom * corner * by_skin * (-1 / skin_hz),
    )


def machine_core_factor(s: ComplexArray, cage_share: Any, cage_hz: Any, iron_hz: Any, exponent: Any) -> ValueAndSlopes:
    """The inductance of a machine's winding: (1 - k) / (1 + (s/wi)^a) + k / (1 + s/wc).

    A share k of the flux is screened by the rotor's cage above a few hundred hertz, the rest by eddy currents in the iron, over several
    decades of frequency.
    """
    cage = 1 / (1 + s * (1 / (TWO_PI * cage_hz)))
    power = _power(s, np.log(TWO_PI * iron_hz), exponent)
    iron = 1 / (1 + power)
    rest = 1 - cage_share

    def slopes() -> tuple[ComplexArray, ...]:
        by_power = -rest * iron**2 * power
        return (
            cage - iron,
            cage_share * cage * (1 - cage) * (1 / cage_hz),
            by_power * (-exponent / iron_hz),
            by_power * (np.log(s) - np.log(TWO_PI * iron_hz)),
        )

    return rest * iron + cage_share * cage, Later(slopes)


def _power(s: ComplexArray, corner: Any, exponent: Any) -> ComplexArray:
    """(s / w)^a, with `corner` ln w: one real power for each point, and one complex factor if all s have the same phase, as on the frequency axis.

    A complex power or the phase of each point would take most of the time of a law.
    """
    modulus, phase = np.log(np.abs(s)), np.angle(s)
    same = phase[:1] if np.all(phase == phase[0]) else phase
    return np.exp((modulus - corner) * exponent) * np.exp(1j * same * exponent)


def constant_phase_factor(s: ComplexArray, tan_delta: Any) -> ValueAndSlopes:
    """Impedance of a capacitance with a constant loss angle: (s/w0)^(2 delta/pi), w0 = 2 pi 1 MHz."""
    ratio = s / (TWO_PI * 1e6)
    value = _power(ratio, 0.0, 2 / np.pi * np.arctan(tan_delta))
    return value, Later(lambda: (value * np.log(ratio) * ((2 / np.pi) / (1 + tan_delta**2)),))


def relaxation_factor(s: ComplexArray, strength: Any, corner_hz: Any, exponent: Any) -> ValueAndSlopes:
    """Impedance of a relaxing capacitance (Cole-Cole): 1 / (1 + d / (1 + (s/wd)^a))."""
    corner = np.log(TWO_PI * corner_hz)
    power = _power(s, corner, exponent)
    pole = 1 / (1 + power)
    value = 1 / (1 + strength * pole)

    def slopes() -> tuple[ComplexArray, ...]:
        by_pole = value**2 * -pole
        turn = by_pole * pole * power
        return by_pole, turn * (strength * exponent / corner_hz), turn * (np.log(s) - corner) * -strength

    return value, Later(slopes)
