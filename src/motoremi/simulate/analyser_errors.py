"""The simulated impedance analyser: its specification, its errors, and faults beyond the specification.

Its errors are a smooth gain error for each calibration, residual R, L, G, C for each connection, and noise for each point.
"""

from __future__ import annotations

import copy
import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.data.sweep import TERMINATIONS, Termination
from motoremi.errors import BadInput
from motoremi.simulate.hidden import log_uniform, uniform
from motoremi.simulate.hidden_effects import ANALYSER_FAULTS

# The E4990A is the 4294A's successor and is simulated as the same instrument.
MODELS = ("4294a", "e4990a")
BANDWIDTH_FACTORS = (1, 2, 3, 4, 5)
# Frequencies at which the specification of the 4294A changes tables.
_RANGE_EDGES_HZ = (1e6, 15e6)
_LINE_OHM = 50.0
_LINE_CELLS = 50
# Standard deviations of the residuals after open and short compensation, and elements of an uncompensated fixture.
_RESIDUAL_SD = {"resistance_ohm": 3e-3, "inductance_h": 1e-9, "capacitance_f": 3e-14}
_RAW_FIXTURE = {"resistance_ohm": 20e-3, "inductance_h": 15e-9, "capacitance_f": 3e-12}
# Noise floors of impedance and admittance: a tenth of the specified offsets.
_NOISE_OHM, _NOISE_SIEMENS = 2e-4, 5e-10


def _bands(frequency_hz: FloatArray, edges_hz: Sequence[float], values: Sequence[float | FloatArray]) -> FloatArray:
    """A table of the specification: `values[i]` up to and including `edges_hz[i]`, the last one above."""
    conditions = [frequency_hz <= edge for edge in edges_hz]
    return np.select(conditions, [np.broadcast_to(v, frequency_hz.shape) for v in values[:-1]], values[-1])


def basic_percent(frequency_hz: FloatArray) -> FloatArray:
    """Basic accuracy E_p of the 4294A with a 16047E fixture, in percent."""
    return _bands(frequency_hz, (100.0, 800.0, 1e6, 15e6), (0.5, 0.3, 0.075, 1e-7 * frequency_hz, 1.5))


def offset_siemens(frequency_hz: FloatArray) -> FloatArray:
    """Specified admittance offset Y_o of the 4294A, in siemens."""
    return _bands(frequency_hz, (100.0, 2e5, 1e6, 15e6), (10e-9, 2.5e-9, 5e-9, 50e-9, 500e-9))


def offset_ohm(frequency_hz: FloatArray) -> FloatArray:
    """Specified impedance offset Z_s of the 4294A, in ohm."""
    return _bands(frequency_hz, (100.0,), (10e-3, 2.5e-3))


def tolerance_percent(
    frequency_hz: ArrayLike,
    impedance_magnitude_ohm: ArrayLike,
    bandwidth_factor: int = 5,
    oscillator_volt: float = 0.5,
) -> FloatArray:
    """Specified tolerance of |Z| in percent (of the phase in 0.01 rad), 4294A with 16047E, no bias.

    Parameters
    ----------
    frequency_hz : array_like
        40 Hz to 110 MHz.
    impedance_magnitude_ohm : array_like
        10 mOhm to 100 MOhm.
    bandwidth_factor : int
        1 (fastest) to 5 (best).
    oscillator_volt : float
        Above 0, at most 1 V.

    Notes
    -----
    E = E_p + 100 (Z_s / |Z| + Y_o |Z|), with adders and factors for bandwidth and oscillator, from the operation manual as
    implemented in ethz-pes/impedance_analyzer_4294A_matlab (BSD-2). 0.5 V is the neutral level.
    """
    _check_bandwidth(bandwidth_factor)
    if not 0 < oscillator_volt <= 1:
        raise BadInput(f"an oscillator level of {oscillator_volt} V is outside 0 .. 1 V")
    frequency: FloatArray = np.asarray(frequency_hz, dtype=np.float64)
    magnitude: FloatArray = np.asarray(impedance_magnitude_ohm, dtype=np.float64)
    index = 5 - bandwidth_factor
    slow = frequency < 5e4
    bandwidth_adder = np.where(slow, (0.0, 0.06, 0.2, 0.4, 0.8)[index], (0.0, 0.03, 0.1, 0.2, 0.4)[index])
    bandwidth_scale = np.where(frequency > 1e6, (1, 1, 4, 5, 10)[index], (1, 1, 3, 4, 6)[index])
    level_adder, admittance_scale, impedance_scale = _oscillator(frequency, bandwidth_adder, oscillator_volt)
    z_offset = bandwidth_scale * impedance_scale * offset_ohm(frequency)
    y_offset = bandwidth_scale * admittance_scale * offset_siemens(frequency)
    return basic_percent(frequency) + bandwidth_adder + level_adder + 100 * (z_offset / magnitude + y_offset * magnitude)


