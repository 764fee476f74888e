"""Sources of the emission: voltage steps of commutation, arcs, a chopper, and the paper's high-pass source.

A source is described by the Fourier integral of one event, in V s, and by the rate of events. The voltage of a contact settles exponentially:
step U, 10 to 90 % in tr = 2.2 tau, |V| = U/(2 pi f)/sqrt(1 + (2 pi f tau)^2), which falls by 20 dB per decade up to 0.35/tr and by 40 beyond. A
chopper switches in linear ramps: U/(2 pi f) |sinc(f tr)| each, the two edges of a pulse with opposite signs.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.emission.commutation import Commutation
from motoremi.errors import BadInput


def repetition_hz(speed_rpm: float, segments: int, interleaved: bool = False) -> float:
    """Commutations per second.

    Parameters
    ----------
    speed_rpm : float
    segments : int
        Bars of the commutator.
    interleaved : bool
        Whether two brush arms commutate alternately instead of simultaneously, for example with an odd number of bars.
    """
    _checked("speed_rpm", speed_rpm, above=0)
    _checked("segments", segments, above=0)
    return segments * speed_rpm / 60 * (2 if interleaved else 1)


def _checked(name: str, value: float, above: float | None = None, least: float | None = None, most: float | None = None) -> None:
    good = math.isfinite(value)
    good &= above is None or value > above
    good &= least is None or value >= least
    good &= most is None or value <= most
    if not good:
        wanted = f"above {above:g}" if above is not None else f"{least:g} or more" if most is None else f"between {least:g} and {most:g}"
        raise BadInput(f"{name} is {value}; it must be {wanted}")


def step_density(frequency_hz: FloatArray, step_v: float, rise_s: float) -> ComplexArray:
    """Fourier integral of a step that settles exponentially, 10 to 90 % in `rise_s`, in V s; it begins at time zero."""
    omega: ComplexArray = np.asarray(2j * np.pi * frequency_hz, dtype=np.complex128)
    return step_v / (omega * (1 + omega * (rise_s / math.log(9))))


def ramp_density(frequency_hz: FloatArray, step_v: float, rise_s: float) -> ComplexArray:
    """Fourier integral of a step that rises linearly, in V s; the rise begins at time zero."""
    shape = np.sinc(frequency_hz * rise_s) * np.exp(-1j * np.pi * frequency_hz * rise_s)
    return step_v * shape / (2j * np.pi * frequency_hz)


@dataclass(frozen=True)
class Arc:
    """The arc when a segment leaves the brush.

    Parameters
    ----------
    voltage_v : float
        Mean voltage step when the arc extinguishes: 12 to 20 V.
    rise_s : float
        10 to 200 ns.
    spread : float
        Standard deviation of the voltage from one arc to the next, relative to its mean.
    """

    voltage_v: float = 15.0
    rise_s: float = 50e-9
    spread: float = 0.1

    def __post_init__(self) -> None:
        _checked("arc voltage_v", self.voltage_v, above=0)
        _checked("arc rise_s", self.rise_s, above=0)
        _checked("arc spread", self.spread, least=0, most=0.5)


@dataclass(frozen=True)
class Chopper:
    """A PWM chopper's trapezoid in series with the motor.

    Parameters
    ----------
    amplitude_v : float
        Amplitude of the part that drives common-mode current.
    frequency_hz, duty, rise_s : float
    """

    amplitude_v: float
    frequency_hz: float
    duty: float = 0.5
    rise_s: float = 100e-9

    def __post_init__(self) -> None:
        _checked("chopper amplitude_v", self.amplitude_v, above=0)
        _checked("chopper frequency_hz", self.frequency_hz, above=0)
        _checked("chopper duty", self.duty, least=0.001, most=0.999)
        _checked("chopper rise_s", self.rise_s, above=0)
        if self.rise_s * self.frequency_hz > min(self.duty, 1 - self.duty):
            raise BadInput(f"the chopper's rise time of {self.rise_s:g} s does not fit into its pulses")

    def density(self, frequency_hz: FloatArray) -> ComplexArray:
        """Fourier integral of one period, in V s."""
        width_s = self.duty / self.frequency_hz
        both = 1 - np.exp(-2j * np.pi * frequency_hz * width_s)
        return ramp_density(frequency_hz, self.amplitude_v, self.rise_s) * both


@dataclass(frozen=True)
class HighPass:
    """The paper's behavioural source (its HIPASS block): a level at every frequency, without events. The paper gives no values for it.

    Parameters
    ----------
    level_v : float
        Rms value well above the corner frequency.
    corner_hz : float
    """

    level_v: float = 1e-3
    corner_hz: float = 150e3

    def __post_init__(self) -> None:
        _checked("high-pass level_v", self.level_v, above=0)
        _checked("high-pass corner_hz", self.corner_hz, above=0)

    def voltage(self, frequency_hz: FloatArray) -> FloatArray:
        """Rms value in volt at each frequency."""
        ratio = frequency_hz / self.corner_hz
        return self.level_v * ratio / np.sqrt(1 + ratio**2)


@dataclass(frozen=True)
class Source:
    """All sources of common-mode current.

    Parameters
    ----------
    repetition_hz : float
        Commutations per second.
    step_v, rise_s : float
        Step of the contact voltage at the end of a commutation, and its fall time. The step follows from `Commutation.end_step_v`;
        the paper does not state the time, and a microsecond is an assumption.
    arc : Arc, optional
    jitter_s : float
        Standard deviation of the times of commutation.
    missing_share : float
        Share of commutations without a step (brush bounce).
    chopper : Chopper, optional
    high_pass : HighPass, optional
    """

    repetition_hz: float = 560.0
    step_v: float = 1.0
    rise_s: float = 1e-6
    arc: Arc | None = None
    jitter_s: float = 0.0
    missing_share: float = 0.0
    chopper: Chopper | None = None
    high_pass: HighPass | None = None

    def __post_init__(self) -> None:
        _checked("repetition_hz", self.repetition_hz, above=0)
        _checked("step_v", self.step_v, least=0)
        _checked("rise_s", self.rise_s, above=0)
        _checked("jitter_s", self.jitter_s, least=0)
        _checked("missing_share", self.missing_share, least=0, most=0.95)

    @classmethod
    def of(cls, commutation: Commutation, repetition_hz: float, arc_voltage_v: float = 15.0, rise_s: float = 1e-6) -> Source:
        """The source for a commutation: a step of the contact voltage, or an arc if the current does not reverse in time."""
        spark = commutation.spark(arc_voltage_v)
        if spark is not None:
            return cls(repetition_hz, 0.0, rise_s, Arc(arc_voltage_v))
        return cls(repetition_hz, min(commutation.end_step_v(), arc_voltage_v), rise_s)

    def density(self, frequency_hz: FloatArray) -> ComplexArray:
        """Fourier integral of one commutation with its arc, in V s."""
        total: ComplexArray = step_density(frequency_hz, self.step_v, self.rise_s)
        if self.arc is not None:
            total = total + step_density(frequency_hz, self.arc.voltage_v, self.arc.rise_s)
        return total

    def to_dict(self) -> JsonDict:
        """Plain data, SI units; missing parts are left out."""
        return {key: value for key, value in asdict(self).items() if value is not None}

    @classmethod
    def from_dict(cls, values: JsonDict) -> Source:
        """From plain data, as stored in a session or a file.

        Raises
        ------
        BadInput
            For an unknown name, or a value out of range.
        """
        parts: dict[str, Any] = {"arc": Arc, "chopper": Chopper, "high_pass": HighPass}
        try:
            made: dict[str, Any] = {key: parts[key](**value) if key in parts else float(value) for key, value in values.items()}
            return cls(**made)
        except (TypeError, ValueError) as error:
            if isinstance(error, BadInput):
                raise
            raise BadInput(f"the source cannot be read: {error}") from error
