"""Networks of ideal parts: resistors, inductors, capacitors, mutual coupling, and networks inside networks."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Literal, TypeAlias

from motoremi.errors import BadInput

Kind = Literal["R", "L", "C"]
# Ports of a network that is used as a block.
IN, OUT = "in", "out"


@dataclass(frozen=True, slots=True)
class Part:
    """One ideal resistor (ohm), inductor (henry) or capacitor (farad) between two nodes."""

    kind: Kind
    name: str
    positive: str
    negative: str
    value: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.value) and self.value > 0):
            raise BadInput(f"part {self.name}: {self.value} cannot be the value of an ideal {self.kind}; it must be above 0")

    def scaled(self, factor: float) -> Part:
        """The same part with `factor` times the impedance."""
        value = self.value / factor if self.kind == "C" else self.value * factor
        return dataclasses.replace(self, value=value)


@dataclass(frozen=True, slots=True)
class Block:
    """A network used as one part between two nodes; its ports are the nodes `in` and `out`.

    Parameters
    ----------
    name, positive, negative : str
    network : Network
    scale : float
        The block has `scale` times the impedance of the network.
    """

    name: str
    positive: str
    negative: str
    network: Network
    scale: float = 1.0

    def scaled(self, factor: float) -> Block:
        """The same block with `factor` times the impedance."""
        return dataclasses.replace(self, scale=self.scale * factor)


@dataclass(frozen=True, slots=True)
class Coupling:
    """Mutual coupling of two inductors of the same network: M = coefficient * sqrt(L1 * L2), |coefficient| <= 1."""

    first: str
    second: str
    coefficient: float

    def __post_init__(self) -> None:
        if not abs(self.coefficient) <= 1:
            raise BadInput(f"coupling of {self.first} and {self.second}: {self.coefficient} is outside -1 .. 1")


Item: TypeAlias = Part | Block


@dataclass(frozen=True)
class Network:
    """Parts between named nodes; every change returns a new network.

    Parameters
    ----------
    items : tuple of Part or Block
        Names are unique.
    couplings : tuple of Coupling
    """

    items: tuple[Item, ...] = ()
    couplings: tuple[Coupling, ...] = ()

    def resistor(self, name: str, positive: str, negative: str, ohm: float) -> Network:
        """With one more resistor."""
        return self.plus(Part("R", name, positive, negative, ohm))

    def inductor(self, name: str, positive: str, negative: str, henry: float) -> Network:
        """With one more inductor."""
        return self.plus(Part("L", name, positive, negative, henry))

    def capacitor(self, name: str, positive: str, negative: str, farad: float) -> Network:
        """With one more capacitor."""
        return self.plus(Part("C", name, positive, negative, farad))

    def block(self, name: str, positive: str, negative: str, network: Network, scale: float = 1.0) -> Network:
        """With one more block."""
        return self.plus(Block(name, positive, negative, network, scale))

    def couple(self, first: str, second: str, coefficient: float) -> Network:
        """With two inductors coupled."""
        return dataclasses.replace(self, couplings=(*self.couplings, Coupling(first, second, coefficient)))

    def plus(self, *items: Item) -> Network:
        """With more items."""
        return dataclasses.replace(self, items=(*self.items, *items))

    def item(self, name: str) -> Item:
        """The item of that name."""
        for item in self.items:
            if item.name == name:
                return item
        raise BadInput(f"the network has no part {name!r}; it has {', '.join(item.name for item in self.items)}")

    def with_item(self, name: str, new: Item) -> Network:
        """With the item of that name replaced."""
        self.item(name)
        return dataclasses.replace(self, items=tuple(new if item.name == name else item for item in self.items))

    def with_node(self, old: str, new: str) -> Network:
        """With one node renamed; with the name of an existing node, the two are connected."""
        names = {old: new}
        return dataclasses.replace(
            self,
            items=tuple(
                dataclasses.replace(
                    item,
                    positive=names.get(item.positive, item.positive),
                    negative=names.get(item.negative, item.negative),
                )
                for item in self.items
            ),
        )

    def with_capacitors(self, factor: float) -> Network:
        """With every capacitance, also inside blocks, `factor` times as large; blocks that share a network still do."""
        items: list[Item] = []
        changed: dict[int, Network] = {}
        for item in self.items:
            if isinstance(item, Block):
                key = id(item.network)
                if key not in changed:
                    changed[key] = item.network.with_capacitors(factor)
                items.append(dataclasses.replace(item, network=changed[key]))
            else:
                items.append(item.scaled(1 / factor) if item.kind == "C" else item)
        return dataclasses.replace(self, items=tuple(items))
