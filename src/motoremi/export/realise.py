"""A fitted motor as a network of ideal parts between terminal, far end and frame."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.errors import BadInput
from motoremi.export.ideal_network import Coils, Element, InParallel, InSeries, Part, resonant_loop
from motoremi.export.law_ladders import Ladder, ladder_of
from motoremi.model import laws, materials
from motoremi.model.circuit import Bridged, Leaf, Line, Node, Parallel, Scaled, Series, Superposed, Tape, walk
from motoremi.model.motor import Motor
from motoremi.model.sections import Sections, linked_flux

# Factor by which the fit of ladders extends beyond the measured span, so that they are still valid near its ends in a transient run.
_MARGIN = 3.0
_POINTS_PER_DECADE = 40
_LARGEST_NUMBER_OF_SECTIONS = 512
# Largest error because of the sections of a distributed winding: half of that of the whole netlist (0.05 dB, 0.5 degree).
_SECTION_DB, _SECTION_DEG = 0.025, 0.25
# Largest error of a cable's electrical length because of its sections, in radians: a tenth of that, since a resonance multiplies it.
_CABLE_RAD = 4e-4


@dataclass(frozen=True)
class Realisation:
    """A motor in ideal parts.

    Parameters
    ----------
    outside : tuple of (str, Part)
        From the terminal inwards: `series` parts (leads), `shunt` parts to the frame, and `housing` parts to the motor's side of the strap.
    winding : Part or Coils
        Between the terminal and the far end; one section of a distributed winding.
    frame : Part or None
        Between the far end and the frame; None without an open-circuit sweep.
    sections : int
        Number of sections of a distributed winding, otherwise 1.
    spread : Part or None
        Impedance to the frame of one section.
    across : Part or None
        Between the ends of a distributed winding.
    strap : Part or None
        Between the motor's own frame, where `spread`, `frame` and `housing` parts end, and the frame of the analyser; None where they are one.
    ladder_errors : dict
        Largest relative error of each dispersive element.
    """

    outside: tuple[tuple[str, Part], ...]
    winding: Part | Coils
    frame: Part | None
    sections: int = 1
    spread: Part | None = None
    across: Part | None = None
    strap: Part | None = None
    ladder_errors: Mapping[str, float] = field(default_factory=dict)

    def impedance(self, termination: str, frequency_hz: FloatArray) -> ComplexArray:
        """Impedance between terminal and frame, with the far end open, or connected to the frame."""
        s: ComplexArray = np.asarray(2j * np.pi * frequency_hz, dtype=np.complex128)
        load = None
        if termination == "open":
            if self.frame is None:
                raise BadInput("no open-circuit sweep: the frame's side of the motor is not known")
            load = self.frame.impedance(s)
        back = None
        if self.strap is not None and self.frame is not None:
            back = 1 / (1 / self.strap.impedance(s) + 1 / self.frame.impedance(s))
        seen = self._through_winding(s, load, back if termination == "short" else None)
        outermost = next((place for place, (kind, _) in enumerate(self.outside) if kind == "housing"), None)
        if outermost is None and termination == "open" and self.strap is not None:
            seen = seen + self.strap.impedance(s)
        for place, (kind, part) in reversed(list(enumerate(self.outside))):
            own = part.impedance(s)
            if kind == "housing" and termination == "short" and back is not None:
                own = own + back
            seen = seen + own if kind == "series" else 1 / (1 / seen + 1 / own)
            if place == outermost and termination == "open" and self.strap is not None:
                seen = seen + self.strap.impedance(s)
        return seen

    def _through_winding(self, s: ComplexArray, load: ComplexArray | None, back: ComplexArray | None) -> ComplexArray:
        """From the terminal to a far end with a load to the frame, or to one at the analyser, which reaches the frame through `back`."""
        if isinstance(self.winding, Coils):
            own, through = self._coupled_ends(s, self.winding)
        else:
            series = self.winding.impedance(s)
            if self.spread is None:
                return series if load is None else series + load
            own, through = self._ends(s, series, 1 / self.spread.impedance(s))
        if back is not None:
            # The currents to the frame from both ends at the same voltage.
            even = own - through
            own = own - even**2 / (2 * even + 1 / back)
        if self.across is not None:
            bridge = 1 / self.across.impedance(s)
            own, through = own + bridge, through + bridge
        return 1 / own if load is None else 1 / (own - through**2 / (own + 1 / load))

    def _ends(self, s: ComplexArray, series: ComplexArray, shunt: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Admittance at either end of the chain of sections with the other end shorted, and transfer admittance between the ends.

        Each section has half of its shunt admittance at each end. The length of the chain is doubled until all sections are included.
        """
        own, through = 1 / series + shunt / 2, 1 / series
        for _ in range(self.sections.bit_length() - 1):
            shared = through / (2 * own)
            own, through = own - through * shared, through * shared
        return own, through

    def _coupled_ends(self, s: ComplexArray, coils: Coils) -> tuple[ComplexArray, ComplexArray]:
        """The same for coils that are coupled by their flux: the admittance matrix with the inner nodes eliminated."""
        assert self.spread is not None
        count = self.sections
        drop = np.eye(count, count + 1) - np.eye(count, count + 1, 1)
        halves = np.concatenate([[0.5], np.ones(count - 1), [0.5]])
        whole = drop.T @ coils.admittance(s, count) @ drop + np.diag(halves) / self.spread.impedance(s)[:, None, None]
        ends, inside = [0, count], np.arange(1, count)
        seen = whole[:, ends][:, :, ends]
        if count > 1:
            cross = whole[:, inside][:, :, ends]
            seen = seen - whole[:, ends][:, :, inside] @ np.linalg.solve(whole[:, inside][:, :, inside], cross)
        return seen[:, 0, 0], -seen[:, 0, 1]


