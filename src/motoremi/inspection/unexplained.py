"""Findings for data that nothing in the catalogue explains: the best error of any linear circuit, where an error remains, what to check.

Three findings, the most important first: the data do not come from a fixed linear circuit (check the measurement); each sweep can be fitted
alone but not both together (check the files); or physics is missing (inspect the element that, free to vary, would lower the error most).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from motoremi.arrays import JsonDict
from motoremi.fitting.problem import AS_DECLARED
from motoremi.fitting.result import Fit
from motoremi.inspection.causal import MOST_POLES, CausalCheck, check_causality, smoothed
from motoremi.inspection.compare import spans_of
from motoremi.inspection.element_circuit import ELEMENTS
from motoremi.inspection.free_element import roughly_freed
from motoremi.inspection.sweep_consistency import SweepConsistency, check_sweep_consistency
from motoremi.quantities import show_band
from motoremi.workers import Map

# Mean variance of whitened residuals, in a window of a few points, above which an error remains.
LEFT_OVER = 3.0
# Variances below this share of the largest one are ignored: the elements compensate for the missing effect and cause small errors elsewhere.
SHARE = 0.05
# Elements are suggested for inspection if, free to vary, they leave at most this many times what the best one leaves.
ALSO = 2.0


@dataclass(frozen=True, eq=False)
class Remainder:
    """What is left unexplained. Immutable.

    Parameters
    ----------
    noise_multiple : dict
        Termination -> error of the closest model in multiples of the random noise, with an analyser as declared.
    causality : CausalCheck
        The error that an unrestricted causal model reaches.
    together : SweepConsistency or None
        Whether the sweeps can be of one motor; None for a single sweep, or if there is no doubt.
    spans_hz : dict
        Termination -> spans in which the closest model leaves more than noise.
    inspect : tuple of str
        Elements suggested for inspection, best first.
    """

    noise_multiple: dict[str, float]
    causality: CausalCheck
    together: SweepConsistency | None
    spans_hz: dict[str, list[list[float]]]
    inspect: tuple[str, ...]

    @property
    def reasons(self) -> tuple[str, ...]:
        """The findings in words."""
        said = list(self._of_the_data())
        reached = ", ".join(
            f"{t} {model.noise_multiple:.2g} times the noise with {model.order} poles (the closest model: {self.noise_multiple[t]:.3g})"
            for t, model in self.causality.models.items()
        )
        said.append(f"the best linear causal model of up to {MOST_POLES} poles reaches: {reached}")
        if not self.causality.causal and not self.causality.disproved:
            said += self.causality.reasons
        for termination, spans in self.spans_hz.items():
            if spans:
                said.append(f"left over in the {termination} sweep: {show_band(spans[0][0], spans[-1][1])}{_parts(spans)}")
        if self.inspect and not self.about_the_data:
            said.append(f"see what the element would have to be: motoremi inspect SESSION --element {self.inspect[0]}{self._others()}")
        return tuple(said)

    @property
    def about_the_data(self) -> bool:
        """Whether the data are at fault, not the model."""
        return self.causality.disproved or (self.together is not None and not self.together.belong)

    def _of_the_data(self) -> tuple[str, ...]:
        if self.causality.disproved:
            return self.causality.reasons
        if self.together is not None and not self.together.belong:
            return (self.together.sentence,)
        return ()

    def _others(self) -> str:
        return f" (or {', '.join(self.inspect[1:])})" if len(self.inspect) > 1 else ""

    def to_dict(self) -> JsonDict:
        """Plain data."""
        return {
            "noise_multiple": dict(self.noise_multiple),
            "causality": self.causality.to_dict(),
            "together": None if self.together is None else self.together.to_dict(),
            "spans_hz": {t: [list(span) for span in spans] for t, spans in self.spans_hz.items()},
            "inspect": list(self.inspect),
        }


def _parts(spans: list[list[float]]) -> str:
    return f" in {len(spans)} parts" if len(spans) > 1 else ""


def remainder(base: Fit, closest: Fit, sweeps_in_question: bool = True, each: Map = map) -> Remainder:
    """What is left unexplained.

    Parameters
    ----------
    base : Fit
        The model that was diagnosed.
    closest : Fit
        The best that the catalogue has.
    sweeps_in_question : bool
        Whether the sweeps may be of different motors; False if some circuit describes both.
    each : callable
        As the built-in `map`.
    """
    # Without a discrepancy: what it would describe is the error that remains.
    problem = closest.task.likelihood(None, AS_DECLARED)
    white = problem.whitened(problem.vector({**closest.parameters, **closest.nuisance}))
    multiple, spans = {}, {}
    for sweep in problem.observed.sweeps:
        own = white[problem.observed.slices[sweep.termination]]
        multiple[sweep.termination] = float(np.sqrt(np.mean(np.abs(own) ** 2) / 2))
        variance = smoothed(own)
        limit = max(LEFT_OVER, SHARE * float(variance.max()))
        spans[sweep.termination] = spans_of(sweep.frequency_hz, variance > limit)
    causality = check_causality(closest.measurement, multiple)
    together = check_sweep_consistency(base, each) if sweeps_in_question and not causality.disproved else None
    return Remainder(multiple, causality, together, spans, _to_inspect(closest))


def _to_inspect(fit: Fit) -> tuple[str, ...]:
    left = {element: roughly_freed(fit, element) for element in ELEMENTS if element in fit.parameters}
    best = min(left.values())
    return tuple(sorted((e for e, objective in left.items() if objective <= ALSO * best), key=lambda e: left[e]))
