"""The value that one element would need at each frequency for the model to be exact.

The impedance of a one-port depends on the impedance x of any one of its parts as Z(x) = (a + b x) / (c + d x) (bilinear theorem): three
probes give the coefficients, and Z(x) = measured is solved for x. Where a part occurs more than once (along a line) this is the step of an
iteration. An element means the element with all effects on it: `La` with laminations is the whole dispersive inductance. The model's other
elements take the values that they have when this one is free (see `free_element`).
"""

from __future__ import annotations

import dataclasses
import html
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from motoremi.arrays import BoolArray, ComplexArray, FloatArray, JsonDict
from motoremi.drawing import figure_of
from motoremi.errors import BadInput
from motoremi.fitting.problem import behind_fixture
from motoremi.fitting.result import Fit
from motoremi.given import refuse_other
from motoremi.inspection.dispersion import BY_UNIT, CLEARLY_BETTER, CONSTANT_ENOUGH, DESCRIBES, DispersionFit, fit_laws
from motoremi.inspection.element_circuit import ELEMENTS, distinct, outermost, substituted, whole_element, with_element
from motoremi.inspection.free_element import with_free
from motoremi.model import laws
from motoremi.model.circuit import Leaf, Node, Scaled, Tape, ThroughCable, Wrapped, walk
from motoremi.model.parameter import Parameter
from motoremi.quantities import percent, show, show_band
from motoremi.threads import one_blas_thread

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# A point with a larger relative standard uncertainty than this says nothing about the element.
KNOWN = 0.5
# Iterations for a part that occurs more than once, and the tolerance of the solution.
ITERATIONS = 8
SOLVED = 1e-7
UNITS = {"R": "Ohm", "L": "H", "C": "F"}
# Smallest number of known points to which laws are fitted.
FEWEST_POINTS = 12


@dataclass(frozen=True, eq=False)
class ElementCurve:
    """An element as one sweep requires it, shape (n,) each.

    Parameters
    ----------
    termination : str
    frequency_hz : ndarray
    value : ndarray
        Complex, in the element's unit: Z for ohm, Z/s for henry, Y/s for farad. Losses are minus the imaginary part of the latter two.
    sigma_relative : ndarray
        Standard uncertainty of the real and of the imaginary part, relative to the magnitude: noise, the analyser's specification, and how
        well the other elements are known. Infinite where no value makes the model exact.
    model : ndarray
        The value in the fitted model.
    """

    termination: str
    frequency_hz: FloatArray
    value: ComplexArray
    sigma_relative: FloatArray
    model: ComplexArray

    @property
    def known(self) -> BoolArray:
        """Points at which the sweep determines the element."""
        return self.sigma_relative < KNOWN

    def to_dict(self) -> JsonDict:
        """Plain data; null where nothing is known."""
        known = self.known

        def listed(values: FloatArray) -> list[float | None]:
            return [float(v) if ok else None for v, ok in zip(values, known, strict=True)]

        return {
            "sweep": self.termination,
            "frequency_hz": self.frequency_hz.tolist(),
            "real": listed(self.value.real),
            "imag": listed(self.value.imag),
            "sigma": listed(np.where(known, self.sigma_relative, 0.0) * np.abs(np.where(known, self.value, 0.0))),
            "model_real": self.model.real.tolist(),
            "model_imag": self.model.imag.tolist(),
            "known": known.tolist(),
        }


