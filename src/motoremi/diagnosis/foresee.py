"""How far two models' predictions part under a measurement that has not been made, in units of what it could resolve."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.diagnosis.menu import Option
from motoremi.fitting.result import Fit
from motoremi.model import laws
from motoremi.model.circuit import Leaf, Tape
from motoremi.model.effects import add_effects, find_effect
from motoremi.model.motor import Motor
from motoremi.model.parameter import Parameter

POINTS = 160
# What a motor repeats to after it was touched; an estimate.
REPEATABILITY = 5e-4
# How well the size of a response is known: within this factor.
RESPONSE_FACTOR = 2.0
# Uncertainties of the other meters: four-wire resistance 0.5 %, insulation resistance 10 % and at most 10 GOhm.
DC_UNCERTAINTY, INSULATION_UNCERTAINTY, HIGHEST_INSULATION_OHM = 0.005, 0.1, 10e9
DIRECT_CURRENT_HZ = 1e-4


@dataclass(frozen=True)
class Parting:
    """How far two models part.

    Parameters
    ----------
    ratio : float
        Largest difference over the uncertainty.
    place : str
        Where: sweep and frequency; empty for a single value.
    frequency_hz : float
    """

    ratio: float
    place: str = ""
    frequency_hz: float = 0.0


def parting(option: Option, one: Fit, other: Fit) -> Parting:
    """How far two fits of the same sweeps part under a measurement of the menu."""
    if option.kind == "sweep":
        return _by_sweep(option, one, other)
    if option.kind == "value":
        return _by_value(option, one, other)
    if option.kind == "standard":
        return _by_standards(one, other)
    return _by_change(option, one, other)


def _by_sweep(option: Option, one: Fit, other: Fit) -> Parting:
    """Predictions beyond what both models could still give, bent as far as the sweeps at hand let them be."""
    analyser, noise = one.measurement.analyser, one.noise_percent / 100
    wide = option.name == "wide-sweep"
    grid = np.geomspace(*(analyser.span_hz if wide else _span(one)), POINTS)
    best = Parting(0.0)
    for termination in one.measurement.terminations if wide else ("grounded",):
        first, second = (_seen(fit, termination, grid) for fit in (one, other))
        sigma = np.hypot(analyser.uncertainty(grid, first.impedance_ohm), noise)
        difference: ComplexArray = np.asarray(np.log(first.impedance_ohm / second.impedance_ohm) / sigma, dtype=np.complex128)
        columns: ComplexArray = np.asarray(np.concatenate([first.slopes, -second.slopes]) / sigma, dtype=np.complex128)
        precision = np.zeros((len(columns), len(columns)))
        split = len(first.slopes)
        precision[:split, :split], precision[split:, split:] = first.precision, second.precision
        left = difference - _bent(difference, columns, precision)
        best = max(best, _largest(np.abs(left), grid, termination), key=lambda p: p.ratio)
    return best


@dataclass(frozen=True)
class _Seen:
    """A model on a grid.

    Parameters
    ----------
    impedance_ohm : ndarray, shape (n,)
    slopes : ndarray, shape (k, n)
        d ln Z / du of the parameters.
    precision : ndarray, shape (k, k)
        What the sweeps at hand say of them.
    """

    impedance_ohm: ComplexArray
    slopes: ComplexArray
    precision: FloatArray


def _seen(fit: Fit, termination: str, grid: FloatArray) -> _Seen:
    names = [p.name for p in fit.motor.parameters]
    values = np.array([fit.parameters.get(p.name, p.middle) for p in fit.motor.parameters])
    tape = Tape(fit.motor.circuit(termination), names)
    s: ComplexArray = np.asarray(2j * np.pi * grid, dtype=np.complex128)
    with np.errstate(all="ignore"):
        impedance, gradient = tape.gradient(s, values)
    rows, where = [], []
    for index, unknown in enumerate(fit.problem.unknowns):
        if unknown.name in names:
            at = names.index(unknown.name)
            unit = values[at] if unknown.scale == "log" else fit.problem.vector_scale(index)
            rows.append(gradient[at] * unit / impedance)
            where.append(index)
    precision: FloatArray = np.linalg.pinv(fit.covariance[np.ix_(where, where)], hermitian=True).astype(np.float64)
    return _Seen(impedance, np.nan_to_num(np.array(rows)), precision)


def _bent(difference: ComplexArray, columns: ComplexArray, precision: FloatArray) -> ComplexArray:
    """The part of a difference that parameters can take up, at the cost of their precision."""
    real = np.concatenate([columns.real, columns.imag], axis=1)
    target = np.concatenate([difference.real, difference.imag])
    step = np.linalg.lstsq(real @ real.T + precision, real @ target, rcond=1e-12)[0]
    result: ComplexArray = step @ columns
    return result


def _by_change(option: Option, one: Fit, other: Fit) -> Parting:
    best = Parting(0.0)
    grid = np.geomspace(*_span(one), POINTS)
    sigma = np.hypot(one.noise_percent / 100, REPEATABILITY)
    for termination in one.measurement.terminations:
        first, second = (_response(option, fit, termination, grid) for fit in (one, other))
        # The weaker pattern may be scaled to look like the stronger.
        strength = float(np.real(np.vdot(second, second)))
        scale = float(np.clip(np.real(np.vdot(second, first)) / strength, 1 / RESPONSE_FACTOR, RESPONSE_FACTOR)) if strength else 1.0
        best = max(best, _largest(np.abs(first - scale * second) / sigma, grid, termination), key=lambda p: p.ratio)
    return best


def answering(option: Option, fit: Fit) -> Parting:
    """How much a change would move a model's own impedance; nothing for what is not a change."""
    best = Parting(0.0)
    if option.kind == "change":
        grid = np.geomspace(*_span(fit), POINTS)
        sigma = np.hypot(fit.noise_percent / 100, REPEATABILITY)
        for termination in fit.measurement.terminations:
            best = max(best, _largest(np.abs(_response(option, fit, termination, grid)) / sigma, grid, termination), key=lambda p: p.ratio)
    return best


