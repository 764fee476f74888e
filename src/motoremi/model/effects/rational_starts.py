"""Start values from the sweeps, mostly by rational fits, for effects that add a resonance or a time constant.

With one such effect a sweep is a rational function of known degree, and the elements follow from the partial fractions or from the
continued fraction of a rational fit. A grid of start values would have to hit a resonance within its width.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from motoremi.model.effects.seen import LEAST_OHM, Seen, winding_of
from motoremi.model.effects.start import Set, Start
from motoremi.model.motor import BASE_PARAMETERS
from motoremi.model.path_to_frame import frames
from motoremi.model.rational import Rational

# Sets of start values of an effect by short name, those of elements as `Set("La")`; empty if the data do not allow any.
Reader: TypeAlias = Callable[[Seen], Sequence[Start]]

# If the rational fit finds a negative resistance, this share of the effect's own resistance is used instead.
LEAST_SHARE = 0.01
# Modes: number of resonances that are examined, factor by which they go beyond the sweep, and number that are tried.
MODES_EXAMINED, MODES_BEYOND, MODES_TRIED = 90, 1.5, 10
# Qualities tried for the first mode, as found in machines; all modes share one quality.
MODE_QUALITIES = (2.0, 5.0, 15.0)
# Start value of a cage's share: a measured machine has 0.3 to 0.4.
CAGE_SHARE = 0.3
# Winding sections: shares of the capacitance at the first resonance that are to the frame, part of the distributed capacitance that acts
# there (a quarter wave), largest share of Cf, and couplings that are tried.
SPREAD_PARTS, ACTING, MOST_SPREAD, COUPLINGS = (0.3, 0.6, 0.9), 0.4, 0.95, (0.02, 0.3, 0.6, 0.85)
# Where Ca may lie to begin with: nearly all of it between turns, or across the ends; not at the end of the range, where only one direction is left.
END_SHARES = (0.01, 0.95)
# Typical elements of the path to the frame of a small motor.
SMALL_FRAME = {"Rr": 40.0, "Lr": 2e-6, "Cr": 5e-10, "Cf": 5e-10}
# Uniform line: fewest resonances, largest relative difference of their distances, points of the mean, and the turns' share of the capacitance.
LINE_RESONANCES, LINE_UNEVEN, LINE_POINTS, LINE_TURNS = 4, 0.5, 400, 1e-3
# Points of the open-circuit sweep from which the path to the frame is read.
FRAME_POINTS = 80
# Start values of the minor parameters of a lead or a strap.
CONDUCTOR_REST = {"resistance_ohm": 0.02, "skin_ohm": 0.01}
# Nearly Debye's law; exactly at the end of its range the exponent could only be varied in one direction.
ONE_TIME_CONSTANT = {"exponent": 0.95, "quality": 0.02}


# Start values that may be zero.
SHARES = ("series_share", "across_share")


def from_rational(rational: Rational | None, read: Callable[[Rational], dict[Any, float]]) -> list[dict[Any, float]]:
    """The start values that `read` finds in a rational fit, if all are finite, and positive but for shares of a damping, which may be zero."""
    if rational is None:
        return []
    with np.errstate(all="ignore"):
        start = read(rational)
    usable = (np.isfinite(value) and (value > 0 or (value == 0 and name in SHARES)) for name, value in start.items())
    return [start] if all(usable) else []


def second_cell(seen: Seen) -> list[dict[Any, float]]:
    """A resonant cell in series with the winding."""
    return from_rational(seen.resonating, _second_cell)


def coupled_winding(seen: Seen) -> list[dict[Any, float]]:
    """A resonant winding coupled to La."""
    return from_rational(seen.resonating, _coupled_winding)


def relaxing_core(seen: Seen) -> list[dict[Any, float]]:
    """A share of La that relaxes with one time constant, or has a damped resonance."""
    return from_rational(seen.relaxing, _relaxing_core) + from_rational(seen.resonating, _damped_core)


def film(seen: Seen) -> list[dict[Any, float]]:
    """A film in series with Rr."""
    return from_rational(seen.film, _film)


def leak(seen: Seen) -> list[dict[Any, float]]:
    """A leak beside Cr, which is the film without a Cr of its own, or beside Cf."""
    if seen.place == "Cr":
        return [_leak(start) for start in film(seen)]
    return from_rational(seen.leaking_frame, _leak_to_frame) if seen.place == "Cf" else []


def relaxing_rotor(seen: Seen) -> list[dict[Any, float]]:
    """A relaxation of Cr with one time constant, which the film and Cr together are."""
    return [_relaxation(start) for start in film(seen)] if seen.place == "Cr" else []


def _second_cell(short: Rational) -> dict[Any, float]:
    """The winding and a cell in series, from the partial fractions: the cell is the one with less inductance."""
    denominator = short.denominator[::-1]
    poles = np.roots(denominator)
    poles = poles[poles.imag > 0]
    if poles.size != 2:
        return {Set("La"): np.nan}
    residues = np.polyval(short.numerator[::-1], poles) / np.polyval(np.polyder(denominator), poles)
    capacitance = 1 / (2 * residues.real * short.middle)
    inductance = 1 / (np.abs(poles * short.middle) ** 2 * capacitance)
    cell, winding = np.argsort(inductance)
    in_series = -(residues * poles.conj()).real / residues.real * short.middle * inductance
    resistance = float(-1 / (2 * poles.real[cell] * short.middle * capacitance[cell]))
    return {
        Set("Ra"): float(in_series[winding]),
        Set("La"): float(inductance[winding]),
        Set("Ca"): float(capacitance[winding]),
        "inductance_h": float(inductance[cell]),
        "resonance_hz": float(np.abs(poles[cell]) * short.middle / (2 * np.pi)),
        "resistance_ohm": resistance,
        "series_share": float(np.clip(in_series[cell] * resistance * capacitance[cell] / inductance[cell], 0.0, 1.0)),
    }


def _coupled_winding(short: Rational) -> dict[Any, float]:
    """Ra + s La (1 - k^2 s^2 / (s^2 + s w/Q + w^2)) in parallel with Ca."""
    elements, missing, (a2, a1, a0) = _beside_ca(short)
    resonance = np.sqrt(a0 / a2)
    return {
        **elements,
        "coupling": float(np.sqrt(missing)),
        "resonance_hz": float(resonance * short.middle / (2 * np.pi)),
        "quality": float(resonance * a2 / a1),
        "across_share": 0.0,
    }


def _relaxing_core(short: Rational) -> dict[Any, float]:
    """Ra + s La (1 - k s / (s + w)) in parallel with Ca."""
    elements, missing, (a1, a0) = _beside_ca(short)
    return {**elements, "share": float(missing), "corner_hz": float(a0 / a1 * short.middle / (2 * np.pi)), **ONE_TIME_CONSTANT}


def _damped_core(short: Rational) -> dict[Any, float]:
    """Ra + s La (1 - k + k / (1 + x + (Q x)^2)) in parallel with Ca, x = s/w."""
    elements, missing, (a2, a1, a0) = _beside_ca(short)
    corner_hz = float(a0 / a1 * short.middle / (2 * np.pi))
    return {
        **elements,
        "share": float(missing),
        "corner_hz": corner_hz,
        "exponent": ONE_TIME_CONSTANT["exponent"],
        "quality": float(np.sqrt(a2 * a0) / a1),
    }


def _beside_ca(short: Rational) -> tuple[dict[Any, float], float, np.ndarray]:
    """From the continued fraction: elements, the share of La that is missing at high frequencies, and the denominator of the branch beside Ca."""
    numerator = short.numerator[::-1]
    shunt, rest = np.polydiv(short.denominator[::-1], numerator)
    below = _last(rest, numerator.size - 1)
    branch, _ = np.polydiv(numerator, below)
    (b0, b1), (a1, a0) = short.numerator[:2], below[-2:]
    inductance = b1 / a0 - b0 * a1 / a0**2
    elements = {Set("Ra"): float(b0 / a0), Set("La"): float(inductance / short.middle), Set("Ca"): float(shunt[0] / short.middle)}
    return elements, float(1 - branch[0] / inductance), below


def _film(frame: Rational) -> dict[Any, float]:
    """Cf in parallel with Rr + s Lr + 1 / (s Cr) + R / (1 + s R C), from the continued fraction of s times the frame's impedance."""
    numerator = frame.numerator[::-1] / frame.middle
    shunt, rest = np.polydiv(np.append(frame.denominator[::-1], 0.0), numerator)
    # The branch is the numerator divided by s (a1 + a2 s): no direct current flows through Cr.
    a2, a1, _ = _last(rest, 3)
    series, rest = np.polydiv(numerator, [a2, a1, 0.0])
    both, corner = _last(rest, 2)[0] / a2, a1 / a2
    through_cr = numerator[-1] / a1
    if not (corner > frame.lowest and through_cr < both):
        # The film's time constant is too long for this band, in which both capacitances appear in series.
        corner, through_cr = frame.lowest, both / 2
    # Beside a leak Cr has no limit.
    through_cr = max(through_cr, LEAST_SHARE * both)
    film = both - through_cr
    resistance = film / corner
    return {
        Set("Cf"): float(shunt[0] / frame.middle),
        Set("Lr"): float(series[0] / frame.middle),
        Set("Rr"): float(max(series[1], LEAST_SHARE * resistance)),
        Set("Cr"): float(1 / (through_cr * frame.middle)),
        "resistance_ohm": float(resistance),
        "capacitance_f": float(1 / (film * frame.middle)),
    }


