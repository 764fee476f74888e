"""An effect: a function from motor to motor, with its description, parameters and start values."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from motoremi.arrays import JsonDict
from motoremi.errors import BadInput
from motoremi.model.effects.rational_starts import Reader
from motoremi.model.effects.start import Start
from motoremi.model.motor import Motor
from motoremi.model.parameter import Parameter

Group: TypeAlias = Literal["winding", "insulation", "connection", "rotor", "instrument"]
# What a device has to have for an effect to show, from what every winding has to what few have.
Needs: TypeAlias = Literal["winding", "core", "lossy insulation", "part"]
# (motor, place, parameters by short name) -> motor
Change: TypeAlias = Callable[[Motor, str, Mapping[str, Parameter]], Motor]


@dataclass(frozen=True)
class Effect:
    """One entry of the catalogue.

    Parameters
    ----------
    name : str
        Identifier without the place, such as `dielectric-loss`.
    group : str
        Part of the set-up that it belongs to.
    title : str
        Short description.
    places : tuple of str
        Elements it may attach to (`dielectric-loss@Cf`); empty if there is only one place. An empty name is the usual place, which
        need not be written.
    formula : str
        The law as text, in the parameters' short names and `s`; a test compares it with the code.
    parameters : tuple of Parameter
        With ranges; `name` is the short name here.
    limit : str
        Limit in which the effect vanishes.
    limit_values : mapping
        Parameter values close to that limit.
    signature, look_alikes, deciding, source : str
        How it changes the sweeps, which effects look similar, which measurement decides, and the source of formula and ranges.
    change : callable
        Adds the effect to a motor.
    starts : tuple of mapping
        Start values by short name; `Scale("La")` multiplies the element La that the search starts from, `Subtract("Ca")` is subtracted from Ca
        (at most most of it).
    reader : callable, optional
        Computes further start values from the sweeps; `Set("La")` sets the element La.
    responds : mapping
        Measurement of the menu -> parameter -> factor by which that measurement's condition changes the parameter.
    copper : mapping
        Parameter -> power of the resistivity of copper (or aluminium) that it is proportional to; its change with temperature is then known.
    seen_as : tuple of str
        Laws of `inspection.dispersion` that an element with this effect may follow.
    repeatable : bool
        Whether it can be added several times.
    describes : bool
        True for an effect that describes a behaviour without a physical cause: a diagnosis never names it, a person can add it.
    below_hz : float
        The search tries it only if the sweeps begin below this frequency, because it is not visible elsewhere.
    shows_below_hz : float
        At usual sizes it is visible by eye only in sweeps that begin below this frequency.
    of_ranges : bool
        Only analysers that switch ranges by impedance have it: the search does not try it for network analysers.
    tried : mapping
        For a parameter that is not varied: the values among which the search chooses; none for a frequency, which is scanned.
    hides : tuple of str
        Parameters that this effect can mask: if the data do not determine them, they are held at the low end of their range.
    excludes : tuple of str
        Effects that cannot be combined with it.
    beside : mapping
        Place -> another effect without which the circuit is that of the usual place: the search tries this place only beside it.
    imitated : mapping
        Place -> a cause outside the catalogue that has nearly the same impedance there (for a law with a flexible shape) and responds alike to
        every measurement of the menu.
    needs : tuple of str
        Terminations without whose sweep it is not sought.
    less_than : mapping
        Parameters that are smaller than an element of the motor, which would otherwise have exchanged places with the effect.
    exchange : callable, optional
        From its parameters by short name and the motor's elements: the values of all that change if both exchange places.
    damping_ratio : callable, optional
        That of its resonance, which `resistance_ohm` or `quality` damps, from its parameters by short name. Above 1 nothing resonates: such values
        are unusual.
    within : callable, optional
        Inductance of a loop within its conductor over that outside, from its parameters by short name. Above 1 no wire, bar or sleeve is like that:
        such values are unusual.
    odds : float
        Prior odds of it relative to other effects: below 1 for what few DC motors have.
    needs_a : str
        What a device has to have for it: a `winding` has wire and insulation, a `core` or `lossy insulation` (damp, or of lossy layers) only some
        have, and a further `part` (a choke, another winding, a loop, a fault of analyser or fixture) fewer.
    kin : str
        Finer grouping than `group`, for tables, and for which effects are losses of one element. Which effects the *data* cannot distinguish is
        computed and does not depend on it.
    """

    name: str
    group: Group
    title: str
    formula: str
    parameters: tuple[Parameter, ...]
    limit: str
    limit_values: Mapping[str, float]
    signature: str
    look_alikes: tuple[str, ...]
    deciding: str
    source: str
    change: Change
    starts: tuple[Start, ...]
    places: tuple[str, ...] = ()
    repeatable: bool = False
    kin: str = ""
    reader: Reader | None = None
    responds: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    copper: Mapping[str, float] = field(default_factory=dict)
    seen_as: tuple[str, ...] = ()
    describes: bool = False
    below_hz: float = math.inf
    shows_below_hz: float = math.inf
    of_ranges: bool = False
    tried: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    hides: tuple[str, ...] = ()
    beside: Mapping[str, str] = field(default_factory=dict)
    imitated: Mapping[str, str] = field(default_factory=dict)
    excludes: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()
    less_than: Mapping[str, str] = field(default_factory=dict)
    exchange: Callable[[Mapping[str, float]], Mapping[str, float]] | None = None
    damping_ratio: Callable[[Mapping[str, float]], float] | None = None
    within: Callable[[Mapping[str, float]], float] | None = None
    odds: float = 1.0
    needs_a: Needs = "part"

    def has_exchanged(self, label: str, values: Mapping[str, float]) -> bool:
        """Whether it has exchanged places with an element (`less_than`), from values by name; `label` is its own in the motor."""
        return any(values.get(f"{label}.{name}", 0.0) > values.get(element, math.inf) for name, element in self.less_than.items())

    @property
    def family(self) -> str:
        """Grouping for tables: `kin`, or `group` without one."""
        return self.kin or self.group

    @property
    def identifiers(self) -> tuple[str, ...]:
        """All names under which it can be added."""
        return tuple(f"{self.name}@{place}" if place else self.name for place in self.places) or (self.name,)

    def to_dict(self) -> JsonDict:
        """Plain data of the description."""
        plain = {key: getattr(self, key) for key in ("name", "group", "title", "formula", "limit", "signature", "deciding", "source", "repeatable")}
        plain["identifiers"] = list(self.identifiers)
        plain["look_alikes"] = list(self.look_alikes)
        plain["parameters"] = [
            {"name": p.name, "unit": p.unit, "low": p.low, "high": p.high, "usual": p.usual and list(p.usual), "reason": p.reason}
            for p in self.parameters
        ]
        return plain


@dataclass(frozen=True)
class AddedEffect:
    """An effect at a place, ready to be added."""

    effect: Effect
    identifier: str
    place: str
    held: Mapping[str, float] = dataclasses.field(default_factory=dict)

    @property
    def imitated_by(self) -> str:
        """Something outside the catalogue with nearly the same impedance; empty if nothing is known."""
        return self.effect.imitated.get(self.place, "")

    def added_to(self, motor: Motor) -> Motor:
        """The motor with this effect.

        Raises
        ------
        BadInput
            If the motor has it already and it is not repeatable, or has an effect that excludes it.
        """
        if obstacle := self._obstacle(motor):
            raise BadInput(obstacle)
        label = self.label_in(motor)
        parameters = {p.name: dataclasses.replace(p, name=f"{label}.{p.name}") for p in self.effect.parameters}
        changed = self.effect.change(motor, self.place, parameters)
        return dataclasses.replace(changed, effects=(*motor.effects, self.identifier))

    def differs_in(self, motor: Motor) -> bool:
        """Whether its place makes a difference in a motor (`Effect.beside`)."""
        other = self.effect.beside.get(self.place)
        return other is None or any(split_identifier(name)[0] == other for name in motor.effects)

    def fits(self, motor: Motor) -> bool:
        """Whether it can be added to a motor."""
        return not self._obstacle(motor)

    def _obstacle(self, motor: Motor) -> str:
        """Why it cannot be added to a motor; empty if it can."""
        for name in motor.effects:
            if split_identifier(name)[0] in self.effect.excludes:
                return f"{self.identifier} and {name} describe the same thing: drop {name} first"
        if self.identifier in motor.effects and not self.effect.repeatable:
            return f"{self.identifier} is in the model already; drop it first or add another effect"
        return ""

    def label_in(self, motor: Motor) -> str:
        """Prefix of its parameters after it has been added to `motor`."""
        count = motor.effects.count(self.identifier)
        return self.identifier if not count else f"{self.identifier}#{count + 1}"


def split_identifier(text: str) -> tuple[str, str]:
    """`name@element` in its two parts; the second may be empty."""
    match = re.fullmatch(r"([a-z][a-z-]*)(?:@([A-Za-z]+))?", text)
    if match is None:
        raise BadInput(f"{text!r} is not an effect: write for example 'eddy-laminations' or 'dielectric-loss@Cf'")
    return match.group(1), match.group(2) or ""
