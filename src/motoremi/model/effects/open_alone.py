"""The open-circuit sweep alone: its poles, divided in all possible ways between winding and path to the frame.

With the far end open the impedance is that of a capacitance to the frame in series with resonances and, if something relaxes, a term with a
real pole (Foster's first form). Every division of these terms gives a short-circuit sweep, from which effects read their start values.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.model.effects.seen import Seen, winding_of
from motoremi.model.effects.start import Set, Start
from motoremi.model.rational import Rational, rational_fit

# Numbers of poles beside that of the capacitance: one more than the paper's circuit has (a relaxation), or two more (a resonance).
POLES = (5, 6)


@dataclass(frozen=True)
class Division:
    """One division of the poles.

    Parameters
    ----------
    elements : mapping
        Start values of the seven elements.
    seen : Seen
        Both sweeps, without noise.
    """

    elements: Start
    seen: Seen


class _Term(NamedTuple):
    """A term of the partial fractions: impedance in ohms, and the elements of a winding that resonates so; none of what relaxes."""

    impedance_ohm: ComplexArray
    elements: Mapping[str, float]


def divisions(frequency_hz: FloatArray, impedance_ohm: ComplexArray) -> list[Division]:
    """All divisions of the poles of an open-circuit sweep.

    Parameters
    ----------
    frequency_hz, impedance_ohm : ndarray, shape (n,)
    """
    s = 2j * np.pi * frequency_hz
    weight = 1 / np.abs(s * impedance_ohm)
    return [one for count in POLES for one in _divided(frequency_hz, rational_fit(frequency_hz, s * impedance_ohm, weight, (count, count)))]


def _divided(frequency_hz: FloatArray, times_s: Rational) -> Iterator[Division]:
    terms = _terms(frequency_hz, times_s)
    elastance = float(times_s.numerator[0])
    if not elastance > 0:
        return
    of_capacitance = elastance / (2j * np.pi * frequency_hz)
    resonances, relaxing = [one for one in terms if one.elements], [one for one in terms if not one.elements]
    for resonance in resonances:
        others = [one for one in resonances if one is not resonance]
        if not others:
            continue
        largest = max((one.elements for one in others), key=lambda one: one["La"])
        elements = {Set(name): value for name, value in {**largest, **_frame(resonance.elements, 1 / elastance)}.items()}
        # What relaxes belongs to the winding, or to the path to the frame.
        for in_winding, in_frame in ((relaxing, []), ([], relaxing)) if relaxing else (([], []),):
            winding, frame = _sum([*others, *in_winding]), _sum([resonance, *in_frame]) + of_capacitance
            yield Division(elements, Seen(frequency_hz, winding, frequency_hz, winding + frame, winding))


def _sum(terms: Sequence[_Term]) -> ComplexArray:
    return np.asarray(np.sum([one.impedance_ohm for one in terms], axis=0), dtype=np.complex128)


def _terms(frequency_hz: FloatArray, times_s: Rational) -> list[_Term]:
    """The partial fractions of an impedance, given times s, without that of its pole at zero; none if a resonance has a negative element."""
    p = 2j * np.pi * frequency_hz / times_s.middle
    numerator, denominator = times_s.numerator[::-1] / times_s.middle, times_s.denominator[::-1]
    terms = []
    for pole in np.roots(denominator).astype(np.complex128):
        residue = complex(np.polyval(numerator, pole) / (pole * np.polyval(np.polyder(denominator), pole)))
        if pole.imag < 0 or not np.isfinite(residue):
            continue
        if pole.imag == 0:
            terms.append(_Term(np.asarray(residue.real / (p - pole.real), dtype=np.complex128), {}))
            continue
        square = abs(pole) ** 2
        resonance = winding_of(-2 * (residue * pole.conjugate()).real / square, 2 * residue.real / square, 1 / square, times_s.middle)
        if min(resonance.values()) <= 0:
            return []
        both = residue / (p - pole) + residue.conjugate() / (p - pole.conjugate())
        terms.append(_Term(np.asarray(both, dtype=np.complex128), resonance))
    return terms


def _frame(resonance: Mapping[str, float], capacitance_f: float) -> dict[str, float]:
    """The path to the frame that is a capacitance in series with a parallel resonance (see `fitting.exchange`)."""
    share = capacitance_f / (capacitance_f + resonance["Ca"])
    return {
        "Rr": resonance["Ra"] / share**2,
        "Lr": resonance["La"] / share**2,
        "Cr": share * capacitance_f,
        "Cf": (1 - share) * capacitance_f,
    }