def _leak_to_frame(frame: Rational) -> dict[Any, float]:
    """1/R and Cf in parallel with Rr + s Lr + 1 / (s Cr), from the first step of the continued fraction; direct current flows through R alone."""
    numerator, denominator = frame.numerator[::-1], frame.denominator[::-1]
    shunt, rest = np.polydiv(denominator, numerator)
    through_cr = _last(rest, 2)[0]
    lr, rr, one = numerator / through_cr
    return {
        Set("Cf"): float(shunt[0] / frame.middle),
        Set("Lr"): float(lr / frame.middle),
        Set("Rr"): float(rr),
        Set("Cr"): float(1 / (one * frame.middle)),
        "resistance_ohm": float(frame.numerator[0]),
    }


def _in_series(film: Mapping[Any, float]) -> float:
    """The capacitance of film and Cr at high frequencies."""
    return 1 / (1 / film["capacitance_f"] + 1 / film[Set("Cr")])


def _leak(film: Mapping[Any, float]) -> dict[Any, float]:
    elements = {name: value for name, value in film.items() if isinstance(name, Set)}
    return {**elements, Set("Cr"): _in_series(film), "resistance_ohm": film["resistance_ohm"]}


def _relaxation(film: Mapping[Any, float]) -> dict[Any, float]:
    elements = {name: value for name, value in film.items() if isinstance(name, Set)}
    at_rest, of_film = film[Set("Cr")], film["capacitance_f"]
    return {
        **elements,
        Set("Cr"): _in_series(film),
        "strength": at_rest / of_film,
        "corner_hz": 1 / (2 * np.pi * film["resistance_ohm"] * (at_rest + of_film)),
        "exponent": ONE_TIME_CONSTANT["exponent"],
    }


