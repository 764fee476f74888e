"""The smallest error that a linear, time-invariant, causal one-port can reach: a vector fit of each sweep, without any circuit.

It answers two questions. Which error could a model with the right physics reach where the catalogue fails? And can the data come from a
fixed linear circuit at all? Drift within a sweep, sweeps joined from several runs and outliers cannot, and no circuit will fit them.
If a known circuit has a smaller error than the vector fit, the vector fit has failed and proves nothing.

Lin-KK tools answer the second question wrongly for motors, because their R-C chains have real poles only. The fit is made on the reflection
coefficient S = (Z - z0) / (Z + z0), whose magnitude is at most 1 for a passive part; scikit-rf's vector fitting finds the poles, and a
least-squares fit then weights the points by their noise. Orders are compared by BIC.
"""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from motoremi.arrays import BoolArray, ComplexArray, FloatArray, JsonDict
from motoremi.data.covariance import orthonormal
from motoremi.data.measurement import Measurement
from motoremi.fitting.observed import observed
from motoremi.fitting.problem import AS_DECLARED
from motoremi.inspection.compare import spans_of
from motoremi.quantities import percent, show_band
from motoremi.threads import one_blas_thread

# Pairs of complex poles tried; a motor with a diffusion and a few resonances needs about eight.
MOST_PAIRS = 12
MOST_POLES = 2 * MOST_PAIRS + 1
# Largest number of points of a sweep that are used: a model with 25 poles does not gain from more.
POINTS = 401
# Orders that may fail to improve in a row before the search ends.
PATIENCE = 2
# Chi-squared per degree of freedom beyond which the data are not those of a fixed linear circuit. Noise from three repeats is known to
# about 10 %, so its square to 20 %; smooth errors of the analyser are marginalised.
NOT_CAUSAL = 1.6
# Poles lie within a factor exp(20) of the sweep's middle: nine decades either way.
FARTHEST = 20.0
# Half width of the narrowest resonance in steps between points: a narrower one cannot be distinguished from an outlier.
NARROWEST = 0.5
# Narrower resonances than this, in the same steps, may be outliers: the fit is repeated without the point at their top.
SUSPECT = 1.5
# If the error of the causal model is below this share of the closest circuit's error, the circuit lacks physics, even if the causal model does
# not reach the noise: the noise of a single sweep is only estimated from its scatter, and a few points that stand out by 0.1 %, where the analyser
# switches ranges, are not why a circuit misses by 60 %.
SMALL_REST = 0.5
# Largest error of a causal model that says nothing of the data, in per cent: the best impedance analysers (4294A, E4990A) are specified to 0.08 %,
# and where they switch ranges they may step by as much. In five of five motors of another generator, with such steps, the data were not at fault.
ACCURACY_PERCENT = 0.08
# The same of analysers that may err by more, as a share of that: their errors have fine structure too. Of a wound core on a NanoVNA, which may err
# by 5 % there, a causal model left 0.13 %. More than a tenth of 10 % is no fine structure.
FINE_SHARE, MOST_ERRING = 0.1, 0.1
# Width in points of the window in which a remainder is located, and the multiple of the noise's variance that it must exceed there:
# the mean over 9 complex points scatters by a third, and noise alone exceeds this in about one of 1000 sweeps of 400 points.
WINDOW = 9
REMAINDER = 3.5
# Number of standard uncertainties by which a resistance may be negative in a passive model.
NEGATIVE = 4.0
# A single point that deviates by this many standard deviations is an outlier, not noise: one chance in 1e9 for Gaussian noise and 1000 points.
OUTLIER = 7.0
# If more than this share of the points deviate that much, they do not count as outliers.
MOST_OUTLIERS = 0.05


