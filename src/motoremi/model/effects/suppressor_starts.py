"""Start values from the sweeps for suppressor capacitors and chokes.

Seen from the terminal of the short-circuit sweep, all suppressor capacitors are in parallel with the winding. Each is a resonance of the
admittance with its own wires, so one rational fit finds all of them. The open-circuit sweep then shows the path to the frame beside them.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from itertools import permutations
from typing import Any, NamedTuple

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.model import materials
from motoremi.model.effects.rational_starts import FRAME_POINTS, LEAST_SHARE, SMALL_FRAME, from_rational
from motoremi.model.effects.seen import LEAST_OHM, Seen, winding_of
from motoremi.model.effects.start import Set, Start, Subtract, own_values
from motoremi.model.path_to_frame import frames
from motoremi.model.rational import Rational, rational_fit

CAPACITOR, CHOKE = "suppressor-capacitor", "suppressor-choke"
# Shares of the whole capacitance to the frame, tried as that of a capacitor.
SHARES = (0.6, 0.9, 0.99)
# Loss tangent of a good capacitor.
LITTLE_LOSS = 0.002
# Start values beside a choke, which hides them: wires of a centimetre, and the capacitance of a small motor's turns.
WIRES = {"esr_ohm": 0.1, "esl_h": 1e-8, "tan_delta": LITTLE_LOSS}
SMALL_CA = 3e-11
# Frame beside a capacitor: fewest points of the open-circuit sweep that must determine it, and largest ratio of the subtracted to the remaining
# impedance at such a point.
LEAST_POINTS, MOST_LOST = 10, 30.0
# Start values of a choke's minor elements: capacitance of its turns and resistance of its wire.
CHOKE_REST = {"exponent": 0.95, "capacitance_f": 2e-12, "resistance_ohm": 0.02}

# Degrees of the admittance of the open-circuit sweep with a capacitor beside winding and frame: three resonances, and a capacitance.
OF_OPEN_ADMITTANCE = (7, 6)

# Values of a capacitor and its wires by short name, SI units.
Part = Mapping[str, float]


class Fractions(NamedTuple):
    """Partial fractions: slope of the linear part, the real pole, and one pole of each complex pair; each pole with its residue."""

    slope: float
    real: tuple[float, float]
    pairs: tuple[tuple[complex, complex], ...]


def suppressor_capacitor(seen: Seen) -> list[dict[Any, float]]:
    """All capacitors and the winding from the short-circuit sweep, and the frame from the rest of the open-circuit sweep.

    A fit without the capacitor attributes it to the frame, or to the capacitors that it has, so all elements get new start values. In case noise
    or another effect hides a part of that, further start values come from the capacitance at the low end of the open-circuit sweep and the dip of
    its impedance, with the frame of a small motor.
    """
    if seen.place == "guarded":
        return _in_open_alone(seen)
    others = _labels(seen, CAPACITOR)
    found = [] if others else _behind_choke(seen)
    for winding, parts in _read(seen, 1 + len(others)):
        # Which of the capacitors is at which place, only the open-circuit sweep shows.
        for own, *rest in permutations(parts):
            other_parts = list(zip(others, rest, strict=True))
            known = {Set(f"{label}.{name}"): value for label, part in other_parts for name, value in part.items()}
            at_places = [(seen.place, own), *((_place(label), part) for label, part in other_parts)]
            found += [{**winding, **known, **own, **frame} for frame in _frames(seen, winding, at_places)]
    return found + _shares(seen)


def suppressor_choke(seen: Seen) -> list[dict[Any, float]]:
    """A choke in series with the winding from a rational fit; and the inductance at the low end of the sweep, divided between the two.

    A choke at the brushes is read from what the model's capacitors leave of the short-circuit sweep. If the model has a resonant cell in series
    with the winding, also one like that cell.
    """
    henry = seen.lowest_inductance_h
    if henry is None or seen.short_ohm is None:
        return []
    return (
        _like_cell(seen.parameters)
        + from_rational(_behind_capacitors(seen) if seen.place == "brushes" else seen.choked, _choke)
        + [
            {
                Set("Ra"): max(float(seen.short_ohm.real[0]), LEAST_OHM),
                Set("La"): (1 - part) * henry,
                Set("Ca"): farad,
                "inductance_h": part * henry,
                "share": 0.6,
                "corner_hz": corner_hz,
                **CHOKE_REST,
            }
            for part in (0.25, 0.5, 0.75)
            for farad in (2e-11, 1e-10)
            for corner_hz in (5e6, 2e7)
        ]
    )


def _in_open_alone(seen: Seen) -> list[dict[Any, float]]:
    """A capacitor that the open-circuit sweep alone shows: one of the resonances of its admittance, beside the winding of the other sweep."""
    windings = from_rational(seen.short_rational((1, 2)), _winding)
    if not windings or seen.frame_hz is None or seen.open_ohm is None:
        return []
    admittance = rational_fit(seen.frame_hz, 1 / seen.open_ohm, np.abs(seen.open_ohm), OF_OPEN_ADMITTANCE)
    with np.errstate(all="ignore"):
        _, poles, residues = _residues(admittance.numerator[::-1], admittance.denominator[::-1])
        pairs = [(pole, residue) for pole, residue in zip(poles.tolist(), residues.tolist(), strict=True) if pole.imag > 0]
        parts = [_capacitor(admittance.middle, pair, residue) for pair, residue in pairs]
    usable = [part for part in parts if all(np.isfinite(value) and value > 0 for value in part.values())]
    return [{**windings[0], **part, **frame} for part in usable for frame in _frames(seen, windings[0], [(seen.place, part)])]


def _winding(short: Rational) -> dict[Any, float]:
    numerator, denominator = short.numerator, short.denominator
    return {Set(name): value for name, value in winding_of(numerator[0], numerator[1], denominator[2], short.middle).items()}


def _labels(seen: Seen, kind: str) -> list[str]:
    """Prefixes of the parameters of the model's effects of a kind, whatever their places."""
    labels = dict.fromkeys(name.rpartition(".")[0] for name in seen.parameters)
    return [label for label in labels if label.partition("#")[0].partition("@")[0] == kind]


