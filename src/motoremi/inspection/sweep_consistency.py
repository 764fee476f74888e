"""Whether the two sweeps can be of one motor: each is fitted alone, and the winding's elements of both fits are compared.

The winding is part of both sweeps. If each sweep can be fitted alone but not both together, they disagree on the winding: they are of
different motors, of different terminals, or of one motor that changed between them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from motoremi.arrays import JsonDict
from motoremi.data.covariance import Sizes
from motoremi.data.measurement import Measurement
from motoremi.data.sweep import ImpedanceSweep
from motoremi.fitting.fit import fit
from motoremi.fitting.race import ALL, Round, Rounds, Trail, race
from motoremi.fitting.refit import on_all_points
from motoremi.fitting.result import Fit
from motoremi.fitting.search import Task
from motoremi.fitting.starts import data_driven_starts
from motoremi.inspection.causal import CausalModel, alone, check_causality
from motoremi.model.circuit import Tape
from motoremi.model.motor import dc_motor
from motoremi.quantities import show
from motoremi.workers import Map

Value = TypeVar("Value")
# For the open-circuit sweep alone every start value is followed to its own solution, because each may attribute another resonance to the winding.
EACH = Rounds((Round(80, 40, 1, ALL),), ALL, 80)
WINDING = ("Ra", "La", "Ca")
# Number of standard deviations beyond which two values count as different.
DIFFERENT = 5.0
# Inductance hardly depends on temperature, capacitance does: beyond these relative changes it is another winding, not a warmer one.
ANOTHER_WINDING: Mapping[str, float] = {"La": 0.02, "Ca": 0.1}


@dataclass(frozen=True, eq=False)
class Disagreement:
    """An element with its value in the fit of each sweep alone, SI units."""

    element: str
    unit: str
    short: float
    open: float

    @property
    def change(self) -> float:
        """Relative difference, open against short."""
        return self.open / self.short - 1

    def __str__(self) -> str:
        values = f"{show(self.short, self.unit)} in the short, {show(self.open, self.unit)} in the open sweep"
        return f"{self.element} {values} ({100 * self.change:+.2g} %)"


@dataclass(frozen=True, eq=False)
class SweepConsistency:
    """Whether two sweeps can be of one motor. Immutable.

    Parameters
    ----------
    alone : dict
        Termination -> fit of that sweep alone; without the open-circuit sweep if the short-circuit sweep cannot be fitted.
    fits_alone : dict
        Termination -> whether that fit describes the sweep; the same terminations.
    fits_together : bool
    disagreements : tuple of Disagreement
        Winding elements on which the sweeps differ beyond their error bars, largest change first.
    """

    alone: dict[str, Fit]
    fits_alone: dict[str, bool]
    fits_together: bool
    disagreements: tuple[Disagreement, ...]

    @property
    def belong(self) -> bool:
        """False if each sweep can be fitted alone but not both together: the circuit lacks nothing, the sweeps disagree."""
        return self.fits_together or not all(self.fits_alone.values()) or not self.disagreements

    @property
    def other_winding(self) -> bool:
        """Whether the difference is too large for one winding at two temperatures."""
        return any(abs(d.change) > ANOTHER_WINDING.get(d.element, np.inf) for d in self.disagreements)

    @property
    def sentence(self) -> str:
        """The finding in words."""
        if self.fits_together:
            return "the two sweeps fit together: they can be of one motor"
        if not all(self.fits_alone.values()):
            poor = " and ".join(t for t, good in self.fits_alone.items() if not good)
            return f"the {poor} sweep does not fit alone either: something is missing in the model, whatever the other sweep says"
        if not self.disagreements:
            return "each sweep fits alone but not both together, though no winding element differs beyond its error bar"
        what = "; ".join(map(str, self.disagreements))
        if self.other_winding:
            return f"the sweeps fit alone, not together: they look like two different motors or pairs of terminals ({what}); check the files"
        return f"the sweeps fit alone, not together: the motor or the connection changed between them ({what}); repeat both in one go"

    def to_dict(self) -> JsonDict:
        """Plain data."""
        return {
            "schema": "motoremi.together/1",
            "belong": self.belong,
            "fits_together": self.fits_together,
            "fits_alone": dict(self.fits_alone),
            "disagreements": [{"element": d.element, "unit": d.unit, "short": d.short, "open": d.open} for d in self.disagreements],
            "sentence": self.sentence,
        }

    def __repr__(self) -> str:
        return self.sentence


def check_sweep_consistency(both: Fit, each: Map = map) -> SweepConsistency | None:
    """Fit each sweep alone with the model of a fit, and compare the two results.

    Parameters
    ----------
    both : Fit
        Of both sweeps.
    each : callable
        As the built-in `map`.

    Returns
    -------
    SweepConsistency or None
        None if there is only one sweep.
    """
    measurement = both.measurement
    if len(measurement.sweeps) < 2:
        return None
    short = _short_alone(both)
    if not short.explained:
        # The model lacks something, whatever the fit of the other sweep alone would show; that fit would take long.
        return SweepConsistency({"short": short}, {"short": False}, both.explained, ())
    open_ = _open_alone(both, each)
    return SweepConsistency({"short": short, "open": open_}, {"short": True, "open": open_.explained}, both.explained, _disagreements(short, open_))


def _short_alone(both: Fit) -> Fit:
    measurement = alone(both.measurement, "short")
    return fit(both.motor, measurement, seed=both.seed, bounds=_seen(both, "short", both.bounds), held=_seen(both, "short", both.held))


def _open_alone(both: Fit, each: Map) -> Fit:
    """The fit of the open-circuit sweep alone: each of its resonances is attributed to the winding in turn.

    Of the solutions that describe the sweep, the one nearest to the joint fit is returned: in this sweep the circuit's two resonances can be
    exchanged, so one good solution alone does not show which of them is the winding's.
    """
    measurement = alone(both.measurement, "open")
    task = Task(both.motor, measurement, both.bounds, both.held)
    starts = [{**both.parameters}]
    for winding in _windings(check_causality(measurement).models["open"]):
        starts += [{**both.parameters, **start} for start in _with_frames(winding, measurement)]
    # The discrepancy of the joint fit does not apply to one sweep alone: the search begins with default sizes.
    trails = {index: Trail(task, [start], 1, Sizes(1.0, 1.0)) for index, start in enumerate(starts)}
    found = race(trails, EACH, each=each).solutions
    fits = list(each(on_all_points, [(trails[index], solution, both) for index, solution in found.items()]))
    good = [one for one in fits if one.explained]
    if good:
        return min(good, key=lambda one: abs(np.log(one.parameters["La"] / both.parameters["La"])))
    return max(fits, key=lambda one: one.log_evidence)


def _windings(model: CausalModel) -> list[dict[str, float]]:
    """Ra, La, Ca of a parallel resonance with the pole and residue of each of a sweep's resonances."""
    found = []
    for pole, residue in model.resonances():
        if residue.real > 0:
            capacitance = 1 / (2 * residue.real)
            inductance = 1 / (abs(pole) ** 2 * capacitance)
            found.append({"Ra": -2 * pole.real * inductance, "La": inductance, "Ca": capacitance})
    return found