@dataclass(frozen=True, eq=False)
class CausalModel:
    """The best rational one-port for one sweep.

    Parameters
    ----------
    termination : str
    reference_ohm : float
        z0 of its reflection coefficient.
    poles, residues : ndarray, shape (order,)
        In 1/s; complex ones stand for themselves and their conjugate. All poles lie in the left half plane.
    constant : float
        Reflection coefficient at infinite frequency.
    order : int
        Number of poles, conjugates counted.
    chi2_reduced, chi2_without_outliers : float
        Over random noise, with the analyser's smooth errors as declared marginalised.
    rms_error_percent : float
        Of Z_model/Z_measured; the model holds the analyser's most likely smooth error.
    accuracy_percent : float
        Largest such error that says nothing of the data.
    passive : bool
        Whether Re Z >= 0 within the sweep, as far as the measurement can tell.
    remainder_hz : tuple of pair
        Spans in which it does not describe the data.
    outliers_hz : tuple of float
        Single points far off.
    """

    termination: str
    reference_ohm: float
    poles: ComplexArray
    residues: ComplexArray
    constant: float
    order: int
    chi2_reduced: float
    chi2_without_outliers: float
    rms_error_percent: float
    accuracy_percent: float
    passive: bool
    remainder_hz: tuple[tuple[float, float], ...]
    outliers_hz: tuple[float, ...]

    @property
    def noise_multiple(self) -> float:
        """Its error in multiples of the random noise, with the analyser's smooth errors marginalised."""
        return float(np.sqrt(self.chi2_reduced))

    @property
    def describes_the_data(self) -> bool:
        """Whether a fixed linear circuit explains the sweep."""
        return self.reaches_the_noise and not self.outliers_hz

    @property
    def reaches_the_noise(self) -> bool:
        """Whether a fixed linear circuit explains the sweep, single points that stand out included."""
        return self.chi2_reduced < NOT_CAUSAL

    @property
    def ended_at_most_poles(self) -> bool:
        """Whether the search ended at the largest number of poles, which proves nothing: a machine may have more resonances."""
        return self.order >= MOST_POLES

    @property
    def only_outliers(self) -> bool:
        """Whether a fixed linear circuit explains all but single points."""
        return self.chi2_without_outliers < NOT_CAUSAL and not self.describes_the_data

    def impedance_ohm(self, frequency_hz: FloatArray) -> ComplexArray:
        """Impedance in ohm."""
        s: ComplexArray = np.asarray(2j * np.pi * np.asarray(frequency_hz, dtype=np.float64), dtype=np.complex128)
        reflection = self.constant + _columns(s, self.poles) @ _stacked(self.residues, self.poles)
        return self.reference_ohm * (1 + reflection) / (1 - reflection)

    def resonances(self) -> list[tuple[complex, complex]]:
        """Poles of the impedance in the upper half plane, in 1/s, and their residues, in ohm/s: the solutions of S = 1."""
        poles = np.concatenate([self.poles, self.poles[self.poles.imag > 0].conj()])
        residues = np.concatenate([self.residues, self.residues[self.poles.imag > 0].conj()])
        own = np.linalg.eigvals(np.diag(poles) + np.outer(np.ones_like(poles), residues) / (1 - self.constant))
        return [(complex(p), complex(2 * self.reference_ohm / np.sum(residues / (p - poles) ** 2))) for p in own if p.imag > 1e-6 * abs(p)]

    def to_dict(self) -> JsonDict:
        """Plain data."""
        return {
            "sweep": self.termination,
            "order": self.order,
            "chi2_reduced": self.chi2_reduced,
            "noise_multiple": self.noise_multiple,
            "rms_error_percent": self.rms_error_percent,
            "passive": self.passive,
            "describes_the_data": self.describes_the_data,
            "remainder_hz": [list(span) for span in self.remainder_hz],
            "outliers_hz": list(self.outliers_hz),
        }


