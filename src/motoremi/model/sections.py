"""A winding as a chain of equal sections whose flux links their neighbours.

Section i carries J_i through copper and core and c U_i through the capacitance of its turns; its voltage is U_i = a J_i + b sum_j k^|i-j| J_j,
with a the copper's share, b the core's and k the coupling of neighbours. Every node has y to the frame, the two ends half of it. The inverse
of the matrix k^|i-j| is tridiagonal, so along the chain everything is a sum of two waves z^i with v = z + 1/z - 2 from

    k (1 + c a) v^2 - (q + c r + a k y) v + y r = 0,  q = (1 - k)^2, r = a q + b (1 - k^2),

whatever the number of sections; both ends driven alike, and driven against each other, give the two-port.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from motoremi.arrays import ComplexArray
from motoremi.model.circuit import Node, Passed, Slopes
from motoremi.model.laws import Law, ValueAndSlopes
from motoremi.model.parameter import Parameter


def linked_flux(sections: Any, coupling: Any) -> tuple[Any, Any]:
    """Sum of k^|i-j| over all pairs of sections, and its derivative for k: what shares one inductance out among them."""
    n, k = sections, coupling
    left, power = 1 - k, k**n
    total = n * (1 + k) / left - 2 * k * (1 - power) / left**2
    slope = (2 * n - 2 * (1 - power) + 2 * n * power) / left**2 - 4 * k * (1 - power) / left**3
    return total, slope


def _geometry(s: ComplexArray, sections: Any, coupling: Any) -> ValueAndSlopes:
    """Hands the coupling and the number of sections, a whole one, to the node."""
    return coupling, (np.rint(sections),)


@dataclass(frozen=True)
class _Driven:
    """The chain with its ends driven alike or against each other: the admittance of either end, and its derivatives for a, b', c, y, k."""

    admittance: ComplexArray
    slopes: Sequence[ComplexArray]


@dataclass(frozen=True)
class Sections(Node):
    """A chain of coupled sections, its far end closed by `load` or shorted, with a branch `across` from end to end.

    Parameters
    ----------
    copper, flux, turns, shunt : Node
        Of the whole winding: in series with its flux, linked by it, beside both, and to the frame.
    number, coupling : Parameter
    across, load : Node, optional
    """

    copper: Node
    flux: Node
    turns: Node
    shunt: Node
    number: Parameter
    coupling: Parameter
    across: Node | None = None
    load: Node | None = None

    @property
    def children(self) -> tuple[Node, ...]:
        return (self.copper, self.flux, self.turns, self.shunt, *(part for part in (self.across, self.load) if part is not None))

    @property
    def own_parameters(self) -> tuple[Parameter, ...]:
        return (self.number, self.coupling)

    @property
    def own_law(self) -> Law | None:
        return _geometry

    def forward(self, parts: list[ComplexArray], given: ValueAndSlopes) -> Passed:
        k, (n,) = given
        total, by_coupling = linked_flux(n, k)
        share = (1 - k**2) / total
        chain = _Chain(parts[0] / n, parts[1] * share, n / parts[2], 1 / (n * parts[3]), k, n)
        alike, against = chain.driven(alike=True), chain.driven(alike=False)
        rest = parts[4:]
        bridge = 0.0 if self.across is None else 1 / rest[0]
        load = None if self.load is None else 1 / rest[-1]
        even, odd = alike.admittance, against.admittance + 2 * bridge
        own = 0.5 * (even + odd)
        bottom = own if load is None else even * odd + own * load
        impedance = 1 / bottom if load is None else (own + load) / bottom
        kept = (chain, alike, against, even, odd, bridge, load, bottom, share, -(2 * k + share * by_coupling) / total)
        return impedance, kept

    def backward(self, parts: list[ComplexArray], given: ValueAndSlopes, impedance: ComplexArray, kept: Any) -> Slopes:
        chain, alike, against, even, odd, bridge, load, bottom, share, share_slope = kept
        if load is None:
            by_even = by_odd = -0.5 * impedance**2
        else:
            by_even = (0.5 - impedance * (odd + 0.5 * load)) / bottom
            by_odd = (0.5 - impedance * (even + 0.5 * load)) / bottom
        by_a, by_flux, by_c, by_y, by_k = (by_even * e + by_odd * o for e, o in zip(alike.slopes, against.slopes, strict=True))
        slopes = [by_a / chain.n, by_flux * share, -by_c * chain.c / parts[2], -by_y * chain.y / parts[3]]
        if self.across is not None:
            slopes.append(-2 * by_odd * bridge**2)
        if load is not None:
            slopes.append((0.5 * (odd - even) * load / bottom) ** 2)
        return slopes, (np.zeros(1, dtype=np.complex128), by_k + by_flux * parts[1] * share_slope)

    def rebuilt(self, children: tuple[Node, ...]) -> Node:
        rest = list(children[4:])
        across = rest.pop(0) if self.across is not None else None
        load = rest.pop(0) if self.load is not None else None
        return Sections(*children[:4], self.number, self.coupling, across, load)


