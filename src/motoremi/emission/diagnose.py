"""Which source-side effect is missing from the prediction of a spectrum: the same verdicts, families and next measurement as for impedance."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from motoremi.arrays import FloatArray, JsonDict, Progress
from motoremi.data.spectrum import Spectrum
from motoremi.emission.effects import EFFECTS, SourceEffect, find_source_effect
from motoremi.emission.fit import EmissionFit, fit_spectra
from motoremi.emission.observe import observations
from motoremi.emission.problem import Problem
from motoremi.emission.starts import chopper_starts

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Log evidence that an effect must bring to be believed (some 150 to 1), and within which two effects cannot be told apart.
LEAST_GAIN = 5.0
FAMILY_GAP = 3.0
# A model whose robust chi2 is above this leaves something unexplained; with the right effect it comes to 0.1 to 1.3.
GOOD_CHI2 = 3.0
BOUND_PENALTY = 3.0
# An effect that takes away so much of the squared error, this far ahead of all others, is named even if it does not explain everything.
MOST_OF_IT, FAR_AHEAD = 0.8, 100.0
# How often the catalogue or the noise model is wrong in a way that no evidence shows.
DOUBT, DOUBT_OF_MOST = 0.03, 0.25
PRIOR_OF_NONE = 0.5
_WINDOWS_HZ = ((150e3, 500e3), (500e3, 1.5e6), (1.5e6, 5e6), (5e6, 12e6), (12e6, 20e6), (20e6, 30e6))


@dataclass(frozen=True, eq=False)
class Candidate:
    """A model with one more effect."""

    effect: SourceEffect
    fit: EmissionFit

    @property
    def log_evidence(self) -> float:
        """Of its model, bounds counted against it."""
        return self.fit.log_evidence - BOUND_PENALTY * bool(self.fit.at_bound)


@dataclass(frozen=True, eq=False)
class EmissionDiagnosis:
    """The answer for one set of spectra. Immutable; fields as those of the impedance's diagnosis."""

    verdict: str
    effects: tuple[str, ...]
    families: tuple[tuple[str, ...], ...]
    confidence: float
    base: EmissionFit
    best: EmissionFit
    candidates: tuple[Candidate, ...]
    probabilities: Mapping[str, float]
    where: tuple[JsonDict, ...]
    following: JsonDict
    reasons: tuple[str, ...]
    seen: tuple[JsonDict, ...]

    def to_dict(self) -> JsonDict:
        """The contract's JSON."""
        top = max((c.log_evidence for c in self.candidates), default=0.0)
        return {
            "schema": "motoremi.diagnosis/1",
            "of": "emission",
            "verdict": self.verdict,
            "effects": list(self.effects),
            "families": [list(family) for family in self.families],
            "confidence": self.confidence,
            "base": self.base.figures(),
            "best": self.best.figures(),
            "where": [dict(span) for span in self.where],
            "candidates": [
                {
                    "effect": c.effect.name,
                    "family": c.effect.group,
                    "probability": self.probabilities[c.effect.name],
                    "chi2_reduced": c.fit.chi2_reduced,
                    "rms_error_db": c.fit.rms_error_db,
                    "rms_error_percent": c.fit.figures()["rms_error_percent"],
                    "delta_bic": 2 * (top - c.log_evidence),
                    "parameters": c.fit.own_parameters(c.effect.name),
                    "plausible": not c.fit.at_bound,
                }
                for c in self.candidates
            ],
            "next_measurement": dict(self.following),
            "reasons": list(self.reasons),
            "observations": [dict(one) for one in self.seen],
        }

    def __repr__(self) -> str:
        lines = [f"Diagnosis of the spectra: {self.verdict}" + (f" ({', '.join(self.effects)})" if self.effects else "")]
        lines += [f"  {reason}" for reason in (*self.reasons, *(one["text"] for one in self.seen))]
        return "\n".join([*lines, f"  confidence {self.confidence:.2f}; next: {self.following['why']}"])

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(repr(self))}</pre>"

    def plot(self) -> Figure:
        """The candidates by evidence, those named and those not told apart marked."""
        from motoremi.report.plots import ranking_figure

        return ranking_figure(self.to_dict())


