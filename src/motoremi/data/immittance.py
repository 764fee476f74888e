"""Impedance from the pair of quantities in a file: R and X, |Z| and phase, Ls and Rs, S11 ..."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.columns import Column
from motoremi.data.table import Table
from motoremi.errors import BadInput

# (angular frequency, first, second) -> impedance in ohm
ToImpedance: TypeAlias = Callable[[FloatArray, FloatArray, FloatArray], ComplexArray]
REFERENCE_OHM = 50.0
# What a table of a sweep needs, for messages.
IMPEDANCE_COLUMNS = "frequency_hz with resistance_ohm,reactance_ohm or with impedance_ohm,phase_deg"


@dataclass(frozen=True)
class Pair:
    """Two quantities that together give an impedance."""

    first: str
    second: str
    title: str
    impedance: ToImpedance


def _rectangular(w: FloatArray, a: FloatArray, b: FloatArray) -> ComplexArray:
    # Not a + 1j * b, which would turn -0.0 into 0.0.
    result = np.empty(a.shape, dtype=np.complex128)
    result.real, result.imag = a, b
    return result


def _polar(w: FloatArray, magnitude: FloatArray, phase_deg: FloatArray) -> ComplexArray:
    return np.asarray(magnitude * np.exp(1j * np.deg2rad(phase_deg)), dtype=np.complex128)


def _reflection(w: FloatArray, a: FloatArray, b: FloatArray) -> ComplexArray:
    s = _rectangular(w, a, b)
    return REFERENCE_OHM * (1 + s) / (1 - s)


def _series(w: FloatArray, reactance: FloatArray, loss: FloatArray) -> ComplexArray:
    """A reactance with a series resistance; `loss` is their ratio."""
    return _rectangular(w, loss * np.abs(reactance), reactance)


def _parallel(w: FloatArray, susceptance: FloatArray, loss: FloatArray) -> ComplexArray:
    """A susceptance with a parallel conductance; `loss` is their ratio."""
    return 1 / _rectangular(w, loss * np.abs(susceptance), susceptance)


REFLECTION = Pair("s11_real", "s11_imag", "S11 in 50 Ohm", _reflection)
# In order of preference if a file holds several.
PAIRS = (
    Pair("resistance", "reactance", "R and X", _rectangular),
    Pair("magnitude", "phase", "|Z| and phase", _polar),
    Pair("series_resistance", "reactance", "Rs and Xs", _rectangular),
    Pair("conductance", "susceptance", "G and B", lambda w, g, b: 1 / _rectangular(w, g, b)),
    Pair("admittance", "admittance_phase", "|Y| and phase", lambda w, y, phase: 1 / _polar(w, y, phase)),
    Pair("series_inductance", "series_resistance", "Ls and Rs", lambda w, inductance, r: _rectangular(w, r, w * inductance)),
    Pair("series_capacitance", "series_resistance", "Cs and Rs", lambda w, c, r: _rectangular(w, r, -1 / (w * c))),
    Pair("parallel_inductance", "parallel_resistance", "Lp and Rp", lambda w, inductance, r: 1 / _rectangular(w, 1 / r, -1 / (w * inductance))),
    Pair("parallel_capacitance", "parallel_resistance", "Cp and Rp", lambda w, c, r: 1 / _rectangular(w, 1 / r, w * c)),
    Pair("parallel_capacitance", "conductance", "Cp and G", lambda w, c, g: 1 / _rectangular(w, g, w * c)),
    Pair("series_inductance", "quality_factor", "Ls and Q", lambda w, inductance, q: _series(w, w * inductance, 1 / q)),
    Pair("series_inductance", "dissipation_factor", "Ls and D", lambda w, inductance, d: _series(w, w * inductance, d)),
    Pair("series_capacitance", "quality_factor", "Cs and Q", lambda w, c, q: _series(w, -1 / (w * c), 1 / q)),
    Pair("series_capacitance", "dissipation_factor", "Cs and D", lambda w, c, d: _series(w, -1 / (w * c), d)),
    Pair("parallel_inductance", "quality_factor", "Lp and Q", lambda w, inductance, q: _parallel(w, -1 / (w * inductance), 1 / q)),
    Pair("parallel_inductance", "dissipation_factor", "Lp and D", lambda w, inductance, d: _parallel(w, -1 / (w * inductance), d)),
    Pair("parallel_capacitance", "quality_factor", "Cp and Q", lambda w, c, q: _parallel(w, w * c, 1 / q)),
    Pair("parallel_capacitance", "dissipation_factor", "Cp and D", lambda w, c, d: _parallel(w, w * c, d)),
    REFLECTION,
)


def find_pair(found: Collection[str]) -> Pair | None:
    """The preferred pair among the meanings of columns, or None."""
    return next((pair for pair in PAIRS if {pair.first, pair.second} <= set(found)), None)


def impedance_of(table: Table, found: dict[str, Column], pair: Pair, frequency_hz: FloatArray) -> ComplexArray:
    """Impedance in ohm of each row.

    Raises
    ------
    BadInput
        If a magnitude is below 0, a phase is beyond a full turn, or a row has no finite impedance.
    """
    first, second = column_values(table, found[pair.first]), column_values(table, found[pair.second])
    if "phase" in pair.second:
        for row in np.flatnonzero(first < 0)[:1]:
            raise BadInput(f"{table.where(int(row))}: the magnitude {first[row]:g} is below 0; is it a reactance?")
        for row in np.flatnonzero(np.abs(second) > 360)[:1]:
            raise BadInput(f"{table.where(int(row))}: a phase of {second[row]:g} degrees is beyond a full turn")
    with np.errstate(all="ignore"):
        impedance = pair.impedance(2 * np.pi * frequency_hz, first, second)
    for row in np.flatnonzero(~np.isfinite(impedance))[:1]:
        raise BadInput(f"{table.where(int(row))}: {pair.title} of {first[row]:g} and {second[row]:g} give no finite impedance")
    return impedance


def reflection_of(table: Table, found: dict[str, Column]) -> ComplexArray:
    """Reflection coefficient of each row of a table with the pair `REFLECTION`."""
    real, imaginary = (column_values(table, found[part]) for part in (REFLECTION.first, REFLECTION.second))
    return real + 1j * imaginary


def column_values(table: Table, column: Column) -> FloatArray:
    """A column in its SI unit."""
    return np.array(table.numbers(column.index), dtype=np.float64) * column.factor
