"""Discrete models of fields and materials made of ideal parts: one-ports between the nodes `in` and `out`.

Each function divides a continuous medium into cells and returns the resistors, inductors and capacitors of the cells;
no closed form is used. The meshes are graded: fine near the surface, to which the field is confined at the highest frequency, and coarse
inside.
"""

from __future__ import annotations

import dataclasses
from itertools import pairwise
from typing import Literal

import numpy as np

from motoremi.arrays import FloatArray
from motoremi.errors import BadInput
from motoremi.simulate.parts import IN, OUT, Block, Network, Part

MU_0 = 4e-7 * np.pi  # H/m; the 2019 SI differs in the tenth digit
COPPER_S_PER_M = 5.8e7  # at 20 degC
# The models are valid from 40 Hz to 110 MHz, the range of a 4294A.
LOWEST_HZ, HIGHEST_HZ = 40.0, 110e6
# Size of the first cell in units of the penetration depth at HIGHEST_HZ, and ratio of the sizes of neighbouring cells.
_FIRST_CELL, _GROWTH = 0.01, 1.01
_BRANCHES_PER_DECADE = 4
_DECADES_BEYOND = 4
LINE_CELLS = 1200
# Distribution of time constants: cells per decade, extent to either side of the middle (natural logarithm), and factor above HIGHEST_HZ up to
# which each cell is a separate part.
_CORES_PER_DECADE, _SPREAD, _FAR_ABOVE = 4, 40.0, 1000.0


def graded_faces(depth: float, refine: int = 1) -> FloatArray:
    """Cell faces from 0 (surface) to 1 (middle) for a field that penetrates `depth` of the way at the highest frequency.

    Parameters
    ----------
    depth : float
        Penetration depth at `HIGHEST_HZ` over the length of the mesh.
    refine : int
        Number of parts into which every cell is divided, for convergence checks.
    """
    first, growth = _FIRST_CELL * depth, _GROWTH
    cells = max(8, int(np.ceil(np.log1p((growth - 1) / first) / np.log(growth)))) if first < 1 else 8
    faces = np.concatenate(([0.0], np.cumsum(growth ** np.arange(cells))))
    coarse: FloatArray = faces / faces[-1]
    return np.interp(np.arange(cells * refine + 1) / refine, np.arange(cells + 1), coarse)


def diffusion_ladder(henry: FloatArray, siemens: FloatArray, end: Literal["open", "short"]) -> Network:
    """Series inductors with a shunt resistor at every node: magnetic diffusion from a surface.

    Parameters
    ----------
    henry : ndarray, shape (n,)
        Flux of each cell per ampere.
    siemens : ndarray, shape (n + 1,)
        Conductance of the current path at each node, the surface first.
    end : {"open", "short"}
        `open`: no current beyond the last node. `short`: no electric field there, by symmetry.
    """
    nodes = [IN, *(f"n{number}" for number in range(1, henry.size)), OUT if end == "short" else f"n{henry.size}"]
    parts = [Part("L", f"l{number}", *ends, float(value)) for number, (ends, value) in enumerate(zip(pairwise(nodes), henry, strict=True), start=1)]
    parts += [
        Part("R", f"r{number}", node, OUT, float(1 / value)) for number, (node, value) in enumerate(zip(nodes, siemens, strict=True)) if node != OUT
    ]
    return Network(tuple(parts))


def half_sheet(henry: float, diffusion_time_s: float, end: Literal["open", "short"], refine: int = 1) -> Network:
    """Diffusion through half a conducting sheet, surface to middle.

    Parameters
    ----------
    henry : float
        Inductance of the whole half sheet when the field is uniform in it.
    diffusion_time_s : float
        mu * sigma * (half thickness)^2.
    end : {"open", "short"}
        `short` for a sheet in a field that is the same on both faces (lamination); `open` for a sheet that carries a current.
    """
    siemens = diffusion_time_s / henry
    faces = graded_faces(float(1 / np.sqrt(np.pi * HIGHEST_HZ * diffusion_time_s)), refine)
    middles = np.concatenate(([0.0], (faces[1:] + faces[:-1]) / 2, [1.0]))
    return diffusion_ladder(henry * np.diff(faces), siemens * np.diff(middles), end)


def lamination(henry: float, corner_hz: float, refine: int = 1) -> Network:
    """Flux through laminations: `henry` at low frequency, eddy currents above `corner_hz` = 4 / (pi mu sigma d^2)."""
    return half_sheet(henry, 1 / (np.pi * corner_hz), "short", refine)


