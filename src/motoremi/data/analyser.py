"""Error models of analysers: prior distributions of the systematic errors that an analyser within its specification makes.

Without them a diagnosis would take a calibration error for a physical effect. An impedance analyser has a gain error, a network analyser
errors of what it measures (`quantity`: the reflection of a motor at one port, or the transmission past one between two), and both have the
residuals that compensation leaves at the connection. The specified sizes are themselves uncertain (`scales`): analysers can be outside their
specification, and for an `unknown` analyser no size is assumed.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import TypeAlias

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.kernels import Parts, smooth_basis
from motoremi.data.quantity import REFLECTION, SERIES_THROUGH, SHUNT_THROUGH, Quantity, ports_written
from motoremi.errors import BadInput

# Functions of modules or parts of them, since an analyser is sent to other processes with its measurement.
OfFrequency: TypeAlias = Callable[[FloatArray], FloatArray]
# Prior of the factor on the declared sizes: three analysers in four are within their specification. An assumption; unconfirmed.
DECLARED: Mapping[float, float] = {1.0: 0.75, 2.0: 0.17, 4.0: 0.08}
# An analyser that is not named may be as accurate as a 4294A, or as inaccurate as a bridge of 3 %. An assumption; unconfirmed.
UNKNOWN: Mapping[float, float] = {1.0: 0.4, 3.0: 0.3, 10.0: 0.2, 30.0: 0.1}
# A network analyser that is not named may be as accurate as an impedance analyser, but most are NanoVNAs. An assumption; unconfirmed.
UNKNOWN_ONE_PORT: Mapping[float, float] = {0.1: 0.15, 0.3: 0.25, 1.0: 0.4, 3.0: 0.2}


@dataclass(frozen=True)
class Fixture:
    """Standard deviations of the elements of a fixture that was not compensated; the same elements for all sweeps.

    Parameters
    ----------
    resistance_ohm, inductance_h : float
        In series with the motor.
    conductance_s, capacitance_f : float
        Across both.
    ground_capacitance_f : float
        From the two ends of a motor that is in the line to ground, together; 0 for other connections.
    line_inductance_h : float
        Of the line to the motor across it and from there on, together; 0 for other connections.
    """

    resistance_ohm: float
    inductance_h: float
    conductance_s: float
    capacitance_f: float
    ground_capacitance_f: float = 0.0
    line_inductance_h: float = 0.0


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
        Lowest and highest frequency.
    conductance_sigma_s : callable
        Frequency in Hz -> standard deviation of the residual conductance across the terminals, in siemens; each connection has its own value.
    capacitance_sigma_f, resistance_sigma_ohm, inductance_sigma_h : float
        Standard deviations of the residuals of open and short compensation; each connection has its own values.
    quantity : Quantity, optional
        What it measures, if that is not the impedance; its noise is white in it.
    wave_sigma : tuple of float
        Standard deviations of the error terms a, b and c of that quantity, each smooth along frequency: directivity, tracking and match
        of a reflection; leakage, tracking and match of a transmission. Empty for an impedance analyser and an ideal one.
    standard_sigma : float
        Standard deviation of the calibration standard of known resistance, relative. With perfect short and open, the load of a network analyser
        scales all impedances: Z is read as Z times 50 ohm over that of the load. A circuit with all its impedances scaled fits as well, so this
        is an error of its elements and not of the fit. For an analyser that is not named, its gain error as its prior has it (root mean square over
        `scales`): that the errors change little along frequency does not show that they are small.
    fixture : Fixture, optional
        Fixture between the calibration plane and the motor that was not compensated.
    scales : mapping
        Factor on all these sizes -> prior probability.
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
    quantity: Quantity | None = None
    wave_sigma: tuple[float, ...] = ()
    standard_sigma: float = 0.0
    fixture: Fixture | None = None
    scales: Mapping[float, float] = field(default_factory=lambda: DECLARED)

    @property
    def ideal(self) -> bool:
        """Whether it makes no systematic error."""
        return self.capacitance_sigma_f == 0 and self.inductance_sigma_h == 0

    @property
    def by_waves(self) -> bool:
        """Whether it is a real network analyser, whose errors are those of a reflection or a transmission."""
        return bool(self.wave_sigma)

    @property
    def ports(self) -> str:
        """Connection of the motor between two ports, a key of `BETWEEN_PORTS`; empty for one port."""
        return "" if self.quantity is None else ports_written(self.quantity.name)

    @property
    def instrument(self) -> str:
        """Name of the instrument alone, a key of `TRANSMISSION` if it measures between two ports."""
        return self.name.partition("+")[0]

    @property
    def named(self) -> bool:
        """Whether the user named it; otherwise the size of its errors is estimated."""
        return self.instrument != DEFAULT_ANALYSER

    @property
    def coefficient(self) -> Quantity:
        """The coefficient that it measures; of an impedance analyser the reflection coefficient."""
        return self.quantity or REFLECTION

    @property
    def standards(self) -> str:
        """What it is calibrated with, for messages."""
        return self.coefficient.standards

    def with_compensated_fixture(self) -> Analyser:
        """The same analyser with its fixture compensated."""
        return dataclasses.replace(self, fixture=None)

    def uncertainty(self, frequency_hz: FloatArray, impedance_ohm: ComplexArray) -> FloatArray:
        """Standard deviation of the systematic error relative to |Z|, per point; without an uncompensated fixture, which is fitted instead."""
        omega = 2 * np.pi * frequency_hz
        magnitude = np.abs(impedance_ohm)
        series = np.hypot(self.resistance_sigma_ohm, omega * self.inductance_sigma_h) / magnitude
        shunt = np.hypot(self.conductance_sigma_s(frequency_hz), omega * self.capacitance_sigma_f) * magnitude
        gain = np.sqrt(np.sum(np.abs(self.smooth_errors(frequency_hz, impedance_ohm)) ** 2, axis=0))
        return np.sqrt(2 * gain**2 + series**2 + shunt**2)

    def smooth_errors(self, frequency_hz: FloatArray, impedance_ohm: ComplexArray, coefficient: ComplexArray | None = None) -> ComplexArray:
        """Standard deviations of the relative errors that are smooth along frequency, shape (m, n): each row scales one smooth process.

        An impedance analyser has its gain, a network analyser the error terms of `quantity`: at the coefficient of this impedance, or at one
        with less noise.
        """
        if self.quantity is None:
            return np.array([self.gain_sigma(frequency_hz).astype(np.complex128)])
        here = self.quantity.coefficient_of(impedance_ohm) if coefficient is None else coefficient
        terms = self.quantity.error_terms(here)[: len(self.wave_sigma)]
        factor = self.quantity.relative(impedance_ohm)
        rows = [sigma * factor * term for sigma, term in zip(self.wave_sigma, terms, strict=True)]
        return np.array(rows, dtype=np.complex128).reshape(len(rows), frequency_hz.size)


def _banded(frequency_hz: FloatArray, bands: tuple[tuple[float, float], ...], beyond: float) -> FloatArray:
    """A value for each frequency: that of the first (upper edge, value) whose edge is not below it, or `beyond`."""
    conditions = [frequency_hz <= edge for edge, _ in bands]
    return np.select(conditions, [np.full_like(frequency_hz, value) for _, value in bands], beyond)


# Of a 4294A, from 800 Hz to 1 MHz: a third of the tolerance of 0.075 %.
_LEAST_GAIN = 0.075 / 300


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


def _same(value: float, frequency_hz: FloatArray) -> FloatArray:
    return np.full_like(frequency_hz, value)


def _rising(constant: float, slope: float, frequency_hz: FloatArray) -> FloatArray:
    return constant + slope * frequency_hz


def _with_percent(gain_sigma: OfFrequency, percent: OfFrequency, frequency_hz: FloatArray) -> FloatArray:
    return gain_sigma(frequency_hz) + percent(frequency_hz) / 300


def _times(sigma: OfFrequency, factor: float, frequency_hz: FloatArray) -> FloatArray:
    return sigma(frequency_hz) * factor


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
        title="NanoVNA, impedance from S11, calibrated at its connector, the fixture not compensated",
        source="residuals of -54, -50 and -46 dB taken for a careful calibration, a fixture of a few centimetres; unconfirmed. Loads of such kits "
        "measured 51.27 and 49.81 Ohm, a poor one 47.05 Ohm (Duffy, owenduffy.net, 2023 and 2024)",
        gain_sigma=_zero,
        conductance_sigma_s=partial(_same, 1e-6),
        capacitance_sigma_f=0.05e-12,
        resistance_sigma_ohm=10e-3,
        inductance_sigma_h=1e-9,
        span_hz=(50e3, 300e6),
        quantity=REFLECTION,
        wave_sigma=(2e-3, 3e-3, 5e-3),
        standard_sigma=0.01,
        fixture=Fixture(resistance_ohm=0.3, inductance_h=30e-9, conductance_s=20e-6, capacitance_f=4e-12),
    ),
    dataclasses.replace(
        _4294A,
        name="unknown",
        title="an analyser that is not named: the size of its errors is estimated from the data",
        source="the shape of a 4294A's errors, at 1 to 30 times their size",
        standard_sigma=_LEAST_GAIN * float(np.sqrt(sum(share * scale**2 for scale, share in UNKNOWN.items()))),
        scales=UNKNOWN,
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
DEFAULT_ANALYSER = "unknown"


def unknown_at_one_port() -> Analyser:
    """The error model of an analyser that is not named and saved reflections: a network analyser whose fixture may not be compensated."""
    return dataclasses.replace(
        find_analyser("nanovna"),
        name=DEFAULT_ANALYSER,
        title="a network analyser that is not named: the size of its errors is estimated from the data",
        source="a NanoVNA's errors, at 0.1 to 3 times their size; unconfirmed",
        span_hz=find_analyser(DEFAULT_ANALYSER).span_hz,
        scales=UNKNOWN_ONE_PORT,
    )


@dataclass(frozen=True)
class Attachment:
    """An adapter or a fixture at the four-terminal-pair ports of an analyser, and what it adds to the analyser's errors.

    Parameters
    ----------
    name, title : str
    gain_percent : callable
        Frequency in Hz -> addition to the tolerance of the gain, in percent.
    residuals : float
        Factor on the residuals of open and short compensation.
    """

    name: str
    title: str
    gain_percent: Callable[[FloatArray], FloatArray]
    residuals: float = 1.0

    def connected_to(self, analyser: Analyser) -> Analyser:
        """The error model of an analyser with this adapter or fixture."""

        return dataclasses.replace(
            analyser,
            name=f"{analyser.name}+{self.name}",
            title=f"{analyser.title}, {self.title}",
            source=f"{analyser.source}; what {self.title} adds is an assumption, unconfirmed",
            gain_sigma=partial(_with_percent, analyser.gain_sigma, self.gain_percent),
            conductance_sigma_s=partial(_times, analyser.conductance_sigma_s, self.residuals),
            capacitance_sigma_f=analyser.capacitance_sigma_f * self.residuals,
            resistance_sigma_ohm=analyser.resistance_sigma_ohm * self.residuals,
            inductance_sigma_h=analyser.inductance_sigma_h * self.residuals,
        )


FOUR_TERMINAL_PAIR = ("4294a", "e4990a")
# Sizes are assumptions in the form of the makers' tables: a part that does not depend on frequency and one that grows with it.
ADAPTERS: Mapping[str, Attachment] = {
    attachment.name: attachment
    for attachment in (
        Attachment("1m", "a 1 m extension cable", partial(_rising, 0.02, 0.02e-6)),
        Attachment("2m", "a 2 m extension cable", partial(_rising, 0.02, 0.03e-6)),
        Attachment("42942a", "a 42942A terminal adapter", partial(_rising, 0.1, 0.02e-6)),
        Attachment("42941a", "a 42941A impedance probe", partial(_rising, 0.2, 0.03e-6), residuals=2.0),
    )
}
FIXTURES: Mapping[str, Attachment] = {
    attachment.name: attachment
    for attachment in (
        Attachment("16034g", "a 16034G fixture", _zero),
        Attachment("16047e", "a 16047E fixture", _zero),
        Attachment("16089", "16089 clip leads", _zero, residuals=5.0),
        Attachment("leads", "self-made leads", _zero, residuals=5.0),
    )
}


@dataclass(frozen=True)
class BetweenPorts:
    """A motor between the two ports of a network analyser: in the line or across it.

    Parameters
    ----------
    quantity : Quantity
    title : str
    stray : mapping
        Elements that an uncompensated fixture of a few centimetres has in addition, with their standard deviations: fields of `Fixture`.
    """

    quantity: Quantity
    title: str
    stray: Mapping[str, float]

    def measured_by(self, analyser: Analyser) -> Analyser:
        """The error model of a network analyser that measures so."""
        title, source, sigma = TRANSMISSION[analyser.name]
        return dataclasses.replace(
            analyser,
            name=f"{analyser.name}+{self.quantity.name}",
            title=f"{title}, {self.title}",
            source=source,
            step_frequencies_hz=(),
            quantity=self.quantity,
            wave_sigma=sigma,
            fixture=None if analyser.fixture is None else dataclasses.replace(analyser.fixture, **self.stray),
        )


# Network analysers that measure between two ports: title, source, and standard deviations of leakage, transmission tracking and match.
#
# The dynamic range of a NanoVNA is stated as 70 dB below 300 MHz (its users' specification); its two ports reflect what no calibration of
# theirs takes off: with a resistor of 200.23 Ohm in the line one showed 204.9 - 2.0j Ohm (Duffy, owenduffy.net, 2024), 2.5 % in c.
# What is not named has the shape of a careful calibration of twelve terms, at 1 to 30 times its size. All are assumptions; unconfirmed.
TRANSMISSION: Mapping[str, tuple[str, str, tuple[float, ...]]] = {
    "nanovna": (
        "NanoVNA, impedance from S21, calibrated with a through connection of its cables, the fixture not compensated",
        "leakage of -70 dB as its users state, tracking of -50 dB taken for a careful calibration, ports that are 2 % off; unconfirmed",
        (3e-4, 3e-3, 2e-2),
    ),
    "unknown": (
        "a network analyser that is not named, impedance from S21: the size of its errors is estimated from the data",
        "leakage, tracking and match of -80, -60 and -50 dB, at 1 to 30 times their size; unconfirmed",
        (1e-4, 1e-3, 3e-3),
    ),
    "none": ("an ideal network analyser: only random noise", "for simulated or corrected data", ()),
}
# Strays are a few picofarads and a few centimetres of wire, as of the fixture at one port; unconfirmed.
BETWEEN_PORTS: Mapping[str, BetweenPorts] = {
    connection.quantity.name: connection
    for connection in (
        BetweenPorts(SERIES_THROUGH, "the motor in series between the ports", {"ground_capacitance_f": 4e-12}),
        BetweenPorts(SHUNT_THROUGH, "the motor from the line between the ports to ground", {"line_inductance_h": 30e-9}),
    )
}


def find_analyser(name: str) -> Analyser:
    """The error model called `name`: an analyser's name, alone or with what is between it and the motor.

    That is adapter and fixture, as `specification` makes it, or for a network analyser the connection between two ports:
    `nanovna+series-through`.

    Raises
    ------
    BadInput
        If it is not known, or the analyser has no such adapter, fixture or ports.
    """
    first, *parts = name.strip().lower().split("+")
    found = next((analyser for analyser in ANALYSERS if analyser.name == first), None)
    if found is None:
        raise BadInput(f"unknown analyser {name!r}: use one of {', '.join(a.name for a in ANALYSERS)}")
    if len(parts) == 1 and parts[0] in BETWEEN_PORTS:
        if first not in TRANSMISSION:
            takes = ", ".join(TRANSMISSION)
            raise BadInput(f"unknown analyser {name!r}: {first} measures no transmission between two ports; for {parts[0]} use one of {takes}")
        return BETWEEN_PORTS[parts[0]].measured_by(found)
    for part in parts:
        attachment = ADAPTERS.get(part) or FIXTURES.get(part)
        if attachment is None or first not in FOUR_TERMINAL_PAIR:
            takes = f"{first} alone" + (f" or {first}+{' or +'.join(BETWEEN_PORTS)}" if first in TRANSMISSION else "")
            if first in FOUR_TERMINAL_PAIR:
                takes = f"{first}+ADAPTER+FIXTURE with {', '.join((*ADAPTERS, *FIXTURES))}"
            raise BadInput(f"unknown analyser {name!r}: {part!r} is not an adapter or fixture of it; use {takes}")
        found = attachment.connected_to(found)
    return found


def specification(analyser: str, adapter: str, fixture: str) -> str:
    """Name of the error model of an analyser with its adapter and fixture, such as `4294a+42941a+leads`."""
    return "+".join([analyser, *(part.lower() for part in (adapter, fixture) if part.lower() in ADAPTERS or part.lower() in FIXTURES)])


# Correlation of the gain error along frequency: calibrations are interpolated between a handful of points, so the error is
# continuous with kinks (Matern 3/2) over about half a decade.
GAIN: Parts = ((1.0, 0.6),)


def error_basis(analyser: Analyser, frequency_hz: FloatArray, impedance_ohm: ComplexArray, coefficient: ComplexArray | None = None) -> ComplexArray:
    """Columns that span those errors of the analyser which are smooth along frequency; each coefficient has unit variance.

    Parameters
    ----------
    frequency_hz, impedance_ohm : ndarray, shape (n,)
        All sweeps of one calibration.
    coefficient : ndarray, shape (n,), optional
        That of this impedance with less noise, where a network analyser measured it.

    Returns
    -------
    ndarray, shape (n, q)
        `basis @ c`, with c complex and standard normal in both parts, is a draw of the relative error.
    """
    if analyser.ideal:
        return np.zeros((frequency_hz.size, 0), dtype=np.complex128)
    smooth = smooth_basis(frequency_hz, GAIN)
    low, high = frequency_hz.min(), frequency_hz.max()
    steps = [analyser.step_share * (frequency_hz > f) for f in analyser.step_frequencies_hz if low < f < high]
    columns = np.column_stack([smooth, *steps]) if steps else smooth
    rows = analyser.smooth_errors(frequency_hz, impedance_ohm, coefficient)
    return np.concatenate([columns * row[:, None] for row in rows], axis=1)
