"""Parts of a motor's circuit: an element with all effects on it, and its replacement by another part."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

from motoremi.model.circuit import Leaf, Node, walk
from motoremi.model.motor import BASE_PARAMETERS, Motor

ELEMENTS = tuple(p.name for p in BASE_PARAMETERS)


def whole_element(motor: Motor, name: str) -> Node:
    """The element with every effect on it: the outermost part that contains no other element of the paper's circuit."""
    others = {p for p in ELEMENTS if p != name}

    def this_alone(node: Node) -> bool:
        leaves = {part.name for part in walk(node) if isinstance(part, Leaf)}
        return name in leaves and not leaves & others

    # Parents come after their children.
    return [node for root in (motor.winding, motor.frame) for node in walk(root) if this_alone(node)][-1]


def with_element(motor: Motor, name: str, change: Callable[[Node], Node]) -> Motor:
    """The motor with an element and the effects on it changed as a whole."""
    whole = whole_element(motor, name)
    new = change(whole)
    return dataclasses.replace(motor, winding=substituted(motor.winding, whole, new), frame=substituted(motor.frame, whole, new))


def outermost(node: Node, prefix: str) -> list[Node]:
    """The largest parts all of whose parameters belong to an effect."""
    names = [p.name for part in walk(node) for p in part.own_parameters]
    if names and all(name.startswith(prefix) for name in names):
        return [node]
    return [part for child in node.children for part in outermost(child, prefix)]


def distinct(nodes: Sequence[Node]) -> list[Node]:
    """Each node once: one element may occur in several places."""
    return [node for index, node in enumerate(nodes) if node not in nodes[:index]]


def substituted(node: Node, target: Node, replacement: Node) -> Node:
    """The circuit with a part replaced wherever it occurs."""
    if node == target:
        return replacement
    return node.rebuilt(tuple(substituted(child, target, replacement) for child in node.children)) if node.children else node