def _oscillator(frequency: FloatArray, bandwidth_adder: FloatArray, volt: float) -> tuple[FloatArray, float, float]:
    """Adder in percent, factor of the admittance offset, factor of the impedance offset."""
    if volt > 0.5:
        return 0.03 * (1 / volt - 1) + frequency / 1e8, 1 / volt, 2.0
    if volt <= 0.064:
        return (0.03 + bandwidth_adder) * (0.064 / volt - 1), 0.5 / volt, 0.064 / volt
    range_volt = next(level for level in (0.125, 0.25, 0.5) if volt <= level)
    return np.full(frequency.shape, 0.03 * (range_volt / volt - 1)), 0.5 / volt, range_volt / volt


def noise_sd_ohm(frequency_hz: FloatArray, impedance_ohm: ComplexArray, bandwidth_factor: int) -> FloatArray:
    """Standard deviation of the noise in the real and in the imaginary part, in ohm.

    6e-5 of |Z| at bandwidth 5 (measured on a 4294A export) to 1e-3 at bandwidth 1, plus floors of impedance and admittance.
    """
    _check_bandwidth(bandwidth_factor)
    relative = 6e-5 * (1e-3 / 6e-5) ** ((5 - bandwidth_factor) / 4)
    floor = np.where(frequency_hz > 1e6, (1, 1, 4, 5, 10)[5 - bandwidth_factor], (1, 1, 3, 4, 6)[5 - bandwidth_factor])
    magnitude = np.abs(impedance_ohm)
    return np.sqrt((relative * magnitude) ** 2 + (floor * _NOISE_OHM) ** 2 + (floor * _NOISE_SIEMENS * magnitude**2) ** 2)


def _check_bandwidth(bandwidth_factor: int) -> None:
    if bandwidth_factor not in BANDWIDTH_FACTORS:
        raise BadInput(f"bandwidth factor {bandwidth_factor} is outside 1 (fastest) .. 5 (best)")


@dataclass(frozen=True)
class _Residuals:
    """Residual elements between the analyser and the motor after compensation."""

    resistance_ohm: float
    inductance_h: float
    capacitance_f: float
    # In units of the specified offset at each frequency.
    conductance: float

    def apply(self, impedance: ComplexArray, frequency: FloatArray) -> ComplexArray:
        s = 2j * np.pi * frequency
        series = impedance + self.resistance_ohm + s * self.inductance_h
        shunt = self.conductance * offset_siemens(frequency) + s * self.capacitance_f
        return series / (1 + shunt * series)


