"""Simulation of the emission of a running motor in the time domain: events, sampled waveform, network, receiver.

No level is computed by a formula: events are placed in time one by one, the network is solved by nodal analysis at the frequencies of the
record's Fourier transform, and the receiver works on the samples. Steps settle exponentially, chopper pulses are trapezoids, and the cable
is a ladder of cells.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import fft
from scipy.interpolate import CubicSpline

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.errors import BadInput
from motoremi.simulate.hidden import log_uniform, uniform
from motoremi.simulate.network import impedance
from motoremi.simulate.parts import Part
from motoremi.simulate.receiver_in_time import Reading, read_waveform
from motoremi.simulate.simulated_motor import SimulatedMotor

DETECTORS = ("peak", "quasi-peak", "average")
SOURCE_EFFECTS = ("arc-breakdown", "commutation-jitter", "chopper", "background-noise", "lisn-deviation", "cable-resonance")
# Twice the highest frequency and a margin for the edges of the pulses; a whole number of samples in 4.5 kHz.
SAMPLE_RATE_HZ = 16384 * 4.5e3
RECORD_S = 0.05
# Number of times that the weighting detectors process the record, because their meter needs most of a second to settle.
REPEATS = 16
# Errors of the receiver: standard deviations of its offset and of the ripple of its front end.
OFFSET_DB, RIPPLE_DB = 0.7, 0.4
_GRID_HZ = 4e3
_TAPS = 24
_LADDER = 60
# Broadcast bands of medium and short wave.
_STATIONS_HZ = ((530e3, 1.6e6), (5.9e6, 6.2e6), (7.2e6, 7.45e6), (9.4e6, 9.9e6))


@dataclass(frozen=True)
class Stand:
    """True values of the source, the path and the receiver.

    Parameters
    ----------
    repetition_hz : float
        Commutations per second.
    step_v, rise_s : float
        Voltage step when a segment leaves the brush, and its fall time (10 to 90 %).
    arc_v, arc_rise_s, arc_spread : float
        Arc at the end of each commutation; 0 V for none.
    jitter_s, missing_share : float
    chopper_v, chopper_hz, chopper_duty, chopper_rise_s : float
        0 V for no chopper.
    broadband_dbuv, broadband_slope_db : float
        Ambient noise in 9 kHz at 1 MHz, and its decrease in dB per decade; none below -40 dBuV.
    stations, stations_seed : int
        Number of broadcast stations, and the seed of their frequencies and levels.
    lisn_factor : float
        Factor on the choke's inductance.
    cable_m, cable_ohm : float
    floor_dbuv, offset_db : float
        The receiver's noise with the average detector, and its offset.
    """

    repetition_hz: float
    step_v: float
    rise_s: float
    arc_v: float = 0.0
    arc_rise_s: float = 50e-9
    arc_spread: float = 0.0
    jitter_s: float = 0.0
    missing_share: float = 0.0
    chopper_v: float = 0.0
    chopper_hz: float = 20e3
    chopper_duty: float = 0.5
    chopper_rise_s: float = 1e-7
    broadband_dbuv: float = -60.0
    broadband_slope_db: float = 0.0
    stations: int = 0
    stations_seed: int = 0
    lisn_factor: float = 1.0
    cable_m: float = 0.0
    cable_ohm: float = 100.0
    floor_dbuv: float = -5.0
    offset_db: float = 0.0

    @classmethod
    def random(cls, seed: int, effects: Sequence[str] = ()) -> Stand:
        """Draw a stand; the values of a seed do not depend on the hidden effects.

        Raises
        ------
        BadInput
            For an unknown effect.
        """
        rng = np.random.default_rng([seed, 11])
        drawn: dict[str, Any] = {
            "repetition_hz": log_uniform(rng, 500.0, 2500.0),
            "step_v": uniform(rng, 0.5, 2.0),
            "rise_s": log_uniform(rng, 2e-7, 2e-6),
            # Within the tolerance of the network.
            "lisn_factor": float(np.exp(rng.normal(0.0, 0.07))),
            "floor_dbuv": uniform(rng, -10.0, 5.0),
            "offset_db": float(rng.normal(0.0, OFFSET_DB)),
        }
        for number, name in enumerate(SOURCE_EFFECTS):
            own = np.random.default_rng([seed, 12, number])
            if name in effects:
                drawn.update(_draw(name, own))
        unknown = set(effects) - set(SOURCE_EFFECTS)
        if unknown:
            raise BadInput(f"unknown source effect {', '.join(sorted(unknown))}: use {', '.join(SOURCE_EFFECTS)}")
        return cls(**drawn)

    def truth(self) -> JsonDict:
        """The true values, against which a blind test is scored."""
        return dict(vars(self))


def _draw(name: str, rng: np.random.Generator) -> dict[str, float | int]:
    if name == "arc-breakdown":
        return {"arc_v": uniform(rng, 12.0, 20.0), "arc_rise_s": log_uniform(rng, 1e-8, 2e-7), "arc_spread": uniform(rng, 0.05, 0.25)}
    if name == "commutation-jitter":
        return {"missing_share": uniform(rng, 0.35, 0.8), "jitter_s": log_uniform(rng, 1e-7, 2e-5)}
    if name == "chopper":
        return {
            "chopper_v": log_uniform(rng, 3.0, 24.0),
            "chopper_hz": log_uniform(rng, 3e3, 40e3),
            "chopper_duty": uniform(rng, 0.15, 0.85),
            "chopper_rise_s": log_uniform(rng, 2e-8, 3e-7),
        }
    if name == "background-noise":
        return {
            "broadband_dbuv": uniform(rng, 12.0, 35.0),
            "broadband_slope_db": uniform(rng, 0.0, 15.0),
            "stations": int(rng.integers(4, 16)),
            "stations_seed": int(rng.integers(2**31)),
        }
    if name == "lisn-deviation":
        return {"lisn_factor": log_uniform(rng, 0.15, 0.5) if rng.random() < 0.7 else log_uniform(rng, 2.5, 6.0)}
    return {"cable_m": uniform(rng, 2.5, 12.0), "cable_ohm": log_uniform(rng, 40.0, 200.0)}


def transfer(motor: SimulatedMotor, stand: Stand, frequency_hz: FloatArray) -> ComplexArray:
    """Receiver voltage per volt of a source in series with the motor, which feeds two networks in parallel.

    With a current driven into the source's node a, V_receiver/V_a is the response to an ideal voltage source there; the transfer
    impedance follows from three driving-point impedances.
    """
    inside = motor.network("open").with_node("G", "source").with_node("X", "port")
    network = inside.plus(
        *(
            part
            for name in "12"
            for part in (
                Part("L", f"lisn{name}", "line", f"choke{name}", 50e-6 * stand.lisn_factor),
                Part("R", f"damping{name}", f"choke{name}", "ground", 5.0),
                Part("R", f"receiver{name}", "line", "ground", 50.0),
            )
        )
    )
    if stand.cable_m:
        henry, farad = (stand.cable_m * value / _LADDER for value in (stand.cable_ohm / 2e8, 1 / (stand.cable_ohm * 2e8)))
        names = ["port", *(f"cable{number}" for number in range(1, _LADDER)), "line"]
        for number, (near, far) in enumerate(pairwise(names)):
            middle = f"between{number}"
            network = (
                network.resistor(f"loss{number}", near, middle, 0.5 * stand.cable_m / _LADDER)
                .inductor(f"series{number}", middle, far, henry)
                .capacitor(f"near{number}", near, "ground", farad / 2)
                .capacitor(f"far{number}", far, "ground", farad / 2)
            )
    else:
        network = network.with_node("port", "line")
    source, receiver, between = (impedance(network, *pair, frequency_hz) for pair in (("source", "ground"), ("line", "ground"), ("source", "line")))
    return (source + receiver - between) / (2 * source)


def waveform(motor: SimulatedMotor, stand: Stand, seed: int) -> FloatArray:
    """The voltage at the receiver's input over one record, in volt; the record is periodic."""
    size = round(RECORD_S * SAMPLE_RATE_HZ)
    frequency = fft.rfftfreq(size, 1 / SAMPLE_RATE_HZ)
    omega = 2j * np.pi * np.maximum(frequency, 1.0)
    rng = np.random.default_rng([seed, 13])
    # The voltages of motor and chopper are described by their derivative: impulses, which are widened by the shape of the edges.
    slope = np.zeros(frequency.size, dtype=np.complex128)
    moments = np.arange(uniform(rng, 0, 1) / stand.repetition_hz, RECORD_S, 1 / stand.repetition_hz)
    moments = moments[rng.random(moments.size) >= stand.missing_share]
    moments = np.mod(moments + stand.jitter_s * rng.standard_normal(moments.size), RECORD_S)
    slope += stand.step_v * fft.rfft(_impulses(moments, np.ones(moments.size), size)) / (1 + omega * stand.rise_s / np.log(9))
    if stand.arc_v:
        heights = stand.arc_v * np.maximum(0.1, 1 + stand.arc_spread * rng.standard_normal(moments.size))
        slope += fft.rfft(_impulses(moments, heights, size)) / (1 + omega * stand.arc_rise_s / np.log(9))
    if stand.chopper_v:
        period = 1 / stand.chopper_hz
        on = np.arange(uniform(rng, 0, period), RECORD_S - stand.chopper_duty * period, period)
        both = np.concatenate([on, on + stand.chopper_duty * period])
        signs = np.concatenate([np.ones(on.size), -np.ones(on.size)])
        ramp = np.sinc(frequency * stand.chopper_rise_s) * np.exp(-0.5 * omega * stand.chopper_rise_s)
        slope += stand.chopper_v * fft.rfft(_impulses(both, signs, size)) * ramp
    grid = np.arange(20e3, SAMPLE_RATE_HZ / 2 + _GRID_HZ, _GRID_HZ)
    passed = CubicSpline(grid, transfer(motor, stand, grid))(frequency)
    passed[frequency < 40e3] = 0
    arriving = slope / omega * passed + _ambient(stand, frequency, rng)
    return fft.irfft(arriving, size)


