"""Rows with the same frequency: those of a sweep are averaged if they agree; of levels the highest is kept."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from motoremi.arrays import BoolArray, FloatArray, JsonDict
from motoremi.data.rows import Rows
from motoremi.data.spectrum import Spectrum
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
    for array in (frequency, impedance):
        array[firsts] = (array[firsts] + array[firsts + 1]) / 2
    kept = np.flatnonzero(~np.concatenate([[False], pairs]))
    sigma, rounding = (_larger_of_two(own, firsts, kept) for own in (rows.sigma_relative, rows.rounding_relative))
    return replace(
        rows,
        frequency_hz=frequency[kept],
        impedance_ohm=impedance[kept],
        sigma_relative=sigma,
        rounding_relative=rounding,
        where=lambda row: rows.where(int(kept[row])),
        changes=(*rows.changes, _description(frequency[firsts], differences)),
    )


def _larger_of_two(sigma: FloatArray | None, firsts: NDArray[np.intp], kept: NDArray[np.intp]) -> FloatArray | None:
    """An error of each row that is kept, of two with one frequency the larger; None if it is not known."""
    if sigma is None:
        return None
    larger = sigma.copy()
    larger[firsts] = np.maximum(sigma[firsts], sigma[firsts + 1])
    return larger[kept]


@dataclass(frozen=True, eq=False)
class Levels:
    """Levels against frequency, before a spectrum is made of them.

    Parameters
    ----------
    frequency_hz, level_dbuv : ndarray, shape (n,)
    overload : ndarray of bool, shape (n,), or None
    changes : tuple of str
        What was left out, in words.
    """

    frequency_hz: FloatArray
    level_dbuv: FloatArray
    overload: BoolArray | None = None
    changes: tuple[str, ...] = ()


def keep_highest(levels: Levels) -> Levels:
    """One level for each frequency: the higher of two, which is the cautious one for a limit.

    Raises
    ------
    BadInput
        If a frequency occurs more than twice, or one of two readings is overloaded.
    """
    frequency, level = levels.frequency_hz, levels.level_dbuv.copy()
    firsts = np.flatnonzero(_same_as_next(frequency))
    if firsts.size == 0:
        return levels
    for row in firsts[1:][np.diff(firsts) == 1][:1]:
        raise BadInput(f"the frequency {frequency[row]:.9g} Hz occurs more than twice; keep one row of it")
    marks = np.zeros(frequency.shape, dtype=np.bool_) if levels.overload is None else levels.overload
    for row in firsts[marks[firsts] != marks[firsts + 1]][:1]:
        raise BadInput(f"the frequency {frequency[row]:.9g} Hz occurs twice, once overloaded; keep the row that is not")
    apart = float(np.abs(level[firsts] - level[firsts + 1]).max())
    level[firsts] = np.maximum(level[firsts], level[firsts + 1])
    kept = np.delete(np.arange(frequency.size), firsts + 1)
    change = f"{_which(frequency[firsts])} twice, readings up to {apart:.2g} dB apart: the higher is kept"
    return Levels(frequency[kept], level[kept], None if levels.overload is None else marks[kept], (*levels.changes, change))


def spectrum_of(detector: str, levels: Levels, bandwidth_hz: float, metadata: JsonDict) -> Spectrum:
    """A spectrum with one level for each frequency (`keep_highest`); `changes` of its metadata record what was left out."""
    kept = keep_highest(levels)
    noted = {"changes": list(kept.changes)} if kept.changes else {}
    return Spectrum(detector, kept.frequency_hz, kept.level_dbuv, bandwidth_hz, kept.overload, {**metadata, **noted})


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


def _which(frequency: FloatArray) -> str:
    first = f"{frequency[0] / 1e6:.9g} MHz"
    return f"{first} occurs" if frequency.size == 1 else f"{frequency.size} frequencies, {first} the first, occur"


def _description(frequency: FloatArray, differences: FloatArray) -> str:
    return f"{_which(frequency)} twice, values up to {percent(100 * differences.max(), 2)} apart: averaged"