@dataclass(frozen=True, eq=False)
class CausalCheck:
    """Whether the sweeps can come from fixed linear circuits, and the error that such circuits reach. Immutable.

    Parameters
    ----------
    models : dict
        Termination -> CausalModel.
    reached : dict
        Termination -> error of the best circuit known so far, in multiples of the noise. A causal model with a larger error proves nothing.
    """

    models: dict[str, CausalModel]
    reached: Mapping[str, float] = field(default_factory=dict)

    @property
    def causal(self) -> bool:
        """Whether a fixed linear circuit explains each sweep."""
        return all(model.describes_the_data for model in self.models.values())

    @property
    def needs_more_poles(self) -> bool:
        """Whether a causal model of the most poles misses a sweep by more than any analyser errs: it has more resonances."""
        return any(model.ended_at_most_poles and model.rms_error_percent > 100 * MOST_ERRING for model in self.models.values())

    @property
    def disproved(self) -> bool:
        """Whether no fixed linear circuit can explain at least one of the sweeps."""
        return any(self._disproves(termination) for termination in self.models)

    def _disproves(self, termination: str) -> bool:
        model = self.models[termination]
        reached = self.reached.get(termination)
        # Single points that do not raise the error above the noise are not what the closest circuit lacks.
        small = reached is not None and (model.noise_multiple <= SMALL_REST * reached or model.reaches_the_noise or _within_accuracy(model))
        if model.describes_the_data or small:
            return False
        return model.only_outliers or ((reached is None or model.noise_multiple < reached) and not model.ended_at_most_poles)

    @property
    def reasons(self) -> tuple[str, ...]:
        """The finding in words, one sentence for each sweep that has one."""
        if self.causal:
            reached = ", ".join(f"{t} {percent(m.rms_error_percent, 2)} with {m.order} poles" for t, m in self.models.items())
            return (f"an unrestricted causal model reaches the noise ({reached}): the physics is missing, not the quality of the data",)
        return tuple(self._reason(termination, model) for termination, model in self.models.items() if not model.describes_the_data)

    def _reason(self, termination: str, model: CausalModel) -> str:
        return _trouble(model) if model.reaches_the_noise or self._disproves(termination) else _nothing_shown(model, self.reached.get(termination))

    def to_dict(self) -> JsonDict:
        """Plain data."""
        return {
            "schema": "motoremi.causality/1",
            "causal": self.causal,
            "disproved": self.disproved,
            "sweeps": [model.to_dict() for model in self.models.values()],
            "reasons": list(self.reasons),
        }

    def __repr__(self) -> str:
        if self.disproved:
            head = "NO fixed linear circuit explains these sweeps"
        else:
            head = f"a fixed linear circuit {'can' if self.causal else 'may'} explain these sweeps"
        return "\n".join([head, *(f"  {reason}" for reason in self.reasons)])


def _within_accuracy(model: CausalModel) -> bool:
    return model.rms_error_percent <= model.accuracy_percent


def _trouble(model: CausalModel) -> str:
    if model.only_outliers:
        where = ", ".join(f"{frequency:.4g} Hz" for frequency in model.outliers_hz[:4])
        return f"the {model.termination} sweep has outliers at {where}: measure it again or take these points out"
    spans = ", ".join(show_band(*span) for span in model.remainder_hz[:3]) or "the whole sweep"
    return (
        f"no fixed linear circuit of up to {MOST_POLES} poles describes the {model.termination} sweep (best causal model: error "
        f"{percent(model.rms_error_percent, 2)}, chi2_reduced {model.chi2_reduced:.3g}, worst in {spans}): look for drift during the sweep, "
        "a range switch, sweeps put together from several runs, or outliers before looking for physics"
    )


def _nothing_shown(model: CausalModel, reached: float | None) -> str:
    if reached is not None and model.noise_multiple <= SMALL_REST * reached:
        return (
            f"a causal model of the {model.termination} sweep leaves {model.noise_multiple:.2g} times the noise (error "
            f"{percent(model.rms_error_percent, 2)}), the closest circuit {reached:.3g} times: physics is most of what is missing"
        )
    if reached is not None and _within_accuracy(model):
        return (
            f"a causal model of the {model.termination} sweep leaves {model.noise_multiple:.2g} times the noise, but an error of only "
            f"{percent(model.rms_error_percent, 2)}, which range switches or fine structure of the analyser's errors may leave: it shows nothing "
            "about the data"
        )
    ended = f"the search for a causal model of the {model.termination} sweep ended at {model.noise_multiple:.2g} times the noise"
    where = (
        f", where a circuit reaches {reached:.2g} times"
        if reached is not None and reached <= model.noise_multiple
        else f" with {model.order} poles"
    )
    return f"{ended}{where}: it shows nothing about the data"


@one_blas_thread
def check_causality(measurement: Measurement, reached: Mapping[str, float] | None = None) -> CausalCheck:
    """Vector-fit each sweep alone.

    Parameters
    ----------
    measurement : Measurement
    reached : mapping, optional
        Termination -> error of the best circuit known so far, in multiples of the noise.

    Returns
    -------
    CausalCheck
    """
    models: dict[str, CausalModel] = {sweep.termination: _fitted(alone(measurement.coarse, sweep.termination)) for sweep in measurement.sweeps}
    return CausalCheck(models, dict(reached or {}))