def _place(label: str) -> str:
    return label.partition("#")[0].partition("@")[2]


def _behind_choke(seen: Seen) -> list[dict[Any, float]]:
    """A capacitor behind the choke in the lead that the model has.

    Beside the choke's inductance that of its wires is small, so in the short-circuit sweep the capacitor is a part of Ca.
    """
    if not (chokes := _labels(seen, CHOKE)) or seen.open_ohm is None or seen.frame_hz is None:
        return []
    found: list[dict[Any, float]] = []
    for read in from_rational(seen.choked, _choke):
        choke = own_values(read)
        part = {"capacitance_f": read[Set("Ca")], **WIRES}
        winding = {**{key: value for key, value in read.items() if isinstance(key, Set)}, Set("Ca"): SMALL_CA}
        behind = dataclasses.replace(seen, open_ohm=seen.open_ohm - _choke_ohm(seen.frame_hz, choke))
        known = {Set(f"{chokes[0]}.{name}"): value for name, value in choke.items()}
        found += [{**winding, **known, **part, **frame} for frame in _frames(behind, winding, [(seen.place, part)])]
    return found


def _choke_ohm(frequency_hz: FloatArray, choke: Part) -> ComplexArray:
    s: ComplexArray = np.asarray(2j * np.pi * frequency_hz, dtype=np.complex128)
    core, _ = materials.cole_cole_factor(s, choke["share"], choke["corner_hz"], choke["exponent"])
    return np.asarray(1 / (1 / (choke["resistance_ohm"] + s * choke["inductance_h"] * core) + s * choke["capacitance_f"]))


def _behind_capacitors(seen: Seen) -> Rational | None:
    """Rational fit of the short-circuit sweep without the model's capacitors, with the degrees of a winding and a choke in series."""
    if seen.frequency_hz is None or seen.short_ohm is None:
        return None
    parts = [{name: seen.parameters[f"{label}.{name}"] for name in ("capacitance_f", "esr_ohm", "esl_h")} for label in _labels(seen, CAPACITOR)]
    branches = sum((_branch_s(seen.frequency_hz, part) for part in parts), np.zeros_like(seen.short_ohm))
    with np.errstate(all="ignore"):
        left, error = _less(seen.short_ohm, np.abs(seen.short_ohm), branches)
    return rational_fit(seen.frequency_hz, left, 1 / error, (4, 3))


def _branch_s(frequency_hz: FloatArray, part: Part) -> ComplexArray:
    """Admittance of a capacitor with its wires."""
    s: ComplexArray = np.asarray(2j * np.pi * frequency_hz, dtype=np.complex128)
    return np.asarray(1 / (part["esr_ohm"] + s * part["esl_h"] + 1 / (s * part["capacitance_f"])))


