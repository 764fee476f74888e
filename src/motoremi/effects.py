"""Everything that an effect of your own needs: its description, parameters, laws and circuit parts."""

from __future__ import annotations

from motoremi.model import laws, materials
from motoremi.model.circuit import Leaf, Line, Node, Parallel, Scaled, Series, Shunted, with_law
from motoremi.model.effects import effects_from
from motoremi.model.effects.effect import Effect
from motoremi.model.effects.seen import Seen
from motoremi.model.effects.start import Scale, Set, Subtract
from motoremi.model.motor import Motor
from motoremi.model.parameter import Parameter

__all__ = [
    "Effect",
    "Leaf",
    "Line",
    "Motor",
    "Node",
    "Parallel",
    "Parameter",
    "Scale",
    "Scaled",
    "Seen",
    "Series",
    "Set",
    "Shunted",
    "Subtract",
    "effects_from",
    "laws",
    "materials",
    "with_law",
]
