"""Conversion to plain data, and strict reading and writing of JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from datetime import date
from pathlib import PurePath
from typing import Any

import numpy as np

from motoremi.arrays import JsonDict

_LINE = json.JSONEncoder(allow_nan=False, separators=(",", ":"))


def plain(value: Any) -> Any:
    """Convert a value to types that JSON has; a number that is not finite becomes None.

    Raises
    ------
    TypeError
        For objects without an obvious plain form, such as complex numbers, whose parts are to be stored under names.
    """
    if value is None or isinstance(value, (str, bool, int)):
        return value
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, (set, frozenset)):
        return sorted((plain(item) for item in value), key=str)
    if isinstance(value, (PurePath, date)):
        return value.as_posix() if isinstance(value, PurePath) else value.isoformat()
    raise TypeError(f"{type(value).__name__} has no plain form")


def to_line(document: Mapping[str, Any]) -> str:
    """One document as one line of JSON, ASCII only."""
    try:
        # Most records of traffic are plain already, and there are hundreds in a sweep.
        return _LINE.encode(document)
    except (TypeError, ValueError):
        return _LINE.encode(plain(document))


def to_page(document: Mapping[str, Any]) -> str:
    """One document as indented JSON with sorted keys: the same data always gives the same text."""
    return json.dumps(plain(document), allow_nan=False, indent=1, sort_keys=True) + "\n"


def from_json(text: str | bytes) -> Any:
    """Parse JSON, without the NaN and Infinity that Python accepts.

    Raises
    ------
    ValueError
        If it is not JSON, is nested too deeply, or contains a number out of range.
    """
    try:
        return json.loads(text, parse_constant=_refuse_constant, parse_float=_finite)
    except RecursionError as error:
        raise ValueError("nested too deeply") from error


def object_from_json(text: str | bytes) -> JsonDict:
    """Parse JSON that must be an object.

    Raises
    ------
    ValueError
        If it is not.
    """
    value = from_json(text)
    if not isinstance(value, dict):
        raise ValueError("not a JSON object")
    return value


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is not JSON")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError("number out of range")
    return value
