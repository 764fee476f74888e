"""Networks of ideal resistors, inductors and capacitors for a circuit simulator."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import Literal, TypeAlias

import numpy as np

from motoremi.arrays import ComplexArray

# Returns a new node name or element name that begins with a stem.
Fresh: TypeAlias = Callable[[str], str]


@dataclass(frozen=True)
class Part:
    """A network with two terminals."""

    def impedance(self, s: ComplexArray) -> ComplexArray:
        """Impedance in ohm."""
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
    """Parts in series."""

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
    """Parts in parallel."""

    members: tuple[Part, ...]

    def impedance(self, s: ComplexArray) -> ComplexArray:
        return np.asarray(1 / sum(1 / member.impedance(s) for member in self.members))

    def scaled(self, factor: float) -> Part:
        return InParallel(tuple(member.scaled(factor) for member in self.members))

    def lines(self, fresh: Fresh, a: str, b: str) -> Iterator[str]:
        for member in self.members:
            yield from member.lines(fresh, a, b)


@dataclass(frozen=True)
class Coils:
    """Equal coils in series that are coupled by their flux, each with a series resistance and a part in parallel with both.

    Parameters
    ----------
    copper : Part
        Resistance of one coil.
    henry : float
        Inductance of one coil.
    coupling : float
        Coupling of neighbours; to the power of the distance for others.
    beside : Part or None
        Part in parallel with one coil and its resistance.
    """

    copper: Part
    henry: float
    coupling: float
    beside: Part | None

    def admittance(self, s: ComplexArray, count: int) -> ComplexArray:
        """Admittance matrix of `count` coils, shape (n, count, count)."""
        order = np.arange(count)
        linked = self.coupling ** np.abs(order[:, None] - order)
        own = self.copper.impedance(s)[:, None, None] * np.eye(count)
        admittance: ComplexArray = np.linalg.inv(own + s[:, None, None] * self.henry * linked)
        return admittance if self.beside is None else admittance + np.eye(count) / self.beside.impedance(s)[:, None, None]

    def lines(self, fresh: Fresh, nodes: Sequence[str]) -> Iterator[str]:
        """SPICE lines of the coils between neighbouring nodes."""
        names = []
        for left, right in pairwise(nodes):
            inner, name = fresh("n"), fresh("L_coil")
            names.append(name)
            yield from self.copper.lines(fresh, left, inner)
            yield f"{name} {inner} {right} {self.henry:.12e}"
            if self.beside is not None:
                yield from self.beside.lines(fresh, left, right)
        for (i, first), (j, second) in combinations(enumerate(names), 2):
            yield f"{fresh('K_coil')} {first} {second} {self.coupling ** (j - i):.12e}"


def resonant_loop(name: str, inductance: float, resonance_rad: float, damping_rad: float, across_share: float = 0.0) -> Part:
    """A resonant loop that is fully coupled to an inductor: s L (1 - s (s + g) / ((s + a) (s + g) + w^2)).

    As L parallel to R and C in series; the share g of the damping a + g is a resistance across C.
    """
    capacitance = 1 / (resonance_rad**2 * inductance)
    ring: Part = Element("C", f"{name}_loop", capacitance)
    if across_share > 0:
        ring = InParallel((ring, Element("R", f"{name}_across", 1 / (across_share * damping_rad * capacitance))))
    copper = Element("R", f"{name}_loop", (1 - across_share) * damping_rad * inductance)
    branch: Part = ring if across_share == 1 else InSeries((copper, ring))
    return InParallel((Element("L", f"{name}_loop", inductance), branch))