def _fractions(numerator: FloatArray, denominator: FloatArray, pairs: int) -> Fractions | None:
    """None if the function has other poles than one real one and so many pairs, or no linear part."""
    straight, poles, residues = _residues(numerator, denominator)
    real, paired = poles.imag == 0, poles.imag > 0
    if np.count_nonzero(real) != 1 or np.count_nonzero(paired) != pairs or straight.size != 2:
        return None
    (of_real,) = zip(poles[real].real.tolist(), residues[real].real.tolist(), strict=True)
    return Fractions(float(straight[0]), of_real, tuple(zip(poles[paired].tolist(), residues[paired].tolist(), strict=True)))


def _residues(numerator: FloatArray, denominator: FloatArray) -> tuple[FloatArray, ComplexArray, ComplexArray]:
    """The polynomial part, highest power first, the poles, and the residue of each, all simple."""
    straight, rest = np.polydiv(numerator, denominator)
    poles = np.roots(denominator).astype(np.complex128)
    return np.asarray(straight, dtype=np.float64), poles, np.asarray(np.polyval(rest, poles) / np.polyval(np.polyder(denominator), poles))


def _read(seen: Seen, count: int) -> list[tuple[dict[Any, float], list[Part]]]:
    """The winding and so many parallel capacitors with their wires, from the partial fractions of their admittance; none if a value is negative."""
    short = seen.resonating if count == 1 else seen.short_rational((2 * count + 1, 2 * count + 2))
    if short is None:
        return []
    with np.errstate(all="ignore"):
        parts = _fractions(short.denominator[::-1], short.numerator[::-1], count)
        if parts is None:
            return []
        real, by_winding = parts.real
        capacitors = [_capacitor(short.middle, pair, residue) for pair, residue in parts.pairs]
        inductance = 1 / (by_winding * short.middle)
        winding: dict[Any, float] = {
            Set("Ra"): float(max(-real * short.middle * inductance, LEAST_OHM)),
            Set("La"): float(inductance),
            # The winding's own capacitance is very small beside them.
            Set("Ca"): float(max(parts.slope / short.middle, LEAST_SHARE * min(one["capacitance_f"] for one in capacitors))),
        }
    values = [*winding.values(), *(value for part in capacitors for value in part.values())]
    return [(winding, capacitors)] if all(np.isfinite(value) and value > 0 for value in values) else []


def _capacitor(middle: float, pair: complex, residue: complex) -> Part:
    esl = (pair / (2j * pair.imag * residue * middle)).real
    esr = max(-2 * pair.real * middle * esl, LEAST_OHM)
    return {"capacitance_f": 1 / (esl * abs(pair * middle) ** 2), "esr_ohm": esr, "esl_h": esl, "tan_delta": LITTLE_LOSS}


