"""The least-squares problem: a motor, a measurement, and the analyser's errors between them.

The residual is ln(Z_measured / Z_model), complex, over the noise. Three kinds of unknowns move it:

- the motor's parameters, as logarithms where they are positive;
- what the fixture's compensation left at each connection (R, L, G, C), with Gaussian priors from the analyser's specification;
- the analyser's gain error, smooth in log frequency and common to all sweeps. It adds to ln Z, so it is marginalised exactly: with
  its basis B and unit normal coefficients the covariance of the residuals is 1 + B B', inverted once for all parameters.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.analyser import Analyser
from motoremi.data.measurement import Measurement
from motoremi.errors import BadInput
from motoremi.fitting.observed import ObservedSweep, Weights, observed
from motoremi.model import laws
from motoremi.model.circuit import Leaf, Node, Series, Shunted, Tape
from motoremi.model.laws import ValueAndSlopes
from motoremi.model.motor import BASE_PARAMETERS, Motor
from motoremi.model.parameter import Parameter

# The allocator hands memory back to the system after every evaluation and asks for it again in the next, which takes half of the time.
# It keeps as much as the largest block that was ever given back.
np.empty(1 << 21)


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
    residual, jacobian, along : ndarray, shapes (..., 2 n), (..., k, 2 n), (..., k, 2 q)
        Weighted residuals, their derivatives, and the derivatives along the directions of the gain error; real parts first.
    """

    objective: FloatArray
    gradient: FloatArray
    matrix: FloatArray
    residual: FloatArray
    jacobian: FloatArray
    along: FloatArray

    def subset(self, index: np.ndarray) -> Linearised:
        """Some members of the batch."""
        return Linearised(
            self.objective[index], self.gradient[index], self.matrix[index],
            self.residual[index], self.jacobian[index], self.along[index],
        )  # fmt: skip

    def put(self, index: np.ndarray, other: Linearised) -> None:
        """Replace some members."""
        for name in ("objective", "gradient", "matrix", "residual", "jacobian", "along"):
            getattr(self, name)[index] = getattr(other, name)


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
    weights : {"likelihood", "log"}
        `likelihood`: over the noise, gain error marginalised. `log`: every point alike and an ideal analyser, which is smooth far from
        the solution and is where searches start.

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
    ) -> None:
        self.motor, self.measurement, self.weights = motor, measurement, weights
        self.bounds, self.held = dict(bounds or {}), dict(held or {})
        analyser = measurement.analyser
        with_residuals = weights == "likelihood" and not analyser.ideal
        used = set().union(*(motor.used_parameters(t) for t in measurement.terminations))
        parameters = [p for p in motor.parameters if p.name in used]
        nuisance = [p for t in measurement.terminations for p in residual_parameters(analyser, t)] if with_residuals else []
        self.everything: tuple[Parameter, ...] = (*parameters, *nuisance)
        names = [p.name for p in self.everything]
        varying = [i for i, p in enumerate(self.everything) if p.vary and p.name not in self.held]
        self.unknowns = tuple(self.everything[i] for i in varying)
        self._varying = np.array(varying, dtype=np.intp)
        self._log = np.array([p.scale == "log" for p in self.unknowns])
        self._scale = np.array([1.0 if p.scale == "log" else _linear_scale(p) for p in self.unknowns])
        self._fixed = np.array([self.held.get(p.name, p.middle) for p in self.everything])
        self._low_si, self._high_si = self._limits_si()
        self.low, self.high = (
            np.where(self._log, np.log(np.where(self._log, limit, 1.0)), limit / self._scale) for limit in (self._low_si, self._high_si)
        )
        self.precision, self.centre = self._priors()
        self.observed = observed(measurement, points, weights, highest_hz)
        self.size = self.observed.size
        self._tapes = [Tape(self._circuit(sweep, with_residuals), names) for sweep in self.observed.sweeps]

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
        if self.weights == "log":  # no noise, so nothing to weigh a prior against
            return precision, centre
        for index, parameter in enumerate(self.unknowns):
            if parameter.sigma is not None:
                precision[index] = 1.0
            elif parameter.name not in paper:
                precision[index] = (2 / (self.high[index] - self.low[index])) ** 2
                centre[index] = 0.5 * (self.high[index] + self.low[index])
        return precision, centre

    def _penalty(self, u: FloatArray) -> FloatArray:
        total: FloatArray = np.sum(self.precision * (u - self.centre) ** 2, axis=-1)
        return total

    def _circuit(self, sweep: ObservedSweep, with_residuals: bool) -> Node:
        circuit = self.motor.circuit(sweep.termination)
        if with_residuals:
            return with_connection_residuals(circuit, self.measurement.analyser, sweep.termination, sweep.frequency_hz)
        return circuit

    def physical(self, u: FloatArray) -> FloatArray:
        """Values in SI units of all parameters, shape (..., p), from unknowns of shape (..., k)."""
        values = np.broadcast_to(self._fixed, (*u.shape[:-1], self._fixed.size)).copy()
        # Clipped once more: a bound must not be missed by the rounding of its logarithm.
        positive = np.clip(np.exp(np.where(self._log, u, 0.0)), self._low_si, self._high_si)
        values[..., self._varying] = np.where(self._log, positive, u * self._scale)
        return values

    def vector(self, values: Mapping[str, float]) -> FloatArray:
        """Unknowns from values in SI units; what is not given starts at zero or in the middle of its range; kept within bounds."""
        u = np.empty(len(self.unknowns))
        for index, parameter in enumerate(self.unknowns):
            if parameter.name in values:
                u[index] = self.unknown(index, float(values[parameter.name]))
            else:
                u[index] = 0.5 * (self.low[index] + self.high[index]) if self._log[index] else 0.0
        return self.clip(u)

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
        values = self.physical(u)
        parts = []
        for sweep, tape in zip(self.observed.sweeps, self._tapes, strict=True):
            with np.errstate(all="ignore"):
                model = tape.impedance(sweep.s, values)
                parts.append(_logarithm(sweep.measured / model))
        joined: ComplexArray = np.concatenate(parts, axis=-1)
        return np.nan_to_num(joined, nan=1e3, posinf=1e3, neginf=-1e3)

    def model_ohm(self, u: FloatArray) -> dict[str, ComplexArray]:
        """Impedance that the analyser should show (fixture residuals included, gain error not), by termination."""
        values = self.physical(u)
        return {sweep.termination: tape.impedance(sweep.s, values) for sweep, tape in zip(self.observed.sweeps, self._tapes, strict=True)}

    def objective(self, u: FloatArray) -> FloatArray:
        """Minus twice the log likelihood (and prior), up to a constant, shape (...)."""
        residual = _parts(self.deviation(u) * self.observed.weight)
        return self._quadratic(residual, self._along(residual)) + self._penalty(u)

    def _along(self, parts: FloatArray) -> FloatArray:
        """Components, shape (..., 2 q), along the directions that the gain error takes up, of real and imaginary parts, shape (..., 2 n)."""
        directions = self.observed.directions
        found: FloatArray = parts.reshape(*parts.shape[:-1], 2, self.size) @ directions
        return found.reshape(*parts.shape[:-1], 2 * directions.shape[1])

    def _quadratic(self, residual: FloatArray, along: FloatArray) -> FloatArray:
        total: FloatArray = np.einsum("...i,...i->...", residual, residual) - np.einsum("...i,...i->...", along, along)
        return total

    def linearised(self, u: FloatArray) -> Linearised:
        """The objective round `u`, shape (..., k), to second order."""
        values = self.physical(u)
        chain = np.where(self._log, values[..., self._varying], self._scale)
        residual = np.empty((*u.shape[:-1], 2 * self.size))
        jacobian = np.zeros((*u.shape, 2 * self.size))
        for sweep, where, tape in zip(self.observed.sweeps, self.observed.slices.values(), self._tapes, strict=True):
            real, imaginary = where, slice(where.start + self.size, where.stop + self.size)
            with np.errstate(all="ignore"):
                model, slopes = tape.slopes(sweep.s, values)
                left = _logarithm(sweep.measured / model)
                residual[..., real], residual[..., imaginary] = left.real / sweep.sigma, left.imag / sweep.sigma
                scale = -1 / (model * sweep.sigma)
                # Parameter by parameter: the parts stay small enough for the processor's cache.
                for row, position in enumerate(self._varying):
                    if slopes[position] is not None:
                        relative = slopes[position] * scale * chain[..., row, None]
                        jacobian[..., row, real], jacobian[..., row, imaginary] = relative.real, relative.imag
        if not np.all(np.isfinite(residual)) or not np.all(np.isfinite(jacobian)):
            residual = np.nan_to_num(residual, nan=1e3, posinf=1e3, neginf=-1e3)
            jacobian = np.nan_to_num(jacobian, nan=0.0, posinf=0.0, neginf=0.0)
        along = self._along(jacobian)
        matrix = jacobian @ np.swapaxes(jacobian, -1, -2) - along @ np.swapaxes(along, -1, -2)
        index = np.arange(len(self.unknowns))
        matrix[..., index, index] += self.precision
        residual_along = self._along(residual)
        objective = self._quadratic(residual, residual_along) + self._penalty(u)
        gradient = _product(jacobian, residual) - _product(along, residual_along) + self.precision * (u - self.centre)
        return Linearised(objective, gradient, matrix, residual, jacobian, along)

    def curvature_pull(self, here: Linearised, u: FloatArray, step: FloatArray, fraction: float = 0.1) -> FloatArray:
        """J' C^-1 times the second derivative of the residuals along `step`, by one more evaluation; shape (..., k)."""
        ahead = self.deviation(u + fraction * step)
        along_step = (step[..., None, :] @ here.jacobian)[..., 0, :]
        before = (here.residual[..., : self.size] + 1j * here.residual[..., self.size :]) / self.observed.weight
        turned = _parts(_wrapped(ahead - before) * self.observed.weight)
        second = 2 / fraction * (turned / fraction - along_step)
        return _product(here.jacobian, second) - _product(here.along, self._along(second))

    def gain_error(self, u: FloatArray) -> ComplexArray:
        """Most likely relative gain error of the analyser given the parameters, shape (n,)."""
        directions = self.observed.directions
        residual = self.deviation(u) * self.observed.weight
        error: ComplexArray = (directions @ (directions.T @ residual)) / self.observed.weight
        return error

    def whitened(self, u: FloatArray) -> ComplexArray:
        """Residuals whose covariance is one, shape (n,): what is left once the gain error has had its say."""
        directions = self.observed.directions
        shares = np.sum(directions**2, axis=0)
        residual = self.deviation(u) * self.observed.weight
        white: ComplexArray = residual - directions @ ((1 - np.sqrt(1 - shares)) / shares * (directions.T @ residual))
        return white

    @property
    def degrees_of_freedom(self) -> float:
        """Real residuals less unknowns that the data, not their priors, determine."""
        return float(2 * self.size - np.count_nonzero(self.precision == 0))