class _Chain:
    """The two waves of a chain; names as in the module's equation, with b' = b (1 - k^2) for the flux.

    Parameters
    ----------
    a, b, c, y, k, n
        Per section, broadcast against each other.
    """

    def __init__(self, a: Any, b: Any, c: Any, y: Any, k: Any, n: Any) -> None:
        self.a, self.b, self.c, self.y, self.k, self.n = a, b, c, y, k, n
        self.loaded = 1 + c * a
        q, q_slope = (1 - k) ** 2, -2 * (1 - k)
        r = a * q + b
        middle = q + c * r + a * k * y
        root = np.sqrt(middle**2 - 4 * k * self.loaded * y * r)
        # Of the two signs the one that does not cancel.
        root = np.where((middle.conj() * root).real < 0, -root, root)
        slow, fast = 2 * y * r / (middle + root), (middle + root) / (2 * k * self.loaded)
        self.waves = (slow, fast)
        # Derivatives of the equation for a, b', c, y, k at each wave, over the derivative for v.
        self.wave_slopes = tuple(
            tuple(
                -slope / width
                for slope in (
                    k * c * v**2 - (c * q + k * y) * v + y * q,
                    y - c * v,
                    (k * a * v - r) * v,
                    r - a * k * v,
                    self.loaded * v**2 - (q_slope * self.loaded + a * y) * v + y * a * q_slope,
                )
            )
            for v, width in ((slow, -root), (fast, root))
        )
        # Of each wave the whole current over that through the copper, times q - k v; that of the second by the sum of the roots.
        bent = k * self.loaded * slow
        self.currents = (middle - a * k * y - bent, bent - a * k * y)
        slow_slopes = self.wave_slopes[0]
        bents = (
            k * (c * slow + self.loaded * slow_slopes[0]),
            k * self.loaded * slow_slopes[1],
            k * (a * slow + self.loaded * slow_slopes[2]),
            k * self.loaded * slow_slopes[3],
            self.loaded * (slow + k * slow_slopes[4]),
        )
        products = (k * y, 0.0, 0.0, a * k, a * y)
        plain = (c * q, c, r, 0.0, q_slope * self.loaded)
        self.current_slopes = (
            tuple(one - bend for one, bend in zip(plain, bents, strict=True)),
            tuple(bend - one for one, bend in zip(products, bents, strict=True)),
        )

    def driven(self, alike: bool) -> _Driven:
        """Both ends at the same voltage, or at opposite ones."""
        ratios, ratio_slopes = zip(*(self._ratio(v, alike) for v in self.waves), strict=True)
        k = self.k
        ends = [(1 - k) + (1 + k) * t for t in ratios]
        h1, h2 = self.currents
        (t1, t2), (e1, e2) = ratios, ends
        top, bottom = e2 * h1 - e1 * h2, e2 * h1 * t1 - e1 * h2 * t2
        admittance = 0.5 * self.y * top / bottom
        slopes = []
        for index in range(5):
            d1, d2 = (slope * wave[index] for slope, wave in zip(ratio_slopes, self.wave_slopes, strict=True))
            g1, g2 = (current[index] for current in self.current_slopes)
            f1, f2 = ((1 + k) * d + ((t - 1) if index == 4 else 0.0) for d, t in ((d1, t1), (d2, t2)))
            top_slope = f2 * h1 + e2 * g1 - f1 * h2 - e1 * g2
            bottom_slope = (f2 * h1 + e2 * g1) * t1 + e2 * h1 * d1 - (f1 * h2 + e1 * g2) * t2 - e1 * h2 * d2
            slope = admittance * (top_slope / top - bottom_slope / bottom)
            slopes.append(slope + admittance / self.y if index == 3 else slope)
        return _Driven(admittance, slopes)

    def _ratio(self, v: ComplexArray, alike: bool) -> tuple[ComplexArray, ComplexArray]:
        """tanh(theta/2) times tanh(n theta/2), or over it, and its derivative for v = 4 sinh(theta/2)^2."""
        sinh = np.sqrt(0.25 * v)
        cosh = np.sqrt(1 + 0.25 * v)
        half, whole = sinh / cosh, np.tanh(self.n * np.arcsinh(sinh))
        by_half, by_whole = 0.5 * (1 - half**2), 0.5 * self.n * (1 - whole**2)
        turn = 1 / (4 * sinh * cosh)
        if alike:
            return half / whole, turn * (by_half - half / whole * by_whole) / whole
        return half * whole, turn * (by_half * whole + half * by_whole)
