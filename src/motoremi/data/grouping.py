"""Files of many motors in one folder: which file belongs to which motor, by patterns for their names."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from motoremi.data.text import clean_text
from motoremi.errors import BadInput


@dataclass(frozen=True)
class Files:
    """The files of one motor; several of one termination are repeats.

    Parameters
    ----------
    short, open_ : list of Path
        In the order of their names.
    """

    short: list[Path] = field(default_factory=list)
    open_: list[Path] = field(default_factory=list)


def files_by_motor(folder: Path, short: str | None, open_: str | None) -> tuple[dict[str, Files], list[Path]]:
    """The files of each motor, and the files of no motor.

    Parameters
    ----------
    folder : Path
        Searched at any depth.
    short, open_ : str, optional
        Patterns of paths below the folder, such as `*_short.csv`: what the first `*` stands for is the name of the motor; any other `*` or `?`
        stands for anything, such as the number of a repeat.

    Raises
    ------
    BadInput
        If the folder does not exist, there is no pattern or one without `*`, a file matches both, or none matches any.
    """
    if not folder.is_dir():
        raise BadInput(f"{folder}: no such folder")
    patterns = {name: _expression(pattern) for name, pattern in (("short", short), ("open", open_)) if pattern is not None}
    if not patterns:
        raise BadInput("give patterns of the files' names: --short '*_short.csv' --open '*_open.csv'")
    found: dict[str, Files] = {}
    others: list[Path] = []
    for path in sorted(one for one in folder.rglob("*") if one.is_file()):
        matches = {name: match for name, expression in patterns.items() if (match := expression.fullmatch(path.relative_to(folder).as_posix()))}
        if len(matches) > 1:
            raise BadInput(f"{path.name} matches both patterns: make them differ")
        for name, match in matches.items():
            files = found.setdefault(match["motor"], Files())
            (files.short if name == "short" else files.open_).append(path)
        if not matches:
            others.append(path)
    if not found:
        names = ", ".join(clean_text(path.name, 40) for path in others[:3]) or "it is empty"
        raise BadInput(f"{folder}: no file matches {' or '.join(repr(one) for one in (short, open_) if one is not None)} (found: {names})")
    return found, others


def without_one_sweep(found: Mapping[str, Files]) -> dict[str, str]:
    """Motors that have no file of a termination, although others have one, by name."""
    every = {"short": any(one.short for one in found.values()), "open": any(one.open_ for one in found.values())}
    return {name: kind for name, one in found.items() for kind, files in (("short", one.short), ("open", one.open_)) if every[kind] and not files}


def _expression(pattern: str) -> re.Pattern[str]:
    first, star, rest = pattern.partition("*")
    if not star:
        raise BadInput(f"the pattern {pattern!r} has no *, which stands for the name of the motor: write for example '*_short.csv'")
    end = "".join({"*": ".*", "?": "."}.get(mark, re.escape(mark)) for mark in rest)
    return re.compile(f"{re.escape(first)}(?P<motor>.+?){end}")
