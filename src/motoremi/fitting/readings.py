"""Start values of effects that add a resonance or a time constant, read off the sweeps.

With one such effect, a sweep is a quotient of polynomials of known degree; its elements are in the partial fractions or in the continued
fraction of a rational fit. Steps from a grid of start values would have to hit a resonance within its width.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache

import numpy as np

from motoremi.data.measurement import Measurement
from motoremi.fitting.rational import Rational, rational_fit
from motoremi.fitting.starts import open_and_winding, short_rational

# Where the rational fit finds a resistance below zero, such a share of the effect's own is tried.
LEAST_SHARE = 0.01


@lru_cache(maxsize=32)
def read_start(measurement: Measurement, effect: str) -> Mapping[str, float]:
    """Start values of an effect by its name, those of elements as `=La`; empty where these data allow for none, or none can be read."""
    if effect not in READERS:
        return {}
    fitted, reader = READERS[effect]
    rational = fitted(measurement)
    if rational is None:
        return {}
    with np.errstate(all="ignore"):
        start = reader(rational)
    return start if all(np.isfinite(value) and value > 0 for value in start.values()) else {}


@lru_cache(maxsize=8)
def _resonating(measurement: Measurement) -> Rational | None:
    """The short-circuit sweep of a winding with two resonances."""
    return short_rational(measurement, (3, 4))


def _relaxing(measurement: Measurement) -> Rational | None:
    """That of a winding with a resonance and a corner."""
    return short_rational(measurement, (2, 3))


def _frame(measurement: Measurement) -> Rational | None:
    """s times the difference of the sweeps."""
    apart = open_and_winding(measurement)
    if apart is None:
        return None
    at, seen, through = apart
    omega = 2 * np.pi * at
    return rational_fit(at, 1j * omega * (seen - through), 1 / (omega * np.hypot(np.abs(seen), np.abs(through))), (3, 3))


def _second_cell(short: Rational) -> dict[str, float]:
    """The winding and a cell in series, from the partial fractions: the cell is the one of less inductance."""
    denominator = short.denominator[::-1]
    poles = np.roots(denominator)
    poles = poles[poles.imag > 0]
    if poles.size != 2:
        return {"=La": np.nan}
    residues = np.polyval(short.numerator[::-1], poles) / np.polyval(np.polyder(denominator), poles)
    capacitance = 1 / (2 * residues.real * short.middle)
    inductance = 1 / (np.abs(poles * short.middle) ** 2 * capacitance)
    cell, winding = np.argsort(inductance)
    return {
        "=Ra": float(-(residues * poles.conj()).real[winding] / residues.real[winding] * short.middle * inductance[winding]),
        "=La": float(inductance[winding]),
        "=Ca": float(capacitance[winding]),
        "inductance_h": float(inductance[cell]),
        "resonance_hz": float(np.abs(poles[cell]) * short.middle / (2 * np.pi)),
        "resistance_ohm": float(-1 / (2 * poles.real[cell] * short.middle * capacitance[cell])),
    }


def _coupled_winding(short: Rational) -> dict[str, float]:
    """Ra + s La (1 - k^2 s^2 / (s^2 + s w/Q + w^2)) beside Ca."""
    elements, missing, (a2, a1, a0) = _beside_ca(short)
    resonance = np.sqrt(a0 / a2)
    return {
        **elements,
        "coupling": float(np.sqrt(missing)),
        "resonance_hz": float(resonance * short.middle / (2 * np.pi)),
        "quality": float(resonance * a2 / a1),
    }


def _relaxing_core(short: Rational) -> dict[str, float]:
    """Ra + s La (1 - k s / (s + w)) beside Ca."""
    elements, missing, (a1, a0) = _beside_ca(short)
    return {**elements, "share": float(missing), "corner_hz": float(a0 / a1 * short.middle / (2 * np.pi))}


def _beside_ca(short: Rational) -> tuple[dict[str, float], float, np.ndarray]:
    """From the continued fraction: elements, the share of La that is missing at high frequencies, and what the branch beside Ca has below."""
    numerator = short.numerator[::-1]
    shunt, rest = np.polydiv(short.denominator[::-1], numerator)
    below = _last(rest, numerator.size - 1)
    branch, _ = np.polydiv(numerator, below)
    (b0, b1), (a1, a0) = short.numerator[:2], below[-2:]
    inductance = b1 / a0 - b0 * a1 / a0**2
    elements = {"=Ra": float(b0 / a0), "=La": float(inductance / short.middle), "=Ca": float(shunt[0] / short.middle)}
    return elements, float(1 - branch[0] / inductance), below


def _film(frame: Rational) -> dict[str, float]:
    """Cf beside Rr + s Lr + 1 / (s Cr) + R / (1 + s R C), from the continued fraction of s times the frame's impedance."""
    numerator = frame.numerator[::-1] / frame.middle
    shunt, rest = np.polydiv(np.append(frame.denominator[::-1], 0.0), numerator)
    # The branch is the numerator over s (a1 + a2 s): no direct current flows through Cr.
    a2, a1, _ = _last(rest, 3)
    series, rest = np.polydiv(numerator, [a2, a1, 0.0])
    both, corner = _last(rest, 2)[0] / a2, a1 / a2
    through_cr = numerator[-1] / a1
    if not (corner > frame.lowest and 0 < through_cr < both):
        # The film's time constant is too long for this band, which sees little more than both capacitances in series.
        corner, through_cr = frame.lowest, both / 2
    film = both - through_cr
    resistance = film / corner
    return {
        "=Cf": float(shunt[0] / frame.middle),
        "=Lr": float(series[0] / frame.middle),
        "=Rr": float(max(series[1], LEAST_SHARE * resistance)),
        "=Cr": float(1 / (through_cr * frame.middle)),
        "resistance_ohm": float(resistance),
        "capacitance_f": float(1 / (film * frame.middle)),
    }


def _last(polynomial: np.ndarray, count: int) -> np.ndarray:
    """The coefficients of the lowest powers, however many the division left."""
    padded: np.ndarray = np.concatenate([np.zeros(count), polynomial])[-count:]
    return padded


READERS: Mapping[str, tuple[Callable[[Measurement], Rational | None], Callable[[Rational], dict[str, float]]]] = {
    "second-resonance": (_resonating, _second_cell),
    "field-coupling": (_resonating, _coupled_winding),
    "permeability-relaxation": (_relaxing, _relaxing_core),
    "bearing-film": (_frame, _film),
}