class _Builder:
    """Converts circuit nodes to parts, for one set of values and one span."""

    def __init__(self, values: Mapping[str, float], span_hz: tuple[float, float]) -> None:
        self.values, self.span_hz = values, span_hz
        low, high = span_hz[0] / _MARGIN, span_hz[1] * _MARGIN
        self.frequency_hz = np.geomspace(low, high, max(60, int(_POINTS_PER_DECADE * np.log10(high / low))))
        self.errors: dict[str, float] = {}

    def part(self, node: Node) -> Part:
        """The part for one node."""
        if isinstance(node, Series):
            return InSeries(tuple(self.part(member) for member in node.members))
        if isinstance(node, Parallel):
            return InParallel(tuple(self.part(member) for member in node.members))
        return self._exact(node) or self._fitted(self._ladder_of(node))

    def _exact(self, node: Node) -> Part | None:
        """The same impedance in few parts, if there are such; only losses of a core that relaxes are a ladder."""
        if isinstance(node, Leaf):
            return self._leaf(node)
        return (self._scaled(node) if isinstance(node, Scaled) else None) or self._relaxing(node)

    def _own(self, node: Node) -> list[float]:
        return [self.values[parameter.name] for parameter in node.own_parameters]

    def _leaf(self, leaf: Leaf) -> Part | None:
        name, own = _word(leaf.name), self._own(leaf)
        if leaf.law in (laws.resistor, laws.inductor, laws.capacitor):
            kind = {laws.resistor: "R", laws.inductor: "L", laws.capacitor: "C"}[leaf.law]
            return Element(kind, name, own[0])  # type: ignore[arg-type]
        if leaf.law is laws.resistance_and_inductance:
            return InSeries((Element("R", name, own[0]), Element("L", name, own[1])))
        if leaf.law is laws.resonant_branch:
            capacitance, resonance_hz, quality = own
            reactance = 1 / (2 * np.pi * resonance_hz * capacitance)
            inductance = reactance / (2 * np.pi * resonance_hz)
            return InSeries((Element("R", name, reactance / quality), Element("L", name, inductance), Element("C", name, capacitance)))
        if leaf.law is laws.resonant_cell:
            return _cell(name, *own)
        return None

    def _scaled(self, node: Scaled) -> Part | None:
        if node.law is laws.split_factor:
            return self.part(node.child).scaled(1 / self._own(node)[0])
        if node.law is laws.rest_factor:
            return self.part(node.child).scaled(1 / (1 - self._own(node)[0]))
        if node.law is laws.lossy_coupled_winding_factor and isinstance(node.child, Leaf) and node.child.law is laws.inductor:
            coupling, resonance_hz, quality, across_share = self._own(node)
            name, inductance, w = _word(node.child.name), self._own(node.child)[0], 2 * np.pi * resonance_hz
            loop = resonant_loop(name, coupling**2 * inductance, w, w / quality, across_share)
            return InSeries((Element("L", name, (1 - coupling**2) * inductance), loop))
        return None

    def _relaxing(self, node: Node) -> Part | None:
        """An inductance whose core relaxes, once or several times, in series with what other laws of the core leave."""
        changes = node.changed if isinstance(node, Superposed) else (node,)
        relaxing = [
            change
            for change in changes
            if isinstance(change, Scaled) and change.law is materials.permeability_factor and isinstance(change.child, Leaf)
        ]
        left = 1 - sum(self._own(change)[0] for change in relaxing)
        if not relaxing or left <= 0:
            return None
        known = dict(self.errors)
        cells = InSeries(tuple(self._relaxation(change) for change in relaxing))
        if len(changes) > len(relaxing):
            rest, whole = self._ladder_of(node, cells), self._ladder_of(node)
            if rest.error < whole.error:
                return InSeries((cells, self._fitted(rest)))
            # The cells are not part of the network, nor are their errors.
            self.errors = known
            return self._fitted(whole)
        inductor = relaxing[0].child
        assert isinstance(inductor, Leaf)
        return InSeries((cells, Element("L", _word(inductor.name), left * self._own(inductor)[0])))

    def _relaxation(self, node: Scaled) -> Part:
        """The share of an inductance that relaxes: s L / (1 + x^a + (Q x)^2) is L, C and an element s^(1 - a) in parallel."""
        share, corner_hz, exponent, quality = self._own(node)
        corner, name = 2 * np.pi * corner_hz, _word(next(part.name for part in walk(node) if isinstance(part, Leaf)))
        inductance = share * self._own(node.child)[0]
        s: ComplexArray = np.asarray(2j * np.pi * self.frequency_hz, dtype=np.complex128)
        loss = self._fitted(ladder_of(f"{name}_loss", self.frequency_hz, inductance * corner**exponent * s ** (1 - exponent)))
        capacitance = quality**2 / (corner**2 * inductance)
        return InParallel((Element("L", f"{name}_core", inductance), Element("C", f"{name}_core", capacitance), loss))

    def _ladder_of(self, node: Node, without: Part | None = None) -> Ladder:
        """A ladder for a node, or for what it has in series with a part that is known."""
        name = _word(next((part.name for part in walk(node) if isinstance(part, Leaf)), "part"))
        loops = [self._own(part)[1:3] for part in walk(node) if isinstance(part, Scaled) and part.law is laws.lossy_coupled_winding_factor]
        # A narrow resonance needs additional points.
        near = [resonance_hz * np.exp(np.linspace(-6, 6, 120) / max(quality, 5.0)) for resonance_hz, quality in loops]
        frequency = np.unique(np.concatenate((self.frequency_hz, *near)))
        resonances = tuple((2 * np.pi * resonance_hz, quality) for resonance_hz, quality in loops)
        target = impedance_of(node, self.values, frequency)
        if without is not None:
            target = target - without.impedance(np.asarray(2j * np.pi * frequency, dtype=np.complex128))
        return ladder_of(name, frequency, target, resonances)

    def _fitted(self, ladder: Ladder) -> Part:
        self.errors[ladder.name] = max(ladder.error, self.errors.get(ladder.name, 0.0))
        return ladder.part


