"""The result of a fit: immutable, with a text and a notebook representation, and convertible to plain data."""

from __future__ import annotations

import dataclasses
import html
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

from motoremi.arrays import BoolArray, ComplexArray, FloatArray, FrozenDict, JsonDict
from motoremi.data.analyser import DECLARED
from motoremi.data.coarse import scatter_in_bins
from motoremi.data.covariance import Sizes
from motoremi.data.measurement import Measurement
from motoremi.data.text import clean_text
from motoremi.drawing import figure_of
from motoremi.errors import BadInput
from motoremi.fitting.band_scaling import scaled_ranges
from motoremi.fitting.exchange import EXCHANGEABLE, other_assignment
from motoremi.fitting.inexact import pulls_of_laws
from motoremi.fitting.intervals import Derived, Interval
from motoremi.fitting.marginal import NOTHING_LEFT, Marginal, scales_of
from motoremi.fitting.problem import AS_DECLARED, Linearised, Problem, fixture_parameters
from motoremi.fitting.search import ABSORBING, BEYOND_SIGMA, PLAIN, Found, Solution, Task
from motoremi.fitting.warming import displacements
from motoremi.given import refuse_other
from motoremi.model.circuit import Tape
from motoremi.model.effects import add_effects, find_effect, identifiers
from motoremi.model.effects.names import as_sum
from motoremi.model.motor import Motor, dc_motor
from motoremi.quantities import error_bar, percent, percent_span, show

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

