"""Motor and path as a SPICE netlist, for checks and for other programs."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping

from motoremi.emission.path import Path
from motoremi.errors import BadInput
from motoremi.model import laws
from motoremi.model.circuit import Leaf, Node, Parallel, Series
from motoremi.model.motor import Motor

_LETTERS = {laws.resistor: "R", laws.inductor: "L", laws.capacitor: "C"}


def emission_netlist(motor: Motor, values: Mapping[str, float], path: Path) -> str:
    """SPICE lines: source `Vsource` of 1 V (AC), motor, stray capacitance, cable, both LISNs; the receiver is between `receiver` and `0`.

    Parameters
    ----------
    motor : Motor
        Of resistors, inductors and capacitors only.
    values : mapping
        Its parameters, SI units.
    path : Path

    Raises
    ------
    BadInput
        If an effect of the motor's model has no exact circuit of R, L and C.
    """
    return "\n".join(_lines(motor, values, path)) + "\n"


def _lines(motor: Motor, values: Mapping[str, float], path: Path) -> Iterator[str]:
    common = path.mode == "common"
    yield "Vsource emf 0 ac 1" if common else "Vsource emf back ac 1"
    yield from _part(motor.circuit("open" if common else "short"), "emf", "terminal", values, itertools.count(1))
    yield from path_lines(path)


def path_lines(path: Path) -> Iterator[str]:
    """SPICE lines from the motor's node `terminal` to the receiver: stray capacitance, cable, both LISNs."""
    common = path.mode == "common"
    home = "0" if common else "back"
    if path.stray_f:
        yield f"Cstray terminal {home} {path.stray_f:.12g}"
    port = "terminal"
    if path.cable is not None:
        cable, port = path.cable, "port"
        henry, farad = cable.impedance_ohm / cable.velocity_m_s, 1 / (cable.impedance_ohm * cable.velocity_m_s)
        yield f"Ocable terminal {home} port {home} line"
        yield f".model line ltra r={cable.resistance_ohm_per_m:.12g} l={henry:.12g} c={farad:.12g} g=0 len={cable.length_m:.12g}"
    yield from _lisn(path, "1", port, "receiver")
    # In the differential mode the current returns through the second LISN, whose receiver voltage has the opposite sign.
    yield from _lisn(path, "2", port if common else "back", "other")


def _lisn(path: Path, name: str, port: str, receiver: str) -> Iterator[str]:
    lisn = path.lisn
    yield f"Llisn{name} {port} choke{name} {lisn.inductance_h:.12g}"
    yield f"Rlisn{name} choke{name} 0 {max(lisn.series_ohm, 1e-9):.12g}"
    coupling = f"Rcouple{name} {port} {receiver} 1e-9" if lisn.coupling_f is None else f"Ccouple{name} {port} {receiver} {lisn.coupling_f:.12g}"
    yield coupling
    yield f"Rreceiver{name} {receiver} 0 {lisn.receiver_ohm:.12g}"


def _part(node: Node, first: str, second: str, values: Mapping[str, float], numbers: Iterator[int]) -> Iterator[str]:
    if isinstance(node, Series):
        inner = [f"n{next(numbers)}" for _ in node.members[1:]]
        for member, start, end in zip(node.members, (first, *inner), (*inner, second), strict=True):
            yield from _part(member, start, end, values, numbers)
    elif isinstance(node, Parallel):
        for member in node.members:
            yield from _part(member, first, second, values, numbers)
    elif isinstance(node, Leaf) and node.law in _LETTERS:
        (parameter,) = node.parameters
        yield f"{_LETTERS[node.law]}{node.name.replace('.', '_').replace('-', '_')} {first} {second} {values[parameter.name]:.12g}"
    else:
        raise BadInput("effects in this model have no exact circuit of R, L and C; write the netlist of the paper's circuit")