def _impulses(moments: FloatArray, heights: FloatArray, size: int) -> FloatArray:
    """Impulses of unit area at times between samples, band-limited by a windowed sinc; the record is periodic."""
    at = moments * SAMPLE_RATE_HZ
    whole = np.floor(at).astype(np.intp)
    steps = np.arange(-_TAPS, _TAPS + 1)
    distance = steps - (at - whole)[:, None]
    shape = np.sinc(distance) * np.i0(9.0 * np.sqrt(np.maximum(0, 1 - (distance / (_TAPS + 1)) ** 2))) / np.i0(9.0)
    samples = np.zeros(size)
    np.add.at(samples, (whole[:, None] + steps) % size, heights[:, None] * shape * SAMPLE_RATE_HZ)
    return samples


def _ambient(stand: Stand, frequency: FloatArray, rng: np.random.Generator) -> ComplexArray:
    """Fourier transform of the ambient: noise, and broadcast stations with some modulation."""
    size = 2 * (frequency.size - 1)
    total = np.zeros(frequency.size, dtype=np.complex128)
    if stand.broadband_dbuv > -40:
        # Density from the effective value in 6.8 kHz, the noise bandwidth of a Gaussian filter of 9 kHz.
        level = stand.broadband_dbuv + 1.05 - stand.broadband_slope_db * np.log10(np.maximum(frequency, 1e5) / 1e6)
        density = 1e-6 * 10 ** (level / 20) / np.sqrt(6.78e3)
        pairs = rng.standard_normal((frequency.size, 2)) @ np.array([1, 1j])
        total += density * pairs * np.sqrt(SAMPLE_RATE_HZ * size) / 2
    if stand.stations:
        rng = np.random.default_rng(stand.stations_seed)
        time_s = np.arange(size) / SAMPLE_RATE_HZ
        air = np.zeros(size)
        for _ in range(stand.stations):
            low, high = _STATIONS_HZ[int(rng.integers(len(_STATIONS_HZ)))]
            carrier, tone = (round(value * RECORD_S) / RECORD_S for value in (uniform(rng, low, high), uniform(rng, 400.0, 2e3)))
            amplitude = np.sqrt(2) * 1e-6 * 10 ** (uniform(rng, 15.0, 50.0) / 20)
            air += amplitude * (1 + 0.3 * np.sin(2 * np.pi * tone * time_s)) * np.cos(2 * np.pi * carrier * time_s + uniform(rng, 0, 6))
        total += fft.rfft(air)
    return total


