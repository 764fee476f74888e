"""Settings for any option of any command, from a TOML file or environment variables; the command line has priority."""

from __future__ import annotations

import difflib
import os
import sys
from pathlib import Path
from typing import Any

import typer

from motoremi.data.toml_file import read_toml
from motoremi.errors import BadInput

LOCAL_NAME = "motoremi.toml"
# Global options, which may be anywhere on the command line; each takes one value.
GLOBAL = ("--config", "--effects-from")


def hoisted(arguments: list[str]) -> tuple[list[str], list[str]]:
    """The global options, and the rest of the arguments."""
    front: list[str] = []
    rest: list[str] = []
    words = iter(arguments)
    for word in words:
        if word == "--":
            rest += [word, *words]
        elif word in GLOBAL:
            front += [word, *([value] if (value := next(words, None)) is not None else [])]
        elif word.startswith(tuple(f"{name}=" for name in GLOBAL)):
            front.append(word)
        else:
            rest.append(word)
    return front, rest


def settings_file(named: Path | None) -> Path | None:
    """The settings file: the named one, `motoremi.toml` in the current folder, or the user's `config.toml`."""
    if named is not None:
        if not named.is_file():
            raise BadInput(f"{named}: no such configuration file")
        return named
    own = Path(typer.get_app_dir("motoremi")) / "config.toml"
    return next((candidate for candidate in (Path(LOCAL_NAME), own) if candidate.is_file()), None)


def defaults(file: Path | None, commands: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Defaults of each command from the file and from variables, which have priority: `MOTOREMI_FIT_SEED=3` is `motoremi fit --seed 3`."""
    known = {} if file is None else _from_file(file, commands)
    for name, command in commands.items():
        for spelling, parameter in _options(command).items():
            value = os.environ.get(f"MOTOREMI_{name}_{spelling}".upper().replace("-", "_"))
            if value:
                known.setdefault(name, {})[parameter.name] = value.split(os.pathsep) if parameter.multiple else value
    return known


def _options(command: Any) -> dict[str, Any]:
    """Options of a command as the file writes them: `--fit-only` is `fit-only`."""
    found = [parameter for parameter in command.params if parameter.param_type_name == "option"]
    return {str(max(parameter.opts, key=len)).lstrip("-"): parameter for parameter in found}


def _from_file(file: Path, commands: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Defaults for each command from a file whose tables are named after the commands and whose keys after their options.

    Parameters
    ----------
    file : Path
    commands : dict
        The commands, by name.

    Raises
    ------
    BadInput
        If the file is not TOML, or names a command or an option that does not exist.
    """
    # An empty file has no settings.
    content = read_toml(file) if file.stat().st_size else {}
    found: dict[str, dict[str, Any]] = {}
    for table, entries in content.items():
        if table not in commands:
            # A settings file in the current folder must not run code, so files with effects cannot be named in it.
            hint = "name it on the command line: it runs code" if table in ("effects-from", "effects_from") else _close(table, commands)
            raise BadInput(f"{file}: there is no command {table!r}: {hint}")
        if not isinstance(entries, dict):
            raise BadInput(f"{file}: {table} is a command: write a table [{table}] with its options")
        options = _options(commands[table])
        for key, value in entries.items():
            if key not in options:
                raise BadInput(f"{file}: motoremi {table} has no option {key!r}: {_close(key, options)}")
            found.setdefault(table, {})[options[key].name] = value
    return found


def _close(word: str, known: dict[str, Any]) -> str:
    close = difflib.get_close_matches(word, list(known), n=1)
    return f"did you mean {close[0]}?" if close else f"there are {', '.join(sorted(known))}"


def tell_own_effects(files: list[Path]) -> None:
    """Print that code of these files is run."""
    for file in files:
        sys.stderr.write(f"motoremi: running the code of {file} for effects of your own\n")