def round_wire(ohm: float, radius_m: float, conductivity_s_per_m: float = COPPER_S_PER_M, refine: int = 1) -> Network:
    """Inside of a round wire in concentric shells: resistance and internal inductance.

    Parameters
    ----------
    ohm : float
        DC resistance; with radius and conductivity it sets the length.
    radius_m, conductivity_s_per_m : float
    """
    length = ohm * conductivity_s_per_m * np.pi * radius_m**2
    depth = 1 / np.sqrt(np.pi * HIGHEST_HZ * MU_0 * conductivity_s_per_m)
    # The mesh ends close to the axis, where a shell would have no flux; the last node represents the remaining disc.
    radii = radius_m * (1 - 0.999 * graded_faces(float(depth / radius_m), refine))
    middles = np.concatenate(([radius_m], (radii[1:] + radii[:-1]) / 2, [0.0]))
    henry = MU_0 * length / (2 * np.pi) * np.log(radii[:-1] / radii[1:])
    siemens = conductivity_s_per_m * np.pi / length * (middles[:-1] ** 2 - middles[1:] ** 2)
    return diffusion_ladder(henry, siemens, "open")


def wire_inductance(ohm: float, radius_m: float, conductivity_s_per_m: float = COPPER_S_PER_M) -> float:
    """Internal inductance of the round wire in a uniform current, in henry: mu_0 / (8 pi) per metre."""
    return MU_0 / 8 * radius_m**2 * conductivity_s_per_m * ohm


def foil_winding(ohm: float, height_m: float, layers: int, conductivity_s_per_m: float = COPPER_S_PER_M, refine: int = 1) -> Network:
    """Layers of foil, each in the field of the others.

    The field of a layer's own current has opposite directions at its two faces, the field of the layers below it the same direction.
    The two parts do not exchange power, so that a layer is the sum of two half sheets: one that carries a current and one in an external
    field. Layer p of m is in (2p - 1)/2 times the field of one layer; sum (2p - 1)^2 = m (4m^2 - 1)/3.

    Parameters
    ----------
    ohm : float
        DC resistance of all layers in series.
    height_m : float
        Height of a layer.
    layers : int
    conductivity_s_per_m : float
        Of the copper, times the part of the layer's width that is copper.
    """
    half = height_m / 2
    time = MU_0 * conductivity_s_per_m * half**2
    # R of one layer is length / (sigma width height); mu_0 length half / width follows from it.
    henry = MU_0 * half * (ohm / layers) * conductivity_s_per_m * height_m
    own = half_sheet(henry, time, "open", refine)
    field = half_sheet(henry, time, "short", refine)
    return Network(
        (
            Block("own", IN, "middle", own, layers / 2),
            Block("field", "middle", OUT, field, layers * (4 * layers**2 - 1) / 6),
        )
    )


def foil_inductance(ohm: float, height_m: float, layers: int, conductivity_s_per_m: float = COPPER_S_PER_M) -> float:
    """Flux inside and between the layers at low frequency, in henry: the field rises linearly over all layers.

    Integral of mu_0 H^2 over m layers of height h whose field is (p - 1 .. p) / width: mu_0 length h m^3 / (3 width).
    """
    return MU_0 * conductivity_s_per_m * height_m**2 * layers**2 / 3 * ohm


def constant_phase(farad: float, tan_delta: float, reference_hz: float = 1e6, per_decade: int = 0) -> Network:
    """Capacitance with a constant loss angle: R-C branches evenly spaced in log time constant.

    The branches reach four decades beyond 40 Hz and 110 MHz; faster ones are purely capacitive and are combined into one capacitor.

    Parameters
    ----------
    farad : float
        |C| at `reference_hz`.
    tan_delta : float
    reference_hz : float
    per_decade : int
        Branches per decade; 0 for the default.
    """
    if not 0 < tan_delta < 1:
        raise BadInput(f"tan delta {tan_delta} is outside 0 .. 1")
    count = per_decade or _BRANCHES_PER_DECADE
    exponent = 2 / np.pi * np.arctan(tan_delta)
    low = np.log10(LOWEST_HZ) - _DECADES_BEYOND
    high = np.log10(HIGHEST_HZ) + _DECADES_BEYOND
    corners = 10 ** np.arange(low, high, 1 / count)
    times = 1 / (2 * np.pi * corners)
    # Branches C_i ~ time^exponent; those beyond the fastest are a geometric series.
    weights = times**exponent
    ratio = 10 ** (-exponent / count)
    rest = weights[-1] * ratio / (1 - ratio)
    at_reference = rest + np.sum(weights / (1 + 2j * np.pi * reference_hz * times))
    unit = farad / abs(at_reference)
    network = Network().capacitor("fast", IN, OUT, float(unit * rest))
    parts = []
    for number, (time, weight) in enumerate(zip(times, weights, strict=True)):
        parts += [
            Part("C", f"c{number}", IN, f"n{number}", float(unit * weight)),
            Part("R", f"r{number}", f"n{number}", OUT, float(time / (unit * weight))),
        ]
    return network.plus(*parts)


