"""Driving-point impedance of a network at all frequencies at once, and its SPICE netlist.

Nodes with at most three neighbours are eliminated one by one (series and star-triangle rules); the rest, and all nodes of coupled
inductors, are solved by modified nodal analysis. Both are exact. Elimination is fast for ladders of hundreds of sections, and it loses no
digits because it never subtracts admittances.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.errors import BadInput
from motoremi.simulate.parts import IN, OUT, Block, Item, Network, Part

__all__ = ["Network", "impedance", "to_spice"]

# Currents are solved in units of 1 V / 1 kOhm, so that voltages and currents of a motor winding are of one size.
_UNIT_OHM = 1e3
_MOST_NEIGHBOURS = 3

_Edges = dict[str, dict[str, ComplexArray]]


def impedance(network: Network, positive: str, negative: str, frequency_hz: ArrayLike) -> ComplexArray:
    """Impedance between two nodes.

    Parameters
    ----------
    network : Network
    positive, negative : str
        The two nodes.
    frequency_hz : array_like, shape (n,)
        In hertz, above 0.

    Returns
    -------
    ndarray of complex, shape (n,)
        In ohm.

    Raises
    ------
    BadInput
        If the two nodes are the same, or not connected by parts.
    """
    frequency: FloatArray = np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
    s: ComplexArray = (2j * np.pi * frequency).astype(np.complex128)
    return _solve(network, positive, negative, s, {})


def _solve(network: Network, positive: str, negative: str, s: ComplexArray, known_blocks: dict[int, ComplexArray]) -> ComplexArray:
    if positive == negative:
        raise BadInput(f"the impedance of node {positive!r} to itself is 0: name two nodes")
    coupled = {name for coupling in network.couplings for name in (coupling.first, coupling.second)}
    inductors = [_coupled_inductor(network, name) for name in sorted(coupled)]
    edges: _Edges = {positive: {}, negative: {}}
    for inductor in inductors:
        edges.setdefault(inductor.positive, {})
        edges.setdefault(inductor.negative, {})
    keep = set(edges)
    for item in network.items:
        if item.name not in coupled and item.positive != item.negative:
            _join(edges, item.positive, item.negative, _admittance(item, s, known_blocks))
    _eliminate(edges, keep)
    _drop_other_islands(edges, inductors, positive)
    if negative not in edges:
        raise BadInput(f"no path of parts joins the nodes {positive!r} and {negative!r}")
    if not inductors and len(edges) == 2:
        return 1 / edges[positive][negative]
    return _modified_nodal(network, edges, inductors, positive, negative, s)


def _coupled_inductor(network: Network, name: str) -> Part:
    for item in network.items:
        if isinstance(item, Part) and item.name == name and item.kind == "L":
            return item
    raise BadInput(f"a coupling names {name!r}, which is no inductor of the same network")


def _admittance(item: Item, s: ComplexArray, known_blocks: dict[int, ComplexArray]) -> ComplexArray:
    if isinstance(item, Block):
        # A line repeats the same cell hundreds of times; it is solved once.
        if id(item.network) not in known_blocks:
            known_blocks[id(item.network)] = 1 / _solve(item.network, IN, OUT, s, known_blocks)
        return known_blocks[id(item.network)] / item.scale
    if item.kind == "R":
        return np.full(s.shape, 1 / item.value, dtype=np.complex128)
    return s * item.value if item.kind == "C" else 1 / (s * item.value)


def _join(edges: _Edges, first: str, second: str, admittance: ComplexArray) -> None:
    present = edges.setdefault(first, {}).get(second)
    total = admittance if present is None else present + admittance
    edges[first][second] = total
    edges.setdefault(second, {})[first] = total


def _eliminate(edges: _Edges, keep: set[str]) -> None:
    """Eliminate inner nodes with few neighbours: a star of admittances y_i becomes the mesh y_i y_j / sum(y)."""
    waiting = sorted((node for node in edges if node not in keep), key=lambda node: -len(edges[node]))
    while waiting:
        node = waiting.pop()
        if node not in edges or len(edges[node]) > _MOST_NEIGHBOURS:
            continue
        star = edges.pop(node)
        for neighbour in star:
            del edges[neighbour][node]
        if len(star) > 1:
            total = sum(star.values())
            for (first, y_first), (second, y_second) in combinations(star.items(), 2):
                _join(edges, first, second, y_first * y_second / total)
        waiting.extend(neighbour for neighbour in star if neighbour not in keep)


def _drop_other_islands(edges: _Edges, inductors: list[Part], start: str) -> None:
    """Keep the nodes that are connected to `start`, and every separate part of the network that contains a coupled inductor."""
    reached: set[str] = set()
    border = [start]
    for inductor in inductors:
        border += [inductor.positive, inductor.negative]
    through: dict[str, list[str]] = {}
    for inductor in inductors:
        through.setdefault(inductor.positive, []).append(inductor.negative)
        through.setdefault(inductor.negative, []).append(inductor.positive)
    while border:
        node = border.pop()
        if node not in reached:
            reached.add(node)
            border += [*edges[node], *through.get(node, ())]
    for node in set(edges) - reached:
        del edges[node]


def _references(edges: _Edges, inductors: list[Part], negative: str) -> set[str]:
    """One node at 0 V in every connected part of the network: `negative` in its own, any node in the others."""
    group = {node: node for node in edges}

    def root(node: str) -> str:
        while group[node] != node:
            node = group[node]
        return node

    pairs = [(node, other) for node in edges for other in edges[node]]
    pairs += [(inductor.positive, inductor.negative) for inductor in inductors]
    for first, second in pairs:
        group[root(first)] = root(second)
    chosen = {root(negative): negative}
    for node in edges:
        chosen.setdefault(root(node), node)
    return set(chosen.values())


def _modified_nodal(network: Network, edges: _Edges, inductors: list[Part], positive: str, negative: str, s: ComplexArray) -> ComplexArray:
    """Node voltages and the currents of the coupled inductors, by batched dense solution."""
    references = _references(edges, inductors, negative)
    if positive in references:
        raise BadInput(f"no path of parts joins the nodes {positive!r} and {negative!r}")
    nodes = {node: index for index, node in enumerate(node for node in edges if node not in references)}
    size = len(nodes) + len(inductors)
    matrix = np.zeros((s.size, size, size), dtype=np.complex128)
    for node, row in nodes.items():
        for other, admittance in edges[node].items():
            matrix[:, row, row] += _UNIT_OHM * admittance
            if other in nodes:
                matrix[:, row, nodes[other]] -= _UNIT_OHM * admittance
    position = {inductor.name: len(nodes) + index for index, inductor in enumerate(inductors)}
    henry = {inductor.name: inductor.value for inductor in inductors}
    for inductor in inductors:
        row = position[inductor.name]
        for node, sign in ((inductor.positive, 1.0), (inductor.negative, -1.0)):
            if node in nodes:
                matrix[:, nodes[node], row] += sign
                matrix[:, row, nodes[node]] += sign
        matrix[:, row, row] -= s * inductor.value / _UNIT_OHM
    for coupling in network.couplings:
        mutual = coupling.coefficient * math.sqrt(henry[coupling.first] * henry[coupling.second])
        first, second = position[coupling.first], position[coupling.second]
        matrix[:, first, second] -= s * mutual / _UNIT_OHM
        matrix[:, second, first] -= s * mutual / _UNIT_OHM
    drive = np.zeros((size, 1), dtype=np.complex128)
    drive[nodes[positive], 0] = _UNIT_OHM
    voltages = np.linalg.solve(matrix, drive)
    return voltages[:, nodes[positive], 0].astype(np.complex128)


def to_spice(network: Network) -> str:
    """The network as SPICE netlist lines, blocks written out in full.

    Node names keep their letters and digits; no node is the SPICE ground `0`.
    """
    return "\n".join(_spice_lines(network, "", {}, 1.0)) + "\n"


def _spice_lines(network: Network, prefix: str, ports: dict[str, str], scale: float) -> Iterator[str]:
    def node(name: str) -> str:
        return ports.get(name) or _word(prefix + name)

    for item in network.items:
        if isinstance(item, Block):
            inner = {IN: node(item.positive), OUT: node(item.negative)}
            yield from _spice_lines(item.network, f"{prefix}{item.name}_", inner, scale * item.scale)
        else:
            value = item.scaled(scale).value
            yield f"{item.kind}{_word(prefix + item.name)} {node(item.positive)} {node(item.negative)} {value:.16g}"
    for number, coupling in enumerate(network.couplings):
        first, second = (f"L{_word(prefix + name)}" for name in (coupling.first, coupling.second))
        yield f"K{_word(prefix)}{number} {first} {second} {coupling.coefficient:.16g}"


def _word(name: str) -> str:
    return re.sub(r"\W", "_", name)
