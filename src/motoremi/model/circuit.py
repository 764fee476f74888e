"""Circuits as immutable trees: leaves are immittance laws, inner nodes combine them.

`Tape` evaluates a circuit for a batch of parameter sets at all frequencies. A forward pass computes the impedance of every node; a backward
pass carries dZ/dZ_node down to the leaves and multiplies it by the exact derivative of each law (reverse-mode differentiation).
All functions are holomorphic, so complex derivatives suffice.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.model.laws import Law, ValueAndSlopes, capacitor
from motoremi.model.parameter import Parameter

# Derivatives with respect to each child's impedance (None stands for one) and to each own parameter.
Slopes: TypeAlias = tuple[Sequence[Any], Sequence[Any]]
# A node's impedance, and the values that its backward pass needs.
Passed: TypeAlias = tuple[ComplexArray, Any]


@dataclass(frozen=True)
class Node:
    """Interface of all circuit parts.

    `given` is the result of the node's law (value and slopes), computed once for both passes; nodes without a law ignore it. `kept` holds the
    values that the forward pass keeps for the backward pass.
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
        """Derivatives with respect to each child's impedance and to each own parameter."""
        raise NotImplementedError

    def rebuilt(self, children: tuple[Node, ...]) -> Node:
        """The same node with other children."""
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
        if len(parts) == 2:  # one division instead of three: a division takes as long as five products
            inverse = 1 / (parts[0] + parts[1])
            share = parts[1] * inverse
            return parts[0] * share, (share, inverse)
        admittances = [1 / part for part in parts]
        return 1 / sum(admittances[1:], start=admittances[0]), admittances

    def backward(self, parts: list[ComplexArray], given: ValueAndSlopes, impedance: ComplexArray, kept: Any) -> Slopes:
        # Each branch's share of the current, squared.
        if len(parts) == 2:
            share, inverse = kept
            return [share**2, (parts[0] * inverse) ** 2], ()
        return [(impedance * admittance) ** 2 for admittance in kept], ()

    def rebuilt(self, children: tuple[Node, ...]) -> Node:
        return Parallel(children)