def _with_frames(winding: dict[str, float], measurement: Measurement) -> list[Mapping[str, float]]:
    """Start values of all elements: those of the path to the frame are computed from the sweep without such a winding."""
    motor, sweep = dc_motor(), measurement.coarse.sweeps[0]
    frequency = sweep.frequency_hz
    names = [p.name for p in motor.parameters if p.name in winding]
    would_be = Tape(motor.circuit("short"), names).impedance(
        np.asarray(2j * np.pi * frequency, dtype=np.complex128), np.array([winding[name] for name in names])
    )
    both = Measurement.of([ImpedanceSweep("short", frequency, would_be), ImpedanceSweep("open", frequency, sweep.mean_ohm)])
    return list(data_driven_starts(both))


def _seen(both: Fit, termination: str, values: Mapping[str, Value]) -> dict[str, Value]:
    used = both.motor.used_parameters(termination)
    return {name: value for name, value in values.items() if name in used}


def _disagreements(short: Fit, open_: Fit) -> tuple[Disagreement, ...]:
    units = {p.name: p.unit for p in short.motor.parameters}
    found = []
    for name in WINDING:
        one, other = short.parameters[name], open_.parameters[name]
        if abs(one - other) > DIFFERENT * np.hypot(_sigma(short, name), _sigma(open_, name)):
            found.append(Disagreement(name, units[name], one, other))
    return tuple(sorted(found, key=lambda d: -abs(d.change)))


def _sigma(fit: Fit, name: str) -> float:
    """Standard deviation of a winding's element from the local covariance, without the alternative that the resonances are exchanged."""
    names = [parameter.name for parameter in fit.problem.unknowns]
    if name not in names:  # held
        return 0.0
    index = names.index(name)
    return float(fit.parameters[name] * np.sqrt(fit.covariance[index, index]))
