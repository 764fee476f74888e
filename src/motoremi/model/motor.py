"""The DC motor of Liu, Wang and Nan (2011), fig. 2, and the places where effects attach."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, TypeAlias

from motoremi.errors import BadInput
from motoremi.model import laws
from motoremi.model.circuit import Bridged, Leaf, Line, Node, Parallel, Scaled, Series, is_element, replace_element, replace_leaf, walk
from motoremi.model.laws import Law
from motoremi.model.parameter import Parameter
from motoremi.model.sections import Sections

Terminations: TypeAlias = tuple[Literal["short", "open"], ...]
BOTH: Terminations = ("short", "open")

BASE_PARAMETERS = (
    Parameter("Ra", "Ohm", 1e-3, 100e3, "from a copper bar to a thin winding whose core losses at MHz are lumped in"),
    Parameter("La", "H", 1e-9, 1.0, "from one turn to the stator of a small mains motor at 100 Hz"),
    Parameter("Ca", "F", 0.01e-12, 1e-6, "turn-to-turn capacitance, from a few turns to a large winding"),
    Parameter("Rr", "Ohm", 1e-3, 1e6, "laminations and bearing: metal contact to a dry oil film"),
    Parameter("Lr", "H", 1e-9, 10e-3, "from a few millimetres of shaft to the whole core"),
    Parameter("Cr", "F", 0.1e-12, 1e-6, "winding to slot, from a toy motor to a traction motor", usual=(10e-12, 20e-9)),
    Parameter("Cf", "F", 0.1e-12, 1e-6, "winding to frame, from a toy motor to a traction motor", usual=(10e-12, 20e-9)),
)


@dataclass(frozen=True)
class Attachment:
    """Something between the analyser and the winding: wraps the circuit of the terminations it applies to."""

    wrap: Callable[[Node], Node]
    terminations: Terminations = BOTH


@dataclass(frozen=True)
class Apart:
    """An element that differs in the open-circuit sweep, by a factor of its impedance."""

    element: str
    law: Law
    parameters: tuple[Parameter, ...]


@dataclass(frozen=True)
class Motor:
    """A motor as two circuits that share their elements.

    Parameters
    ----------
    winding : Node
        Between the armature terminals: (Ra + s La) parallel Ca, eq. (1).
    frame : Node
        From the far end of the winding to the frame: (Rr + s Lr + 1/s Cr) parallel Cf, the second term of eq. (2).
    distribution : Parameter, optional
        Share of Cf that is spread along the winding.
    spread : Node, optional
        From the turns to the frame, all along the winding; what lies beside its copper (Ca) is then across its ends.
    coupled : tuple of Parameter, optional
        Number of sections and coupling of neighbours, where what is spread lies along sections that are linked by their flux.
    across : tuple of Node
        Parts from one end of the winding to the other that are no part of it.
    apart : tuple of Apart
        Elements that differ in the open-circuit sweep.
    attachments : tuple of Attachment
        From the motor outwards to the analyser.
    effects : tuple of str
        Identifiers of the effects added so far, in order.
    """

    winding: Node
    frame: Node
    distribution: Parameter | None = None
    spread: Node | None = None
    coupled: tuple[Parameter, Parameter] | None = None
    across: tuple[Node, ...] = ()
    apart: tuple[Apart, ...] = ()
    attachments: tuple[Attachment, ...] = ()
    effects: tuple[str, ...] = ()

    def circuit(self, termination: str) -> Node:
        """The one-port that the analyser sees with the far end `short` or `open`.

        `grounded` is what `open` becomes once the far end is tied to the frame: seen through the same leads and strap, without the frame.
        """
        if termination not in (*BOTH, "grounded"):
            raise BadInput(f"unknown termination {termination!r}: use 'short', 'open' or 'grounded'")
        winding, frame = self.winding, self.frame
        if termination != "short":
            for apart in self.apart:
                winding = replace_leaf(winding, apart.element, lambda leaf, apart=apart: Scaled(leaf, apart.law, apart.parameters))  # type: ignore[misc]
        seen: Node
        if self.spread is not None:
            copper, *beside = winding.children
            seen = self._distributed(copper, (), self.spread, (*beside, *self.across), frame if termination == "open" else None)
        elif (share := self.distribution) is not None:
            spread = Scaled(self._insulation("Cf"), laws.split_factor, (share,))
            rest = replace_leaf(frame, "Cf", lambda leaf: Scaled(leaf, laws.rest_factor, (share,)))
            copper, *turns = winding.children
            seen = self._distributed(copper, turns, spread, self.across, rest if termination == "open" else None)
        else:
            whole = self._with_across(winding)
            seen = Series((whole, frame)) if termination == "open" else whole
        for attachment in self.attachments:
            if ("short" if termination == "short" else "open") in attachment.terminations:
                seen = attachment.wrap(seen)
        return seen

    def _with_across(self, winding: Node) -> Node:
        """A winding with what lies from end to end of it."""
        return Parallel((*winding.children, *self.across)) if self.across else winding

    @property
    def between(self) -> Node:
        """All that lies between the ends of a winding that is not spread."""
        return self._with_across(self.winding)

    @property
    def is_line(self) -> bool:
        """Whether the winding is spread along the frame."""
        return self.spread is not None or self.distribution is not None

    def _distributed(self, copper: Node, turns: Sequence[Node], spread: Node, across: Sequence[Node], frame: Node | None) -> Node:
        """Copper and core, with parts beside all of their turns, spread toward the frame; further parts across the ends."""
        bridge = _together(across)
        if self.coupled is not None:
            resistance, flux = copper.children
            return Sections(resistance, flux, spread, *self.coupled, _together(turns), bridge, frame)
        series = Parallel((copper, *turns)) if turns else copper
        if bridge is None:
            return Line(series, spread, frame)
        return Parallel((Line(series, spread), bridge)) if frame is None else Bridged(series, spread, bridge, frame)

    def _insulation(self, name: str) -> Node:
        """The element with everything that effects have made of it (dielectric loss and the like)."""
        # Parents come after their children.
        found = [node for node in walk(self.frame) if is_element(node, name)]
        if not found:
            raise BadInput(f"the motor has no element {name}")
        return found[-1]

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """All parameters, those of the paper first, each once."""
        seen: dict[str, Parameter] = {parameter.name: parameter for parameter in BASE_PARAMETERS}
        for termination in BOTH:
            for node in walk(self.circuit(termination)):
                for parameter in node.own_parameters:
                    seen.setdefault(parameter.name, parameter)
        return tuple(seen.values())

    def used_parameters(self, termination: str) -> set[str]:
        """Names of the parameters that one termination depends on."""
        return {p.name for node in walk(self.circuit(termination)) for p in node.own_parameters}

    def replaced(self, element: str, change: Callable[[Node], Node]) -> Motor:
        """The motor with one element, under all laws of its material, changed wherever it occurs."""
        winding, frame = (replace_element(part, element, change) for part in (self.winding, self.frame))
        return dataclasses.replace(self, winding=winding, frame=frame)

    def attached(self, wrap: Callable[[Node], Node], terminations: Terminations = BOTH) -> Motor:
        """The motor with one more part between it and the analyser."""
        return dataclasses.replace(self, attachments=(*self.attachments, Attachment(wrap, terminations)))

    def with_branch(self, branch: Node) -> Motor:
        """The motor with one more part across its winding, beside Ca."""
        return dataclasses.replace(self, winding=Parallel((*self.winding.children, branch)))

    def with_across(self, branch: Node) -> Motor:
        """The motor with a part from one end of its winding to the other, which is no part of the winding."""
        return dataclasses.replace(self, across=(*self.across, branch))

    def with_first_turns(self, cell: Node) -> Motor:
        """The motor with a part in series at the winding's terminal: lumped even where the winding is not, inside all that is attached."""
        first = Attachment(lambda seen: Series((seen, cell)))
        return dataclasses.replace(self, attachments=(first, *self.attachments))

    def __repr__(self) -> str:
        return f"Motor(effects={list(self.effects)})"


def _together(parts: Sequence[Node]) -> Node | None:
    """Parts side by side; None for none."""
    return Parallel(tuple(parts)) if len(parts) > 1 else parts[0] if parts else None


def dc_motor() -> Motor:
    """The seven-element circuit of the paper: eq. (1) between the terminals, eq. (2) from terminal to frame.

    Returns
    -------
    Motor
        With parameters Ra, La, Ca, Rr, Lr, Cr, Cf in ohm, henry and farad.
    """
    ra, la, ca, rr, lr, cr, cf = BASE_PARAMETERS
    return Motor(
        winding=Parallel(
            (
                Series((Leaf("Ra", laws.resistor, (ra,)), Leaf("La", laws.inductor, (la,)))),
                Leaf("Ca", laws.capacitor, (ca,)),
            )
        ),
        frame=Parallel(
            (
                Series(
                    (
                        Leaf("Rr", laws.resistor, (rr,)),
                        Leaf("Lr", laws.inductor, (lr,)),
                        Leaf("Cr", laws.capacitor, (cr,)),
                    )
                ),
                Leaf("Cf", laws.capacitor, (cf,)),
            )
        ),
    )
