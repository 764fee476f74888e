"""A circuit is a value: leaves are laws, inner nodes compose them.

`Tape` evaluates a circuit for a whole batch of parameter sets at all frequencies. One pass forward gives the impedance
of every node; one pass backward carries dZ/dZ_node down to the leaves, where it meets the exact derivative of each law.
All quantities are holomorphic, so complex derivatives suffice.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.model.laws import Law, ValueAndSlopes
from motoremi.model.parameter import Parameter

# Derivatives for each child's impedance (None stands for one) and for each own parameter.
Slopes: TypeAlias = tuple[Sequence[Any], Sequence[Any]]
# A node's impedance, and what the way back wants of the way there.
Passed: TypeAlias = tuple[ComplexArray, Any]


@dataclass(frozen=True)
class Node:
    """Common face of all circuit parts.

    `given` is what the node's law gives (value and slopes), worked out once for both passes; nodes without a law ignore it. `kept` is what
    the forward pass hands to the backward one.
    """

    @property
    def own_law(self) -> Law | None:
        """Law of this node, if it has one."""
        return None

    @property
    def children(self) -> tuple[Node, ...]:
        """Parts of this one."""
        return ()

    @property
    def own_parameters(self) -> tuple[Parameter, ...]:
        """Parameters of this node alone."""
        return ()

    def forward(self, parts: list[ComplexArray], given: ValueAndSlopes) -> Passed:
        """Impedance in ohm from the impedances of the children."""
        raise NotImplementedError

    def backward(self, parts: list[ComplexArray], given: ValueAndSlopes, impedance: ComplexArray, kept: Any) -> Slopes:
        """Derivatives for each child's impedance and for each own parameter."""
        raise NotImplementedError

    def rebuilt(self, children: tuple[Node, ...]) -> Node:
        """The same node over other children."""
        return self


@dataclass(frozen=True)
class Leaf(Node):
    """One element: a law of impedance and its parameters."""

    name: str
    law: Law
    parameters: tuple[Parameter, ...]

    @property
    def own_parameters(self) -> tuple[Parameter, ...]:
        return self.parameters

    @property
    def own_law(self) -> Law | None:
        return self.law

    def forward(self, parts: list[ComplexArray], given: ValueAndSlopes) -> Passed:
        return given[0], None

    def backward(self, parts: list[ComplexArray], given: ValueAndSlopes, impedance: ComplexArray, kept: Any) -> Slopes:
        return (), given[1]


@dataclass(frozen=True)
class Series(Node):
    """Sum of impedances."""

    members: tuple[Node, ...]

    @property
    def children(self) -> tuple[Node, ...]:
        return self.members

    def forward(self, parts: list[ComplexArray], given: ValueAndSlopes) -> Passed:
        total = parts[0]
        for part in parts[1:]:
            total = total + part
        return total, None

    def backward(self, parts: list[ComplexArray], given: ValueAndSlopes, impedance: ComplexArray, kept: Any) -> Slopes:
        return [None] * len(parts), ()  # None stands for a derivative of one

    def rebuilt(self, children: tuple[Node, ...]) -> Node:
        return Series(children)


@dataclass(frozen=True)
class Parallel(Node):
    """Sum of admittances."""

    members: tuple[Node, ...]

    @property
    def children(self) -> tuple[Node, ...]:
        return self.members

    def forward(self, parts: list[ComplexArray], given: ValueAndSlopes) -> Passed:
        admittances = [1 / part for part in parts]
        total = admittances[0]
        for admittance in admittances[1:]:
            total = total + admittance
        return 1 / total, admittances

    def backward(self, parts: list[ComplexArray], given: ValueAndSlopes, impedance: ComplexArray, kept: Any) -> Slopes:
        return [(impedance * admittance) ** 2 for admittance in kept], ()

    def rebuilt(self, children: tuple[Node, ...]) -> Node:
        return Parallel(children)


@dataclass(frozen=True)
class Wrapped(Node):
    """One part behind a law that has parameters of its own."""

    child: Node
    law: Law
    parameters: tuple[Parameter, ...]

    @property
    def children(self) -> tuple[Node, ...]:
        return (self.child,)

    @property
    def own_parameters(self) -> tuple[Parameter, ...]:
        return self.parameters

    @property
    def own_law(self) -> Law | None:
        return self.law

    def rebuilt(self, children: tuple[Node, ...]) -> Node:
        return dataclasses.replace(self, child=children[0])


