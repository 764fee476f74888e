"""The quasi-peak detector as a circuit: a diode that charges a capacitor through a resistor, a discharge resistor, and the meter.

The capacitor is charged while the intermediate-frequency sine exceeds its voltage v; averaged over a cycle of amplitude e the current
is e h(v/e) with h(x) = (sqrt(1 - x^2) - x arccos x)/pi. The standard defines the charge time by the response to a sine (63 % of the
final value), from which the resistor follows. The meter is a critically damped system of second order.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.optimize import brentq

from motoremi.arrays import FloatArray
from motoremi.emission.band import Band

# Steps over a Gaussian pulse of +-4 standard deviations; halving them changes the reading by less than 0.01 dB.
_STEPS = 160
_WIDTH = 4.0
_METER_POINTS = 4096
# Number of bisections; the remaining uncertainty is 0.01 dB.
_HALVINGS = 11


@dataclass(frozen=True)
class Diode:
    """The detector circuit of a band.

    Parameters
    ----------
    charge_s : float
        Charge resistor times capacitor.
    discharge_s : float
    final : float
        Final voltage for a sine of amplitude 1; readings are divided by it.
    """

    charge_s: float
    discharge_s: float
    final: float


def _current(x: float) -> float:
    return (math.sqrt(1 - x * x) - x * math.acos(x)) / math.pi if x < 1 else 0.0


@lru_cache(maxsize=8)
def diode(band: Band) -> Diode:
    """The circuit whose response to a sine rises to 63 % within the charge time of the band."""

    def final(charge_s: float) -> float:
        return float(brentq(lambda x: _current(x) / charge_s - x / band.discharge_s, 0.0, 1.0))

    def rise_time(charge_s: float) -> float:
        x = np.linspace(0, (1 - math.exp(-1)) * final(charge_s), 801)
        rate = np.array([_current(value) for value in x]) / charge_s - x / band.discharge_s
        return float(np.trapezoid(1 / rate, x))

    charge_s = float(brentq(lambda t: rise_time(t) - band.charge_s, 0.01 * band.charge_s, band.charge_s))
    return Diode(charge_s, band.discharge_s, final(charge_s))


@lru_cache(maxsize=256)
def pulse_weight(band: Band, repetition_hz: float) -> float:
    """Ratio of the quasi-peak to the peak reading of separate pulses of one height.

    Parameters
    ----------
    repetition_hz : float
        So low that the pulses behind the filter do not overlap (8 standard deviations of the envelope).
    """
    circuit = diode(band)
    step = 2 * _WIDTH * band.pulse_sigma_s / _STEPS
    envelope = [math.exp(-((((index + 0.5) / _STEPS - 0.5) * 2 * _WIDTH) ** 2) / 2) for index in range(_STEPS)]
    rest = max(0.0, 1 / repetition_hz - 2 * _WIDTH * band.pulse_sigma_s)
    fade = math.exp(-rest / circuit.discharge_s)
    trace = [0.0] * _STEPS

    def over_pulse(v: float) -> float:
        for index, e in enumerate(envelope):
            gain = e * _current(v / e) / circuit.charge_s if e > v else 0.0
            v += step * (gain - v / circuit.discharge_s)
            trace[index] = v
        return v

    start = float(brentq(lambda v: over_pulse(v) * fade - v, 0.0, 1.0, xtol=1e-6))
    peak = over_pulse(start)
    moments = np.arange(_METER_POINTS) / (_METER_POINTS * repetition_hz)
    during = (np.arange(_STEPS) + 1) * step
    after = peak * np.exp(-(moments - 2 * _WIDTH * band.pulse_sigma_s) / circuit.discharge_s)
    voltage = np.where(moments < during[-1], np.interp(moments, during, trace), after)
    return float(_meter(voltage, repetition_hz, band.meter_s).max() / circuit.final)


def _meter(voltage: FloatArray, repetition_hz: float, meter_s: float) -> FloatArray:
    """Response of a critically damped meter to a periodic voltage."""
    harmonics = np.arange(voltage.size // 2 + 1)
    return np.fft.irfft(np.fft.rfft(voltage) / (1 + 2j * np.pi * harmonics * repetition_hz * meter_s) ** 2, voltage.size)


def envelope_weight(band: Band, envelope: FloatArray) -> FloatArray:
    """Quasi-peak reading of an envelope that repeats much faster than the detector discharges.

    Parameters
    ----------
    envelope : ndarray, shape (..., m)
        Samples over one period, or over a sufficiently long section of noise.

    Returns
    -------
    ndarray, shape (...)
        In the unit of the envelope.
    """
    circuit = diode(band)
    low, high = np.zeros(envelope.shape[:-1]), envelope.max(axis=-1)
    safe = np.maximum(envelope, 1e-300)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        charge = np.mean(envelope * _fast_current(middle[..., None] / safe), axis=-1) / circuit.charge_s
        rising = charge > middle / circuit.discharge_s
        low, high = np.where(rising, middle, low), np.where(rising, high, middle)
    return 0.5 * (low + high) / circuit.final


def _fast_current(x: FloatArray) -> FloatArray:
    """h(x) for 0 <= x <= 1 with an error below 1e-7: a fitted polynomial in 1 - x."""
    y = np.maximum(1 - x, 0.0)
    return y * np.sqrt(y) * (0.3001156 + y * (0.0149013 + y * (0.0027818 + y * (-0.00002 + y * 0.0005311))))
