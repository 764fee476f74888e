"""Libraries that only some exports need."""

from __future__ import annotations

import importlib.util

from motoremi.errors import BadInput


def needs(module: str, what: str, extra: str) -> None:
    """Say in one line how to install what is missing.

    Raises
    ------
    BadInput
        If the library is not installed.
    """
    if importlib.util.find_spec(module) is None:
        raise BadInput(f"{what} needs {module}: pip install 'motoremi[{extra}]'")