@dataclass(frozen=True)
class Scaled(Wrapped):
    """Impedance times a dispersive factor: Z = Z_child g(s)."""

    def forward(self, parts: list[ComplexArray], given: ValueAndSlopes) -> Passed:
        return parts[0] * given[0], None

    def backward(self, parts: list[ComplexArray], given: ValueAndSlopes, impedance: ComplexArray, kept: Any) -> Slopes:
        factor, slopes = given
        return [factor], [parts[0] * slope for slope in slopes]


@dataclass(frozen=True)
class Shunted(Wrapped):
    """Impedance with an admittance across it: Z = Z_child / (1 + Y Z_child). Y may be zero or negative."""

    def forward(self, parts: list[ComplexArray], given: ValueAndSlopes) -> Passed:
        divided = 1 / (1 + given[0] * parts[0])
        return parts[0] * divided, divided

    def backward(self, parts: list[ComplexArray], given: ValueAndSlopes, impedance: ComplexArray, kept: Any) -> Slopes:
        square = -(impedance**2)
        return [kept**2], [square * slope for slope in given[1]]


@dataclass(frozen=True)
class ThroughCable(Wrapped):
    """Impedance seen through a lossless line of 50 ohm whose tanh(s tau) the law gives."""

    REFERENCE_OHM: ClassVar[float] = 50.0

    def forward(self, parts: list[ComplexArray], given: ValueAndSlopes) -> Passed:
        tangent, z0 = given[0], self.REFERENCE_OHM
        bottom = 1 / (z0 + parts[0] * tangent)
        return z0 * (parts[0] + z0 * tangent) * bottom, bottom

    def backward(self, parts: list[ComplexArray], given: ValueAndSlopes, impedance: ComplexArray, kept: Any) -> Slopes:
        tangent, slopes = given
        z0 = self.REFERENCE_OHM
        square = kept**2
        by_tangent = z0 * (z0**2 - parts[0] ** 2) * square
        return [z0**2 * (1 - tangent**2) * square], [by_tangent * slope for slope in slopes]


