"""From the source inside the motor to the receiver: fitted motor, stray capacitance, cable, two LISNs.

    source - motor (Z_open) - [Cs to ground] - cable - LISN || LISN        common mode: each port has the whole voltage
    source - motor (Z_short) - cable - LISN + LISN                         differential mode: each port has half of it

Networks and values of the LISNs: `50 || (50 uH + 5 Ohm)` and, with a measuring capacitor, the 5 uH network of CISPR 25.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.errors import BadInput

Mode: TypeAlias = Literal["common", "differential"]


@dataclass(frozen=True)
class Lisn:
    """A LISN with the receiver connected.

    Parameters
    ----------
    name : str
    inductance_h, series_ohm : float
        Choke and resistor between the port and the supply, which is a short circuit for noise.
    receiver_ohm : float
    coupling_f : float, optional
        Capacitor in front of the receiver; ideal if None.
    """

    name: str
    inductance_h: float
    series_ohm: float
    receiver_ohm: float = 50.0
    coupling_f: float | None = None

    def impedance(self, s: ComplexArray) -> ComplexArray:
        """Impedance of the port against ground, in ohm."""
        return 1 / (1 / (self.series_ohm + s * self.inductance_h) + 1 / self._branch(s))

    def reading(self, s: ComplexArray) -> ComplexArray:
        """Voltage at the receiver for one volt at the port."""
        return self.receiver_ohm / self._branch(s)

    def _branch(self, s: ComplexArray) -> ComplexArray:
        return self.receiver_ohm + (0 * s if self.coupling_f is None else 1 / (s * self.coupling_f))

    def deviating(self, inductance_factor: float) -> Lisn:
        """The LISN with another inductance: a saturated or shorted choke, or a deviation within its tolerance."""
        return replace(self, inductance_h=self.inductance_h * inductance_factor)


LISN_50UH = Lisn("50uH", 50e-6, 5.0)
LISN_5UH = Lisn("5uH", 5e-6, 0.0, coupling_f=0.1e-6)
LISNS = {lisn.name: lisn for lisn in (LISN_50UH, LISN_5UH)}


def find_lisn(name: str) -> Lisn:
    """The LISN of that name.

    Raises
    ------
    BadInput
        If there is none.
    """
    if name not in LISNS:
        raise BadInput(f"unknown LISN {name!r}: use {' or '.join(LISNS)}")
    return LISNS[name]


@dataclass(frozen=True)
class Cable:
    """A uniform line over the ground plane.

    Parameters
    ----------
    length_m : float
    impedance_ohm : float
        Of all wires together against ground, usually 30 to 150 Ohm.
    velocity_m_s : float
    resistance_ohm_per_m : float
    """

    length_m: float
    impedance_ohm: float = 100.0
    velocity_m_s: float = 2e8
    resistance_ohm_per_m: float = 0.5

    def __post_init__(self) -> None:
        for name in ("length_m", "impedance_ohm", "velocity_m_s"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise BadInput(f"the cable's {name} is {value}; it must be above 0")
        if not (np.isfinite(self.resistance_ohm_per_m) and self.resistance_ohm_per_m >= 0):
            raise BadInput(f"the cable's resistance_ohm_per_m is {self.resistance_ohm_per_m}; it must be 0 or above")

    def through(self, s: ComplexArray, load_ohm: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Impedance at the near end in ohm, and voltage at the far end for one volt at the near end."""
        per_m = self.resistance_ohm_per_m + s * self.impedance_ohm / self.velocity_m_s
        siemens_per_m = s / (self.impedance_ohm * self.velocity_m_s)
        wave = np.sqrt(per_m / siemens_per_m)
        angle = np.sqrt(per_m * siemens_per_m) * self.length_m
        cosh, sinh = np.cosh(angle), np.sinh(angle)
        near = cosh + wave / load_ohm * sinh
        return near / (sinh / wave + cosh / load_ohm), 1 / near


@dataclass(frozen=True)
class Path:
    """The path from the motor to the receiver.

    Parameters
    ----------
    lisn : Lisn
        There are two of this kind.
    cable : Cable, optional
        Cable between motor and LISNs; without one they are directly at the motor.
    stray_f : float
        Cs, capacitance from the motor's terminals to ground, before the cable. The paper shows it in Fig. 12 without a value.
    mode : {"common", "differential"}
    """

    lisn: Lisn = LISN_50UH
    cable: Cable | None = None
    stray_f: float = 0.0
    mode: Mode = "common"

    def __post_init__(self) -> None:
        if self.mode not in ("common", "differential"):
            raise BadInput(f"unknown mode {self.mode!r}: use common or differential")
        if not (np.isfinite(self.stray_f) and self.stray_f >= 0):
            raise BadInput(f"the stray capacitance is {self.stray_f}; it must be 0 or above")

    def transfer(self, frequency_hz: ArrayLike, motor_ohm: ArrayLike) -> ComplexArray:
        """Voltage at one receiver per volt of the source.

        Parameters
        ----------
        frequency_hz : array_like, shape (n,)
        motor_ohm : array_like of complex, shape (n,)
            Z_open for the common mode, Z_short for the differential one.
        """
        frequency: FloatArray = np.asarray(frequency_hz, dtype=np.float64)
        s: ComplexArray = np.asarray(2j * np.pi * frequency, dtype=np.complex128)
        port = self.lisn.impedance(s)
        seen, share = (port / 2, 1.0) if self.mode == "common" else (2 * port, 0.5)
        arriving: ComplexArray = np.ones_like(s)
        if self.cable is not None:
            seen, arriving = self.cable.through(s, seen)
        if self.stray_f:
            seen = seen / (1 + s * self.stray_f * seen)
        return share * seen / (seen + np.asarray(motor_ohm)) * arriving * self.lisn.reading(s)

    def to_dict(self) -> JsonDict:
        """Plain data, SI units."""
        return asdict(self)
