"""Common types: arrays of double precision, plain data, and progress functions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
ComplexArray: TypeAlias = NDArray[np.complex128]
BoolArray: TypeAlias = NDArray[np.bool_]
IntArray: TypeAlias = NDArray[np.intp]
JsonDict: TypeAlias = dict[str, Any]
# What is being done, how much is done, and of how much.
Progress: TypeAlias = Callable[[str, int, int], None]