Method: TypeAlias = Literal["ant-colony", "paper"]
METHODS: tuple[Method, ...] = ("ant-colony", "paper")
# Standard deviations of the analyser's errors that its specification is taken for.
SPECIFIED_SIGMA = 3.0
# Error bars are those of an analyser whose errors are twice as large as declared: by so many times the declared variance that is more. With errors
# of that size 90 % of 107 intervals of 95 % contained the truth; 84 % with the average over how much worse analysers may be (1.7).
WORSE = 2.0**2 - 1
# Fields of a fit that cannot be changed either.
MAPPINGS = ("parameters", "local_sigma", "nuisance", "bounds", "held", "search_parameters", "likeliest_parameters")
# Standard deviations by which chi-squared is above what noise and analyser leave: of a complex value at each point its mean has one of
# 1 / sqrt(points).
PLAINLY_MORE = 5.0
# A value that is so near to its bound, as a share of its range, is at it; searches end on it exactly, but for rounding.
EDGE = 1e-6
# Standard deviations away that another solution is far. A likelihood that is a normal distribution is there e^8 times lower, and has none.
FAR = 4.0
# Of another solution, parameters that differ by more than this share are shown.
CLEARLY = 0.05
# From this error on a circuit does not describe its motor (the paper's stop rule asks for 10 %), and what a fit says of it then.
MUCH_PERCENT = 10.0
MISSES = "while the circuit errs so much its elements are not those of the motor: do not quote them, look for what is missing"
# A scale of the declared errors that is less likely than this adds nothing to an error bar.
LEAST_LIKELY = 1e-3


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted motor. Immutable; `add` and `drop` return new ones.

    Parameters
    ----------
    motor : Motor
    measurement : Measurement
    method : {"ant-colony", "paper"}
    seed : int
    parameters, local_sigma : dict
        Values and standard deviations in SI units, infinite for what the data do not determine: from the curvature at the solution, with the
        discrepancy, that the analyser may be worse than declared, changes while the repeats drifted, laws of effects that are not exact, and that
        the resonances of an open-circuit sweep alone may be exchanged. `sigma` has other solutions as well.
    nuisance : dict
        Most probable residuals of the fixture's compensation, SI units.
    chi2_reduced : float
        1 for a perfect model, with noise and analyser as declared and without the discrepancy.
    rms_error_percent, rms_error_db : float
        Of Z_model/Z_measured - 1 over all points, mean of repeats: the motor's circuit alone, nothing absorbed.
    corrected_error_percent : float
        The same with the analyser's most likely error subtracted: no more than its specification allows, and none where that does not help.
    analyser_sigma : float
        Size of the analyser's errors, in standard deviations of what is declared.
    noise_percent, floor_percent : float
        What random noise alone, and noise with the analyser's specification, would leave of a perfect model.
    sizes : Sizes
        Of what no model describes and of the analyser's errors, at which the parameters were found.
    marginal : Marginal
        Posterior of both sizes.
    converged : bool
    evaluations : int
    elapsed_s : float
    history : tuple of dict
        Training curve: evaluations so far and rms deviation in percent.
    warnings : tuple of str
        What a reader has to know.
    search_parameters : dict
        Best of the search on few points: where a further effect starts from.
    likeliest_parameters : dict
        Of the likelihood's own solution, where `parameters` are those of the least relative error: one more place to start from.
    """

    motor: Motor
    measurement: Measurement
    method: Method
    seed: int
    parameters: Mapping[str, float]
    local_sigma: Mapping[str, float]
    nuisance: Mapping[str, float]
    chi2_reduced: float
    rms_error_percent: float
    rms_error_db: float
    corrected_error_percent: float
    analyser_sigma: float
    noise_percent: float
    floor_percent: float
    sizes: Sizes
    marginal: Marginal
    converged: bool
    evaluations: int
    elapsed_s: float
    history: tuple[JsonDict, ...]
    warnings: tuple[str, ...] = ()
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    held: Mapping[str, float] = field(default_factory=dict)
    search_parameters: Mapping[str, float] = field(default_factory=dict)
    likeliest_parameters: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in MAPPINGS:
            own = getattr(self, name)
            if not isinstance(own, FrozenDict):
                object.__setattr__(self, name, FrozenDict(own))
        object.__setattr__(self, "history", tuple(point if isinstance(point, FrozenDict) else FrozenDict(point) for point in self.history))

    def __getstate__(self) -> dict[str, object]:
        """The part that is sent to another process; derived values are computed there."""
        return {own.name: getattr(self, own.name) for own in dataclasses.fields(self)}

    @property
    def log_evidence(self) -> float:
        """Of the model, summed over the sizes; comparable among models of the same data only."""
        return self.marginal.log_evidence

    @property
    def task(self) -> Task:
        """Model, data, bounds and held values of this fit."""
        return Task(self.motor, self.measurement, self.bounds, self.held)

    @cached_property
    def problem(self) -> Problem:
        """The problem on all points, for the errors that are shown."""
        return Problem(self.motor, self.measurement, self.bounds, self.held, sizes=self.sizes)

    @cached_property
    def weighed(self) -> Problem:
        """The likelihood that this solves: on all points, or on averages where there are many thousand."""
        return self.problem if self.measurement.coarse is self.measurement else self.task.likelihood(None, self.sizes)

    @cached_property
    def objective(self) -> float:
        """Minus twice the log likelihood, up to a constant for these sizes."""
        return float(self.linearised.objective)

    @property
    def unexplained_percent(self) -> JsonDict:
        """What neither circuit, analyser nor noise describes, relative to Z: the median of its posterior, and its 95 % interval."""
        unit, error_percent = self.weighed.discrepancy_percent, self._regular_error_percent
        low, value, high = (unit * self.marginal.quantile(share) for share in (0.025, 0.5, 0.975))
        nothing = unit * NOTHING_LEFT
        if value > error_percent or self.sizes.discrepancy >= PLAIN:
            # If the circuit is fitted by its relative error, or only a sharp feature makes the discrepancy large, the error itself is undescribed.
            low, value, high = (error_percent / value * limit for limit in (low, value, high))
        if self.chi2_reduced > 1 + PLAINLY_MORE / np.sqrt(self.measurement.points):
            # A misfit at a few points, as beside a sharp resonance, is no discrepancy that is smooth along frequency.
            high = max(high, error_percent * float(np.sqrt(1 - 1 / self.chi2_reduced)))
        if self.analyser_sigma > BEYOND_SIGMA:
            # An error that the analyser could have caused only beyond its specification is undescribed too.
            beyond = float(np.sqrt(max(error_percent**2 - self.noise_percent**2, 0.0)))
            value, high = max(value, beyond), max(high, beyond)
        return {"value": 0.0 if value <= nothing else value, "low": 0.0 if low <= nothing else low, "high": high}

    @cached_property
    def _regular_error_percent(self) -> float:
        """`corrected_error_percent` at the points that do not stand out, as `noise_percent`: a station is no error of the model."""
        regular = np.concatenate([noise.regular for noise in self.measurement.noise])
        if regular.all():
            return self.corrected_error_percent
        problem, u = self.problem, self.unknowns
        corrected = self.weighed.less_allowed_error(u, None if self.weighed is problem else problem)
        with np.errstate(over="ignore"):
            return min(_rms_percent(np.exp(-left[regular]) - 1) for left in (problem.deviation(problem.alone(u)), corrected))

    @cached_property
    def explained(self) -> bool:
        """Whether the circuit describes the motor within the stated accuracy, or as well as these data show."""
        left = self.unexplained_percent
        nothing = self.marginal.nothing_left >= 0.5 and self.analyser_sigma <= BEYOND_SIGMA
        accuracy = self.measurement.accuracy_percent
        # A stated accuracy applies to the circuit itself: an analyser far beyond its specification could describe any error.
        within = accuracy is None or self.rms_error_percent <= np.hypot(accuracy, self.floor_percent)
        return bool(nothing or (left["value"] <= self.measurement.good_enough_percent and within))

    @cached_property
    def within_specification(self) -> bool:
        """Whether the circuit alone, nothing absorbed, errs within the floor as a whole, and within the specification (rms) at the points."""
        errors = self.errors()
        pairs = zip(self.measurement.sweeps, self.measurement.floors, strict=True)
        ratios = [np.abs(errors[sweep.termination]) / floor for sweep, floor in pairs]
        return bool(self.rms_error_percent <= self.floor_percent and np.mean(np.concatenate(ratios) ** 2) <= SPECIFIED_SIGMA**2)

    @property
    def fixture_sigma(self) -> float:
        """How large a fixture without compensation has to be, in standard deviations of one of a few centimetres; 0 without one."""
        sigma = {p.name: p.sigma for p in fixture_parameters(self.measurement.analyser)}
        return max((abs(self.nuisance.get(name, 0.0)) / one for name, one in sigma.items() if one is not None), default=0.0)

    @property
    def instrument_sigma(self) -> float:
        """The larger of `analyser_sigma` and `fixture_sigma`."""
        return max(self.analyser_sigma, self.fixture_sigma)

    @cached_property
    def linearised(self) -> Linearised:
        """The likelihood round the solution."""
        return self.weighed.linearised(self.unknowns)

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
        """Of the problem's unknowns (logarithms of positive parameters), averaged over how much worse than declared the analyser may be.

        That of the linear model round the solution; `exact_covariance`, `local_covariance` and `shown_covariance` have more.
        """
        shares = self.marginal.of_scale
        total = np.zeros_like(self.linearised.matrix)
        for scale, share in zip(self.marginal.scales, shares, strict=True):
            if share > LEAST_LIKELY:
                total += share / shares[shares > LEAST_LIKELY].sum() * self._covariance_at(scale)
        return total

    @cached_property
    def alternatives(self) -> FloatArray:
        """Steps to other solutions of this model that are about as probable and not near this one, shape (m, k)."""
        return on_fits.alternatives(self)

    @cached_property
    def sigma(self) -> Mapping[str, float]:
        """Standard deviations of the parameters in SI units, so that one of them contains the other solutions: `alternatives`."""
        return self.local_sigma if not len(self.alternatives) else FrozenDict(_in_si(self, self.shown_covariance))

    @cached_property
    def exact_sigma(self) -> Mapping[str, float]:
        """Standard deviations in SI units if the laws of all effects were exact."""
        return FrozenDict(_in_si(self, self.exact_covariance))

    @cached_property
    def shown_covariance(self) -> FloatArray:
        """That of `local_covariance`, and of other solutions: one standard deviation contains each that is far, two the others.

        Those that are not far are within the rise of a 95 % interval.
        """
        total = self.local_covariance
        for step, is_far in zip(self.alternatives, self.far(self.alternatives), strict=True):
            sigmas = 1.0 if is_far else 2.0
            if (np.abs(step) > sigmas * np.sqrt(np.diag(total))).any():
                total = total + np.outer(step, step) / sigmas**2
        return total

    def far(self, steps: FloatArray) -> BoolArray:
        """Whether steps of the unknowns, shape (m, k), are far for a parameter of the motor, given its error bar from the curvature."""
        own = self.weighed.own
        return np.asarray((np.abs(steps) > FAR * np.sqrt(np.diag(self.exact_covariance)))[:, own].any(axis=1))

    @cached_property
    def local_covariance(self) -> FloatArray:
        """That of `exact_covariance`, and of laws of effects that are not exact (`fitting.inexact`)."""
        pulls = pulls_of_laws(self.weighed, self.unknowns, self.linearised, 0.01 * self.unexplained_percent["value"])
        off = pulls @ self._covariance_at(self.sizes.declared)
        return self.exact_covariance + off.T @ off

    @cached_property
    def exact_covariance(self) -> FloatArray:
        """That of `covariance` with what the likelihood does not contain, if the laws of all effects are exact.

        That is: changes between the sweeps, two resonances that may be exchanged, an error that all impedances have in common
        (`Measurement.scale_sigma`), and an analyser that is worse than declared. Data that show that its errors change little from point to point
        do not show that they are small.
        """
        moved = displacements(self.weighed, self.unknowns, self.linearised, self.covariance)
        total: FloatArray = self.covariance + moved.T @ moved
        if self.measurement.scale_sigma:
            scaled = self.weighed.pull_of_scale(self.linearised) @ self._covariance_at(self.sizes.declared)
            total = total + scaled.T @ scaled
        # Nothing is declared for an unnamed analyser: only the data show how large its errors are.
        if self.measurement.analyser.scales == DECLARED:
            # The solution stays where the declared errors put it; larger ones only move it further.
            off = self.weighed.pulls_of_analyser(self.linearised) @ self._covariance_at(self.sizes.declared)
            total = total + WORSE * off.T @ off
        if self.exchange is not None:
            # The other assignment is about as probable, so that one standard deviation must contain it.
            total = total + np.outer(self.exchange, self.exchange)
        return total

    @cached_property
    def exchange(self) -> FloatArray | None:
        """Difference to the solution with the resonances of winding and frame exchanged; None if the data distinguish them."""
        return other_assignment(self.weighed, self.unknowns)

    def _covariance_at(self, declared: float) -> FloatArray:
        if declared == self.sizes.declared:
            return _inverse(self.linearised.matrix)
        other = self.task.likelihood(None, Sizes(self.sizes.discrepancy, declared))
        return _inverse(other.linearised(self.unknowns).matrix)

    def interval(self, name: str) -> Interval:
        """What values of a parameter the data allow at 95 %, by its profile likelihood."""
        return on_fits.profile(self, name)

    def derived(self) -> list[Derived]:
        """Resonances, quality factors and characteristic impedances with error bars."""
        return on_fits.derived(self)

    def errors(self) -> dict[str, ComplexArray]:
        """Z_model/Z_measured - 1 per termination, the motor's circuit alone."""
        problem = self.problem
        error = np.exp(-problem.deviation(problem.alone(self.unknowns))) - 1
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
            Whether the ant colony searches as well if an error remains from all start values.

        Raises
        ------
        BadInput
            If the effect is unknown or already in the model.
        """
        refuse_other(effect, str, "an effect is a name such as 'eddy-laminations'")
        return on_fits.refit_with(self, effect, held, thorough)

    def drop(self, effect: str | None = None) -> Fit:
        """The fit without an effect (the last one by default), refitted."""
        if effect is not None:
            refuse_other(effect, str, "an effect is a name such as 'eddy-laminations'")
        return on_fits.refit_without(self, effect)

    def to_frame(self) -> pd.DataFrame:
        """A pandas table of the parameters, by name: value, sigma (NaN if held or at a bound), unit, determined, held, at_bound."""
        import pandas as pd

        units = {p.name: p.unit for p in self.motor.parameters}
        rows = {
            name: {
                "value": value,
                "sigma": np.nan if name in self.held or name in self.at_bounds else self.sigma[name],
                "unit": units[name],
                "determined": self.determined(name),
                "held": name in self.held,
                "at_bound": name in self.at_bounds,
            }
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
                    "sigma": None if p.name in self.at_bounds else _finite(self.sigma[p.name]),
                    "unit": p.unit,
                    "low": self.bounds.get(p.name, (p.low, p.high))[0],
                    "high": self.bounds.get(p.name, (p.low, p.high))[1],
                    "determined": self.determined(p.name),
                    "at_bound": p.name in self.at_bounds,
                }
                for p in self.motor.parameters
                if p.name in self.parameters
            },
            "undetermined": self.undetermined(),
            "unseen": self.unseen(),
            "derived": [{"name": d.name, "value": d.value, "sigma": _finite(d.sigma), "unit": d.unit} for d in self.derived()],
            "nuisance": dict(self.nuisance),
            "searched": dict(self.search_parameters),
            "bounds": {name: list(pair) for name, pair in self.bounds.items()},
            "held": dict(self.held),
            "chi2_reduced": self.chi2_reduced,
            "rms_error_percent": self.rms_error_percent,
            "rms_error_db": self.rms_error_db,
            "corrected_error_percent": self.corrected_error_percent,
            "analyser_sigma": self.analyser_sigma,
            "unexplained_percent": self.unexplained_percent,
            "noise_percent": self.noise_percent,
            "floor_percent": self.floor_percent,
            "sizes": {"discrepancy": self.sizes.discrepancy, "declared": self.sizes.declared, **self.marginal.to_dict()},
            "converged": self.converged,
            "evaluations": self.evaluations,
            "elapsed_s": self.elapsed_s,
            "history": [dict(point) for point in self.history],
            "warnings": list(self.warnings),
        }

    def determined(self, name: str) -> bool:
        """Whether the data determine a parameter: its standard deviation is below half its value, and it is not at a bound that was given for it.

        A signed number that may well be none (a coupling) is known where its standard deviation is below a tenth of its range.
        """
        signed = self._signed_ranges.get(name, 0.0)
        return name not in self.at_bounds and bool(self.sigma[name] < max(0.5 * abs(self.parameters[name]), 0.1 * signed))

    @cached_property
    def _signed_ranges(self) -> dict[str, float]:
        """Width of the ranges of signed parameters of which nothing is known beforehand."""
        return {p.name: p.high - p.low for p in self.motor.parameters if p.low < 0 < p.high and p.sigma is None}

    def undetermined(self) -> list[str]:
        """Names of the parameters that the sweeps show and do not determine."""
        return [name for name in self.parameters if not self.determined(name) and name not in self.held and name not in self.at_bounds]

    @cached_property
    def at_bounds(self) -> dict[str, float]:
        """Parameters that are at a bound that was given for them, with that bound: it says so, and not the data."""
        problem, u = self.problem, self.unknowns
        near = EDGE * (problem.high - problem.low)
        at_low, at_high = u <= problem.low + near, u >= problem.high - near
        return {
            p.name: self.bounds[p.name][0 if at_low[index] else 1]
            for index, p in enumerate(problem.unknowns)
            if (at_low[index] or at_high[index]) and self._bound_given(p.name)
        }

    def _bound_given(self, name: str) -> bool:
        """Whether the bounds of a parameter are not the range of an effect, which reaches as far as the sweeps do."""
        label = name.rpartition(".")[0]
        if not label or name not in self.bounds:
            return name in self.bounds
        effect = find_effect(label.partition("#")[0]).effect
        return scaled_ranges(effect, label, self.measurement).get(name) != self.bounds[name]

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
            elif name in self.at_bounds:
                bar = "at its bound"
            elif not self.determined(name):
                bar = "not determined by these data"
            else:
                bar = error_bar(value, self.sigma[name])
            table.append((name, show(value, units[name]), bar))
        return table

    def __repr__(self) -> str:
        model = as_sum(("paper's circuit", *self.effects))
        lines = [
            f"Fit of the {model} ({self.method}, {'converged' if self.converged else 'NOT CONVERGED'})",
            f"  error {percent(self.rms_error_percent)} rms ({self.rms_error_db:.3g} dB); noise and analyser would leave "
            f"{percent(self.floor_percent)}, noise alone {percent(self.noise_percent, 2)}",
            f"  {self.said_of_the_rest}",
            *([f"  {MISSES}"] if self.rms_error_percent >= MUCH_PERCENT and not self.explained else []),
            *(f"  {name:34s} {value:>14s}  {bar}" for name, value, bar in self.rows()),
            *([f"  not in these sweeps: {', '.join(self.unseen())}"] if self.unseen() else []),
            *(f"  note: {warning}" for warning in self.warnings),
        ]
        return "\n".join(lines)

    def another_solution(self) -> str | None:
        """The farthest of the other solutions in words, if there are any: those parameters that are clearly different."""
        if not len(self.alternatives):
            return None
        units = {p.name: p.unit for p in self.motor.parameters}
        values = self.weighed.named(self.unknowns + self.alternatives[0])
        differing = [name for name, own in self.parameters.items() if abs(values[name] - own) > CLEARLY * abs(own)]
        shown = ", ".join(f"{name} {show(values[name], units[name], 3)}" for name in differing)
        return f"other values describe these sweeps about as well, for example {shown}" if shown else None

    @property
    def said_of_the_rest(self) -> str:
        """The undescribed part and the analyser's error, in words."""
        left = self.unexplained_percent
        some = f"undescribed {percent(left['value'], 2)} (95 %: {percent_span(left['low'], left['high'], 2)})"
        rest = some if left["value"] else "nothing else is undescribed"
        if self.measurement.analyser.ideal:
            return rest
        known = "declared" if self.measurement.analyser.named else "expected of an unknown analyser"
        return (
            f"with the analyser's most likely error subtracted {percent(self.corrected_error_percent)} "
            f"({self.analyser_sigma:.1f} sigma of what is {known}); {rest}"
        )

    @property
    def said_of_absorbing(self) -> str:
        """In words, why values are not determined, where that is not for want of data: the misfit may be the analyser's; else empty."""
        loose, known = self.undetermined(), "declared" if self.measurement.analyser.named else "assumed of an unknown one"
        if not loose or self.sizes.declared < ABSORBING:
            return ""
        errors = f"errors of the analyser, {self.sizes.declared:g} times as large as {known}"
        return (
            f"{', '.join(loose)}: the circuit misses these sweeps, and its misfit may also be {errors}; with such errors these values are open. "
            "Look for what is missing, or name the analyser"
        )

    def _repr_html_(self) -> str:
        rows = "".join(f"<tr>{''.join(f'<td>{html.escape(cell)}</td>' for cell in row)}</tr>" for row in self.rows())
        head = html.escape(repr(self).splitlines()[0] + repr(self).splitlines()[1])
        return f"<b>{head}</b><table><tr><th>parameter</th><th>value</th><th>error bar</th></tr>{rows}</table>"

    def plot(self) -> Figure:
        """Both sweeps against the model, with the error below."""
        return figure_of(self)