def _response(option: Option, fit: Fit, termination: str, grid: FloatArray) -> ComplexArray:
    """ln of the impedance after a change over that before."""
    before = fit.model_ohm(termination, grid)
    after = _model_ohm(fit.motor, _changed(option, fit), termination, grid)
    result: ComplexArray = np.log(after / before)
    return result


def _changed(option: Option, fit: Fit) -> dict[str, float]:
    values = dict(fit.parameters)
    for name, factor in option.elements.items():
        if name in values:
            values[name] *= factor
    for name in values:
        label, _, short = name.rpartition(".")
        if label:
            answers = find_effect(label.split("#")[0]).effect.responds
            values[name] *= answers.get(option.name, {}).get(short, 1.0)
    return values


def _by_value(option: Option, one: Fit, other: Fit) -> Parting:
    if option.name == "dc-resistance":
        if "Ra" in one.held or "Ra" in other.held:
            return Parting(0.0)
        a, b = (fit.parameters["Ra"] for fit in (one, other))
        doubt = np.hypot(one.sigma["Ra"] / a, other.sigma["Ra"] / b)
        return Parting(float(abs(np.log(a / b)) / np.hypot(doubt, DC_UNCERTAINTY)))
    if "open" not in one.measurement.terminations:
        return Parting(0.0)
    grid = np.array([DIRECT_CURRENT_HZ])
    a, b = (1 / (1 / abs(fit.model_ohm("open", grid)[0]) + 1 / HIGHEST_INSULATION_OHM) for fit in (one, other))
    return Parting(float(abs(np.log(a / b)) / INSULATION_UNCERTAINTY))


def _by_standards(one: Fit, other: Fit) -> Parting:
    grid = np.geomspace(*_span(one), POINTS)
    best = Parting(0.0)
    for law, value, label in ((laws.resistor, 50.0, "50 Ohm"), (laws.capacitor, 100e-12, "100 pF")):
        true = _standard(one, law, value, grid, errors=False)
        sigma = np.hypot(one.measurement.analyser.uncertainty(grid, true), one.noise_percent / 100)
        first, second = (_standard(fit, law, value, grid, errors=True) for fit in (one, other))
        best = max(best, _largest(np.abs(np.log(first / second)) / sigma, grid, label), key=lambda p: p.ratio)
    return best


def _standard(fit: Fit, law: laws.Law, value: float, grid: FloatArray, errors: bool) -> ComplexArray:
    """A known part as the analyser shows it."""
    part = Leaf("standard", law, (Parameter("standard", "", value / 2, value * 2, "known", vary=False),))
    names = [name for name in fit.effects if find_effect(name).effect.group == "instrument"] if errors else []
    motor = add_effects(Motor(winding=part, frame=part), names)
    return _model_ohm(motor, {**fit.parameters, "standard": value}, "short", grid)


def _model_ohm(motor: Motor, values: Mapping[str, float], termination: str, grid: FloatArray) -> ComplexArray:
    used = motor.used_parameters(termination)
    own = {name: value for name, value in values.items() if name in used}
    s: ComplexArray = np.asarray(2j * np.pi * grid, dtype=np.complex128)
    with np.errstate(all="ignore"):
        return Tape(motor.circuit(termination), list(own)).impedance(s, np.array(list(own.values())))


def _span(fit: Fit) -> tuple[float, float]:
    sweeps = fit.measurement.sweeps
    return min(s.frequency_hz[0] for s in sweeps), max(s.frequency_hz[-1] for s in sweeps)


def _largest(ratio: FloatArray, grid: FloatArray, place: str) -> Parting:
    usable = np.where(np.isfinite(ratio), ratio, 0.0)
    at = int(np.argmax(usable))
    return Parting(float(usable[at]), place, float(grid[at]))
