"""Fit of source and path to measured spectra: robust least squares in dB with what is known of the receiver as priors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import least_squares

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.data.spectrum import Spectrum
from motoremi.emission.effects import changed, find_source_effect
from motoremi.emission.setup import Ambient, MotorImpedance, Setup
from motoremi.errors import BadInput
from motoremi.model.parameter import Parameter

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Points that a fit works on, for each detector: all below this frequency, where combs can be told line by line, and so many above.
_ALL_BELOW_HZ = 1.2e6
_ABOVE = 260
# Ripple of the receiver and what the formulas leave (measured against the time domain): on the peak the luck of the highest event besides.
_RIPPLE_DB = 0.4
_MODEL_DB = {"peak": 0.45, "quasi-peak": 0.45, "average": 0.2, "rms-average": 0.2}
# By how much the motor's resonances may lie elsewhere than the fitted circuit has them.
_DETUNING = 0.004
# Beyond so many standard deviations a point (a station, a glitch) counts in proportion only.
_ROBUST = 2.5
# Neighbours share noise and ripple: so many points in truth say as much as one.
CORRELATED = 8.0

BASE: tuple[tuple[Parameter, float | None], ...] = (
    (Parameter("step_v", "V", 0.05, 4.0, "drop of a carbon brush, below the least voltage of an arc"), None),
    (Parameter("rise_s", "s", 5e-8, 5e-6, "a segment leaves the brush"), None),
    (Parameter("floor_dbuv", "dBuV", -30.0, 12.0, "of the receiver, average", scale="linear"), None),
    (Parameter("offset_db", "dB", -4.0, 4.0, "error of the receiver", scale="linear"), 0.8),
    (Parameter("speed_factor", "", 0.9, 1.1, "stated speed against the real one"), 0.015),
    (Parameter("lisn_factor", "", 0.7, 1.4, "choke within its tolerance"), 0.08),
)


@dataclass(frozen=True, eq=False)
class EmissionFit:
    """A model of the spectra. Immutable.

    Parameters
    ----------
    problem : Problem
    effects : tuple of str
    parameters : dict
        Base and effects' parameters, SI units.
    chi2_reduced : float
        Robust, over points.
    rms_error_db : float
        Over the points that are fitted.
    log_evidence : float
    at_bound : tuple of str
    """

    problem: Problem
    effects: tuple[str, ...]
    parameters: Mapping[str, float]
    chi2_reduced: float
    rms_error_db: float
    log_evidence: float
    at_bound: tuple[str, ...]

    def setup(self) -> Setup:
        """The set-up that the fit found, to predict from."""
        return self.problem.setup_for(self.effects, self.parameters)

    def error_db(self) -> dict[str, tuple[FloatArray, FloatArray]]:
        """Detector -> frequencies and measured minus model."""
        error = self.problem.error(self.effects, self.parameters)
        return {detector: (self.problem.frequency_hz[at], error[at]) for detector, at in self.problem.where.items()}

    def figures(self) -> JsonDict:
        """As in the contract."""
        return {
            "effects": list(self.effects),
            "chi2_reduced": self.chi2_reduced,
            "rms_error_percent": float(100 * (10 ** (self.rms_error_db / 20) - 1)),
            "rms_error_db": self.rms_error_db,
        }

    def to_dict(self) -> JsonDict:
        """Plain data; `restored` reads it back."""
        return {**self.figures(), "parameters": dict(self.parameters), "log_evidence": self.log_evidence, "at_bound": list(self.at_bound)}

    def own_parameters(self, effect: str) -> JsonDict:
        """Of one effect, by short name."""
        return {
            p.name: {
                "value": self.parameters[f"{effect}.{p.name}"],
                "sigma": None,
                "at_bound": f"{effect}.{p.name}" in self.at_bound,
                "unit": p.unit,
            }
            for p in find_source_effect(effect).parameters
            if f"{effect}.{p.name}" in self.parameters
        }

    def plot(self) -> Figure:
        """Measured levels and the model, the difference below."""
        from motoremi.report.emission import emission_fit_figure

        return emission_fit_figure(self)


class Problem:
    """Measured spectra, the motor, and the set-up as stated.

    Parameters
    ----------
    spectra : sequence of Spectrum
        Of the running motor; several of one detector are averaged.
    motor : callable
        Impedance that the source sees.
    setup : Setup
    ambient : Ambient, optional
        A sweep with the motor off.

    Raises
    ------
    BadInput
        Without a spectrum that can be used.
    """

    def __init__(self, spectra: Sequence[Spectrum], motor: MotorImpedance, setup: Setup, ambient: Ambient | None = None) -> None:
        if not spectra:
            raise BadInput("there is no spectrum of the running motor to compare with")
        self.setup, self.ambient = replace(setup, ambient=None), ambient
        levels: dict[str, list[tuple[FloatArray, FloatArray]]] = {}
        for spectrum in spectra:
            usable = ~spectrum.overload
            levels.setdefault(spectrum.detector, []).append((spectrum.frequency_hz[usable], spectrum.level_dbuv[usable]))
        grid = levels[next(iter(levels))][0][0]
        if grid.size < 30:
            raise BadInput(f"{grid.size} points that are not overloaded are too few to say which effect is missing")
        self.grid_hz = grid[_chosen(grid)]
        self.detectors = tuple(levels)
        self.measured_dbuv = np.concatenate(
            [np.mean([np.interp(self.grid_hz, f, level) for f, level in sweeps], axis=0) for sweeps in levels.values()]
        )
        self.frequency_hz = np.tile(self.grid_hz, len(self.detectors))
        size = self.grid_hz.size
        self.where = {detector: slice(index * size, (index + 1) * size) for index, detector in enumerate(self.detectors)}
        self.motor_ohm: ComplexArray = np.asarray(motor(self.grid_hz), dtype=np.complex128)
        self.sigma_db = self._sigma()
        self.full = levels

    def _sigma(self) -> FloatArray:
        transfer_db = 20 * np.log10(np.abs(self.setup.path.transfer(self.grid_hz, self.motor_ohm)))
        slope = np.abs(np.gradient(transfer_db, np.log(self.grid_hz))) * _DETUNING
        return np.concatenate([np.sqrt(_RIPPLE_DB**2 + _MODEL_DB[detector] ** 2 + slope**2) for detector in self.detectors])

    @cached_property
    def repetition_known(self) -> bool:
        """Whether speed and segments, or the repetition, were stated."""
        return "source" not in self.setup.assumed

    def parameters(self, effects: Sequence[str]) -> list[tuple[Parameter, float | None]]:
        """Unknowns with the standard deviation of their prior, if they have one."""
        found = [(p, (None if p.name == "speed_factor" and not self.repetition_known else sigma)) for p, sigma in BASE]
        if not self.repetition_known:
            found = [(replace(p, low=0.05, high=20.0) if p.name == "speed_factor" else p, sigma) for p, sigma in found]
        for name in effects:
            if name == "background-noise" and self.ambient is not None:
                continue
            found += [(replace(p, name=f"{name}.{p.name}"), None) for p in find_source_effect(name).parameters]
        return found

    def setup_for(self, effects: Sequence[str], values: Mapping[str, float]) -> Setup:
        """The set-up with all values in it."""
        stated = self.setup
        source = replace(
            stated.source,
            step_v=values["step_v"],
            rise_s=values["rise_s"],
            repetition_hz=stated.source.repetition_hz * values["speed_factor"],
        )
        path = replace(stated.path, lisn=stated.path.lisn.deviating(values["lisn_factor"]))
        ambient = self.ambient if "background-noise" in effects else None
        setup = replace(stated, source=source, path=path, floor_dbuv=values["floor_dbuv"], ambient=ambient)
        return changed(setup, [name for name in effects if not (name == "background-noise" and ambient is not None)], values)

    def error(self, effects: Sequence[str], values: Mapping[str, float]) -> FloatArray:
        """Measured minus model in dB."""
        levels = self.setup_for(effects, values).levels(self.grid_hz, self.motor_ohm)
        model = np.concatenate([levels[detector] for detector in self.where])  # type: ignore[index]
        error: FloatArray = self.measured_dbuv - model - values["offset_db"]
        return error


def _chosen(grid: FloatArray) -> FloatArray:
    low = np.flatnonzero(grid <= _ALL_BELOW_HZ)
    high = np.flatnonzero(grid > _ALL_BELOW_HZ)
    if high.size > _ABOVE:
        high = high[np.unique(np.searchsorted(grid[high], np.geomspace(grid[high[0]], grid[high[-1]], _ABOVE)).clip(0, high.size - 1))]
    if low.size > 2 * _ABOVE:
        low = low[:: low.size // _ABOVE]
    return np.concatenate([low, high])


def _to_unit(parameter: Parameter, value: float) -> float:
    if parameter.scale == "log":
        return float(np.log(value / parameter.low) / np.log(parameter.high / parameter.low))
    return (value - parameter.low) / (parameter.high - parameter.low)


def _from_unit(parameter: Parameter, unit: float) -> float:
    if parameter.scale == "log":
        return float(parameter.low * (parameter.high / parameter.low) ** unit)
    return parameter.low + unit * (parameter.high - parameter.low)


def fit_spectra(problem: Problem, effects: Sequence[str], starts: Sequence[Mapping[str, float]], keep: int = 2) -> EmissionFit:
    """The best of several local fits.

    Parameters
    ----------
    problem : Problem
    effects : sequence of str
    starts : sequence of mapping
        Values by name; what is missing starts in the middle of its range.
    keep : int
        How many of the starts are followed.
    """
    unknowns = problem.parameters(effects)
    names = [p.name for p, _ in unknowns]

    def values_of(x: FloatArray) -> dict[str, float]:
        return {p.name: _from_unit(p, float(u)) for (p, _), u in zip(unknowns, x, strict=True)}

    def residuals(x: FloatArray) -> FloatArray:
        values = values_of(x)
        errors = problem.error(effects, values) / problem.sigma_db
        priors = [
            (np.log(values[p.name]) if p.scale == "log" else values[p.name]) / sigma * _PRIOR_WEIGHT for p, sigma in unknowns if sigma is not None
        ]
        return np.concatenate([_softened(errors), priors])

    points = [np.array([np.clip(_to_unit(p, start.get(p.name, p.middle)), 0.01, 0.99) for p, _ in unknowns], dtype=np.float64) for start in starts]
    ranked = sorted(points, key=lambda x: float(np.sum(residuals(x) ** 2)))
    best_x, best_cost = ranked[0], np.inf
    # The formulas are smooth but not exact to the last digit: wider steps than usual for the slopes. Line 1000 of a comb moves by a
    # bandwidth when the comb's frequency moves by a thousandth of it.
    steps = [1e-7 if name == "chopper.frequency_hz" else 1e-4 for name in names]
    for start in ranked[:keep]:
        found = least_squares(
            residuals, start, bounds=(0.0, 1.0), diff_step=steps, x_scale=1e3 * np.array(steps), max_nfev=25, ftol=1e-4, xtol=1e-9, gtol=1e-6
        )
        if found.cost < best_cost:
            best_x, best_cost = found.x, float(found.cost)
    values = values_of(best_x)
    error = problem.error(effects, values)
    count = error.size
    chi2 = float(np.sum(_softened(error / problem.sigma_db) ** 2))
    freedom = len(names) - len(BASE)
    evidence = -best_cost / CORRELATED - 0.5 * freedom * np.log(count / CORRELATED)
    at_bound = tuple(name for name, u in zip(names, best_x, strict=True) if "." in name and (u < 1e-3 or u > 1 - 1e-3))
    return EmissionFit(
        problem, tuple(effects), values, chi2 / max(1, count - len(names)), float(np.sqrt(np.mean(error**2))), float(evidence), at_bound
    )


# Priors are not diluted by the correlation of the points.
_PRIOR_WEIGHT = np.sqrt(CORRELATED)


def _softened(errors: FloatArray) -> FloatArray:
    """Residuals whose squares grow in proportion beyond a few standard deviations."""
    size = np.abs(errors)
    beyond = np.sqrt(_ROBUST * (2 * np.maximum(size, _ROBUST) - _ROBUST))
    return np.where(size <= _ROBUST, errors, np.sign(errors) * beyond)


def restored(problem: Problem, stored: JsonDict) -> EmissionFit:
    """A fit from its plain data and the problem it solved."""
    values = {str(name): float(value) for name, value in stored["parameters"].items()}
    return EmissionFit(
        problem, tuple(stored["effects"]), values, float(stored["chi2_reduced"]), float(stored["rms_error_db"]),
        float(stored["log_evidence"]), tuple(stored["at_bound"]),
    )  # fmt: skip
