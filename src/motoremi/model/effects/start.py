"""Start values of an effect: values of its own parameters, and changes of the motor's elements that go with them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

# At least this share of an element remains, however much a start subtracts from it.
LEAST_LEFT = 0.1


@dataclass(frozen=True)
class Set:
    """Replaces the element's value, usually by one computed from the sweeps."""

    element: str


@dataclass(frozen=True)
class Scale:
    """Multiplies the element's value."""

    element: str


@dataclass(frozen=True)
class Subtract:
    """Is subtracted from the element's value; `LEAST_LEFT` of the value remains at least."""

    element: str


# Values in SI units: of the effect's parameters by short name, and of elements by `Set`, `Scale` or `Subtract`. The keys are `Any` because
# mappings are invariant in their keys: a dictionary with names alone would not be a mapping whose keys may also be `Set` and so on.
Start: TypeAlias = Mapping[Any, float]


# Former spelling in files of effects, from before these types: "=La", "*La", "-Ca".
_FORMER = {"=": Set, "*": Scale, "-": Subtract}


def from_former(start: Start) -> Start:
    """A start whose keys of changed elements are converted from the former spelling."""
    return {_FORMER[key[0]](key[1:]) if isinstance(key, str) and key[:1] in _FORMER else key: value for key, value in start.items()}


def own_values(start: Start) -> dict[str, float]:
    """Start values of the effect's own parameters."""
    return {key: value for key, value in start.items() if isinstance(key, str)}


def with_start(values: Mapping[str, float], start: Start, label: str = "") -> dict[str, float]:
    """Values of a motor's parameters with an effect's start: elements changed, its own parameters under `label`."""

    changed = dict(values)
    for name in {key.element for key in start if not isinstance(key, str)} & values.keys():
        value = values[name]
        left = max(value * start.get(Scale(name), 1.0) - start.get(Subtract(name), 0.0), LEAST_LEFT * value)
        changed[name] = start.get(Set(name), left if value > 0 else value)
    return {**changed, **{f"{label}.{name}": value for name, value in own_values(start).items()}}