@dataclass(frozen=True, eq=False)
class Inspection:
    """The value that an element would need for the model to be exact. Immutable.

    Parameters
    ----------
    element : str
        Of the circuit, or an effect's part.
    unit : str
        H stands for a complex inductance Z/s, F for a complex capacitance Y/s, Ohm for an impedance, S for an admittance, s for a delay,
        1 for a factor.
    effects : tuple of str
        Effects in the model.
    curves : tuple of ElementCurve
        One for each sweep that depends on the element.
    laws : dict
        Termination -> laws that were tried on the curve, best first.
    """

    element: str
    unit: str
    effects: tuple[str, ...]
    curves: tuple[ElementCurve, ...]
    laws: dict[str, list[DispersionFit]]

    @property
    def readings(self) -> dict[str, str]:
        """Termination -> the law that the curve follows, in words."""
        return {curve.termination: self._reading(curve) for curve in self.curves}

    def _reading(self, curve: ElementCurve) -> str:
        known = curve.known
        if not known.any():
            return f"says nothing about {self.element}: the uncertainty is above {100 * KNOWN:.0f} % everywhere"
        tried = self.laws.get(curve.termination, [])
        if not tried:
            return "no law was tried on it"
        best = tried[0]
        constant = next(fit for fit in tried if fit.law.name == "constant")
        if constant.chi2_reduced < CONSTANT_ENOUGH or constant.bic - best.bic < CLEARLY_BETTER:
            if constant.rms_error_percent > 100 * KNOWN:
                return f"no simple law describes it ({percent(constant.rms_error_percent, 2)} left with a constant)"
            return f"a constant describes it (within {percent(constant.rms_error_percent, 2)})"
        left = f"{percent(best.rms_error_percent, 2)} left, {percent(constant.rms_error_percent, 2)} with a constant"
        if best.chi2_reduced > DESCRIBES:
            return f"no simple law describes it; nearest: {best.law.name} ({left})"
        own = ", ".join(f"{name} {show(value, _unit_of(name), 3)}" for name, value in list(best.parameters.items())[1:])
        effects = f"; effects with this law: {', '.join(best.law.effects)}" if best.law.effects else ""
        return f"looks like: {best.law.name} ({own}; {left}){effects}"

    def to_dict(self) -> JsonDict:
        """Plain data, SI units."""
        return {
            "schema": "motoremi.inspection/1",
            "element": self.element,
            "unit": self.unit,
            "effects": list(self.effects),
            "sweeps": [
                {
                    **curve.to_dict(),
                    "reading": self.readings[curve.termination],
                    "laws": [fit.to_dict() for fit in self.laws.get(curve.termination, [])],
                }
                for curve in self.curves
            ],
        }

    def __repr__(self) -> str:
        lines = [f"{self.element}: what it would have to be for the model to be exact"]
        for curve in self.curves:
            known = curve.known
            if known.any():
                f, value = curve.frequency_hz[known], curve.value[known]
                lines.append(
                    f"  {curve.termination:5s} {show_band(f[0], f[-1])}: {_range(value.real, self.unit)} "
                    f"(the model has {_range(curve.model[known].real, self.unit)}), {_lossy(self.unit, value)}, "
                    f"known to {percent(100 * np.median(curve.sigma_relative[known]), 2)} (median)"
                )
            lines.append(f"  {curve.termination:5s} {self.readings[curve.termination]}")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        head, *rest = repr(self).splitlines()
        return f"<b>{html.escape(head)}</b><ul>{''.join(f'<li>{html.escape(line.strip())}</li>' for line in rest)}</ul>"

    def plot(self) -> Figure:
        """Value and losses over frequency with the uncertainty as a band."""
        return figure_of(self)


def _range(values: FloatArray, unit: str) -> str:
    low, high = float(values.min()), float(values.max())
    return show(low, unit) if high - low < 1e-3 * abs(high) else f"{show(low, unit)} to {show(high, unit)}"


def _lossy(unit: str, value: ComplexArray) -> str:
    if unit in ("H", "F"):
        loss = -value.imag / value.real
        return f"loss tangent {loss.min():.3g} to {loss.max():.3g}"
    return f"imaginary part {show(value.imag.min(), unit)} to {show(value.imag.max(), unit)}"


def _unit_of(name: str) -> str:
    endings = {"_hz": "Hz", "_ohm": "Ohm", "_h": "H", "_f": "F", "_m": "m"}
    return next((unit for ending, unit in endings.items() if name.endswith(ending)), "")


@one_blas_thread
def inspect(fit: Fit, element: str) -> Inspection:
    """The value that an element would need at each frequency for the model to be exact.

    Parameters
    ----------
    fit : Fit
    element : str
        Ra, La, Ca, Rr, Lr, Cr or Cf, with all effects on it; or an effect of the model, whose own part (a cell, a film, a factor) is meant.

    Returns
    -------
    Inspection

    Raises
    ------
    BadInput
        For an unknown element, one that no sweep depends on, or an effect that is not a single part of the circuit.
    """
    refuse_other(fit, Fit, "inspect needs a Fit")
    names = (*ELEMENTS, *_labels(fit.effects))
    if element not in names:
        raise BadInput(f"unknown element {element!r}: use one of {', '.join(names)}")
    targets = _targets(fit, element)
    if not targets:
        raise BadInput(f"none of the sweeps depends on {element}: measure the other sweep too")
    unit = next(iter(targets.values())).unit
    curves = tuple(_curve(target, termination) for termination, target in targets.items())
    tried = {}
    for curve in curves:
        known = curve.known
        if known.sum() >= FEWEST_POINTS and unit in BY_UNIT:
            tried[curve.termination] = fit_laws(BY_UNIT[unit], curve.frequency_hz[known], curve.value[known], curve.sigma_relative[known])
    return Inspection(element, unit, fit.effects, curves, tried)


