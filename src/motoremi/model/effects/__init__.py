"""The catalogue of effects: one file for each family; third parties add theirs through an entry point."""

from __future__ import annotations

import difflib
from functools import lru_cache
from importlib.metadata import entry_points

from motoremi.errors import BadInput
from motoremi.model.effects import connection, instrument, insulation, winding
from motoremi.model.effects.effect import AddedEffect, Effect, split_identifier
from motoremi.model.motor import Motor

ENTRY_POINT_GROUP = "motoremi.effects"

__all__ = ["AddedEffect", "Effect", "add_effects", "catalogue", "find_effect", "identifiers"]


@lru_cache(maxsize=1)
def catalogue() -> tuple[Effect, ...]:
    """All known effects, in the order of the contract."""
    own = (*winding.EFFECTS, *insulation.EFFECTS, *connection.EFFECTS, *instrument.EFFECTS)
    foreign = []
    for entry in entry_points(group=ENTRY_POINT_GROUP):
        effect = entry.load()
        if not isinstance(effect, Effect):
            raise BadInput(f"the entry point {entry.name} of {ENTRY_POINT_GROUP} is not an Effect")
        if any(effect.name == other.name for other in own):
            raise BadInput(f"the entry point {entry.name} wants the name {effect.name}, which is taken")
        foreign.append(effect)
    return (*own, *foreign)


def identifiers() -> tuple[str, ...]:
    """All identifiers that can be added."""
    return tuple(identifier for effect in catalogue() for identifier in effect.identifiers)


def find_effect(text: str) -> AddedEffect:
    """The effect called `name` or `name@element`.

    Raises
    ------
    BadInput
        If there is none, naming the closest.
    """
    name, place = split_identifier(text)
    for effect in catalogue():
        if effect.name != name:
            continue
        if not effect.places:
            if place:
                raise BadInput(f"{name} has only one place: write it without '@{place}'")
            return AddedEffect(effect, name, "")
        if not place:
            raise BadInput(f"{name} needs a place: one of {', '.join(effect.identifiers)}")
        if place not in effect.places:
            raise BadInput(f"{name} cannot be at {place}: use one of {', '.join(effect.identifiers)}")
        return AddedEffect(effect, f"{name}@{place}", place)
    close = difflib.get_close_matches(text, identifiers(), n=1)
    hint = f"did you mean {close[0]}?" if close else "'motoremi effects' lists the catalogue"
    raise BadInput(f"unknown effect {text!r}: {hint}")


def add_effects(motor: Motor, names: tuple[str, ...] | list[str]) -> Motor:
    """A motor with several effects added in turn."""
    for name in names:
        motor = find_effect(name).added_to(motor)
    return motor