def _last(polynomial: np.ndarray, count: int) -> np.ndarray:
    """The `count` coefficients of the lowest powers, padded with zeros if the division left fewer."""
    return np.concatenate([np.zeros(count), polynomial])[-count:]


def winding_modes(seen: Seen) -> list[dict[Any, float]]:
    """One more series branch across the winding at the resonances where it reduces the relative error most, the best first."""
    if seen.across is None:
        return []
    frequency, measured, model, decrease = seen.across
    # To first order in the admittance of the branch.
    s, left = 2j * np.pi * frequency, 1 - model / measured
    resonances = np.geomspace(frequency[0], MODES_BEYOND * frequency[-1], MODES_EXAMINED)
    x = s / (2 * np.pi * resonances[:, None])
    found: list[tuple[float, dict[str, float]]] = []
    known = seen.parameters.get("winding-modes.quality")
    for quality in (known,) if known else MODE_QUALITIES:
        branch = -decrease * s / (1 + x / quality + x**2)
        strength = np.sum(np.abs(branch) ** 2, axis=1)
        size = np.maximum((branch.conj() @ left).real / strength, 0.0)
        gain = size**2 * strength
        around = np.pad(gain, 1)
        peaks = np.flatnonzero((gain > 0) & (gain >= around[:-2]) & (gain >= around[2:]))
        found += [(gain[i], {"capacitance_f": float(size[i]), "resonance_hz": float(resonances[i]), "quality": quality}) for i in peaks]
    found.sort(key=lambda pair: -pair[0])
    return [start for _, start in found[:MODES_TRIED]]


