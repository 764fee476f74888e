"""Models of spectra for the search over sets of effects (`diagnosis.explore`): effects of source and path are added, swapped and dropped."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from motoremi.arrays import Progress
from motoremi.diagnosis.candidates import prior_of_size
from motoremi.diagnosis.explore import Key, ranked
from motoremi.emission.source_effects import EFFECTS, SourceEffect, find_source_effect
from motoremi.emission.source_starts import chopper_starts
from motoremi.emission.spectrum_fit import EmissionFit, fit_spectra
from motoremi.emission.spectrum_problem import Problem
from motoremi.progress import part

# Penalty in log evidence for a model with a parameter at the bound of its range: odds of 20 to 1.
AT_BOUND_PENALTY = 3.0
# Number of starts that are optimised fully: of the first effect, where there are several minima; of a further effect; and of an effect in place
# of its look-alike, which begins near the solution.
_FROM_AFAR, _BESIDE, _FROM_NEAR = 3, 2, 1


@dataclass(frozen=True, eq=False)
class Candidate:
    """A model with effects added to the one that is diagnosed, refitted.

    Parameters
    ----------
    added : tuple of str
        In the order in which they were added.
    fit : EmissionFit
    score : float
        Log of evidence times prior, with `AT_BOUND_PENALTY`; comparable among models of the same spectra only.
    """

    added: tuple[str, ...]
    fit: EmissionFit
    score: float

    @property
    def effect(self) -> SourceEffect:
        """The effect that was added last."""
        return find_source_effect(self.added[-1])

    @property
    def done(self) -> bool:
        """Always False: the ripple also fits errors of the model, so a small chi2 does not show that nothing is missing.

        At chi2 0.65 an effect still gained 1800 log units.
        """
        return False


# Models whose scores differ by less than this are about equally likely: odds of 20 to 1.
AS_LIKELY = 3.0
# Number of models to which effects are added: the second one is for two effects that together look like a third. It must raise the score by at
# least this share of the gain of the best model.
BEAM, SHARE = 2, 0.3


class SpectrumBoard:
    """Models with further effects in addition to those of one fit.

    Parameters
    ----------
    base : EmissionFit
    """

    def __init__(self, base: EmissionFit) -> None:
        self._base, self._problem = base, base.problem
        # Without a stated speed missing commutations cannot be detected.
        unknown = () if self._problem.repetition_known else ("commutation-jitter",)
        self._possible = [effect.name for effect in EFFECTS if effect.name not in (*base.effects, *unknown)]

    @property
    def much_is_left(self) -> bool:
        """Never: a source or path that is missing shows by itself, since the powers of sources add."""
        return False

    def start(self) -> Candidate:
        """The model with nothing added."""
        return self._weighed(self._base)

    def sets(self, size: int, found: Mapping[Key, Candidate], progress: Progress | None) -> Iterator[Candidate]:
        """The most probable models of one effect less, each with every possible effect added."""
        beam = self._beam(found, size - 1)
        for place, model in enumerate(beam):
            yield from self.beside(model, part(progress, place / len(beam), (place + 1) / len(beam)))

    def beside(self, model: Candidate, progress: Progress | None = None) -> Iterator[Candidate]:
        """The model with each further effect."""
        names = [name for name in self._possible if name not in model.added]
        for index, name in enumerate(names):
            if progress is not None:
                progress(name, index, len(names))
            yield self._weighed(add_effect(self._problem, model.fit, name))

    def _beam(self, found: Mapping[Key, Candidate], size: int) -> list[Candidate]:
        """The models of one size to which effects are added: those that gain at least `SHARE` of what the best one gains.

        Of models that are about equally likely only the best is kept: with spectra, they usually contain look-alikes of the same effect.
        """
        leaders = ranked(found, size)
        least = self.start().score + SHARE * (leaders[0].score - self.start().score)
        kept: list[Candidate] = []
        for model in leaders:
            if model.score >= least and not any(abs(one.score - model.score) < AS_LIKELY for one in kept):
                kept.append(model)
        return kept[:BEAM]

    def swapped(self, model: Candidate, effect: str, only: str = "") -> Iterator[Candidate]:
        """The model with each look-alike of the effect, or `only` one, in its place."""
        effects, values = _without(model.fit, effect)
        for name in self._possible:
            if name not in model.added and _alike(name, effect) and only in ("", name):
                starts = _starts(self._problem, effects, name, [values])
                yield self._weighed(fit_spectra(self._problem, (*effects, name), starts, _FROM_NEAR))

    def dropped(self, model: Candidate, effect: str) -> Candidate:
        """The model without an effect."""
        effects, values = _without(model.fit, effect)
        return self._weighed(fit_spectra(self._problem, effects, [values], _FROM_NEAR))

    def _weighed(self, fit: EmissionFit) -> Candidate:
        added = fit.effects[len(self._base.effects) :]
        prior = prior_of_size(len(added), len(self._possible))
        return Candidate(added, fit, fit.log_evidence - AT_BOUND_PENALTY * bool(fit.at_bound) + prior)


def fit_base(
    problem: Problem, effects: Sequence[str] = (), known: Mapping[str, float] | None = None, progress: Progress | None = None
) -> EmissionFit:
    """The model with the effects of the ladder's last step, without any at first."""
    starts = [{**(known or {}), "step_v": step, "rise_s": rise} for step in (0.3, 1.2) for rise in (2e-7, 1e-6)]
    return fit_spectra(problem, effects, [dict(known), *starts] if known else _with_floor(problem, starts), progress=progress)


def add_effect(problem: Problem, before: EmissionFit, name: str) -> EmissionFit:
    """The model with one more effect, refitted from its own solution and from default values."""
    bases = [dict(before.parameters)]
    if not before.effects:
        # Without the effect the parameters of the base may be at their bounds, so default values are tried as well.
        bases += _with_floor(problem, [{"step_v": 1.0, "rise_s": 6e-7}])
    return fit_spectra(problem, (*before.effects, name), _starts(problem, before.effects, name, bases), _BESIDE if before.effects else _FROM_AFAR)


def _starts(problem: Problem, effects: Sequence[str], name: str, bases: Sequence[Mapping[str, float]]) -> list[dict[str, float]]:
    """An effect's start values together with those of the model without it."""
    starts = []
    for base in bases:
        own = chopper_starts(problem, effects, base) if name == "chopper" else find_source_effect(name).starts or [{}]
        starts += [{**base, **{f"{name}.{key}": value for key, value in start.items()}} for start in own]
    return starts


def _with_floor(problem: Problem, starts: Sequence[Mapping[str, float]]) -> list[dict[str, float]]:
    """Start values of the base parameters: the lowest levels are the floor, the speed is as stated."""
    detector = "average" if "average" in problem.where else problem.detectors[0]
    floor = float(np.percentile(problem.measured_dbuv[problem.where[detector]], 5)) - (0.0 if detector == "average" else 9.0)
    common = {"floor_dbuv": min(floor, 8.0), "offset_db": 0.0, "lisn_factor": 1.0, "speed_factor": 1.0}
    return [{**common, **start} for start in starts]


def _without(fit: EmissionFit, effect: str) -> tuple[tuple[str, ...], dict[str, float]]:
    """A fit's effects and values without one effect, not refitted, as start values."""
    values = {name: value for name, value in fit.parameters.items() if not name.startswith(f"{effect}.")}
    return tuple(name for name in fit.effects if name != effect), values


def _alike(one: str, other: str) -> bool:
    """Whether two effects are known to look alike."""
    return one in find_source_effect(other).look_alikes or other in find_source_effect(one).look_alikes
