"""The motor's state that is stored with a sweep or spectrum: its quantities, and their display."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

# Key in the metadata -> name and unit.
STATE_QUANTITIES: dict[str, tuple[str, str]] = {
    "voltage_volt": ("voltage", "V"),
    "current_ampere": ("current", "A"),
    "speed_rpm": ("speed", "rpm"),
    "temperature_degc": ("temperature", "degC"),
}


def show_state(key: str, value: float) -> str:
    """A value with its unit, such as `3012 rpm`."""
    # Without prefixes: 3012 rpm, not 3.012 krpm.
    return f"{value:.4g} {STATE_QUANTITIES[key][1]}"


def state_line(state: object) -> str:
    """The values of a state in one line, such as `12 V, 0.43 A, 3012 rpm, 45.3 degC`; empty if it holds none."""
    values = state if isinstance(state, Mapping) else {}
    return ", ".join(show_state(key, values[key]) for key in STATE_QUANTITIES if _is_number(values.get(key)))


def marks_of(state: object) -> list[str]:
    """The marks of a state: quantities outside of the required limits, and quantities that could not be read."""
    if not isinstance(state, Mapping):
        return []
    outside, missing = state.get("outside"), state.get("missing")
    marks = [str(text) for text in outside] if isinstance(outside, list) else []
    for key, reason in (missing if isinstance(missing, Mapping) else {}).items():
        marks.append(f"{STATE_QUANTITIES.get(key, (key, ''))[0]} not read: {reason}")
    return marks


def states_of(documents: Iterable[Mapping[str, Any]]) -> list[tuple[str, Mapping[str, Any]]]:
    """File and state of every sweep and spectrum that was measured with one."""
    return [
        (str(document.get("file")), document["state"])
        for document in documents
        if document.get("kind") in ("sweep", "spectrum", "final") and isinstance(document.get("state"), Mapping)
    ]


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
