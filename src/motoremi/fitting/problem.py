"""The least-squares problem: a motor, a measurement, and the analyser's errors between them.

The residual is ln(Z_measured / Z_model), complex; for a network analyser the same to first order, but exact where its errors are: in the
reflection coefficient. Two kinds of unknowns move it:

- the motor's parameters, as logarithms where they are positive;
- what compensation left at each connection, and a fixture that was not compensated (R, L, G, C), with Gaussian priors.

All else that a perfect circuit would leave (noise, the analyser's smooth errors, what no model describes) is in the covariance of the
residuals (`data.covariance`), whose two free sizes are given: the data choose them (`fitting.marginal`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.analyser import Analyser
from motoremi.data.covariance import LEAST_SHARE, Sizes, Whitening, orthonormal
from motoremi.data.measurement import Measurement
from motoremi.data.quantity import Quantity
from motoremi.errors import BadInput
from motoremi.fitting.observed import ObservedSweep, Weights, observed
from motoremi.fitting.ports import with_ground_capacitance, with_line_inductance
from motoremi.model import laws
from motoremi.model.circuit import Leaf, Node, Series, Shunted, Tape
from motoremi.model.laws import ValueAndSlopes
from motoremi.model.motor import BASE_PARAMETERS, Motor
from motoremi.model.parameter import Parameter

# Without a discrepancy, and with an analyser that is as good as declared.
AS_DECLARED = Sizes(3e-8, 1.0)
# What the specification allows at most: it is taken for three standard deviations.
ALLOWED = 3.0
# Relative error assumed for each point in a search, against the prior of a fixture: rather less than the error of a circuit during the search.
SEARCHED = 0.01
# Residuals of connection and fixture are not clipped; this many standard deviations only keep the arithmetic finite.
FAR = 1e4
# The second derivative along a step is taken over this share of it.
AHEAD = 0.1
# Standard deviations of R, L, G and C of leads that stayed where they were.
NOT_MOVED = np.zeros(4)


@dataclass
class Linearised:
    """A batch of points with what a Gauss-Newton step needs.

    Parameters
    ----------
    objective : ndarray, shape (...)
    gradient : ndarray, shape (..., k)
        Half of the objective's gradient.
    matrix : ndarray, shape (..., k, k)
        Gauss-Newton matrix.
    deviation, slopes : ndarray, shapes (..., n), (..., k, n)
        Complex weighted residuals, and their derivatives for the parameters in SI units.
    along : ndarray, shape (..., k, 2 q)
        The derivatives along the directions of the gain error.
    chain : ndarray, shape (..., k)
        Derivatives of the parameters for the unknowns.
    """

    objective: FloatArray
    gradient: FloatArray
    matrix: FloatArray
    deviation: ComplexArray
    slopes: ComplexArray
    along: FloatArray
    chain: FloatArray

    @property
    def residual(self) -> FloatArray:
        """Weighted residuals, shape (..., 2 n), real parts first."""
        return np.concatenate([self.deviation.real, self.deviation.imag], axis=-1)

    @property
    def jacobian(self) -> FloatArray:
        """Derivatives of the residuals for the unknowns, shape (..., k, 2 n), real parts first."""
        return np.concatenate([self.slopes.real, self.slopes.imag], axis=-1) * self.chain[..., None]

    def subset(self, index: np.ndarray) -> Linearised:
        """Some members of the batch."""
        return Linearised(*(getattr(self, name)[index] for name in _MEMBERS))

    def put(self, index: np.ndarray, other: Linearised) -> None:
        """Replace some members by those of another batch."""
        if index.any():
            self.take(index, other.subset(index))

    def take(self, index: np.ndarray, other: Linearised) -> None:
        """Take all members of another batch to these places."""
        for name in _MEMBERS:
            getattr(self, name)[index] = getattr(other, name)


_MEMBERS = tuple(field.name for field in dataclasses.fields(Linearised))


class Problem:
    """Unknowns, residuals and their exact derivatives.

    Parameters
    ----------
    motor : Motor
    measurement : Measurement
    bounds : mapping, optional
        Parameter name -> (low, high) in SI units; replaces the parameter's own range.
    held : mapping, optional
        Values of parameters that are not varied.
    points : int, optional
        Use about this many points a sweep.
    highest_hz : float
        Use points up to here only.
    weights : {"likelihood", "log", "relative"}
        `likelihood`: over the noise, all else marginalised. `log`: every point alike and an analyser without errors, behind the fixture
        if it was not compensated; that is smooth far from the solution and is where searches start. `relative`: for an ideal analyser,
        1 - Z_model / Z_measured, the error that is shown.
    sizes : Sizes
        Of what no model describes, and of the analyser's errors against those declared.
    least_share : float
        Smooth directions that hold less than this share of the noise's variance are left out of the objective.
    blur : float
        White noise that is added to that of the measurement, relative to Z.
    swept : collection of str
        Parameters of which each member of a batch keeps its own value: unknowns whose derivatives and priors are zero.

    Attributes
    ----------
    unknowns : tuple of Parameter
        In the order of the vectors `u`, which hold logarithms (`log`) or multiples of `scale` (`linear`).
    """

    def __init__(
        self,
        motor: Motor,
        measurement: Measurement,
        bounds: Mapping[str, tuple[float, float]] | None = None,
        held: Mapping[str, float] | None = None,
        points: int | None = None,
        weights: Weights = "likelihood",
        highest_hz: float = np.inf,
        sizes: Sizes = AS_DECLARED,
        least_share: float = LEAST_SHARE,
        blur: float = 0.0,
        swept: Collection[str] = (),
    ) -> None:
        self.motor, self.measurement, self.weights, self.sizes = motor, measurement, weights, sizes
        self._least_share = least_share
        self.bounds, self.held = dict(bounds or {}), dict(held or {})
        analyser = measurement.analyser
        used = motor.used_parameters(*measurement.terminations)
        parameters = [p for p in motor.parameters if p.name in used]
        self.everything: tuple[Parameter, ...] = (*parameters, *self._nuisances())
        names = [p.name for p in self.everything]
        varying = [i for i, p in enumerate(self.everything) if (p.vary or p.name in swept) and p.name not in self.held]
        self.unknowns = tuple(self.everything[i] for i in varying)
        self._varying = np.array(varying, dtype=np.intp)
        self._swept = frozenset(swept)
        self._log = np.array([p.scale == "log" for p in self.unknowns])
        self._as_log, self._as_linear = np.flatnonzero(self._log), np.flatnonzero(~self._log)
        self._scale = np.array([1.0 if p.scale == "log" else _linear_scale(p) for p in self.unknowns])
        self._fixed = np.array([self.held.get(p.name, p.middle) for p in self.everything])
        self._low_si, self._high_si = self._limits_si()
        self.low, self.high = (
            np.where(self._log, np.log(np.where(self._log, limit, 1.0)), limit / self._scale) for limit in (self._low_si, self._high_si)
        )
        self.precision, self.centre = self._priors()
        self.observed = observed(measurement, points, weights, highest_hz, blur)
        self.size = self.observed.size
        sweeps = self.observed.sweeps
        self._quantity = analyser.quantity if weights == "likelihood" else None
        self._tape = Tape([self._circuit(sweep) for sweep in sweeps], names, [sweep.s.size for sweep in sweeps])

    def _nuisances(self) -> Sequence[Parameter]:
        """The unknown elements between analyser and motor that are used with these weights."""
        analyser = self.measurement.analyser
        if self.weights == "relative" or analyser.ideal:
            return ()
        if self.weights == "likelihood":
            own = (p for sweep in self.measurement.sweeps for p in residual_parameters(analyser, sweep.termination, sweep.moved_of_mean))
            return [*own, *fixture_parameters(analyser)]
        # Ants and far steps stay where a fixture can be.
        return fixture_parameters(analyser, ALLOWED)

    def _limits_si(self) -> tuple[FloatArray, FloatArray]:
        pairs = [self.bounds.get(parameter.name, (parameter.low, parameter.high)) for parameter in self.unknowns]
        low, high = np.array(pairs, dtype=np.float64).reshape(-1, 2).T
        return low, high

    def _priors(self) -> tuple[FloatArray, FloatArray]:
        """Precision and centre of the Gaussian priors, in units of `u`.

        The analyser's errors have those of its specification. The shape parameters of effects get a wide one over their physical range,
        which matters only along directions that the data leave open. The paper's seven elements have none.
        """
        paper = {p.name for p in BASE_PARAMETERS}
        precision, centre = np.zeros(len(self.unknowns)), np.zeros(len(self.unknowns))
        if self.weights != "likelihood":  # no noise, so nothing to weigh a prior of the motor against
            precision[~self.own] = SEARCHED**2
            return precision, centre
        for index, parameter in enumerate(self.unknowns):
            if parameter.sigma is not None:
                precision[index] = 1 / self.sizes.declared**2 if _declared(parameter) else 1.0
            elif parameter.name not in paper and parameter.name not in self._swept and parameter.vary:
                precision[index] = (2 / (self.high[index] - self.low[index])) ** 2
                centre[index] = 0.5 * (self.high[index] + self.low[index])
        return precision, centre

    @cached_property
    def flat_precision(self) -> FloatArray:
        """Precision of the normal distribution whose density is that of a flat prior over the range, shape (k,); 0 where there is another prior."""
        return np.where(self.precision == 0, 2 * np.pi / (self.high - self.low) ** 2, 0.0)

    def precision_at(self, declared: float) -> FloatArray:
        """Precision of the priors at another scale of the declared errors, shape (k,)."""
        ratio = (self.sizes.declared / declared) ** 2
        return np.where(self._declared, self.precision * ratio, self.precision)

    def _penalty(self, u: FloatArray) -> FloatArray:
        return (u - self.centre) ** 2 @ self.precision

    def _circuit(self, sweep: ObservedSweep) -> Node:
        circuit, analyser = self.motor.circuit(sweep.termination), self.measurement.analyser
        if self.weights == "relative" or analyser.ideal:
            return circuit
        if self.weights == "log":
            return on_fixture(circuit, analyser)
        return behind_fixture(circuit, analyser, sweep.termination, sweep.frequency_hz)

    def physical(self, u: FloatArray) -> FloatArray:
        """Values in SI units of all parameters, shape (..., p), from unknowns of shape (..., k)."""
        values = np.empty((*u.shape[:-1], self._fixed.size))
        values[...] = self._fixed
        if self._as_log.size:
            log = self._as_log
            # Clipped once more: a bound must not be missed by the rounding of its logarithm.
            values[..., self._varying[log]] = np.minimum(np.maximum(np.exp(u[..., log]), self._low_si[log]), self._high_si[log])
        if self._as_linear.size:
            linear = self._as_linear
            values[..., self._varying[linear]] = u[..., linear] * self._scale[linear]
        return values

    def vector(self, values: Mapping[str, float]) -> FloatArray:
        """Unknowns from values in SI units; what is not given starts at zero or in the middle of its range; kept within bounds."""
        return self.vectors([values])[0]

    def vectors(self, starts: Sequence[Mapping[str, float]]) -> FloatArray:
        """Several at once, shape (m, k)."""
        missing = self.physical(np.where(self._log, 0.5 * (self.low + self.high), 0.0))[self._varying].tolist()
        names = [parameter.name for parameter in self.unknowns]
        rows = [[start.get(name, other) for name, other in zip(names, missing, strict=True)] for start in starts]
        values = np.array(rows, dtype=np.float64).reshape(-1, len(names))
        return self.clip(np.where(self._log, np.log(np.maximum(values, 1e-300)), values / self._scale))

    def unknown(self, index: int, value: float) -> float:
        """One unknown from its value in SI units, bounds or not."""
        return float(np.log(max(value, 1e-300)) if self._log[index] else value / self._scale[index])

    def named(self, u: FloatArray) -> dict[str, float]:
        """Values in SI units by name."""
        return {p.name: float(v) for p, v in zip(self.everything, self.physical(u), strict=True)}

    def vector_scale(self, index: int) -> float:
        """SI value of one unit of a linear unknown."""
        return float(self._scale[index])

    def clip(self, u: FloatArray) -> FloatArray:
        """Unknowns moved into their bounds."""
        return np.clip(u, self.low, self.high)

    def deviation(self, u: FloatArray) -> ComplexArray:
        """ln(Z_measured / Z_model), complex, phase wrapped, shape (..., n)."""
        with np.errstate(all="ignore"):
            found = _logarithm(self.observed.measured / self._tape.impedance(self.observed.s, self.physical(u)))
        return _repaired(found, 1e3)

    @cached_property
    def _to_relative(self) -> ComplexArray:
        """Relative change of Z for one of the coefficient that the analyser measures, shape (n,)."""
        assert self._quantity is not None
        return self._quantity.relative(self.observed.measured)

    @cached_property
    def _coefficient(self) -> ComplexArray:
        """The measured coefficient, shape (n,)."""
        assert self._quantity is not None
        return self._quantity.coefficient_of(self.observed.measured)

    def _of_waves(self, quantity: Quantity, model: ComplexArray) -> ComplexArray:
        """Residuals of the coefficient that the analyser measures, relative to Z, shape (..., n)."""
        return self._to_relative * (self._coefficient - quantity.coefficient_of(model))

    @cached_property
    def _directions(self) -> ComplexArray:
        """D, shape (n, q): 1 - D D* is the inverse covariance of weighted residuals."""
        if self.weights != "likelihood":
            return np.zeros((self.size, 0), dtype=np.complex128)
        return self.whitening.directions(self.sizes.discrepancy, self._least_share)

    @cached_property
    def _adjoints(self) -> tuple[tuple[slice, ComplexArray], ...]:
        """D* in parts, each with the points at which it is not zero."""
        return self.whitening.adjoints(self.sizes.discrepancy, self._least_share) if self.weights == "likelihood" else ()

    @property
    def whitening(self) -> Whitening:
        """The covariance at these sizes' scale of the declared errors; only of the likelihood."""
        assert self.weights == "likelihood"
        return self.observed.columns.whitening(self.sizes.declared)

    def residual(self, u: FloatArray) -> ComplexArray:
        """The residuals relative to Z, shape (..., n)."""
        if self._quantity is None and self.weights != "relative":
            return self.deviation(u)
        with np.errstate(all="ignore"):
            model = self._tape.impedance(self.observed.s, self.physical(u))
            if self._quantity is None:
                return _repaired(1 - model / self.observed.measured, 1e3)
            found = self._of_waves(self._quantity, model)
        return _repaired(found, 1e3)

    def objective(self, u: FloatArray) -> FloatArray:
        """Minus twice the log likelihood (and prior), up to a constant for these sizes, shape (...)."""
        residual = self.residual(u) * self.observed.weight
        return _squares(residual.view(np.float64)) - _squares(self._along(residual)) + self._penalty(u)

    def _along(self, values: ComplexArray) -> FloatArray:
        """Components, shape (..., 2 q), of weighted residuals, shape (..., n), along the smooth directions."""
        # One product of all rows takes less time than one for each member of a batch.
        rows = values.reshape(-1, self.size)
        along = [rows[:, points] @ part for points, part in self._adjoints]
        if not along:
            return np.zeros((*values.shape[:-1], 0))
        return np.concatenate(along, axis=-1).view(np.float64).reshape(*values.shape[:-1], -1)

    def linearised(self, u: FloatArray) -> Linearised:
        """The objective round `u`, shape (..., k), to second order."""
        values = self.physical(u)
        chain = np.where(self._log, values[..., self._varying], self._scale)
        slopes = np.zeros((*u.shape, self.size), dtype=np.complex128)
        into: list[ComplexArray | None] = [None] * len(self.everything)
        for row, position in enumerate(self._varying):
            if self.unknowns[row].name not in self._swept:
                into[position] = slopes[..., row, :]
        with np.errstate(all="ignore"):
            model, trace = self._tape.forward(self.observed.s, values)
            residual, slope = self._residual_and_slope(model)
            deviation = residual * self.observed.weight
            self._tape.backward(trace, slope * self.observed.weight, into)
            here = self._squared(u, deviation, slopes, chain)
            if np.isfinite(here.objective).all() and np.isfinite(here.matrix).all():
                return here
            return self._squared(u, _repaired(deviation, 1e3), _repaired(slopes, 0.0), chain)

    def _residual_and_slope(self, model: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """The residual, and its derivative for the model's impedance."""
        if self.weights == "relative":
            share = 1 / self.observed.measured
            return 1 - model * share, -share + 0 * model
        if self._quantity is None:
            inverse = 1 / model
            return _logarithm(self.observed.measured * inverse), -inverse
        quantity = self._quantity
        return self._of_waves(quantity, model), self._to_relative * -quantity.slope_ohm / (model + quantity.pole_ohm) ** 2

    def _squared(self, u: FloatArray, deviation: ComplexArray, slopes: ComplexArray, chain: FloatArray) -> Linearised:
        along, residual_along = self._along(slopes), self._along(deviation)
        # Real products of real and imaginary parts, which lie side by side, take half the time of complex ones.
        residual, jacobian = deviation.view(np.float64), slopes.view(np.float64)
        matrix = jacobian @ np.swapaxes(jacobian, -1, -2)
        if along.shape[-1]:
            matrix -= along @ np.swapaxes(along, -1, -2)
        matrix *= chain[..., :, None] * chain[..., None, :]
        index = np.arange(len(self.unknowns))
        matrix[..., index, index] += self.precision
        objective = _squares(residual) - _squares(residual_along) + self._penalty(u)
        gradient = (_product(jacobian, residual) - _product(along, residual_along)) * chain + self.precision * (u - self.centre)
        return Linearised(objective, gradient, matrix, deviation, slopes, along, chain)

    def curvature_pull(self, here: Linearised, u: FloatArray, step: FloatArray) -> FloatArray:
        """J' C^-1 times the second derivative of the residuals along `step`, by one more evaluation; shape (..., k)."""
        weight, jacobian = self.observed.weight, here.slopes.view(np.float64)
        turned = self.residual(u + AHEAD * step) - here.deviation / weight
        turned = (_wrapped(turned) if self.weights != "relative" and self._quantity is None else turned) * weight
        along_step: ComplexArray = ((step * here.chain)[..., None, :] @ jacobian)[..., 0, :].view(np.complex128)
        second = (2 / AHEAD) * (turned / AHEAD - along_step)
        return self.pull(here, second)

    def pull(self, here: Linearised, weighted: ComplexArray) -> FloatArray:
        """J' C^-1 times a change of the weighted residuals, shape (..., n): half of what it adds to the gradient; shape (..., k)."""
        along = _product(here.along, self._along(weighted))
        return (_product(here.slopes.view(np.float64), weighted.view(np.float64)) - along) * here.chain

    def pulls_of_analyser(self, here: Linearised) -> FloatArray:
        """What an analyser that is off as a whole by one standard deviation adds to J' C^-1 r: each of its errors in turn; shape (m, k).

        The smooth ones are off alike at all frequencies, as by the error of a calibration standard; those left at a connection have one value.
        """
        observed, analyser = self.observed, self.measurement.analyser
        smooth = analyser.smooth_errors(observed.frequency_hz, observed.measured) * (self.sizes.declared * observed.weight)
        return np.concatenate([self.pull(here, smooth), self.pull(here, 1j * smooth), np.diag(np.sqrt(self.precision))[self._declared]])

    def pull_of_scale(self, here: Linearised) -> FloatArray:
        """What an error of all impedances in common, of one standard deviation, adds to J' C^-1 r, shape (1, k)."""
        return self.pull(here, np.asarray(self.measurement.scale_sigma * self.observed.weight, dtype=np.complex128)[None])

    def slopes_of_deviation(self, u: FloatArray) -> ComplexArray:
        """Derivatives of `deviation` for the unknowns, shape (k, n); `u` of shape (k,)."""
        values = self.physical(u)
        slopes = np.zeros((len(self.unknowns), self.size), dtype=np.complex128)
        into: list[ComplexArray | None] = [None] * len(self.everything)
        for row, position in enumerate(self._varying):
            into[position] = slopes[row]
        model, trace = self._tape.forward(self.observed.s, values)
        self._tape.backward(trace, -1 / model, into)
        return slopes * np.where(self._log, values[self._varying], self._scale)[:, None]

    @cached_property
    def _declared(self) -> np.ndarray:
        """Which unknowns are errors whose size the analyser's specification declares; shape (k,), bool."""
        return np.array([_declared(parameter) for parameter in self.unknowns], dtype=np.bool_)

    @cached_property
    def own(self) -> np.ndarray:
        """Which unknowns are the motor's, not the analyser's or the fixture's; shape (k,), bool."""
        names = {parameter.name for parameter in self.motor.parameters}
        return np.array([parameter.name in names for parameter in self.unknowns], dtype=np.bool_)

    def alone(self, u: FloatArray) -> FloatArray:
        """The same with nothing left at the connections: the motor's circuit alone."""
        return np.where(self.own, u, 0.0)

    def smooth_error(self, u: FloatArray) -> ComplexArray:
        """Most likely smooth relative error of the analyser given what the model leaves, shape (n,).

        What no model describes is taken to be no larger than what is left: a larger one could cancel an error of the analyser that nothing shows
        (of a core on a NanoVNA 0.4 % were left, and the analyser was to err by 50 %, with a discrepancy of 14 %).
        """
        residual = self.residual(u)
        weight, columns = self.observed.weight, self.observed.columns.analyser * self.sizes.declared
        left = 100 * float(np.sqrt(np.mean(np.abs(residual) ** 2))) / self.discrepancy_percent
        within = self.sizes.discrepancy <= left
        directions = self._directions if within else self.whitening.directions(left, self._least_share)
        weighted = residual * weight
        white = weighted - directions @ (directions.conj().T @ weighted)
        return columns @ (columns.conj().T @ (white * weight))

    def analyser_sigma(self, u: FloatArray) -> float:
        """How far the analyser's errors had to go, in standard deviations of what was declared: the farthest of them."""
        if self.measurement.analyser.ideal or self.weights != "likelihood":
            return 0.0
        residuals = float(np.max(np.abs(u[self._declared]), initial=0.0))
        return max(residuals, self._smooth_sigma(self.smooth_error(u)))

    def _smooth_sigma(self, error: ComplexArray) -> float:
        size = np.sqrt(np.sum(np.abs(self.observed.columns.analyser) ** 2, axis=1))
        return float(np.max(np.abs(error) / np.where(size > 0, np.sqrt(2) * size, np.inf), initial=0.0))

    def less_allowed_error(self, u: FloatArray, everywhere: Problem | None = None) -> ComplexArray:
        """ln(Z_measured / Z_model) less the analyser's most likely error, of which no more is taken off than its specification allows.

        Parameters
        ----------
        u : ndarray, shape (k,)
        everywhere : Problem, optional
            The same on all points of the sweeps, if this one is of averages: its residual is used.
        """
        seen = everywhere or self
        if self.measurement.analyser.ideal or self.weights != "likelihood":
            return seen.deviation(u)
        allowed = np.where(self._declared, np.clip(u, -ALLOWED, ALLOWED), u)
        error = self.smooth_error(u)
        sigma = self._smooth_sigma(error)
        taken = error * (min(1.0, ALLOWED / sigma) if sigma else 1.0)
        return seen.deviation(allowed) - (taken if everywhere is None else self.observed.at(everywhere.observed, taken))

    def whiten(self, weighted: ComplexArray) -> ComplexArray:
        """Weighted residuals, shape (..., n), with unit covariance."""
        unit, shares = orthonormal(self._directions)
        taken = 1 - np.sqrt(np.maximum(1 - shares, 0.0))
        return weighted - ((weighted @ unit.conj()) * taken) @ unit.T

    def whitened(self, u: FloatArray) -> ComplexArray:
        """Residuals whose covariance is one, shape (n,)."""
        return self.whiten(self.residual(u) * self.observed.weight)

    @cached_property
    def discrepancy_percent(self) -> float:
        """Relative error, rms in percent, that a discrepancy of size one stands for at a typical point."""
        variance = np.sum(np.abs(self.observed.columns.discrepancy) ** 2, axis=1)
        return float(100 * np.sqrt(2 * np.median(variance)))

    @property
    def degrees_of_freedom(self) -> float:
        """Real residuals less unknowns that the data, not their priors, determine."""
        return float(2 * self.size - np.count_nonzero(self.precision == 0))


def _logarithm(ratio: ComplexArray) -> ComplexArray:
    """Natural logarithm; several times quicker than the library's, which guards against squares out of range."""
    result = np.empty(ratio.shape, dtype=np.complex128)
    result.real = 0.5 * np.log(ratio.real**2 + ratio.imag**2)
    result.imag = np.arctan2(ratio.imag, ratio.real)
    return result


def _repaired(values: ComplexArray, replacement: float) -> ComplexArray:
    """Real and imaginary parts that are not finite numbers replaced, the sign of infinity kept."""
    if np.isfinite(values).all():
        return values
    return np.nan_to_num(values, nan=replacement, posinf=replacement, neginf=-replacement)


def _squares(values: FloatArray) -> FloatArray:
    """Sum of squares along the last axis."""
    return np.einsum("...i,...i->...", values, values)


def _wrapped(logarithm: ComplexArray) -> ComplexArray:
    """The phase moved into ±180 degrees, in place."""
    logarithm.imag -= 2 * np.pi * np.rint(logarithm.imag / (2 * np.pi))
    return logarithm


def _product(rows: FloatArray, column: FloatArray) -> FloatArray:
    """Matrix times vector for a batch."""
    return (rows @ column[..., None])[..., 0]


def _linear_scale(parameter: Parameter) -> float:
    return parameter.sigma if parameter.sigma is not None else 0.5 * (parameter.high - parameter.low)


def _declared(parameter: Parameter) -> bool:
    """Whether it is an error whose size the analyser's specification declares."""
    return parameter.name.split(" ")[-2:-1] == ["connection"]


def residual_parameters(analyser: Analyser, termination: str, moved: FloatArray = NOT_MOVED) -> tuple[Parameter, ...]:
    """What compensation left at one connection, together with leads that moved.

    Parameters
    ----------
    moved : ndarray, shape (4,)
        Standard deviations of the average R, L, G and C of the leads, in SI units.
    """

    def one(name: str, unit: str, sigma: float) -> Parameter:
        return Parameter(f"{termination} connection {name}", unit, -FAR * sigma, FAR * sigma, "the analyser's specification", "linear", sigma)

    resistance, inductance, _, capacitance = moved.tolist()
    return (
        one("R", "Ohm", float(np.hypot(analyser.resistance_sigma_ohm, resistance))),
        one("L", "H", float(np.hypot(analyser.inductance_sigma_h, inductance))),
        # In multiples of the specified conductance, which depends on frequency; that of moved leads is in the covariance.
        one("G", "1", 1.0),
        one("C", "F", float(np.hypot(analyser.capacitance_sigma_f, capacitance))),
    )


def fixture_parameters(analyser: Analyser, farthest: float = FAR) -> tuple[Parameter, ...]:
    """The elements of a fixture that was not compensated, the same in all sweeps, with their standard deviations; empty if it was."""
    fixture = analyser.fixture
    if fixture is None:
        return ()

    def one(name: str, unit: str, sigma: float) -> Parameter:
        return Parameter(f"fixture {name}", unit, -farthest * sigma, farthest * sigma, "a fixture of a few centimetres", "linear", sigma)

    return (
        one("R", "Ohm", fixture.resistance_ohm),
        one("L", "H", fixture.inductance_h),
        one("G", "S", fixture.conductance_s),
        one("C", "F", fixture.capacitance_f),
        *([one("C to ground", "F", fixture.ground_capacitance_f)] if fixture.ground_capacitance_f else []),
        *([one("L of the line", "H", fixture.line_inductance_h)] if fixture.line_inductance_h else []),
    )


def on_fixture(circuit: Node, analyser: Analyser) -> Node:
    """The circuit behind a fixture that was not compensated; the circuit itself if there is none."""
    fixture = fixture_parameters(analyser)
    if not fixture:
        return circuit
    circuit = Series((circuit, Leaf("fixture", laws.resistance_and_inductance, fixture[:2])))
    circuit = Shunted(circuit, laws.conductance_and_capacitance, fixture[2:4])
    for stray in fixture[4:]:
        circuit = with_ground_capacitance(circuit, stray) if stray.unit == "F" else with_line_inductance(circuit, stray)
    return circuit


def behind_fixture(circuit: Node, analyser: Analyser, termination: str, frequency_hz: FloatArray) -> Node:
    """The circuit as the analyser sees it: behind a fixture, and what its compensation left."""
    resistance, inductance, conductance, capacitance = residual_parameters(analyser, termination)
    shape: ComplexArray = analyser.conductance_sigma_s(frequency_hz).astype(np.complex128)

    def admittance(s: ComplexArray, multiple: FloatArray, c: FloatArray) -> ValueAndSlopes:
        return multiple * shape + s * c, (shape, s)

    circuit = on_fixture(circuit, analyser)
    series = Leaf(f"{termination} connection", laws.resistance_and_inductance, (resistance, inductance))
    return Shunted(Series((circuit, series)), admittance, (conductance, capacitance))


def checked_bounds(motor: Motor, bounds: Mapping[str, tuple[float, float]] | None) -> dict[str, tuple[float, float]]:
    """Bounds that make sense, or one clear line.

    Raises
    ------
    BadInput
        For an unknown parameter, crossed or non-finite bounds, or non-positive bounds of a positive quantity.
    """
    known = {p.name: p for p in motor.parameters}
    checked = {}
    for name, pair in (bounds or {}).items():
        if name not in known:
            raise BadInput(f"bounds for the unknown parameter {name!r}; the model has {', '.join(known)}")
        try:
            low, high = (float(value) for value in pair)
        except (TypeError, ValueError) as error:
            raise BadInput(f"bounds of {name} must be a pair (low, high) of numbers in {known[name].unit}, got {pair!r}") from error
        if not (np.isfinite(low) and np.isfinite(high)) or low >= high:
            raise BadInput(f"bounds of {name} are crossed or not finite: ({low:g}, {high:g}) {known[name].unit}")
        if known[name].scale == "log" and low <= 0:
            raise BadInput(f"the lower bound of {name} must be above 0 {known[name].unit}, got {low:g}")
        checked[name] = (low, high)
    return checked
