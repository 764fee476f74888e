"""Strays of an uncompensated fixture between two ports that are not across the motor or in series with it.

In the line, each end of the motor has a capacitance to ground, Y1 and Y2. The chain matrices of Y1, Z and Y2 multiplied give S21, and what
is read from it as an impedance is

    Z' = Z (1 + Z0 Y1)(1 + Z0 Y2) + Z0^2 (Y1 + Y2),

a gain and an apparent inductance Z0^2 C in series. A motor across the line is the dual of it: with the impedances Z1 and Z2 of the line at
either side

    1/Z' = (1 + Z1/Z0)(1 + Z2/Z0) / Z + (Z1 + Z2) / Z0^2,

a gain and an apparent capacitance L/Z0^2 across. Both are exact; the two sides are taken to be alike, which is of second order.
"""

from __future__ import annotations

from typing import Any

from motoremi.arrays import ComplexArray
from motoremi.data.quantity import REFERENCE_OHM
from motoremi.model.circuit import Leaf, Node, Scaled, Series, Shunted
from motoremi.model.laws import ValueAndSlopes
from motoremi.model.parameter import Parameter


def with_ground_capacitance(circuit: Node, farad: Parameter) -> Node:
    """The circuit in a line, with a capacitance to ground half of which is at either end."""
    return Series((Scaled(circuit, _gain_in_line, (farad,)), Leaf("ends to ground", _apparent_inductance, (farad,))))


def with_line_inductance(circuit: Node, henry: Parameter) -> Node:
    """The circuit across a line, with an inductance half of which is on either side."""
    return Shunted(Scaled(circuit, _gain_across_line, (henry,)), _apparent_capacitance, (henry,))


def _gain_in_line(s: ComplexArray, farad: Any) -> ValueAndSlopes:
    one = 1 + s * (REFERENCE_OHM / 2) * farad
    return one**2, (one * s * REFERENCE_OHM,)


def _apparent_inductance(s: ComplexArray, farad: Any) -> ValueAndSlopes:
    each = s * REFERENCE_OHM**2
    return each * farad, (each,)


def _gain_across_line(s: ComplexArray, henry: Any) -> ValueAndSlopes:
    one = 1 + s * henry / (2 * REFERENCE_OHM)
    return one**-2, (-s / REFERENCE_OHM * one**-3,)


def _apparent_capacitance(s: ComplexArray, henry: Any) -> ValueAndSlopes:
    each = s / REFERENCE_OHM**2
    return each * henry, (each,)