def _parts(values: ComplexArray) -> FloatArray:
    """Real parts, then imaginary parts: real products take half the time of complex ones."""
    return np.concatenate([values.real, values.imag], axis=-1)


def _logarithm(ratio: ComplexArray) -> ComplexArray:
    """Natural logarithm; several times quicker than the library's, which guards against squares out of range."""
    result = np.empty(ratio.shape, dtype=np.complex128)
    result.real = 0.5 * np.log(ratio.real**2 + ratio.imag**2)
    result.imag = np.arctan2(ratio.imag, ratio.real)
    return result


def _wrapped(logarithm: ComplexArray) -> ComplexArray:
    """The phase moved into ±180 degrees."""
    phase = np.remainder(logarithm.imag + np.pi, 2 * np.pi) - np.pi
    result: ComplexArray = logarithm.real + 1j * phase
    return result


def _product(rows: FloatArray, column: FloatArray) -> FloatArray:
    """Matrix times vector for a batch."""
    product: FloatArray = (rows @ column[..., None])[..., 0]
    return product


def _linear_scale(parameter: Parameter) -> float:
    return parameter.sigma if parameter.sigma is not None else 0.5 * (parameter.high - parameter.low)


def residual_parameters(analyser: Analyser, termination: str) -> tuple[Parameter, ...]:
    """What compensation left at one connection."""
    reason = "the analyser's specification"

    def one(name: str, unit: str, sigma: float) -> Parameter:
        # Four standard deviations: beyond that it is no longer within specification, and an effect of the catalogue.
        return Parameter(f"{termination} connection {name}", unit, -4 * sigma, 4 * sigma, reason, "linear", sigma)

    return (
        one("R", "Ohm", analyser.resistance_sigma_ohm),
        one("L", "H", analyser.inductance_sigma_h),
        one("G", "1", 1.0),  # in multiples of the specified conductance, which depends on frequency
        one("C", "F", analyser.capacitance_sigma_f),
    )


def with_connection_residuals(circuit: Node, analyser: Analyser, termination: str, frequency_hz: FloatArray) -> Node:
    """The circuit behind a fixture whose compensation left small residuals."""
    resistance, inductance, conductance, capacitance = residual_parameters(analyser, termination)
    shape: ComplexArray = analyser.conductance_sigma_s(frequency_hz).astype(np.complex128)

    def admittance(s: ComplexArray, multiple: FloatArray, c: FloatArray) -> ValueAndSlopes:
        return multiple * shape + s * c, (shape, s)

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
