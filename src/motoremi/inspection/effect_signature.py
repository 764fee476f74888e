"""The signature of an effect on a given motor: the change of both sweeps, and the part that remains after the elements are fitted again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.drawing import figure_of
from motoremi.errors import BadInput
from motoremi.fitting.band_scaling import scaled_starts
from motoremi.fitting.problem import Problem
from motoremi.fitting.result import Fit
from motoremi.model.circuit import Tape, walk
from motoremi.model.effects import find_effect
from motoremi.model.parameter import Parameter
from motoremi.threads import one_blas_thread

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_SIZES = 3


@dataclass(frozen=True, eq=False)
class Shown:
    """An effect of one size.

    Parameters
    ----------
    parameters : dict
        By short name, SI units.
    change, remaining : dict
        Termination -> ln of the impedance with the effect over that without, complex, shape (n,); `remaining` is the part that a new fit of
        the elements cannot absorb (to first order).
    """

    parameters: dict[str, float]
    change: dict[str, ComplexArray]
    remaining: dict[str, ComplexArray]

    @property
    def rms(self) -> float:
        """Over both sweeps."""
        return float(np.sqrt(np.mean(np.abs(np.concatenate(list(self.change.values()))) ** 2)))


@dataclass(frozen=True, eq=False)
class Signature:
    """The signature of an effect on a motor. Immutable.

    Parameters
    ----------
    effect : str
    title : str
    frequency_hz, uncertainty : dict
        Termination -> frequencies, and expanded uncertainty (k = 2) of ln Z from noise and the analyser's specification.
    sizes : tuple of Shown
        From weak to strong; the fitted one alone where the model has the effect.
    """

    effect: str
    title: str
    frequency_hz: dict[str, FloatArray]
    uncertainty: dict[str, FloatArray]
    sizes: tuple[Shown, ...]

    def to_dict(self) -> JsonDict:
        """Plain data; changes in dB and degrees."""

        def curves(values: dict[str, ComplexArray]) -> JsonDict:
            return {t: {"db": (_DB * v.real).tolist(), "deg": np.degrees(v.imag).tolist()} for t, v in values.items()}

        return {
            "frequency_hz": {t: f.tolist() for t, f in self.frequency_hz.items()},
            "uncertainty_percent": {t: (100 * u).tolist() for t, u in self.uncertainty.items()},
            "sizes": [{"parameters": s.parameters, "change": curves(s.change), "remaining": curves(s.remaining)} for s in self.sizes],
        }

    def plot(self) -> Figure:
        """Change in dB and degrees, a column for each sweep."""
        return figure_of(self)


_DB = 20 / np.log(10)


@one_blas_thread
def signature(fit: Fit, effect: str) -> Signature:
    """The signature of an effect on the motor of a fit.

    Parameters
    ----------
    fit : Fit
        Gives the motor's parameters; the effect need not be in its model.
    effect : str
        `name` or `name@element`.

    Raises
    ------
    BadInput
        If the effect changes none of the fit's sweeps.
    """
    found = find_effect(effect)
    inside = found.identifier in fit.effects
    motor = fit.motor if inside else found.added_to(fit.motor)
    label = found.identifier if inside else found.label_in(fit.motor)
    problem = Problem(motor, fit.measurement, fit.bounds, fit.held)
    seen = {p.name for p in problem.everything}
    own = [p for p in motor.parameters if p.name.startswith(f"{label}.") and p.name in seen]
    if not own:
        raise BadInput(f"{effect} changes none of these sweeps: measure the other termination too")
    sizes = (
        [{p.name: fit.parameters[p.name] for p in own}]
        if inside
        else [_size(start, own, problem) for start in scaled_starts(found.effect, fit.measurement)]
    )
    nothing = {p.name: found.effect.limit_values[p.short_name] for p in own}
    shown = sorted((_shown(fit, problem, size, nothing) for size in sizes), key=lambda one: one.rms)
    chosen = shown if len(shown) <= MOST_SIZES else [shown[0], shown[len(shown) // 2], shown[-1]]
    return Signature(effect, found.effect.title, *_axes(fit), tuple(chosen))


def _size(start: Mapping[str, float], own: list[Parameter], problem: Problem) -> dict[str, float]:
    """Start values; where they are zero, one standard deviation, and a frequency to be scanned in the middle of the sweep."""
    middle = float(np.exp(np.mean(np.log(problem.observed.frequency_hz))))
    values = {}
    for parameter in own:
        if not parameter.vary:
            values[parameter.name] = start.get(parameter.short_name) or middle
        else:
            values[parameter.name] = start.get(parameter.short_name, parameter.middle) or parameter.sigma or parameter.middle
    return values


def _shown(fit: Fit, problem: Problem, size: Mapping[str, float], nothing: Mapping[str, float]) -> Shown:
    base = {**fit.parameters, **fit.nuisance}
    with_it, without = (_impedance(problem, {**base, **values}) for values in (size, nothing))
    change = {t: np.log(with_it[t] / without[t]) for t in with_it}
    return Shown({name.rpartition(".")[2]: value for name, value in size.items()}, change, _remaining(fit, change))


def _impedance(problem: Problem, values: Mapping[str, float]) -> dict[str, ComplexArray]:
    """Impedance in ohm by termination; values may lie outside the parameters' ranges, as an effect's limit does."""
    found = {}
    for sweep in problem.observed.sweeps:
        circuit = problem.motor.circuit(sweep.termination)
        names = list({p.name: None for node in walk(circuit) for p in node.own_parameters})
        found[sweep.termination] = Tape(circuit, names).impedance(sweep.s, np.array([values[name] for name in names]))
    return found


def _remaining(fit: Fit, change: Mapping[str, ComplexArray]) -> dict[str, ComplexArray]:
    """The change without the part that the fit's parameters can absorb, by least squares with the weights of the fit."""
    problem = fit.problem
    joined = np.concatenate([change[t] for t in problem.observed.slices]) * problem.observed.weight
    wanted = np.concatenate([joined.real, joined.imag])
    slopes = problem.slopes_of_deviation(fit.unknowns) * problem.observed.weight
    design = np.concatenate([slopes.real, slopes.imag], axis=1).T
    scale = np.maximum(np.linalg.norm(design, axis=0), 1e-300)
    taken = design @ (np.linalg.lstsq(design / scale, wanted, rcond=1e-10)[0] / scale)
    left = (wanted - taken)[: problem.size] + 1j * (wanted - taken)[problem.size :]
    left = left / problem.observed.weight
    return {t: left[where] for t, where in problem.observed.slices.items()}


def _axes(fit: Fit) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
    frequency: dict[str, FloatArray] = {}
    uncertainty: dict[str, FloatArray] = {}
    for sweep, noise in zip(fit.measurement.sweeps, fit.measurement.noise, strict=True):
        systematic = fit.measurement.analyser.uncertainty(sweep.frequency_hz, sweep.mean_ohm)
        frequency[sweep.termination] = sweep.frequency_hz
        uncertainty[sweep.termination] = np.asarray(2 * np.sqrt(2 * noise.variance + systematic**2), dtype=np.float64)
    return frequency, uncertainty