class SimulatedAnalyser:
    """An impedance analyser with systematic errors and noise.

    The gain error belongs to the analyser's calibration, residuals to a connection, noise to a point. All are drawn from the seed;
    the noise is one random stream, so that the same calls in the same order give the same data.

    Parameters
    ----------
    seed : int
    model : {"4294a", "e4990a"}
    faults : sequence of str
        Errors beyond the specification, any of `ANALYSER_FAULTS`.
    compensated : bool
        Whether open and short compensation of the fixture were done.

    Raises
    ------
    BadInput
        For an unknown model or fault.
    """

    def __init__(self, seed: int, model: str = "4294a", faults: Sequence[str] = (), *, compensated: bool = True) -> None:
        if model not in MODELS:
            raise BadInput(f"unknown analyser {model!r}; the simulation knows {', '.join(MODELS)}")
        for name in faults:
            if name not in ANALYSER_FAULTS:
                raise BadInput(f"unknown fault {name!r} of the analyser; it knows {', '.join(ANALYSER_FAULTS)}")
        if seed < 0:
            raise BadInput(f"the seed is {seed}; it must be 0 or above")
        self.seed = seed
        self.model = model
        self.compensated = compensated
        self.faults: dict[str, dict[str, float | str]] = {name: _draw_fault(name, self._rng(name)) for name in dict.fromkeys(faults)}
        self._noise = self._rng("noise")
        self._fixture = {name: value * uniform(self._rng(name), 0.8, 1.2) for name, value in _RAW_FIXTURE.items()}

    def __repr__(self) -> str:
        return f"SimulatedAnalyser(seed={self.seed}, model={self.model!r}, faults={tuple(self.faults)!r})"

    def without(self, faults: Sequence[str], *, compensated: bool = False) -> SimulatedAnalyser:
        """The same analyser, with the same stream of noise, without some faults or with its fixture compensated."""
        other = copy.copy(self)
        other.faults = {name: sizes for name, sizes in self.faults.items() if name not in faults}
        other.compensated = self.compensated or compensated
        return other

    def with_noise(self, purpose: str) -> SimulatedAnalyser:
        """The same analyser with a separate stream of noise, which does not depend on earlier measurements."""
        other = copy.copy(self)
        other._noise = self._rng(f"noise {purpose}")
        return other

    def measure(
        self,
        termination: Termination,
        frequency_hz: ArrayLike,
        true_impedance: ArrayLike,
        connection: int = 0,
        bandwidth_factor: int = 5,
        averages: int = 1,
    ) -> ComplexArray:
        """One sweep.

        Parameters
        ----------
        termination : {"short", "open"}
        frequency_hz : array_like, shape (n,)
        true_impedance : array_like, shape (n,)
            Impedance of the motor, in ohm.
        connection : int
            Number of the connection; sweeps with the same number share their residuals.
        bandwidth_factor : int
            1 (fastest) to 5 (best).
        averages : int
            Number of readings that are averaged at each point.

        Returns
        -------
        ndarray of complex, shape (n,)
            In ohm.
        """
        if termination not in TERMINATIONS:
            raise BadInput(f"unknown termination {termination!r}: use 'short' or 'open'")
        frequency: FloatArray = np.asarray(frequency_hz, dtype=np.float64)
        impedance: ComplexArray = np.asarray(true_impedance, dtype=np.complex128)
        if frequency.shape != impedance.shape:
            raise BadInput(f"{frequency.size} frequencies but {impedance.size} impedances")
        if (contact := self.faults.get("contact-resistance")) and contact["sweep"] == termination:
            impedance = impedance + float(contact["resistance_ohm"])
        if delay := self.faults.get("cable-delay"):
            impedance = behind_line(impedance, frequency, float(delay["delay_s"]))
        impedance = impedance * (1 + self.gain_error(frequency))
        impedance = self._residuals(termination, connection).apply(impedance, frequency)
        noise = self._noise.standard_normal((2, frequency.size))
        sd = noise_sd_ohm(frequency, impedance, bandwidth_factor) / np.sqrt(averages)
        return impedance + sd * (noise[0] + 1j * noise[1])

    def gain_error(self, frequency_hz: FloatArray) -> ComplexArray:
        """Relative error of the calibration, the same in all sweeps; a third of the basic accuracy, smooth in log f."""
        rng = self._rng("gain")
        # Between 100 kHz and 100 MHz; constant beyond.
        knots = np.linspace(np.log(1e5), np.log(1e8), 3 + int(rng.integers(0, 3)))
        draws = rng.standard_normal((2, knots.size))
        position = np.clip(np.log(frequency_hz), knots[0], knots[-1])
        parts = PchipInterpolator(knots, draws, axis=1)(position)
        shape = parts[0] + 1j * parts[1]
        for edge in _RANGE_EDGES_HZ:
            step = uniform(rng, 0.1, 0.3) * np.exp(2j * np.pi * rng.random())
            shape = shape + np.where(frequency_hz > edge, step, 0)
        # The specification jumps at 1 MHz; the error itself need not.
        amplitude = np.where(frequency_hz > 800, np.maximum(0.075, np.minimum(1e-7 * frequency_hz, 1.5)), basic_percent(frequency_hz))
        error: ComplexArray = amplitude / 300 * shape
        if fault := self.faults.get("gain-error"):
            error = error + float(fault["gain_at_30_mhz"]) * (frequency_hz / 30e6) ** 2
        if fault := self.faults.get("range-step"):
            error = error + np.where(frequency_hz > float(fault["frequency_hz"]), float(fault["step"]), 0.0)
        return error

    def truth(self) -> JsonDict:
        """Faults with their sizes, SI units."""
        return {"faults": {name: dict(sizes) for name, sizes in self.faults.items()}}

    def _residuals(self, termination: Termination, connection: int) -> _Residuals:
        rng = self._rng(f"{termination} {connection}")
        sizes = {name: float(rng.normal(0.0, sd)) for name, sd in _RESIDUAL_SD.items()}
        conductance = float(rng.normal(0.0, 1 / 3))
        if not self.compensated:
            sizes = {name: value + self._fixture[name] for name, value in sizes.items()}
        # The error of a bad compensation is the same for all connections.
        for fault in ("open-residual", "short-residual"):
            for name, value in self.faults.get(fault, {}).items():
                if name == "conductance":
                    conductance += float(value)
                else:
                    sizes[name] += float(value)
        return _Residuals(**sizes, conductance=conductance)

    def _rng(self, purpose: str) -> np.random.Generator:
        return np.random.default_rng([self.seed, zlib.crc32(purpose.encode())])