def machine_winding(seen: Seen) -> list[dict[Any, float]]:
    """From the inductance at the lowest frequencies and the first parallel resonance, for several corner frequencies of cage and iron."""
    lowest, resonance = seen.lowest_inductance_h, seen.first_resonance_hz
    if lowest is None or resonance is None or seen.frequency_hz is None or seen.short_ohm is None:
        return []
    frequency, impedance = seen.frequency_hz, seen.short_ohm
    # Iron and cage already have an effect at the low end: assumed are a tenth of La, and half of the resistance.
    base: dict[Any, float] = {Set("Ra"): max(0.5 * float(impedance.real[0]), 1e-3), Set("La"): 1.1 * lowest}
    starts = []
    for iron in (0.5 * resonance, 2 * resonance):
        for exponent in (0.5, 0.8):
            remaining = (1 - CAGE_SHARE) * lowest / abs(1 + (1j * resonance / iron) ** exponent)
            # A line with a shorted far end resonates at the frequency at which it is a quarter wave long.
            slots = (np.pi / 2) ** 2 / ((2 * np.pi * resonance) ** 2 * remaining)
            for cage in (3 * frequency[0], 0.03 * resonance):
                own = {"slots_f": slots, "path_ohm": 300.0, "iron_hz": iron, "exponent": exponent, "cage_share": CAGE_SHARE, "cage_hz": float(cage)}
                starts.append({**base, Set("Ca"): 0.2 * slots, **own})
    return starts