@dataclass(frozen=True)
class Line(Node):
    """Uniform line with total series impedance `series` and total shunt impedance `shunt`, its far end closed by `load` or shorted.

    With a = Z_series, y = 1/Z_shunt, u = a y and T(u) = tanh(sqrt u)/sqrt u, its input is (Z_load + a T) / (1 + Z_load y T).
    """

    series: Node
    shunt: Node
    load: Node | None = None

    @property
    def children(self) -> tuple[Node, ...]:
        return (self.series, self.shunt) if self.load is None else (self.series, self.shunt, self.load)

    @staticmethod
    def _tangent(u: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """T(u) and dT/du; a power series where the closed form would cancel."""
        small = np.abs(u) < 1e-2
        root = np.sqrt(np.where(small, 1.0, u))
        tanh = np.tanh(root)
        value = tanh / root
        slope = (1 - tanh**2 - value) / (2 * root**2)
        if np.any(small):
            few = u[small]
            value[small] = 1 + few * (-1 / 3 + few * (2 / 15 + few * (-17 / 315 + few * 62 / 2835)))
            slope[small] = -1 / 3 + few * (4 / 15 + few * (-17 / 105 + few * (248 / 2835 - few * 1382 / 31185)))
        return value, slope

    def forward(self, parts: list[ComplexArray], given: ValueAndSlopes) -> Passed:
        a, y = parts[0], 1 / parts[1]
        t, dt = self._tangent(a * y)
        if self.load is None:
            return a * t, (y, t, dt, None)
        bottom = 1 / (1 + parts[2] * y * t)
        return (parts[2] + a * t) * bottom, (y, t, dt, bottom)

    def backward(self, parts: list[ComplexArray], given: ValueAndSlopes, impedance: ComplexArray, kept: Any) -> Slopes:
        a, (y, t, dt, bottom) = parts[0], kept
        u = a * y
        turn = t + u * dt
        y_by_shunt, bent = -(y**2), a**2 * dt
        if self.load is None:
            return [turn, bent * y_by_shunt], ()
        load = impedance * parts[2]
        by_a = (turn - load * y**2 * dt) * bottom
        by_y = (bent - load * turn) * bottom
        return [by_a, by_y * y_by_shunt, (1 - u * t**2) * bottom**2], ()

    def rebuilt(self, children: tuple[Node, ...]) -> Node:
        return Line(*children)


def walk(node: Node) -> Iterator[Node]:
    """All nodes of a circuit, children before their parent."""
    for child in node.children:
        yield from walk(child)
    yield node


def replace_leaf(node: Node, name: str, change: Callable[[Node], Node]) -> Node:
    """The circuit with the element called `name` replaced by `change(element)`."""
    if isinstance(node, Leaf):
        return change(node) if node.name == name else node
    return node.rebuilt(tuple(replace_leaf(child, name, change) for child in node.children))


def find(node: Node, name: str) -> Node | None:
    """The element called `name`, or None."""
    return next((part for part in walk(node) if isinstance(part, Leaf) and part.name == name), None)


class Tape:
    """A circuit made ready for fast evaluation.

    Parameters
    ----------
    root : Node
    names : sequence of str
        Order of the parameters in the vectors that the methods take.
    """

    def __init__(self, root: Node, names: Sequence[str]) -> None:
        position = {name: index for index, name in enumerate(names)}
        self._steps: list[tuple[Node, Law | None, tuple[int, ...], tuple[int, ...]]] = []
        self._record(root, position)

    def _record(self, node: Node, position: dict[str, int]) -> int:
        children = tuple(self._record(child, position) for child in node.children)
        self._steps.append((node, node.own_law, children, tuple(position[p.name] for p in node.own_parameters)))
        return len(self._steps) - 1

    def forward(self, s: ComplexArray, values: FloatArray) -> tuple[ComplexArray, list[Any]]:
        """Impedance in ohm, shape (..., n), for parameter values of shape (..., p) in SI units; and what `backward` needs."""
        columns = np.moveaxis(values, -1, 0)[..., None]
        computed: list[ComplexArray] = []
        trace: list[Any] = []
        for node, law, children, indices in self._steps:
            given = _NOTHING if law is None else law(s, *[columns[index] for index in indices])
            parts = [computed[child] for child in children]
            impedance, kept = node.forward(parts, given)
            computed.append(impedance)
            trace.append((parts, given, impedance, kept))
        return self._whole(computed[-1], s, values), trace

    def backward(self, trace: list[Any], seed: ComplexArray, into: Sequence[ComplexArray | None]) -> None:
        """Add `seed`, shape (..., n), times the derivative of the impedance for each parameter to `into`.

        `into` holds zeros of shape (..., n) for each parameter, None for what is not wanted.
        """
        sensitivity: list[ComplexArray] = [seed] * len(self._steps)
        written: set[int] = set()
        for index in range(len(self._steps) - 1, -1, -1):
            node, _, children, indices = self._steps[index]
            by_child, by_parameter = node.backward(*trace[index])
            own = sensitivity[index]
            for child, slope in zip(children, by_child, strict=True):
                sensitivity[child] = own if slope is None else own * slope
            for position, slope in zip(indices, by_parameter, strict=True):
                target = into[position]
                if target is None:
                    continue
                if position in written:  # an element may occur twice
                    target += own * slope
                else:
                    np.multiply(own, slope, out=target)
                    written.add(position)

    def impedance(self, s: ComplexArray, values: FloatArray) -> ComplexArray:
        """Impedance in ohm, shape (..., n), for parameter values of shape (..., p) in SI units."""
        return self.forward(s, values)[0]

    def gradient(self, s: ComplexArray, values: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Impedance, shape (..., n), and its derivative for each parameter, shape (..., p, n)."""
        impedance, trace = self.forward(s, values)
        gradient = np.zeros((*values.shape, s.size), dtype=np.complex128)
        self.backward(trace, np.ones_like(impedance), list(np.moveaxis(gradient, -2, 0)))
        return impedance, gradient

    @staticmethod
    def _whole(impedance: ComplexArray, s: ComplexArray, values: FloatArray) -> ComplexArray:
        """At every frequency, even if it depends on none."""
        if impedance.shape == (*values.shape[:-1], s.size) and impedance.dtype == np.complex128:
            return impedance
        return np.asarray(np.broadcast_to(impedance, (*values.shape[:-1], s.size)), dtype=np.complex128)


_NOTHING: ValueAndSlopes = (np.zeros(0, dtype=np.complex128), ())
