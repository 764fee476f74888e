"""The result of a fit: immutable, speaks for itself in a terminal and a notebook, turns into plain data."""

from __future__ import annotations

import dataclasses
import html
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.data.measurement import Measurement
from motoremi.errors import BadInput
from motoremi.fitting.problem import Linearised, Problem
from motoremi.model.circuit import Tape
from motoremi.model.effects import add_effects
from motoremi.model.motor import Motor, dc_motor
from motoremi.quantities import show

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from motoremi.fitting.identify import Derived, Interval

Method: TypeAlias = Literal["ant-colony", "paper"]
METHODS: tuple[Method, ...] = ("ant-colony", "paper")


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted motor. Immutable; `add` and `drop` return new ones.

    Parameters
    ----------
    motor : Motor
    measurement : Measurement
    method : {"ant-colony", "paper"}
    seed : int
    parameters, sigma : dict
        Values and standard deviations in SI units; sigma is infinite for what the data do not determine, and is widened where the model
        does not describe the data (chi2_reduced > 1).
    nuisance : dict
        What the fit believes the fixture's compensation left, SI units.
    chi2_reduced : float
        1 for a perfect model, over random noise with the analyser's systematic errors marginalised.
    rms_error_percent, rms_error_db : float
        Of Z_model/Z_measured over all points, mean of repeats; the model holds the analyser's most likely error within its specification.
    motor_error_percent : float
        The same for the motor's circuit alone.
    floor_percent : float
        What random noise alone would leave.
    converged : bool
    evaluations : int
    elapsed_s : float
    history : tuple of dict
        Training curve: evaluations so far and rms deviation in percent.
    warnings : tuple of str
        What a reader has to know.
    """

    motor: Motor
    measurement: Measurement
    method: Method
    seed: int
    parameters: Mapping[str, float]
    sigma: Mapping[str, float]
    nuisance: Mapping[str, float]
    chi2_reduced: float
    rms_error_percent: float
    rms_error_db: float
    motor_error_percent: float
    floor_percent: float
    converged: bool
    evaluations: int
    elapsed_s: float
    history: tuple[JsonDict, ...]
    warnings: tuple[str, ...] = ()
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    held: Mapping[str, float] = field(default_factory=dict)
    search_parameters: Mapping[str, float] = field(default_factory=dict)
    objective: float = np.inf
    log_evidence: float = -np.inf

    @cached_property
    def problem(self) -> Problem:
        """The least-squares problem that this solves, on all points."""
        return Problem(self.motor, self.measurement, self.bounds, self.held)

    @cached_property
    def linearised(self) -> Linearised:
        """The problem round the solution."""
        return self.problem.linearised(self.unknowns)

    @cached_property
    def unknowns(self) -> FloatArray:
        """The solution as the problem's vector."""
        return self.problem.vector({**self.parameters, **self.nuisance})

    @property
    def effects(self) -> tuple[str, ...]:
        """Effects in the model."""
        return self.motor.effects

    def model_ohm(self, termination: str, frequency_hz: FloatArray | None = None) -> ComplexArray:
        """Impedance of the motor alone in ohm, without the analyser's errors, at the measured or other frequencies."""
        if frequency_hz is None:
            frequency_hz = next(s.frequency_hz for s in self.measurement.sweeps if s.termination == termination)
        motor_parameters = [p for p in self.motor.parameters if p.name in self.motor.used_parameters(termination)]
        values = np.array([self.parameters.get(p.name, p.middle) for p in motor_parameters])
        tape = Tape(self.motor.circuit(termination), [p.name for p in motor_parameters])
        s: ComplexArray = np.asarray(2j * np.pi * np.asarray(frequency_hz), dtype=np.complex128)
        return tape.impedance(s, values)

    @cached_property
    def covariance(self) -> FloatArray:
        """Of the problem's unknowns (logarithms of positive parameters), widened where the model does not describe the data."""
        return _inverse(self.linearised.matrix) * max(1.0, self.chi2_reduced)

    def interval(self, name: str) -> Interval:
        """What values of a parameter the data allow at 95 %, by its profile likelihood."""
        from motoremi.fitting.identify import profile

        return profile(self, name)

    def derived(self) -> list[Derived]:
        """Resonances, quality factors and characteristic impedances with error bars."""
        from motoremi.fitting.identify import derived

        return derived(self)

    def errors(self) -> dict[str, ComplexArray]:
        """Z_model/Z_measured - 1 per termination, the analyser's most likely error included."""
        problem = self.problem
        error = np.exp(-problem.less_gain_error(problem.deviation(self.unknowns))) - 1
        return {termination: error[where] for termination, where in problem.observed.slices.items()}

    def add(self, effect: str, held: Mapping[str, float] | None = None, thorough: bool = True) -> Fit:
        """The fit with one more effect, refitted from here.

        Parameters
        ----------
        effect : str
            `name` or `name@element`.
        held : mapping, optional
            Parameters of the effect that are not to be fitted.
        thorough : bool
            Whether to send ants out as well where start values do not lead down to the noise.

        Raises
        ------
        BadInput
            If the effect is unknown or already in the model.
        """
        from motoremi.fitting.fit import refit_with

        return refit_with(self, effect, held, thorough=thorough)

    def drop(self, effect: str | None = None) -> Fit:
        """The fit without an effect (the last one by default), refitted."""
        from motoremi.fitting.fit import refit_without

        return refit_without(self, effect)

    def to_frame(self) -> pd.DataFrame:
        """A pandas table of the parameters, by name: value, sigma, unit, determined."""
        import pandas as pd

        units = {p.name: p.unit for p in self.motor.parameters}
        rows = {
            name: {"value": value, "sigma": self.sigma[name], "unit": units[name], "determined": self.determined(name)}
            for name, value in self.parameters.items()
        }
        return pd.DataFrame.from_dict(rows, orient="index")

    def to_dict(self) -> JsonDict:
        """Plain data, SI units."""
        return {
            "schema": "motoremi.fitting/1",
            "effects": list(self.effects),
            "method": self.method,
            "seed": self.seed,
            "analyser": self.measurement.analyser.name,
            "parameters": {
                p.name: {
                    "value": self.parameters[p.name],
                    "sigma": _finite(self.sigma[p.name]),
                    "unit": p.unit,
                    "low": self.bounds.get(p.name, (p.low, p.high))[0],
                    "high": self.bounds.get(p.name, (p.low, p.high))[1],
                    "determined": self.determined(p.name),
                }
                for p in self.motor.parameters
                if p.name in self.parameters
            },
            "undetermined": self.undetermined(),
            "derived": [{"name": d.name, "value": d.value, "sigma": _finite(d.sigma), "unit": d.unit} for d in self.derived()],
            "nuisance": dict(self.nuisance),
            "searched": dict(self.search_parameters),
            "bounds": {name: list(pair) for name, pair in self.bounds.items()},
            "held": dict(self.held),
            "chi2_reduced": self.chi2_reduced,
            "rms_error_percent": self.rms_error_percent,
            "rms_error_db": self.rms_error_db,
            "motor_error_percent": self.motor_error_percent,
            "floor_percent": self.floor_percent,
            "converged": self.converged,
            "evaluations": self.evaluations,
            "elapsed_s": self.elapsed_s,
            "history": [dict(point) for point in self.history],
            "warnings": list(self.warnings),
        }

    def determined(self, name: str) -> bool:
        """Whether the data say anything useful about a parameter: its standard deviation is below half its value."""
        return bool(self.sigma[name] < 0.5 * abs(self.parameters[name])) if self.parameters[name] else False

    def undetermined(self) -> list[str]:
        """Names of the parameters that the data do not determine, those that no sweep sees among them."""
        loose = [name for name in self.parameters if not self.determined(name) and name not in self.held]
        return [*loose, *self.unseen()]

    def unseen(self) -> list[str]:
        """Names of the parameters that none of the sweeps depends on."""
        return [p.name for p in self.motor.parameters if p.name not in self.parameters]

    def rows(self) -> list[tuple[str, str, str]]:
        """Name, value and error bar of each parameter as text."""
        units = {p.name: p.unit for p in self.motor.parameters}
        table = []
        for name, value in self.parameters.items():
            if name in self.held:
                bar = "held"
            elif not self.determined(name):
                bar = "not determined by these data"
            else:
                bar = f"± {100 * self.sigma[name] / abs(value):.2g} %"
            table.append((name, show(value, units[name]), bar))
        return table + [(name, "-", "not determined: no sweep depends on it") for name in self.unseen()]

    def __repr__(self) -> str:
        model = "paper's circuit" + "".join(f" + {effect}" for effect in self.effects)
        lines = [
            f"Fit of the {model} ({self.method}, {'converged' if self.converged else 'NOT CONVERGED'})",
            f"  error {self.rms_error_percent:.3g} % rms ({self.rms_error_db:.3g} dB), noise floor {self.floor_percent:.3g} %, "
            f"chi2_reduced {self.chi2_reduced:.4g}",
            *(f"  {name:34s} {value:>14s}  {bar}" for name, value, bar in self.rows()),
            *(f"  note: {warning}" for warning in self.warnings),
        ]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        rows = "".join(f"<tr>{''.join(f'<td>{html.escape(cell)}</td>' for cell in row)}</tr>" for row in self.rows())
        head = html.escape(repr(self).splitlines()[0] + repr(self).splitlines()[1])
        return f"<b>{head}</b><table><tr><th>parameter</th><th>value</th><th>error bar</th></tr>{rows}</table>"

    def plot(self) -> Figure:
        """Both sweeps against the model, with the error below."""
        from motoremi.report.plots import fit_figure

        return fit_figure(self)


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def restore(payload: JsonDict, measurement: Measurement) -> Fit:
    """A fit from what `Fit.to_dict` wrote: the stored values, with statistics computed afresh from the sweeps.

    Raises
    ------
    BadInput
        If it is not such a dictionary.
    """
    try:
        motor = add_effects(dc_motor(), [str(effect) for effect in payload["effects"]])
        bounds = {str(name): (float(low), float(high)) for name, (low, high) in payload["bounds"].items()}
        held = {str(name): float(value) for name, value in payload["held"].items()}
        values = {str(name): float(entry["value"]) for name, entry in payload["parameters"].items()}
        nuisance = {str(name): float(value) for name, value in payload["nuisance"].items()}
        searched = {str(name): float(value) for name, value in payload["searched"].items()}
        method, seed, converged = payload["method"], int(payload["seed"]), bool(payload["converged"])
        evaluations, elapsed_s, history = int(payload["evaluations"]), float(payload["elapsed_s"]), tuple(payload["history"])
        warnings = tuple(str(warning) for warning in payload["warnings"])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise BadInput("the stored fit is incomplete: fit the session again") from error
    problem = Problem(motor, measurement, bounds, held)
    result = summarise(problem, problem.vector({**values, **nuisance}), converged, method, seed, evaluations, history, searched)
    return dataclasses.replace(result, elapsed_s=elapsed_s, warnings=warnings)


