"""Rows with the same frequency: averaged if they agree, refused if they do not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from motoremi.arrays import BoolArray, FloatArray
from motoremi.data.rows import Rows
from motoremi.errors import BadInput
from motoremi.quantities import percent

# Largest relative difference of two readings at one frequency that are averaged.
AGREE = 0.03
# Two frequencies count as the same if they differ by less than this, relative to the frequency and to the sweep's own steps.
_SAME = 1e-6
_SAME_OF_STEP = 1e-3


def merge_duplicates(rows: Rows) -> Rows:
    """One row for each frequency; its `changes` say what was averaged.

    Raises
    ------
    BadInput
        If a frequency occurs more than twice, or twice with values that differ by more than `AGREE`.
    """
    pairs = _same_as_next(rows.frequency_hz)
    firsts = np.flatnonzero(pairs)
    if firsts.size == 0:
        return rows
    differences = _differences(rows, firsts)
    frequency, impedance = rows.frequency_hz.copy(), rows.impedance_ohm.copy()
    sigma = None if rows.sigma_relative is None else rows.sigma_relative.copy()
    for array in (frequency, impedance):
        array[firsts] = (array[firsts] + array[firsts + 1]) / 2
    if sigma is not None:
        sigma[firsts] = np.maximum(sigma[firsts], sigma[firsts + 1])
    kept = np.flatnonzero(~np.concatenate([[False], pairs]))
    return replace(
        rows,
        frequency_hz=frequency[kept],
        impedance_ohm=impedance[kept],
        sigma_relative=None if sigma is None else sigma[kept],
        where=lambda row: rows.where(int(kept[row])),
        changes=(*rows.changes, _description(frequency[firsts], differences)),
    )


def _same_as_next(frequency: FloatArray) -> BoolArray:
    """For each row but the last, whether the next has the same frequency; decreasing frequencies are left to the sweep's own check."""
    if frequency.size < 2 or not np.all(np.isfinite(frequency)) or np.any(frequency <= 0):
        return np.zeros(max(frequency.size - 1, 0), dtype=np.bool_)
    steps = np.diff(frequency) / frequency[1:]
    rising = steps[steps > 0]
    near = min(_SAME, _SAME_OF_STEP * float(np.median(rising))) if rising.size else 0.0
    return (steps >= 0) & (steps <= near)


def _differences(rows: Rows, firsts: NDArray[np.intp]) -> FloatArray:
    """Relative difference of each pair of rows with one frequency."""
    for row in firsts[1:][np.diff(firsts) == 1][:1]:
        raise BadInput(f"{rows.where(int(row) + 1)}: the frequency {rows.frequency_hz[row]:.9g} Hz occurs more than twice; keep one row of it")
    one, other = rows.impedance_ohm[firsts], rows.impedance_ohm[firsts + 1]
    differences: FloatArray = np.abs(one - other) / np.maximum(np.maximum(np.abs(one), np.abs(other)), np.finfo(float).tiny)
    for number in np.flatnonzero(~(differences <= AGREE))[:1]:
        row = int(firsts[number])
        raise BadInput(
            f"{rows.where(row + 1)}: the frequency {rows.frequency_hz[row]:.9g} Hz occurs twice, "
            f"with values {percent(100 * differences[number], 2)} apart; keep one row for each frequency"
        )
    return differences


def _description(frequency: FloatArray, differences: FloatArray) -> str:
    first = f"{frequency[0] / 1e6:.9g} MHz"
    which = f"{first} occurs" if frequency.size == 1 else f"{frequency.size} frequencies, {first} the first, occur"
    return f"{which} twice, values up to {percent(100 * differences.max(), 2)} apart: averaged"
