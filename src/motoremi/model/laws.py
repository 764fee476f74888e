"""Immittance laws: value and exact derivative in one call.

A law takes the complex angular frequency `s` (shape (n,)) and its parameters (each broadcast against `s`, shape (..., 1))
and returns its value and the partial derivative for each parameter, which broadcast against (..., n): what depends on no parameter, or
on no frequency, need not be repeated. What the value means depends on the node that holds the law: an impedance in ohm, an admittance
in siemens, or a pure factor.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, TypeAlias

import numpy as np
from scipy.special import ive

from motoremi.arrays import ComplexArray

# (s, *parameters) -> (value, derivatives). Parameters are real arrays; `Any` spares each law a cast.
ValueAndSlopes: TypeAlias = tuple[ComplexArray, tuple[ComplexArray, ...]]
Law: TypeAlias = Callable[..., ValueAndSlopes]
TWO_PI = 2 * np.pi
# The table for round wires: from where the factor is 1 to far beyond any wire at any frequency, in steps that keep it within 1e-11.
_LOWEST, _HIGHEST, _STEP = np.log(1e-4), np.log(1e5), 0.0025
_ONE: ComplexArray = np.ones(1, dtype=np.complex128)
# Permeability of vacuum times the conductivity of copper at 20 °C (5.8e7 S/m), in s/m².
COPPER_MU_SIGMA = 4e-7 * np.pi * 5.8e7


def resistor(s: ComplexArray, resistance: Any) -> ValueAndSlopes:
    """Z = R."""
    return resistance, (_ONE,)


def inductor(s: ComplexArray, inductance: Any) -> ValueAndSlopes:
    """Z = s L."""
    return s * inductance, (s,)


def capacitor(s: ComplexArray, capacitance: Any) -> ValueAndSlopes:
    """Z = 1 / (s C)."""
    elastance = 1 / capacitance
    impedance = (1 / s) * elastance
    return impedance, (impedance * -elastance,)


def given(values: ComplexArray) -> Law:
    """A law that takes given values, shape (n,), at the frequencies they belong to."""

    def law(s: ComplexArray) -> ValueAndSlopes:
        return values, ()

    return law


def resonant_cell(s: ComplexArray, inductance: Any, resonance_hz: Any, resistance: Any) -> ValueAndSlopes:
    """Parallel L, C, R by its resonance: Z = 1 / (1/(s L) + s/(w0^2 L) + 1/R), w0 = 2 pi f0."""
    capacitance = 1 / ((TWO_PI * resonance_hz) ** 2 * inductance)
    capacitive = s * capacitance
    reactive = (1 / s) * (1 / inductance) + capacitive
    impedance = 1 / (reactive + 1 / resistance)
    square = impedance**2
    return impedance, (
        square * reactive * (1 / inductance),
        square * capacitive * (2 / resonance_hz),
        square * (1 / resistance**2),
    )


def skin_factor(s: ComplexArray, radius: Any) -> ValueAndSlopes:
    """Round copper wire: x I0(x) / (2 I1(x)), x = radius sqrt(s mu0 sigma). 1 for a thin wire."""
    # On the frequency axis x lies on one ray: a table along its logarithm is ten times quicker than Bessel functions and as exact.
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
    # Scaled Bessel functions: the exponentials cancel in the ratio and would overflow one by one.
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


def lamination_factor(s: ComplexArray, share: Any, corner_hz: Any) -> ValueAndSlopes:
    """Flux in laminations: (1 - k) + k tanh(x)/x, x = sqrt(s / (pi fe))."""
    x = np.sqrt(s) * np.sqrt(1 / (np.pi * corner_hz))
    tanh = np.tanh(x)
    shape = tanh / x
    by_logarithm = 1 - tanh**2 - shape
    return (1 - share) + share * shape, (shape - 1, by_logarithm * (-share / (2 * corner_hz)))


def debye_permeability_factor(s: ComplexArray, share: Any, corner_hz: Any) -> ValueAndSlopes:
    """Magnetic relaxation: (1 - k) + k / (1 + s/wm)."""
    pole = 1 / (1 + s * (1 / (TWO_PI * corner_hz)))
    less = pole - 1
    return 1 + share * less, (less, pole * less * (-share / corner_hz))


def coupled_winding_factor(s: ComplexArray, coupling: Any, resonance_hz: Any, quality: Any) -> ValueAndSlopes:
    """A winding coupled to La, closed by its own capacitance: 1 - k^2 s^2 / (s^2 + s ww/Q + ww^2)."""
    w = TWO_PI * resonance_hz
    # Over s squared: what is left depends on one quotient.
    x = (1 / s) * w
    damped = x * (1 / quality)
    shape = 1 / (1 + damped + x**2)
    square = shape**2
    return 1 - coupling**2 * shape, (
        shape * (-2 * coupling),
        square * (damped + 2 * x**2) * (coupling**2 / resonance_hz),
        square * damped * (-(coupling**2) / quality),
    )


def _power(x: ComplexArray, exponent: Any) -> ComplexArray:
    """x^a; where all x have the same phase, as on the frequency axis, without a complex power for each."""
    modulus, phase = np.abs(x), np.angle(x)
    same = phase[:1] if np.all(phase == phase[0]) else phase
    result: ComplexArray = np.exp(np.log(modulus) * exponent) * np.exp(1j * same * exponent)
    return result


def constant_phase_factor(s: ComplexArray, tan_delta: Any) -> ValueAndSlopes:
    """Impedance of a capacitance with a constant loss angle: (s/w0)^(2 delta/pi), w0 = 2 pi 1 MHz."""
    ratio = s / (TWO_PI * 1e6)
    value = _power(ratio, 2 / np.pi * np.arctan(tan_delta))
    return value, (value * np.log(ratio) * ((2 / np.pi) / (1 + tan_delta**2)),)


def relaxation_factor(s: ComplexArray, strength: Any, corner_hz: Any, exponent: Any) -> ValueAndSlopes:
    """Impedance of a relaxing capacitance (Cole-Cole): 1 / (1 + d / (1 + (s/wd)^a))."""
    corner = TWO_PI * corner_hz
    # In units of an angular frequency in its middle, powers of the axis stay far from the ends of what a number can hold.
    middle = np.abs(s[s.size // 2])
    power = _power(s / middle, exponent) * (middle / corner) ** exponent
    pole = 1 / (1 + power)
    value = 1 / (1 + strength * pole)
    by_pole = value**2 * -pole
    turn = by_pole * pole * power
    return value, (by_pole, turn * (strength * exponent / corner_hz), turn * (np.log(s) - np.log(corner)) * -strength)


def conductance_and_capacitance(s: ComplexArray, conductance: Any, capacitance: Any) -> ValueAndSlopes:
    """Y = G + s C."""
    return conductance + s * capacitance, (_ONE, s)


def capacitance_only(s: ComplexArray, capacitance: Any) -> ValueAndSlopes:
    """Y = s C."""
    return s * capacitance, (s,)


def resistance_and_inductance(s: ComplexArray, resistance: Any, inductance: Any) -> ValueAndSlopes:
    """Z = R + s L."""
    return resistance + s * inductance, (_ONE, s)


def positive_part(s: ComplexArray, resistance: Any) -> ValueAndSlopes:
    """Z = R where R > 0, else nothing."""
    on = (resistance > 0) + 0j
    return resistance * on, (on,)


def negative_part(s: ComplexArray, resistance: Any) -> ValueAndSlopes:
    """Z = -R where R < 0, else nothing."""
    on = (resistance < 0) + 0j
    return -resistance * on, (-on,)


def square_law_gain(s: ComplexArray, error: Any) -> ValueAndSlopes:
    """Load error of a fixture: 1 + e (f / 30 MHz)^2."""
    shape = -((s / (TWO_PI * 30e6)) ** 2)
    return 1 + error * shape, (shape,)


def gain_step(s: ComplexArray, real_step: Any, imaginary_step: Any, frequency_hz: Any) -> ValueAndSlopes:
    """Range switching: exp(u + j v) from `frequency_hz` upwards, 1 below."""
    above = ((s.imag >= TWO_PI * frequency_hz * (1 - 1e-12)) + 0j) * np.ones_like(real_step)
    value = np.exp((real_step + 1j * imaginary_step) * above)
    return value, (value * above, 1j * value * above, 0 * value)


def split_factor(s: ComplexArray, share: Any) -> ValueAndSlopes:
    """Impedance of a share of a capacitance: 1 / b."""
    return 1 / share, (-1 / share**2,)


def rest_factor(s: ComplexArray, share: Any) -> ValueAndSlopes:
    """Impedance of what is left of a capacitance: 1 / (1 - b)."""
    return 1 / (1 - share), (1 / (1 - share) ** 2,)


def drift_factor(s: ComplexArray, change: Any) -> ValueAndSlopes:
    """Impedance of a capacitance that has grown by a share: 1 / (1 + c)."""
    return 1 / (1 + change), (-1 / (1 + change) ** 2,)


def line_tangent(s: ComplexArray, delay: Any) -> ValueAndSlopes:
    """tanh(s tau) of a lossless line; signed, since a reference plane may lie on either side."""
    tanh = np.tanh(s * delay)
    return tanh, (s * (1 - tanh**2),)