def measure(motor: SimulatedMotor, stand: Stand, frequency_hz: ArrayLike, seed: int, quasi_peak: bool = True) -> Reading:
    """Readings of the receiver, with its noise, its offset and the ripple of its front end.

    Parameters
    ----------
    frequency_hz : array_like, shape (n,)
        Equally spaced, 150 kHz to 30 MHz.
    seed : int
        Seed of all random events while the motor runs.
    """
    frequency: FloatArray = np.asarray(frequency_hz, dtype=np.float64)
    samples = waveform(motor, stand, seed)
    read = read_waveform(samples, SAMPLE_RATE_HZ, frequency, quasi_peak=quasi_peak, noise_dbuv=stand.floor_dbuv, repeats=REPEATS, seed=seed)
    rng = np.random.default_rng([seed, 14])
    knots = np.geomspace(1e5, 4e7, 9)
    ripple = CubicSpline(np.log(knots), rng.normal(0.0, RIPPLE_DB, knots.size))(np.log(frequency))
    levels = [read.level(name) + stand.offset_db + ripple + rng.normal(0.0, 0.15, frequency.size) for name in (*DETECTORS, "rms-average")]
    return Reading(frequency, *levels)


def motor_off(stand: Stand, frequency_hz: ArrayLike, seed: int, quasi_peak: bool = True) -> Reading:
    """The background: the same stand with the motor off."""
    quiet = dataclasses.replace(stand, step_v=0.0, arc_v=0.0, chopper_v=0.0)
    return measure(SimulatedMotor(), quiet, frequency_hz, seed, quasi_peak)