def _labels(effects: Sequence[str]) -> list[str]:
    """Effects as their parameters name them: a second of one kind is called `name#2`."""
    return [e if effects[: i + 1].count(e) == 1 else f"{e}#{effects[: i + 1].count(e)}" for i, e in enumerate(effects)]


@dataclass(frozen=True)
class _Target:
    """A part that can take any value.

    Parameters
    ----------
    unit : str
    fit : Fit
        The model, its other elements as they are once this one is free.
    model : callable
        s -> the value that the model to be inspected has.
    circuit : callable
        Value -> the circuit with it.
    own : callable
        (s, value) -> the value in `unit`.
    """

    unit: str
    fit: Fit
    model: Callable[[ComplexArray], ComplexArray]
    circuit: Callable[[ComplexArray], Node]
    own: Callable[[ComplexArray, ComplexArray], ComplexArray]


_OWN: dict[str, Callable[[ComplexArray, ComplexArray], ComplexArray]] = {
    "Ohm": lambda s, z: z,
    "H": lambda s, z: z / s,
    "F": lambda s, z: 1 / (s * z),
}


def _targets(fit: Fit, element: str) -> dict[str, _Target]:
    """The part called `element` in the circuit of each termination that depends on it."""
    terminations = fit.measurement.terminations
    if element in ELEMENTS:
        if element not in fit.parameters:
            return {}
        free = with_free(fit, element)
        return {t: _element_target(fit, free, element, t) for t in terminations if element in fit.motor.used_parameters(t)}
    found = {t: _part_target(fit, element, t) for t in terminations}
    return {t: target for t, target in found.items() if target is not None}


def _element_target(fit: Fit, free: Fit, element: str, termination: str) -> _Target:
    def circuit(x: ComplexArray) -> Node:
        return with_element(fit.motor, element, lambda whole: Leaf(element, laws.given(x), ())).circuit(termination)

    unit = UNITS[element[0]]
    return _Target(unit, free, lambda s: _impedance_of(fit, whole_element(fit.motor, element), s), circuit, _OWN[unit])


def _part_target(fit: Fit, effect: str, termination: str) -> _Target | None:
    """The one part of the circuit that an effect has added, or the factor by which it changes another."""
    circuit = fit.motor.circuit(termination)
    prefix = f"{effect}."
    parts = distinct(outermost(circuit, prefix))
    inside = [node for part in parts for node in walk(part)]
    wrapped = [node for node in walk(circuit) if isinstance(node, Wrapped) and node.parameters and node not in inside]
    wraps = distinct([node for node in wrapped if node.parameters[0].name.startswith(prefix)])
    if len(parts) + len(wraps) == 0:
        return None
    if len(parts) + len(wraps) > 1:
        raise BadInput(f"{effect} is not a single part of the circuit: inspect an element instead ({', '.join(ELEMENTS)})")
    if not parts:
        wrap = wraps[0]
        assert isinstance(wrap, Wrapped)
        return _wrap_target(fit, wrap, circuit)
    part = parts[0]
    # A capacitance with a loss angle is a complex one.
    units = {p.unit for node in walk(part) for p in node.own_parameters if p.unit}
    unit = units.pop() if units in ({"H"}, {"F"}) else "Ohm"
    return _Target(
        unit=unit,
        fit=fit,
        model=lambda s: _impedance_of(fit, part, s),
        circuit=lambda x: substituted(circuit, part, Leaf(effect, laws.given(x), ())),
        own=_OWN[unit],
    )


def _wrap_target(fit: Fit, wrap: Wrapped, circuit: Node) -> _Target:
    """The factor, admittance or line of a part that wraps another."""

    def model(s: ComplexArray) -> ComplexArray:
        return np.asarray(wrap.law(s, *(np.array([fit.parameters[p.name]]) for p in wrap.parameters))[0], dtype=np.complex128)

    def changed(x: ComplexArray) -> Node:
        return substituted(circuit, wrap, dataclasses.replace(wrap, law=laws.given(x), parameters=()))

    if isinstance(wrap, ThroughCable):
        return _Target("s", fit, model, changed, lambda s, x: np.arctanh(x) / s)
    if isinstance(wrap, Scaled):
        return _Target("1", fit, model, changed, lambda s, x: x)
    if {p.unit for p in wrap.parameters} == {"F"}:
        return _Target("F", fit, model, changed, lambda s, y: y / s)
    return _Target("S", fit, model, changed, lambda s, y: y)