def summarise(
    problem: Problem,
    u: FloatArray,
    converged: bool,
    method: Method,
    seed: int,
    evaluations: int,
    history: tuple[JsonDict, ...],
    searched: Mapping[str, float] | None = None,
) -> Fit:
    """A solution with its statistics; `searched` is where the next effect starts from."""
    here = problem.linearised(u)
    objective, matrix = here.objective, here.matrix
    chi2_reduced = float(objective) / problem.degrees_of_freedom
    deviations = np.sqrt(np.diag(_inverse(matrix))) * max(1.0, np.sqrt(chi2_reduced))
    values = problem.named(u)
    own = {p.name for p in problem.motor.parameters}
    sigma: dict[str, float] = dict.fromkeys(own & values.keys(), 0.0)
    for index, parameter in enumerate(problem.unknowns):
        if parameter.name in own:
            unit = values[parameter.name] if parameter.scale == "log" else problem.vector_scale(index)
            sigma[parameter.name] = float(abs(unit) * deviations[index])
    left = problem.less_gain_error(here.deviation / problem.observed.weight)
    error = np.abs(np.exp(-left) - 1)
    alone = _motor_alone(problem, u)
    warnings = list(problem.measurement.caveats())
    if not converged and method != "paper":
        warnings.append("the fit did not converge: do not use its values")
    result = Fit(
        motor=problem.motor,
        measurement=problem.measurement,
        method=method,
        seed=seed,
        parameters={p.name: values[p.name] for p in problem.motor.parameters if p.name in values},
        sigma=sigma,
        nuisance={name: value for name, value in values.items() if name not in own},
        chi2_reduced=chi2_reduced,
        rms_error_percent=float(100 * np.sqrt(np.mean(error**2))),
        rms_error_db=float(20 / np.log(10) * np.sqrt(np.mean(left.real**2))),
        motor_error_percent=float(100 * np.sqrt(np.mean(np.abs(alone) ** 2))),
        floor_percent=problem.measurement.floor_percent,
        converged=converged,
        evaluations=evaluations,
        elapsed_s=0.0,
        history=history,
        warnings=tuple(warnings),
        bounds=problem.bounds,
        held=problem.held,
        search_parameters=searched or {},
        objective=float(objective),
        log_evidence=_log_evidence(problem, float(objective), matrix),
    )
    # Spares the cached property from building it again.
    vars(result)["problem"] = problem
    return result


