"""Fit of source and path to measured spectra: the best of several local minima."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from motoremi.arrays import FloatArray, FrozenDict, JsonDict, Progress
from motoremi.drawing import figure_of
from motoremi.emission.posterior import Posterior, to_unit
from motoremi.emission.setup import Setup
from motoremi.emission.source_effects import find_source_effect
from motoremi.emission.spectrum_problem import Problem
from motoremi.progress import part
from motoremi.threads import one_blas_thread

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Number of starts that are first optimised for a few steps, and the number of these steps; then the best of them are optimised fully.
_TRIED, _FEW_STEPS = 20, 5


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

    def __post_init__(self) -> None:
        object.__setattr__(self, "parameters", FrozenDict(self.parameters))

    def setup(self) -> Setup:
        """The set-up that the fit found, to predict from."""
        return self.problem.setup_for(self.effects, self.parameters)

    def error_db(self) -> dict[str, tuple[FloatArray, FloatArray]]:
        """Detector -> frequencies and measured minus model."""
        error = self.problem.error(self.effects, self.parameters)
        return {detector: (self.problem.frequency_hz[at], error[at]) for detector, at in self.problem.where.items()}

    @property
    def floor_db(self) -> float:
        """The floor: rms error that a correct model would have because of the scatter of the readings and the errors of the formulas."""
        return _rms(self.problem.sigma_db)

    def figures(self) -> JsonDict:
        """Effects and errors for the JSON of a diagnosis."""
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
        """Parameters of one effect by short name."""
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
        return figure_of(self)


@one_blas_thread
def fit_spectra(
    problem: Problem, effects: Sequence[str], starts: Sequence[Mapping[str, float]], keep: int = 2, progress: Progress | None = None
) -> EmissionFit:
    """The best of several local fits.

    Parameters
    ----------
    problem : Problem
    effects : sequence of str
    starts : sequence of mapping
        Values by name; a parameter without a value starts in the middle of its range.
    keep : int
        Number of starts that are optimised fully.
    progress : callable, optional
        Called at each step of these.
    """
    posterior = Posterior(problem, tuple(effects))
    unknowns = posterior.unknowns
    points = [np.array([np.clip(to_unit(p, start.get(p.name, p.middle)), 0.01, 0.99) for p, _ in unknowns], dtype=np.float64) for start in starts]
    ranked = sorted(points, key=posterior.at_start)
    if len(ranked) > _TRIED:
        # Starts can only be compared after step, offset and ripple have been adjusted to them.
        tried = sorted((posterior.polished(start, _FEW_STEPS) for start in ranked[:_TRIED]), key=lambda found: found.cost)
        ranked = [found.x for found in tried]
    followed = [
        posterior.polished(start, progress=part(progress, index / len(ranked[:keep]), (index + 1) / len(ranked[:keep])))
        for index, start in enumerate(ranked[:keep])
    ]
    best = min(followed, key=lambda found: found.cost)
    values = posterior.values(best.x)
    rms_error_db = _rms(problem.error(effects, values))
    own = [(p.name, float(unit)) for (p, _), unit in zip(unknowns, best.x, strict=False) if "." in p.name]
    at_bound = tuple(name for name, unit in own if unit < 1e-3 or unit > 1 - 1e-3)
    evidence = posterior.evidence(best.x, best.cost)
    return EmissionFit(problem, tuple(effects), values, posterior.chi2_reduced(best.x), rms_error_db, evidence, at_bound)


def restored(problem: Problem, stored: JsonDict) -> EmissionFit:
    """A fit from its plain data and its problem; its error is computed again, because the model of the motor may have changed since."""
    values = {str(name): float(value) for name, value in stored["parameters"].items()}
    effects = tuple(str(name) for name in stored["effects"])
    return EmissionFit(
        problem, effects, values, float(stored["chi2_reduced"]), _rms(problem.error(effects, values)),
        float(stored["log_evidence"]), tuple(stored["at_bound"]),
    )  # fmt: skip


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
