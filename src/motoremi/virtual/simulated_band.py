"""Centre and span of a sweep, for simulated instruments that have them in addition to start and stop."""

from __future__ import annotations

import math
from collections.abc import Callable

from motoremi.virtual.simulated_device import SimulatedDevice, number_text


def about(middle: float, half: float, low: float, high: float) -> tuple[float, float]:
    """First and last frequency for a new centre; the span is reduced if it does not fit."""
    middle = min(max(middle, low), high)
    half = min(half, middle - low, high - middle)
    return middle - half, middle + half


def as_wide_as(middle: float, half: float, low: float, high: float) -> tuple[float, float]:
    """First and last frequency for a new span; the centre is moved if it does not fit."""
    half = min(half, (high - low) / 2)
    middle = min(max(middle, low + half), high - half)
    return middle - half, middle + half


def band_commands(device: SimulatedDevice, center: str, span: str, start: str, stop: str) -> dict[str, Callable[[str], bytes | None]]:
    """The commands and queries of centre and span.

    Parameters
    ----------
    device : SimulatedDevice
    center, span : str
        Headers.
    start, stop : str
        Names of the profile's settings that they change.
    """

    def edges() -> tuple[float, float]:
        return float(device.value(start)), float(device.value(stop))

    def move(argument: str, *, width: bool) -> None:
        text = number_text(argument)
        value = math.nan if text is None else float(text)
        if not math.isfinite(value) or (width and value < 0):
            device.note_error("execution_error")
            return
        first, last = edges()
        limits = float(device.limits(start)[0]), float(device.limits(stop)[1])
        first, last = as_wide_as((first + last) / 2, value / 2, *limits) if width else about(value, abs(last - first) / 2, *limits)
        device.set_value(start, first)
        device.set_value(stop, last)

    def shown(value: float) -> bytes:
        return f"{value:+.11E}".encode()

    return {
        center: lambda argument: move(argument, width=False),
        f"{center}?": lambda _: shown(sum(edges()) / 2),
        span: lambda argument: move(argument, width=True),
        f"{span}?": lambda _: shown(edges()[1] - edges()[0]),
    }