def impedance_of(node: Node, values: Mapping[str, float], frequency_hz: FloatArray) -> ComplexArray:
    """Impedance of a circuit in ohm."""
    names = list(dict.fromkeys(p.name for part in walk(node) for p in part.own_parameters))
    s: ComplexArray = np.asarray(2j * np.pi * frequency_hz, dtype=np.complex128)
    return Tape(node, names).impedance(s, np.array([values[name] for name in names]))


def realise(motor: Motor, values: Mapping[str, float], span_hz: tuple[float, float], with_frame: bool = True) -> Realisation:
    """The motor in ideal parts, within the stated errors over a span.

    Parameters
    ----------
    motor : Motor
        Without effects of the analyser.
    values : mapping
        Values of all its parameters, SI units.
    span_hz : tuple
        Span over which the ladders are fitted.
    with_frame : bool
        False if the path to the frame is not known.

    Raises
    ------
    BadInput
        If an element differs between the two sweeps, or a user's effect changes the motor in a way that has no equivalent of ideal parts.
    """
    if motor.open_factors:
        differing = ", ".join(factor.element for factor in motor.open_factors)
        raise BadInput(
            f"{differing} differs between the short- and the open-circuit sweep: no one network is both; drop common-mode-flux for this export"
        )
    builder = _Builder(values, span_hz)
    strap = builder.part(motor.strap) if with_frame and motor.strap is not None else None
    outside: tuple[tuple[str, Part], ...] = ()
    for one in reversed(motor.outside):
        if strap is not None and one.to_frame is not None:
            outside += (("housing", builder.part(one.to_frame)),)
        else:
            outside += _outside(builder, one.wrap(_PLACEHOLDER))
    seen = _bare(motor).circuit("open" if with_frame else "short")
    if isinstance(seen, Sections):
        return _coupled(builder, outside, seen, strap)
    line, across = _line_of(seen)
    frame = builder.part(motor.frame if line is None or line.load is None else line.load) if with_frame else None
    if line is None:
        return Realisation(outside, builder.part(motor.between), frame, strap=strap, ladder_errors=builder.errors)
    winding, spread = builder.part(line.series), builder.part(line.shunt)
    bridge = None if across is None else builder.part(across)
    terminations = ("short", "open") if frame is not None else ("short",)
    frequency = np.geomspace(*span_hz, 400)
    wanted = {termination: impedance_of(motor.circuit(termination), values, frequency) for termination in terminations}
    sections = 8
    while True:
        part, slots = winding.scaled(1 / sections), spread.scaled(sections)
        result = Realisation(outside, part, frame, sections, slots, bridge, strap, builder.errors)
        errors = [deviation(result.impedance(termination, frequency), wanted[termination]) for termination in terminations]
        if sections >= _LARGEST_NUMBER_OF_SECTIONS or all(db < _SECTION_DB and deg < _SECTION_DEG for db, deg in errors):
            return result
        sections *= 2