class OnFits:
    """Functions of higher modules for the methods of `Fit`; those modules register them when the package is imported."""

    refit_with: Callable[[Fit, str, Mapping[str, float] | None, bool], Fit]
    refit_without: Callable[[Fit, str | None], Fit]
    profile: Callable[[Fit, str], Interval]
    alternatives: Callable[[Fit], FloatArray]
    derived: Callable[[Fit], list[Derived]]


on_fits = OnFits()


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def restore(payload: JsonDict, measurement: Measurement) -> Fit:
    """A fit from what `Fit.to_dict` wrote: the stored values and sizes, with errors and intervals computed afresh from the sweeps.

    Raises
    ------
    BadInput
        If it is not such a dictionary, or has an effect that is not in the catalogue.
    """
    _refuse_unknown(payload.get("effects"))
    try:
        motor = add_effects(dc_motor(), [str(effect) for effect in payload["effects"]])
        bounds = {str(name): (float(low), float(high)) for name, (low, high) in payload["bounds"].items()}
        held = {str(name): float(value) for name, value in payload["held"].items()}
        stored = {str(name): float(entry["value"]) for name, entry in payload["parameters"].items()}
        values = _completed(motor, stored)
        nuisance = {str(name): float(value) for name, value in payload["nuisance"].items()}
        searched = {str(name): float(value) for name, value in payload["searched"].items()}
        sizes = Sizes(float(payload["sizes"]["discrepancy"]), float(payload["sizes"]["declared"]))
        found = Marginal.restored(payload["sizes"])
        method, seed, converged = payload["method"], int(payload["seed"]), bool(payload["converged"])
        evaluations, elapsed_s = int(payload["evaluations"]), float(payload["elapsed_s"])
        history = tuple(dict(point) for point in payload["history"])
        warnings = tuple(str(warning) for warning in payload["warnings"])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise BadInput("the stored fit is incomplete: fit the session again") from error
    task = Task(motor, measurement, bounds, {name: value for name, value in values.items() if name in held or name not in stored})
    problem = task.likelihood(None, sizes)
    u = problem.vector({**values, **nuisance})
    solution = Solution(problem.named(u), sizes, found, converged, evaluations)
    result = summarise(task, Found(solution, history, searched), method, seed)
    return dataclasses.replace(result, elapsed_s=elapsed_s, warnings=warnings)


