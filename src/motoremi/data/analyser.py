"""What an analyser within its specification may do to a sweep: priors of nuisance parameters.

A verdict that forgets these calls a calibration error physics; what lies beyond them is an instrument *effect* of the catalogue.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.errors import BadInput


@dataclass(frozen=True)
class Analyser:
    """Systematic errors of one kind of analyser with its fixture.

    Parameters
    ----------
    name, title, source : str
    gain_sigma : callable
        Frequency in Hz -> standard deviation of the relative gain error, for its real and its imaginary part each. The
        error is smooth in log frequency and common to all sweeps of one calibration.
    step_frequencies_hz : tuple of float
        Where the analyser may switch ranges.
    step_share : float
        Size of such a step as a share of `gain_sigma`.
    span_hz : tuple of float
        Widest sweep.
    conductance_sigma_s : callable
        Frequency in Hz -> standard deviation of the conductance left across the terminals, in siemens, one draw a connection.
    capacitance_sigma_f, resistance_sigma_ohm, inductance_sigma_h : float
        Standard deviations of what open and short compensation leave, one draw a connection.
    """

    name: str
    title: str
    source: str
    gain_sigma: Callable[[FloatArray], FloatArray]
    conductance_sigma_s: Callable[[FloatArray], FloatArray]
    capacitance_sigma_f: float
    resistance_sigma_ohm: float
    inductance_sigma_h: float
    step_frequencies_hz: tuple[float, ...] = ()
    step_share: float = 0.3
    span_hz: tuple[float, float] = (40.0, 110e6)

    @property
    def ideal(self) -> bool:
        """Whether it makes no systematic error."""
        return self.capacitance_sigma_f == 0 and self.inductance_sigma_h == 0

    def uncertainty(self, frequency_hz: FloatArray, impedance_ohm: ComplexArray) -> FloatArray:
        """Standard deviation of the systematic error relative to |Z|, per point."""
        omega = 2 * np.pi * frequency_hz
        magnitude = np.abs(impedance_ohm)
        series = np.hypot(self.resistance_sigma_ohm, omega * self.inductance_sigma_h) / magnitude
        shunt = np.hypot(self.conductance_sigma_s(frequency_hz), omega * self.capacitance_sigma_f) * magnitude
        total: FloatArray = np.sqrt(2 * self.gain_sigma(frequency_hz) ** 2 + series**2 + shunt**2)
        return total


def _banded(frequency_hz: FloatArray, bands: tuple[tuple[float, float], ...], beyond: float) -> FloatArray:
    """A value for each frequency: the first band whose upper edge is not below it."""
    conditions = [frequency_hz <= edge for edge, _ in bands]
    return np.select(conditions, [np.full_like(frequency_hz, value) for _, value in bands], beyond)


def _gain_4294a(frequency_hz: FloatArray) -> FloatArray:
    """A third of the tolerance E_p in percent at 500 mV and the slowest bandwidth."""
    percent = _banded(frequency_hz, ((100, 0.5), (800, 0.3), (1e6, 0.075)), 0.0)
    percent = np.where(frequency_hz > 1e6, np.clip(0.1e-6 * frequency_hz, 0.075, 1.5), percent)
    return percent / 300


def _conductance_4294a(frequency_hz: FloatArray) -> FloatArray:
    """A third of the tolerance Y_o."""
    return _banded(frequency_hz, ((100, 10e-9), (200e3, 2.5e-9), (1e6, 5e-9), (15e6, 50e-9)), 500e-9) / 3


def _zero(frequency_hz: FloatArray) -> FloatArray:
    return np.zeros_like(frequency_hz)


_4294A = Analyser(
    name="4294a",
    title="Agilent 4294A with a four-terminal fixture, open and short compensated",
    source="operation manual's tolerance formula as coded in public scripts; fixture handbook for the residuals",
    gain_sigma=_gain_4294a,
    conductance_sigma_s=_conductance_4294a,
    capacitance_sigma_f=0.1e-12,
    resistance_sigma_ohm=10e-3,
    inductance_sigma_h=3e-9,
    step_frequencies_hz=(1e6, 15e6),
)
ANALYSERS = (
    _4294A,
    dataclasses.replace(
        _4294A,
        name="e4990a",
        title="Keysight E4990A with a four-terminal fixture, open and short compensated",
        source="taken to be as good as the 4294A that it replaces: unconfirmed",
        span_hz=(20.0, 120e6),
    ),
    Analyser(
        name="nanovna",
        title="NanoVNA, impedance from S11, calibrated at its port",
        source="estimate: 1 % of gain, 10 mm of adapter; unconfirmed",
        gain_sigma=lambda f: np.full_like(f, 0.01),
        conductance_sigma_s=lambda f: np.full_like(f, 20e-6),
        capacitance_sigma_f=0.5e-12,
        resistance_sigma_ohm=0.1,
        inductance_sigma_h=5e-9,
        span_hz=(50e3, 300e6),
    ),
    Analyser(
        name="none",
        title="an ideal analyser: only random noise",
        source="for simulated or corrected data",
        gain_sigma=_zero,
        conductance_sigma_s=_zero,
        capacitance_sigma_f=0.0,
        resistance_sigma_ohm=0.0,
        inductance_sigma_h=0.0,
    ),
)
DEFAULT_ANALYSER = "4294a"


def find_analyser(name: str) -> Analyser:
    """The analyser called `name`.

    Raises
    ------
    BadInput
        If it is not known.
    """
    for analyser in ANALYSERS:
        if analyser.name == name.strip().lower():
            return analyser
    raise BadInput(f"unknown analyser {name!r}: use one of {', '.join(a.name for a in ANALYSERS)}")


# Correlation of the gain error along frequency: calibrations are interpolated between a handful of points, so the error is
# continuous with kinks (Matern 3/2) over about half a decade.
GAIN_LENGTH_DECADES = 0.6


def gain_basis(analyser: Analyser, frequency_hz: FloatArray) -> FloatArray:
    """Columns that span the analyser's gain error, each with unit variance of its coefficient.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)

    Returns
    -------
    ndarray, shape (n, q)
        `basis @ c`, with c complex and standard normal in both parts, is a draw of the relative gain error.
    """
    sigma = analyser.gain_sigma(frequency_hz)
    if not np.any(sigma > 0):
        return np.zeros((frequency_hz.size, 0))
    # The covariance is smooth, so a grid of 40 knots carries it for any number of points.
    logarithm = np.log10(frequency_hz)
    knots = np.linspace(logarithm[0], logarithm[-1], 40)
    distance = np.sqrt(3) * np.abs(knots[:, None] - knots[None, :]) / GAIN_LENGTH_DECADES
    eigenvalues, vectors = np.linalg.eigh((1 + distance) * np.exp(-distance))
    keep = eigenvalues > 1e-4 * eigenvalues[-1]
    modes = vectors[:, keep] * np.sqrt(eigenvalues[keep])
    columns = np.array([np.interp(logarithm, knots, mode) for mode in modes.T]).T
    steps = [analyser.step_share * (frequency_hz > f) for f in analyser.step_frequencies_hz if frequency_hz[0] < f < frequency_hz[-1]]
    everything = np.column_stack([columns, *steps]) if steps else columns
    return np.asarray(everything * sigma[:, None], dtype=np.float64)
