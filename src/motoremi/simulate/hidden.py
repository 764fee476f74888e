"""Kinds of hidden effects, and functions that add one to a network."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from motoremi.data.sweep import TERMINATIONS, Termination
from motoremi.simulate.parts import IN, OUT, Block, Network

Elements: TypeAlias = Mapping[str, float]
Sizes: TypeAlias = Mapping[str, float]
ELEMENTS = ("Ra", "La", "Ca", "Rr", "Lr", "Cr", "Cf")


@dataclass(frozen=True)
class EffectKind:
    """A kind of effect that a simulated motor can hide.

    Parameters
    ----------
    name : str
        Identifier, `name` or `name@element`.
    draw : callable
        `draw(rng, elements)` returns sizes that a good measurement must detect, named with their units. A size with the name of one of the
        seven elements replaces that element.
    apply : callable
        `apply(network, elements, sizes)` returns the network with the effect.
    terminations : tuple of str
        Sweeps in which it is present.
    excludes : tuple of str
        Kinds that change the same parts in another way: a motor has only one of them.
    """

    name: str
    draw: Callable[[np.random.Generator, Elements], dict[str, float]]
    apply: Callable[[Network, Elements, Sizes], Network]
    terminations: tuple[Termination, ...] = TERMINATIONS
    excludes: tuple[str, ...] = ()


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A random number whose logarithm is uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A uniform random number."""
    return float(rng.uniform(low, high))


def replaced(network: Network, name: str, inner: Network) -> Network:
    """The item `name` replaced by a block of the same name."""
    item = network.item(name)
    return network.with_item(name, Block(name, item.positive, item.negative, inner))


def beside(network: Network, name: str, extra: Network) -> Network:
    """The item `name` with `extra` in parallel, as one block of the same name."""
    inside = dataclasses.replace(network.item(name), positive=IN, negative=OUT)
    return replaced(network, name, Network((inside,)).block("beside", IN, OUT, extra))


def behind(network: Network, name: str, extra: Network, share: float = 1.0) -> Network:
    """`share` of the item `name` in series with `extra`, as one block of the same name."""
    inside = dataclasses.replace(network.item(name), positive=IN, negative="middle").scaled(share)
    return replaced(network, name, Network((inside,)).block("behind", "middle", OUT, extra))