def alone(measurement: Measurement, termination: str) -> Measurement:
    """The measurement with one of its sweeps only."""
    index = measurement.terminations.index(termination)
    return dataclasses.replace(measurement, sweeps=(measurement.sweeps[index],), noise=(measurement.noise[index],))


@dataclass(frozen=True)
class _Task:
    """One sweep as a least-squares problem in S, frequencies in units of their geometric mean.

    Correlated noise and the analyser's errors lie along the orthonormal `directions`, shape (n, q); whitening removes the share `taken` of a
    residual along each of them.
    """

    s: ComplexArray
    reflection: ComplexArray
    weight: ComplexArray
    directions: ComplexArray
    taken: FloatArray

    def subset(self, keep: BoolArray) -> _Task:
        """The problem with some of its points; without a few of them the directions remain nearly orthogonal."""
        return _Task(self.s[keep], self.reflection[keep], self.weight[keep], self.directions[keep], self.taken)

    def whitened(self, columns: ComplexArray) -> ComplexArray:
        """Columns weighted by the noise, without the part that correlated noise and the analyser's smooth errors explain; shape (n, ...)."""
        weighted = (columns.T * self.weight).T
        along = self.directions.conj().T @ weighted
        return weighted - self.directions @ (along.T * self.taken).T


def _fitted(measurement: Measurement) -> CausalModel:
    seen = observed(measurement, POINTS, "likelihood", np.inf)
    sweep = seen.sweeps[0]
    measured: ComplexArray = sweep.measured
    reference = float(np.exp(np.mean(np.log(np.abs(measured)))))
    unit = float(2 * np.pi * np.exp(np.mean(np.log(sweep.frequency_hz))))
    reflection: ComplexArray = np.asarray((measured - reference) / (measured + reference), dtype=np.complex128)
    directions, shares = orthonormal(seen.columns.whitening(AS_DECLARED.declared).directions(0.0))
    # To first order the deviation of ln Z is that of S times 2 / (1 - S^2).
    s: ComplexArray = sweep.s / unit
    weight: ComplexArray = 2 / (1 - reflection**2) / sweep.sigma
    task = _Task(s, reflection, weight, directions, 1 - np.sqrt(np.maximum(1 - shares, 0.0)))
    score, poles, coefficients = _best_order(task, unit, reference)
    suspects = _narrow(task, poles)
    if suspects.any():
        # A resonance as narrow as the step between points may be a single bad point: it is left out if that lowers the BIC, in which a point left
        # out counts as two parameters.
        left_out, fewer, without = _best_order(task.subset(~suspects), unit, reference)
        if left_out + 2 * np.count_nonzero(suspects) * np.log(2 * s.size) < score:
            poles, coefficients = fewer, without
    residues = _unstacked(coefficients[:-1], poles)
    constant = float(coefficients[-1])
    modelled = constant + _columns(task.s, poles) @ coefficients[:-1]
    white = task.whitened(reflection - modelled)
    deviation = np.log(measured * (1 - modelled) / (reference * (1 + modelled)))
    # The most likely error of the analyser does not count as an error of the model.
    errors = seen.columns.analyser * AS_DECLARED.declared
    weighted = deviation / sweep.sigma
    pulled = weighted - directions @ (shares * (directions.conj().T @ weighted))
    left = deviation - errors @ (errors.conj().T @ (pulled / sweep.sigma))
    order = _order(poles)
    impedance = reference * (1 + modelled) / (1 - modelled)
    uncertainty = np.hypot(np.sqrt(sweep.part.noise.variance[sweep.part.chosen]), measurement.analyser.uncertainty(sweep.frequency_hz, measured))
    outlying = np.abs(white) > OUTLIER
    square = np.abs(white) ** 2
    freedom = np.maximum(2 * np.array([white.size, white.size - np.count_nonzero(outlying)]) - 2 * order - 1, 1)
    fine = FINE_SHARE * min(float(np.median(measurement.floors[0])), MOST_ERRING)
    return CausalModel(
        termination=sweep.termination,
        reference_ohm=reference,
        poles=poles * unit,
        residues=residues * unit,
        constant=constant,
        order=order,
        chi2_reduced=float(np.sum(square) / freedom[0]),
        chi2_without_outliers=float(np.sum(square[~outlying]) / freedom[1]) if np.mean(outlying) <= MOST_OUTLIERS else np.inf,
        rms_error_percent=float(100 * np.sqrt(np.mean(np.abs(np.exp(-left) - 1) ** 2))),
        accuracy_percent=max(ACCURACY_PERCENT, 100 * fine, measurement.accuracy_percent or 0.0),
        passive=bool(np.all(impedance.real >= -NEGATIVE * uncertainty * np.abs(impedance))),
        remainder_hz=tuple((low, high) for low, high in spans_of(sweep.frequency_hz, smoothed(white) > REMAINDER)),
        outliers_hz=tuple(float(f) for f in sweep.frequency_hz[outlying]),
    )


