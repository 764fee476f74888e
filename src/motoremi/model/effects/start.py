"""Start values of an effect: of its own parameters, and what they do to the elements that the motor has already."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

# What a start leaves of an element from which it takes more than there is.
LEAST_LEFT = 0.1


@dataclass(frozen=True)
class Set:
    """The element's value, whatever it was: what the sweeps themselves say of it."""

    element: str


@dataclass(frozen=True)
class Scale:
    """The factor of the element's value."""

    element: str


@dataclass(frozen=True)
class Subtract:
    """What is taken off the element's value, most of it at most."""

    element: str


# Values in SI units: of the effect's parameters by short name, and of elements by `Set`, `Scale` or `Subtract`. Not told to the type checker:
# a dictionary of names alone would be none of both.
Start: TypeAlias = Mapping[Any, float]


# How files of effects wrote it before these types: "=La", "*La", "-Ca".
_FORMER = {"=": Set, "*": Scale, "-": Subtract}


def from_former(start: Start) -> Start:
    """A start with the former spelling of changed elements read as it was meant."""
    return {_FORMER[key[0]](key[1:]) if isinstance(key, str) and key[:1] in _FORMER else key: value for key, value in start.items()}


def own_values(start: Start) -> dict[str, float]:
    """Those of the effect's own parameters."""
    return {key: value for key, value in start.items() if isinstance(key, str)}


def with_start(values: Mapping[str, float], start: Start, label: str = "") -> dict[str, float]:
    """Values of a motor's parameters with an effect's start: elements changed, its own parameters under `label`."""

    changed = dict(values)
    for name in {key.element for key in start if not isinstance(key, str)} & values.keys():
        value = values[name]
        left = max(value * start.get(Scale(name), 1.0) - start.get(Subtract(name), 0.0), LEAST_LEFT * value)
        changed[name] = start.get(Set(name), left if value > 0 else value)
    return {**changed, **{f"{label}.{name}": value for name, value in own_values(start).items()}}
