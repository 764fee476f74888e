"""Effects of the user's own, from Python files. Reading one runs its code."""

from __future__ import annotations

import dataclasses
import hashlib
import importlib.util
import os
import re
from pathlib import Path

from motoremi.errors import BadInput
from motoremi.model.effects.effect import Effect
from motoremi.model.effects.start import from_former, own_values

# Worker processes inherit the environment, so they know the same effects.
VARIABLE = "MOTOREMI_EFFECTS_FROM"


def named_files() -> tuple[Path, ...]:
    """The files that the environment names, separated as in PATH."""
    return tuple(Path(name) for name in os.environ.get(VARIABLE, "").split(os.pathsep) if name)


def effects_in(path: Path) -> tuple[Effect, ...]:
    """Run a Python file and return the effects that it defines.

    Raises
    ------
    BadInput
        If there is no such file, its code fails, or it defines no effect.
    """
    if not path.is_file():
        raise BadInput(f"{path}: no such file of effects")
    spec = importlib.util.spec_from_file_location(f"motoremi_own_{hashlib.sha256(str(path.resolve()).encode()).hexdigest()[:12]}", path)
    if spec is None or spec.loader is None:
        raise BadInput(f"{path}: effects are defined in a Python file (.py)")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise BadInput(f"{path}: its code fails: {type(error).__name__}: {error}") from error
    written = {id(value): value for value in vars(module).values() if isinstance(value, Effect)}.values()
    if not written:
        raise BadInput(f"{path}: defines no Effect")
    found = tuple(dataclasses.replace(effect, starts=tuple(map(from_former, effect.starts))) for effect in written)
    for effect in found:
        _check(effect, path)
    return found


def _check(effect: Effect, path: Path) -> None:
    if not re.fullmatch(r"[a-z][a-z-]*", effect.name):
        raise BadInput(f"{path}: the name {effect.name!r} must be lower-case words joined by '-'")
    if not effect.parameters or not effect.starts:
        raise BadInput(f"{path}: {effect.name} needs at least one parameter and one set of start values")
    names = {parameter.name for parameter in effect.parameters}
    for start in effect.starts:
        strange = own_values(start).keys() ^ names
        if strange:
            raise BadInput(f"{path}: {effect.name}: parameters and start values differ in {', '.join(sorted(strange))}")