def _narrow(task: _Task, poles: ComplexArray) -> BoolArray:
    """Points at which resonances of the model are hardly wider than the step between points."""
    steps = np.gradient(task.s.imag)
    marked = np.zeros(task.s.size, dtype=np.bool_)
    for pole in poles[poles.imag > 0]:
        nearest = int(np.argmin(np.abs(task.s.imag - pole.imag)))
        if -pole.real < SUSPECT * steps[nearest]:
            marked[nearest] = True
    return marked


def _best_order(task: _Task, unit: float, reference: float) -> tuple[float, ComplexArray, FloatArray]:
    """BIC, poles and coefficients of the order with the least BIC."""
    count = 2 * task.s.size
    best: tuple[float, ComplexArray, FloatArray, float] | None = None
    worse = 0
    for pairs in range(1, MOST_PAIRS + 1):
        starts = [_vector_fitted(task, unit, reference, pairs)]
        if best is not None:
            starts.append(_one_more_pair(task, best[1], best[2]))
        poles, coefficients, chi2 = min((_polished(task, start) for start in starts), key=lambda found: found[2])
        score = chi2 + (2 * _order(poles) + 1) * np.log(count)
        if best is None or score < best[0]:
            best, worse = (score, poles, coefficients, chi2), 0
        else:
            worse += 1
        if worse >= PATIENCE or (worse and best[3] < count + 3 * np.sqrt(2 * count)):
            break
    assert best is not None
    return best[:3]


def _one_more_pair(task: _Task, poles: ComplexArray, coefficients: FloatArray) -> ComplexArray:
    """Poles with another pair at the frequency with the largest remaining error."""
    white = task.whitened(task.reflection - coefficients[-1] - _columns(task.s, poles) @ coefficients[:-1])
    top = task.s[int(np.argmax(smoothed(white)))].imag
    return np.append(poles, complex(-0.1 * top, top))