def uniform_line(seen: Seen) -> list[dict[Any, float]]:
    """A line with a shorted far end, from equidistant resonances: Z = Zc tanh(theta), and the geometric mean of |Z| is Zc."""
    if seen.frequency_hz is None or seen.short_ohm is None:
        return []
    frequency, reactance = seen.frequency_hz, seen.short_ohm.imag
    crossings = frequency[:-1][np.diff(np.sign(reactance)) != 0]
    distances = np.diff(crossings)
    if distances.size < LINE_RESONANCES - 1 or np.ptp(distances) > LINE_UNEVEN * float(np.median(distances)):
        return []
    # From one resonance to the next the electrical length grows by a quarter wave. The mean is taken over whole half waves.
    delay_s = 1 / (4 * float(np.median(distances)))
    whole = (frequency >= crossings[0]) & (frequency <= crossings[2 * ((crossings.size - 1) // 2)])
    places = np.linspace(crossings[0], crossings[2 * ((crossings.size - 1) // 2)], LINE_POINTS)
    wave_ohm = float(np.exp(np.mean(np.interp(places, frequency[whole], np.log(np.abs(seen.short_ohm[whole]))))))
    loss_ohm = 2 * float(np.min(np.abs(seen.short_ohm[whole])))
    line = {Set("La"): wave_ohm * delay_s, Set("Cf"): 2 * delay_s / wave_ohm, "share": 0.5, "end_share": END_SHARES[0]}
    return [{**line, Set("Ra"): ra * loss_ohm, Set("Ca"): LINE_TURNS * delay_s / wave_ohm} for ra in (1.0, 0.1)]


def distributed_winding(seen: Seen) -> list[dict[Any, float]]:
    """A line from equidistant resonances, and from the low ends of both sweeps and the first parallel resonance.

    A circuit without the line may attribute its resonances to wrong elements, so all of them get new start values.
    """
    lowest, resonance, total = seen.lowest_inductance_h, seen.first_resonance_hz, seen.frame_capacitance_f
    if sections := _from_law(seen, "winding-sections"):
        return [sections]
    starts = uniform_line(seen)
    if lowest is None or resonance is None or total is None or seen.short_ohm is None:
        return starts
    whole = 1 / ((2 * np.pi * resonance) ** 2 * lowest)
    winding: dict[Any, float] = {Set("Ra"): max(float(seen.short_ohm.real[0]), LEAST_OHM), Set("La"): lowest}
    for part in SPREAD_PARTS:
        slots = min(part * whole / ACTING, MOST_SPREAD**2 * total)
        for farad in (slots / MOST_SPREAD, 0.5 * (slots / MOST_SPREAD + total)):
            frame = {Set("Rr"): SMALL_FRAME["Rr"], Set("Lr"): SMALL_FRAME["Lr"], Set("Cr"): max(total - farad, (1 - MOST_SPREAD) * total)}
            line = {**winding, **frame, Set("Ca"): (1 - part) * whole, Set("Cf"): farad, "share": slots / farad}
            starts += [{**line, "end_share": end} for end in END_SHARES]
    return starts


def _from_law(seen: Seen, effect: str) -> dict[Any, float]:
    """The elements and shares of a fit with another law of a distributed winding; empty if the fit is not of that law."""
    if f"{effect}.share" not in seen.parameters:
        return {}
    elements = {Set(p.name): seen.parameters[p.name] for p in BASE_PARAMETERS if p.name in seen.parameters}
    return {**elements, **{name: seen.parameters[f"{effect}.{name}"] for name in ("share", "end_share")}}


def winding_sections(seen: Seen) -> list[dict[Any, float]]:
    """From the inductance at the lowest frequencies and the first parallel resonance, with several distributions of its capacitance."""
    lowest, resonance = seen.lowest_inductance_h, seen.first_resonance_hz
    if line := _from_law(seen, "distributed-winding"):
        return [{**line, "sections": 8.0, "coupling": COUPLINGS[0]}]
    if lowest is None or resonance is None or seen.short_ohm is None or "machine-winding.slots_f" in seen.parameters:
        return []
    whole = 1 / ((2 * np.pi * resonance) ** 2 * lowest)
    ohm = max(float(seen.short_ohm.real[0]), 1e-3)
    starts = []
    for part in SPREAD_PARTS:
        slots = part * whole / ACTING
        farad = max(seen.parameters.get("Cf", 2 * slots), slots / MOST_SPREAD)
        base = {Set("Ra"): ohm, Set("La"): lowest, Set("Ca"): (1 - part) * whole, Set("Cf"): farad, "share": slots / farad, "sections": 8.0}
        starts += [{**base, "coupling": coupling, "end_share": end} for end in END_SHARES for coupling in COUPLINGS]
    return starts


def winding_behind_lead(seen: Seen) -> list[dict[Any, float]]:
    """Winding and lead from a rational fit.

    The resonance of a lead with the winding's capacitance is sharp, and a model without it takes the elements of the winding for it.
    """
    return from_rational(seen.behind_lead, _winding_and_lead)


def _winding_and_lead(short: Rational) -> dict[Any, float]:
    """The winding, and R + s L in series with it: what remains at high frequencies."""
    straight, rest = np.polydiv(short.numerator[::-1], short.denominator[::-1])
    if straight.size != 2 or rest.size != 2:
        return {"inductance_h": np.nan}
    return {
        **{Set(name): value for name, value in winding_of(rest[1], rest[0], short.denominator[2], short.middle).items()},
        **CONDUCTOR_REST,
        "resistance_ohm": float(max(straight[1], LEAST_OHM)),
        "inductance_h": float(straight[0] / short.middle),
    }


def frame_behind_strap(seen: Seen) -> list[dict[Any, float]]:
    """Path to the frame and strap from the difference of the two sweeps.

    The resonance of a strap with Cf is sharp, and a model without it takes the elements of the frame for it.
    """
    if seen.frame is None:
        return []
    step = max(1, seen.frame.frequency_hz.size // FRAME_POINTS)
    found = frames(*seen.frame.at(slice(None, None, step)), has_strap=True)
    straps = [(one.pop("inductance_h"), one) for one in found]
    return [
        {**{Set(name): value for name, value in frame.items()}, **CONDUCTOR_REST, "inductance_h": henry} for henry, frame in straps if henry > 0
    ]
