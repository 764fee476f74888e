"""Fit of source and path to measured spectra: robust least squares in dB with what is known of the receiver as priors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.data.spectrum import Spectrum
from motoremi.emission.effects import changed, find_source_effect
from motoremi.emission.scatter import ripple_columns, scatter_db
from motoremi.emission.setup import Ambient, MotorImpedance, Setup
from motoremi.emission.stations import Station, find_stations
from motoremi.errors import BadInput
from motoremi.model.parameter import Parameter

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Points that a fit works on, for each detector: all below this frequency, where combs can be told line by line, and so many above.
_ALL_BELOW_HZ = 1.2e6
_ABOVE = 260
# What the formulas leave, measured against the time domain, without what is smooth along frequency.
_MODEL_DB = {"peak": 0.25, "quasi-peak": 0.25, "average": 0.15, "rms-average": 0.15}
# By how much the motor's resonances may lie elsewhere than the fitted circuit has them.
_DETUNING = 0.004
# Beyond so many standard deviations a point (a glitch) counts in proportion only.
_ROBUST = 2.5
# Neighbours are read one after the other, but what a model does not know they share: so many points say as much as one.
CORRELATED = 2.0
# A station in the model is worth it if it explains more than its frequency and its two levels cost.
_STATION_COST = 8.0
# Curvature of the flat distribution that stands for a range: one that the data do not narrow counts nothing.
_FLAT = 2 * np.pi

BASE: tuple[tuple[Parameter, float | None], ...] = (
    (Parameter("step_v", "V", 0.05, 4.0, "drop of a carbon brush, below the least voltage of an arc"), None),
    (Parameter("rise_s", "s", 5e-8, 5e-6, "a segment leaves the brush"), None),
    (Parameter("floor_dbuv", "dBuV", -30.0, 12.0, "of the receiver, average; expected from noise figure and attenuator", scale="linear"), 8.0),
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
        self.detectors = tuple(levels)
        whole = {detector: np.mean([np.interp(grid, f, level) for f, level in sweeps], axis=0) for detector, sweeps in levels.items()}
        self.stations = find_stations(grid, whole, setup.receiver.band)
        chosen = _chosen(grid, self.stations)
        self.grid_hz = grid[chosen]
        self.measured_dbuv = np.concatenate([level[chosen] for level in whole.values()])
        self.frequency_hz = np.tile(self.grid_hz, len(self.detectors))
        size = self.grid_hz.size
        self.where = {detector: slice(index * size, (index + 1) * size) for index, detector in enumerate(self.detectors)}
        self.motor_ohm: ComplexArray = np.asarray(motor(self.grid_hz), dtype=np.complex128)
        self.sigma_db = self._sigma(np.concatenate([scatter_db(level)[chosen] for level in whole.values()]))
        self.ripple = ripple_columns(self.grid_hz, len(self.detectors))
        self.grid = grid
        self.whole = whole

    def _sigma(self, scatter: FloatArray) -> FloatArray:
        transfer_db = 20 * np.log10(np.abs(self.setup.path.transfer(self.grid_hz, self.motor_ohm)))
        slope = np.abs(np.gradient(transfer_db, np.log(self.grid_hz))) * _DETUNING
        formula = np.concatenate([np.hypot(_MODEL_DB[detector], slope) for detector in self.detectors])
        sigma: FloatArray = np.hypot(scatter, formula)
        return sigma

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
        if "background-noise" in effects and ambient is None:
            setup = replace(setup, stations=self.stations)
        return changed(setup, [name for name in effects if not (name == "background-noise" and ambient is not None)], values)

    def error(self, effects: Sequence[str], values: Mapping[str, float]) -> FloatArray:
        """Measured minus model in dB."""
        levels = self.setup_for(effects, values).levels(self.grid_hz, self.motor_ohm, "quasi-peak" in self.where)
        model = np.concatenate([levels[detector] for detector in self.where])  # type: ignore[index]
        error: FloatArray = self.measured_dbuv - model - values["offset_db"]
        return error


def _chosen(grid: FloatArray, stations: Sequence[Station]) -> NDArray[np.intp]:
    low = np.flatnonzero(grid <= _ALL_BELOW_HZ)
    high = np.flatnonzero(grid > _ALL_BELOW_HZ)
    if high.size > _ABOVE:
        high = high[np.unique(np.searchsorted(grid[high], np.geomspace(grid[high[0]], grid[high[-1]], _ABOVE)).clip(0, high.size - 1))]
    if low.size > 2 * _ABOVE:
        low = low[:: low.size // _ABOVE]
    tops = np.searchsorted(grid, [station.frequency_hz for station in stations])
    beside = (tops[:, None] + np.arange(-2, 3)).ravel().clip(0, grid.size - 1)
    return np.unique(np.concatenate([low, high, beside])).astype(np.intp)


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
    posterior = _Posterior(problem, tuple(effects))
    unknowns = posterior.unknowns
    points = [np.array([np.clip(_to_unit(p, start.get(p.name, p.middle)), 0.01, 0.99) for p, _ in unknowns], dtype=np.float64) for start in starts]
    ranked = sorted(points, key=posterior.at_start)
    best = min((posterior.polished(start) for start in ranked[:keep]), key=lambda found: float(found.cost))
    return posterior.fit(best.x, float(best.cost))


class _Posterior:
    """Residuals whose squares add up to twice the negative log posterior: of points and priors; the receiver's ripple is unknown too."""

    def __init__(self, problem: Problem, effects: tuple[str, ...]) -> None:
        self.problem, self.effects = problem, effects
        self.unknowns = problem.parameters(effects)
        self.size = len(self.unknowns)
        self.columns = -problem.ripple / problem.sigma_db[:, None]
        # The formulas are smooth but not exact to the last digit: wider steps than usual for the slopes. But line 1000 of a comb moves by its
        # spacing when the comb's frequency moves by a thousandth of it, and so does what the two edges of a pulse cancel.
        self.steps = np.array([1e-7 if p.name in ("chopper.frequency_hz", "chopper.width_s") else 1e-4 for p, _ in self.unknowns])
        self._last: tuple[FloatArray, FloatArray] | None = None

    def values(self, x: FloatArray) -> dict[str, float]:
        """By name."""
        return {p.name: _from_unit(p, float(u)) for (p, _), u in zip(self.unknowns, x, strict=False)}

    def _errors(self, x: FloatArray) -> FloatArray:
        """In standard deviations, without the ripple."""
        if self._last is None or not np.array_equal(self._last[0], x):
            self._last = x.copy(), self.problem.error(self.effects, self.values(x)) / self.problem.sigma_db
        return self._last[1]

    def _priors(self, x: FloatArray) -> FloatArray:
        values = self.values(x)
        centre = {"floor_dbuv": self.problem.setup.receiver.floor_dbuv}
        return np.array(
            [
                ((np.log(values[p.name]) if p.scale == "log" else values[p.name]) - centre.get(p.name, 0.0)) / sigma
                for p, sigma in self.unknowns
                if sigma is not None
            ]
        )

    def residuals(self, x: FloatArray) -> FloatArray:
        """Of all unknowns: the model's in units of their ranges, then those of the ripple."""
        at, ripple = x[: self.size], x[self.size :]
        points = _softened(self._errors(at) + self.columns @ ripple) / np.sqrt(CORRELATED)
        return np.concatenate([points, self._priors(at), ripple])

    def slopes(self, x: FloatArray) -> FloatArray:
        """Of the residuals."""
        at, ripple = x[: self.size], x[self.size :]
        error, prior = self._errors(at), self._priors(at)
        raw, priors = np.empty((error.size, self.size)), np.empty((prior.size, self.size))
        for index, step in enumerate(self.steps):
            moved = at.copy()
            moved[index] += step if moved[index] + step <= 1 else -step
            by = moved[index] - at[index]
            raw[:, index], priors[:, index] = (self._errors(moved) - error) / by, (self._priors(moved) - prior) / by
        slopes = np.zeros((error.size + prior.size + ripple.size, x.size))
        hard = _softening(error + self.columns @ ripple)[:, None] / np.sqrt(CORRELATED)
        slopes[: error.size, : self.size], slopes[: error.size, self.size :] = hard * raw, hard * self.columns
        slopes[error.size : error.size + prior.size, : self.size] = priors
        slopes[error.size + prior.size :, self.size :] = np.eye(ripple.size)
        return slopes

    def at_start(self, x: FloatArray) -> float:
        """How bad a start is."""
        return float(np.sum(_softened(self._errors(x)) ** 2))

    def polished(self, start: FloatArray) -> OptimizeResult:
        """The nearest minimum."""
        free = self.columns.shape[1]
        low, high = (np.concatenate([np.full(self.size, end), np.full(free, far)]) for end, far in ((0.0, -np.inf), (1.0, np.inf)))
        return least_squares(
            self.residuals, np.concatenate([start, np.zeros(free)]), jac=self.slopes, bounds=(low, high),
            x_scale=np.concatenate([1e3 * self.steps, np.ones(free)]), max_nfev=25, ftol=1e-4, xtol=1e-9, gtol=1e-6,
        )  # fmt: skip

    def fit(self, x: FloatArray, cost: float) -> EmissionFit:
        """What a minimum says: its evidence is the integral over all unknowns around it (Laplace)."""
        problem, values = self.problem, self.values(x[: self.size])
        error = problem.error(self.effects, values)
        slopes = self.slopes(x)
        flat = [_FLAT if index < self.size and self.unknowns[index][1] is None else 0.0 for index in range(x.size)]
        _, volume = np.linalg.slogdet(slopes.T @ slopes + np.diag(flat))
        own = [p.name for p, _ in self.unknowns if "." in p.name]
        stations = len(problem.stations) if "background-noise" in self.effects and problem.ambient is None else 0
        evidence = -cost - 0.5 * volume + 0.5 * len(own) * np.log(_FLAT) - _STATION_COST * stations
        left = _softened(error / problem.sigma_db + self.columns @ x[self.size :])
        chi2 = float(np.sum(left**2)) / max(1, error.size - x.size)
        at_bound = tuple(p.name for (p, _), u in zip(self.unknowns, x, strict=False) if p.name in own and (u < 1e-3 or u > 1 - 1e-3))
        return EmissionFit(problem, self.effects, values, chi2, float(np.sqrt(np.mean(error**2))), float(evidence), at_bound)


def _softening(errors: FloatArray) -> FloatArray:
    """Slope of `_softened`."""
    size = np.maximum(np.abs(errors), _ROBUST)
    return np.where(np.abs(errors) <= _ROBUST, 1.0, _ROBUST / np.sqrt(_ROBUST * (2 * size - _ROBUST)))


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
