"""A winding as a chain of equal sections that are coupled by their flux.

Section i carries the current J_i through copper and core and c U_i through the capacitance of its turns; its voltage is
U_i = a J_i + b sum_j k^|i-j| J_j, with the impedance a of the copper, b of the core, and the coupling k of neighbours. Every node has the
admittance y to the frame, the two end nodes half of it. The inverse of the matrix k^|i-j| is tridiagonal, so that voltages and currents along
the chain are sums of two waves z^i with v = z + 1/z - 2 from

    k (1 + c a) v^2 - (q + c r + a k y) v + y r = 0,  q = (1 - k)^2, r = a q + b (1 - k^2),

for any number of sections. The two-port follows from the even mode (equal voltages at both ends) and the odd mode (opposite voltages).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.model.circuit import Node, Passed, Slopes
from motoremi.model.laws import Law, ValueAndSlopes
from motoremi.model.parameter import Parameter

# A smaller coupling is replaced by this, since the equation is singular at zero.
LEAST_COUPLING = 1e-6


def linked_flux(sections: Any, coupling: Any) -> tuple[Any, Any]:
    """Sum of k^|i-j| over all pairs of sections, and its derivative with respect to k: the winding's inductance in units of a section's."""
    n, k = sections, coupling
    left, power = 1 - k, k**n
    total = n * (1 + k) / left - 2 * k * (1 - power) / left**2
    slope = (2 * n - 2 * (1 - power) + 2 * n * power) / left**2 - 4 * k * (1 - power) / left**3
    return total, slope


def _geometry(s: ComplexArray, sections: Any, coupling: Any) -> ValueAndSlopes:
    """The coupling, kept away from zero, and the number of sections as a whole number, as the law of the node."""
    return np.where(np.abs(coupling) < LEAST_COUPLING, LEAST_COUPLING, coupling), (np.rint(sections),)


@dataclass(frozen=True)
class Sections(Node):
    """A chain of coupled sections, terminated by `load` or shorted, with a branch `across` from end to end.

    If it is shorted, its frame may be connected to the far end through `back` only.

    Parameters
    ----------
    copper, flux, shunt : Node
        Totals of the whole winding: the part in series with the flux, the part that is coupled by it, and the impedance to the frame.
    number, coupling : Parameter
    turns, across, load, back : Node, optional
        In parallel with copper and flux of every section; in parallel with the whole chain; at the far end; from the frame to a shorted far end.
    """

    copper: Node
    flux: Node
    shunt: Node
    number: Parameter
    coupling: Parameter
    turns: Node | None = None
    across: Node | None = None
    load: Node | None = None
    back: Node | None = None

    @property
    def children(self) -> tuple[Node, ...]:
        return (self.copper, self.flux, self.shunt, *(part for part in self._others if part is not None))

    @property
    def _others(self) -> tuple[Node | None, ...]:
        return (self.turns, self.across, self.load, self.back)

    def _sorted(self, parts: Sequence[Any]) -> list[Any]:
        """The entries for turns, branch across, load and return out of the entries for all children; None for a missing part."""
        rest = iter(parts[3:])
        return [None if node is None else next(rest) for node in self._others]

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
        turns, across, closing, returning = self._sorted(parts)
        chain = _Chain(parts[0] / n, parts[1] * share, 0.0 if turns is None else n / turns, 1 / (n * parts[2]), k, n)
        even_mode, odd_mode = chain.mode(even=True), chain.mode(even=False)
        bridge = 0.0 if across is None else 1 / across
        load = None if closing is None else 1 / closing
        even, odd = even_mode.admittance, odd_mode.admittance + 2 * bridge
        # In the even mode both ends drive what the frame is connected through.
        passed = 1.0 if returning is None else 1 / (1 + 2 * even * returning)
        own = 0.5 * (even * passed + odd)
        bottom = own if load is None else even * odd + own * load
        impedance = 1 / bottom if load is None else (own + load) / bottom
        kept = (chain, even_mode, odd_mode, even, odd, bridge, load, bottom, passed, share, -(2 * k + share * by_coupling) / total)
        return impedance, kept

    def backward(self, parts: list[ComplexArray], given: ValueAndSlopes, impedance: ComplexArray, kept: Any) -> Slopes:
        chain, even_mode, odd_mode, even, odd, bridge, load, bottom, passed, share, share_slope = kept
        if load is None:
            by_odd = -0.5 * impedance**2
            by_even = by_odd * passed**2
        else:
            by_even = (0.5 - impedance * (odd + 0.5 * load)) / bottom
            by_odd = (0.5 - impedance * (even + 0.5 * load)) / bottom
        by_a, by_flux, by_c, by_y, by_k = chain.backward(
            *(e + o for e, o in zip(even_mode.backward(by_even), odd_mode.backward(by_odd), strict=True))
        )
        slopes = [by_a / chain.n, by_flux * share, -by_y * chain.y / parts[2]]
        if self.turns is not None:
            slopes.append(-by_c * chain.c**2 / chain.n)
        if self.across is not None:
            slopes.append(-2 * by_odd * bridge**2)
        if load is not None:
            slopes.append((0.5 * (odd - even) * load / bottom) ** 2)
        if self.back is not None:
            slopes.append((impedance * even * passed) ** 2)
        return slopes, (np.zeros(1, dtype=np.complex128), by_k + by_flux * parts[1] * share_slope)

    def rebuilt(self, children: tuple[Node, ...]) -> Node:
        copper, flux, shunt = children[:3]
        return Sections(copper, flux, shunt, self.number, self.coupling, *self._sorted(children))


class _Chain:
    """The two waves of a chain; names as in the module's equation, with b for b (1 - k^2).

    Parameters
    ----------
    a, b, c, y, k, n
        Per section, broadcast against each other.
    """

    def __init__(self, a: Any, b: Any, c: Any, y: Any, k: Any, n: Any) -> None:
        self.a, self.b, self.c, self.y, self.k, self.n = a, b, c, y, k, n
        self.loaded = 1 + c * a
        self.q = (1 - k) ** 2
        self.r = a * self.q + b
        middle = self.q + c * self.r + a * k * y
        root = np.sqrt(middle**2 - 4 * k * self.loaded * y * self.r)
        # The sign that does not cancel.
        self.root = root = np.where((middle.conj() * root).real < 0, -root, root)
        self.waves = (2 * y * self.r / (middle + root), (middle + root) / (2 * k * self.loaded))
        # For each wave, total current over current through the copper, times q - k v; for the second wave from the sum of the roots.
        bent = k * self.loaded * self.waves[0]
        self.currents = (middle - a * k * y - bent, bent - a * k * y)
        # With v = 4 sinh(theta/2)^2: tanh of theta/2 and of n theta/2, of each wave; their common sign means nothing. Adding 0 turns an imaginary
        # part of -0 into +0: for a wave below -4 it would select the other side of the branch cut of `sqrt`.
        quarters = [0.25 * v + 0.0 for v in self.waves]
        self.squared_cosh = [1 + quarter for quarter in quarters]
        self.half = [np.sqrt(quarter / square) for quarter, square in zip(quarters, self.squared_cosh, strict=True)]
        self.whole = [_tanh_of_multiple(half, n) for half in self.half]

    def backward(self, by_v1: Any, by_v2: Any, by_h1: Any, by_h2: Any, by_y: Any, by_k: Any) -> tuple[Any, Any, Any, Any, Any]:
        """Derivatives with respect to a, b, c, y, k from those with respect to the waves v, the currents h, and y and k at constant v and h."""
        a, c, y, k, q, r, loaded, v1, v2 = self.a, self.c, self.y, self.k, self.q, self.r, self.loaded, *self.waves
        q_slope = -2 * (1 - k)
        by_bent = by_h2 - by_h1
        by_first = (by_v1 + by_bent * (k * loaded)) / self.root
        by_second = -by_v2 / self.root
        # Sums over both waves, which are roots of one equation: of v^0, v^1, v^2.
        first, second = by_first * v1, by_second * v2
        none, once, twice = by_first + by_second, first + second, first * v1 + second * v2
        bent = by_bent * v1 + twice
        return (
            k * c * bent - (c * q + k * y) * once + (y * q) * none + (c * q) * by_h1 - (k * y) * by_h2,
            y * none - c * once + c * by_h1,
            (k * a) * bent - r * once + r * by_h1,
            r * none - (a * k) * (once + by_h2) + by_y,
            loaded * bent - (q_slope * loaded + a * y) * once + (y * a * q_slope) * none + (q_slope * loaded) * by_h1 - (a * y) * by_h2 + by_k,
        )

    def mode(self, even: bool) -> _Mode:
        """Both ends at the same voltage (even), or at opposite voltages (odd)."""
        return _Mode(self, even)


def _tanh_of_multiple(tanh: ComplexArray, n: FloatArray) -> ComplexArray:
    """tanh(n x) from tanh(x) for whole numbers n > 0.

    By doubling and adding arguments, as n is written in binary: a few divisions instead of hyperbolic functions, which take ten times as long.
    """
    bits: np.ndarray = n.astype(np.intp)
    result: ComplexArray = np.zeros_like(tanh)
    power = tanh
    while True:
        odd = (bits & 1).astype(np.bool_)
        if odd.any():
            result = np.where(odd, (result + power) / (1 + result * power), result)
        bits = bits >> 1
        if not bits.any():
            return result
        power = 2 * power / (1 + power**2)


class _Mode:
    """The admittance of either end in the even or the odd mode, and its derivatives with respect to a, b, c, y, k."""

    def __init__(self, chain: _Chain, even: bool) -> None:
        self.chain, self.even, k = chain, even, chain.k
        # tanh(theta/2) divided by tanh(n theta/2) in the even mode, times it in the odd mode.
        self.ratios = [half / whole if even else half * whole for half, whole in zip(chain.half, chain.whole, strict=True)]
        self.ends = [(1 - k) + (1 + k) * t for t in self.ratios]
        (h1, h2), (t1, t2), (e1, e2) = chain.currents, self.ratios, self.ends
        self.top, self.bottom = e2 * h1 - e1 * h2, e2 * h1 * t1 - e1 * h2 * t2
        self.admittance = 0.5 * chain.y * self.top / self.bottom

    def _turns(self) -> list[ComplexArray]:
        """Derivatives of the ratios with respect to v."""
        found, chain = [], self.chain
        for square, half, whole in zip(chain.squared_cosh, chain.half, chain.whole, strict=True):
            by_half, by_whole = 0.5 * (1 - half**2), 0.5 * chain.n * (1 - whole**2)
            turn = (by_half - half / whole * by_whole) / whole if self.even else by_half * whole + half * by_whole
            found.append(turn / (4 * half * square))
        return found

    def backward(self, by: Any) -> tuple[Any, Any, Any, Any, Any, Any]:
        """`by` times the derivatives of the admittance with respect to the waves, the currents, y and k: what `_Chain.backward` takes."""
        k, (h1, h2), (t1, t2), (e1, e2) = self.chain.k, self.chain.currents, self.ratios, self.ends
        turn1, turn2 = self._turns()
        weighted = by * self.admittance
        by_top, by_bottom = weighted / self.top, -weighted / self.bottom
        up1, up2 = by_top + by_bottom * t1, by_top + by_bottom * t2
        by_h1, by_h2 = e2 * up1, -e1 * up2
        by_e1, by_e2 = -h2 * up2, h1 * up1
        by_v1 = (by_bottom * e2 * h1 + (1 + k) * by_e1) * turn1
        by_v2 = ((1 + k) * by_e2 - by_bottom * e1 * h2) * turn2
        return by_v1, by_v2, by_h1, by_h2, weighted / self.chain.y, by_e1 * (t1 - 1) + by_e2 * (t2 - 1)
