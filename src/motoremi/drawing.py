"""Figures of results: `plot()` of a result calls `figure_of`, for which the report registers a drawing function for each type of result.

Results thus need not import the report, which depends on them.
"""

from __future__ import annotations

import importlib
from functools import singledispatch
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Names of the modules that register drawing functions, such as `motoremi.report.figures`, which `motoremi/__init__.py` adds. They are imported
# with the first figure, because matplotlib takes long to import.
DRAWN_BY: list[str] = []


@singledispatch
def figure_of(result: object) -> Figure:
    """The figure of a result.

    Raises
    ------
    TypeError
        If no drawing function is registered for this type of result.
    """
    unregistered = figure_of.dispatch(object)
    for module in DRAWN_BY:
        importlib.import_module(module)
    if figure_of.dispatch(type(result)) is unregistered:
        raise TypeError(f"there is no figure of a {type(result).__name__}")
    # The function that was registered by now, not this one.
    return figure_of(result)
