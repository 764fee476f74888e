"""Immittance laws: value and exact derivative in one call.

A law takes the complex angular frequency `s` (shape (n,)) and its parameters (each broadcast against `s`, shape (..., 1))
and returns its value and its partial derivative with respect to each parameter, which broadcast against (..., n). The node that holds the law
decides what the value is: an impedance in ohm, an admittance in siemens, or a factor.

Instead of dividing a complex array by a parameter, laws multiply it by one over the parameter: the same numbers in a fifth of the time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import Any, TypeAlias, overload

import numpy as np

from motoremi.arrays import ComplexArray

# (s, *parameters) -> (value, derivatives). Parameters are real arrays; with `Any` no law needs a cast.
ValueAndSlopes: TypeAlias = tuple[ComplexArray, Sequence[ComplexArray]]
Law: TypeAlias = Callable[..., ValueAndSlopes]
TWO_PI = 2 * np.pi
_ONE: ComplexArray = np.ones(1, dtype=np.complex128)


class Later(Sequence[ComplexArray]):
    """Derivatives that are computed when the first of them is used: four in ten evaluations of a fit need the value only.

    For laws whose derivatives take as long as the value.
    """

    def __init__(self, compute: Callable[[], tuple[ComplexArray, ...]]) -> None:
        self._compute = compute

    @cached_property
    def _computed(self) -> tuple[ComplexArray, ...]:
        return self._compute()

    @overload
    def __getitem__(self, index: int) -> ComplexArray: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[ComplexArray]: ...
    def __getitem__(self, index: int | slice) -> ComplexArray | Sequence[ComplexArray]:
        return self._computed[index]

    def __len__(self) -> int:
        return len(self._computed)

    def __iter__(self) -> Iterator[ComplexArray]:
        return iter(self._computed)


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
    """A law with given values, shape (n,), at the frequencies of the sweep."""

    def law(s: ComplexArray) -> ValueAndSlopes:
        return values, ()

    return law


def resonant_cell(s: ComplexArray, inductance: Any, resonance_hz: Any, resistance: Any, series_share: Any) -> ValueAndSlopes:
    """L parallel to C, by its resonance, with the damping of R across them, a share k of it in series with L instead:
    Z = (s L + k w0^2 L^2 / R) / (1 + s L / R + s^2 / w0^2), w0 = 2 pi f0.
    """
    capacitance = 1 / ((TWO_PI * resonance_hz) ** 2 * inductance)
    capacitive = s * capacitance
    reactive = (1 / s) * (1 / inductance) + capacitive
    alone = 1 / (reactive + 1 / resistance)
    # The resistance in series that damps as much as R does across, relative to s L.
    series = (1 / s) * (1 / (capacitance * resistance))
    factor = 1 + series_share * series

    def slopes() -> tuple[ComplexArray, ...]:
        square = alone**2 * factor
        rising = alone * series * series_share
        return (
            square * reactive * (1 / inductance) + rising * (1 / inductance),
            square * capacitive * (2 / resonance_hz) + rising * (2 / resonance_hz),
            square * (1 / resistance**2) - rising * (1 / resistance),
            alone * series,
        )

    return alone * factor, Later(slopes)


def lossy_coupled_winding_factor(s: ComplexArray, coupling: Any, resonance_hz: Any, quality: Any, across_share: Any) -> ValueAndSlopes:
    """A winding coupled to La, closed by its own capacitance: 1 - k^2 s (s + g) / ((s + a) (s + g) + ww^2), a + g = ww/Q, g the share of it.

    The secondary of coupled coils with a resistance R2 = a L2 in series and a conductance g C across its capacitance.
    """
    x = (1 / s) * (TWO_PI * resonance_hz)
    damped = x * (1 / quality)
    across, along = across_share * damped, (1 - across_share) * damped
    bottom = 1 / ((1 + along) * (1 + across) + x**2)
    shape = (1 + across) * bottom
    # Slopes of numerator and denominator, both divided by s squared; the damping falls as one over Q.
    by_damping = along * (1 + across) + (1 + along) * across
    by_resonance = (across - shape * (by_damping + 2 * x**2)) * bottom
    by_quality = (shape * by_damping - across) * bottom
    by_share = (damped - shape * damped**2 * (1 - 2 * across_share)) * bottom
    squared = coupling**2
    return 1 - squared * shape, (
        shape * (-2 * coupling),
        by_resonance * (-squared / resonance_hz),
        by_quality * (-squared / quality),
        by_share * -squared,
    )


def coupled_winding_factor(s: ComplexArray, coupling: Any, resonance_hz: Any, quality: Any) -> ValueAndSlopes:
    """The same with all of its damping in its copper: 1 - k^2 s^2 / (s^2 + s ww/Q + ww^2)."""
    value, slopes = lossy_coupled_winding_factor(s, coupling, resonance_hz, quality, 0.0)
    return value, slopes[:3]


def conductance_and_capacitance(s: ComplexArray, conductance: Any, capacitance: Any) -> ValueAndSlopes:
    """Y = G + s C."""
    return conductance + s * capacitance, (_ONE, s)


def resistance_and_inductance(s: ComplexArray, resistance: Any, inductance: Any) -> ValueAndSlopes:
    """Z = R + s L."""
    return resistance + s * inductance, (_ONE, s)


def conductor(s: ComplexArray, resistance: Any, inductance: Any, skin: Any) -> ValueAndSlopes:
    """Z = R + s L + Rs sqrt(2 s / w1), w1 = 2 pi 1 MHz: Rs is the resistance that the skin effect adds at 1 MHz.

    The surface impedance of any cross-section whose penetration depth is small; for a round wire R is then a quarter of its DC resistance.
    """
    rise = np.sqrt(s) * (2 / (TWO_PI * 1e6)) ** 0.5
    return resistance + s * inductance + skin * rise, (_ONE, s, rise)


def line_series(s: ComplexArray, wave: Any, delay: Any, skin: Any) -> ValueAndSlopes:
    """Z = s Zc tau + Rs sqrt(2 s / w1): inductance and skin effect of the whole length of a line, as of `conductor`."""
    impedance, (_, by_inductance, by_skin) = conductor(s, 0.0, wave * delay, skin)
    return impedance, (by_inductance * delay, by_inductance * wave, by_skin)


def line_shunt(s: ComplexArray, wave: Any, delay: Any) -> ValueAndSlopes:
    """Z = Zc / (s tau): the capacitance of the whole length of a line."""
    inverse = 1 / (s * delay)
    return wave * inverse, (inverse, -wave * inverse * (1 / delay))


def square_law_gain(s: ComplexArray, error: Any) -> ValueAndSlopes:
    """Load error of a fixture: 1 + e (f / 30 MHz)^2."""
    shape = -((s / (TWO_PI * 30e6)) ** 2)
    return 1 + error * shape, (shape,)


def gain_step(s: ComplexArray, real_step: Any, imaginary_step: Any, frequency_hz: Any) -> ValueAndSlopes:
    """Range switching: exp(u + j v) from `frequency_hz` upwards, 1 below."""
    above = ((s.imag >= TWO_PI * frequency_hz * (1 - 1e-12)) + 0j) * np.ones_like(real_step)
    value = np.exp((real_step + 1j * imaginary_step) * above)
    return value, (value * above, 1j * value * above, 0 * value)


# A smaller share of a capacitance is replaced by this: the impedance of none is infinite.
LEAST_SHARE = 1e-15


def split_factor(s: ComplexArray, share: Any) -> ValueAndSlopes:
    """Factor on the impedance of a capacitance of which the share b is taken: 1 / b."""
    share = np.maximum(share, LEAST_SHARE)
    return 1 / share, (-1 / share**2,)


def rest_factor(s: ComplexArray, share: Any) -> ValueAndSlopes:
    """Factor on the impedance of a capacitance of which the share 1 - b is left: 1 / (1 - b)."""
    rest = np.maximum(1 - share, LEAST_SHARE)
    return 1 / rest, (1 / rest**2,)


def drift_factor(s: ComplexArray, change: Any) -> ValueAndSlopes:
    """Factor on the impedance of a capacitance that has grown by the share c: 1 / (1 + c)."""
    return 1 / (1 + change), (-1 / (1 + change) ** 2,)


def rise_factor(s: ComplexArray, change: Any) -> ValueAndSlopes:
    """Factor on a resistance that has grown by the share c: 1 + c."""
    return 1 + change, (_ONE,)


def line_tangent(s: ComplexArray, delay: Any) -> ValueAndSlopes:
    """tanh(s tau) of a lossless line; tau may be negative, because the reference plane can be shifted to either side."""
    tanh = np.tanh(s * delay)
    return tanh, (s * (1 - tanh**2),)


def resonant_branch(s: ComplexArray, capacitance: Any, resonance_hz: Any, quality: Any) -> ValueAndSlopes:
    """Series R, L, C by its resonance: Z = (1 + s/(w0 Q) + (s/w0)^2) / (s C), w0 = 2 pi f0."""
    x = s * (1 / (TWO_PI * resonance_hz))
    damped, square = x * (1 / quality), x**2
    elastance = 1 / capacitance
    inverse = (1 / s) * elastance
    impedance = inverse * (1 + damped + square)

    def slopes() -> tuple[ComplexArray, ...]:
        return impedance * -elastance, inverse * (damped + 2 * square) * (-1 / resonance_hz), inverse * damped * (-1 / quality)

    return impedance, Later(slopes)


def share_factor(s: ComplexArray, share: Any) -> ValueAndSlopes:
    """Factor on the impedance of an inductance of which the share k is taken: k."""
    return share, (_ONE,)
