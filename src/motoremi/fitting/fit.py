"""`fit`: from sweeps to a circuit with error bars."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterable, Mapping

import numpy as np

from motoremi.arrays import Progress
from motoremi.data.measurement import Measurement
from motoremi.data.sweep import ImpedanceSweep
from motoremi.errors import BadInput
from motoremi.fitting.base_fit import base_fit, fit_by_the_paper
from motoremi.fitting.problem import checked_bounds
from motoremi.fitting.refit import refit_with
from motoremi.fitting.result import METHODS, Fit
from motoremi.fitting.search import Task
from motoremi.given import real_number, refuse_other, seed_number
from motoremi.model.effects import add_effects, find_effect
from motoremi.model.effects.validity import active_at
from motoremi.model.motor import BASE_PARAMETERS, Motor, dc_motor
from motoremi.model.parameter import Parameter
from motoremi.quantities import show
from motoremi.threads import one_blas_thread


@one_blas_thread
def fit(
    model: Motor | None,
    sweeps: Iterable[ImpedanceSweep] | Measurement,
    *,
    seed: int = 1,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    method: str = "ant-colony",
    analyser: str | None = None,
    held: Mapping[str, float] | None = None,
    progress: Progress | None = None,
) -> Fit:
    """Fit a motor's circuit to its impedance sweeps.

    Parameters
    ----------
    model : Motor
        `dc_motor()`, with or without effects.
    sweeps : iterable of ImpedanceSweep
        Short- and open-circuit sweeps; several of one termination are repeats and give the noise.
    seed : int
        The search is deterministic for a seed.
    bounds : mapping, optional
        Parameter name -> (low, high) in SI units, for example `{"La": (1e-6, 1e-4)}`.
    method : {"ant-colony", "paper"}
        The default searches with ants and polishes to the noise floor; `paper` is the algorithm as printed.
    analyser : str, optional
        Whose systematic errors to allow for: `4294a`, `e4990a`, `nanovna`, `none`, or `unknown`, whose size is estimated (default).
    held : mapping, optional
        Parameters that are not fitted, in SI units: for example Ra from a DC measurement.
    progress : callable, optional
        Called with a text, the work done and its total in each round of the search for the paper's circuit.

    Returns
    -------
    Fit

    Raises
    ------
    BadInput
        For sweeps, bounds, names or a seed that cannot be used.
    """
    started = time.perf_counter()
    motor = model if model is not None else dc_motor()
    refuse_other(motor, Motor, "fit needs a model first, dc_motor()")
    for option, given in (("bounds", bounds), ("held", held)):
        if given is not None:
            refuse_other(given, Mapping, f"{option} are a dictionary of parameters by name")
    seed = seed_number(seed)
    if method not in METHODS:
        raise BadInput(f"unknown method {method!r}: use one of {', '.join(METHODS)}")
    measurement = sweeps if isinstance(sweeps, Measurement) else Measurement.of(_sweeps(sweeps), analyser)
    _check_informative(measurement)
    limits, fixed = checked_bounds(motor, bounds), checked_held(motor, held)
    for p in motor.parameters:
        for value in limits.get(p.name, ()):
            _check_valid(p, value)
    _check_possible(limits, fixed)
    base = dc_motor()
    paper_names = {p.name for p in BASE_PARAMETERS}
    base_bounds = {n: b for n, b in limits.items() if n in paper_names}
    base_held = {n: v for n, v in fixed.items() if n in paper_names}
    if base.used_parameters(*measurement.terminations) <= base_held.keys():
        raise BadInput("all elements that these sweeps show are held, so nothing is left to fit: leave one of them free")
    task = Task(base, measurement, base_bounds, base_held)
    result = fit_by_the_paper(task, seed) if method == "paper" else base_fit(task, seed, progress)
    for effect in motor.effects:
        result = refit_with(result, effect, {n: v for n, v in fixed.items() if n.startswith(effect)}, limits)
    return dataclasses.replace(result, elapsed_s=time.perf_counter() - started)


def _sweeps(given: object) -> list[ImpedanceSweep]:
    needs = "fit needs a list of ImpedanceSweep"
    refuse_other(given, Iterable, needs)
    listed = list(given)  # type: ignore[call-overload]
    for one in listed:
        refuse_other(one, ImpedanceSweep, f"{needs}, and nothing else in it")
    return listed


def checked_held(motor: Motor, held: Mapping[str, float] | None) -> dict[str, float]:
    """Values that can be held, or one clear line.

    Raises
    ------
    BadInput
        For an unknown parameter, a value that is no finite number, one that is not above 0 where only such are possible, an element beyond what
        motors have, or a value with which an effect would give energy away.
    """
    known = {p.name: p for p in motor.parameters}
    values = {name: real_number(value, f"the held value of {name}") for name, value in (held or {}).items()}
    for name, value in values.items():
        if name not in known:
            raise BadInput(f"held value for the unknown parameter {name!r}; the model has {', '.join(sorted(known))}")
        if not np.isfinite(value):
            raise BadInput(f"held value of {name} is not a finite number")
        if known[name].scale == "log" and value <= 0:
            raise BadInput(f"the held value of {name} must be above 0 {known[name].unit}, got {value:g}")
        if known[name] in BASE_PARAMETERS and not known[name].low <= value <= known[name].high:
            raise BadInput(f"the held value of {name}, {value:g} {known[name].unit}, is outside of what motors have: {_range(known[name])}")
        _check_valid(known[name], value)
    return values


def _check_possible(limits: Mapping[str, tuple[float, float]], held: Mapping[str, float]) -> None:
    """Refuse bounds of an element that leave out all that a motor can have, and bounds of one that is held."""
    for p in BASE_PARAMETERS:
        if p.name not in limits:
            continue
        if p.name in held:
            raise BadInput(f"{p.name} is held and has bounds: leave out one of them")
        low, high = limits[p.name]
        # A range that only touches leaves one value: 1 to 100 H for La was meant to be in microhenries.
        if high <= p.low or low >= p.high:
            raise BadInput(f"the bounds of {p.name}, {low:g} - {high:g} {p.unit}, are outside of what motors have: {_range(p)}")


def _range(parameter: Parameter) -> str:
    return f"{show(parameter.low, parameter.unit)} - {show(parameter.high, parameter.unit)} ({parameter.reason})"


def _check_valid(parameter: Parameter, value: float) -> None:
    """Refuse a value with which the law of an effect leaves its validity: a permeability below zero."""
    effect = parameter.name.rpartition(".")[0].partition("#")[0]
    # The analyser's errors are no part of a motor.
    if not effect or find_effect(effect).effect.group == "instrument":
        return
    if active_at(add_effects(dc_motor(), [effect]), [{f"{effect}.{parameter.short_name}": value}]) is not None:
        given = f"{parameter.name} = {value:g} {parameter.unit}".rstrip()
        raise BadInput(f"{given} makes the motor give energy away: keep it between {parameter.low:g} and {parameter.high:g}")


def _check_informative(measurement: Measurement) -> None:
    for sweep in measurement.sweeps:
        magnitude = np.abs(sweep.mean_ohm)
        if np.ptp(magnitude) < 1e-9 * magnitude.max() and np.ptp(np.angle(sweep.mean_ohm)) < 1e-9:
            raise BadInput(f"the {sweep.termination} sweep is the same at all frequencies: this is not a motor's impedance")
