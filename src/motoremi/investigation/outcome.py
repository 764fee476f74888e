"""Prediction of a measurement under a condition by a model, and its derivatives for all unknowns.

The outcome is a vector of real numbers. Of a sweep it is ln Z at each frequency (real parts, then imaginary parts). Of a change it is the change
of the coefficient that the analyser measures (a reflection coefficient; for an impedance analyser too, to 50 ohm) in units of a relative change
of Z: whatever both sweeps share (the analyser's errors, what no model describes) is gone, and a change of some milliohms at a resonance of a
tenth of an ohm is the same for all models, also for one that misses that resonance by half. Of a shorting bar
it is Z, of an open fixture 1/Z, in units of what the specification leaves there: a logarithm of next to nothing is anything. What moves
the prediction: the model's own parameters, as far as the sweeps at hand leave them open; the response numbers of the condition, standard
normal; what compensation leaves at a connection that is made anew; and smooth errors, standard normal along the columns of a basis.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from motoremi.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from motoremi.data.analyser import error_basis
from motoremi.data.conditions import NEXT_TO_NOTHING, VALUES, Condition, SingleValue
from motoremi.data.kernels import logarithm, slope, smooth_basis
from motoremi.fitting.problem import behind_fixture, residual_parameters
from motoremi.fitting.result import Fit
from motoremi.investigation.menu import BY_NAME, Option
from motoremi.investigation.responses import Responses, factors, responses
from motoremi.model import laws
from motoremi.model.circuit import Leaf, Node, Parallel, Series, Tape
from motoremi.model.effects import add_effects, find_effect
from motoremi.model.motor import Motor
from motoremi.model.parameter import Parameter

# What no model describes of a change is smooth over this length, in decades; beside it, the place of a resonance moves by as much.
SMOOTH: tuple[tuple[float, float], ...] = ((1.0, 0.6),)
# How well the value of an added part is known, and what a strap of some centimetres has. Assumptions; unconfirmed.
LEAD_TOLERANCE, CAPACITOR_TOLERANCE, STRAP_H = 0.05, 0.02, 50e-9
# Smooth errors of the analyser that do not cancel are left out where they are this small beside the noise.
NEGLIGIBLE = 0.05
# The analyser reads no infinite impedance.
OPEN_OHM = 1e9


@dataclass(frozen=True, eq=False)
class Observed:
    """One sweep under a condition, thinned; without data if it is only predicted.

    Parameters
    ----------
    condition : Condition
    termination : str
    frequency_hz : ndarray, shape (n,)
    sigma : ndarray, shape (n,)
        Noise of ln Z, that of the reference sweep included where it counts.
    impedance_ohm : ndarray, shape (n,), or None
        None for a sweep that is only predicted.
    """

    condition: Condition
    termination: str
    frequency_hz: FloatArray
    sigma: FloatArray
    impedance_ohm: ComplexArray | None = None

    @property
    def key(self) -> bytes:
        """A cache key that is equal for equal data only."""
        values = b"" if self.impedance_ohm is None else self.impedance_ohm.tobytes()
        return f"{self.condition} {self.termination}".encode() + self.frequency_hz.tobytes() + self.sigma.tobytes() + values


class Outcome:
    """The prediction of one model for the sweeps of one condition.

    Parameters
    ----------
    fit : Fit
    sweeps : sequence of Observed
        All of one condition.
    silent : collection of str, optional
        Labels of effects whose stated responses do not come; None for all.
    option : Option, optional
        The row of the menu; by default that of the condition.
    sound : bool
        Whether the analyser has none of the model's errors: what they were taken for is then in the motor, and no standard shows it.
    """

    def __init__(
        self, fit: Fit, sweeps: Sequence[Observed], silent: Collection[str] | None = (), option: Option | None = None, sound: bool = False
    ) -> None:
        self.fit, self.sweeps, self._sound = fit, tuple(sweeps), sound
        self.condition = self.sweeps[0].condition
        self.option = option or BY_NAME[self.condition.id]
        problem = fit.problem
        self._quantity = fit.measurement.analyser.coefficient
        # If the fixture was not compensated before, sweeps after a compensation are the first ones of the motor without it.
        self._bare = self.option.name == "repeat-compensation" and fit.measurement.analyser.fixture is not None
        self._part = _added_part(self.option, self.condition, fit.motor)
        self._names = [p.name for p in problem.everything] + ([] if self._part is None else [self._part.parameter.name])
        found = responses(self.condition, self._names, self.option) if self.option.kind == "change" else Responses((), 1)
        self._responses = found.without(found.answering if silent is None else silent)
        self._anew = self._connections()
        self._units = [self._unit(sweep) for sweep in self.sweeps]
        self.size = self._responses.size + len(self._anew)
        self._varying = np.array([self._names.index(p.name) for p in problem.unknowns], dtype=np.intp)
        self._log = np.array([p.scale == "log" for p in problem.unknowns])
        self._scale = np.array([problem.vector_scale(i) for i in range(len(problem.unknowns))])
        self._tapes = [Tape(self._circuit(sweep), self._names) for sweep in self.sweeps]
        self._before = [None if self.absolute else self._reference_tape(sweep) for sweep in self.sweeps]
        self._kept: dict[int, tuple[FloatArray, tuple[ComplexArray, ComplexArray]]] = {}

    @property
    def answering(self) -> tuple[str, ...]:
        """Labels of the effects that state a response to this condition, which may come or not."""
        return self._responses.answering

    @property
    def absolute(self) -> bool:
        """Whether the sweep is used by itself, not relative to a reference sweep."""
        return self.option.kind != "change" or self._bare

    @cached_property
    def moving(self) -> BoolArray:
        """The unknowns on which it depends by more than a little, shape (k,): of a change those of the parts that respond to it."""
        return np.array([self.absolute or p.name.rpartition(".")[0] in self.answering for p in self.fit.problem.unknowns], dtype=np.bool_)

    @property
    def elsewhere(self) -> bool:
        """Whether the circuit or span differs from that of the fit."""
        return self.option.kind == "sweep" or self._bare

    @property
    def unpredicted(self) -> IntArray:
        """As `Responses.unpredicted`; what compensation leaves anew is predicted."""
        return np.concatenate([self._responses.unpredicted, np.zeros(len(self._anew), dtype=np.intp)])

    @property
    def typical(self) -> FloatArray:
        """As `Responses.typical`; a connection that is made anew is the same."""
        return np.concatenate([self._responses.typical, np.zeros(len(self._anew))])

    @cached_property
    def sigma(self) -> FloatArray:
        """White noise of each number, shape (2 n,)."""
        rows = [
            sweep.sigma if unit is None or sweep.impedance_ohm is None else sweep.sigma * np.abs(unit.number(sweep.impedance_ohm))
            for sweep, unit in zip(self.sweeps, self._units, strict=True)
        ]
        return np.concatenate([np.concatenate([row, row]) for row in rows])

    @cached_property
    def density(self) -> float:
        """Logarithm of what turns a density of these numbers into one of ln Z."""
        return sum(
            2 * float(np.sum(np.log(np.abs(unit.number(sweep.impedance_ohm)))))
            for sweep, unit in zip(self.sweeps, self._units, strict=True)
            if unit is not None and sweep.impedance_ohm is not None
        )

    def _unit(self, sweep: Observed) -> _Unit | None:
        """Of a sweep of next to nothing; None for one that is a logarithm."""
        analyser = self.fit.measurement.analyser
        if analyser.ideal or self.option.name not in NEXT_TO_NOTHING:
            return None
        resistance, inductance, _, capacitance = (float(p.sigma or 0.0) for p in residual_parameters(analyser, sweep.termination))
        omega = 2 * np.pi * sweep.frequency_hz
        if self.option.name == "fixture-short":
            return _Unit(1, np.hypot(resistance, omega * inductance))
        return _Unit(-1, 1 / np.hypot(analyser.conductance_sigma_s(sweep.frequency_hz), omega * capacitance))

    def _connections(self) -> list[tuple[int, float, float]]:
        """Place, mean and standard deviation of what is new in the circuit: an added part, and what compensation leaves at each connection."""
        analyser = self.fit.measurement.analyser
        part = [] if self._part is None else [(len(self._names) - 1, self._part.value, self._part.sigma)]
        if analyser.ideal or self._bare:
            return part
        declared = self.fit.sizes.declared
        connections = tuple(f"{termination} connection" for termination in dict.fromkeys(sweep.termination for sweep in self.sweeps))
        own = [(place, p) for place, p in enumerate(self.fit.problem.everything) if p.name.startswith(connections)]
        return part + [(place, 0.0, declared * float(p.sigma or 0.0)) for place, p in own]

    def _physical(self, u: FloatArray) -> FloatArray:
        """Values of all names; an added part has its nominal one."""
        values = self.fit.problem.physical(u)
        return values if self._part is None else np.append(values, self._part.value)

    def _circuit(self, sweep: Observed) -> Node:
        s: ComplexArray = np.asarray(2j * np.pi * sweep.frequency_hz, dtype=np.complex128)
        circuit = _set_up(self.fit.motor, self.option, self.condition, sweep.termination, s, self._sound)
        circuit = circuit if self._part is None else self._part.beside(circuit, sweep.termination)
        return circuit if self._bare else self._behind(circuit, sweep)

    def _reference_tape(self, sweep: Observed) -> Tape:
        return Tape(self._behind(self.fit.motor.circuit(sweep.termination), sweep), self._names)

    def _behind(self, circuit: Node, sweep: Observed) -> Node:
        analyser = self.fit.measurement.analyser
        return circuit if analyser.ideal else behind_fixture(circuit, analyser, sweep.termination, sweep.frequency_hz)

    def at(self, u: FloatArray, eta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Prediction, shape (2 n,), its derivatives for the model's unknowns, shape (k, 2 n), and for eta, shape (q, 2 n)."""
        values = self._physical(u)
        chain = np.where(self._log, values[self._varying], self._scale)
        factor, slopes = factors(self._responses, eta[: self._responses.size], self._names)
        moved = values * factor
        redrawn = np.zeros(len(self._names), dtype=np.bool_)
        for number, (place, mean_value, sigma) in enumerate(self._anew, start=self._responses.size):
            moved[place] = mean_value + sigma * eta[number]
            redrawn[place] = True
        means, by_u, by_eta = [], [], []
        for number, (sweep, tape, before, unit) in enumerate(zip(self.sweeps, self._tapes, self._before, self._units, strict=True)):
            s: ComplexArray = np.asarray(2j * np.pi * sweep.frequency_hz, dtype=np.complex128)
            with np.errstate(all="ignore"):
                impedance, gradient = tape.gradient(s, moved)
                if before is None:
                    mean, relative = logarithm(impedance), gradient / impedance
                else:
                    reference, tilt = self._before_change(number, before, s, u, values)
                    mean = self._changed(number, reference, impedance)
                    relative, tilt = gradient * self._steepness(number, impedance), tilt * self._steepness(number, reference)
                own = np.where(redrawn[:, None], 0.0, relative * factor[:, None])[self._varying] * chain[:, None]
                response = np.concatenate(
                    [slopes @ (relative * moved[:, None]), *((relative[place] * sigma)[None] for place, _, sigma in self._anew)]
                )
                if before is not None:
                    own = own - tilt[self._varying] * chain[:, None]
                if unit is not None:
                    mean = unit.number(impedance)
                    own, response = unit.power * own * mean, unit.power * response * mean
            means.append(_real(mean))
            by_u.append(_real(own))
            by_eta.append(_real(response))
        together, own_slopes, answers = (_numbers(np.concatenate(parts, axis=-1)) for parts in (means, by_u, by_eta))
        return together, own_slopes, answers

    def _before_change(self, number: int, tape: Tape, s: ComplexArray, u: FloatArray, values: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """The reference sweep of sweep `number` and its derivatives; a search often changes the response alone, so the last ones are kept."""
        kept = self._kept.get(number)
        if kept is None or not np.array_equal(kept[0], u):
            kept = self._kept[number] = (u, tape.gradient(s, values))
        return kept[1]

    @cached_property
    def _per_coefficient(self) -> list[ComplexArray]:
        """Relative change of Z for one of the coefficient, of each sweep: where it was measured, else in the reference sweep."""
        pairs = zip(self.sweeps, self._references, strict=True)
        there = [np.exp(reference) if sweep.impedance_ohm is None else sweep.impedance_ohm for sweep, reference in pairs]
        return [self._quantity.relative(impedance) for impedance in there]

    def _changed(self, number: int, before: ComplexArray, after: ComplexArray) -> ComplexArray:
        """A change of impedance in ohm, as it is compared in sweep `number`."""
        return (self._quantity.coefficient_of(after) - self._quantity.coefficient_of(before)) * self._per_coefficient[number]

    def _steepness(self, number: int, impedance: ComplexArray) -> ComplexArray:
        """The derivative of `_changed` for an impedance in ohm."""
        return self._quantity.slope_ohm / (impedance + self._quantity.pole_ohm) ** 2 * self._per_coefficient[number]

    @cached_property
    def data(self) -> FloatArray:
        """The data, shape (2 n,): ln Z; of a change the coefficient's."""
        rows = []
        for number, (sweep, unit) in enumerate(zip(self.sweeps, self._units, strict=True)):
            assert sweep.impedance_ohm is not None
            if not self.absolute:
                measured = self._changed(number, np.exp(self._references[number]), sweep.impedance_ohm)
            else:
                measured = logarithm(sweep.impedance_ohm) if unit is None else unit.number(sweep.impedance_ohm)
            rows.append(_real(measured))
        return np.concatenate(rows)

    @cached_property
    def _references(self) -> list[ComplexArray]:
        """`_reference` of each sweep."""
        return [self._reference(sweep) for sweep in self.sweeps]

    def _reference(self, sweep: Observed) -> ComplexArray:
        """ln Z of the reference sweep at a sweep's frequencies: between its points the model, with its error interpolated."""
        measurement = self.fit.measurement
        own = next(one for one in measurement.sweeps if one.termination == sweep.termination)
        fitted = self._modelled(own.termination, own.frequency_hz)
        left = logarithm(own.mean_ohm / fitted)
        between = np.interp(np.log(sweep.frequency_hz), np.log(own.frequency_hz), left)
        return between + logarithm(self._modelled(own.termination, sweep.frequency_hz))

    def _modelled(self, termination: str, frequency_hz: FloatArray) -> ComplexArray:
        here = Observed(self.condition, termination, frequency_hz, np.ones_like(frequency_hz))
        s: ComplexArray = np.asarray(2j * np.pi * frequency_hz, dtype=np.complex128)
        with np.errstate(all="ignore"):
            return self._reference_tape(here).impedance(s, self._physical(self.fit.unknowns))

    def residual(self, mean: FloatArray) -> FloatArray:
        """Data less a prediction, phases within half a turn."""
        left = self.data - mean
        start = 0
        for sweep, unit in zip(self.sweeps, self._units, strict=True):
            phases = slice(start + sweep.frequency_hz.size, start + 2 * sweep.frequency_hz.size)
            if unit is None and self.absolute:
                left[phases] -= 2 * np.pi * np.rint(left[phases] / (2 * np.pi))
            start = phases.stop
        return left

    @cached_property
    def smooth(self) -> FloatArray:
        """Columns, shape (p, 2 n), of what no model describes of a condition, for a size of one: in value and in place."""
        count = sum(2 * sweep.frequency_hz.size for sweep in self.sweeps)
        rows, start = [], 0
        for number, (sweep, impedance) in enumerate(zip(self.sweeps, self._there, strict=True)):
            with np.errstate(all="ignore"):
                steepness = slope(sweep.frequency_hz, impedance, float(np.median(sweep.sigma)))
            columns = smooth_basis(sweep.frequency_hz, SMOOTH).T * self._unit_of_change(number)
            place: ComplexArray = np.asarray(np.nan_to_num(steepness) * np.minimum(1.0, 1e3 / np.maximum(np.abs(steepness), 1e-300)) * columns)
            for column in (np.asarray(columns, dtype=np.complex128), np.asarray(1j * columns, dtype=np.complex128), place):
                wide = np.zeros((len(column), count))
                wide[:, start : start + 2 * sweep.frequency_hz.size] = _real(column)
                rows.append(wide)
            start += 2 * sweep.frequency_hz.size
        return np.concatenate(rows)

    @cached_property
    def errors(self) -> FloatArray:
        """Columns, shape (p, 2 n), of the analyser's smooth errors: of a change only what does not cancel."""
        analyser, declared = self.fit.measurement.analyser, self.fit.sizes.declared
        count = sum(2 * sweep.frequency_hz.size for sweep in self.sweeps)
        if analyser.ideal:
            return np.zeros((0, count))
        frequency = np.concatenate([sweep.frequency_hz for sweep in self.sweeps])
        here = _finite(np.concatenate(self._there))
        basis = error_basis(analyser, frequency, here)
        if not self.absolute:
            basis = basis * np.concatenate([self._unit_of_change(number) for number in range(len(self.sweeps))])[:, None]
            if self.option.name == "repeat-compensation":
                basis = np.sqrt(2) * basis
            else:
                before = np.exp(np.concatenate(self._references))
                to_coefficient = np.concatenate(self._per_coefficient) / self._quantity.relative(before)
                basis = basis - error_basis(analyser, frequency, before) * to_coefficient[:, None]
                if np.all(np.abs(basis) < NEGLIGIBLE * np.concatenate([sweep.sigma for sweep in self.sweeps])[:, None]):
                    return np.zeros((0, count))
        columns = declared * basis.T
        parts, start = [], 0
        for sweep, unit in zip(self.sweeps, self._units, strict=True):
            own = slice(start, start + sweep.frequency_hz.size)
            both: ComplexArray = np.concatenate([columns, 1j * columns])[:, own]
            parts.append(_real(both if unit is None else unit.power * unit.number(here[own]) * both))
            start += sweep.frequency_hz.size
        return np.concatenate(parts, axis=1)

    def _unit_of_change(self, number: int) -> ComplexArray:
        """What a relative change of Z of one is in a sweep as it is compared, shape (n,): one where it was measured."""
        if self.absolute:
            return np.ones(self.sweeps[number].frequency_hz.size, dtype=np.complex128)
        return self._per_coefficient[number] / self._quantity.relative(_finite(self._there[number]))

    @cached_property
    def _there(self) -> list[ComplexArray]:
        """Impedance of each sweep, in ohm: as it was measured, otherwise with the most probable response."""
        factor, _ = factors(self._responses, np.zeros(self._responses.size), self._names)
        moved = self._physical(self.fit.unknowns) * factor
        for place, mean_value, _ in self._anew:
            moved[place] = mean_value
        found = []
        for sweep, tape in zip(self.sweeps, self._tapes, strict=True):
            with np.errstate(all="ignore"):
                expected = tape.impedance(np.asarray(2j * np.pi * sweep.frequency_hz), moved)
            found.append(expected if sweep.impedance_ohm is None else sweep.impedance_ohm)
        return found


@dataclass(frozen=True)
class _Unit:
    """A sweep as Z (power 1) or 1/Z (power -1) in units of its own at each frequency."""

    power: int
    impedance_ohm: FloatArray

    def number(self, impedance_ohm: ComplexArray) -> ComplexArray:
        return (impedance_ohm / self.impedance_ohm) ** self.power


@dataclass(frozen=True)
class _AddedPart:
    """A part that a condition adds to the circuit.

    Parameters
    ----------
    parameter : Parameter
    law : Law
    value, sigma : float
        Its nominal value and how well that is known, SI unit.
    terminations : tuple of str
        Sweeps that it is in.
    parallel : bool
    """

    parameter: Parameter
    law: laws.Law
    value: float
    sigma: float
    terminations: tuple[str, ...] = ("short", "open")
    parallel: bool = False

    def beside(self, circuit: Node, termination: str) -> Node:
        """A circuit with the part."""
        if termination not in self.terminations:
            return circuit
        both = (circuit, Leaf("part", self.law, (self.parameter,)))
        return Parallel(both) if self.parallel else Series(both)


def _added_part(option: Option, condition: Condition, motor: Motor) -> _AddedPart | None:
    value = condition.value
    lead = Parameter("added part", "H", 0.0, 1e-3, "", "linear")
    if option.name == "longer-lead" and value is not None:
        return _AddedPart(lead, laws.inductor, value, LEAD_TOLERANCE * value)
    if option.name == "longer-strap" and not (value is None and "ground-strap-inductance" in motor.effects):
        # A motor whose strap is a part of its model has twice as much of it: `Effect.responds`.
        return _AddedPart(lead, laws.inductor, value or 0.0, LEAD_TOLERANCE * value if value else STRAP_H, ("open",))
    if option.name == "known-capacitor" and value is not None:
        capacitor = Parameter("added part", "F", 0.0, 1e-3, "", "linear")
        return _AddedPart(capacitor, laws.capacitor, value, CAPACITOR_TOLERANCE * value, parallel=True)
    return None


class ValueOutcome:
    """The prediction of one model for a single value, as a logarithm; the same interface as `Outcome`.

    Parameters
    ----------
    fit : Fit
    value : SingleValue
    """

    size = 1
    elsewhere = False
    density = 0.0
    unpredicted: IntArray = np.zeros(1, dtype=np.intp)

    def __init__(self, fit: Fit, value: SingleValue) -> None:
        self.fit, self.value = fit, value
        self._names = [p.name for p in fit.problem.everything]
        self._tapes = {termination: Tape(fit.motor.circuit(termination), self._names) for termination in fit.measurement.terminations}
        relative = value.sigma / value.value_si
        self.sigma: FloatArray = np.array([float(np.hypot(relative, self._doubt()))])
        self.data: FloatArray = np.array([np.log(value.value_si)])
        self.errors: FloatArray = np.zeros((0, 1))
        self.smooth: FloatArray = np.ones((1, 1))
        self.moving: BoolArray = np.ones(len(fit.problem.unknowns), dtype=np.bool_)

    def _doubt(self) -> float:
        """How far the quantity may be from what the model calls by its name, as a logarithm."""
        name = self.value.name
        if name == "insulation-resistance":
            return FINITE_DOUBT if self._leaks else LEAKAGE_DOUBT
        if name == "lead-length":
            return LEAD_DOUBT if self._lead is not None else NO_LEAD_DOUBT
        return VALUE_DOUBT[name]

    @property
    def _leaks(self) -> bool:
        """Whether the model has a path to the frame at DC."""
        if "open" not in self.fit.measurement.terminations:
            return False
        fitted = self.fit.problem.physical(self.fit.unknowns[None])
        return bool(np.abs(self._impedance("open", DIRECT_CURRENT_HZ, fitted)[0]) < 0.1 * HIGHEST_INSULATION_OHM)

    @property
    def _lead(self) -> int | None:
        """Place of the lead among the parameters."""
        return next((at for at, p in enumerate(self.fit.problem.everything) if p.name == "lead-inductance.inductance_h"), None)

    @property
    def known(self) -> bool:
        """Whether the model determines the value."""
        return VALUES[self.value.name].termination in (None, *self.fit.measurement.terminations)

    def residual(self, mean: FloatArray) -> FloatArray:
        """Data less a prediction."""
        return self.data - mean

    def at(self, u: FloatArray, eta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """As `Outcome.at`."""
        mean, *nudged = self._predicted(np.concatenate([u[None], u + NUDGE * np.eye(u.size)]))
        return np.array([mean]), np.nan_to_num((np.array(nudged) - mean) / NUDGE)[:, None], np.zeros((1, 1))

    def _predicted(self, u: FloatArray) -> FloatArray:
        """For unknowns of shape (m, k), shape (m,)."""
        values = self.fit.problem.physical(u)
        name = self.value.name
        if name == "lead-length":
            return np.full(len(u), np.log(USUAL_LEAD_M)) if self._lead is None else np.log(values[:, self._lead] / LEAD_H_PER_M)
        if name == "dc-resistance":
            return np.log(np.maximum(self._impedance("short", DIRECT_CURRENT_HZ, values).real, 1e-12))
        if name == "insulation-resistance":
            resistance = np.abs(self._impedance("open", DIRECT_CURRENT_HZ, values))
            return -np.log(1 / resistance + 1 / HIGHEST_INSULATION_OHM)
        admittance = 1 / self._impedance("open", 1e3, values)
        if name == "capacitance-1khz":
            return np.log(np.maximum(admittance.imag / (2 * np.pi * 1e3), 1e-18))
        return np.log(np.maximum(admittance.real / np.maximum(admittance.imag, 1e-18), 1e-9))

    def _impedance(self, termination: str, frequency_hz: float, values: FloatArray) -> ComplexArray:
        """At the motor's terminals, without its cable, for values of shape (m, p), shape (m,)."""
        s: ComplexArray = np.array([2j * np.pi * frequency_hz])
        values = values.copy()
        if CABLE in self.fit.effects:
            for name, value in find_effect(CABLE).effect.limit_values.items():
                values[:, self._names.index(f"{CABLE}.{name}")] = value
        with np.errstate(all="ignore"):
            return self._tapes[termination].impedance(s, values)[:, 0]


# Uncertainties of a single value beyond those of its meter, as logarithms: the motor's temperature (3 K of copper), a capacitance that a bridge
# measures with its leads, an insulation that leaks along paths that no model contains (within a factor of three of 10 GOhm), a lead of 1 uH for
# each metre.
VALUE_DOUBT = {"dc-resistance": 0.015, "capacitance-1khz": 0.01, "tan-delta-1khz": 0.1}
FINITE_DOUBT, LEAKAGE_DOUBT, HIGHEST_INSULATION_OHM = 0.15, 1.1, 10e9
LEAD_H_PER_M, LEAD_DOUBT, USUAL_LEAD_M, NO_LEAD_DOUBT = 1e-6, 0.4, 0.1, 1.2
DIRECT_CURRENT_HZ = 1e-4
CABLE = "supply-cable"
NUDGE = 1e-4


def _set_up(motor: Motor, option: Option, condition: Condition, termination: str, s: ComplexArray, sound: bool) -> Node:
    """The circuit that the analyser measures."""
    value = condition.value
    if option.kind == "standard":
        part = _standard(option.name, value, s)
        own = [name for name in motor.effects if find_effect(name).effect.group == "instrument" and not sound]
        return add_effects(Motor(winding=part, frame=part), own).circuit("short" if termination == "short" else "open")
    if option.name == "far-end-grounded":
        return motor.circuit("grounded")
    return motor.circuit(termination)


def _standard(name: str, value: float | None, s: ComplexArray) -> Node:
    if name == "fixture-open":
        return _known(np.full_like(s, OPEN_OHM))
    if name == "fixture-short":
        return _known(np.full_like(s, 1e-9))
    return _known(np.full_like(s, value or 50.0))


def _known(impedance_ohm: ComplexArray) -> Leaf:
    return Leaf("known", laws.given(impedance_ohm), ())


def _numbers(values: FloatArray) -> FloatArray:
    """The values, with zero and the largest numbers in place of what is none."""
    return values if np.isfinite(values).all() else np.nan_to_num(values)


def _finite(impedance_ohm: ComplexArray) -> ComplexArray:
    return np.where(np.isfinite(impedance_ohm), impedance_ohm, OPEN_OHM)


def _real(values: ComplexArray) -> FloatArray:
    """Real parts, then imaginary parts, along the last axis."""
    return np.concatenate([values.real, values.imag], axis=-1)
