"""Checks of what callers give to constructors and public functions: anything else is refused in one sentence that says what to give."""

from __future__ import annotations

import operator
from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motoremi.arrays import ComplexArray, FloatArray, FrozenDict
from motoremi.errors import BadInput

Kinds: TypeAlias = type | tuple[type, ...]


def refuse_other(value: object, kinds: Kinds, what: str) -> None:
    """Raise `BadInput` for an argument of another type; `what` is the sentence up to what was given: "compare needs a Fit"."""
    if not isinstance(value, kinds):
        raise BadInput(f"{what}, not {'None' if value is None else f'a value of type {type(value).__name__}'}")


def real_numbers(values: ArrayLike, what: str) -> FloatArray:
    """A copy as real numbers; `what` names them: "short sweep: the frequencies".

    Raises
    ------
    BadInput
        If some are masked, complex, or no numbers.
    """
    given = _numbers(values, what)
    if given.dtype.kind == "c":
        raise BadInput(f"{what} are complex numbers: give real ones")
    return _converted(given, np.dtype(np.float64), what)


def complex_numbers(values: ArrayLike, what: str) -> ComplexArray:
    """The same as complex numbers."""
    return _converted(_numbers(values, what), np.dtype(np.complex128), what)


def _numbers(values: ArrayLike, what: str) -> NDArray[Any]:
    if isinstance(values, np.ma.MaskedArray) and np.any(np.ma.getmaskarray(values)):
        masked = int(np.sum(np.ma.getmaskarray(values)))
        remedy = "leave these points out of all arrays (keep = ~numpy.ma.getmaskarray(...))"
        raise BadInput(f"{what} are masked at {masked} of {values.size} points: {remedy}")
    try:
        return np.asarray(values)
    except (TypeError, ValueError) as error:  # rows of different lengths
        raise BadInput(f"{what} are not an array of numbers") from error


def _converted(given: NDArray[Any], wanted: np.dtype[Any], what: str) -> NDArray[Any]:
    try:
        # Texts and objects may be numbers; dates and truth values are none.
        if given.dtype.kind not in "iufcOU":
            raise TypeError(given.dtype)
        return given.astype(wanted)
    except (TypeError, ValueError) as error:
        raise BadInput(f"{what} are not numbers") from error


def real_number(value: object, what: str) -> float:
    """One real number; `what` names it.

    Raises
    ------
    BadInput
        If it is none; a text with a unit is none.
    """
    try:
        if isinstance(value, (str, bytes)):
            raise TypeError(value)
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError) as error:
        raise BadInput(f"{what} must be a number in SI units, not {value!r}") from error


def seed_number(value: object) -> int:
    """The start of random numbers: a whole number from 0 upwards.

    Raises
    ------
    BadInput
        If it is none.
    """
    try:
        seed = operator.index(value)  # type: ignore[arg-type]
    except TypeError as error:
        raise BadInput(f"the seed must be a whole number from 0 upwards, not {value!r}") from error
    if seed < 0:
        raise BadInput(f"the seed must be a whole number from 0 upwards, not {seed}")
    return seed


def frozen_metadata(metadata: Mapping[str, Any] | None, what: str) -> FrozenDict[str, Any]:
    """Metadata that cannot be changed.

    Raises
    ------
    BadInput
        If they are no mapping.
    """
    if metadata is None:
        return FrozenDict()
    refuse_other(metadata, Mapping, f"{what}: metadata are a dictionary, for example {{'source': 'bench 2'}}")
    return FrozenDict(metadata)