def _refuse_unknown(effects: object) -> None:
    for name in effects if isinstance(effects, list) else ():
        if isinstance(name, str) and name not in identifiers():
            shown = clean_text(name, 60)
            raise BadInput(f"the stored model has the effect {shown!r}, which is not in the catalogue: give its file, --effects-from FILE.py")


def same_error_model(payload: JsonDict, measurement: Measurement) -> bool:
    """Whether a stored fit was made with the error model that these sweeps have now; true if it does not say."""
    analyser = measurement.analyser
    sizes = payload.get("sizes")
    scales = sizes.get("posterior") if isinstance(sizes, dict) else None
    same_sizes = not isinstance(scales, dict) or set(scales) == {str(scale) for scale in scales_of(analyser)}
    return bool(payload.get("analyser", analyser.name) == analyser.name and same_sizes)


def _completed(motor: Motor, stored: Mapping[str, float]) -> dict[str, float]:
    """The values of a fit that an earlier version stored: parameters that laws have been given since, at the value at which they change nothing.

    An effect that the data exclude was held at zero where it is now held at the values at which it vanishes.
    """
    values = dict(stored)
    for parameter in motor.parameters:
        label, _, name = parameter.name.rpartition(".")
        nothing = find_effect(label.partition("#")[0]).effect.limit_values.get(name, 0.0) if label else None
        if parameter.name not in stored and (added := nothing if parameter.special is None else parameter.special) is not None:
            values[parameter.name] = added
        elif nothing is not None and values[parameter.name] == 0:
            values[parameter.name] = nothing
    return values


