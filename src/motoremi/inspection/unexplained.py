"""What to say where nothing in the catalogue explains the data: how far any linear circuit would get, where it is left over, where to look.

Three findings, in the order in which they matter: the data are not those of a fixed linear circuit (look at the measurement), the two
sweeps fit alone but not together (look at the files), or physics is missing (look at the element whose freedom would help most).
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
from motoremi.inspection.free_element import promise
from motoremi.inspection.sweep_consistency import Together, check_together
from motoremi.quantities import show_band
from motoremi.workers import Map

# Mean variance of whitened residuals, in a window of a few points, beyond which something is left over.
LEFT_OVER = 3.0
# Nor is anything left over where there is less than this share of what there is at most: elements that make up for it bend the rest a little.
SHARE = 0.05
# Elements whose freedom leaves no more than so many times what the best one's leaves are worth a look as well.
ALSO = 2.0


@dataclass(frozen=True, eq=False)
class Remainder:
    """What is left unexplained. Immutable.

    Parameters
    ----------
    noise_multiple : dict
        Termination -> error of the closest model in multiples of the random noise, with an analyser as declared.
    causality : CausalCheck
        What an unrestricted causal model reaches.
    together : Together or None
        Whether the sweeps belong together; None if there is one only, or if it is not in question.
    spans_hz : dict
        Termination -> spans in which the closest model leaves more than noise.
    inspect : tuple of str
        Elements worth a look, best first.
    """

    noise_multiple: dict[str, float]
    causality: CausalCheck
    together: Together | None
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
        """Whether the data, not the model, are what is wrong."""
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
        Whether the sweeps may be of different motors: not if any one circuit describes them both.
    each : callable
        As the built-in `map`.
    """
    # What the discrepancy would describe is what is left.
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
    together = check_together(base, each) if sweeps_in_question and not causality.disproved else None
    return Remainder(multiple, causality, together, spans, _worth_a_look(closest))


def _worth_a_look(fit: Fit) -> tuple[str, ...]:
    left = {element: promise(fit, element) for element in ELEMENTS if element in fit.parameters}
    best = min(left.values())
    return tuple(sorted((e for e, objective in left.items() if objective <= ALSO * best), key=lambda e: left[e]))