def _draw_fault(name: str, rng: np.random.Generator) -> dict[str, float | str]:
    sign = 1.0 if rng.random() < 0.5 else -1.0
    match name:
        case "open-residual":
            return {"capacitance_f": uniform(rng, 0.9e-12, 1.5e-12), "conductance": uniform(rng, 1.0, 3.0)}
        case "short-residual":
            return {"inductance_h": uniform(rng, 1.5e-8, 3e-8), "resistance_ohm": log_uniform(rng, 0.01, 0.05)}
        case "gain-error":
            return {"gain_at_30_mhz": sign * uniform(rng, 0.05, 0.08)}
        case "cable-delay":
            return {"delay_s": log_uniform(rng, 2e-10, 5e-10)}
        case "contact-resistance":
            return {"resistance_ohm": log_uniform(rng, 0.8, 2.0), "sweep": str(rng.choice(TERMINATIONS))}
        case _:  # range-step
            return {"frequency_hz": log_uniform(rng, 4e5, 8e6), "step": sign * log_uniform(rng, 1.5e-2, 3e-2)}


def behind_line(impedance: ComplexArray, frequency: FloatArray, delay_s: float) -> ComplexArray:
    """The impedance at the input of a 50 Ohm line with that delay, made of cells of half C, L, half C."""
    s = 2j * np.pi * frequency
    series = s * delay_s * _LINE_OHM / _LINE_CELLS
    half_shunt = s * delay_s / _LINE_OHM / _LINE_CELLS / 2
    seen: ComplexArray = impedance
    for _ in range(_LINE_CELLS):
        seen = np.asarray(1 / (half_shunt + 1 / (series + 1 / (half_shunt + 1 / seen))), dtype=np.complex128)
    return seen