def summarise(task: Task, found: Found, method: Method, seed: int) -> Fit:
    """A solution with its statistics."""
    solution, measurement = found.solution, task.measurement
    weighed = task.likelihood(None, solution.sizes)
    averaged = measurement.coarse is not measurement
    problem = Problem(task.motor, measurement, task.bounds, task.held, sizes=solution.sizes) if averaged else weighed
    u = problem.vector(solution.values)
    values = problem.named(u)
    own = {p.name for p in problem.motor.parameters}
    alone = problem.deviation(problem.alone(u))
    plain_percent = _rms_percent(np.exp(-alone) - 1)
    strict = task.likelihood(None, AS_DECLARED)
    # Averages say nothing of how their points scatter, which is of no model.
    pairs = zip(measurement.sweeps, measurement.noise, strict=True)
    left = problem.deviation(u) if averaged else alone
    steps_hz, where = measurement.analyser.step_frequencies_hz, problem.observed.slices
    scatter = sum(scatter_in_bins(sweep, noise, steps_hz, left[where[sweep.termination]]) for sweep, noise in pairs)
    warnings = list(measurement.caveats())
    if not solution.converged and method != "paper":
        warnings.append("the fit did not converge: do not use its values")
    # A model that has nothing in common with the data may need errors of the analyser without bounds.
    with np.errstate(over="ignore"):
        corrected_percent = _rms_percent(np.exp(-weighed.less_allowed_error(u, problem if averaged else None)) - 1)
    result = Fit(
        motor=problem.motor,
        measurement=measurement,
        method=method,
        seed=seed,
        parameters={p.name: values[p.name] for p in problem.motor.parameters if p.name in values},
        local_sigma={},
        nuisance={name: value for name, value in values.items() if name not in own},
        chi2_reduced=(float(strict.objective(strict.vector(values))) + scatter) / (strict.degrees_of_freedom + 2 * (problem.size - strict.size)),
        rms_error_percent=plain_percent,
        rms_error_db=float(20 / np.log(10) * np.sqrt(np.mean(alone.real**2))),
        corrected_error_percent=min(plain_percent, corrected_percent),
        analyser_sigma=weighed.analyser_sigma(u),
        noise_percent=measurement.noise_percent,
        floor_percent=measurement.floor_percent,
        sizes=solution.sizes,
        marginal=solution.marginal,
        converged=solution.converged,
        evaluations=solution.evaluations,
        elapsed_s=0.0,
        history=found.history,
        warnings=tuple(warnings),
        bounds=problem.bounds,
        held=problem.held,
        search_parameters=found.searched,
        likeliest_parameters=solution.likeliest,
    )
    return _with_sigma(result, problem)