def _curve(target: _Target, termination: str) -> ElementCurve:
    fit = target.fit
    observed, analyser = fit.weighed.observed, fit.measurement.analyser
    sweep = next(s for s in observed.sweeps if s.termination == termination)
    measured: ComplexArray = sweep.measured * np.exp(-fit.weighed.smooth_error(fit.unknowns)[observed.slices[termination]])

    def circuit(x: ComplexArray) -> Node:
        bare = target.circuit(x)
        return bare if analyser.ideal else behind_fixture(bare, analyser, termination, sweep.frequency_hz)

    model = target.model(sweep.s)
    needed, slope = _solved(lambda x: _impedance_of(fit, circuit(x), sweep.s), model, measured)
    relative = np.hypot(np.sqrt(2 * sweep.part.noise.variance), fit.sizes.declared * analyser.uncertainty(sweep.frequency_hz, measured))
    with np.errstate(all="ignore"):
        from_sweep = np.abs(slope * measured / needed) * relative / np.sqrt(2)
        from_others = np.abs(slope / needed) * _impedance_sigma(fit, circuit(needed), sweep.s) / np.sqrt(2)
        sigma = np.hypot(from_sweep, from_others)
        value = target.own(sweep.s, needed)
    return ElementCurve(
        termination, sweep.frequency_hz, np.nan_to_num(value), np.nan_to_num(sigma, nan=np.inf, posinf=np.inf), target.own(sweep.s, model)
    )


def _impedance_sigma(fit: Fit, circuit: Node, s: ComplexArray) -> FloatArray:
    """Standard uncertainty of |Z| in ohm from the parameters that a circuit shares with a fit."""
    problem = fit.problem
    names, values = _values(fit, circuit)
    slopes = Tape(circuit, names).gradient(s, values)[1]
    rows, shared = [], []
    for index, parameter in enumerate(problem.unknowns):
        if parameter.name in names:
            position = names.index(parameter.name)
            unit = values[position] if parameter.scale == "log" else problem.vector_scale(index)
            rows.append(slopes[position] * unit)
            shared.append(index)
    if not rows:  # all that the circuit has is held
        return np.zeros(s.shape)
    jacobian = np.array(rows)
    covariance = fit.covariance[np.ix_(shared, shared)]
    variance = np.einsum("in,ij,jn->n", jacobian.conj(), covariance, jacobian).real
    return np.sqrt(np.maximum(variance, 0.0))


def _values(fit: Fit, node: Node) -> tuple[list[str], FloatArray]:
    """Names and fitted values of a circuit's parameters."""
    values = {**fit.parameters, **fit.nuisance}
    parameters: dict[str, Parameter] = {p.name: p for part in walk(node) for p in part.own_parameters}
    return list(parameters), np.array([values.get(name, parameter.middle) for name, parameter in parameters.items()])


def _impedance_of(fit: Fit, node: Node, s: ComplexArray) -> ComplexArray:
    names, values = _values(fit, node)
    return Tape(node, names).impedance(s, values)


def _solved(impedance: Callable[[ComplexArray], ComplexArray], start: ComplexArray, wanted: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """The x at which impedance(x) takes the wanted values, and dx/dZ there; not a number where none is found."""
    x, spread = start, 2.0
    with np.errstate(all="ignore"):
        for _ in range(ITERATIONS):
            probes = [x / spread, x, x * spread]
            x, slope = solve_bilinear(probes, [impedance(probe) for probe in probes], wanted)
            spread = 1.05
            miss = np.abs(impedance(x) / wanted - 1)
            if np.all(miss < SOLVED):
                break
    return np.where(miss < SOLVED, x, np.nan), slope


def solve_bilinear(probes: Sequence[ComplexArray], seen: Sequence[ComplexArray], wanted: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """The x at which a bilinear Z(x) takes the wanted values, and dx/dZ there.

    Parameters
    ----------
    probes, seen : three arrays each, shape (n,)
        Values x and Z(x).
    wanted : ndarray, shape (n,)

    Notes
    -----
    A bilinear map keeps cross ratios: (x, x1; x2, x3) = (Z, Z1; Z2, Z3).
    """
    x1, x2, x3 = probes
    z1, z2, z3 = seen
    scale = (x3 - x1) / (x3 - x2)
    top, bottom = scale * (wanted - z1) * (z3 - z2), (wanted - z2) * (z3 - z1)
    x = (x1 * bottom - x2 * top) / (bottom - top)
    slope = scale * (x1 - x2) * (z3 - z2) * (z3 - z1) * (z1 - z2) / (bottom - top) ** 2
    return x, slope
