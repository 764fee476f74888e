"""Networks of ideal resistors, inductors and capacitors as values: what a circuit simulator can take."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from motoremi.arrays import ComplexArray

# Hands out a new node, or a new element name from a stem.
Fresh: TypeAlias = Callable[[str], str]


@dataclass(frozen=True)
class Part:
    """A network of two terminals."""

    def impedance(self, s: ComplexArray) -> ComplexArray:
        """In ohm."""
        raise NotImplementedError

    def scaled(self, factor: float) -> Part:
        """The network whose impedance is `factor` times this one's."""
        raise NotImplementedError

    def lines(self, fresh: Fresh, a: str, b: str) -> Iterator[str]:
        """SPICE lines between two nodes."""
        raise NotImplementedError


@dataclass(frozen=True)
class Element(Part):
    """One resistor, inductor or capacitor."""

    kind: Literal["R", "L", "C"]
    name: str
    value: float

    def impedance(self, s: ComplexArray) -> ComplexArray:
        if self.kind == "R":
            return self.value + 0 * s
        return s * self.value if self.kind == "L" else 1 / (s * self.value)

    def scaled(self, factor: float) -> Part:
        return dataclasses.replace(self, value=self.value / factor if self.kind == "C" else self.value * factor)

    def lines(self, fresh: Fresh, a: str, b: str) -> Iterator[str]:
        yield f"{fresh(f'{self.kind}_{self.name}')} {a} {b} {self.value:.12e}"


@dataclass(frozen=True)
class InSeries(Part):
    """One after the other."""

    members: tuple[Part, ...]

    def impedance(self, s: ComplexArray) -> ComplexArray:
        return np.asarray(sum(member.impedance(s) for member in self.members))

    def scaled(self, factor: float) -> Part:
        return InSeries(tuple(member.scaled(factor) for member in self.members))

    def lines(self, fresh: Fresh, a: str, b: str) -> Iterator[str]:
        nodes = [a, *(fresh("n") for _ in self.members[1:]), b]
        for member, left, right in zip(self.members, nodes[:-1], nodes[1:], strict=True):
            yield from member.lines(fresh, left, right)


@dataclass(frozen=True)
class InParallel(Part):
    """Side by side."""

    members: tuple[Part, ...]

    def impedance(self, s: ComplexArray) -> ComplexArray:
        return np.asarray(1 / sum(1 / member.impedance(s) for member in self.members))

    def scaled(self, factor: float) -> Part:
        return InParallel(tuple(member.scaled(factor) for member in self.members))

    def lines(self, fresh: Fresh, a: str, b: str) -> Iterator[str]:
        for member in self.members:
            yield from member.lines(fresh, a, b)


def resonant_loop(name: str, inductance: float, resonance_rad: float, damping_rad: float) -> Part:
    """A resonant loop that is fully coupled to an inductor: s L (1 - s^2 / (s^2 + s a + w^2)), as L parallel to R and C in series."""
    capacitance = 1 / (resonance_rad**2 * inductance)
    branch = InSeries((Element("R", f"{name}_loop", damping_rad * inductance), Element("C", f"{name}_loop", capacitance)))
    return InParallel((Element("L", f"{name}_loop", inductance), branch))
