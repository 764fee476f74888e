"""`fit`: from sweeps to a circuit with error bars."""

from __future__ import annotations

import dataclasses
import html
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.data.measurement import Measurement
from motoremi.data.sweep import ImpedanceSweep
from motoremi.errors import BadInput
from motoremi.fit.colony import Colony
from motoremi.fit.paper import paper_colony
from motoremi.fit.polish import Polished, polish
from motoremi.fit.problem import Problem, checked_bounds
from motoremi.fit.starts import data_driven_starts
from motoremi.model.effects import add_effects, find_effect
from motoremi.model.motor import BASE_PARAMETERS, Motor, dc_motor
from motoremi.quantities import show

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Method: TypeAlias = Literal["ant-colony", "paper"]
METHODS: tuple[Method, ...] = ("ant-colony", "paper")
# Points a sweep for searching; the final polish uses all.
SEARCH_POINTS = 48
EFFECT_POINTS = 80
FIRST_STEPS = 7
FOLLOWED = 6
GENERATIONS = 12
ROUGH = {"tolerance": 1e-7, "relative": 1e-4}
ROUNDS = 3


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
    def unknowns(self) -> FloatArray:
        """The solution as the problem's vector."""
        return self.problem.vector({**self.parameters, **self.nuisance})

    @property
    def effects(self) -> tuple[str, ...]:
        """Effects in the model."""
        return self.motor.effects

    def model_ohm(self, termination: str, frequency_hz: FloatArray | None = None) -> ComplexArray:
        """Impedance of the motor alone in ohm, without the analyser's errors, at the measured or other frequencies."""
        from motoremi.model.circuit import Tape

        if frequency_hz is None:
            frequency_hz = next(s.frequency_hz for s in self.measurement.sweeps if s.termination == termination)
        motor_parameters = [p for p in self.motor.parameters if p.name in self.motor.used_parameters(termination)]
        values = np.array([self.parameters.get(p.name, p.middle) for p in motor_parameters])
        tape = Tape(self.motor.circuit(termination), [p.name for p in motor_parameters])
        return tape.impedance(2j * np.pi * np.asarray(frequency_hz), values)

    def errors(self) -> dict[str, ComplexArray]:
        """Z_model/Z_measured - 1 per termination, the analyser's most likely error included."""
        problem = self.problem
        left = problem.deviation(self.unknowns) - problem.gain_error(self.unknowns)
        error = np.exp(-left) - 1
        return {termination: error[where] for termination, where in problem.slices.items()}

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
        return refit_with(self, effect, held, thorough=thorough)

    def drop(self, effect: str | None = None) -> Fit:
        """The fit without an effect (the last one by default), refitted."""
        if not self.effects:
            raise BadInput("the model is the paper's circuit: there is no effect to drop")
        gone = effect if effect is not None else self.effects[-1]
        find_effect(gone)
        if gone not in self.effects:
            raise BadInput(f"{gone} is not in the model; it has {', '.join(self.effects)}")
        kept = list(self.effects)
        del kept[len(kept) - 1 - kept[::-1].index(gone)]
        motor = add_effects(dc_motor(), kept)
        names = {p.name for p in motor.parameters}
        held = {name: value for name, value in self.held.items() if name in names}
        return _finish(
            motor, self.measurement, self, [dict(self.parameters)], {n: b for n, b in self.bounds.items() if n in names}, held
        )

    def to_dict(self) -> JsonDict:
        """Plain data, SI units."""
        return {
            "schema": "motoremi.fit/1",
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
            "nuisance": dict(self.nuisance),
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
        """Names of the parameters that the data do not determine."""
        return [name for name in self.parameters if not self.determined(name) and name not in self.held]

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
        return table

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


def fit(
    model: Motor | None,
    sweeps: Iterable[ImpedanceSweep] | Measurement,
    *,
    seed: int = 1,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    method: str = "ant-colony",
    analyser: str | None = None,
    held: Mapping[str, float] | None = None,
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
        Whose systematic errors to allow for: `4294a` (default), `e4990a`, `nanovna`, `none`.
    held : mapping, optional
        Parameters that are not fitted, in SI units: for example Ra from a DC measurement.

    Returns
    -------
    Fit

    Raises
    ------
    BadInput
        For sweeps, bounds or names that cannot be used.
    """
    started = time.perf_counter()
    motor = model if model is not None else dc_motor()
    if method not in METHODS:
        raise BadInput(f"unknown method {method!r}: use one of {', '.join(METHODS)}")
    measurement = sweeps if isinstance(sweeps, Measurement) else Measurement.of(sweeps, analyser)
    _check_informative(measurement)
    limits, fixed = checked_bounds(motor, bounds), _checked_held(motor, held)
    base = dc_motor()
    paper_names = {p.name for p in BASE_PARAMETERS}
    base_bounds = {n: b for n, b in limits.items() if n in paper_names}
    base_held = {n: v for n, v in fixed.items() if n in paper_names}
    if method == "paper":
        result = _by_the_paper(base, measurement, seed, base_bounds, base_held)
    else:
        result = _by_ants(base, measurement, seed, base_bounds, base_held)
    for effect in motor.effects:
        result = refit_with(result, effect, {n: v for n, v in fixed.items() if n.startswith(effect)}, limits)
    return dataclasses.replace(result, elapsed_s=time.perf_counter() - started)


def _checked_held(motor: Motor, held: Mapping[str, float] | None) -> dict[str, float]:
    names = {p.name for p in motor.parameters}
    for name, value in (held or {}).items():
        if name not in names:
            raise BadInput(f"held value for the unknown parameter {name!r}; the model has {', '.join(sorted(names))}")
        if not np.isfinite(value):
            raise BadInput(f"held value of {name} is not a finite number")
    return {name: float(value) for name, value in (held or {}).items()}


def _check_informative(measurement: Measurement) -> None:
    for sweep in measurement.sweeps:
        magnitude = np.abs(sweep.mean_ohm)
        if np.ptp(magnitude) < 1e-9 * magnitude.max() and np.ptp(np.angle(sweep.mean_ohm)) < 1e-9:
            raise BadInput(f"the {sweep.termination} sweep is the same at all frequencies: this is not a motor's impedance")


def _by_ants(
    motor: Motor, measurement: Measurement, seed: int, bounds: Mapping[str, tuple[float, float]], held: Mapping[str, float]
) -> Fit:
    """Ants on a thinned grid, the best and most different polished, the winner polished on all points."""
    search = Problem(motor, measurement, bounds, held, points=SEARCH_POINTS, weights="log")
    full = Problem(motor, measurement, bounds, held)
    known = [search.vector(start) for start in data_driven_starts(measurement)]
    seeds = np.array(known).reshape(-1, len(search.unknowns))
    evaluations, history = 0, []
    best: Polished | None = None
    colony: Colony | None = None
    searched: dict[str, float] = {}
    searched_objective = np.inf
    for round_number in range(ROUNDS + 1):
        if round_number == 0:
            if not len(seeds):
                continue
            candidates = seeds
        else:
            if colony is None:
                colony = Colony(search, np.random.default_rng(seed), seeds)
                evaluations += colony.evaluations
            before = colony.evaluations
            curve = colony.walk(GENERATIONS)
            evaluations += colony.evaluations - before
            step = (colony.evaluations - before) // GENERATIONS
            first = evaluations - (colony.evaluations - before)
            history += [
                {"evaluations": first + step * (i + 1), "rms_deviation_percent": 100 * np.sqrt(c)} for i, c in enumerate(curve)
            ]
            candidates = colony.different(8)
        rough = polish(search, candidates, iterations=40, **ROUGH)
        evaluations += rough.evaluations
        if rough.objective[rough.best] < 0.999 * searched_objective:
            order = np.argsort(rough.objective)[:2]
            searched, searched_objective = search.named(rough.u[order[0]]), float(rough.objective[order[0]])
            final = polish(full, np.array([full.vector(search.named(u)) for u in rough.u[order]]), iterations=80)
            evaluations += final.evaluations
            if best is None or final.objective[final.best] < best.objective[best.best]:
                best = final
        assert best is not None
        reached = best.objective[best.best] / full.degrees_of_freedom
        history.append(
            {
                "evaluations": evaluations,
                "rms_deviation_percent": 100 * float(np.sqrt(np.mean(np.abs(full.deviation(best.u[best.best])) ** 2))),
            }
        )
        if reached < _good_enough(full):
            break
    assert best is not None
    return _summary(
        full, best.u[best.best], bool(best.converged[best.best]), "ant-colony", seed, evaluations, tuple(history), bounds, held
    )


def _good_enough(problem: Problem) -> float:
    """A reduced chi-squared that only the right valley reaches: five standard deviations above one, and noise itself uncertain by 10 %."""
    return 1.1 + 5 * float(np.sqrt(2 / problem.degrees_of_freedom))


def _by_the_paper(
    motor: Motor, measurement: Measurement, seed: int, bounds: Mapping[str, tuple[float, float]], held: Mapping[str, float]
) -> Fit:
    search = Problem(motor, measurement, bounds, held, weights="log")
    full = Problem(motor, measurement, bounds, held)
    outcome = paper_colony(search, np.random.default_rng(seed))
    result = _summary(
        full,
        full.vector(search.named(outcome.u)),
        outcome.converged,
        "paper",
        seed,
        outcome.evaluations,
        outcome.history,
        bounds,
        held,
    )
    remark = (
        f"the paper's colony met its stop rule (deviation {outcome.deviation:.3g} <= 0.1)"
        if outcome.converged
        else f"the paper's colony did not meet its stop rule: deviation {outcome.deviation:.3g}, wanted 0.1"
    )
    return dataclasses.replace(result, warnings=(*result.warnings, remark))


def refit_with(
    before: Fit,
    effect: str,
    held: Mapping[str, float] | None = None,
    limits: Mapping[str, tuple[float, float]] | None = None,
    thorough: bool = True,
) -> Fit:
    """Add an effect to a fitted motor and fit again, from several start values of the effect."""
    added = find_effect(effect)
    label = added.label_in(before.motor)
    motor = added.added_to(before.motor)
    names = {p.name for p in motor.parameters}
    fixed = {**before.held, **(held or {})}
    if any(not p.vary for p in added.effect.parameters) and not any(name.startswith(label) for name in fixed):
        fixed.update(_scanned_step(before, label))
    bounds = {name: b for name, b in {**before.bounds, **(limits or {})}.items() if name in names}
    starts = [
        {**base, **{f"{label}.{k}": v for k, v in start.items()}}
        for start in added.effect.starts
        for base in _bases(before, few=len(added.effect.starts) > 8)
    ]
    return _finish(motor, before.measurement, before, starts, bounds, fixed, thorough)


def _bases(before: Fit, few: bool) -> list[dict[str, float]]:
    """Values of the elements to start an effect from.

    A model that lacks an effect bends its elements, so besides the fit itself there are the values that the data give away (the frame's
    from the difference of the two sweeps, which no effect in the winding touches), and Ra without the losses that it had to carry.
    """
    searched = {**before.parameters, **before.search_parameters}
    bases = [searched, *({**searched, **start} for start in data_driven_starts(before.measurement)[-1:])]
    return bases if few else [{**base, "Ra": base.get("Ra", 1.0) * ra} for base in bases for ra in (1.0, 0.1)]


def _scanned_step(before: Fit, label: str) -> dict[str, float]:
    """The frequency at which a step of gain would explain most, over all points."""
    problem = before.problem
    white = problem.deviation(before.unknowns) - problem.gain_error(before.unknowns)
    sigma = np.concatenate([noise.sigma for noise in before.measurement.noise])
    frequency = problem.frequency_hz
    candidates = np.unique(frequency)[2:-2]
    gains = []
    for f in candidates:
        # A step is seen in the change between the few points on either side, in every sweep that covers it.
        near = np.abs(np.log(frequency / f)) < 0.15
        above, below = near & (frequency >= f), near & (frequency < f)
        if above.sum() < 2 or below.sum() < 2:
            gains.append(0.0)
            continue
        jump = np.mean(white[above]) - np.mean(white[below])
        variance = np.mean(sigma[near] ** 2) * (1 / above.sum() + 1 / below.sum())
        gains.append(abs(jump) ** 2 / variance)
    return {f"{label}.frequency_hz": float(candidates[int(np.argmax(gains))])}


def _finish(
    motor: Motor,
    measurement: Measurement,
    before: Fit,
    starts: Sequence[Mapping[str, float]],
    bounds: Mapping[str, tuple[float, float]],
    held: Mapping[str, float],
    thorough: bool = True,
) -> Fit:
    """Search from several starts on a thinned grid, then polish the best on all points."""
    started = time.perf_counter()
    full = Problem(motor, measurement, bounds, held)
    search = Problem(motor, measurement, bounds, held, points=EFFECT_POINTS, weights="log")
    first = np.array([search.vector(start) for start in starts])
    # Successive halving: a few steps tell the hopeless starts, and only the best are followed.
    found = polish(search, first, iterations=FIRST_STEPS, **ROUGH)
    found = polish(search, found.u[np.argsort(found.objective)[:FOLLOWED]], iterations=40, **ROUGH)
    good = 3 * search.expected_objective
    if found.objective[found.best] > good:
        found = found.joined(_climb(search, first))
    if thorough and found.objective[found.best] > good:
        colony = Colony(search, np.random.default_rng(before.seed), first)
        colony.walk(GENERATIONS)
        found = found.joined(polish(search, colony.different(10), iterations=40, **ROUGH))
    order = np.argsort(found.objective)[:2]
    final = polish(full, np.array([full.vector(search.named(u)) for u in found.u[order]]))
    best = final.best
    evaluations = found.evaluations + final.evaluations
    result = _summary(
        full, final.u[best], bool(final.converged[best]), before.method, before.seed, evaluations, before.history, bounds, held
    )
    return dataclasses.replace(result, elapsed_s=time.perf_counter() - started, search_parameters=search.named(found.u[order[0]]))


def _climb(search: Problem, starts: FloatArray) -> Polished:
    """Fit the low end of the band first and raise its upper edge: a wrong resonance higher up cannot mislead what it does not reach."""
    lowest, highest = float(search.frequency_hz.min()), float(search.frequency_hz.max())
    u, evaluations = starts, 0
    for share in (0.36, 0.5, 0.63, 0.75, 0.88):
        part = Problem(
            search.motor,
            search.measurement,
            search.bounds,
            search.held,
            points=60,
            weights="log",
            highest_hz=lowest * (highest / lowest) ** share,
        )
        stage = polish(part, u, iterations=25, tolerance=1e-6, relative=1e-3)
        evaluations += stage.evaluations
        u = stage.u[np.argsort(stage.objective)[: max(FOLLOWED, len(u) // 2)]]
    last = polish(search, u, iterations=40, **ROUGH)
    return dataclasses.replace(last, evaluations=last.evaluations + evaluations)


def _summary(
    problem: Problem,
    u: FloatArray,
    converged: bool,
    method: Method,
    seed: int,
    evaluations: int,
    history: tuple[JsonDict, ...],
    bounds: Mapping[str, tuple[float, float]],
    held: Mapping[str, float],
) -> Fit:
    """A solution with its statistics."""
    here = problem.linearised(u)
    objective, matrix = here.objective, here.matrix
    chi2_reduced = float(objective) / problem.degrees_of_freedom
    deviations = _standard_deviations(matrix) * max(1.0, np.sqrt(chi2_reduced))
    values = problem.named(u)
    own = {p.name for p in problem.motor.parameters}
    sigma: dict[str, float] = dict.fromkeys(own & values.keys(), 0.0)
    for index, parameter in enumerate(problem.unknowns):
        if parameter.name in own:
            unit = values[parameter.name] if parameter.scale == "log" else problem.vector_scale(index)
            sigma[parameter.name] = float(abs(unit) * deviations[index])
    left = problem.deviation(u) - problem.gain_error(u)
    error = np.abs(np.exp(-left) - 1)
    alone = _motor_alone(problem, u)
    warnings = list(problem.measurement.caveats())
    if not converged and method != "paper":
        warnings.append("the fit did not converge: do not use its values")
    return Fit(
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
        bounds=dict(bounds),
        held=dict(held),
        objective=float(objective),
        log_evidence=_log_evidence(problem, float(objective), matrix),
    )


def _motor_alone(problem: Problem, u: FloatArray) -> Any:
    own = np.array([p.sigma is None or "connection" not in p.name for p in problem.unknowns])
    return np.exp(-problem.deviation(np.where(own, u, 0.0))) - 1


def _standard_deviations(matrix: FloatArray) -> FloatArray:
    """Square roots of the diagonal of the inverse; infinite along directions that the data leave open."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    values, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
    usable = np.maximum(values, 1e-14)
    deviation: FloatArray = np.sqrt(np.sum(vectors**2 / usable, axis=1)) / scale
    return deviation


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