def _with_sigma(result: Fit, problem: Problem) -> Fit:
    """With the standard deviations, which follow from the covariance."""
    warnings = result.warnings if result.exchange is None else (*result.warnings, EXCHANGEABLE)
    units = {p.name: p.unit for p in problem.unknowns}
    warnings += tuple(
        f"{name} is at its bound, {show(bound, units[name])}: this value is not measured, and the others depend on it; fit with wider bounds"
        for name, bound in result.at_bounds.items()
    )
    return dataclasses.replace(result, local_sigma=_in_si(result, result.local_covariance), warnings=warnings)


def _in_si(fit: Fit, covariance: FloatArray) -> dict[str, float]:
    """Standard deviations of the parameters in SI units; 0 of one that is held."""
    problem, deviations = fit.problem, np.sqrt(np.diag(covariance))
    sigma: dict[str, float] = dict.fromkeys(fit.parameters, 0.0)
    for index, parameter in enumerate(problem.unknowns):
        if parameter.name in sigma:
            unit = fit.parameters[parameter.name] if parameter.scale == "log" else problem.vector_scale(index)
            sigma[parameter.name] = float(abs(unit) * deviations[index])
    return sigma


def _rms_percent(error: ComplexArray) -> float:
    return float(100 * np.sqrt(np.mean(np.abs(error) ** 2)))


def _inverse(matrix: FloatArray) -> FloatArray:
    """Covariance from the Gauss-Newton matrix; very large along directions that the data leave open."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    values, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
    return (vectors / np.maximum(values, 1e-14)) @ vectors.T / np.outer(scale, scale)