def _frames(seen: Seen, winding: Start, capacitors: Sequence[tuple[str, Part]]) -> list[dict[Any, float]]:
    """The path to the frame from the open-circuit sweep without winding and capacitors; also that of a small motor, if little remains.

    Parameters
    ----------
    capacitors : sequence of tuple
        Place and values of each.
    """
    if seen.frame_hz is None or seen.open_ohm is None:
        return [{}]
    step = max(1, seen.frame_hz.size // FRAME_POINTS)
    frequency, measured = seen.frame_hz[::step], seen.open_ohm[::step]
    s: ComplexArray = np.asarray(2j * np.pi * frequency, dtype=np.complex128)
    with np.errstate(all="ignore"):
        branches = [(place, _branch_s(frequency, part)) for place, part in capacitors]
        nothing: ComplexArray = np.zeros_like(s)
        # Between the terminals, from the first one to the frame, and from the second one to the frame.
        across = sum((branch for place, branch in branches if not place), nothing)
        to_frame = sum((branch for place, branch in branches if place), nothing)
        in_short = sum((branch for place, branch in branches if place not in ("", "guarded")), nothing)
        beside_frame = sum((branch for place, branch in branches if place == "pair"), nothing)
        through = 1 / (1 / (winding[Set("Ra")] + s * winding[Set("La")]) + s * winding[Set("Ca")] + across)
        short = 1 / (1 / through + in_short)
        left, error = _less(measured, np.abs(measured), to_frame)
        frame, error = left - through, np.hypot(error, _less(short, np.abs(short), in_short)[1])
        known = error <= MOST_LOST * np.abs(frame)
        frame, error = _less(frame, error, beside_frame)
        known &= error <= MOST_LOST * np.abs(frame)
    found = frames(frequency[known], frame[known], error[known]) if np.count_nonzero(known) >= LEAST_POINTS else []
    # A fit without the second capacitor of a pair attributes its capacitance to the frame.
    paired = sum(part["capacitance_f"] for place, part in capacitors if place == "pair")
    taken: list[dict[Any, float]] = [{Subtract("Cf"): paired}] if paired else []
    return [{Set(name): value for name, value in one.items()} for one in (*found, SMALL_FRAME)] + taken


def _less(impedance: ComplexArray, error: FloatArray, branch: ComplexArray) -> tuple[ComplexArray, FloatArray]:
    """An impedance without an admittance in parallel with it, and its error; both are assumed to have the same relative error."""
    alone = 1 / (1 / impedance - branch)
    return alone, np.abs(alone) ** 2 * np.hypot(error / np.abs(impedance) ** 2, np.abs(branch))


def _shares(seen: Seen) -> list[dict[Any, float]]:
    henry = seen.lowest_inductance_h
    if henry is None or seen.frame_hz is None or seen.open_ohm is None or seen.frequency_hz is None:
        return []
    whole = -1 / (2 * np.pi * seen.frame_hz[0] * seen.open_ohm.imag[0])
    if whole <= 0:
        return []
    dip = int(np.argmin(np.abs(seen.open_ohm)))
    starts = []
    for share in SHARES:
        capacitance = share * whole
        esl = 1 / ((2 * np.pi * seen.frame_hz[dip]) ** 2 * capacitance)
        half = min(0.5 * (1 - share) * whole, SMALL_FRAME["Cf"])
        # Below the resonance with La the capacitor increases the measured inductance.
        own = henry / (1 + (2 * np.pi * seen.frequency_hz[0]) ** 2 * henry * capacitance)
        frame = {Set("Cf"): half, Set("Cr"): half, Set("Lr"): SMALL_FRAME["Lr"], Set("Rr"): SMALL_FRAME["Rr"]}
        part = {"capacitance_f": capacitance, "esr_ohm": max(0.5 * abs(seen.open_ohm[dip].real), 2e-3), "esl_h": float(np.clip(esl, 1e-9, 1e-7))}
        starts += [{Set("La"): own, Set("Ca"): ca, **frame, **part, "tan_delta": LITTLE_LOSS} for ca in (2e-11, 2e-10)]
    return starts


def _like_cell(parameters: Mapping[str, float]) -> list[dict[Any, float]]:
    """A choke with the inductance, the loss and the resonance of the model's resonant cell, if it has one."""
    henry = parameters.get("second-resonance.inductance_h", 0.0)
    if not henry:
        return []
    omega = 2 * np.pi * parameters["second-resonance.resonance_hz"]
    return [
        {
            "inductance_h": henry,
            "share": 0.8,
            "corner_hz": parameters["second-resonance.resistance_ohm"] / (2 * np.pi * henry),
            **CHOKE_REST,
            "capacitance_f": float(1 / (omega**2 * henry)),
        }
    ]


def _choke(short: Rational) -> dict[Any, float]:
    """The winding, and s L (1 - k) + s L k / (1 + s/w) in series with it, from the partial fractions: the real pole belongs to the choke."""
    parts = _fractions(short.numerator[::-1], short.denominator[::-1], 1)
    if parts is None:
        return {Set("La"): np.nan}
    slope, (real, by_rod), ((pair, by_winding),) = parts
    corner = -real * short.middle
    ferrite, air = -by_rod * short.middle / corner**2, slope / short.middle
    capacitance = 1 / (2 * by_winding.real * short.middle)
    inductance = 1 / (np.abs(pair * short.middle) ** 2 * capacitance)
    return {
        Set("Ra"): float(-(by_winding * pair.conjugate()).real / by_winding.real * short.middle * inductance),
        Set("La"): float(inductance),
        Set("Ca"): float(capacitance),
        "inductance_h": float(air + ferrite),
        "share": float(ferrite / (air + ferrite)),
        "corner_hz": float(corner / (2 * np.pi)),
        **CHOKE_REST,
    }