def _coupled(builder: _Builder, outside: tuple[tuple[str, Part], ...], seen: Sections, strap: Part | None) -> Realisation:
    """A winding of coils that are coupled by their flux.

    Raises
    ------
    BadInput
        If La has a law of its core: coupled coils of ideal parts cannot represent it.
    """
    if not (isinstance(seen.flux, Leaf) and seen.flux.law is laws.inductor):
        raise BadInput(
            "La has a law of its core, which coupled coils of ideal parts cannot represent: drop that effect, or winding-sections, for this export"
        )
    count, coupling = round(builder.values[seen.number.name]), builder.values[seen.coupling.name]
    copper, spread = builder.part(seen.copper).scaled(1 / count), builder.part(seen.shunt).scaled(count)
    turns = None if seen.turns is None else builder.part(seen.turns).scaled(1 / count)
    coils = Coils(copper, builder.values["La"] / float(linked_flux(count, coupling)[0]), coupling, turns)
    across, frame = (None if node is None else builder.part(node) for node in (seen.across, seen.load))
    return Realisation(outside, coils, frame, count, spread, across, strap, builder.errors)


def deviation(got: ComplexArray, wanted: ComplexArray) -> tuple[float, float]:
    """Largest error of magnitude in dB and of phase in degrees."""
    ratio = got / wanted
    return float(np.abs(20 * np.log10(np.abs(ratio))).max()), float(np.abs(np.angle(ratio, deg=True)).max())


