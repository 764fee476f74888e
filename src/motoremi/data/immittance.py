"""Impedance from the pair of quantities in a file: R and X, |Z| and phase, Ls and Rs, S11 ..., and whether its other columns agree with it."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.columns import Column
from motoremi.data.numbers import last_place
from motoremi.data.quantity import REFERENCE_OHM, REFLECTION
from motoremi.data.table import Table
from motoremi.data.text import clean_text
from motoremi.errors import BadInput

# (angular frequency, first, second) -> impedance in ohm
ToImpedance: TypeAlias = Callable[[FloatArray, FloatArray, FloatArray], ComplexArray]
# Reference resistances of network analysers, in ohm: beside R and X a file may hold reflections in either.
_REFERENCES_OHM = (REFERENCE_OHM, 75.0)
# Largest relative difference of Z between columns of one row beyond the rounding of their numbers: the same as of two readings at one frequency
# (`repeated`), since some meters measure each pair of quantities anew.
_AGREE = 0.03
# Ratios of the resistance and the reactance of a part, which some meters show with the sign of the reactance.
LOSSES = ("quality_factor", "dissipation_factor")
_MAGNITUDES = ("magnitude", "admittance", "reflection_magnitude")
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
    return REFLECTION.impedance_of(_rectangular(w, a, b))


def _series(w: FloatArray, reactance: FloatArray, loss: FloatArray) -> ComplexArray:
    """A reactance with a series resistance; `loss` is their ratio."""
    return _rectangular(w, loss * np.abs(reactance), reactance)


def _unsigned(element: FloatArray, loss: FloatArray) -> FloatArray:
    """The loss without the sign that some meters give it: everywhere that of L or C, or everywhere the opposite one of both that occur.

    Q = X/R and D = R/X have the sign of X. A loss that is below 0 beside elements of one sign above 0 is left as it is.
    """
    signs = np.sign(loss) * np.sign(element)
    signed = np.all(signs >= 0) or (np.all(signs <= 0) and np.any(element < 0) and np.any(element > 0))
    return np.abs(loss) if signed else loss


def _parallel(w: FloatArray, susceptance: FloatArray, loss: FloatArray) -> ComplexArray:
    """A susceptance with a parallel conductance; `loss` is their ratio."""
    return 1 / _rectangular(w, loss * np.abs(susceptance), susceptance)


def _reflection_polar(w: FloatArray, magnitude: FloatArray, phase_deg: FloatArray) -> ComplexArray:
    return REFLECTION.impedance_of(_polar(w, magnitude, phase_deg))


def _reflection_db(w: FloatArray, decibels: FloatArray, phase_deg: FloatArray) -> ComplexArray:
    return _reflection_polar(w, 10 ** (decibels / 20), phase_deg)


def _return_loss(w: FloatArray, decibels: FloatArray, phase_deg: FloatArray) -> ComplexArray:
    # Some programs write it with a minus.
    return _reflection_db(w, -np.abs(decibels), phase_deg)


REFLECTIONS = (
    Pair("s11_real", "s11_imag", "S11 in 50 Ohm", _reflection),
    Pair("reflection_db", "reflection_phase", "S11 in dB and its phase, in 50 Ohm", _reflection_db),
    Pair("return_loss", "reflection_phase", "S11 as return loss and phase, in 50 Ohm", _return_loss),
    Pair("reflection_magnitude", "reflection_phase", "S11 magnitude and phase, in 50 Ohm", _reflection_polar),
)
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
    Pair("parallel_inductance", "conductance", "Lp and G", lambda w, inductance, g: 1 / _rectangular(w, g, -1 / (w * inductance))),
    Pair("series_inductance", "quality_factor", "Ls and Q", lambda w, inductance, q: _series(w, w * inductance, _unsigned(inductance, 1 / q))),
    Pair("series_inductance", "dissipation_factor", "Ls and D", lambda w, inductance, d: _series(w, w * inductance, _unsigned(inductance, d))),
    Pair("series_capacitance", "quality_factor", "Cs and Q", lambda w, c, q: _series(w, -1 / (w * c), _unsigned(c, 1 / q))),
    Pair("series_capacitance", "dissipation_factor", "Cs and D", lambda w, c, d: _series(w, -1 / (w * c), _unsigned(c, d))),
    Pair("parallel_inductance", "quality_factor", "Lp and Q", lambda w, lp, q: _parallel(w, -1 / (w * lp), _unsigned(lp, 1 / q))),
    Pair("parallel_inductance", "dissipation_factor", "Lp and D", lambda w, lp, d: _parallel(w, -1 / (w * lp), _unsigned(lp, d))),
    Pair("parallel_capacitance", "quality_factor", "Cp and Q", lambda w, c, q: _parallel(w, w * c, _unsigned(c, 1 / q))),
    Pair("parallel_capacitance", "dissipation_factor", "Cp and D", lambda w, c, d: _parallel(w, w * c, _unsigned(c, d))),
    *REFLECTIONS,
)


def find_pair(found: Collection[str]) -> Pair | None:
    """The preferred pair among the meanings of columns, or None."""
    return next((pair for pair in PAIRS if {pair.first, pair.second} <= set(found)), None)


def impedance_of(table: Table, found: dict[str, Column], pair: Pair, frequency_hz: FloatArray) -> ComplexArray:
    """Impedance in ohm of each row.

    Raises
    ------
    BadInput
        If a magnitude is below 0, a phase is beyond a full turn, a row has no finite impedance, or another column contradicts it.
    """
    w = 2 * np.pi * frequency_hz
    first, second = column_values(table, found[pair.first]), column_values(table, found[pair.second])
    if pair.first in _MAGNITUDES:
        for row in np.flatnonzero(first < 0)[:1]:
            raise BadInput(f"{table.where(int(row))}: the magnitude {first[row]:g} is below 0; is it a reactance?")
    if "phase" in pair.second:
        for row in np.flatnonzero(np.abs(second) > 360)[:1]:
            raise BadInput(f"{table.where(int(row))}: a phase of {second[row]:g} degrees is beyond a full turn")
    with np.errstate(all="ignore"):
        impedance = pair.impedance(w, first, second)
        rounded = (_last_places(table, found[pair.first]), _last_places(table, found[pair.second]))
        moved = (pair.impedance(w, first + rounded[0], second), pair.impedance(w, first, second + rounded[1]))
        # Where a last digit more makes it infinite, nothing can contradict it.
        uncertain = np.nan_to_num(sum(np.abs(one - impedance) for one in moved) / np.abs(impedance), nan=np.inf)
    for row in np.flatnonzero(~np.isfinite(impedance))[:1]:
        raise BadInput(f"{table.where(int(row))}: {pair.title} of {first[row]:g} and {second[row]:g} give no finite impedance")
    for meaning in sorted(set(found) - {pair.first, pair.second}):
        _refuse_contradiction(table, found, pair, meaning, impedance, uncertain)
    return impedance


def _refuse_contradiction(table: Table, found: dict[str, Column], pair: Pair, meaning: str, impedance: ComplexArray, uncertain: FloatArray) -> None:
    """Raise `BadInput` at the row where a column contradicts the impedance most, by more than `_AGREE` beyond the rounding of both.

    Columns of inductance, capacitance, Q and D are not compared: meters give them with signs and limits of their own.
    """
    if meaning == "resistance" and pair.first.startswith("parallel"):
        return  # it may be that of the parallel circuit
    column = found[meaning]
    expected = _expected(meaning, impedance)
    if not expected or not len(table.rows):
        return
    try:
        values, rounded = column_values(table, column), _last_places(table, column)
    except BadInput:
        return  # a column that is not used may lack values, or hold complex numbers
    if meaning == "return_loss":
        values = -np.abs(values)
    beyond = []
    for value, slope in expected:
        apart = values - value
        if "phase" in meaning:
            apart = (apart + 180) % 360 - 180
        beyond.append(np.abs(apart) - rounded - slope * (_AGREE + uncertain))
    best = min(range(len(beyond)), key=lambda one: float(beyond[one].max()))
    row = int(np.argmax(beyond[best]))
    if beyond[best][row] > 0:
        title, cell = clean_text(table.columns[column.index], 40), clean_text(table.rows[row][column.index], 40)
        raise BadInput(
            f"{table.where(row)}: {pair.title} and the column {title!r} contradict each other: it says {cell} where "
            f"{expected[best][0][row] / column.factor:.6g} follows; remove the columns that are wrong, or write whose they are in their names"
        )


def _expected(meaning: str, impedance: ComplexArray) -> list[tuple[FloatArray, FloatArray]]:
    """What a column of this meaning holds of an impedance, and its change for a relative change of it by 1; several if it is not known of which
    reference resistance, none if it is not compared."""
    size, degree = np.abs(impedance), np.full(impedance.shape, np.rad2deg(1))
    with np.errstate(all="ignore"):
        admittance = 1 / impedance
        of_impedance = {
            "resistance": (impedance.real, size),
            "series_resistance": (impedance.real, size),
            "reactance": (impedance.imag, size),
            "magnitude": (size, size),
            "phase": (np.angle(impedance, deg=True), degree),
            "conductance": (admittance.real, 1 / size),
            "susceptance": (admittance.imag, 1 / size),
            "admittance": (1 / size, 1 / size),
            "admittance_phase": (-np.angle(impedance, deg=True), degree),
        }
        if meaning in of_impedance:
            return [of_impedance[meaning]]
        if not any(meaning in (pair.first, pair.second) for pair in REFLECTIONS):
            return []
        return [_expected_reflection(meaning, (impedance - reference) / (impedance + reference)) for reference in _REFERENCES_OHM]


def _expected_reflection(meaning: str, s: ComplexArray) -> tuple[FloatArray, FloatArray]:
    change = np.abs(1 - s**2) / 2
    size = np.abs(s)
    if meaning == "reflection_phase":
        return np.angle(s, deg=True), np.rad2deg(change / size)
    if meaning in ("reflection_db", "return_loss"):
        return 20 * np.log10(size), 20 / np.log(10) * change / size
    return {"s11_real": s.real, "s11_imag": s.imag}.get(meaning, size), change


def _last_places(table: Table, column: Column) -> FloatArray:
    """One unit in the last digit of each number of a column, in its SI unit."""
    return np.array([last_place(cells[column.index]) for cells in table.rows]) * abs(column.factor)


def column_values(table: Table, column: Column) -> FloatArray:
    """A column in its SI unit."""
    return np.array(table.numbers(column.index), dtype=np.float64) * column.factor


def in_rising_order(table: Table, column: Column) -> tuple[Table, tuple[str, ...]]:
    """The table with its rows turned round if every frequency is lower than the one before it, and that this was done in words."""
    frequency = column_values(table, column)
    if frequency.size < 2 or not np.all(np.diff(frequency) < 0):
        return table, ()
    return table.only(range(frequency.size)[::-1]), ("measured from high to low frequencies: rows turned round",)