def fit_base(problem: Problem, effects: Sequence[str] = (), known: Mapping[str, float] | None = None) -> EmissionFit:
    """The model with the effects that it has so far, none at first."""
    starts = [{**(known or {}), "step_v": step, "rise_s": rise} for step in (0.3, 1.2) for rise in (2e-7, 1e-6)]
    return fit_spectra(problem, effects, [dict(known), *starts] if known else _with_floor(problem, starts))


def _with_floor(problem: Problem, starts: Sequence[Mapping[str, float]]) -> list[dict[str, float]]:
    """Start values of what every model has: the lowest levels are the floor, the speed is as stated."""
    detector = "average" if "average" in problem.where else problem.detectors[0]
    floor = float(np.percentile(problem.measured_dbuv[problem.where[detector]], 5)) - (0.0 if detector == "average" else 9.0)
    common = {"floor_dbuv": min(floor, 8.0), "offset_db": 0.0, "lisn_factor": 1.0, "speed_factor": 1.0}
    return [{**common, **start} for start in starts]


def add_effect(problem: Problem, before: EmissionFit, name: str) -> EmissionFit:
    """The model with one more effect, refitted from where it stands and from the start."""
    effect = find_source_effect(name)
    bases = [dict(before.parameters)]
    if not before.effects:
        # Without the effect the base may have been bent to its limits: try it unbent as well.
        bases += _with_floor(problem, [{"step_v": 1.0, "rise_s": 6e-7}])
    starts = []
    for base in bases:
        own = chopper_starts(problem, before.effects, base) if name == "chopper" else effect.starts or [{}]
        starts += [{**base, **{f"{name}.{key}": value for key, value in start.items()}} for start in own]
    return fit_spectra(problem, (*before.effects, name), starts, keep=3)


def diagnose_emission(problem: Problem, base: EmissionFit | None = None, progress: Progress | None = None) -> EmissionDiagnosis:
    """Which effect of source or path is missing.

    Parameters
    ----------
    problem : Problem
    base : EmissionFit, optional
        Where the emission's ladder stands; the model without any effect if not given.
    progress : callable, optional
        Told the effect's name, how many are done, and of how many.
    """
    start = base if base is not None else fit_base(problem)
    candidates = _ranked(problem, start, progress)
    probabilities = _probabilities(start, candidates)
    seen = tuple(observations([_as_spectrum(problem, detector) for detector in problem.detectors]))
    where = where_it_fails(start)
    gain = candidates[0].log_evidence - start.log_evidence if candidates else -np.inf
    if gain < LEAST_GAIN:
        return _nothing_to_add(start, candidates, probabilities, where, seen)
    best, families = candidates[0].fit, _family(candidates)
    names: tuple[str, ...] = (candidates[0].effect.name,)
    chance = _share(probabilities, names[0], families)
    second = _ranked(problem, best, progress)
    if second and second[0].log_evidence - candidates[0].log_evidence > LEAST_GAIN and second[0].fit.chi2_reduced <= GOOD_CHI2:
        # With the second in place nothing but the first may be left of its family: only the second's is told.
        chance, families = _share(_probabilities(best, second), second[0].effect.name, _family(second)), _family(second)
        best, names = second[0].fit, (*names, second[0].effect.name)
    explained = 1 - (best.rms_error_db / start.rms_error_db) ** 2
    ahead = len(candidates) == 1 or candidates[0].log_evidence - candidates[1].log_evidence > FAR_AHEAD
    whole = best.chi2_reduced <= GOOD_CHI2
    good = whole or (explained > MOST_OF_IT and ahead)
    text = f"adding {' and '.join(names)} takes the error from {start.rms_error_db:.2f} dB to {best.rms_error_db:.2f} dB rms"
    if not good:
        return EmissionDiagnosis(
            "unexplained", (), (), 1 - DOUBT, start, best, tuple(candidates), probabilities, where,
            {"id": "motor-off", "why": "scan with the motor off, to know what is not the motor's"},
            (f"something is missing (error {start.rms_error_db:.2f} dB rms) and nothing in the catalogue explains it", f"closest: {text}"), seen,
        )  # fmt: skip
    verdict = "family" if families else "missing-effect"
    reasons = [text, *(f"these spectra cannot tell {', '.join(family)} apart" for family in families)]
    doubt = DOUBT
    if not whole:
        doubt = DOUBT_OF_MOST
        reasons.append(f"that is most of it, but not all: {best.rms_error_db:.1f} dB rms are left")
    return EmissionDiagnosis(
        verdict, names, families, (1 - doubt) * chance, start, best, tuple(candidates), probabilities, where,
        _following(names, families), tuple(reasons), seen,
    )  # fmt: skip


