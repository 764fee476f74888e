"""Common types: arrays of double precision, plain data, mappings that cannot be changed, and progress functions; runs of marked points."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NoReturn, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
ComplexArray: TypeAlias = NDArray[np.complex128]
BoolArray: TypeAlias = NDArray[np.bool_]
IntArray: TypeAlias = NDArray[np.intp]
JsonDict: TypeAlias = dict[str, Any]
# What is being done, how much is done, and of how much.
Progress: TypeAlias = Callable[[str, int, int], None]

Key = TypeVar("Key")
Value = TypeVar("Value")


def runs(marked: BoolArray) -> list[slice]:
    """The runs of neighbouring marked points of an array of shape (n,), in their order."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], marked.astype(np.int8), [0]])))
    return [slice(first, end) for first, end in edges.reshape(-1, 2).tolist()]


class ReadOnlyArrays:
    """A result whose own arrays stay read-only in its copies and in other processes, where numpy makes them writable."""

    def __setstate__(self, state: dict[str, Any]) -> None:
        for value in state.values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
        self.__dict__.update(state)


class FrozenDict(dict[Key, Value]):
    """A dictionary of a result, which cannot be changed.

    A subclass and not a `MappingProxyType`, because results are sent to other processes and written as JSON.
    """

    def _refuse(self, *_: object, **__: object) -> NoReturn:
        raise TypeError("results are immutable: change a copy, dict(...)")

    __setitem__ = __delitem__ = clear = pop = popitem = setdefault = update = __ior__ = _refuse

    def __reduce__(self) -> tuple[type[FrozenDict[Key, Value]], tuple[dict[Key, Value]]]:
        return type(self), (dict(self),)
