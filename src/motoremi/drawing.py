"""Figures of results: a result asks for its figure here, and the report, which knows how results are drawn, registers how."""

from __future__ import annotations

import importlib
from functools import singledispatch
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# The modules that register how results are drawn; imported when the first figure is asked for, since drawing is heavy.
DRAWN_BY: list[str] = []


@singledispatch
def figure_of(result: object) -> Figure:
    """The figure of a result.

    Raises
    ------
    TypeError
        If nobody has registered how such a result is drawn.
    """
    nobody = figure_of.dispatch(object)
    for module in DRAWN_BY:
        importlib.import_module(module)
    if figure_of.dispatch(type(result)) is nobody:
        raise TypeError(f"nobody can draw a {type(result).__name__}")
    return figure_of(result)