def _motor_alone(problem: Problem, u: FloatArray) -> ComplexArray:
    own = np.array([p.sigma is None or "connection" not in p.name for p in problem.unknowns])
    error: ComplexArray = np.exp(-problem.deviation(np.where(own, u, 0.0))) - 1
    return error


def _inverse(matrix: FloatArray) -> FloatArray:
    """Covariance from the Gauss-Newton matrix; very large along directions that the data leave open."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    values, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
    covariance: FloatArray = (vectors / np.maximum(values, 1e-14)) @ vectors.T / np.outer(scale, scale)
    return covariance


def _log_evidence(problem: Problem, objective: float, matrix: FloatArray) -> float:
    """Marginal likelihood by Laplace's method, up to a constant that all models of these data share.

    Every positive parameter is spread evenly in its logarithm over its range; a direction that the data leave open counts with that range.
    """
    width = problem.high - problem.low
    flat = problem.precision == 0
    capped = matrix + np.diag(np.where(flat, 2 * np.pi / width**2, 0.0))
    sign, determinant = np.linalg.slogdet(capped)
    if sign <= 0:
        return -np.inf
    total = -0.5 * objective - 0.5 * determinant
    total += np.sum(np.where(flat, 0.5 * np.log(2 * np.pi) - np.log(width), 0.5 * np.log(np.maximum(problem.precision, 1e-300))))
    return float(total)
