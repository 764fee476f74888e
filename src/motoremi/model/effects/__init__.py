"""The catalogue of effects: one file for each group; other packages add theirs through an entry point."""

from __future__ import annotations

import copyreg
import difflib
import hashlib
import os
from collections.abc import Callable
from functools import lru_cache
from importlib.metadata import entry_points
from pathlib import Path

from motoremi.errors import BadInput
from motoremi.model.effects import connection, instrument, insulation, machine, own, suppressor, winding, winding_sections
from motoremi.model.effects.effect import AddedEffect, Effect, split_identifier
from motoremi.model.effects.validity import check_effect
from motoremi.model.motor import Motor, dc_motor

ENTRY_POINT_GROUP = "motoremi.effects"

__all__ = ["AddedEffect", "Effect", "add_effects", "catalogue", "catalogue_sha256", "effects_from", "find_effect", "identifiers"]


@lru_cache(maxsize=1)
def catalogue() -> tuple[Effect, ...]:
    """All known effects: the built-in ones, then those of installed packages, then those of the user's own files."""
    known = [
        *winding.EFFECTS,
        *machine.EFFECTS,
        *winding_sections.EFFECTS,
        *insulation.EFFECTS,
        *connection.EFFECTS,
        *suppressor.EFFECTS,
        *instrument.EFFECTS,
    ]
    for entry in entry_points(group=ENTRY_POINT_GROUP):
        effect = entry.load()
        if not isinstance(effect, Effect):
            raise BadInput(f"the entry point {entry.name} of {ENTRY_POINT_GROUP} is not an Effect")
        _join(known, effect, f"the entry point {entry.name}")
    for path in own.named_files():
        for effect in own.effects_in(path):
            _join(known, effect, str(path))
    return tuple(known)


def _join(known: list[Effect], effect: Effect, origin: str) -> None:
    if any(effect.name == other.name for other in known):
        raise BadInput(f"{origin}: the name {effect.name} is already used by another effect")
    try:
        check_effect(effect, known)
    except BadInput as error:
        raise BadInput(f"{origin}: {error}") from error
    known.append(effect)


def effects_from(*paths: str | os.PathLike[str]) -> tuple[Effect, ...]:
    """Add the effects of Python files to the catalogue, for this process and those that it starts. This runs their code.

    Returns
    -------
    tuple of Effect
        The effects that the files define.

    Raises
    ------
    BadInput
        If a file defines no effect, its code fails, or a name is already used.
    """
    before = os.environ.get(own.VARIABLE)
    files = dict.fromkeys(Path(path).resolve() for path in (*own.named_files(), *paths))
    os.environ[own.VARIABLE] = os.pathsep.join(str(file) for file in files)
    catalogue.cache_clear()
    try:
        mine = {effect.name for path in paths for effect in own.effects_in(Path(path))}
        return tuple(effect for effect in catalogue() if effect.name in mine)
    except BadInput:
        if before is None:
            del os.environ[own.VARIABLE]
        else:
            os.environ[own.VARIABLE] = before
        catalogue.cache_clear()
        raise


def catalogue_sha256() -> str:
    """Digest of the catalogue: results are comparable only if it is the same."""
    known: list[object] = ["what several laws change of one element adds up"]
    known += [(effect.identifiers, effect.formula, [(p.name, p.low, p.high) for p in effect.parameters]) for effect in catalogue()]
    return hashlib.sha256(repr(known).encode()).hexdigest()


def identifiers() -> tuple[str, ...]:
    """Identifiers of all effects."""
    return tuple(identifier for effect in catalogue() for identifier in effect.identifiers)


def find_effect(text: str) -> AddedEffect:
    """The effect called `name` or `name@element`.

    Raises
    ------
    BadInput
        If there is none; the message suggests the closest name.
    """
    name, place = split_identifier(text)
    for effect in catalogue():
        if effect.name != name:
            continue
        if not effect.places:
            if place:
                raise BadInput(f"{name} has only one place: write it without '@{place}'")
            return AddedEffect(effect, name, "")
        if place not in effect.places and not place:
            raise BadInput(f"{name} needs a place: one of {', '.join(effect.identifiers)}")
        if place not in effect.places:
            raise BadInput(f"{name} cannot be at {place}: use one of {', '.join(effect.identifiers)}")
        return AddedEffect(effect, f"{name}@{place}" if place else name, place)
    close = difflib.get_close_matches(text, identifiers(), n=1)
    own = "; for one of your own give its file, --effects-from FILE.py"
    hint = f"did you mean {close[0]}?" if close else f"'motoremi effects' lists the catalogue{own}"
    raise BadInput(f"unknown effect {text!r}: {hint}")


def add_effects(motor: Motor, names: tuple[str, ...] | list[str]) -> Motor:
    """A motor with several effects added in turn."""
    for name in names:
        motor = find_effect(name).added_to(motor)
    return motor


def _of_effects(names: tuple[str, ...]) -> Motor:
    return add_effects(dc_motor(), names)


def _by_names(motor: Motor) -> tuple[Callable[[tuple[str, ...]], Motor], tuple[tuple[str, ...]]]:
    """A motor is sent to another process by the names of its effects: a circuit holds functions, which cannot be sent."""
    if _of_effects(motor.effects).parameters != motor.parameters:
        raise TypeError("only a motor that is made of effects of the catalogue can be sent to another process")
    return _of_effects, (motor.effects,)


copyreg.pickle(Motor, _by_names)
