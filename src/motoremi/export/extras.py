"""Check for libraries that only some exports need."""

from __future__ import annotations

import importlib.util

from motoremi.errors import BadInput


def needs(module: str, what: str, extra: str) -> None:
    """Raise an error that says how to install a missing library.

    Raises
    ------
    BadInput
        If the library is not installed.
    """
    if importlib.util.find_spec(module) is None:
        raise BadInput(f"{what} needs {module}: pip install 'motoremi[{extra}]'")