def smoothed(white: ComplexArray) -> FloatArray:
    """Mean variance of whitened residuals round each point; 1 for noise."""
    return np.convolve(np.pad(np.abs(white) ** 2 / 2, WINDOW // 2, mode="reflect"), np.full(WINDOW, 1 / WINDOW), mode="valid")


def _vector_fitted(task: _Task, unit: float, reference: float, pairs: int) -> ComplexArray:
    """Poles by scikit-rf, those of the upper half plane, in the task's unit of frequency."""
    from skrf.network import Network
    from skrf.vectorFitting import VectorFitting

    network: Any = Network(f=task.s.imag * unit / (2 * np.pi), f_unit="Hz", s=task.reflection[:, None, None], z0=reference)
    # Only for a warning, scikit-rf would find out whether the sweep is passive, which takes most of its time.
    network.is_passive = lambda: False
    fitting: Any = VectorFitting(network)
    fitting.max_iterations = 12
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        # Its warnings (no convergence, not passive) are ignored: both are checked here, after the least-squares fit.
        warnings.simplefilter("ignore")
        fitting.vector_fit(n_poles_real=1, n_poles_cmplx=pairs, init_pole_spacing="log", fit_constant=True, fit_proportional=False)
    return np.asarray(fitting.poles, dtype=np.complex128) / unit


def _order(poles: ComplexArray) -> int:
    return int(np.sum(np.where(poles.imag == 0, 1, 2)))


def _columns(s: ComplexArray, poles: ComplexArray) -> ComplexArray:
    """Partial fractions with real coefficients, shape (n, order): one column for a real pole, two for a pair."""
    columns = []
    for pole in poles:
        if pole.imag == 0:
            columns.append(1 / (s - pole.real))
        else:
            one, other = 1 / (s - pole), 1 / (s - pole.conjugate())
            columns += [one + other, 1j * (one - other)]
    return np.stack(columns, axis=1)


def _stacked(residues: ComplexArray, poles: ComplexArray) -> FloatArray:
    parts = [[r.real] if p.imag == 0 else [r.real, r.imag] for r, p in zip(residues, poles, strict=True)]
    return np.concatenate(parts)


def _unstacked(coefficients: FloatArray, poles: ComplexArray) -> ComplexArray:
    left = list(coefficients)
    found = [complex(left.pop(0)) if pole.imag == 0 else complex(left.pop(0), left.pop(0)) for pole in poles]
    return np.array(found, dtype=np.complex128)


def _real(values: ComplexArray) -> FloatArray:
    return np.concatenate([values.real, values.imag])


def _polished(task: _Task, start: ComplexArray) -> tuple[ComplexArray, FloatArray, float]:
    """Poles moved by least squares; the coefficients, which are linear, are solved for at each step (variable projection)."""
    real = start.imag == 0
    target = _real(task.whitened(task.reflection))
    # Logarithms keep real parts negative, which is causality, and imaginary parts positive.
    widths = np.log(np.clip(np.abs(start.real), 1e-8, 1e8))
    heights = np.log(np.clip(np.abs(start.imag[~real]), 1e-8, 1e8))

    def poles_of(u: FloatArray) -> ComplexArray:
        u = np.clip(u, -FARTHEST, FARTHEST)
        height = np.zeros(start.size)
        height[~real] = np.exp(u[start.size :])
        narrowest = np.where(real, 0.0, NARROWEST * np.interp(height, task.s.imag, np.gradient(task.s.imag)))
        return -np.maximum(np.exp(u[: start.size]), narrowest) + 1j * height

    # Residuals and slopes are asked for one after the other at the same point.
    @lru_cache(maxsize=1)
    def solved_at(point: bytes) -> tuple[ComplexArray, FloatArray, FloatArray, FloatArray]:
        poles = poles_of(np.frombuffer(point))
        columns = np.column_stack([_columns(task.s, poles), np.ones_like(task.s)])
        white = task.whitened(columns)
        design = np.concatenate([white.real, white.imag])
        norms = np.linalg.norm(design, axis=0)
        q, r = np.linalg.qr(design / norms)
        coefficients = np.linalg.lstsq(r, q.T @ target, rcond=1e-12)[0] / norms
        return poles, coefficients, target - design @ coefficients, q

    def solved(u: FloatArray) -> tuple[ComplexArray, FloatArray, FloatArray, FloatArray]:
        return solved_at(u.tobytes())

    def residual(u: FloatArray) -> FloatArray:
        return solved(u)[2]

    def jacobian(u: FloatArray) -> FloatArray:
        poles, coefficients, _, q = solved(u)
        residues = _unstacked(coefficients[:-1], poles)
        slopes = np.empty((task.s.size, u.size), dtype=np.complex128)
        after = start.size
        for index, (pole, residue) in enumerate(zip(poles, residues, strict=True)):
            one = residue / (task.s - pole) ** 2
            if pole.imag == 0:
                slopes[:, index] = one * pole.real
                continue
            other = residue.conjugate() / (task.s - pole.conjugate()) ** 2
            slopes[:, index] = (one + other) * pole.real
            slopes[:, after] = 1j * (one - other) * pole.imag
            after += 1
        white = task.whitened(slopes)
        parts = np.concatenate([white.real, white.imag])
        # Kaufman's approximation: only the part of a slope that the linear coefficients cannot follow.
        return q @ (q.T @ parts) - parts

    u = np.concatenate([widths, heights])
    found = least_squares(residual, u, jacobian, method="lm", max_nfev=40, xtol=1e-6, ftol=1e-6)
    poles, coefficients, left, _ = solved(found.x)
    return poles, coefficients, float(left @ left)
