"""The circuit of a DC motor (Liu, Wang and Nan 2011, fig. 2), and the places where effects change it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Literal, TypeAlias

from motoremi.errors import BadInput
from motoremi.model import laws
from motoremi.model.circuit import (
    Bridged,
    FloatingLine,
    Leaf,
    Line,
    Node,
    Parallel,
    Scaled,
    Series,
    is_element,
    replace_element,
    replace_leaf,
    walk,
)
from motoremi.model.laws import Law
from motoremi.model.parameter import Parameter
from motoremi.model.sections import Sections

Terminations: TypeAlias = tuple[Literal["short", "open"], ...]
BOTH: Terminations = ("short", "open")

BASE_PARAMETERS = (
    Parameter("Ra", "Ohm", 1e-3, 100e3, "from a copper bar to a thin winding whose core losses at MHz are lumped in"),
    Parameter("La", "H", 1e-9, 1.0, "from one turn to the stator of a small mains motor at 100 Hz"),
    Parameter("Ca", "F", 0.01e-12, 1e-6, "turn-to-turn capacitance, from a few turns to a large winding", usual=(1e-12, 20e-9)),
    Parameter("Rr", "Ohm", 1e-3, 1e6, "laminations and bearing: metal contact to a dry oil film"),
    Parameter("Lr", "H", 1e-9, 10e-3, "from a few millimetres of shaft to the whole core"),
    Parameter("Cr", "F", 0.1e-12, 1e-6, "winding to slot, from a toy motor to a traction motor", usual=(10e-12, 20e-9)),
    Parameter("Cf", "F", 0.1e-12, 1e-6, "winding to frame, from a toy motor to a traction motor", usual=(10e-12, 20e-9)),
)


class Outwards(IntEnum):
    """Where a part between winding and analyser is, from the motor outwards, whatever the order in which parts are added."""

    FIRST_TURNS = 0
    BRUSHES = 1
    CHOKE = 2
    LEADS = 3
    TERMINALS = 4
    CABLE = 5
    ANALYSER = 6


@dataclass(frozen=True)
class Attachment:
    """A part between the analyser and the winding: `wrap` adds it to the circuit of the terminations it applies to.

    `to_frame` is a part that ends at the motor's own frame, so that its current flows through the strap as well; None of any other.
    """

    wrap: Callable[[Node], Node]
    terminations: Terminations = BOTH
    place: Outwards = Outwards.LEADS
    to_frame: Node | None = None


@dataclass(frozen=True)
class OpenSweepFactor:
    """A factor on the impedance of an element that applies in the open-circuit sweep only."""

    element: str
    law: Law
    parameters: tuple[Parameter, ...]


@dataclass(frozen=True)
class Motor:
    """A motor as the circuits of its two sweeps, which share their elements.

    Parameters
    ----------
    winding : Node
        Between the armature terminals: (Ra + s La) parallel Ca, eq. (1).
    frame : Node
        From the far end of the winding to the frame: (Rr + s Lr + 1/s Cr) parallel Cf, the second term of eq. (2).
    strap : Node, optional
        Between frame and analyser: in series with `frame`, with a winding whose far end is tied to the frame, and with parts that end at the frame.
    tie : Node, optional
        From the far end of the winding to the analyser in the short-circuit sweep, in parallel with the path through the frame; nothing is ideal.
    distribution : Parameter, optional
        Share of Cf that is distributed along the winding.
    ends : Parameter, optional
        Share of Ca from one end of a distributed winding to the other, instead of between its turns.
    spread : Node, optional
        Impedance to the frame that is distributed along the winding, instead of a share of Cf; Ca is then across the ends of the winding.
    coupled : tuple of Parameter, optional
        Number of sections and coupling of neighbours, if the winding is divided into sections that are coupled by their flux.
    across : tuple of Node
        Parts from one end of the winding to the other that do not belong to it, such as a capacitor.
    open_factors : tuple of OpenSweepFactor
        Factors on elements in the open-circuit sweep.
    attachments : tuple of Attachment
        Parts between motor and analyser, from the motor outwards.
    effects : tuple of str
        Identifiers of the effects added so far, in order.
    """

    winding: Node
    frame: Node
    strap: Node | None = None
    tie: Node | None = None
    distribution: Parameter | None = None
    ends: Parameter | None = None
    spread: Node | None = None
    coupled: tuple[Parameter, Parameter] | None = None
    across: tuple[Node, ...] = ()
    open_factors: tuple[OpenSweepFactor, ...] = ()
    attachments: tuple[Attachment, ...] = ()
    effects: tuple[str, ...] = ()

    def circuit(self, termination: str) -> Node:
        """The one-port at the analyser with the termination `short` or `open`.

        `grounded` is the open-circuit sweep with the far end connected to the frame: with the same leads and strap, without the path to the frame.
        """
        if termination not in (*BOTH, "grounded"):
            raise BadInput(f"unknown termination {termination!r}: use 'short', 'open' or 'grounded'")
        winding, frame = self.winding, self.frame
        if termination != "short":
            for factor in self.open_factors:
                winding = replace_leaf(winding, factor.element, lambda leaf, factor=factor: Scaled(leaf, factor.law, factor.parameters))  # type: ignore[misc]
        seen: Node
        # How the winding ends; a tie is the end of a short-circuited one.
        end = termination
        if termination == "short" and self.tie is not None:
            end, frame = "open", Parallel((self.tie, frame if self.strap is None else Series((frame, self.strap))))
        if self.spread is not None:
            copper, *beside = winding.children
            seen = self._distributed(end, copper, (), self.spread, (*beside, *self.across), frame)
        elif (share := self.distribution) is not None:
            spread = Scaled(self._insulation("Cf"), laws.split_factor, (share,))
            rest = replace_leaf(frame, "Cf", lambda leaf: Scaled(leaf, laws.rest_factor, (share,)))
            copper, *turns = winding.children
            across = self.across
            if self.ends is not None:
                whole, *branches = turns
                turns = [Scaled(whole, laws.rest_factor, (self.ends,)), *branches]
                across = (Scaled(whole, laws.split_factor, (self.ends,)), *across)
            seen = self._distributed(end, copper, turns, spread, across, rest)
        else:
            whole = self._with_across(winding)
            seen = Series((whole, frame)) if end == "open" else whole
        outermost = self.outermost_to_frame
        if termination != "short" and self.strap is not None and outermost is None:
            seen = Series((seen, self.strap))
        for attachment in self.outside:
            if ("short" if termination == "short" else "open") not in attachment.terminations:
                continue
            if outermost is None or attachment.to_frame is None:
                seen = attachment.wrap(seen)
            elif termination == "short":
                # The far end is at the analyser, not at the frame: the frame is reached through the strap, and from the far end.
                assert self.strap is not None
                seen = Parallel((seen, Series((attachment.to_frame, Parallel((self.strap, self.frame))))))
            else:
                seen = attachment.wrap(seen)
                if attachment is outermost:
                    assert self.strap is not None
                    seen = Series((seen, self.strap))
        return seen

    @property
    def outermost_to_frame(self) -> Attachment | None:
        """The last part that ends at the frame inside a strap; None without either."""
        if self.strap is None:
            return None
        return next((one for one in reversed(self.attachments) if one.to_frame is not None), None)

    def _with_across(self, winding: Node) -> Node:
        """A winding with the parts that are connected from end to end of it, its first turns included."""
        if not self.across:
            return winding
        inside = winding
        for attachment in self._within_across:
            inside = attachment.wrap(inside)
        return Parallel((*(winding.children if inside is winding else (inside,)), *self.across))

    @property
    def _within_across(self) -> tuple[Attachment, ...]:
        """First turns inside the parts across the winding; none beside a distributed winding, whose first turns are taken to be outside of them."""
        return tuple(one for one in self.attachments if one.place == Outwards.FIRST_TURNS) if self.across and not self.is_line else ()

    @property
    def outside(self) -> tuple[Attachment, ...]:
        """The parts between motor and analyser that are not within parts across the winding."""
        return self.attachments[len(self._within_across) :]

    @property
    def between(self) -> Node:
        """All parts between the ends of a winding that is not distributed."""
        return self._with_across(self.winding)

    @property
    def is_line(self) -> bool:
        """Whether the winding has a distributed capacitance to the frame."""
        return self.spread is not None or self.distribution is not None

    def _distributed(self, termination: str, copper: Node, turns: Sequence[Node], spread: Node, across: Sequence[Node], frame: Node) -> Node:
        """A distributed winding: copper and core, `turns` in parallel with every turn, `spread` to the frame, `across` from end to end.

        With the far end at the analyser, the current to the frame comes back through the strap and the path from frame to far end. A suppressor
        to the frame uses the same way back; that the two influence each other there is neglected, and so is the strap beside a tie.
        """
        bridge = _parallel(across)
        load = frame if termination == "open" else None
        back = None if termination != "short" or self.strap is None else Parallel((self.strap, frame))
        if self.coupled is not None:
            resistance, flux = copper.children
            return Sections(resistance, flux, spread, *self.coupled, _parallel(turns), bridge, load, back)
        series = Parallel((copper, *turns)) if turns else copper
        if bridge is not None and load is not None:
            return Bridged(series, spread, bridge, load)
        line: Node = Line(series, spread, load) if back is None else FloatingLine(series, spread, back)
        return line if bridge is None else Parallel((line, bridge))

    def _insulation(self, name: str) -> Node:
        """The element with all laws that effects have added to it, such as dielectric loss."""
        # `walk` yields parents after their children, so the last match is the outermost.
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

    def used_parameters(self, *terminations: str) -> set[str]:
        """Names of the parameters that these terminations depend on."""
        return {p.name for termination in terminations for node in walk(self.circuit(termination)) for p in node.own_parameters}

    def replaced(self, element: str, change: Callable[[Node], Node]) -> Motor:
        """The motor with one element, together with all laws of its material, changed wherever it occurs."""
        winding, frame = (replace_element(part, element, change) for part in (self.winding, self.frame))
        return dataclasses.replace(self, winding=winding, frame=frame)

    def attached(self, wrap: Callable[[Node], Node], terminations: Terminations = BOTH, place: Outwards = Outwards.LEADS) -> Motor:
        """The motor with one more part between it and the analyser."""
        return self._with(Attachment(wrap, terminations, place))

    def with_part_to_frame(self, branch: Node, terminations: Terminations = BOTH) -> Motor:
        """The motor with a part from its brush to its frame; `open` alone: of a frame that a guard holds during the short-circuit sweep."""
        return self._with(Attachment(lambda node: Parallel((node, branch)), terminations, Outwards.BRUSHES, branch))

    def _with(self, attachment: Attachment) -> Motor:
        # Parts at one place stay in the order in which they are added.
        return dataclasses.replace(self, attachments=tuple(sorted((*self.attachments, attachment), key=lambda one: one.place)))

    def with_branch(self, branch: Node) -> Motor:
        """The motor with one more part of its winding, in parallel with Ca."""
        return dataclasses.replace(self, winding=Parallel((*self.winding.children, branch)))

    def with_across(self, branch: Node) -> Motor:
        """The motor with a part from one end of its winding to the other that does not belong to the winding."""
        return dataclasses.replace(self, across=(*self.across, branch))

    def with_first_turns(self, cell: Node) -> Motor:
        """The motor with a lumped part in series at the winding's terminal, inside all other attachments and parts across the winding."""
        return self._with(Attachment(lambda seen: Series((seen, cell)), place=Outwards.FIRST_TURNS))

    def __repr__(self) -> str:
        return f"Motor(effects={list(self.effects)})"


def _parallel(parts: Sequence[Node]) -> Node | None:
    """Parts in parallel; None if there are none."""
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