@dataclass(frozen=True, eq=False)
class _Running:
    """A motor, or none, as a cache key: equal for motors with equal values."""

    motor: SimulatedMotor | None

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Running) and self.motor == other.motor

    def __hash__(self) -> int:
        return hash(repr(self.motor))


# Cached because the detectors of one scan are requested one by one.
@lru_cache(maxsize=6)
def _scanned(running: _Running, seed: int, grid: tuple[float, float, int], effects: tuple[str, ...], quasi_peak: bool) -> Reading:
    start, step, count = grid
    stand, frequency_hz = Stand.random(seed, effects), start + step * np.arange(count)
    if running.motor is None:
        return motor_off(stand, frequency_hz, seed, quasi_peak)
    return measure(running.motor, stand, frequency_hz, seed, quasi_peak)


def spectrum(
    motor: SimulatedMotor | None, frequency_hz: ArrayLike, detector: str, seed: int, effects: Sequence[str] = ("arc-breakdown",)
) -> FloatArray:
    """Level at the receiver.

    Parameters
    ----------
    motor : SimulatedMotor, optional
        None for the background, with the motor off.
    frequency_hz : array_like, shape (n,)
        Equally spaced, 150 kHz to 30 MHz.
    detector : {"peak", "quasi-peak", "average", "cispr-average", "rms-average"}
        After the meters have settled. The pulses of a motor are so frequent that the CISPR-average is equal to the average.
    seed : int
        Seed of the stand and of all random events.
    effects : sequence of str
        Hidden effects of source and path; by default the brushes arc.

    Returns
    -------
    ndarray, shape (n,)
        In dBuV.
    """
    known = {name: name for name in (*DETECTORS, "rms-average")} | {"cispr-average": "average"}
    if detector not in known:
        raise BadInput(f"unknown detector {detector!r}: use {', '.join(known)}")
    frequency: FloatArray = np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
    step = float(frequency[1] - frequency[0]) if frequency.size > 1 else 4.5e3
    level = _scanned(_Running(motor), seed, (float(frequency[0]), step, frequency.size), tuple(effects), detector == "quasi-peak").level(
        known[detector]
    )
    return level.copy()


def background(frequency_hz: ArrayLike, detector: str, seed: int, effects: Sequence[str] = ()) -> FloatArray:
    """Level at the receiver with the motor off, in dBuV, shape (n,)."""
    return spectrum(None, frequency_hz, detector, seed, effects)