@dataclass(frozen=True)
class Wrapped(Node):
    """One part that is changed by a law with parameters of its own."""

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
class Superposed(Node):
    """One element with several laws of its material: the changes that each law alone would make are added.

    For a capacitance they are added in the admittance (each mechanism polarises independently), otherwise in the impedance (each mechanism
    takes up flux or dissipates power independently). A product of the laws could turn the phase further than a passive part can.
    """

    element: Node
    changed: tuple[Node, ...]
    in_admittance: bool

    @property
    def children(self) -> tuple[Node, ...]:
        return (self.element, *self.changed)

    def forward(self, parts: list[ComplexArray], given: ValueAndSlopes) -> Passed:
        more = len(self.changed) - 1
        if not self.in_admittance:
            return sum(parts[1:]) - more * parts[0], None
        admittances = [1 / part for part in parts]
        return 1 / (sum(admittances[1:]) - more * admittances[0]), admittances

    def backward(self, parts: list[ComplexArray], given: ValueAndSlopes, impedance: ComplexArray, kept: Any) -> Slopes:
        shares = [-float(len(self.changed) - 1), *[1.0] * len(self.changed)]
        if not self.in_admittance:
            return [np.full(1, share, dtype=np.complex128) for share in shares], ()
        return [share * (impedance * admittance) ** 2 for share, admittance in zip(shares, kept, strict=True)], ()

    def rebuilt(self, children: tuple[Node, ...]) -> Node:
        return dataclasses.replace(self, element=children[0], changed=children[1:])


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
    """Impedance at the input of a lossless 50 ohm line; the law gives tanh(s tau)."""

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
    """Uniform line with total series impedance `series` and total shunt impedance `shunt`, terminated by `load` or shorted.

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
        value: ComplexArray = np.asarray(tanh / root, dtype=np.complex128)
        slope: ComplexArray = np.asarray((1 - tanh**2 - value) / (2 * root**2), dtype=np.complex128)
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


@dataclass(frozen=True)
class FloatingLine(Node):
    """A uniform line as `Line`, its far end shorted to the analyser, its return (the motor's frame) connected to it through `back` only.

    In the odd mode, opposite voltages at its ends, no current flows through `back`; in the even mode both ends drive it. With u and T of
    `Line` taken at u / 4, the input is Z_series T in parallel with 4 (Z_shunt / T + Z_back).
    """

    series: Node
    shunt: Node
    back: Node

    @property
    def children(self) -> tuple[Node, ...]:
        return (self.series, self.shunt, self.back)

    def forward(self, parts: list[ComplexArray], given: ValueAndSlopes) -> Passed:
        a, y = parts[0], 1 / parts[1]
        t, dt = Line._tangent(0.25 * a * y)
        odd, even = a * t, 4 * (parts[1] / t + parts[2])
        share = even / (odd + even)
        return odd * share, (y, t, dt, share)

    def backward(self, parts: list[ComplexArray], given: ValueAndSlopes, impedance: ComplexArray, kept: Any) -> Slopes:
        a, (y, t, dt, share) = parts[0], kept
        by_odd, by_even = share**2, (1 - share) ** 2
        # With respect to u / 4, which goes with the series impedance and against the shunt impedance.
        by_quarter = by_odd * a * dt - by_even * 4 * parts[1] * dt / t**2
        return [by_odd * t + by_quarter * 0.25 * y, by_even * 4 / t - by_quarter * 0.25 * a * y**2, 4 * by_even], ()

    def rebuilt(self, children: tuple[Node, ...]) -> Node:
        return FloatingLine(*children)


@dataclass(frozen=True)
class Bridged(Node):
    """A uniform line as `Line`, terminated by `load`, with a branch `across` it from end to end.

    With y = 1/Z_shunt and u = Z_series y = theta^2, its admittances are (theta coth(theta) + Z_series/Z_across)/Z_series at either end and
    -(theta/sinh(theta) + Z_series/Z_across)/Z_series between them.
    """

    series: Node
    shunt: Node
    across: Node
    load: Node

    @property
    def children(self) -> tuple[Node, ...]:
        return (self.series, self.shunt, self.across, self.load)

    @staticmethod
    def _ends(u: ComplexArray) -> tuple[ComplexArray, ComplexArray, ComplexArray, ComplexArray, ComplexArray]:
        """theta coth(theta), theta/sinh(theta), their difference, and the derivatives of the two with respect to u.

        For small u power series are used, because the closed forms would cancel.
        """
        small = np.abs(u) < 1e-3
        theta = np.sqrt(np.where(small, 1.0, u))
        once = np.exp(-theta)
        less = 1 - once**2
        coth, inverse = (1 + once**2) / less, 2 * once / less
        here, between, difference = theta * coth, theta * inverse, theta * (1 - once) / (1 + once)
        here_slope, between_slope = 0.5 * (coth / theta - inverse**2), 0.5 * inverse * (1 / theta - coth)
        if np.any(small):
            few = u[small]
            here[small], here_slope[small] = 1 + few * (1 / 3 - few / 45), 1 / 3 + few * (-2 / 45 + few * 2 / 315)
            between[small], between_slope[small] = 1 + few * (-1 / 6 + few * 7 / 360), -1 / 6 + few * (7 / 180 - few * 31 / 5040)
            difference[small] = few * (1 / 2 + few * (-1 / 24 + few / 240))
        return here, between, difference, here_slope, between_slope

    def forward(self, parts: list[ComplexArray], given: ValueAndSlopes) -> Passed:
        a, y = parts[0], 1 / parts[1]
        inverse, bridge, load = 1 / a, 1 / parts[2], 1 / parts[3]
        ends = self._ends(a * y)
        own, through = ends[0] * inverse + bridge, ends[1] * inverse + bridge
        bottom = own + load
        # own - through^2 / bottom, without subtracting nearly equal numbers.
        impedance = bottom / (ends[2] * inverse * (own + through) + own * load)
        return impedance, (y, inverse, bridge, load, ends, through / bottom)

    def backward(self, parts: list[ComplexArray], given: ValueAndSlopes, impedance: ComplexArray, kept: Any) -> Slopes:
        y, inverse, bridge, load, (here, between, _, here_slope, between_slope), passed = kept
        turn = -(impedance**2)
        by_own, by_through = turn * (1 + passed**2), -2 * turn * passed
        by_y = by_own * here_slope + by_through * between_slope
        by_a = (by_own * (here_slope * y - here * inverse) + by_through * (between_slope * y - between * inverse)) * inverse
        by_bridge = turn * (1 - passed) ** 2
        return [by_a, -by_y * y**2, -by_bridge * bridge**2, -turn * (passed * load) ** 2], ()

    def rebuilt(self, children: tuple[Node, ...]) -> Node:
        return Bridged(*children)


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


def replace_element(node: Node, name: str, change: Callable[[Node], Node]) -> Node:
    """The circuit with the element called `name`, together with all laws of its material, replaced by `change(element)`."""
    if is_element(node, name):
        return change(node)
    return node.rebuilt(tuple(replace_element(child, name, change) for child in node.children)) if node.children else node


def is_element(node: Node, name: str) -> bool:
    """Whether a node is the element called `name`, with or without laws of its material."""
    while isinstance(node, (Scaled, Superposed)):
        node = node.children[0]
    return isinstance(node, Leaf) and node.name == name


def with_law(node: Node, law: Law, parameters: tuple[Parameter, ...]) -> Node:
    """An element with one more law of its material, which scales its impedance."""
    element = node
    while not isinstance(element, Leaf):
        element = element.children[0]
    changed = Scaled(element, law, parameters)
    if element is node:
        return changed
    before = node.changed if isinstance(node, Superposed) else (node,)
    return Superposed(element, (*before, changed), in_admittance=element.law is capacitor)


def find(node: Node, name: str) -> Node | None:
    """The element called `name`, or None."""
    return next((part for part in walk(node) if isinstance(part, Leaf) and part.name == name), None)


@dataclass(eq=False)
class _Step:
    """A node of a tape: the steps of its children, the indices of its parameters, and the first and last root that it belongs to."""

    node: Node
    law: Law | None
    children: tuple[int, ...]
    indices: tuple[int, ...]
    first: int
    last: int


class Tape:
    """One or more circuits prepared for fast evaluation.

    Parts that consecutive circuits share, such as the winding in the short-circuit and in the open-circuit sweep, are computed once.

    Parameters
    ----------
    roots : Node or sequence of Node
    names : sequence of str
        Order of the parameters in the vectors that the methods take.
    sizes : sequence of int, optional
        Number of frequencies that belong to each root, in order. A single root has all.
    """

    def __init__(self, roots: Node | Sequence[Node], names: Sequence[str], sizes: Sequence[int] = ()) -> None:
        position = {name: index for index, name in enumerate(names)}
        self._steps: list[_Step] = []
        self._roots: list[int] = []
        known: dict[int, int] = {}
        for number, root in enumerate((roots,) if isinstance(roots, Node) else roots):
            self._roots.append(self._record(root, position, number, known))
            known = {id(step.node): index for index, step in enumerate(self._steps) if step.last == number}
        self._edges = np.concatenate([[0], np.cumsum(sizes, dtype=np.intp)])
        self._spans = [self._span(step.first, step.last) for step in self._steps]
        self._widths = [span.stop - span.start if sizes else None for span in self._spans]
        self._cuts = [tuple(self._cut(step.first, step.last, child) for child in step.children) for step in self._steps]
        self._root_spans = [self._span(number, number) for number in range(len(self._roots))]
        self._root_cuts = [self._cut(number, number, root) for number, root in enumerate(self._roots)]

    def _record(self, node: Node, position: dict[str, int], root: int, known: dict[int, int]) -> int:
        if (index := known.get(id(node))) is not None and self._shared(index, root):
            return index
        children = tuple(self._record(child, position, root, known) for child in node.children)
        self._steps.append(_Step(node, node.own_law, children, tuple(position[p.name] for p in node.own_parameters), root, root))
        return len(self._steps) - 1

    def _shared(self, index: int, root: int) -> bool:
        """Share a step and all steps below it with one more root. Not possible if the root has one already: each occurrence needs a step."""
        below = [self._steps[index]]
        for step in below:
            below.extend(self._steps[child] for child in step.children)
        if any(step.last != root - 1 for step in below):
            return False
        for step in below:
            step.last = root
        return True

    def _span(self, first: int, last: int) -> slice:
        """The frequencies of the roots from `first` to `last`, as a slice of all."""
        return slice(int(self._edges[first]), int(self._edges[last + 1])) if self._edges.size > 1 else slice(None)

    def _cut(self, first: int, last: int, step: int) -> slice | None:
        """The frequencies of the roots from `first` to `last`, as a slice of those of a step; None for all."""
        theirs = self._steps[step]
        if (theirs.first, theirs.last) == (first, last):
            return None
        start = self._edges[theirs.first]
        return slice(int(self._edges[first] - start), int(self._edges[last + 1] - start))

    def forward(self, s: ComplexArray, values: FloatArray) -> tuple[ComplexArray, list[Any]]:
        """Impedance in ohm, shape (..., n), for parameter values of shape (..., p) in SI units; and the trace that `backward` needs."""
        columns = values.transpose(-1, *range(values.ndim - 1))[..., None]
        computed: list[ComplexArray] = []
        trace: list[Any] = []
        for step, span, cuts in zip(self._steps, self._spans, self._cuts, strict=True):
            given = _NOTHING if step.law is None else step.law(s[span], *[columns[index] for index in step.indices])
            parts = [_within(computed[child], cut) for child, cut in zip(step.children, cuts, strict=True)]
            impedance, kept = step.node.forward(parts, given)
            computed.append(impedance)
            trace.append((parts, given, impedance, kept))
        joined = np.empty((*values.shape[:-1], s.size), dtype=np.complex128)
        for root, span, cut in zip(self._roots, self._root_spans, self._root_cuts, strict=True):
            joined[..., span] = _within(computed[root], cut)
        return joined, trace

    def backward(self, trace: list[Any], seed: ComplexArray, into: Sequence[ComplexArray | None]) -> None:
        """Write `seed`, shape (..., n), times the derivative of the impedance with respect to each parameter into `into`.

        `into` holds an array of zeros of shape (..., n) for each parameter, or None if its derivative is not needed.
        """
        sensitivity: list[Any] = [None] * len(self._steps)

        def give(index: int, cut: slice | None, value: ComplexArray) -> None:
            if cut is None:
                sensitivity[index] = value
                return
            if sensitivity[index] is None:
                sensitivity[index] = np.empty((*seed.shape[:-1], self._widths[index]), dtype=np.complex128)
            sensitivity[index][..., cut] = value

        for root, span, cut in zip(self._roots, self._root_spans, self._root_cuts, strict=True):
            give(root, cut, seed[..., span])
        written: set[int] = set()
        for index in range(len(self._steps) - 1, -1, -1):
            step, own = self._steps[index], sensitivity[index]
            by_child, by_parameter = step.node.backward(*trace[index])
            for child, cut, slope in zip(step.children, self._cuts[index], by_child, strict=True):
                give(child, cut, own if slope is None else own * slope)
            for position, slope in zip(step.indices, by_parameter, strict=True):
                target = into[position]
                if target is None:
                    continue
                if position in written:  # an element may occur more than once
                    target[..., self._spans[index]] += own * slope
                else:
                    np.multiply(own, slope, out=target[..., self._spans[index]])
                    written.add(position)

    def impedance(self, s: ComplexArray, values: FloatArray) -> ComplexArray:
        """Impedance in ohm, shape (..., n), for parameter values of shape (..., p) in SI units."""
        return self.forward(s, values)[0]

    def gradient(self, s: ComplexArray, values: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Impedance, shape (..., n), and its derivative with respect to each parameter, shape (..., p, n)."""
        impedance, trace = self.forward(s, values)
        gradient = np.zeros((*values.shape, s.size), dtype=np.complex128)
        self.backward(trace, np.ones_like(impedance), list(np.moveaxis(gradient, -2, 0)))
        return impedance, gradient


def _within(values: ComplexArray, cut: slice | None) -> ComplexArray:
    """Values at the frequencies of a slice; values that do not depend on frequency are returned unchanged."""
    return values if cut is None or values.shape[-1] == 1 else values[..., cut]


_NOTHING: ValueAndSlopes = (np.zeros(0, dtype=np.complex128), ())
