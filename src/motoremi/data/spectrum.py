"""An emission spectrum as an EMI receiver measures it."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from motoremi.arrays import BoolArray, FloatArray, JsonDict, ReadOnlyArrays
from motoremi.data.sweep import checked_frequency
from motoremi.data.text import clean_text
from motoremi.drawing import figure_of
from motoremi.errors import BadInput
from motoremi.given import frozen_metadata, real_number, real_numbers
from motoremi.quantities import show, show_band

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

Detector = Literal["peak", "quasi-peak", "average", "cispr-average", "rms-average"]
DETECTORS: tuple[Detector, ...] = get_args(Detector)
MOTOR_RUNNING, MOTOR_OFF = "motor running", "motor off"
# The state of the motor as people write it, in lower case; EUT and DUT are the equipment and the device under test.
_CONDITIONS = {
    **dict.fromkeys((MOTOR_RUNNING, "running", "motor on", "on", "eut on", "dut on"), MOTOR_RUNNING),
    **dict.fromkeys((MOTOR_OFF, "off", "background", "background noise", "ambient", "ambient noise", "eut off", "dut off"), MOTOR_OFF),
}


def motor_condition(written: object) -> str:
    """`MOTOR_RUNNING` or `MOTOR_OFF` in any of its spellings; other text as written."""
    text = str(written)
    return _CONDITIONS.get(re.sub(r"[\s_-]+", " ", text.strip().lower()), text)


def known_condition(written: object) -> str:
    """The state of the motor that the header of a spectrum names.

    Raises
    ------
    BadInput
        If it is not known, because a background would be judged as the motor.
    """
    condition = motor_condition(written)
    if condition in (MOTOR_RUNNING, MOTOR_OFF):
        return condition
    raise BadInput(
        f"unknown condition {clean_text(condition, 40)!r}: write '# condition: {MOTOR_OFF}' (or background, ambient, off) for a background, "
        f"'# condition: {MOTOR_RUNNING}' for the motor, and its operating state in a line '# operating: ...'"
    )


@dataclass(frozen=True, eq=False)
class Spectrum(ReadOnlyArrays):
    """Level against frequency for one detector.

    Parameters
    ----------
    detector : {"peak", "quasi-peak", "average", "cispr-average", "rms-average"}
        "average" is the mean over the dwell time; "cispr-average" is the highest reading of a meter with the time constant of
        CISPR 16-1-1 (160 ms below 30 MHz).
    frequency_hz : array_like, shape (n,)
        Strictly increasing, in hertz; at least two, but for a final value, whose metadata have `maximum_hz`.
    level_dbuv : array_like, shape (n,)
        In dB above 1 uV at the receiver's input.
    resolution_bandwidth_hz : float
        6 dB bandwidth in hertz (9 kHz in CISPR band B).
    overload : array_like of bool, optional
        Points that the receiver marked as overloaded: they are kept but not compared with a limit.
    metadata : mapping, optional

    Raises
    ------
    BadInput
        For an unknown detector, arrays that do not match, masked points, NaN, or levels that cannot be dBuV.
    """

    detector: Detector
    frequency_hz: FloatArray
    level_dbuv: FloatArray
    resolution_bandwidth_hz: float
    overload: BoolArray
    metadata: Mapping[str, Any] = field(default_factory=dict)

    def __init__(
        self,
        detector: str,
        frequency_hz: ArrayLike,
        level_dbuv: ArrayLike,
        resolution_bandwidth_hz: float = 9e3,
        overload: ArrayLike | None = None,
        metadata: Mapping[str, Any] | None = None,
    ) -> None:
        if detector not in DETECTORS:
            raise BadInput(f"unknown detector {detector!r}: use one of {', '.join(DETECTORS)}")
        least = 1 if isinstance(metadata, Mapping) and "maximum_hz" in metadata else 2
        frequency = checked_frequency(frequency_hz, f"{detector} spectrum", least)
        level = real_numbers(level_dbuv, f"{detector} spectrum: the levels")
        if level.shape != frequency.shape:
            raise BadInput(f"{detector} spectrum: {frequency.size} frequencies but {level.size} levels")
        if not np.all(np.isfinite(level)):
            raise BadInput(f"{detector} spectrum: a level is not a finite number")
        if np.any(np.abs(level) > 250):
            raise BadInput(f"{detector} spectrum: levels beyond ±250 are not dBuV; convert them first")
        bandwidth_hz = real_number(resolution_bandwidth_hz, f"{detector} spectrum: the resolution bandwidth")
        if not bandwidth_hz > 0:
            raise BadInput(f"{detector} spectrum: the resolution bandwidth must be above 0 Hz")
        marked = np.zeros(frequency.shape, dtype=np.bool_) if overload is None else np.array(overload, dtype=np.bool_)
        if marked.shape != frequency.shape:
            raise BadInput(f"{detector} spectrum: {frequency.size} frequencies but {marked.size} overload marks")
        for array in (frequency, level, marked):
            array.flags.writeable = False
        for name, value in (
            ("detector", detector),
            ("frequency_hz", frequency),
            ("level_dbuv", level),
            ("resolution_bandwidth_hz", bandwidth_hz),
            ("overload", marked),
            ("metadata", frozen_metadata(metadata, f"{detector} spectrum")),
        ):
            object.__setattr__(self, name, value)

    @property
    def condition(self) -> str:
        """State of the motor according to the metadata; "motor running" if it is not stated."""
        return motor_condition(self.metadata.get("condition", MOTOR_RUNNING))

    @property
    def is_background(self) -> bool:
        """Whether it was measured with the motor off."""
        return self.condition == MOTOR_OFF

    @property
    def level_unit(self) -> str:
        """Unit of the levels: dBuV, or that of corrected levels."""
        return str(self.metadata.get("level_unit", "dBuV"))

    def with_metadata(self, **extra: Any) -> Spectrum:
        """The same spectrum with more metadata."""
        return dataclasses.replace(self, metadata={**self.metadata, **extra})

    def __len__(self) -> int:
        return int(self.frequency_hz.size)

    def __repr__(self) -> str:
        return f"Spectrum({self.detector!r}, {self.summary()})"

    def summary(self) -> str:
        """One line for a person."""
        span = show_band(float(self.frequency_hz[0]), float(self.frequency_hz[-1]))
        bandwidth = show(self.resolution_bandwidth_hz, "Hz")
        background = f", background ({MOTOR_OFF})" if self.is_background else ""
        points = f"{len(self)} points, {span}" if len(self) > 1 else f"1 point, {show(float(self.frequency_hz[0]), 'Hz')}"
        return f"{points}, {self.detector} in {bandwidth}, up to {self.level_dbuv.max():.1f} {self.level_unit}{background}"

    def _repr_html_(self) -> str:
        return f"<b>{self.detector} spectrum</b>: {self.summary()}"

    def to_frame(self) -> pd.DataFrame:
        """A pandas table: frequency_hz, level_dbuv, overload."""
        import pandas as pd

        return pd.DataFrame({"frequency_hz": self.frequency_hz, "level_dbuv": self.level_dbuv, "overload": self.overload})

    def plot(self) -> Figure:
        """Level over frequency, overloaded points marked."""
        return figure_of(self)

    def to_dict(self) -> JsonDict:
        """Plain data, SI units and dBuV."""
        return {
            "detector": self.detector,
            "frequency_hz": self.frequency_hz.tolist(),
            "level_dbuv": self.level_dbuv.tolist(),
            "resolution_bandwidth_hz": self.resolution_bandwidth_hz,
            "overload": self.overload.tolist(),
            "metadata": dict(self.metadata),
        }