_PLACEHOLDER = Leaf("motor", laws.resistor, ())


def _bare(motor: Motor) -> Motor:
    """The motor without attachments and strap."""
    return dataclasses.replace(motor, open_factors=(), attachments=(), strap=None)


def _line_of(seen: Node) -> tuple[Line | None, Node | None]:
    """The line of a distributed winding, and the part across its ends."""
    if isinstance(seen, Bridged):
        return Line(seen.series, seen.shunt, seen.load), seen.across
    if isinstance(seen, Parallel) and isinstance(seen.members[0], Line):
        return seen.members[0], Parallel(seen.members[1:])
    return (seen if isinstance(seen, Line) else None), None


def _outside(builder: _Builder, wrapped: Node) -> tuple[tuple[str, Part], ...]:
    if isinstance(wrapped, Line) and wrapped.load == _PLACEHOLDER:
        return _cable(builder, wrapped)
    if isinstance(wrapped, (Series, Parallel)):
        others = tuple(member for member in wrapped.members if _PLACEHOLDER not in walk(member))
        if len(others) == len(wrapped.members) - 1 and _PLACEHOLDER in wrapped.members:
            parts = tuple(builder.part(member) for member in others)
            return (("series", InSeries(parts)) if isinstance(wrapped, Series) else ("shunt", InParallel(parts)),)
    raise BadInput("an effect wraps the motor in a way that has no equivalent of resistors, inductors and capacitors; drop it for this export")


def _cable(builder: _Builder, line: Line) -> tuple[tuple[str, Part], ...]:
    """A cable in sections, each with half of its capacitance at either end.

    The electrical length of a section of theta radians is too large by theta^3 / 24.
    """
    series, shunt = builder.part(line.series), builder.part(line.shunt)
    highest: ComplexArray = np.array([2j * np.pi * builder.span_hz[1]])
    angle = float(np.sqrt(np.abs(series.impedance(highest) / shunt.impedance(highest)))[0])
    count = min(int(np.ceil(np.sqrt(angle**3 / (24 * _CABLE_RAD)))) + 1, _LARGEST_NUMBER_OF_SECTIONS)
    part, slot = ("series", series.scaled(1 / count)), ("shunt", shunt.scaled(count))
    end = ("shunt", shunt.scaled(2 * count))
    return (end, *(part, slot) * (count - 1), part, end)


def _word(name: str) -> str:
    """A name that every simulator accepts."""
    return "".join(c if c.isascii() and c.isalnum() else "_" for c in name)


def _cell(name: str, inductance: float, resonance_hz: float, resistance: float, series_share: float) -> Part:
    """The admittance of `laws.resonant_cell`, divided into C, a resistance across, and R with L in series."""
    capacitance = 1 / ((2 * np.pi * resonance_hz) ** 2 * inductance)
    copper = series_share * inductance / (capacitance * resistance)
    across = (1 - series_share) / resistance
    rest = 1 - copper * across
    coil: list[Part] = [Element("L", name, inductance / rest)]
    if copper > 0:
        coil.append(Element("R", f"{name}_copper", copper / rest))
    parts: list[Part] = [InSeries(tuple(coil)), Element("C", name, capacitance)]
    if across > 0:
        parts.append(Element("R", name, 1 / across))
    return InParallel(tuple(parts))