def _ranked(problem: Problem, start: EmissionFit, progress: Progress | None) -> list[Candidate]:
    possible = [effect for effect in EFFECTS if effect.name not in start.effects]
    if not problem.repetition_known:
        # Without a stated speed nobody can say whether commutations are missing.
        possible = [effect for effect in possible if effect.name != "commutation-jitter"]
    found = []
    for index, effect in enumerate(possible):
        if progress is not None:
            progress(effect.name, index, len(possible))
        found.append(Candidate(effect, add_effect(problem, start, effect.name)))
    return sorted(found, key=lambda c: -c.log_evidence)


def _probabilities(start: EmissionFit, candidates: Sequence[Candidate]) -> dict[str, float]:
    share = np.log((1 - PRIOR_OF_NONE) / max(1, len(candidates)))
    scores = np.array([np.log(PRIOR_OF_NONE) + start.log_evidence, *(share + c.log_evidence for c in candidates)])
    weights = np.exp(scores - scores.max())
    weights /= weights.sum()
    return {c.effect.name: float(weight) for c, weight in zip(candidates, weights[1:], strict=True)}


def _family(candidates: Sequence[Candidate]) -> tuple[tuple[str, ...], ...]:
    near = [c.effect.name for c in candidates if candidates[0].log_evidence - c.log_evidence < FAMILY_GAP]
    return (tuple(near),) if len(near) > 1 else ()


def _share(probabilities: Mapping[str, float], name: str, families: Sequence[Sequence[str]]) -> float:
    """Probability of an effect and of those that cannot be told from it."""
    return sum(probabilities[one] for one in {name, *(families[0] if families else ())})


def _nothing_to_add(
    start: EmissionFit, candidates: Sequence[Candidate], probabilities: Mapping[str, float], where: tuple[JsonDict, ...], seen: tuple[JsonDict, ...]
) -> EmissionDiagnosis:
    good = start.chi2_reduced <= GOOD_CHI2
    if good:
        verdict, text = (
            "adequate",
            f"the prediction describes the spectra to {start.rms_error_db:.2f} dB rms: nothing in the catalogue would improve it",
        )
        confidence = (1 - DOUBT) * max(0.5, 1 - sum(probabilities.values()))
        following = {"id": "repeat", "why": "nothing is missing; repeat the scan at another speed and current to see whether that stays so"}
    else:
        verdict, text = "unexplained", f"something is missing (error {start.rms_error_db:.2f} dB rms) and nothing in the catalogue explains it"
        confidence = 1 - DOUBT
        following = {"id": "motor-off", "why": "scan with the motor off, to know what is not the motor's"}
    return EmissionDiagnosis(
        verdict, (), (), confidence, start, start, tuple(candidates), dict(probabilities), where, following, (text,), seen
    )  # fmt: skip


def _following(names: Sequence[str], families: Sequence[Sequence[str]]) -> JsonDict:
    members = [*(families[0] if families else names[:1])]
    identifier, why = find_source_effect(members[0]).following
    return {"id": identifier, "why": f"to {'tell ' + ' and '.join(members) + ' apart' if len(members) > 1 else 'confirm ' + members[0]}: {why}"}


def where_it_fails(fit: EmissionFit) -> tuple[JsonDict, ...]:
    """Spans that hold most of the squared error, worst first."""
    spans, total = [], 0.0
    for detector, (frequency, error) in fit.error_db().items():
        total += float(np.sum(error**2))
        for low, high in _WINDOWS_HZ:
            inside = (frequency >= low) & (frequency < high)
            if inside.any():
                part: FloatArray = error[inside]
                spans.append((float(np.sum(part**2)), detector, low, high, float(np.sqrt(np.mean(part**2)))))
    spans.sort(reverse=True)
    return tuple(
        {"sweep": detector, "band_hz": [low, high], "share": square / total if total else 0.0, "rms_error_db": rms,
         "rms_error_percent": 100 * (10 ** (rms / 20) - 1)}
        for square, detector, low, high, rms in spans[:4]
    )  # fmt: skip


def _as_spectrum(problem: Problem, detector: str) -> Spectrum:
    return Spectrum(detector, problem.grid, problem.whole[detector], problem.setup.receiver.band.bandwidth_hz)