def lossy_capacitor(farad: float, tan_delta: float) -> Network:
    """`constant_phase`, or an ideal capacitor if the loss tangent is zero: motors stored by earlier versions have none."""
    return constant_phase(farad, tan_delta) if tan_delta else Network().capacitor("c", IN, OUT, farad)


def resistive_line(ohm: float, farad: float, refine: int = 1) -> Network:
    """Line with series resistance and shunt capacitance, open at the end: diffusion of charge (Warburg)."""
    faces = graded_faces(float(1 / np.sqrt(np.pi * HIGHEST_HZ * ohm * farad)), refine)
    middles = np.concatenate(([0.0], (faces[1:] + faces[:-1]) / 2, [1.0]))
    nodes = [IN, *(f"n{number}" for number in range(1, faces.size))]
    parts = [
        Part("R", f"r{number}", *ends, float(ohm * share)) for number, (ends, share) in enumerate(zip(pairwise(nodes), np.diff(faces), strict=True))
    ]
    parts += [
        Part("C", f"c{number}", node, OUT, float(farad * share)) for number, (node, share) in enumerate(zip(nodes, np.diff(middles), strict=True))
    ]
    return Network(tuple(parts))


def winding_line(winding: Network, slots: Part | Block, start: str, end: str, cells: int, prefix: str = "") -> tuple[Block | Part, ...]:
    """A winding or cable divided into cells, with its impedance to the frame distributed along it; the end nodes have half a share.

    Parameters
    ----------
    winding : Network
        The whole winding between `in` and `out`.
    slots : Part or Block
        Impedance of the whole winding to the frame, which is its negative node.
    start, end : str
        Nodes of the outer network.
    cells : int
    prefix : str
        Of the names of parts and nodes, if the network has another line.
    """
    nodes = [start, *(f"{prefix}turn{number}" for number in range(1, cells)), end]
    items: list[Block | Part] = [Block(f"{prefix}cell{number}", *ends, winding, 1 / cells) for number, ends in enumerate(pairwise(nodes))]
    for number, node in enumerate(nodes):
        whole = slots.scaled(cells * (2.0 if node in (start, end) else 1.0))
        items.append(dataclasses.replace(whole, name=f"{prefix}slot{number}", positive=node))
    return tuple(items)


def spread_relaxation(henry: float, corner_hz: float, exponent: float, per_decade: int = 0) -> Network:
    """Inductance with a distribution of time constants: cells of R parallel L, evenly spaced in log corner frequency.

    The inductance is divided among the cells according to the distribution of Cole and Cole (J. Chem. Phys. 9 (1941) 341). Cells beyond the
    band are purely inductive or purely resistive and are combined into one inductor and one resistor. From 100 Hz to 30 MHz the error is below
    1e-4 for exponents of 0.55 to 0.75.

    Parameters
    ----------
    henry : float
        Inductance at low frequency.
    corner_hz : float
        Corner frequency of the middle cell.
    exponent : float
        Above 0, below 1: the smaller, the wider the distribution.
    per_decade : int
        Cells per decade; 0 for the default.
    """
    if not 0 < exponent < 1:
        raise BadInput(f"exponent {exponent} is outside 0 .. 1")
    step = np.log(10) / (per_decade or _CORES_PER_DECADE)
    away = step * np.arange(-_SPREAD // step, _SPREAD // step + 2)
    weights = 1 / (np.cosh(exponent * away) + np.cos(np.pi * exponent))
    henries, corners = henry * weights / weights.sum(), corner_hz * np.exp(away)
    slow, fast = corners < LOWEST_HZ, corners > HIGHEST_HZ * _FAR_ABOVE
    ohms = 2 * np.pi * corners * henries
    network = Network().resistor("slow", IN, "n", float(ohms[slow].sum())).inductor("fast", "n", "n0", float(henries[fast].sum()))
    cells = list(zip(henries[~slow & ~fast].tolist(), ohms[~slow & ~fast].tolist(), strict=True))
    nodes = [*(f"n{number}" for number in range(len(cells))), OUT]
    for number, ((value, ohm), ends) in enumerate(zip(cells, pairwise(nodes), strict=True)):
        network = network.inductor(f"l{number}", *ends, value).resistor(f"r{number}", *ends, ohm)
    return network
